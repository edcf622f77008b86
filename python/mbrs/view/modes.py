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
from .drawing import scene_data, solids
from .scene import SceneGeometry

__all__ = ["Viewer", "modes"]

_REACH = 0.1  # largest displacement drawn at amplitude 1, in sizes of the scene
_LINE = 25  # points of the line of a flexible body
_TURN = 0.6  # largest rotation drawn at amplitude 1, rad


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
            "(scene.motion ? mbrsMotion : scene.modes ? mbrsViewer : mbrsStill)"
            "(place.appendChild(document.createElement('div')), scene);});"
        )
        style = _asset("viewer.css") + "\n.mbrs-scene > div { height: 100%; box-sizing: border-box; }"
        script = "\n".join(_asset(name) for name in ("viewer.js", "motion.js", "still.js"))
        return f"<style>\n{style}\n</style>\n<script>\n{script}\n{start}\n</script>"

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
    select: int | None = None,
    phase: float | None = None,
    title: str = "Modes",
) -> Path | Viewer:
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
        Index of the mode shown first, from 0; by default the first that is not rigid.
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
    if select is None:
        select = int(np.argmax(np.asarray(result.frequency, dtype=float)[:count] > 0.0))
    if not 0 <= select < count:
        raise ModelError(f"select={select} is not among the {count} modes shown; it counts from 0")
    viewer = Viewer(title, _data(result, scene, count, select, phase))
    return viewer if path is None else viewer.write(path)


def _data(result: Any, scene: SceneGeometry, count: int, select: int, phase: float | None) -> dict[str, Any]:
    points, size = scene.points, scene.size
    shapes, lines = _shapes(result, scene, count), _lines(result, scene, count)
    vertices = [np.vstack([[[0.0] * 3], *(part[0] for part in parts)]) for parts in solids(scene)]
    drawn = [_drawn(shapes[:, :, i], vertices, [line[..., i] for line in lines.values()], size) for i in range(count)]
    return {
        **scene_data(scene, points.min(axis=0), points.max(axis=0)),
        "reach": _REACH * size,
        "modes": [
            {
                **_mode(result, i, shapes[:, :, i] * factor),
                "elastic": [_packed(line[..., i] * factor) for line in lines.values()],
            }
            for i, factor in enumerate(drawn)
        ],
        "start": select,
        "phase": phase,
    }


def _shapes(result: Any, scene: SceneGeometry, count: int) -> np.ndarray:
    """Motion of all bodies, (n_bodies, 6, n_modes) complex."""
    out = np.zeros((len(scene.bodies), 6, count), dtype=complex)
    for i, body in enumerate(scene.bodies):
        shape = np.asarray(result.body_shape(body.name))
        if shape.ndim != 2 or shape.shape[0] != 6 or shape.shape[1] < count:
            raise ModelError(f"body_shape({body.name!r}) must be (6, {count} or more), got {shape.shape}")
        out[i] = shape[:, :count]
    return np.where(np.isfinite(out), out, 0.0)


def _lines(result: Any, scene: SceneGeometry, count: int) -> dict[str, np.ndarray]:
    """Motion of the lines of flexible bodies by name, (k, 3, n_modes) complex: of their frames, and of their shapes."""
    out = {}
    model, names = getattr(result.system, "model", None) if hasattr(result, "system") else None, None
    for body in scene.bodies:
        if len(body.line) < 2:
            continue
        motion = np.asarray(result.body_shape(body.name))[:, :count]
        arm = body.line - body.origin
        moved = motion[None, :3] + np.cross(motion[3:].T[None], arm[:, None, :], axis=-1).transpose(0, 2, 1)
        names = list(result.coordinates) if names is None else names
        rows = [k for k, name in enumerate(names) if name.startswith(f"{body.name}.q")]
        if rows and model is not None:
            modal = model[body.name].modal
            bent = modal.line_shape[line_points(modal), :3] @ np.asarray(result.shape)[rows][:, :count]
            moved = moved + body.rotation @ bent
        out[body.name] = np.where(np.isfinite(moved), moved, 0.0)
    return out


def _drawn(shape: np.ndarray, solids: list[np.ndarray], lines: list[np.ndarray], size: float) -> complex:
    """The factor that scales a shape (n_bodies, 6) for the eye, and makes the largest motion real and positive."""
    travel = [s[:3] + np.cross(s[3:], solid) for s, solid in zip(shape, solids, strict=True)]
    largest = max((_longest(t) for t in (*travel, *lines)), default=0.0)
    turn = _longest(shape[:, 3:])
    limits = [limit / value for limit, value in ((_REACH * size, largest), (_TURN, turn)) if value > 0.0]
    if not limits:
        return 1.0
    weighted = shape * np.array([1.0, 1.0, 1.0, size, size, size])
    every = np.concatenate([weighted.ravel(), *(line.ravel() for line in lines)])
    pivot = every[int(np.argmax(np.abs(every)))]
    return complex(min(limits) * np.conj(pivot) / abs(pivot))


def _longest(vectors: np.ndarray) -> float:
    """The largest length of complex vectors (..., 3), in whatever direction."""
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))


def line_points(modal: Any) -> np.ndarray:
    """Indices of the points of a flexible body's line that pictures show."""
    return np.unique(np.linspace(0, len(modal.line_position) - 1, _LINE).astype(int))


def _mode(result: Any, i: int, shape: np.ndarray) -> dict[str, Any]:
    damping = np.asarray(getattr(result, "damping", np.full(i + 1, math.nan)), dtype=float)[i]
    kind: Any = getattr(result, "kind", None)
    return {
        "label": str(i + 1),
        "f": number(float(np.asarray(result.frequency)[i]), 5),
        "zeta": number(float(damping), 3),
        "kind": str(np.asarray(kind)[i]) if np.ndim(kind) else str(kind or "mode"),
        "shape": _packed(shape),
    }


def _packed(values: np.ndarray) -> str:
    """Complex numbers as pairs of single precision."""
    pairs = np.stack([values.real, values.imag], axis=-1).astype("<f4")
    return base64.b64encode(np.ascontiguousarray(pairs).tobytes()).decode("ascii")


def _asset(name: str) -> str:
    return files("mbrs.view").joinpath(name).read_text(encoding="utf-8")
