"""The Campbell diagram: natural frequencies over the speed of rotation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .figure import PALETTE, canvas, colours, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .protocols import HasWhirl


def campbell(
    result: HasWhirl,
    *,
    orders: tuple[float, ...] = (1.0, 2.0),
    most: int = 16,
    ax: Axes | None = None,
    label: str | None = None,
) -> Figure:
    """Natural frequencies over the speed of rotation, with engine orders, critical speeds and forward or backward whirl.

    The axis reaches as far as the speed, the critical speeds and the two lowest modes do.

    Parameters
    ----------
    result
        A `CampbellResult`: ``speed`` (n_s,) in ``unit`` (rad/s unless it says otherwise), ``frequency`` (n_s, n) Hz,
        ``whirl`` (n_s, n) or (n,): +1 forward, -1 backward, 0 none; ``damping`` (n_s, n), of which negative values are
        marked unstable.
    orders
        Multiples of the speed drawn as dashed lines.
    most
        How many modes at most, from the lowest.
    ax, label
        Axes for several results in one picture, and what to call this one there instead of telling whirl apart.

    Returns
    -------
    matplotlib.figure.Figure
    """
    speed, frequency = np.asarray(result.speed, dtype=float), np.asarray(result.frequency, dtype=float)
    if frequency.ndim != 2 or frequency.shape[0] != speed.size or frequency.size == 0:
        raise ModelError(
            f"a Campbell diagram needs frequencies of shape (n_s = {speed.size}, n), got {frequency.shape}"
        )
    whirl = np.broadcast_to(np.asarray(getattr(result, "whirl", 0)), frequency.shape)
    unit = str(getattr(result, "unit", "") or "rad/s")
    hertz: Any = {"rad/s": speed / (2 * np.pi), "rpm": speed / 60.0, "1/min": speed / 60.0, "Hz": speed}.get(unit)
    critical = [c for c in getattr(result, "critical", ()) if c.speed <= speed[-1]]
    top = _top(frequency, hertz, critical)
    lowest = np.flatnonzero(np.min(frequency, axis=0) <= top)[:most]
    frame = str(getattr(result, "frame", "fixed"))
    with style():
        made, axes = canvas(ax, (8.0, 5.0))
        if axes.has_data():
            top = max(top, axes.get_ylim()[1])
        own = None if label is None else colours(axes, 1)[0]
        for value, colour, name in (
            (1, own or PALETTE[0], label or "forward"),
            (-1, own or PALETTE[1], label or "backward"),
            (0, own or PALETTE[7], label or "no whirl"),
        ):
            curves = [_of_whirl(frequency[:, j], whirl[:, j], value) for j in lowest]
            for place, curve in enumerate(c for c in curves if np.isfinite(c).any()):
                axes.plot(speed, curve, color=colour, label=name if place == 0 else None)
        _unstable(axes, result, speed, frequency, lowest)
        for order in orders if hertz is not None else ():
            axes.plot(speed, order * hertz, color="#6b7280", ls="--", lw=1.0)
            end = min(order * float(hertz[-1]), 0.96 * top)  # of the line, or where it leaves the picture
            if end > max(0.05 * top, order * float(hertz[0])):
                at = (float(np.interp(end, order * hertz, speed)), end)
                axes.annotate(
                    f"{order:g}x",
                    at,
                    (-6, 0),
                    textcoords="offset points",
                    ha="right",
                    va="center",
                    fontsize=9,
                    color="#6b7280",
                )
        _critical(axes, critical)
        title = "Campbell diagram" if frame == "fixed" else f"Campbell diagram, {frame} axes"
        axes.set(xlabel=f"speed [{unit}]", ylabel="frequency [Hz]", ylim=(0.0, top), title=title)
        axes.margins(x=0.0)
        legend(axes)
    return made


def _top(frequency: np.ndarray, hertz: Any, critical: Sequence[Any]) -> float:
    """The range that matters: the speed itself, all critical speeds, and the two lowest modes."""
    high = np.nanmax(frequency, axis=0)
    moving = np.sort(high[high > 0.0])
    bounds = [*moving[:2], *(c.frequency for c in critical)]
    if hertz is not None:
        reach = float(np.max(np.abs(hertz)))
        bounds += [reach, *high[np.nanmin(frequency, axis=0) <= reach].clip(max=1.5 * reach)]
    return 1.08 * float(max(bounds, default=1.0)) or 1.0


def _of_whirl(frequency: np.ndarray, whirl: np.ndarray, value: int) -> np.ndarray:
    """The part of a curve with this sense of whirl; a point without one (at rest) belongs to what it joins."""
    if len(whirl) == 1:
        return np.where(whirl == value, frequency, np.nan)
    links = np.where(whirl[1:] != 0, whirl[1:], whirl[:-1]) == value
    shown = np.zeros(len(whirl), dtype=bool)
    shown[1:] |= links
    shown[:-1] |= links
    return np.where(shown, frequency, np.nan)


def _critical(axes: Any, critical: Sequence[Any]) -> None:
    # what unbalance excites lies on top
    for fill, name in ((True, "critical, unbalance excites"), (False, "critical, unbalance does not")):
        rows = [c for c in critical if bool(c.excited) == fill]
        if rows:
            face = PALETTE[5] if fill else "white"
            axes.plot(
                [c.speed for c in rows],
                [c.frequency for c in rows],
                "o",
                color=PALETTE[5],
                mfc=face,
                ms=6,
                label=name,
                zorder=6 if fill else 5,
            )


def _unstable(axes: Any, result: Any, speed: np.ndarray, frequency: np.ndarray, modes: np.ndarray) -> None:
    damping = getattr(result, "damping", None)
    if damping is None:
        return
    negative = np.asarray(damping, dtype=float)[:, modes] < -1e-9
    if negative.any():
        at = np.broadcast_to(speed[:, None], negative.shape)
        axes.plot(at[negative], frequency[:, modes][negative], "x", color=PALETTE[5], ms=4, label="unstable")
