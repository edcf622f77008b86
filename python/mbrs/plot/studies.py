"""Figures of sensitivities and studies: tornado, error against time, effects."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import ModelError
from .data import tornado_bars
from .figure import PALETTE, figure, legend, style

__all__ = ["accuracy", "effects", "tornado"]


def tornado(sensitivity: Any, mode: int = 0, *, most: int = 20) -> Any:
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
        made, axes = figure(size=(8.0, 1.4 + 0.42 * len(bars)))
        place = np.arange(len(bars))
        values = np.array([bar.value for bar in bars])
        axes.barh(place, values, color=[PALETTE[0] if v >= 0 else PALETTE[1] for v in values], height=0.62)
        axes.set_yticks(place, [f"{bar.label}  ({bar.change})" for bar in bars])
        axes.invert_yaxis()
        axes.axvline(0.0, color="#33404e", lw=0.9)
        axes.grid(axis="y", visible=False)
        for y, value in zip(place, values, strict=True):
            side = 1 if value >= 0 else -1
            axes.annotate(f"{value:.3g}", (value, y), (4 * side, 0), textcoords="offset points", va="center",
                          ha="left" if side > 0 else "right", fontsize=8.5, color="#4b5968")  # fmt: skip
        axes.margins(x=0.14)
        axes.set(xlabel="change of f [Hz]", title=f"mode {mode + 1}: change of the natural frequency")
    return made


def accuracy(study: Any) -> Any:
    """Measured error against measured time, both logarithmic, one line for each categorical setting of the study.

    ``study``: an `AccuracyStudy`; its ``lines()`` gives (label, points), each point with ``time`` (s), ``error`` and
    ``text``. Points with error 0 are drawn on the lower edge, hollow. Returns a Figure.
    """
    lines = [(label, [p for p in points if np.isfinite(p.error)]) for label, points in study.lines()]
    lines = [(label, points) for label, points in lines if points]
    if not lines:
        raise ModelError("no run of this study has an error to plot; see print(study) for what happened")
    positive = [p.error for _, points in lines for p in points if p.error > 0.0]
    floor = 0.3 * min(positive) if positive else 1e-17
    with style():
        made, axes = figure(size=(8.0, 5.0))
        for i, (label, points) in enumerate(lines):
            colour = PALETTE[i % len(PALETTE)]
            time = [p.time for p in points]
            error = [max(p.error, floor) for p in points]
            axes.plot(time, error, "-o", color=colour, ms=5, label=label or None)
            for p in points:
                if p.error <= 0.0:
                    axes.plot([p.time], [floor], "o", color="white", mec=colour, ms=5, zorder=3)
            for p, e in zip(points, error, strict=True):
                axes.annotate(p.text, (p.time, e), (5, 4), textcoords="offset points", fontsize=7.5, color=colour)
        axes.set(xscale="log", yscale="log", xlabel="wall time [s], best of the repeats", ylabel="error")
        axes.set_title("what accuracy costs", pad=20)
        axes.text(0.0, 1.015, study.measure, transform=axes.transAxes, fontsize=8.5, color="#4b5968")
        axes.margins(0.1)
        legend(axes, [label for label, _ in lines if label])
    return made


def effects(study: Any) -> Any:
    """Change of the result and time saved when each effect is left out, as bars side by side. Returns a Figure."""
    rows = [row for row in study.rows if np.isfinite(row.change)]
    if not rows:
        raise ModelError("no effect of this study could be switched off; see print(study) for why")
    with style():
        made, (left, right) = figure(1, 2, size=(9.5, 1.6 + 0.45 * len(rows)), sharey=True)
        place = np.arange(len(rows))
        left.barh(place, [row.change for row in rows], color=PALETTE[0], height=0.6)
        if any(row.change > 0.0 for row in rows):
            left.set_xscale("log")
        right.barh(place, [100.0 * row.saved for row in rows], color=PALETTE[2], height=0.6)
        left.set_yticks(place, [row.effect for row in rows])
        left.invert_yaxis()
        right.axvline(0.0, color="#33404e", lw=0.9)
        left.set(xlabel=f"change: {study.measure}", title="change of the result")
        right.set(xlabel="time saved [%]", title="time saved")
    return made
