"""Figures of many designs: lines over all numbers, scatter, correlation, failures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .figure import PALETTE, canvas, colours, from_the_top, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["correlation", "failures", "indices", "parallel", "scatter"]

# More lines or points than these are drawn as an even selection: a figure shows no more, and takes seconds.
_MOST_LINES = 2000


def parallel(columns: Mapping[str, Any], title: str, *, colour: Any = None, ax: Axes | None = None) -> Figure:
    """Every design as one line over its numbers, each scaled to its range; ``columns`` as from ``labelled``.

    ``colour`` (n,) tells lines apart by a value, such as an output.
    """
    names = list(columns)
    values = np.stack([np.asarray(columns[name][1], dtype=float) for name in names], axis=1)
    keep = np.flatnonzero(np.isfinite(values).all(axis=1))
    keep = keep[:: max(1, len(keep) // _MOST_LINES)]
    values = values[keep]
    low, high = (f(values, axis=0) if len(values) else np.zeros(len(names)) for f in (np.min, np.max))
    span = np.where(high > low, high - low, 1.0)
    with style():
        made, axes = canvas(ax, (max(6.0, 1.2 * len(names)), 4.4))
        shades: Any = PALETTE[0]
        if colour is not None and len(keep):
            from matplotlib import colormaps

            chosen = np.asarray(colour, dtype=float)[keep]
            spread = np.ptp(chosen) or 1.0
            shades = colormaps["viridis"]((chosen - chosen.min()) / spread)
        place = np.arange(len(names))
        for i, row in enumerate((values - low) / span):
            axes.plot(place, row, "-o", ms=2, lw=0.7, alpha=0.6, color=shades if isinstance(shades, str) else shades[i])
        axes.set_xticks(
            place, [f"{n}\n{a:.4g} .. {b:.4g}" for n, a, b in zip(names, low, high, strict=True)], fontsize=8.5
        )
        axes.set(yticks=(0.0, 1.0), yticklabels=("least", "largest"), title=title)
    return made


def scatter(columns: Mapping[str, Any], *, colour: Any = None, shade: str = "", ax: Axes | None = None) -> Figure:
    """The second column over the first, one point for each design; ``colour`` (n,) and its name ``shade`` colour them."""
    (across, x), (up, y) = columns.items()
    good = np.isfinite(x[1]) & np.isfinite(y[1])
    if colour is not None:
        good &= np.isfinite(colour)
    keep = np.flatnonzero(good)
    with style():
        made, axes = canvas(ax)
        drawn = axes.scatter(
            x[1][keep], y[1][keep], s=12, alpha=0.7, lw=0, c=PALETTE[0] if colour is None else colour[keep]
        )
        if colour is not None:
            made.colorbar(drawn, ax=axes, label=shade)
        axes.set(xlabel=_axis(across, x[2]), ylabel=_axis(up, y[2]), title=f"{len(keep)} designs")
    return made


def _axis(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def correlation(
    values: Mapping[str, np.ndarray], inputs: tuple[str, ...], outputs: tuple[str, ...], *, ax: Axes | None = None
) -> Figure:
    """Rank correlation (Spearman) of every output with every number of the designs, as a coloured table."""
    table = np.array([[_rank_correlation(values[a], values[b]) for a in inputs] for b in outputs])
    table = table.reshape(len(outputs), len(inputs))
    with style():
        made, axes = canvas(ax, (2.5 + 0.9 * len(inputs), 1.6 + 0.34 * len(outputs)))
        axes.imshow(np.nan_to_num(table), cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
        for (i, j), value in np.ndenumerate(table):
            text = "-" if np.isnan(value) else f"{value:.2f}"
            axes.annotate(
                text, (j, i), ha="center", va="center", fontsize=8.5, color="white" if abs(value) > 0.6 else "#33404e"
            )
        axes.set_xticks(range(len(inputs)), inputs, rotation=30, ha="right")
        axes.set_yticks(range(len(outputs)), outputs)
        axes.grid(visible=False)
        axes.set(title="rank correlation")
    return made


def _rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Spearman's coefficient, equal values sharing the mean of their ranks; nan where one does not vary."""
    from scipy.stats import rankdata

    good = np.isfinite(a) & np.isfinite(b)
    if good.sum() < 2 or np.ptp(a[good]) == 0.0 or np.ptp(b[good]) == 0.0:
        return float("nan")
    return float(np.corrcoef(rankdata(a[good]), rankdata(b[good]))[0, 1])


def failures(result: Any, *, ax: Axes | None = None) -> Figure:
    """Bars of the number of failed designs of each kind; ``result`` with ``kinds()``: designs by reason, error class and object."""
    kinds = result.kinds()
    labels = [" ".join(part for part in key if part) for key in kinds]
    with style():
        made, axes = canvas(ax, (7.0, 1.2 + 0.4 * max(1, len(labels))))
        place = np.arange(len(labels))
        bars = axes.barh(place, [len(designs) for designs in kinds.values()], color=PALETTE[5], height=0.62)
        axes.bar_label(bars, padding=3, fontsize=8.5)
        axes.set_yticks(place, labels)
        from_the_top(axes)
        if not labels:
            axes.set(xticks=())
        axes.set(xlabel="designs", title=result.heading())
    return made


def indices(names: tuple[str, ...], sides: Mapping[str, Any], title: str, *, ax: Axes | None = None) -> Figure:
    """Bars of several values for each name; ``sides``: values and standard errors by label."""
    with style():
        made, axes = canvas(ax, (7.0, 1.4 + 0.42 * len(names)))
        place, height = np.arange(len(names)), 0.75 / max(1, len(sides))
        for i, ((label, (values, errors)), colour) in enumerate(
            zip(sides.items(), colours(axes, len(sides)), strict=True)
        ):
            shift = height * (i - 0.5 * (len(sides) - 1))
            axes.barh(place + shift, np.nan_to_num(values), height, xerr=errors, color=colour, label=label)
        axes.set_yticks(place, names)
        from_the_top(axes)
        axes.set(title=title)
        if len(sides) > 1:
            legend(axes)
    return made
