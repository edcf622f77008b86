"""Figures of a motion: coordinates, energy, residuals of constraints, step sizes and their errors, reactions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import shown
from ..errors import ModelError
from .figure import PALETTE, canvas, colours, figure, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot"]

_MOST_CURVES = 8
_FLOOR = 1e-18  # zero, on a logarithmic axis
_CHANGES = 1e-12  # of the largest component: one that changes less is not drawn
# endings of the names of a joint's free coordinates and True for angles, by type (docs/tables.md)
_FREEDOMS: tuple[tuple[tuple[str, bool], ...], ...] = (
    (),
    (("", True),),
    (("", False),),
    ((".z", False), (".rz", True)),
    ((".alpha", True), (".beta", True)),
    ((".rx", True), (".ry", True), (".rz", True)),
    ((".x", False), (".y", False), (".rz", True)),
    ((".x", False), (".y", False), (".z", False), (".rx", True), (".ry", True), (".rz", True)),
    (),
    (),
    (),
)


@dataclass(frozen=True, eq=False)
class Series:
    """A quantity over time."""

    label: str
    value: np.ndarray


@dataclass(frozen=True)
class Panel:
    """One pair of axes: its title, the unit of its ordinate, and what draws it."""

    title: str
    ylabel: str
    draw: Callable[[Any], None]
    height: float = 1.0


def plot(
    traj: Any, what: str = "motion", *, of: Any = None, ax: Axes | None = None, label: str | None = None
) -> Figure:
    """Curves over time.

    Parameters
    ----------
    traj
        A `Trajectory`.
    what
        "motion": coordinates, energy, constraints and steps below each other. One of them alone: "coordinates" (of
        joints), "positions" (of bodies and markers, world, m), "velocities" (of bodies, m/s), "energy" (J), "power" (W
        into each element), "residual" (residuals of constraints, scaled, on three levels), "steps" (their length,
        s), "error" (local error of each step over its tolerance), "reactions" (forces of joints, N).
    of
        Names or handles of joints, bodies, markers or elements; by default those that move most, at most eight curves.
    ax, label
        Axes for several motions in one picture, into which the first of these goes alone, and what to call this motion there.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ModelError
        An unknown ``what``; nothing to draw.
    """
    if of is not None and not (_single(of) or isinstance(of, Sequence)):
        raise ModelError(f"of= takes names or handles of joints, bodies, markers or elements, got {shown(of)}")
    chosen = None if of is None else [str(getattr(one, "name", one)) for one in ([of] if _single(of) else of)]
    makers: dict[str, Callable[[], list[Panel]]] = {
        "motion": lambda: _overview(traj, chosen),
        "coordinates": lambda: coordinates(traj, chosen),
        "positions": lambda: positions(traj, chosen),
        "velocities": lambda: velocities(traj, chosen),
        "energy": lambda: [energy(traj)],
        "power": lambda: [power(traj, chosen)],
        "residual": lambda: [residual(traj)],
        "steps": lambda: [steps(traj)],
        "error": lambda: [error(traj)],
        "reactions": lambda: [reactions(traj, chosen)],
    }
    if what not in makers:
        raise ModelError(f"there is no plot {what!r} of a motion; known are {', '.join(makers)}")
    if len(traj.t) == 0:
        raise ModelError("this motion has no outputs to plot")
    panels = makers[what]()
    if not panels:
        raise ModelError(f"there is nothing to plot for {what!r}: no such coordinate; try 'positions'")
    if ax is not None:
        panels = panels[:1]
    heights = [p.height for p in panels]
    with style():
        if ax is not None:
            _draw(panels[0], ax, label)
            ax.set_xlabel("time [s]")
            return canvas(ax)[0]
        made, axes = figure(
            len(panels), 1, size=(8.6, 0.8 + 2.3 * sum(heights)), sharex=True, squeeze=False, height_ratios=heights
        )
        for panel, ax in zip(panels, axes[:, 0], strict=True):
            _draw(panel, ax, label)
        axes[-1, 0].set_xlabel("time [s]")
    return made


def _draw(panel: Panel, ax: Any, label: str | None) -> None:
    before = len(ax.lines)
    panel.draw(ax)
    if label is not None:
        for line in ax.lines[before:]:
            if not line.get_label().startswith("_"):
                line.set_label(f"{label}: {line.get_label()}")
        legend(ax)
    ax.set(title=panel.title, ylabel=panel.ylabel)


def energies(energy: Any, *, ax: Axes | None = None) -> Figure:
    """Energies of a motion over time."""
    parts = {"total": energy.total, "kinetic": energy.kinetic, "gravity": energy.gravity, **energy.stored}
    kept = {name: value for name, value in parts.items() if np.any(value != 0.0)} or {"total": energy.total}
    with style():
        made, axes = canvas(ax)
        for (name, value), colour in zip(kept.items(), colours(axes, len(kept)), strict=True):
            axes.plot(energy.time, value, color=colour, label=name)
        axes.set(xlabel="t [s]", ylabel="energy [J]", title="energy")
        legend(axes)
    return made


def _single(of: Any) -> bool:
    return isinstance(of, str) or hasattr(of, "name")


def _overview(traj: Any, chosen: list[str] | None) -> list[Panel]:
    panels = coordinates(traj, chosen) or positions(traj, chosen)
    panels.append(energy(traj))
    if np.any(np.asarray(traj.residual) > 0.0):
        panels.append(residual(traj))
    return [*panels, steps(traj)]


def coordinates(traj: Any, chosen: list[str] | None = None) -> list[Panel]:
    """Angles and lengths of joints, apart."""
    t = traj.snapshot.tables
    groups: dict[bool, list[Series]] = {True: [], False: []}
    for name, kind in zip(t["joint_name"], t["joint_type"], strict=True):
        freedoms = _FREEDOMS[int(kind)]
        if not freedoms or (chosen is not None and name not in chosen):
            continue
        values = np.asarray(traj.joint(name)).reshape(len(traj.t), -1)
        for k, (ending, angle) in enumerate(freedoms):
            groups[angle].append(Series(f"{name}{ending}", values[:, k]))
    titles = {True: ("angles of joints", "angle [rad]"), False: ("displacements in joints", "displacement [m]")}
    return [_lines(traj, *titles[angle], groups[angle]) for angle in (True, False) if groups[angle]]


def positions(traj: Any, chosen: list[str] | None = None) -> list[Panel]:
    """World positions of bodies and markers."""
    markers = [str(n) for n in traj.snapshot.tables["marker_name"]]
    names = chosen if chosen is not None else [*traj.bodies, *markers]
    places = {name: traj.point(name) if name in markers else traj.position(name) for name in names}
    return [_lines(traj, "positions", "position [m]", _axes_of(places))] if places else []


def velocities(traj: Any, chosen: list[str] | None = None) -> list[Panel]:
    """World velocities of bodies."""
    found = {name: traj.velocity(name) for name in (traj.bodies if chosen is None else chosen)}
    return [_lines(traj, "velocities", "velocity [m/s]", _axes_of(found))] if found else []


def _axes_of(vectors: dict[str, np.ndarray]) -> list[Series]:
    """Components that change at all."""
    series = [Series(f"{name}.{axis}", v[:, k]) for name, v in vectors.items() for k, axis in enumerate("xyz")]
    largest = max(float(np.max(np.abs(s.value), initial=0.0)) for s in series)
    return [s for s in series if np.ptp(s.value) > _CHANGES * largest] or series[:3]


def _lines(traj: Any, title: str, ylabel: str, series: Sequence[Series]) -> Panel:
    """The curves that range most; the title says how many are left out."""
    ranked = sorted(series, key=lambda s: -float(np.ptp(s.value)))[:_MOST_CURVES]
    kept = [s for s in series if any(s is r for r in ranked)]
    if len(kept) < len(series):
        title += f" ({len(kept)} of {len(series)} that change most)"

    def draw(ax: Any) -> None:
        for s, colour in zip(kept, colours(ax, len(kept)), strict=True):
            ax.plot(traj.t, s.value, _mark(traj), color=colour, label=s.label, ms=4)
        legend(ax, [s.label for s in kept])

    return Panel(title, ylabel, draw, 1.3)


def _mark(traj: Any) -> str:
    """Long steps of a high order leave few outputs: dots say that the lines between them are only a help to the eye."""
    return ".-" if len(traj.t) <= 80 else "-"


def energy(traj: Any) -> Panel:
    """Kinetic energy, that of weight, of all springs together, and the sum."""
    e = traj.energy
    parts = [Series("kinetic", e.kinetic)]
    if np.any(e.gravity != 0.0):
        parts.append(Series("weight", e.gravity))
    if e.stored:
        parts.append(Series("springs", np.sum(list(e.stored.values()), axis=0)))

    def draw(ax: Any) -> None:
        for i, s in enumerate(parts):
            ax.plot(traj.t, s.value, _mark(traj), color=PALETTE[i], label=s.label, lw=1.2, ms=4)
        ax.plot(traj.t, e.total, color="#1d2733", lw=1.8, label="total")
        legend(ax, [*(s.label for s in parts), "total"])

    drift = float(np.ptp(e.total))
    return Panel(f"energy (the total ranges over {drift:.2g} J)", "energy [J]", draw)


def power(traj: Any, chosen: list[str] | None = None) -> Panel:
    """Power that each element takes out of the motion."""
    found = [Series(n, p) for n, p in traj.energy.power.items() if chosen is None or n in chosen]
    if not found:
        raise ModelError("there is no element that takes power; see print(model)")
    return _lines(traj, "power taken by elements", "power [W]", found)


def residual(traj: Any) -> Panel:
    """Position, velocity and acceleration level on a logarithmic axis; zeros at its foot."""
    value = np.maximum(np.asarray(traj.residual, dtype=float), _FLOOR)
    levels = ("position", "velocity", "acceleration")

    def draw(ax: Any) -> None:
        for k, level in enumerate(levels):
            ax.semilogy(traj.t, value[:, k], color=PALETTE[k], label=level, lw=1.1)
        ax.set_ylim(max(_FLOOR, 0.3 * float(value.min())), 10.0 * float(value.max()))
        legend(ax, levels)

    return Panel("residuals of the constraints (scaled by the characteristic length)", "residual", draw)


def steps(traj: Any) -> Panel:
    """Length of every accepted step."""
    t = np.asarray(traj.steps, dtype=float)

    rejected = traj.stats.counts.get("rejected steps", 0)
    note = f"{traj.method}, {max(len(t) - 1, 0)} steps" + (f", {rejected} rejected" if rejected else "")

    def draw(ax: Any) -> None:
        if len(t) > 1:
            ax.step(t, np.append(np.diff(t), np.diff(t)[-1:]), where="post", color=PALETTE[0])
            if np.ptp(np.diff(t)) > 1e-9 * (t[-1] - t[0]):
                ax.set_yscale("log")
            else:  # equal steps but for rounding, which is not worth a picture
                ax.set_ylim(0.0, 1.3 * float(np.diff(t).max()))

    return Panel(f"length of steps ({note})", "step [s]", draw)


def error(traj: Any) -> Panel:
    """Estimated local error over the tolerance, at the end of each step."""
    t, value = np.asarray(traj.steps, dtype=float), np.asarray(traj.local_error, dtype=float)
    if not np.any(value > 0.0):
        raise ModelError("this motion was made in fixed steps, which have no local errors; simulate with rtol=")
    ends = t[-value.size :]

    def draw(ax: Any) -> None:
        ax.semilogy(ends, np.maximum(value, _FLOOR), ".", color=PALETTE[1], ms=5)
        ax.axhline(1.0, color="#9aa7b5", lw=1.0)
        ax.set_ylim(top=max(5.0, 2.0 * float(value.max())))
        ax.text(ends[0], 1.1, "tolerance", fontsize=8.5, color="#4b5968", va="bottom")

    return Panel("estimated local error of each step", "error / tolerance", draw)


def reactions(traj: Any, chosen: list[str] | None = None) -> Panel:
    """Size of the reaction force of every joint."""
    names = chosen if chosen is not None else [str(n) for n in traj.snapshot.tables["joint_name"]]
    if not names:
        raise ModelError("this model has no joints, so no reactions")
    found = [Series(name, np.linalg.norm(traj.reaction(name)[:, :3], axis=1)) for name in names]
    return _lines(traj, "forces in joints", "|force| [N]", found)
