"""Figures of many designs: lines over all numbers, scatter, correlation, failures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .figure import PALETTE, canvas, style

__all__ = ["parallel"]

# More lines or points than these are drawn as an even selection: a figure shows no more, and takes seconds.
_MOST_LINES = 2000


def parallel(columns: Mapping[str, Any], title: str, *, colour: Any = None, ax: Any = None) -> Any:
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
