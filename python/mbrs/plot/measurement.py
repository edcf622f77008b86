"""Pictures of measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .figure import canvas, colours, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# lines beyond these have no entry in the legend
_MOST_NAMED = 8


def measurement(result: Any, *, against: Any = None, ax: Axes | None = None) -> Figure:
    """|value| of each function over its axis, frequency responses on a logarithmic scale; natural frequencies as vertical lines;
    computed functions, ``against``, as dashed lines.
    """
    if against is not None and not hasattr(against, "outputs"):
        raise ModelError(f"against= takes a result of mb.frf, got {type(against).__name__}")
    with style():
        made, axes = canvas(ax)
        responses = [f for f in result.functions if f.kind == "frequency response"]
        shown = responses or result.functions
        for i, (f, colour) in enumerate(zip(shown, colours(axes, len(shown)), strict=False)):
            label = f"{f.response} / {f.reference}" if i < _MOST_NAMED else None
            axes.plot(f.x, np.abs(f.value) if responses else f.value.real, color=colour, label=label)
        if against is not None:
            _computed(axes, result, against)
        for frequency in result.frequency:
            axes.axvline(frequency, color="#9aa7b5", linewidth=0.8, zorder=0)
        if responses:
            axes.set_yscale("log")
        axes.set_xlabel("frequency [Hz]" if responses or not shown else "")
        axes.set_title(result.heading())
        if shown:
            legend(axes)
    return made


def _computed(axes: Any, result: Any, against: Any) -> None:
    """Computed functions as dashed lines, those that were measured in the colour of the measured one."""
    measured = {(f.response, f.reference): line for f, line in zip(result.functions, axes.lines, strict=False)}
    pairs = [(i, j) for i, j in np.ndindex(against.value.shape[:2])]
    same = [(i, j) for i, j in pairs if (against.outputs[i], against.inputs[j]) in measured]
    for n, (i, j) in enumerate(same or pairs):
        line = measured.get((against.outputs[i], against.inputs[j]))
        colour = line.get_color() if line is not None else colours(axes, 1)[0]
        axes.plot(against.frequency, np.abs(against.value[i, j]), "--", color=colour, label=None if n else "computed")
    if not any(f.kind == "frequency response" for f in result.functions):
        axes.set_yscale("log")
        axes.set_xlabel("frequency [Hz]")


def side_by_side(measured: Any, computed: Any, *, ax: Axes | None = None) -> Figure:
    """|H| of measured transfer functions as dots and of computed ones as lines of the same colour."""
    with style():
        made, axes = canvas(ax)
        pairs = list(np.ndindex(measured.value.shape[:2]))
        for n, ((i, j), colour) in enumerate(zip(pairs, colours(axes, len(pairs)), strict=True)):
            name = f"{measured.outputs[i]} / {measured.inputs[j]}" if n < _MOST_NAMED else None
            axes.plot(measured.frequency, np.abs(measured.value[i, j]), ".", markersize=3, color=colour, label=name)
            axes.plot(computed.frequency, np.abs(computed.value[i, j]), "-", color=colour)
        axes.set_yscale("log")
        axes.set_xlabel("frequency [Hz]")
        axes.set_title(f"{measured.kind}: measured (dots) and computed (lines)")
        legend(axes)
    return made


def correlation(result: Any, *, ax: Axes | None = None) -> Figure:
    """MAC of measured (rows) and computed modes (columns) as squares."""
    with style():
        made, axes = canvas(ax)
        image = axes.imshow(result.mac, vmin=0.0, vmax=1.0, cmap="Blues", aspect="auto")
        made.colorbar(image, ax=axes, label="MAC")
        for i, j in enumerate(result.partner.tolist()):
            if j >= 0:
                axes.plot(j, i, "s", markersize=9, markerfacecolor="none", markeredgecolor="#d9662b")
        n_test, n_model = result.mac.shape
        axes.set_xticks(range(n_model), range(1, n_model + 1))
        axes.set_yticks(range(n_test), range(1, n_test + 1))
        axes.set_xlabel("mode of the model")
        axes.set_ylabel("measured mode")
        axes.grid(visible=False)
        axes.set_title(result.heading())
    return made


def pairing(result: Any, *, ax: Axes | None = None) -> Figure:
    """Distances of nodes from the points that they were paired with."""
    with style():
        made, axes = canvas(ax)
        labels = [f"{node} = {target}" for node, target in zip(result.node, result.target.tolist(), strict=True)]
        distance, colour = np.nan_to_num(result.distance), colours(axes, 1)[0]
        axes.barh(labels, distance, height=0.5, color=colour)
        axes.plot(distance, labels, "o", color=colour)  # a distance of zero is seen too
        axes.set_xlabel("distance [m]")
        axes.grid(axis="y", visible=False)
        axes.set_title(result.heading())
    return made


def update(result: Any, *, ax: Axes | None = None) -> Figure:
    """Values of updated parameters over their first ones, with their intervals."""
    with style():
        made, axes = canvas(ax)
        size = np.where(result.start == 0.0, 1.0, np.abs(result.start))
        reach = 0.5 * np.diff(result.interval(), axis=1)[:, 0] / size
        place = np.arange(len(result.labels))[::-1]
        seen = np.isfinite(reach)
        colour = colours(axes, 1)[0]
        axes.errorbar((result.x / size)[seen], place[seen], xerr=reach[seen], fmt="o", color=colour, capsize=3)
        axes.plot((result.x / size)[~seen], place[~seen], "o", markerfacecolor="none", color=colour)
        axes.axvline(1.0, color="#9aa7b5", linewidth=0.8)
        axes.set_yticks(place, result.labels)
        axes.set_xlabel("value over first value, 95 % interval")
        axes.grid(axis="y", visible=False)
        axes.set_title(result.heading())
    return made
