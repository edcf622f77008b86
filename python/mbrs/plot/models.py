"""Figures of a model in a state: equilibrium, steady motion, spanning tree."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..view.scene import SceneGeometry
from .figure import FADED, PALETTE, canvas, colours, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["equilibrium", "steady_motion", "system"]

_AXES = "xyz"
_SEEN = 0.1  # part of the model's size to which smaller displacements are enlarged
_SMALL = 0.02  # below this part of the size they are enlarged


def equilibrium(result: Any, *, ax: Axes | None = None) -> Figure:
    """The drawn model in grey and the equilibrium in colour, in the plane of the two world axes along which it is widest.

    Small displacements are enlarged by a round factor, which the title states.
    """
    drawn = result.linearization.snapshot.scene
    moved = result.linearization.geometry
    plane, size = _plane(drawn)
    shift = max((float(np.linalg.norm(a - b)) for a, b in _pairs(drawn, moved)), default=0.0)
    factor = _round(_SEEN * size / shift) if 1e-12 * size < shift < _SMALL * size else 1.0
    with style():
        made, axes = canvas(ax, (7.0, 5.6))
        _scene(axes, drawn, drawn, 1.0, plane, FADED, "drawn")
        _scene(axes, drawn, moved, factor, plane, colours(axes, 1)[0], "equilibrium")
        _square(axes, plane)
        enlarged = f", displacements x {factor:g}" if factor != 1.0 else ""
        axes.set_title(f"equilibrium of {result.model.name!r}{enlarged}")
        legend(axes)
    return made


def steady_motion(result: Any, *, ax: Axes | None = None) -> Figure:
    """The bodies in a steady motion with the velocities of their origins as arrows, and the driven speeds in the title."""
    scene = result.linearization.geometry
    plane, size = _plane(scene)
    velocity = np.asarray(result.poses["velocity"])[:, list(plane)]
    place = np.asarray(result.poses["position"])[:, list(plane)]
    fastest = float(np.linalg.norm(velocity, axis=1).max(initial=0.0))
    with style():
        made, axes = canvas(ax, (7.0, 5.6))
        colour, arrows = colours(axes, 2)
        _scene(axes, scene, scene, 1.0, plane, colour, "bodies")
        if fastest > 0.0:
            scale = fastest / (0.25 * size)
            axes.quiver(
                *place.T, *velocity.T, angles="xy", scale_units="xy", scale=scale, color=arrows, width=0.005, zorder=3
            )
            axes.plot([], [], color=arrows, label=f"velocity, longest {fastest:.3g} m/s")
            axes.update_datalim(place + velocity / scale)
        _square(axes, plane)
        units = result.speed_unit.tolist()
        speeds = ", ".join(
            f"{name} {v:.4g} {unit}" for (name, v), unit in zip(result.speed.items(), units, strict=True)
        )
        axes.set_title(f"steady motion: {speeds or 'nothing driven'}")
        legend(axes)
    return made


def system(result: Any, *, ax: Axes | None = None) -> Figure:
    """The spanning tree: bodies in columns by the number of joints to ground, tree joints as lines, joints that close loops
    dashed.
    """
    place = _layout(result.tree)
    with style():
        made, axes = canvas(ax, (2.2 + 1.7 * (1 + max(x for x, _ in place.values())), 4.4))
        for body, inner, joint, kind in result.tree:
            (x0, y0), (x1, y1) = place[inner], place[body]
            axes.plot([x0, x1], [y0, y1], color=FADED, zorder=1)
            if kind != "free":
                axes.annotate(joint or kind, (0.5 * (x0 + x1), 0.5 * (y0 + y1)), fontsize=8, color="#4b5968", ha="center",
                              bbox=dict(fc="white", ec="none", pad=1.0))  # fmt: skip
        for loop in result.loops:
            ends = [place[loop.bodies[0]], place[loop.bodies[-1]]]
            axes.plot(*zip(*ends, strict=True), "--", color=PALETTE[1], zorder=1, label="closes a loop")
            x, y = np.mean(ends, axis=0)
            axes.annotate(loop.joint, (x, y), fontsize=8, color=PALETTE[1], ha="center",
                          bbox=dict(fc="white", ec="none", pad=1.0))  # fmt: skip
        for name, (x, y) in place.items():
            own = PALETTE[7] if name == "ground" else PALETTE[0]
            axes.annotate(name, (x, y), ha="center", va="center", fontsize=9, color="white",
                          bbox=dict(boxstyle="round,pad=0.4", fc=own, ec="none"))  # fmt: skip
        axes.set(
            xticks=(),
            yticks=(),
            title=f"{result.name!r}: {result.dof} degree{'' if result.dof == 1 else 's'} of freedom",
        )
        axes.margins(0.2)
        axes.grid(visible=False)
        legend(axes)
    return made


def _layout(tree: Any) -> dict[str, tuple[float, float]]:
    """Column: joints to ground; the bodies of a column stand apart evenly."""
    depth = {"ground": 0}
    for body, inner, _, _ in tree:
        depth[body] = depth[inner] + 1
    columns: dict[int, list[str]] = {}
    for name, d in depth.items():
        columns.setdefault(d, []).append(name)
    # neighbours of a column alternate a little, so that joints to farther columns do not hide behind bodies
    return {
        name: (float(d), 0.5 * (len(names) - 1) - i + 0.15 * (d % 2))
        for d, names in columns.items()
        for i, name in enumerate(names)
    }


def _plane(scene: SceneGeometry) -> tuple[tuple[int, int], float]:
    """The two world axes along which a scene is widest, in their order, and its size."""
    points = scene.points
    width = np.ptp(points, axis=0) if len(points) else np.ones(3)
    first, second = sorted(int(i) for i in np.argsort(-width, kind="stable")[:2])
    return (first, second), float(np.linalg.norm(width)) or 1.0


def _pairs(drawn: SceneGeometry, moved: SceneGeometry) -> list[tuple[np.ndarray, np.ndarray]]:
    pairs = [(a.origin, b.origin) for a, b in zip(drawn.bodies, moved.bodies, strict=True)]
    return pairs + [
        (p, q) for a, b in zip(drawn.bodies, moved.bodies, strict=True) for p, q in zip(a.points, b.points, strict=True)
    ]


def _round(factor: float) -> float:
    """The largest of 1, 2, 5, 10, ... below a factor."""
    power = 10.0 ** np.floor(np.log10(factor))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= factor * (1.0 + 1e-9)))


def _scene(
    axes: Any,
    drawn: SceneGeometry,
    moved: SceneGeometry,
    factor: float,
    plane: tuple[int, int],
    colour: str,
    label: str,
) -> None:
    """Bodies as lines from their origins to what is attached, springs thin, joints as rings."""

    def seen(a: Any, b: Any) -> np.ndarray:
        return (np.asarray(a) + factor * (np.asarray(b) - np.asarray(a)))[..., list(plane)]

    for i, (one, other) in enumerate(zip(drawn.bodies, moved.bodies, strict=True)):
        origin = seen(one.origin, other.origin)
        axes.plot(*origin, "o", color=colour, ms=6, mew=0, label=label if i == 0 else None)
        for p, q in zip(one.points, other.points, strict=True):
            axes.plot(*zip(origin, seen(p, q), strict=True), color=colour, lw=2.2)
    for a, b in zip(drawn.links, moved.links, strict=True):
        ends = [seen(a.at_a, b.at_a), seen(a.at_b, b.at_b)]
        axes.plot(*zip(*ends, strict=True), color=colour, lw=1.0, ls=":")
    for joint, after in zip(drawn.joints, moved.joints, strict=True):
        axes.plot(*seen(joint.at, after.at), "o", mfc="white", mec=colour, ms=6)


def _square(axes: Any, plane: tuple[int, int]) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)
    axes.set(xlabel=f"{_AXES[plane[0]]} [m]", ylabel=f"{_AXES[plane[1]]} [m]")
