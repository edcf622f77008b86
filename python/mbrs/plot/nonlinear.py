"""Figures of nonlinear vibration: response curves, harmonics, motions, spectra, Floquet multipliers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .data import port_unit
from .figure import FADED, PALETTE, canvas, colours, figure, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["curve", "harmonics", "multipliers", "orbit", "spectrum", "torus_branch"]

_MARKERS = {
    "fold": ("o", "fold"),
    "branch-point": ("s", "branch point"),
    "neimark-sacker": ("^", "Neimark-Sacker"),
    "period-doubling": ("D", "period doubling"),
}
# Amplitudes below this part of the largest are rounding and would only stretch a logarithmic axis.
_FLOOR = 1e-16


def curve(
    result: Any,
    dof: Any = 0,
    harmonic: int | None = 1,
    *,
    ax: Axes | None = None,
    label: str | None = None,
    over: str = "",
) -> Figure:
    """Amplitude over frequency (or force level): unstable parts dashed, events marked where they were solved for.

    Parameters
    ----------
    result
        A `FrequencyResponse`.
    dof, harmonic
        Which amplitude, as for ``result.amplitude``; ``harmonic=None`` is the largest displacement.
    ax, label
        Axes to draw into, for several curves in one picture, and what to call this one there instead of telling stable
        from unstable; a figure of its own by default.
    over
        "frequency" (Hz) or "omega" (rad/s) for the axis of a curve over frequency; by default as the range was given.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if over not in ("", "frequency", "omega"):
        raise ModelError(f"over={over!r} is not known; use 'frequency' or 'omega'")
    x, name_of_x = result.axis()
    y = result.amplitude(dof, harmonic)
    factor = 1.0
    if over == "omega" and name_of_x == "f [Hz]":
        factor, name_of_x = 2 * np.pi, "omega [rad/s]"
    elif over == "frequency" and name_of_x == "omega [rad/s]":
        factor, name_of_x = 1.0 / (2 * np.pi), "f [Hz]"
    x = factor * x
    marks = [(e.index, factor * result.place(e), result.event_amplitude(e, dof, harmonic)) for e in result.events]
    with style():
        made, axes = canvas(ax)
        before = len(axes.lines)
        if result.connected:
            color = _branch(axes, x, y, result.stable, marks, colours(axes, 1)[0])
        else:
            color = colours(axes, 1)[0]
            axes.plot(x, y, "o", color=color, ms=4, mew=0, label="solutions")
        for kind, (marker, name) in _MARKERS.items():
            at = [mark[1:] for e, mark in zip(result.events, marks, strict=True) if e.kind == kind]
            if at:
                axes.plot(*zip(*at, strict=True), marker, color=color, mfc="white", ms=6, mew=1.4, ls="none",
                          label=name)  # fmt: skip
        if label is not None:
            for line in axes.lines[before:]:
                line.set_label("_")
            axes.lines[before].set_label(label)
        legend(axes)
        what = "largest displacement" if harmonic is None else "mean" if harmonic == 0 else f"harmonic {harmonic}"
        axes.set(xlabel=name_of_x, ylabel=f"{what} of {_named(result, dof)}")
        if ax is None:
            axes.set_title(f"{len(result)} points, {result.status}")
    return made


def _named(result: Any, dof: Any, rate: str = "") -> str:
    """The label of a displacement, with the unit of a motion of a model; coordinates of matrices have those of the matrices."""
    label = str(result.label(dof))
    return f"{label} [{port_unit(label)}{rate}]" if ".motion." in label else label


def _branch(
    axes: Any, x: np.ndarray, y: np.ndarray, stable: Any, marks: list[tuple[int, float, float]], color: Any
) -> Any:
    """The curve as lines through points and events, split by stability; returns its colour."""
    flags = np.full(len(x), np.nan) if stable is None else np.asarray(stable, dtype=float)
    places = np.array([m[0] for m in marks], dtype=int)
    values = [[m[i] for m in marks] for i in (1, 2)]
    x, y = np.insert(x, places, values[0]), np.insert(y, places, values[1])
    is_event = np.insert(np.zeros(len(flags), bool), places, True)
    flags = np.insert(flags, places, np.nan)
    # a piece between two points takes the flag of its first end that is a point; events lie where it changes
    first, second = flags[:-1], flags[1:]
    piece = np.where(is_event[:-1], second, first)
    both = ~is_event[:-1] & ~is_event[1:] & (first != second)
    piece = np.where(both, np.fmin(first, second), piece)
    known = not np.all(np.isnan(piece))
    styles = ((1.0, "-", "stable"), (0.0, "--", "unstable"), (np.nan, "-", "stability unknown" if known else None))
    for flag, line, name in styles:
        chosen = np.isnan(piece) if np.isnan(flag) else piece == flag
        if not np.any(chosen):
            continue
        gaps = np.where(chosen, 0.0, np.nan)
        # each piece is drawn by itself with a break behind it wherever the next one is not drawn
        xs = np.column_stack([x[:-1] + gaps, x[1:] + gaps, np.where(np.roll(chosen, -1), x[1:], np.nan)]).ravel()
        ys = np.column_stack([y[:-1] + gaps, y[1:] + gaps, np.where(np.roll(chosen, -1), y[1:], np.nan)]).ravel()
        drawn = axes.plot(xs, ys, line, color=color, label=name)[0]
        color = drawn.get_color()
    return color


def harmonics(result: Any, dof: Any = 0, *, ax: Axes | None = None) -> Figure:
    """Bars of the amplitudes |a - i b| of the harmonics of one coordinate, the mean first, on a logarithmic axis."""
    top = (result.X.shape[1] - 1) // 2
    order = np.arange(top + 1)
    size = np.array([result.amplitude(dof, h) for h in range(top + 1)])
    if not np.any(size > 0):
        raise ModelError(f"{result.label(dof)} does not move: there is no harmonic to show")
    floor = max(float(size.max()) * _FLOOR, np.nextafter(0, 1) * 1e8)
    shown = size > floor
    nu = getattr(result, "subharmonic", 1)
    with style():
        made, axes = canvas(ax)
        axes.bar(order[shown], size[shown], width=0.7, color=colours(axes, 1)[0], zorder=2)
        axes.set_yscale("log")
        axes.set_ylim(10.0 ** (np.floor(np.log10(size[shown].min())) - 0.3), 2.5 * size.max())
        axes.set_xlim(-0.7, top + 0.7)
        axes.xaxis.get_major_locator().set_params(integer=True)
        unit = "" if nu == 1 else f" (of f / {nu})"
        axes.set(xlabel=f"harmonic{unit}", ylabel=f"amplitude of {_named(result, dof)}")
        if ax is None:
            axes.set_title(f"estimated error {float(result.error):.0e}")
    return made


def orbit(result: Any, dof: Any = 0, *, ax: Axes | None = None) -> Figure:
    """Displacement over one period, and velocity over displacement; with ``ax`` the latter alone.

    A quasi-periodic motion, which has no period, is drawn over thirty cycles of its slowest force.
    """
    is_torus = hasattr(result, "indices")
    span = 30 * 2 * np.pi / float(np.min(result.omega)) if is_torus else result.period
    # a relaxation oscillation jumps within a small part of its period
    harmonics = (result.X.shape[1] - 1) // 2
    t = np.linspace(0.0, span, 6001 if is_torus else min(max(720, 32 * harmonics), 16384) + 1)
    x, v = result.displacement(t, dof), result.velocity(t, dof)
    with style():
        if ax is None:
            made, (left, axes) = figure(1, 2, size=(9.5, 4.0), width_ratios=(1.35, 1))
            left.plot(t, x, color=PALETTE[0], lw=0.9 if is_torus else 1.5)
            left.set(xlabel="t [s]", ylabel=_named(result, dof), title="30 cycles" if is_torus else "one period")
        else:
            made, axes = ax.figure, ax
        color = colours(axes, 1)[0]
        axes.plot(x, v, color=color, lw=0.6 if is_torus else 1.5)
        if not is_torus:
            axes.plot(x[:1], v[:1], "o", color=PALETTE[1], ms=5, label="t = 0")
            legend(axes)
        axes.set(xlabel=_named(result, dof), ylabel=f"d/dt {_named(result, dof, '/s')}")
    return made


def spectrum(result: Any, dof: Any = 0, *, most: int = 6, ax: Axes | None = None) -> Figure:
    """Amplitude over frequency in Hz as stems; the ``most`` largest of a quasi-periodic motion are named by index."""
    frequency, size, names = result.lines(dof)
    keep = size > float(np.max(size, initial=0.0)) * 1e-14
    if not np.any(keep):
        raise ModelError(f"{result.label(dof)} does not move: its spectrum is empty")
    with style():
        made, axes = canvas(ax)
        bottom = 10.0 ** (np.floor(np.log10(size[keep].min())) - 0.3)
        color = colours(axes, 1)[0]
        axes.vlines(frequency[keep], bottom, size[keep], color=color, lw=1.2)
        axes.plot(frequency[keep], size[keep], "o", color=color, ms=4, mew=0)
        axes.set_yscale("log")
        tilted = len(frequency) > 12
        axes.set_ylim(bottom, (200 if tilted else 12) * size.max())
        for i in np.argsort(-size)[:most]:
            if keep[i] and names[i]:
                axes.annotate(names[i], (frequency[i], size[i]), xytext=(0, 5), textcoords="offset points", ha="center",
                              fontsize=8, rotation=60 if tilted else 0)  # fmt: skip
        axes.set(xlabel="f [Hz]", ylabel=f"amplitude of {_named(result, dof)}")
        if ax is None:
            axes.set_title(f"estimated error {float(result.error):.0e}")
    return made


def multipliers(result: Any) -> Any:
    """Floquet multipliers in the complex plane with the unit circle; of a curve also the largest over frequency."""
    values = result.multipliers
    if values is None:
        raise ModelError(
            "there are no multipliers: stability was not asked for, or cannot be told for laws with memory"
        )
    values = np.atleast_2d(values)
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 361))
    many = len(values) > 1
    with style():
        made, axes = figure(1, 2 if many else 1, size=(10.0, 4.4) if many else (5.0, 4.8))
        plane = axes[0] if many else axes
        plane.plot(circle.real, circle.imag, color=FADED, lw=1.0)
        outside = np.abs(values) > 1 + 1e-7
        for chosen, color, name in ((~outside, PALETTE[0], "inside"), (outside, PALETTE[5], "outside")):
            shown = values[chosen]
            if shown.size:
                plane.plot(shown.real, shown.imag, "o", color=color, ms=3.5 if many else 7, mew=0, label=name)
        plane.set_aspect("equal", adjustable="datalim")
        plane.set(xlabel="Re", ylabel="Im", title="Floquet multipliers")
        plane.legend(loc="best")
        if many:
            x, name = result.axis()
            axes[1].axhline(1.0, color=FADED, lw=1.0)
            axes[1].plot(x, np.max(np.abs(values), axis=1), color=PALETTE[0])
            axes[1].set(xlabel=name, ylabel="largest magnitude", title="stable at most 1")  # fmt: skip
    return made


def torus_branch(result: Any, dof: Any = 0, index: Any = None, *, ax: Axes | None = None) -> Figure:
    """Amplitudes of terms of a quasi-periodic branch, folds marked."""
    (x, name), marks = result.axis(), np.array(result.fold_places, dtype=float)
    with style():
        made, axes = canvas(ax)
        terms = result.ordinates(dof, index)
        for (label, y, at_folds), color in zip(terms, colours(axes, len(terms)), strict=True):
            line = axes.plot(x, y, color=color, label=label)[0]
            if len(marks):
                axes.plot(
                    marks, at_folds, "o", mfc="white", color=line.get_color(), ms=6, mew=1.4, ls="none", label="fold"
                )
        legend(axes)
        axes.set(xlabel=name, ylabel=f"amplitude of {_named(result, dof)}")
        if ax is None:
            axes.set_title(f"{len(result)} points, {result.status}")
    return made
