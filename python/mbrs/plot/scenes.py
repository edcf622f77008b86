"""Figures of a model as it was drawn: bodies, joints by their kind, springs, ground, loads, as pages draw them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import UNFIT, shown
from ..errors import ModelError
from ..view.drawing import first_look, grain, solids
from ..view.scene import SceneGeometry
from ..view.symbols import GLYPHS, Link, links, marks
from .figure import canvas, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["scene"]

_BODIES = ("#6f8fb0", "#8fae7f", "#c9a36a", "#9d8bb8", "#7fb0ad", "#b98a84", "#a3a16b", "#8696a3")
_FILL = {"joint": "#c0392b", "spring": "#9aa5b1", "load": "#7d3c98"}
_EDGE = {"joint": "#8e2b20", "spring": "#3b4757", "load": "#6c2e86"}
_TRIAD = ("#c0392b", "#27865a", "#2a5db0")
_PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
_NAME = 8.0  # size of names, points
_FEW = 30  # objects, up to which all names are written
_ROUND = 30  # vertices above which a solid is drawn without edges
_LIGHT = np.array([-0.4, 0.5, 0.77])


@dataclass(frozen=True)
class _Eye:
    """A parallel projection: rows are right, up, towards the eye. ``plane``: the two world axes that it shows squarely, or None."""

    axes: np.ndarray
    plane: tuple[int, int] | None

    def __call__(self, points: Any) -> np.ndarray:
        return np.asarray(points, dtype=float) @ self.axes.T


def scene(
    drawn: SceneGeometry, title: str = "", *, view: Any = None, names: bool | None = None, ax: Axes | None = None
) -> Figure:
    """Draw a scene as one sees it from far away.

    Parameters
    ----------
    drawn
        What to draw.
    title
        Above it.
    view
        "xy", "xz", "yz", or (azimuth, elevation) in rad of the eye; by default a flat scene squarely, others from above.
    names
        Write the names of objects; by default where there are at most 30.
    ax
        Axes to draw into; a figure of its own by default.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ModelError
        Another ``view``.
    """
    eye = _eye(view, drawn)
    thick = grain(drawn)
    few = len(drawn.bodies) + len(drawn.joints) + len(drawn.links) + len(drawn.loads) <= _FEW
    with style():
        made, axes = canvas(ax, (7.6, 5.6))
        painter = _Painter(axes, eye)
        _bodies(painter, drawn)
        for link in links(drawn):
            _link(painter, link, 1.4 * thick)
        for mark in marks(drawn, thick):
            base = _FILL[mark.group] if mark.filled else "#f4f6f8" if mark.group == "joint" else _FILL[mark.group]
            lift = drawn.size if mark.group == "load" else 3.0 * thick
            for vertices, faces in mark.solids:
                painter.solid(mark.at + vertices, faces, base, _EDGE[mark.group], lift)
            for line in mark.lines:
                painter.line(mark.at + line, _EDGE[mark.group], 2.0 if mark.group == "load" else 0.9, lift)
        painter.paint()
        _frame(axes, eye)
        if few if names is None else names:
            _names(axes, eye, drawn, 3.0 * thick)
        axes.set_title(title)
    return made


def _eye(view: Any, drawn: SceneGeometry) -> _Eye:
    extent = np.ptp(drawn.points, axis=0)
    flat = extent < 0.02 * drawn.size
    if view is None and flat.sum() == 1:
        view = "".join(letter for letter, thin in zip("xyz", flat, strict=True) if not thin)
    if isinstance(view, str) and view in _PLANES:
        i, j = _PLANES[view]
        right, up = np.eye(3)[i], np.eye(3)[j]
        return _Eye(np.array([right, up, np.cross(right, up)]), (i, j))
    if view is None:
        view = first_look(extent, drawn.size)
    try:
        azimuth, elevation = (float(v) for v in view)
        good = math.isfinite(azimuth) and math.isfinite(elevation)
    except UNFIT:
        good = False
    if not good:
        raise ModelError(f"view= must be 'xy', 'xz', 'yz' or (azimuth, elevation) in rad, got {shown(view)}")
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    return _Eye(np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]]), None)


class _Painter:
    """Collects faces and lines and draws them from back to front."""

    def __init__(self, axes: Any, eye: _Eye) -> None:
        self.axes, self.eye = axes, eye
        self.items: list[tuple[float, Any]] = []

    def solid(self, vertices: Any, faces: Iterable[Sequence[int]], base: str, edge: str, lift: float = 0.0) -> None:
        from matplotlib.colors import to_rgb
        from matplotlib.patches import Polygon

        seen = self.eye(vertices)
        for face in faces:
            loop = seen[list(face)]
            normal = np.cross(loop, np.roll(loop, -1, axis=0)).sum(axis=0)
            size = float(np.linalg.norm(normal))
            if size == 0.0 or normal[2] <= 1e-9 * size:
                continue
            shade = 0.62 + 0.5 * max(0.0, float(normal @ _LIGHT) / size)
            colour = np.minimum(np.array(to_rgb(base)) * shade, 1.0)
            patch = Polygon(loop[:, :2], closed=True, fc=colour, ec=edge or colour, lw=0.5, joinstyle="round")
            self.items.append((float(loop[:, 2].mean()) + lift, patch))

    def line(self, points: Any, colour: str, width: float, lift: float = 0.0) -> None:
        from matplotlib.lines import Line2D

        seen = self.eye(points)
        for k in range(len(seen) - 1):
            two = seen[k : k + 2]
            drawn = Line2D(two[:, 0], two[:, 1], color=colour, lw=width, solid_capstyle="round")
            self.items.append((float(two[:, 2].mean()) + lift, drawn))

    def paint(self) -> None:
        from matplotlib.lines import Line2D

        for rank, (_, item) in enumerate(sorted(self.items, key=lambda one: one[0])):
            item.set_zorder(2.0 + rank / (len(self.items) + 1))
            (self.axes.add_line if isinstance(item, Line2D) else self.axes.add_patch)(item)
        self.axes.autoscale_view()


def _bodies(painter: _Painter, drawn: SceneGeometry) -> None:
    for i, (body, parts) in enumerate(zip(drawn.bodies, solids(drawn), strict=True)):
        for vertices, faces, colour in parts:
            edge = "" if len(vertices) > _ROUND else "#3f4c5a"
            painter.solid(body.origin + vertices, faces, colour or _BODIES[i % len(_BODIES)], edge)
        if len(body.line) > 1:
            painter.line(body.line, "#3f8c96", 4.0)


def _link(painter: _Painter, link: Link, width: float) -> None:
    """Symbols between two points, beside each other in the plane of the picture."""
    ends = painter.eye([link.at_a, link.at_b])
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along[:2]))
    colour = _EDGE[link.group]
    parts = [part for part in link.parts if part != "bushing"]
    if length > width:
        across = np.array([-along[1], along[0], 0.0]) * width / length

        def to(points: Iterable[tuple[float, float]], shift: float, apart: bool) -> np.ndarray:
            return np.array(
                [ends[0] + (0.1 + 0.8 * t if apart else t) * along + (s + shift) * across for t, s in points]
            )

        apart = len(parts) > 1
        for k, part in enumerate(parts):
            shift = 2.6 * (k - (len(parts) - 1) / 2.0) if apart else 0.0
            for line in GLYPHS[part]:
                _flat(painter, to(line, shift, apart), colour, 2.2 if part == "rod" else 1.1)
        half = 1.3 * (len(parts) - 1)
        for line in [
            [(0.0, 0.0), (0.1, 0.0)],
            [(0.9, 0.0), (1.0, 0.0)],
            *([(t, -half), (t, half)] for t in (0.1, 0.9)),
        ]:
            if apart:
                _flat(painter, to(line, 0.0, False), colour, 1.1)
    if "bushing" in link.parts:
        middle, w = ends.mean(axis=0) + [0.0, 0.0, 3.0 * width], 1.4 * width
        square = middle + w * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
        for pick in ([0, 1, 2, 3, 0], [0, 2], [1, 3]):
            _flat(painter, square[pick], colour, 1.1)


def _flat(painter: _Painter, seen: np.ndarray, colour: str, width: float) -> None:
    """A line that is projected already."""
    from matplotlib.lines import Line2D

    drawn = Line2D(seen[:, 0], seen[:, 1], color=colour, lw=width, solid_capstyle="round", solid_joinstyle="round")
    painter.items.append((float(seen[:, 2].mean()), drawn))


def _names(axes: Any, eye: _Eye, drawn: SceneGeometry, gap: float) -> None:
    told = [(body.name, body.origin, "#1d2733") for body in drawn.bodies]
    told += [(joint.name, joint.place, _EDGE["joint"]) for joint in drawn.joints]
    told += [(link.name, 0.5 * (link.at_a + link.at_b), _EDGE["spring"]) for link in drawn.links]
    told += [(load.name, load.at, _EDGE["load"]) for load in drawn.loads]
    used: list[np.ndarray] = []
    # a name that would have to go far away from its object is left out
    most = 6
    step = _height_of_text(axes)
    for name, at, colour in told:
        place = eye(at)[:2] + [gap, gap]
        tries = 0
        while tries <= most and any(abs(place[1] - p[1]) < step and abs(place[0] - p[0]) < 3.5 * step for p in used):
            place, tries = place - [0.0, 1.05 * step], tries + 1
        if tries > most:
            continue
        used.append(place)
        axes.annotate(
            name, place, fontsize=_NAME, color=colour, zorder=5, va="center",
            bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.7},
        )  # fmt: skip


def _height_of_text(axes: Any) -> float:
    """Height of a line of names, in units of the axes."""
    axes.autoscale_view()
    axes.apply_aspect()
    low, high = axes.transData.inverted().transform([(0.0, 0.0), (0.0, 1.3 * _NAME / 72.0 * axes.figure.dpi)])
    return float(high[1] - low[1])


def _frame(axes: Any, eye: _Eye) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    if eye.plane is not None:
        axes.set(xlabel=f"{'xyz'[eye.plane[0]]} [m]", ylabel=f"{'xyz'[eye.plane[1]]} [m]")
        return
    axes.set(xlabel="[m]", ylabel="[m]")
    inset = axes.inset_axes((0.0, 0.0, 0.14, 0.14))
    inset.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
    inset.axis("off")
    for k in np.argsort(eye.axes[2]):
        tip = eye.axes[:2, k]
        inset.annotate("", tip, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": _TRIAD[k], "lw": 1.4})
        inset.annotate("xyz"[k], 1.25 * tip, color=_TRIAD[k], fontsize=9, ha="center", va="center")
