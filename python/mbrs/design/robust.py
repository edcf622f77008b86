"""Objectives over a sample of numbers that are not known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import choice, real_array, shown
from ..errors import ModelError
from .goals import Goal
from .table import Designs

if TYPE_CHECKING:
    from ..model.model import Model

_MEASURES = ("mean", "worst")


@dataclass(frozen=True, eq=False)
class Robust(Goal):
    """An objective over a sample: mean + spread * standard deviation, or the worst.

    Parameters
    ----------
    goal
        `mb.Match`, `mb.Peak` or `mb.MeanSquare`.
    sample
        `Designs` of what is not known exactly, such as `mb.design.normal`. A number that is a variable of the problem as well is
        a deviation and is added to it (a tolerance of manufacture); others are given to the model as they are.
    measure
        "mean" or "worst".
    spread
        How many standard deviations of the sample (divided by n) are added to the mean.

    Notes
    -----
    The gradient is that of the objective over this sample: mean' + spread (mean(f f') - mean f mean f') / sd; of "worst" that of the
    worst design. Cost: the goal, once for each design of the sample.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod(); p = m["payload"]
    >>> goal = mb.Peak(p.force("z"), p.motion("z"), (1.0, 100.0))
    >>> sample = mb.design.normal({"payload.mass": 20.0}, {"payload.mass": 1.0}, n=8)
    >>> best = mb.problem(m, mb.Robust(goal, sample, spread=2.0), ["c_leg"], bounds={"c_leg": (1.0, 300.0)}).solve()
    >>> round(float(best.x[0]))
    300
    """

    goal: Goal
    sample: Designs
    measure: str = field(default="mean", kw_only=True)
    spread: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.goal, Goal) or isinstance(self.goal, Robust):
            raise ModelError(f"mb.Robust takes mb.Match, mb.Peak or mb.MeanSquare, got {shown(self.goal)}")
        if not isinstance(self.sample, Designs) or not len(self.sample):
            raise ModelError(f"sample= takes a table of mb.design with at least one design, got {shown(self.sample)}")
        choice("measure", self.measure, _MEASURES)
        spread = real_array("spread", self.spread)
        if spread.shape != () or (float(spread) != 0.0 and self.measure == "worst"):
            raise ModelError("spread= is one number, and belongs to measure='mean'")

    def both(self, model: Model, labels: Sequence[str]) -> tuple[float, np.ndarray]:
        now = {name: float(model.value(name)) for name in self.sample.names}
        try:
            found = [self._one(model, labels, now, point) for point in self.sample]
        finally:
            model.set(now)
        values, slopes = np.array([f[0] for f in found]), np.array([f[1] for f in found])
        if self.measure == "worst":
            k = int(np.argmax(values))
            return float(values[k]), slopes[k]
        mean, sd = float(values.mean()), float(values.std())
        slope = slopes.mean(axis=0)
        if self.spread and sd > 0.0:
            slope = slope + self.spread * ((values - mean) @ slopes) / (len(values) * sd)
        return mean + self.spread * sd, slope

    def _one(self, model: Model, labels: Sequence[str], now: dict[str, float], point: dict[str, Any]) -> Any:
        model.set({name: now[name] + value if name in labels else value for name, value in point.items()})
        return self.goal.both(model, labels)
