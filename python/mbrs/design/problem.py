"""Optimisation of a motion or of linear results: `mb.problem` makes what `scipy.optimize.minimize` takes."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from .._lib.checks import real_number
from ..errors import ModelError
from ..gradients.gradient import gradient
from ..gradients.objectives import Objective
from ..model.directions import directions
from ..model.names import nearest, shown
from ..motion.tangent import value_at
from .functions import Constraint, DesignFunctions, number_or_infinite
from .goals import Goal, Sum
from .optimum import Optimum
from .solver import solve

if TYPE_CHECKING:
    from ..gradients.gradient import GradientOptions
    from ..model.model import Model


@dataclass
class Problem(DesignFunctions):
    """An optimisation problem for ``scipy.optimize.minimize(p.fun, p.x0, jac=p.jac, bounds=p.bounds, constraints=p.constraints)``.

    Variables are parameters over their scales; ``unscaled`` takes them back. ``history`` holds (x, value) of every evaluation.
    Values and gradients are those of the objectives themselves; `solve` scales them for the optimiser.
    """

    def solve(self, method: str | None = None, **options: object) -> Optimum:
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
        return solve(self, method, options)


def problem(
    m: Model,
    objective: Objective | Goal | Sequence[Goal],
    parameters: str | Sequence[str],
    t: float | None = None,
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = (),
    scale: Mapping[str, float] | None = None,
    **options: Unpack[GradientOptions],
) -> Problem:
    """min objective(p) of a motion, of modes or of transfer functions over parameters, with bounds and constraints, for `scipy.optimize`.

    Parameters
    ----------
    m
        The model; evaluations set its parameters.
    objective
        Of a motion: `mb.Integral`, `mb.Final` or `mb.AtTimes`. Of linear results: `mb.Match`, `mb.Peak`, `mb.MeanSquare`, one of
        them over a sample, `mb.Robust`, or a list of such, which are added up.
    parameters
        Addresses of single numbers.
    t
        s; the end of the motion, where an objective or a constraint is one of a motion.
    bounds
        {address: (lower, upper)}; None or an infinite number where there is none.
    constraints
        `mb.Bounded` objectives, `mb.Frequency` and `mb.Damping` of modes, mixed.
    scale
        {address: size}; variables are parameters over it. The present value, or 1 where that is 0.
    **options
        Of `mb.gradient`: step, rtol, method, at, ...

    Returns
    -------
    Problem
        ``fun, x0, jac, bounds, constraints``; ``solve()`` runs SciPy with them.

    Raises
    ------
    ModelError
        A parameter that is named twice or is a rotation, bounds or constraints that do not fit, an unknown option.

    Notes
    -----
    Gradients of the motion: docs/theory.md (20.1), (20.2); of its modes: (9.5). Cost: one motion with its gradient per evaluation, or
    what the objectives of linear results say.

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
                f"{label!r} is a rotation and cannot be a design variable; make the axis or orientation depend on a parameter"
            )
    _known_options(options)
    now = np.array([float(m.value(label)) for label in along.labels])
    given = [_scales(scale, along.labels).get(label) for label in along.labels]
    sizes = np.array([s or abs(p) or 1.0 for s, p in zip(given, now.tolist(), strict=True)])
    goal = _objective(objective)
    limits = _bounds(bounds, along.labels, sizes)
    wanted = () if constraints is None else constraints
    if not isinstance(wanted, (list, tuple)) or not all(isinstance(c, Constraint) for c in wanted):
        raise ModelError(
            f"constraints= takes a list of mb.Bounded, mb.Frequency and mb.Damping, got {shown(constraints)}"
        )
    made = Problem(
        model=m,
        objective=goal,
        labels=along.labels,
        units=along.units,
        options=dict(options),
        scale=sizes,
        x0=now / sizes,
        bounds=limits,
        limits=tuple(wanted),
    )
    if made.motions:
        if t is None:
            raise ModelError("t= is missing: the end of the motion in s")
        made.options["t"] = real_number("t=", t, 0.0)
    elif t is not None or options:
        name = "t" if t is not None else next(iter(options))
        raise ModelError(
            f"{name}= belongs to motions, and no objective or constraint here is one of a motion; leave it out"
        )
    return made


def _objective(given: Any) -> Objective | Goal:
    if isinstance(given, Objective | Goal):
        return given
    if isinstance(given, list | tuple) and given and all(isinstance(one, Goal) for one in given):
        return Sum(tuple(given))
    raise ModelError(
        "objective= takes mb.Integral, mb.Final or mb.AtTimes of a motion, or mb.Match, mb.Peak, mb.MeanSquare or mb.Robust of linear "
        f"results, got {shown(given)}"
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
    out = {
        name: number_or_infinite(f"scale={{{name!r}: ...}}", size)
        for name, size in _named(scale, labels, "scale").items()
    }
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
            open_ if end is None else number_or_infinite(f"a bound of {label!r}", end)
            for end, open_ in zip(pair, (-math.inf, math.inf), strict=True)
        )
        if low > high:
            raise ModelError(f"the lower bound of {label!r}, {low:g}, is above its upper bound {high:g}")
        out.append((low / size, high / size))
    return out
