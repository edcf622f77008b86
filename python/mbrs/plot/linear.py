"""Figures of linear results: modes, transfer functions, time response."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import shown
from ..errors import ModelError
from .data import Curve, breaks_at_jumps, frf_unit, magnitude_label, peak, ranked_curves, response_unit, rounded
from .figure import FADED, PALETTE, canvas, colours, figure, legend, log_frequencies, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from .protocols import HasModes, HasOutputs, HasTransfer

__all__ = ["frf", "modes", "response"]

_MOST_NAMED = 10
_MOST_TICKS = 40
# Real parts below this share of the largest root are the rounding of zero: no axis is scaled to them.
_UNDAMPED = 1e-14


def modes(
    result: HasModes,
    view: str = "poles",
    *,
    n: int | None = None,
    against: HasModes | tuple[ArrayLike, ArrayLike] | None = None,
    ax: Axes | None = None,
    label: str | None = None,
) -> Figure:
    """Poles in the complex plane and how much each coordinate moves in each mode, or lists of frequencies and damping ratios.

    Parameters
    ----------
    result
        A `ModalResult`: ``eigenvalue`` (n,) rad/s, ``shape`` (dof, n), ``frequency`` (n,) Hz, ``coordinates`` (dof
        names).
    view
        "poles", or "list": natural frequency (Hz) and damping ratio over the number of the mode, ascending.
    n
        How many modes at most, from the first; 40 of the poles, all of a list by default.
    against
        Of a list: another result, or its frequencies and damping ratios ((m,), (m,)), drawn beside; the titles tell the mean and the
        largest difference of modes of the same number.
    ax, label
        Axes for the eigenvalues alone, and what to call this result there instead of telling its kinds of modes apart.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if view not in ("poles", "list"):
        raise ModelError(f'modes are plotted as "poles" or as a "list", got {shown(view)}')
    if view == "list":
        return _mode_list(result, against, n, label)
    if against is not None:
        raise ModelError('against= belongs to plot("list"); draw poles of two results into one ax=')
    s = np.asarray(result.eigenvalue)[: 40 if n is None else n]
    n = s.size
    if s.size == 0:
        raise ModelError("there is no mode to plot")
    with style():
        if ax is None:
            made, (left, right) = figure(1, 2, size=(10.5, 4.6), width_ratios=(1, 1.6))
        else:
            made, left = ax.figure, ax
        kinds = np.asarray(getattr(result, "kind", np.array(["mode"] * s.size))).astype(str)[:n]
        kinds = kinds if label is None else np.full(s.size, label)
        names = list(dict.fromkeys(kinds))
        for kind, colour in zip(names, colours(left, len(names)), strict=True):
            chosen = s[kinds == kind]
            left.plot(chosen.real, chosen.imag / (2 * np.pi), "o", color=colour, ms=6, mew=0, label=kind)
        left.axvline(0.0, color="#9aa7b5", lw=0.8)
        left.set(xlabel="Re s [rad/s]", ylabel="Im s / 2 pi [Hz]", title="eigenvalues")
        left.margins(0.12)
        if np.all(np.abs(s.real) <= _UNDAMPED * np.abs(s).max()):  # no scale of its own for the rounding of zero
            left.set_xlim(-1.0, 1.0)
            left.set_xticks([0.0])
        left.locator_params(axis="x", nbins=5)
        legend(left)
        if ax is None:
            _participation(made, right, result, s.size)
    return made


def _mode_list(result: Any, against: Any, n: int | None, label: str | None) -> Figure:
    """Frequencies above, damping ratios below, over the number of the mode."""
    lists = [_ascending(result, n)] + ([] if against is None else [_ascending(against, n)])
    if lists[0][0].size == 0:
        raise ModelError("there is no mode to plot")
    with style():
        made, axes = figure(2, 1, size=(7.5, 6.0), sharex=True)
        names = ["this result" if label is None else label, "the other"]
        for quantity, (ax, what, unit) in enumerate(
            zip(axes, ("natural frequency [Hz]", "damping ratio"), (" Hz", ""), strict=True)
        ):
            for k, (values, name) in enumerate(zip(lists, names, strict=False)):
                number = np.arange(1, values[quantity].size + 1)
                marks: dict[str, Any] = dict(marker="o", ms=7, mfc="none") if k else dict(marker=".", ms=6)
                ax.plot(number, values[quantity], ls="none", color=PALETTE[k], label=name, **marks)
            ax.set_ylabel(what)
            if len(lists) == 2:
                m = min(len(lists[0][0]), len(lists[1][0]))
                off = np.abs(lists[0][quantity][:m] - lists[1][quantity][:m])
                ax.set_title(f"difference: mean {np.nanmean(off):.1e}{unit}, largest {np.nanmax(off):.1e}{unit}")
                legend(ax)
        axes[1].set_xlabel("mode")
        axes[1].xaxis.get_major_locator().set_params(integer=True)
    return made


def _ascending(result: Any, n: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and damping ratios by ascending frequency."""
    pair = result if isinstance(result, tuple) else (result.frequency, result.damping)
    f, zeta = (np.asarray(values, dtype=float) for values in pair)
    if f.ndim != 1 or f.shape != zeta.shape:
        raise ModelError("against= is a result of mb.modes, or frequencies and damping ratios of the same length")
    order = np.argsort(f, kind="stable")[:n]
    return f[order], zeta[order]


def _participation(made: Any, axes: Any, result: Any, n: int) -> None:
    shape = np.abs(np.asarray(result.shape)[:, :n])
    largest = shape.max(axis=0)
    picture = axes.imshow(
        shape / np.where(largest > 0.0, largest, 1.0),
        aspect="auto",
        cmap="Blues",
        vmin=0.0,
        vmax=1.0,
        interpolation="nearest",
    )
    axes.grid(False)
    names = list(getattr(result, "coordinates", None) or [])
    if len(names) == shape.shape[0] <= _MOST_TICKS:
        axes.set_yticks(range(len(names)), names, fontsize=8 if len(names) <= 20 else 6)
    else:
        axes.set_ylabel("coordinate")
    frequency = np.asarray(result.frequency, dtype=float)[:n]
    every = max(1, -(-n // 16))
    places = np.arange(0, n, every)
    labels = [f"{i + 1}\n{frequency[i]:.4g}" for i in places]
    axes.set_xticks(places, labels, fontsize=8)
    axes.set(xlabel="mode, f [Hz]", title="|shape| of each coordinate, largest = 1")
    made.colorbar(picture, ax=axes, fraction=0.04, pad=0.02)


def frf(
    result: HasTransfer, kind: str = "bode", *, marks: ArrayLike = (), ax: Axes | None = None, label: str | None = None
) -> Figure:
    """A transfer function as Bode or Nyquist plot; with many curves the ten largest are coloured and the others grey.

    Parameters
    ----------
    result
        An `FrfResult`: ``value`` (n_out, n_in, n_freq) complex, ``frequency`` (n_freq,) Hz, ``kind``, ``inputs``,
        ``outputs``.
    kind
        ``"bode"``: magnitude (logarithmic) and phase in degrees of exp(+i omega t); ``"nyquist"``: imaginary over real
        part.
    marks
        Frequencies in Hz to mark by vertical lines in the Bode plot, such as natural frequencies.
    ax, label
        Axes for several results in one picture, of a Bode plot one (the magnitude) or two, and what to call this one there.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if kind not in ("bode", "nyquist"):
        raise ModelError(f"kind={kind!r} is not known; use 'bode' or 'nyquist'")
    ranked, rounding = ranked_curves(result)
    named, rest = ranked[:_MOST_NAMED], ranked[_MOST_NAMED:]
    alone = len(ranked) == 1 and not rounding and ax is None and label is None
    with style():
        if alone:
            named = [Curve("_", ranked[0].value)]
        if label is not None:
            named = [Curve(label if len(named) == 1 else f"{label}: {c.label}", c.value) for c in named]
        made, top = _bode(result, named, rest, marks, ax) if kind == "bode" else _nyquist(result, named, rest, ax)
        notes = [f"{len(rest)} smaller curves in grey"] * bool(rest) + [f"left out as zero: {rounding}"] * bool(
            rounding
        )
        kind_ = str(getattr(result, "kind", ""))
        if alone:  # its name is the title
            kind_, notes = f"{kind_} {ranked[0].label}".strip(), []
        top.set_title(kind_ + (f" ({', '.join(notes)})" if notes else ""))
    return made


def _bode(result: Any, named: list[Curve], rest: list[Curve], marks: Any, ax: Any) -> tuple[Any, Any]:
    frequency = np.asarray(result.frequency, dtype=float)
    if ax is None:
        made, (above, below) = figure(2, 1, size=(8.5, 5.6), sharex=True, height_ratios=(2, 1))
    else:
        given = list(np.ravel(ax))
        above, below = given[0], given[1] if len(given) > 1 else None
        made = above.figure
    lowest = above if below is None else below
    for curve in rest:
        above.plot(frequency, np.abs(curve.value), color=FADED, lw=0.7, zorder=1.5)
    for curve, colour in zip(named, colours(above, len(named)), strict=True):
        above.plot(frequency, np.abs(curve.value), color=colour, label=curve.label)
        if below is not None:
            below.plot(frequency, breaks_at_jumps(np.degrees(np.angle(curve.value)), 270.0), color=colour)
    for mark in np.ravel(marks):
        for axes in (above, *(() if below is None else (below,))):
            axes.axvline(mark, color="#9aa7b5", lw=0.8, ls=":")
    above.set_yscale("log")
    low, high = _widened(lowest, frequency)
    if high > low:
        lowest.set_xlim(low, high)
    if low > 0.0 and high > 20.0 * low:
        log_frequencies(lowest)
    above.set(ylabel=magnitude_label(frf_unit(result)))
    lowest.set(xlabel="frequency [Hz]")
    if below is not None:
        below.set(ylabel="phase [deg]", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    legend(above)
    return made, above


def _widened(axes: Any, x: np.ndarray) -> tuple[float, float]:
    """Limits that hold these values and those of the results drawn before."""
    before = getattr(axes, "_mbrs_limits", (np.inf, -np.inf))
    axes._mbrs_limits = (min(before[0], float(np.min(x))), max(before[1], float(np.max(x))))
    return axes._mbrs_limits  # type: ignore[no-any-return]


def _nyquist(result: Any, named: list[Curve], rest: list[Curve], ax: Any) -> tuple[Any, Any]:
    unit = frf_unit(result)
    made, axes = canvas(ax, (7.0, 6.0))
    for curve in rest:
        line = rounded(curve.value)
        axes.plot(line.real, line.imag, color=FADED, lw=0.7, zorder=1.5)
    for i, (curve, colour) in enumerate(zip(named, colours(axes, len(named)), strict=True)):
        line = rounded(curve.value)
        axes.plot(line.real, line.imag, color=colour, label=curve.label)
        if i < 4:
            _mark_peak(axes, curve, np.asarray(result.frequency, dtype=float), colour)
    axes.axhline(0.0, color="#9aa7b5", lw=0.8)
    axes.axvline(0.0, color="#9aa7b5", lw=0.8)
    axes.set_aspect("equal", adjustable="datalim")
    suffix = f" [{unit}]" if unit else ""
    axes.set(xlabel=f"Re H{suffix}", ylabel=f"Im H{suffix}")
    axes.ticklabel_format(style="sci", scilimits=(-3, 4))
    axes.margins(0.1)
    legend(axes, inside=1)
    return made, axes


def _mark_peak(axes: Any, curve: Curve, frequency: np.ndarray, colour: str) -> None:
    size = np.abs(curve.value)
    if not np.isfinite(size).any():
        return
    i = int(np.nanargmax(size))
    axes.plot(curve.value[i].real, curve.value[i].imag, "o", color=colour, ms=5)
    place = (curve.value[i].real, curve.value[i].imag)
    axes.annotate(f"{frequency[i]:.4g} Hz", place, (6, -12), textcoords="offset points", fontsize=8, color=colour)


def response(result: HasOutputs, *, ax: Axes | None = None, label: str | None = None) -> Figure:
    """Outputs over time: one axes up to ten curves, above that the ten largest coloured and the others grey.

    ``result``: a `ResponseResult` with ``t`` (n_t,) s, ``value`` (n_out, n_t), ``outputs`` (names). ``ax``,
    ``label``: axes for several results in one picture, and what to call this one there. Returns a Figure.
    """
    t, value = np.asarray(result.t, dtype=float), np.atleast_2d(np.asarray(result.value))
    if value.ndim != 2 or value.shape[1] != t.size or t.size == 0:
        raise ModelError(f"a response must be (n_out, n_t) with n_t = {t.size}, got {value.shape}")
    outputs = [str(name) for name in getattr(result, "outputs", ())]
    names = outputs if len(outputs) == value.shape[0] else [f"out{i}" for i in range(value.shape[0])]
    kind = str(getattr(result, "kind", "") or "response")
    order = sorted(range(value.shape[0]), key=lambda i: -peak(value[i]))
    with style():
        made, axes = canvas(ax, (8.5, 4.2))
        if label is not None:
            names = [label if len(names) == 1 else f"{label}: {name}" for name in names]
        shown = order[:_MOST_NAMED]
        for i in order[_MOST_NAMED:]:
            axes.plot(t, value[i], color=FADED, lw=0.7, zorder=1.5)
        for colour, i in zip(colours(axes, len(shown)), shown, strict=True):
            axes.plot(t, value[i], color=colour, label=names[i])
        low, high = _widened(axes, t)
        axes.set(xlabel="t [s]", ylabel=f"{kind} [{response_unit(result)}]", xlim=(low, high) if high > low else None)
        axes.set_title("time response")
        legend(axes)
    return made
