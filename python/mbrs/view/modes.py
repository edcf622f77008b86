"""Mode shapes as a viewer that moves: scene and modes become data in a page that needs nothing else."""

from __future__ import annotations

import base64
import json
import math
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.files import write_atomic
from .._lib.text import number
from ..errors import ModelError
from .document import document
from .scene import SceneGeometry
from .solids import body_solid

__all__ = ["Viewer", "modes"]

_DETAILED_BODIES = 400
_REACH = 0.1  # largest displacement drawn at amplitude 1, in sizes of the scene
_TURN = 0.6  # largest rotation drawn at amplitude 1, rad
_KINDS = {"spring_damper": 0, "bushing": 1, "torsion": 2}


@dataclass(frozen=True)
class Viewer:
    """A scene that moves, ready to be written or put on a page: ``data`` is what viewer.js draws."""

    title: str
    data: dict[str, Any]

    def fragment(self, height: str = "460px") -> str:
        """HTML for a page that has the assets of `Viewer.assets` once."""
        content = json.dumps(self.data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
        return (
            f'<div class="mbrs-scene" style="height:{height}"><script type="application/json">{content}</script></div>'
        )

    @staticmethod
    def assets() -> str:
        """Style and script that every page with viewers needs once, at its end."""
        start = (
            'document.querySelectorAll(".mbrs-scene").forEach((place) => {'
            'const scene = JSON.parse(place.querySelector("script").textContent);'
            "(scene.motion ? mbrsMotion : mbrsViewer)(place.appendChild(document.createElement('div')), scene);});"
        )
        style = _asset("viewer.css") + "\n.mbrs-scene > div { height: 100%; box-sizing: border-box; }"
        return f"<style>\n{style}\n</style>\n<script>\n{_asset('viewer.js')}\n{_asset('motion.js')}\n{start}\n</script>"

    def html(self) -> str:
        """One complete page."""
        return document(self.title, self.fragment("calc(100vh - 32px)") + self.assets(), wide=True)

    def write(self, path: str | Path) -> Path:
        """Write the page; an ending ``.html`` is usual. Returns the path."""
        return write_atomic(path, self.html().encode())

    def _repr_html_(self) -> str:
        import html

        style = "width:100%;height:520px;border:0"
        return f'<iframe style="{style}" srcdoc="{html.escape(self.html(), quote=True)}"></iframe>'


def modes(
    result: Any,
    path: str | Path | None = None,
    *,
    n: int = 30,
    select: int = 0,
    phase: float | None = None,
    title: str = "Modes",
) -> Any:
    """Mode shapes in motion: each body moves with Re(phi exp(i omega t)), its rotation included.

    Drawn at amplitude 1, the fastest point of a mode moves by a tenth of the size of the scene, but no body turns by
    more than 0.6 rad. All modes play at one pace, whatever their frequency. Cost O(bodies x modes).

    Parameters
    ----------
    result
        A `ModalResult` of a model: ``geometry`` (a `SceneGeometry`), ``body_shape(name)`` (6, n_modes) complex motion
        of the body's origin (x y z rx ry rz, world, m and rad), ``frequency`` (Hz), ``damping``.
    path
        File to write; None returns the `Viewer` instead, to be put on a page.
    n
        How many modes at most, from the first.
    select
        Index of the mode shown first, from 0.
    phase
        Start paused at this phase in rad; None plays.
    title
        Title of the page.

    Returns
    -------
    pathlib.Path or Viewer

    Raises
    ------
    ModelError
        Modes of plain matrices, which have no geometry; ``select`` outside the modes; no modes at all.
    """
    scene = getattr(result, "geometry", None)
    if scene is None:
        raise ModelError(
            "these modes come from plain matrices, which have no geometry to draw; use result.plot() instead"
        )
    count = min(int(n), int(np.size(result.frequency)))
    if count < 1:
        raise ModelError("there is no mode to draw; ask for at least one mode")
    if not 0 <= select < count:
        raise ModelError(f"select={select} is not among the {count} modes shown; it counts from 0")
    viewer = Viewer(title, _data(result, scene, count, select, phase))
    return viewer if path is None else viewer.write(path)


def _data(result: Any, scene: SceneGeometry, count: int, select: int, phase: float | None) -> dict[str, Any]:
    points, size = scene.points, scene.size
    shapes, solids = _shapes(result, scene, count), _bodies(scene)[2]
    return {
        **scene_data(scene, points.min(axis=0), points.max(axis=0)),
        "reach": _REACH * size,
        "modes": [_mode(result, i, _drawn(shapes[:, :, i], solids, size)) for i in range(count)],
        "start": select,
        "phase": phase,
    }


def scene_data(scene: SceneGeometry, low: np.ndarray, high: np.ndarray) -> dict[str, Any]:
    """Data for every viewer of a scene that stays within the box from ``low`` to ``high`` (3,), m."""
    bodies, faces, _ = _bodies(scene)
    index = {**scene.index, None: -1}
    size = float(np.linalg.norm(high - low)) or scene.size
    return {
        "size": size,
        "centre": _rounded(0.5 * (low + high), size),
        "floor": float(low[2] - 0.06 * size),
        "view": _view(high - low, size),
        "half": _rounded(0.5 * (high - low), size),
        "grain": _thickness(scene),
        "reach": 0.0,
        "bodies": bodies,
        "faces": faces,
        "links": [_link(one, index, size) for one in scene.links],
        "joints": [_joint(one, index, size) for one in scene.joints],
    }


def _bodies(scene: SceneGeometry) -> tuple[list[dict[str, Any]], list[list[list[int]]], list[np.ndarray]]:
    """Drawn bodies, the distinct lists of faces they share, and the vertices of each relative to its origin."""
    detailed = len(scene.bodies) <= _DETAILED_BODIES
    thickness = _thickness(scene)
    drawn: list[dict[str, Any]] = []
    known: dict[str, tuple[int, list[list[int]]]] = {}
    solids: list[np.ndarray] = []
    size = scene.size
    for body in scene.bodies:
        vertices, loops = body_solid(body.origin, body.rotation, body.points, thickness, detailed)
        key = json.dumps(loops)
        known.setdefault(key, (len(known), loops))
        solids.append(vertices)
        flat = _rounded(vertices.ravel(), size)
        drawn.append({"n": body.name, "o": _rounded(body.origin, size), "v": flat, "f": known[key][0]})
    return drawn, [loops for _, loops in known.values()], solids


def _thickness(scene: SceneGeometry) -> float:
    """Half the thickness of a link: a share of the scene, or of a typical body where there are many."""
    reach = [float(np.max(np.linalg.norm(b.points - b.origin, axis=1))) for b in scene.bodies if len(b.points)]
    typical = float(np.median(reach)) if reach else 0.0
    fallback = 0.3 * scene.size / max(len(scene.bodies), 1)
    return min(0.012 * scene.size, 0.12 * typical if typical > 0.0 else fallback)


def _shapes(result: Any, scene: SceneGeometry, count: int) -> np.ndarray:
    """Motion of all bodies, (n_bodies, 6, n_modes) complex."""
    out = np.zeros((len(scene.bodies), 6, count), dtype=complex)
    for i, body in enumerate(scene.bodies):
        shape = np.asarray(result.body_shape(body.name))
        if shape.ndim != 2 or shape.shape[0] != 6 or shape.shape[1] < count:
            raise ModelError(f"body_shape({body.name!r}) must be (6, {count} or more), got {shape.shape}")
        out[i] = shape[:, :count]
    return np.where(np.isfinite(out), out, 0.0)


def _drawn(shape: np.ndarray, solids: list[np.ndarray], size: float) -> np.ndarray:
    """The shape (n_bodies, 6) scaled for the eye, its phase turned so that the largest motion is real and positive."""
    travel = [np.abs(s[:3] + np.cross(s[3:], solid)) for s, solid in zip(shape, solids, strict=True)]
    largest = max((float(t.max()) for t in travel), default=0.0)
    turn = float(np.abs(shape[:, 3:]).max(initial=0.0))
    limits = [limit / value for limit, value in ((_REACH * size, largest), (_TURN, turn)) if value > 0.0]
    if not limits:
        return shape
    weighted = shape * np.array([1.0, 1.0, 1.0, size, size, size])
    pivot = weighted.flat[int(np.argmax(np.abs(weighted)))]
    return shape * (min(limits) * np.conj(pivot) / abs(pivot))


def _mode(result: Any, i: int, shape: np.ndarray) -> dict[str, Any]:
    values = np.empty((*shape.shape, 2), dtype="<f4")
    values[..., 0], values[..., 1] = shape.real, shape.imag
    damping = np.asarray(getattr(result, "damping", np.full(i + 1, math.nan)), dtype=float)[i]
    kind: Any = getattr(result, "kind", None)
    return {
        "label": str(i + 1),
        "f": number(float(np.asarray(result.frequency)[i]), 5),
        "zeta": number(float(damping), 3),
        "kind": str(np.asarray(kind)[i]) if np.ndim(kind) else str(kind or "mode"),
        "shape": base64.b64encode(values.tobytes()).decode("ascii"),
    }


def _link(link: Any, index: dict[str | None, int], size: float) -> list[Any]:
    return [
        _KINDS.get(link.kind, 0),
        index[link.a],
        index[link.b],
        *_rounded(link.at_a, size),
        *_rounded(link.at_b, size),
    ]


def _joint(joint: Any, index: dict[str | None, int], size: float) -> list[Any]:
    axis = None
    if joint.axis is not None and joint.kind not in ("fixed", "spherical", "free"):
        axis = _rounded(joint.axis / np.linalg.norm(joint.axis), 1.0)
    return [joint.kind, index[joint.a], index[joint.b], _rounded(joint.at, size), axis]


def _view(extent: np.ndarray, size: float) -> list[float]:
    """Azimuth and elevation of the first look: planar scenes are looked at almost squarely."""
    if extent[2] < 0.05 * size:
        return [-math.pi / 2 + 0.12, 1.05]
    if extent[1] < 0.05 * size:
        return [-math.pi / 2 + 0.3, 0.2]
    return [-math.pi / 2 + 0.6, 0.4]


def _rounded(values: Any, size: float) -> list[float]:
    """Coordinates to 1e-5 of the scene: the page is half as long and no eye sees the difference."""
    decimals = 5 - math.floor(math.log10(size))
    return [round(float(v), decimals) + 0.0 for v in np.ravel(values)]


def _asset(name: str) -> str:
    return files("mbrs.view").joinpath(name).read_text(encoding="utf-8")
