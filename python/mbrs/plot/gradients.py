"""Figures of gradients of motions: tornado, sensitivities over time, convergence of an optimisation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import real_number
from ..errors import ModelError
from .figure import PALETTE, canvas, colours, figure, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["convergence", "over_time", "tornado"]


def tornado(
    result: Any,
    *,
    n: int = 30,
    change: float | Mapping[str, float] = 0.01,
    objective: int = 0,
    ax: Axes | None = None,
) -> Figure:
    """Bars of the first-order change of the objective for a change of each parameter, largest first.

    Parameters
    ----------
    result
        A `MotionGradient`.
    n
        How many parameters at most.
    change
        By how much each parameter changes: a part of its present value (0.01: one per cent), or {name: amount in its own unit},
        where the name of an array parameter means all of its entries; those not named change by one per cent.
    objective
        Which one, of several.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ModelError
        A name that is not a parameter of the gradient, a change that is not a number, an unknown objective.
    """
    rows = np.asarray(result.gradient).reshape(-1, len(result.labels))
    if not isinstance(objective, int) or not 0 <= objective < len(rows):
        raise ModelError(f"objective={objective!r}: the gradient has {len(rows)}, counted from 0")
    amounts, texts = _amounts(result, change)
    values = rows[objective] * amounts
    order = [i for i in np.argsort(-np.abs(values), kind="stable") if amounts[i] != 0.0][:n][::-1]
    names = [f"{result.labels[i]}  {texts[i]}" for i in order]
    with style():
        made, ax = canvas(ax, (7.5, 1.2 + 0.28 * len(order)))
        ax.barh(names, values[order], color=[PALETTE[0] if v >= 0 else PALETTE[1] for v in values[order]])
        ax.axvline(0.0, color="#9aa7b5", lw=0.8)
        ax.grid(axis="y", visible=False)
        value = np.atleast_1d(result.value)[objective]
        left_out = len(values) - len(order)
        more = f" ({left_out} smaller ones or zeros not shown)" if left_out else ""
        ax.set(xlabel="first-order change of the objective" + more, title=f"objective {value:.6g}")
        ax.margins(y=0.01)
    return made


def _amounts(result: Any, change: float | Mapping[str, float]) -> tuple[np.ndarray, list[str]]:
    """Change of every parameter, and the words for it."""
    part = 0.01 if isinstance(change, Mapping) else real_number("change", change)
    amounts = part * np.nan_to_num(np.abs(np.asarray(result.where, dtype=float)))
    texts = [f"+{100 * part:g} %"] * len(amounts)
    for name, amount in change.items() if isinstance(change, Mapping) else ():
        found = [i for i, label in enumerate(result.labels) if label == name or label.startswith(f"{name}[")]
        if not found:
            known = ", ".join(result.labels[:12]) + (", ..." if len(result.labels) > 12 else "")
            raise ModelError(f"change= names {name!r}, no parameter of this gradient; known: {known}")
        for i in found:
            amounts[i] = real_number(f"change[{name!r}]", amount)
            texts[i] = f"+{amounts[i]:g} {result.units[i]}".rstrip()
    return amounts, texts


def over_time(traj: Any, of: Any, *, ax: Axes | None = None) -> Figure:
    """The derivatives of a quantity of a trajectory over time: a panel for each parameter, a line for each component.

    ``of`` names the quantity as in `Trajectory.sensitivity`; with ``ax`` only the first parameter is drawn, there.
    """
    d = np.asarray(traj.sensitivity(of))
    labels, units = traj.parameter_labels, traj.parameter_units
    flat = d.reshape(len(traj.t), -1, len(labels))
    names, unit = traj.component_names(of), traj.unit_of(of)
    labels = labels if ax is None else labels[:1]
    across = 1 if len(labels) <= 3 else 2
    down = -(-len(labels) // across)
    with style():
        if ax is None:
            made, axes = figure(down, across, size=(8.0 if across == 1 else 10.0, 1.0 + 1.9 * down), sharex=True)
        else:
            made, axes = ax.figure, [ax]
        panels = np.ravel(axes)
        for p, label in enumerate(labels):
            for k, name in enumerate(names):
                panels[p].plot(traj.t, flat[:, k, p], label=name, color=PALETTE[k % len(PALETTE)])
            panels[p].set(ylabel=_per(unit, units[p]), title=f"by {label}")
            if p == 0 and len(names) > 1:
                legend(panels[p], names)
        for ax in panels[len(labels) :]:
            ax.set_visible(False)
        for ax in panels[max(0, len(labels) - across) : len(labels)]:
            ax.set(xlabel="t [s]")
            ax.tick_params(labelbottom=True)
        if ax is None:
            made.suptitle(f"derivatives of {of}")
    return made


def _per(unit: str, by: str) -> str:
    """The unit of a derivative; parameters of a model's own carry none."""
    if not unit:
        return f"[per {by}]" if by else ""
    if not by:
        return f"[{unit} per unit]"
    return f"[{unit} / ({by})]" if "/" in by or " " in by else f"[{unit}/{by}]"


def convergence(result: Any, *, ax: Axes | None = None, label: str | None = None) -> Figure:
    """The objective over the evaluations of an optimiser, and the least so far among designs that keep to the constraints.

    ``ax``, ``label``: axes for several runs in one picture, and what to call this one there.
    """
    with style():
        made, ax = canvas(ax, (7.0, 4.0))
        values, kept = np.asarray(result.history), np.asarray(result.kept)
        count = np.arange(1, len(values) + 1)
        names = ["evaluated", "least so far"] if label is None else ["_", label]
        points, line = colours(ax, 2) if label is None else 2 * colours(ax, 1)
        ax.plot(count[kept], values[kept], "o", color=points, ms=5, label=names[0])
        least = np.minimum.accumulate(np.where(kept, values, np.inf))
        ax.step(count, np.where(np.isfinite(least), least, np.nan), where="post", color=line, label=names[1])
        if not kept.all():
            names.append("constraints violated")
            ax.plot(count[~kept], values[~kept], "o", mfc="none", color="#6b7280", ms=5, label=names[2])
        if len(values) and np.all(values > 0.0) and values.max() > 20 * values.min():
            ax.set_yscale("log")
        ax.set(xlabel="evaluation", ylabel="objective", title=f"{result.status}: {result.value:.6g}")
        ax.locator_params(axis="x", integer=True)
        legend(ax)
    return made
