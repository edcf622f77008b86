"""A tolerance for schemes of fixed steps: the step is shortened until the estimated error of the whole motion is within it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .errors import MbrsWarning

if TYPE_CHECKING:
    from .trajectory import Trajectory

Made = tuple[dict[str, Any], "Trajectory"]
_FIRST_PARTS = 200
_ORDER = 4
_MOST_STEPS = 2 * 10**5
_LEAST_GAIN = 0.5


def halved(make: Callable[[dict[str, Any]], Made], options: dict[str, Any]) -> Made:
    """Run with equal steps that are short enough for ``options["rtol"]``.

    ``traj.error`` compares every run with one of twice its step; the next step follows from its order, at most half and at
    least a fifth of the last one. Where shorter steps no longer help (rounding, kinks) the best run is returned with a warning.
    """
    rtol, span = options["rtol"], options["end"] - options["t"]
    fixed = {name: value for name, value in options.items() if name not in ("rtol", "first_step", "max_step")}
    step = min(options.get("first_step", span / _FIRST_PARTS), options.get("max_step", span), span)
    counts: dict[str, int] = {}
    best: tuple[float, Made] | None = None
    while True:
        made, traj = make({**fixed, "step": step})
        for name, n in traj.stats.counts.items():
            counts[name] = counts.get(name, 0) + n
        traj = replace(traj, stats=replace(traj.stats, counts=counts))
        if traj.status == "interrupted":
            return made, traj
        error = traj.error if traj.status == "finished" else None
        error = float("inf") if error is None else float(error)
        if error <= rtol:
            return made, traj
        stuck = best is not None and error > _LEAST_GAIN * best[0]
        if best is None or error < best[0]:
            best = (error, (made, traj))
        if stuck or span / step > _MOST_STEPS:
            if best[1][1].status == "finished":
                warnings.warn(
                    f"rtol={rtol:g} was not reached: shorter steps leave an estimated error of {best[0]:.1e}; the motion with "
                    f"that error is returned",
                    MbrsWarning,
                    stacklevel=3,
                )
            return best[1]
        factor = 0.9 * (rtol / error) ** (1 / _ORDER)
        step *= min(0.5, max(0.2, factor))
