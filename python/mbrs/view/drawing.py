"""A scene as the data that viewer.js draws: bodies, solids, springs and symbols, sizes and the first look."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from .scene import COINCIDE, BodyGeometry, SceneGeometry
from .solids import body_solid
from .symbols import GLYPHS, Link, Mark, links, marks

__all__ = ["first_look", "grain", "rounded", "scene_data", "solids"]

_DETAILED_BODIES = 400
# A scene is flat across a direction in which it is thinner than this share of its size.
_FLAT = 0.05


def scene_data(scene: SceneGeometry, low: np.ndarray, high: np.ndarray) -> dict[str, Any]:
    """Data for every viewer of a scene that stays within the box from ``low`` to ``high`` (3,), m."""
    size = float(np.linalg.norm(high - low)) or scene.size
    index = {**scene.index, None: -1}
    thick = grain(scene)
    faces = _Faces()
    detailed = len(scene.bodies) <= _DETAILED_BODIES
    return {
        "size": size,
        "centre": rounded(0.5 * (low + high), size),
        "floor": float(low[2] - 0.06 * size),
        "view": first_look(high - low, size),
        "half": rounded(0.5 * (high - low), size),
        "grain": thick,
        "reach": 0.0,
        "bodies": [{"n": body.name, "o": rounded(body.origin, size)} for body in scene.bodies],
        "solids": [
            {
                "b": i,
                "v": rounded(vertices.ravel(), size),
                "f": faces.number(loops),
                **({"c": colour} if colour else {}),
            }
            for i, parts in enumerate(solids(scene))
            for vertices, loops, colour in parts
        ],
        "elastic": [{"n": b.name, "p": rounded(b.line.ravel(), size)} for b in scene.bodies if len(b.line) > 1],
        "links": [_link(one, index, size) for one in links(scene)],
        "marks": [_mark(one, index, size, faces) for one in marks(scene, thick)] if detailed else [],
        "faces": faces.loops,
        "glyphs": {name: [[list(p) for p in line] for line in lines] for name, lines in GLYPHS.items()},
    }


class _Faces:
    """The distinct lists of faces that solids share."""

    def __init__(self) -> None:
        self.loops: list[Any] = []
        self._known: dict[str, int] = {}

    def number(self, loops: Any) -> int:
        key = json.dumps([list(map(int, loop)) for loop in loops])
        if key not in self._known:
            self._known[key] = len(self.loops)
            self.loops.append(json.loads(key))
        return self._known[key]


def solids(scene: SceneGeometry) -> list[list[tuple[np.ndarray, Any, str]]]:
    """For each body (vertices relative to its origin, faces, colour): its shape, or a hull; none for a flexible one and its nodes, of
    which the line is drawn.
    """
    detailed, thick = len(scene.bodies) <= _DETAILED_BODIES, grain(scene)
    lined = {body.name for body in scene.bodies if len(body.line) > 1}
    return [
        [] if body.name.partition(".")[0] in lined and not body.solids else _of_body(body, thick, detailed)
        for body in scene.bodies
    ]


def _of_body(body: BodyGeometry, thick: float, detailed: bool) -> list[tuple[np.ndarray, Any, str]]:
    if body.solids:
        return [(solid.vertices - body.origin, solid.faces, solid.colour) for solid in body.solids]
    return [(*body_solid(body.origin, body.rotation, body.points, thick, detailed), "")]


def grain(scene: SceneGeometry) -> float:
    """Half the thickness of a link: a share of the scene, or of a typical body where there are many."""
    reach = [float(np.max(np.linalg.norm(b.extent - b.origin, axis=1))) for b in scene.bodies if len(b.extent) > 1]
    typical = float(np.median(reach)) if reach else 0.0
    fallback = 0.3 * scene.size / max(len(scene.bodies), 1)
    return min(0.012 * scene.size, 0.12 * typical if typical > COINCIDE * scene.size else fallback)


def _link(link: Link, index: dict[str | None, int], size: float) -> dict[str, Any]:
    return {
        "g": link.group,
        "n": link.label,
        "t": link.name,
        "a": index[link.a],
        "b": index[link.b],
        "p": rounded(link.at_a, size),
        "q": rounded(link.at_b, size),
        "k": list(link.parts),
    }


def _mark(mark: Mark, index: dict[str | None, int], size: float, faces: _Faces) -> dict[str, Any]:
    return {
        "g": mark.group,
        "n": mark.label,
        "t": mark.name,
        "b": index[mark.body],
        "o": rounded(mark.at, size),
        "w": int(mark.stays),
        "i": int(mark.filled),
        "s": [[rounded(vertices.ravel(), size), faces.number(loops)] for vertices, loops in mark.solids],
        "l": [rounded(line.ravel(), size) for line in mark.lines],
    }


def first_look(extent: np.ndarray, size: float) -> list[float]:
    """Azimuth and elevation (rad) of the first look: flat scenes are looked at almost squarely."""
    flat = extent < _FLAT * size
    if flat.sum() == 1:
        return [[0.3, 0.2], [-math.pi / 2 + 0.3, 0.2], [-math.pi / 2 + 0.12, 1.05]][int(np.argmax(flat))]
    return [-math.pi / 2 + 0.6, 0.4]


def rounded(values: Any, size: float) -> list[float]:
    """Coordinates to 1e-5 of the scene: the page is half as long and no eye sees the difference."""
    decimals = 5 - math.floor(math.log10(size))
    return [round(float(v), decimals) + 0.0 for v in np.ravel(values)]
