"""Pictures of measurements."""

from __future__ import annotations

from typing import Any

import numpy as np

from .figure import canvas, colours, legend, style

# lines beyond these have no entry in the legend
_MOST_NAMED = 8


def measurement(result: Any, *, ax: Any = None) -> Any:
    """|value| of each function over its axis, frequency responses on a logarithmic scale; natural frequencies as vertical lines."""
    with style():
        made, axes = canvas(ax)
        responses = [f for f in result.functions if f.kind == "frequency response"]
        shown = responses or result.functions
        for i, (f, colour) in enumerate(zip(shown, colours(axes, len(shown)), strict=False)):
            label = f"{f.response} / {f.reference}" if i < _MOST_NAMED else None
            axes.plot(f.x, np.abs(f.value) if responses else f.value.real, color=colour, label=label)
        for frequency in result.frequency:
            axes.axvline(frequency, color="#9aa7b5", linewidth=0.8, zorder=0)
        if responses:
            axes.set_yscale("log")
        axes.set_xlabel("frequency [Hz]" if responses or not shown else "")
        axes.set_title(result.heading())
        if shown:
            legend(axes)
    return made
