"""Figures of gradients of motions: tornado, sensitivities over time, convergence of an optimisation."""

from __future__ import annotations

from typing import Any

import numpy as np

from .figure import PALETTE, figure, legend, style

__all__ = ["convergence", "over_time", "tornado"]


def tornado(result: Any, *, n: int = 30) -> Any:
    """Bars of the derivatives by each parameter, largest first, in units of the objective per unit of the parameter.

    Parameters
    ----------
    result
        A `MotionGradient`; of several objectives the first is drawn.
    n
        How many parameters at most.

    Returns
    -------
    matplotlib.figure.Figure
    """
    values = np.asarray(result.gradient).reshape(-1, len(result.labels))[0]
    order = np.argsort(-np.abs(values))[:n][::-1]
    names = [f"{result.labels[i]} [1/{result.units[i]}]" if result.units[i] else result.labels[i] for i in order]
    with style():
        made, axes = figure(1, 1, size=(7.5, 1.2 + 0.3 * len(order)))
        ax = np.ravel(axes)[0]
        ax.barh(names, values[order], color=[PALETTE[0] if v >= 0 else PALETTE[1] for v in values[order]])
        ax.axvline(0.0, color="#9aa7b5", lw=0.8)
        ax.set(xlabel="change of the objective per unit of the parameter")
    return made


def over_time(traj: Any, what: str) -> Any:
    """The derivatives of a quantity of a trajectory over time, one line per component and parameter."""
    d = traj.sensitivity(what)
    n = int(np.prod(d.parameter_shape))
    named = [traj.parameters] if isinstance(traj.parameters, str) else list(traj.parameters)
    labels = named if len(named) == n else [f"{', '.join(named)} {i}" for i in range(n)]
    flat = np.asarray(d).reshape(len(traj.t), -1, n)
    with style():
        made, axes = figure(1, 1, size=(8.0, 4.4))
        ax = np.ravel(axes)[0]
        names = []
        for p, label in enumerate(labels):
            for k in range(flat.shape[1]):
                name = label if flat.shape[1] == 1 else f"{'xyz'[k] if flat.shape[1] == 3 else k} by {label}"
                names.append(name)
                ax.plot(traj.t, flat[:, k, p], label=name, color=PALETTE[(p * flat.shape[1] + k) % len(PALETTE)])
        ax.set(xlabel="t [s]", ylabel=f"d {what}", title=f"sensitivities of {what}")
        legend(ax, names)
    return made


def convergence(result: Any) -> Any:
    """The objective over the evaluations of an optimiser."""
    with style():
        made, axes = figure(1, 1, size=(7.0, 4.0))
        ax = np.ravel(axes)[0]
        values = np.asarray(result.history)
        ax.plot(np.arange(1, len(values) + 1), values, "o-", color=PALETTE[0], ms=4)
        if np.all(values > 0.0):
            ax.set_yscale("log")
        ax.set(xlabel="evaluation", ylabel="objective")
    return made
