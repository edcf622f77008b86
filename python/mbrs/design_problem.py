"""Optimisation of a motion: `mb.problem` makes what `scipy.optimize.minimize` takes."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import ModelError
from .gradient import gradient
from .names import shown
from .objectives import AtTimes, Final, Integral, Objective
from .results import Result, Stats
from .tables import directions

if TYPE_CHECKING:
    from .model import Model


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
        _limits(self, "mb.Frequency")


@dataclass(frozen=True)
class Damping:
    """lower <= damping ratio of a mode <= upper; see `Frequency`."""

    mode: int
    lower: float = -math.inf
    upper: float = math.inf
    at_equilibrium: bool = False

    def __post_init__(self) -> None:
        _limits(self, "mb.Damping")


Constraint = Bounded | Frequency | Damping


def _limits(c: Any, what: str) -> None:
    if not c.lower <= c.upper or (c.lower == -math.inf and c.upper == math.inf):
        raise ModelError(f"{what} needs lower= or upper=, lower not above upper; got {c.lower} and {c.upper}")


@dataclass(frozen=True, eq=False, repr=False)
class Optimum(Result):
    """What an optimiser found.

    Attributes
    ----------
    x
        (n_p,) parameters, in their units; the model has them now.
    value
        The objective there.
    history
        Objective after every evaluation.
    labels, units
        Of the parameters.
    message
        The optimiser's own words.
    """

    x: np.ndarray
    value: float
    history: np.ndarray
    labels: tuple[str, ...]
    units: tuple[str, ...]
    message: str

    def __str__(self) -> str:
        from .parameter_units import unit_note
        from .report import table

        rows = list(zip(self.labels, self.units, self.x, strict=True))
        title = f"objective {self.value:.6g} after {len(self.history)} evaluations: {self.status} ({self.message})"
        return table(["parameter", "unit", "value"], rows, title=title, footer=unit_note(self.labels, self.units))

    __repr__ = __str__

    def plot(self, **options: Any) -> Any:
        """The objective over the evaluations."""
        from .plot import gradients

        return gradients.convergence(self, **options)

    def to_xarray(self) -> Any:
        """`xarray.Dataset`: the optimum over the parameters, the objective over the evaluations."""
        import xarray

        return xarray.Dataset(
            {"x": (("parameter",), self.x), "objective": (("evaluation",), self.history)},
            coords={"parameter": list(self.labels), "unit": ("parameter", list(self.units))},
            attrs={"status": self.status, "value": self.value, "message": self.message},
        )


@dataclass
class Problem:
    """An optimisation problem for ``scipy.optimize.minimize(p.fun, p.x0, jac=p.jac, bounds=p.bounds, constraints=p.constraints)``.

    Variables are parameters over their scales; ``unscaled`` takes them back. ``history`` holds (x, value) of every evaluation.
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

    def unscaled(self, z: np.ndarray) -> np.ndarray:
        """Parameters in their units."""
        return np.asarray(z, dtype=float) * self.scale

    def apply(self, z: np.ndarray) -> None:
        """Give the model the values of z."""
        self.model.set(dict(zip(self.labels, self.unscaled(z).tolist(), strict=True)))

    def _evaluate(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values and gradients (rows) of the objective and of the bounded objectives, one motion for all."""
        z = np.asarray(z, dtype=float)
        if z.shape != self.x0.shape or not np.all(np.isfinite(z)):
            raise ModelError(f"the variables must be {len(self.x0)} finite numbers, got {shown(z)}")
        key = z.tobytes()
        if key not in self._known:
            self.apply(z)
            goals = [self.objective, *(c.objective for c in self.limits if isinstance(c, Bounded))]
            found = gradient(self.model, goals, list(self.labels), **self.options)
            if len(self._known) > 20:
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
            self.apply(z)
            return self._modal(c)

        return {
            "type": "ineq",
            "fun": lambda z: sign * (both(z)[0] - limit),
            "jac": lambda z: sign * both(z)[1],
        }

    def _modal(self, c: Frequency | Damping) -> tuple[float, np.ndarray]:
        from .equilibrium import equilibrium
        from .modal import modes
        from .sensitivity import sensitivity

        m = self.model
        found = modes(m, at=equilibrium(m)) if c.at_equilibrium else modes(m)
        what = "frequency" if isinstance(c, Frequency) else "damping"
        if not 0 <= c.mode < len(found.frequency):
            raise ModelError(f"there is no mode {c.mode}; the model has {len(found.frequency)}, counted from 0")
        slope = getattr(sensitivity(found, list(self.labels)), what)
        return float(getattr(found, what)[c.mode]), np.asarray(slope)[c.mode] * self.scale

    def solve(self, method: str | None = None, **options: Any) -> Optimum:
        """`scipy.optimize.minimize` with everything; the model keeps the optimum."""
        from scipy.optimize import minimize

        begin = time.perf_counter()
        chosen = method or ("SLSQP" if self.limits else "L-BFGS-B")
        r = minimize(
            self.fun, self.x0, jac=self.jac, bounds=self.bounds, constraints=self.constraints, method=chosen, **options
        )
        self.apply(r.x)
        return Optimum(
            x=self.unscaled(r.x),
            value=float(r.fun),
            history=np.array([v for _, v in self.history]),
            labels=self.labels,
            units=self.units,
            message=str(r.message),
            stats=Stats(time.perf_counter() - begin, {"evaluations": len(self.history)}, (), chosen),
            status="converged" if r.success else "stopped",
        )


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
        {address: (lower, upper)}.
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
        if np.ndim(m.value(label)) != 0:
            raise ModelError(f"{label!r} is not a single number; vary one of its entries")
    _known_names(bounds, along.labels, "bounds")
    _known_names(scale, along.labels, "scale")
    now = np.array([float(m.value(label)) for label in along.labels])
    sizes = np.where(now == 0.0, 1.0, np.abs(now))
    for i, label in enumerate(along.labels):
        if scale and label in scale:
            sizes[i] = float(scale[label])
    if not np.all(np.isfinite(sizes)) or np.any(sizes <= 0.0):
        raise ModelError("scale= takes positive finite numbers")
    limits = None
    if bounds:
        pairs = [bounds.get(label, (-math.inf, math.inf)) for label in along.labels]
        limits = [(float(a) / s, float(b) / s) for (a, b), s in zip(pairs, sizes, strict=True)]
    for c in constraints:
        if not isinstance(c, Constraint):
            raise ModelError(f"constraints= takes mb.Bounded, mb.Frequency and mb.Damping, got {shown(c)}")
    if not isinstance(objective, Objective):
        raise ModelError(f"objective= takes mb.Integral, mb.Final or mb.AtTimes, got {shown(objective)}")
    return Problem(
        model=m,
        objective=objective,
        labels=along.labels,
        units=along.units,
        options={"t": t, **options},
        scale=sizes,
        x0=now / sizes,
        bounds=limits,
        limits=tuple(constraints),
    )


def _known_names(given: Mapping[str, Any] | None, labels: Sequence[str], what: str) -> None:
    for name in given or ():
        if name not in labels:
            raise ModelError(f"{what}= names {name!r}, which is not among the parameters {', '.join(labels)}")


__all__ = ["AtTimes", "Bounded", "Damping", "Final", "Frequency", "Integral", "Optimum", "Problem", "problem"]
