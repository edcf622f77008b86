"""Optimisation of a motion: `mb.problem` makes what `scipy.optimize.minimize` takes."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..errors import ModelError
from ..gradients.gradient import finite, gradient
from ..gradients.objectives import AtTimes, Final, Integral, Objective
from ..model.names import nearest, shown
from ..motion.tangent import value_at
from ..results import Result, derived, quantity, result
from ..system.tables import directions, tables
from .solver import FEASIBLE

if TYPE_CHECKING:
    from ..model.model import Model


# Designs whose values and gradients are kept.
_KEPT = 20


@dataclass(frozen=True)
class Bounded:
    """lower <= objective <= upper for an objective of the motion.

    Examples
    --------
    >>> import mbrs as mb
    >>> low = mb.Bounded(mb.Final(lambda s: s.position("p")[0]), upper=1.0)
    """

    objective: Objective
    lower: float = -math.inf
    upper: float = math.inf

    def __post_init__(self) -> None:
        if not isinstance(self.objective, Objective):
            raise ModelError(f"mb.Bounded takes mb.Integral, mb.Final or mb.AtTimes, got {shown(self.objective)}")
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
    lower, upper = (_plain(f"{name}= of {what}", getattr(c, name)) for name in ("lower", "upper"))
    if not lower <= upper or (lower == -math.inf and upper == math.inf) or lower == math.inf or upper == -math.inf:
        raise ModelError(f"{what} needs lower= or upper=, lower not above upper; got {c.lower} and {c.upper}")


def _mode(c: Any, what: str) -> None:
    if isinstance(c.mode, bool) or not isinstance(c.mode, (int, np.integer)) or c.mode < 0:
        raise ModelError(f"{what} takes the number of a mode, counted from 0, got {shown(c.mode)}")
    _limits(c, what)


def _plain(what: str, value: Any) -> float:
    """A number that may be infinite."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise ModelError(f"{what} must be a number, got {shown(value)}")
    return number


@result
class Optimum(Result):
    """What an optimiser found.

    Attributes
    ----------
    x
        (n_p,) parameters, in their units; the model has them now.
    value
        The objective there.
    history
        (n,) objective after every evaluation.
    violation
        (n,) how far the constraints were violated there, relative to their limits (absolute where these are 0).
    labels, units
        Of the parameters.
    message
        The optimiser's own words.
    error
        What is left of the gradient beyond active bounds and constraints, by variables over their scales, relative to the
        objective or its gradient at the start; None where the optimiser was stopped.
    """

    x: np.ndarray = quantity(dims=("parameter",))
    value: float = quantity(name="objective_at_x")
    history: np.ndarray = quantity(dims=("evaluation",), name="objective")
    labels: tuple[str, ...]
    units: tuple[str, ...]
    message: str
    violation: np.ndarray = quantity(dims=("evaluation",))

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"parameter": "labels"}

    @property
    @derived(dims=("parameter",))
    def unit(self) -> np.ndarray:
        """(n_p,) units of the parameters."""
        return np.array(self.units, dtype=str)

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "value": self.value, "message": self.message}

    def heading(self) -> str:
        return f"objective {self.value:.6g} after {len(self.history)} evaluations: {self.status} ({self.message})"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the parameters."""
        return ["parameter", "unit", "value"], [
            list(row) for row in zip(self.labels, self.units, self.x.tolist(), strict=True)
        ]

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    @property
    def kept(self) -> np.ndarray:
        """(n,) whether the constraints held at every evaluation, to 1e-4 of their limits."""
        return np.asarray(self.violation <= FEASIBLE)

    def plot(self, *, ax: Any = None, **options: Any) -> Any:
        """The objective over the evaluations."""
        from ..plot import gradients

        return gradients.convergence(self, ax=ax, **options)


@dataclass
class Problem:
    """An optimisation problem for ``scipy.optimize.minimize(p.fun, p.x0, jac=p.jac, bounds=p.bounds, constraints=p.constraints)``.

    Variables are parameters over their scales; ``unscaled`` takes them back. ``history`` holds (x, value) of every evaluation.
    Values and gradients are those of the objectives themselves; `solve` scales them for the optimiser.
    """

    model: Model
    objective: Objective
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

    def unscaled(self, z: np.ndarray) -> np.ndarray:
        """Parameters in their units."""
        return np.asarray(z, dtype=float) * self.scale

    def apply(self, z: np.ndarray) -> None:
        """Give the model the values of z."""
        self.model.set(dict(zip(self.labels, self.unscaled(z).tolist(), strict=True)))

    def _place(self, z: np.ndarray) -> bytes:
        """The model at z, and a key of all its numbers: others than the parameters may have been set as well."""
        z = np.asarray(z, dtype=float)
        if z.shape != self.x0.shape or not np.all(np.isfinite(z)):
            raise ModelError(f"the variables must be {len(self.x0)} finite numbers, got {shown(z)}")
        self.apply(z)
        return z.tobytes() + tables(self.model)["x"].tobytes() + bytes(str(self.model.structure_version), "ascii")

    def _evaluate(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values and gradients (rows) of the objective and of the bounded objectives, one motion for all."""
        key = self._place(z)
        if key not in self._known:
            goals = [self.objective, *(c.objective for c in self.limits if isinstance(c, Bounded))]
            found = gradient(self.model, goals, list(self.labels), **self.options)
            if len(self._known) >= _KEPT:
                self._known.clear()
            self._known[key] = (np.asarray(found.value), np.asarray(found.gradient) * self.scale)
            self.history.append((self.unscaled(z), float(found.value[0])))
        return self._known[key]

    def fun(self, z: np.ndarray) -> float:
        """The objective."""
        return float(self._evaluate(z)[0][0])

    def jac(self, z: np.ndarray) -> np.ndarray:
        """(n_p,) its gradient by the scaled variables."""
        return self._evaluate(z)[1][0]

    @property
    def constraints(self) -> list[dict[str, Any]]:
        """Constraints as dictionaries of `scipy.optimize.minimize`: fun(z) >= 0."""
        out, place = [], 0
        for c in self.limits:
            place += isinstance(c, Bounded)
            for sign, limit in ((1.0, c.lower), (-1.0, c.upper)):
                if math.isfinite(limit):
                    out.append(self._inequality(c, place, sign, limit))
        return out

    def _inequality(self, c: Constraint, place: int, sign: float, limit: float) -> dict[str, Any]:
        def both(z: np.ndarray) -> tuple[float, np.ndarray]:
            if isinstance(c, Bounded):
                values, gradients = self._evaluate(z)
                return float(values[place]), gradients[place]
            return self._modal(c, z)

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
        from ..linear.equilibrium import equilibrium
        from ..linear.modes import modes
        from ..linear.sensitivity import sensitivity

        found = modes(self.model, at=equilibrium(self.model)) if at_equilibrium else modes(self.model)
        by = sensitivity(found, list(self.labels))
        return {
            "frequency": np.asarray(found.frequency),
            "damping": np.asarray(found.damping),
            "d frequency": np.asarray(by.frequency),
            "d damping": np.asarray(by.damping),
        }

    def solve(self, method: str | None = None, **options: Any) -> Optimum:
        """`scipy.optimize.minimize` with everything; the model keeps the optimum.

        Parameters
        ----------
        method
            Of SciPy; one that knows bounds and constraints where there are any. "SLSQP" with constraints, else "L-BFGS-B".
        **options
            Of `scipy.optimize.minimize`: tol, options, callback. The objective is given to it relative to its value at the
            start, constraints relative to their limits, and so are tolerances.

        Returns
        -------
        Optimum
            ``status``: "converged", "infeasible" (constraints violated), "stopped" (the optimiser gave up).

        Raises
        ------
        ModelError
            A method that does not know bounds or constraints.
        ConvergenceError
            A design that the optimiser tried has no motion; ``.result`` is the best `Optimum` until then.
        Interrupted
            Ctrl-C; ``.result`` is the best `Optimum` until then, with the status "interrupted".
        """
        from .solver import solve

        return solve(self, method, options)


def problem(
    m: Model,
    objective: Objective,
    parameters: str | Sequence[str],
    t: float,
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = (),
    scale: Mapping[str, float] | None = None,
    **options: Any,
) -> Problem:
    """min objective(p) of a motion over parameters, with bounds and constraints, for `scipy.optimize`.

    Parameters
    ----------
    m
        The model; evaluations set its parameters.
    objective
        `mb.Integral`, `mb.Final` or `mb.AtTimes`.
    parameters
        Addresses of single numbers.
    t
        s; the end of the motion.
    bounds
        {address: (lower, upper)}; None or an infinite number where there is none.
    constraints
        `mb.Bounded` objectives of the motion, `mb.Frequency` and `mb.Damping` of its modes, mixed.
    scale
        {address: size}; variables are parameters over it. The present value, or 1 where that is 0.
    **options
        Of `mb.gradient`: step, rtol, method, at, ...

    Returns
    -------
    Problem
        ``fun, x0, jac, bounds, constraints``; ``solve()`` runs SciPy with them.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("one"); p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0, 0))
    >>> rail = m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x")
    >>> goal = mb.Final(lambda s: (s.position("p")[0] - 3.0) ** 2)
    >>> best = mb.problem(m, goal, ["p.velocity[0]"], t=1.0, step=0.1).solve()
    >>> round(float(best.x[0]), 6)
    3.0
    """
    along = directions(m, parameters)
    for label in along.labels:
        if along.labels.count(label) > 1:
            raise ModelError(f"{label!r} is named twice; name every parameter once")
        if math.isnan(value_at(m, label)):
            raise ModelError(
                f"{label!r} is a turn, which is no number to be varied; make the axis or orientation depend on a parameter"
            )
    _known_options(options)
    now = np.array([float(m.value(label)) for label in along.labels])
    given = [_scales(scale, along.labels).get(label) for label in along.labels]
    sizes = np.array([s or abs(p) or 1.0 for s, p in zip(given, now.tolist(), strict=True)])
    if not isinstance(objective, Objective):
        raise ModelError(f"objective= takes mb.Integral, mb.Final or mb.AtTimes, got {shown(objective)}")
    limits = _bounds(bounds, along.labels, sizes)
    wanted = () if constraints is None else constraints
    if not isinstance(wanted, (list, tuple)) or not all(isinstance(c, Constraint) for c in wanted):
        raise ModelError(
            f"constraints= takes a list of mb.Bounded, mb.Frequency and mb.Damping, got {shown(constraints)}"
        )
    return Problem(
        model=m,
        objective=objective,
        labels=along.labels,
        units=along.units,
        options={"t": finite("t", t), **options},
        scale=sizes,
        x0=now / sizes,
        bounds=limits,
        limits=tuple(wanted),
    )


def _known_options(options: Mapping[str, Any]) -> None:
    known = [name for name, p in inspect.signature(gradient).parameters.items() if p.kind is p.KEYWORD_ONLY]
    for name in options:
        if name not in known:
            guess = nearest(name, known)
            raise ModelError(
                f"mb.problem and mb.gradient have no {name}=" + (f"; did you mean {guess}=?" if guess else "")
            )


def _named(given: Any, labels: Sequence[str], what: str) -> Mapping[str, Any]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ModelError(f"{what}= takes a dictionary over the parameters, got {shown(given)}")
    for name in given:
        if name not in labels:
            raise ModelError(f"{what}= names {name!r}, which is not among the parameters {', '.join(labels)}")
    return given


def _scales(scale: Any, labels: Sequence[str]) -> dict[str, float]:
    out = {name: _plain(f"scale={{{name!r}: ...}}", size) for name, size in _named(scale, labels, "scale").items()}
    if not all(0.0 < size < math.inf for size in out.values()):
        raise ModelError("scale= takes positive finite numbers")
    return out


def _bounds(bounds: Any, labels: Sequence[str], sizes: np.ndarray) -> list[tuple[float, float]] | None:
    if not _named(bounds, labels, "bounds"):
        return None
    out = []
    for label, size in zip(labels, sizes.tolist(), strict=True):
        pair = bounds.get(label, (None, None))
        if not isinstance(pair, (tuple, list, np.ndarray)) or len(pair) != 2:
            raise ModelError(f"bounds of {label!r} are (lower, upper), got {shown(pair)}")
        low, high = (
            open_ if end is None else _plain(f"a bound of {label!r}", end)
            for end, open_ in zip(pair, (-math.inf, math.inf), strict=True)
        )
        if low > high:
            raise ModelError(f"the lower bound of {label!r}, {low:g}, is above its upper bound {high:g}")
        out.append((low / size, high / size))
    return out


__all__ = ["AtTimes", "Bounded", "Damping", "Final", "Frequency", "Integral", "Optimum", "Problem", "problem"]
