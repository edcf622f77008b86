"""Figures of sensitivities and studies: tornado, error against time, effects."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .data import tornado_bars
from .figure import FADED, PALETTE, canvas, colours, figure, from_the_top, legend, log_frequencies, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .protocols import HasEffectRuns, HasFrequencyRates, HasLines

__all__ = ["accuracy", "effects", "tornado"]


def tornado(sensitivity: HasFrequencyRates, mode: int = 0, *, most: int = 20, ax: Axes | None = None) -> Figure:
    """Bars of the change of one natural frequency for a small change of each parameter, the largest on top.

    Parameters
    ----------
    sensitivity
        An `EigenSensitivity`: ``frequency`` (n, n_p) Hz per unit, ``labels``, ``units``, ``values`` (n_p each).
    mode
        Which mode, from 0.
    most
        How many parameters at most.

    Returns
    -------
    matplotlib.figure.Figure
    """
    bars = tornado_bars(sensitivity, mode, most)
    if not bars:
        raise ModelError("there is nothing to draw: no parameter has a value other than 0 and a finite derivative")
    with style():
        made, axes = canvas(ax, (8.0, 1.4 + 0.42 * len(bars)))
        place = np.arange(len(bars))
        values = np.array([bar.value for bar in bars])
        axes.barh(place, values, color=[PALETTE[0] if v >= 0 else PALETTE[1] for v in values], height=0.62)
        axes.set_yticks(place, [f"{bar.label}  ({bar.change})" for bar in bars])
        from_the_top(axes)
        axes.axvline(0.0, color="#33404e", lw=0.9)
        axes.grid(axis="y", visible=False)
        for y, value in zip(place, values, strict=True):
            side = 1 if value >= 0 else -1
            axes.annotate(f"{value:.3g}", (value, y), (4 * side, 0), textcoords="offset points", va="center",
                          ha="left" if side > 0 else "right", fontsize=8.5, color="#4b5968")  # fmt: skip
        axes.margins(x=0.14)
        axes.set(xlabel="change of f [Hz]", title=f"mode {mode + 1}: change of the natural frequency")
    return made


def accuracy(study: HasLines, *, ax: Axes | None = None) -> Figure:
    """Measured error against measured time, both logarithmic, one line for each categorical setting of the study.

    ``study``: an `AccuracyStudy`; its ``lines()`` gives (label, points), each point with ``time`` (s), ``error`` and
    ``text``. Points with error 0 are drawn on the lower edge, hollow. Returns a Figure.
    """
    lines = [(label, [p for p in points if np.isfinite(p.error)]) for label, points in study.lines()]
    lines = [(label, points) for label, points in lines if points]
    beside = ", ".join(dict.fromkeys(name for _, points in lines for p in points for name in p.numeric))
    if not lines:
        raise ModelError("no run of this study has an error to plot; see print(study) for what happened")
    positive = [p.error for _, points in lines for p in points if p.error > 0.0]
    floor = 0.3 * min(positive) if positive else 1e-17
    with style():
        made, axes = canvas(ax, (8.0, 5.0))
        before, drawn = len(axes.lines), colours(axes, len(lines))
        for colour, (label, points) in zip(drawn, lines, strict=True):
            error = [max(p.error, floor) for p in points]
            axes.plot([p.time for p in points], error, "-o", color=colour, ms=5, label=label or None)
        axes.set(xscale="log", yscale="log", xlabel="wall time [s], best of the repeats", ylabel="error")
        axes.margins(0.1)
        log_frequencies(axes)
        for line, (_, points) in zip(axes.lines[before:], lines, strict=True):
            _settings_beside(axes, line, points)
        for colour, (_, points) in zip(drawn, lines, strict=True):
            exact = [p.time for p in points if p.error <= 0.0]
            axes.plot(exact, [floor] * len(exact), "o", color="white", mec=colour, ms=5, zorder=3)
        axes.set_title("what accuracy costs", pad=20)
        note = f"{study.measure}; beside the points: {beside}" if beside else study.measure
        axes.text(0.0, 1.015, note, transform=axes.transAxes, fontsize=8.5, color="#4b5968")
        legend(axes)
    return made


def _settings_beside(axes: Any, line: Any, points: Any) -> None:
    """The numeric settings of a curve beside its points, without those that would lie on one that is there."""
    taken = [axes.transData.transform(text.xy) for text in axes.texts if hasattr(text, "xy")]
    for p, at in zip(points, line.get_xydata(), strict=True):
        place = axes.transData.transform(at)
        if all(abs(place[0] - x) > 40 or abs(place[1] - y) > 11 for x, y in taken):
            taken.append(place)
            axes.annotate(p.text, at, (5, 4), textcoords="offset points", fontsize=7.5, color=line.get_color())


def effects(study: HasEffectRuns, *, ax: Axes | None = None) -> Figure:
    """Change of the result and time saved when each effect is left out, as bars side by side. Returns a Figure."""
    rows = [row for row in study.runs if np.isfinite(row.change)]
    if not rows:
        raise ModelError("no effect of this study could be switched off; see print(study) for why")
    with style():
        if ax is None:
            made, (left, right) = figure(1, 2, size=(9.5, 1.6 + 0.45 * len(rows)), sharey=True)
        else:
            made, left, right = ax.figure, ax, None
        place = np.arange(len(rows))
        left.barh(place, [row.change for row in rows], color=PALETTE[0], height=0.6)
        if any(row.change > 0.0 for row in rows):
            left.set_xscale("log")
        left.set_yticks(place, [row.effect for row in rows])
        from_the_top(left)
        left.set(xlabel=textwrap.fill(f"change: {study.measure}", 46), title="change of the result")
        if right is not None:
            right.barh(place, [100.0 * row.saved for row in rows], color=PALETTE[2], height=0.6)
            right.axvline(0.0, color="#33404e", lw=0.9)
            right.set(xlabel="time saved [%]", title="time saved")
    return made


def effects_list(table: Any, *, ax: Axes | None = None) -> Figure:
    """The effects of a model: filled marks where they are on, empty ones where they are off, each with its reason."""
    entries = list(table.entries)
    with style():
        made, axes = canvas(ax, (8.0, 1.0 + 0.3 * len(entries)))
        for y, entry in enumerate(entries):
            axes.plot([0.0], [y], "o", ms=8, color=PALETTE[0] if entry.on else FADED, mfc=None if entry.on else "white")
            axes.annotate(entry.why, (0.0, y), (14, 0), textcoords="offset points", va="center", fontsize=9)
        axes.set_yticks(range(len(entries)), [entry.name for entry in entries])
        axes.set(xticks=(), xlim=(-0.05, 1.0), title=f"effects of {table.name!r}", ylim=(len(entries) - 0.5, -0.5))
        axes.grid(visible=False)
    return made


def directional(result: Any, *, ax: Axes | None = None) -> Figure:
    """First-order change of every natural frequency along one change of all parameters, as bars."""
    with style():
        made, axes = canvas(ax)
        bars = axes.bar(result.numbers, np.nan_to_num(result.frequency), color=colours(axes, 1)[0], width=0.6)
        axes.axhline(0.0, color="#33404e", lw=0.9)
        axes.bar_label(bars, [f"{v:.3g}" for v in result.frequency], fontsize=8.5, padding=2)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.margins(y=0.12)
        axes.set(xlabel="mode", ylabel="change of f [Hz]", title="change of the natural frequencies")
    return made


def gradient_check(check: Any, *, ax: Axes | None = None) -> Figure:
    """Relative disagreement of derivatives and differences by parameter, beside the error that the differences have."""
    labels, floor = list(check.labels), 1e-17
    with style():
        made, axes = canvas(ax, (8.0, 1.4 + 0.36 * len(labels)))
        place = np.arange(len(labels))
        blue, orange = colours(axes, 2)
        error, noise = (
            np.maximum(np.nan_to_num(np.asarray(a, dtype=float)), floor) for a in (check.error, check.noise)
        )
        axes.plot(error, place, "o", color=blue, label="disagreement")
        axes.plot(noise, place, "|", color=orange, ms=14, mew=2, label="error of the difference")
        wrong = ~np.asarray(check.ok, dtype=bool)
        if wrong.any():
            axes.plot(error[wrong], place[wrong], "x", color=PALETTE[5], ms=11, mew=2, label="do not agree")
        axes.set_xscale("log")
        axes.set_yticks(place, labels)
        from_the_top(axes)
        axes.set(xlabel="relative to the derivative", title="check of gradients")
        legend(axes)
    return made


def comparison(result: Any, *, ax: Axes | None = None) -> Figure:
    """Relative difference of core and reference by quantity, beside the error that the result states."""
    floor = 1e-17
    with style():
        made, axes = canvas(ax, (8.0, 1.6 + 0.36 * len(result.labels)))
        place = np.arange(len(result.labels))
        blue, orange = colours(axes, 2)
        far = np.maximum(np.nan_to_num(np.asarray(result.difference, dtype=float), posinf=1.0), floor)
        axes.plot(far, place, "o", color=blue, label="difference")
        axes.axvline(max(result.stated, floor), color=orange, lw=1.2, label="stated error")
        wrong = ~np.asarray(result.agree, dtype=bool)
        if wrong.any():
            axes.plot(far[wrong], place[wrong], "x", color=PALETTE[5], ms=11, mew=2, label="do not agree")
        axes.set_xscale("log")
        axes.set_yticks(place, result.labels)
        from_the_top(axes)
        axes.set(xlabel="relative difference", title=result.heading())
        legend(axes, inside=0)  # beside the rows, which fill the axes
    return made


def motion_sensitivity(result: Any, *, ax: Axes | None = None) -> Figure:
    """Derivatives of objectives by parameters as bars, each over the largest of its objective."""
    flat = np.asarray(result.derivative, dtype=float)
    labels = [f"{name} [per {unit}]" if unit else name for name, unit in zip(result.labels, result.units, strict=True)]
    with style():
        made, axes = canvas(ax, (8.0, 1.4 + 0.4 * len(labels)))
        place, height = np.arange(len(labels)), 0.7 / len(flat)
        for i, (row, colour) in enumerate(zip(flat, colours(axes, len(flat)), strict=True)):
            largest = np.max(np.abs(row), initial=0.0) or 1.0
            name = f"objective {i}" if len(flat) > 1 else None
            axes.barh(place + (i - 0.5 * (len(flat) - 1)) * height, row / largest, height, color=colour, label=name)
        axes.axvline(0.0, color="#33404e", lw=0.9)
        axes.set_yticks(place, labels)
        from_the_top(axes)
        axes.set(xlabel="derivative over the largest of its objective", title="objectives of a motion")
        legend(axes)
    return made
