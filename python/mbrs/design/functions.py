"""Objective and constraints of a design, and what limits them, as functions with gradients."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import UNFIT, real_array
from ..errors import ModelError
from ..gradients.gradient import gradient
from ..gradients.objectives import Objective
from ..linear.equilibrium import equilibrium
from ..linear.modes import modes
from ..linear.sensitivity import sensitivity
from ..model.names import shown
from ..model.tables import tables
from .goals import Goal

if TYPE_CHECKING:
    from ..model.model import Model

# Designs whose values and gradients are kept.
_KEPT = 20


@dataclass(frozen=True)
class Bounded:
    """lower <= objective <= upper for an objective of the motion or of linear results.

    Examples
    --------
    >>> import mbrs as mb
    >>> low = mb.Bounded(mb.Final(lambda s: s.position("p")[0]), upper=1.0)
    """

    objective: Objective | Goal
    lower: float = -math.inf
    upper: float = math.inf

    def __post_init__(self) -> None:
        if not isinstance(self.objective, Objective | Goal):
            raise ModelError(
                "mb.Bounded takes mb.Integral, mb.Final, mb.AtTimes, mb.Match, mb.Peak, mb.MeanSquare or mb.Robust, "
                f"got {shown(self.objective)}"
            )
        _limits(self, "mb.Bounded")


@dataclass(frozen=True)
class Frequency:
    """lower <= frequency of a mode <= upper (Hz), from the linear analysis at the drawn state or at equilibrium; the mode counts
    from 0 in ascending order."""

    mode: int
    lower: float = -math.inf
    upper: float = math.inf
    at_equilibrium: bool = False

    def __post_init__(self) -> None:
        _mode(self, "mb.Frequency")


@dataclass(frozen=True)
class Damping:
    """lower <= damping ratio of a mode <= upper; see `Frequency`."""

    mode: int
    lower: float = -math.inf
    upper: float = math.inf
    at_equilibrium: bool = False

    def __post_init__(self) -> None:
        _mode(self, "mb.Damping")


Constraint = Bounded | Frequency | Damping


def _limits(c: Any, what: str) -> None:
    lower, upper = (number_or_infinite(f"{name}= of {what}", getattr(c, name)) for name in ("lower", "upper"))
    if not lower <= upper or (lower == -math.inf and upper == math.inf) or lower == math.inf or upper == -math.inf:
        raise ModelError(f"{what} needs lower= or upper=, lower not above upper; got {c.lower} and {c.upper}")


def _mode(c: Any, what: str) -> None:
    if isinstance(c.mode, bool) or not isinstance(c.mode, (int, np.integer)) or c.mode < 0:
        raise ModelError(f"{what} takes the number of a mode, counted from 0, got {shown(c.mode)}")
    _limits(c, what)


def number_or_infinite(what: str, value: Any) -> float:
    """A number that may be infinite."""
    try:
        number = float(value)
    except UNFIT:
        number = math.nan
    if math.isnan(number):
        raise ModelError(f"{what} must be a number, got {shown(value)}")
    return number


@dataclass
class DesignFunctions:
    """Objective and constraints of a design with their gradients, as functions of variables: parameters over their scales."""

    model: Model
    objective: Objective | Goal
    labels: tuple[str, ...]
    units: tuple[str, ...]
    options: dict[str, Any]
    scale: np.ndarray
    x0: np.ndarray
    bounds: list[tuple[float, float]] | None
    limits: tuple[Constraint, ...]
    history: list[tuple[np.ndarray, float]] = field(default_factory=list)
    _known: dict[bytes, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    _modes: dict[tuple[bytes, bool], dict[str, np.ndarray]] = field(default_factory=dict)
    _linear: dict[tuple[bytes, int], tuple[float, np.ndarray]] = field(default_factory=dict)

    @property
    def motions(self) -> list[Objective]:
        """The objectives of the motion, that of the problem first."""
        goals = [self.objective, *(c.objective for c in self.limits if isinstance(c, Bounded))]
        return [goal for goal in goals if isinstance(goal, Objective)]

    def unscaled(self, z: np.ndarray) -> np.ndarray:
        """Parameters in their units."""
        return np.asarray(z, dtype=float) * self.scale

    def apply(self, z: np.ndarray) -> None:
        """Give the model the values of z."""
        self.model.set(dict(zip(self.labels, self.unscaled(z).tolist(), strict=True)))

    def _place(self, z: np.ndarray) -> bytes:
        """The model at z, and a key of all its numbers: others than the parameters may have been set as well."""
        z = real_array("the vector of variables", z, self.x0.shape)
        self.apply(z)
        return z.tobytes() + tables(self.model)["x"].tobytes() + bytes(str(self.model.structure_version), "ascii")

    def _evaluate(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values and gradients (rows) of all objectives of the motion, one motion for all."""
        key = self._place(z)
        if key not in self._known:
            found = gradient(self.model, self.motions, list(self.labels), **self.options)
            if len(self._known) >= _KEPT:
                self._known.clear()
            self._known[key] = (np.asarray(found.value), np.asarray(found.gradient) * self.scale)
            if isinstance(self.objective, Objective):
                self.history.append((self.unscaled(z), float(found.value[0])))
        return self._known[key]

    def _goal(self, goal: Goal, z: np.ndarray) -> tuple[float, np.ndarray]:
        """Value and gradient of an objective of linear results."""
        key = self._place(z), id(goal)
        if key not in self._linear:
            value, slope = goal.both(self.model, self.labels)
            if not (math.isfinite(value) and np.all(np.isfinite(slope))):
                raise ModelError(
                    f"mb.{type(goal).__name__} has no value or no derivative at this design; keep away with bounds="
                )
            if len(self._linear) >= _KEPT * (1 + len(self.limits)):
                self._linear.clear()
            self._linear[key] = value, slope * self.scale
            if goal is self.objective:
                self.history.append((self.unscaled(z), value))
        return self._linear[key]

    def both(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        """The objective, and its gradient (n_p,) by the scaled variables."""
        if isinstance(self.objective, Goal):
            return self._goal(self.objective, z)
        values, gradients = self._evaluate(z)
        return float(values[0]), gradients[0]

    def fun(self, z: np.ndarray) -> float:
        """The objective."""
        return self.both(z)[0]

    def jac(self, z: np.ndarray) -> np.ndarray:
        """(n_p,) its gradient by the scaled variables."""
        return self.both(z)[1]

    @property
    def constraints(self) -> list[dict[str, Any]]:
        """Constraints as dictionaries of `scipy.optimize.minimize`: fun(z) >= 0."""
        out, place = [], int(isinstance(self.objective, Objective)) - 1
        for c in self.limits:
            place += isinstance(c, Bounded) and isinstance(c.objective, Objective)
            for sign, limit in ((1.0, c.lower), (-1.0, c.upper)):
                if math.isfinite(limit):
                    out.append(self._inequality(c, place, sign, limit))
        return out

    def _inequality(self, c: Constraint, place: int, sign: float, limit: float) -> dict[str, Any]:
        def both(z: np.ndarray) -> tuple[float, np.ndarray]:
            if not isinstance(c, Bounded):
                return self._modal(c, z)
            if isinstance(c.objective, Goal):
                return self._goal(c.objective, z)
            values, gradients = self._evaluate(z)
            return float(values[place]), gradients[place]

        return {
            "type": "ineq",
            "fun": lambda z: sign * (both(z)[0] - limit),
            "jac": lambda z: sign * both(z)[1],
        }

    def _modal(self, c: Frequency | Damping, z: np.ndarray) -> tuple[float, np.ndarray]:
        key = (self._place(z), c.at_equilibrium)
        if key not in self._modes:
            if len(self._modes) >= _KEPT:
                self._modes.clear()
            self._modes[key] = self._modal_numbers(c.at_equilibrium)
        numbers, what = self._modes[key], "frequency" if isinstance(c, Frequency) else "damping"
        if c.mode >= len(numbers[what]):
            raise ModelError(f"there is no mode {c.mode}; the model has {len(numbers[what])}, counted from 0")
        value, slope = float(numbers[what][c.mode]), numbers["d " + what][c.mode] * self.scale
        if not (math.isfinite(value) and np.all(np.isfinite(slope))):
            raise ModelError(
                f"mode {c.mode} has no {what}, or none that can be differentiated (rigid, or repeated with others): limit another one"
            )
        return value, slope

    def _modal_numbers(self, at_equilibrium: bool) -> dict[str, np.ndarray]:
        found = modes(self.model, at=equilibrium(self.model)) if at_equilibrium else modes(self.model)
        by = sensitivity(found, list(self.labels))
        return {
            "frequency": np.asarray(found.frequency),
            "damping": np.asarray(found.damping),
            "d frequency": np.asarray(by.frequency),
            "d damping": np.asarray(by.damping),
        }
