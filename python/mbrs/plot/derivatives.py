"""Figures of derivatives: of transfer functions, responses, linearisations and equilibria by parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .figure import canvas, colours, from_the_top, legend, log_frequencies, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["equilibrium_sensitivity", "frf_sensitivity", "linearization_sensitivity", "response_sensitivity"]

_MOST = 10


def frf_sensitivity(result: Any, *, ax: Axes | None = None) -> Figure:
    """|dH/dp| over the frequency, a line for each parameter and pair of ports, the ten largest of them."""
    values = result.labelled()["dH_dp"][1]
    n_out, n_in = values.shape[:2]
    pairs = n_out * n_in > 1
    curves = [
        (
            f"d/d {p}" + (f", {result.outputs[i]} / {result.inputs[j]}" if pairs else ""),
            np.abs(values[i, j, :, k]),
        )
        for i in range(n_out)
        for j in range(n_in)
        for k, p in enumerate(result.labels)
    ]
    made, axes = _lines(ax, result.frequency, curves, f"derivatives of the {result.kind}")
    with style():
        if any(np.any(value > 0.0) for _, value in curves):
            axes.set_yscale("log")
        low, high = float(np.min(result.frequency)), float(np.max(result.frequency))
        if low > 0.0 and high > 20.0 * low:
            log_frequencies(axes)
        axes.set(xlabel="frequency [Hz]", ylabel="|dH/dp| per unit of the parameter")
    return made


def response_sensitivity(result: Any, *, ax: Axes | None = None) -> Figure:
    """dy/dp over time, each line over its largest value, since parameters have different units."""
    several = len(result.outputs) > 1
    curves, values = [], result.labelled()["dy_dp"][1]
    for i, output in enumerate(result.outputs):
        for k, p in enumerate(result.labels):
            size = float(np.max(np.abs(values[i, :, k]), initial=0.0))
            name = f"d/d {p}" + (f" of {output}" if several else "") + f" (1 = {size:.3g})"
            curves.append((name, values[i, :, k] / (size or 1.0)))
    made, axes = _lines(ax, result.t, curves, f"derivatives of the {result.kind}")
    axes.set(xlabel="t [s]", ylabel="dy/dp over its largest value")
    return made


def linearization_sensitivity(result: Any, *, ax: Axes | None = None) -> Figure:
    """Largest entries of dM/dp and dK/dp for a change of each parameter by its unit, over the largest of each matrix."""
    labels = list(result.labels)
    sizes = {f"max |d{name}|": _largest(getattr(result, name), len(labels)) for name in "MK"}
    shown = {name: size / (size.max(initial=0.0) or 1.0) for name, size in sizes.items()}
    return _bars(
        ax, labels, shown, "over the largest of its kind", f"derivatives of {result.linearization.model.name!r}"
    )


def equilibrium_sensitivity(result: Any, *, ax: Axes | None = None) -> Figure:
    """Displacement of the origin of each body, |dx/dp|, over the largest by each parameter."""
    size = np.linalg.norm(result.labelled()["position"][1], axis=1)
    largest = size.max(axis=0, initial=0.0)
    shown = {
        f"d/d {label} (1 = {top:.3g} m{_per(unit)})": size[:, p] / (top or 1.0)
        for p, (label, unit, top) in enumerate(zip(result.labels, result.units, largest, strict=True))
    }
    return _bars(ax, list(result.bodies), shown, "displacement over its largest", "how the equilibrium moves")


def _per(unit: str) -> str:
    return "" if not unit else f"/({unit})" if " " in unit or "/" in unit else f"/{unit}"


def _largest(a: np.ndarray, n: int) -> np.ndarray:
    size: np.ndarray = np.abs(a).reshape(-1, n).max(axis=0, initial=0.0)
    return size


def _lines(ax: Any, x: np.ndarray, curves: Sequence[tuple[str, np.ndarray]], title: str) -> tuple[Any, Any]:
    if not curves:
        raise ModelError("there is nothing to draw: no parameter, or no output")
    ranked = sorted(curves, key=lambda c: -float(np.max(np.nan_to_num(c[1], posinf=0.0), initial=0.0)))[:_MOST]
    with style():
        made, axes = canvas(ax, (8.5, 4.4))
        for (name, value), colour in zip(ranked, colours(axes, len(ranked)), strict=True):
            axes.plot(x, value, color=colour, label=name)
        hidden = len(curves) - len(ranked)
        axes.set_title(title + (f" ({hidden} smaller ones not shown)" if hidden else ""))
        legend(axes)
    return made, axes


def _bars(ax: Any, names: Sequence[str], groups: dict[str, np.ndarray], xlabel: str, title: str) -> Any:
    height = 0.75 / max(len(groups), 1)
    with style():
        made, axes = canvas(ax, (8.0, 1.6 + 0.3 * len(names) * max(len(groups), 1)))
        for i, ((label, values), colour) in enumerate(zip(groups.items(), colours(axes, len(groups)), strict=True)):
            places = np.arange(len(names)) + (i - 0.5 * (len(groups) - 1)) * height
            axes.barh(places, values, height, color=colour, label=label)
        axes.set_yticks(range(len(names)), names)
        from_the_top(axes)
        axes.grid(axis="y", visible=False)
        axes.set(xlabel=xlabel, title=title)
        legend(axes)
    return made
