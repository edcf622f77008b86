"""SciPy's optimisers at work on a `Problem`: methods that serve it, scaling, progress, and what is kept when one fails."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from .._lib.checks import shown
from .._lib.progress import Progress
from ..errors import ConvergenceError, Interrupted, MbrsError, ModelError
from ..results import Stats
from .functions import DesignFunctions
from .optimum import FEASIBLE, Optimum

# What SciPy's methods take into account; others would leave it out silently.
_CONSTRAINED = ("SLSQP", "trust-constr", "COBYLA", "COBYQA")
_BOUNDED = (*_CONSTRAINED, "L-BFGS-B", "TNC", "Nelder-Mead", "Powell")
_ANY = (*_BOUNDED, "BFGS", "CG", "Newton-CG")
# An objective that is this small against its slope at the start passes through zero there.
_SMALL = 1e-3


def solve(p: DesignFunctions, method: Any, options: dict[str, Any]) -> Optimum:
    """See `Problem.solve`."""
    run = _Search(p, _checked(p, method))
    begin = time.perf_counter()
    try:
        with Progress("optimisation") as progress:
            r = run.minimize(progress, options)
    except KeyboardInterrupt:
        best = run.best("interrupted", "interrupted", begin) if run.tried else None
        raise Interrupted("the optimisation was interrupted; its result is the best design so far", best) from None
    except MbrsError as reason:
        if not run.tried:
            raise
        best = run.best("stopped", str(reason), begin)
        raise ConvergenceError(
            f"the optimiser tried a design that cannot be evaluated: {reason}; keep it away with bounds=. The best design so far is "
            "the result of this error",
            best,
        ) from reason
    return run.optimum(r, begin)


def _checked(p: DesignFunctions, method: Any) -> str:
    chosen = method if method is not None else "SLSQP" if p.limits else "L-BFGS-B"
    known = {name.casefold(): name for name in _ANY}
    if not isinstance(chosen, str) or chosen.casefold() not in known:
        raise ModelError(f"method= is one of {', '.join(_ANY)}, got {shown(method)}")
    name = known[chosen.casefold()]
    for what, given, able in (("constraints", p.limits, _CONSTRAINED), ("bounds", p.bounds, _BOUNDED)):
        if given and name not in able:
            raise ModelError(f"method={name!r} knows no {what} and would leave them out; take one of {', '.join(able)}")
    return name


class _Search:
    """A run of an optimiser: scaled functions for it, and the designs that it tried."""

    def __init__(self, p: DesignFunctions, method: str) -> None:
        self.problem, self.method = p, method
        # design, objective, violation, in the order of their first evaluation
        self.tried: dict[bytes, tuple[np.ndarray, float, float]] = {}
        self.limits = p.constraints
        self.sizes = [_size(c) for c in p.limits for _ in range(_sides(c))]

    def minimize(self, progress: Progress, options: dict[str, Any]) -> Any:
        from scipy.optimize import minimize

        p = self.problem
        value, slope = abs(p.fun(p.x0)), float(np.abs(p.jac(p.x0)).max())
        self.scale = max(value, _SMALL * slope) or 1.0

        def fun(z: np.ndarray) -> float:
            found = self.record(z)
            progress.advance(note=f"objective {found:.6g}")
            return found / self.scale

        constraints = [
            {
                "type": "ineq",
                "fun": lambda z, c=c, size=size: c["fun"](z) / size,
                "jac": lambda z, c=c, size=size: c["jac"](z) / size,
            }
            for c, size in zip(self.limits, self.sizes, strict=True)
        ]
        jac = None if self.method in ("Nelder-Mead", "Powell", "COBYLA", "COBYQA") else lambda z: p.jac(z) / self.scale
        given = {"bounds": p.bounds, "constraints": constraints or ()}
        return minimize(fun, p.x0, jac=jac, method=self.method, **{k: v for k, v in given.items() if v}, **options)

    def record(self, z: np.ndarray) -> float:
        z = np.array(z, dtype=float)
        value = self.problem.fun(z)
        if z.tobytes() not in self.tried:
            self.tried[z.tobytes()] = z, value, self.violation(z)
        return value

    def violation(self, z: np.ndarray) -> float:
        return max((-c["fun"](z) / size for c, size in zip(self.limits, self.sizes, strict=True)), default=0.0)

    def optimum(self, r: Any, begin: float) -> Optimum:
        z = np.asarray(r.x, dtype=float)
        self.record(z)
        holds = self.violation(z) <= FEASIBLE
        status = "infeasible" if not holds else "converged" if r.success else "stopped"
        return self.result(z, status, str(r.message), begin, self.stationarity(z))

    def stationarity(self, z: np.ndarray) -> float:
        """max |g - A^T lam| over the size of the objective at the start, min over lam >= 0: g the gradient, A the normals of the
        constraints and bounds that are active, all by the scaled variables. Zero at an optimum (Karush-Kuhn-Tucker).
        """
        from scipy.optimize import nnls

        p, n = self.problem, len(z)
        active = [c["jac"](z) / s for c, s in zip(self.limits, self.sizes, strict=True) if c["fun"](z) <= FEASIBLE * s]
        for i, (low, high) in enumerate(p.bounds or ()):
            near = FEASIBLE * max(1.0, abs(z[i]))
            active += [sign * np.eye(n)[i] for sign, gap in ((1.0, z[i] - low), (-1.0, high - z[i])) if gap <= near]
        g = p.jac(z)
        if active:
            normals = np.array(active).T
            g = g - normals @ nnls(normals, g)[0]
        size = max(abs(p.fun(p.x0)), float(np.abs(p.jac(p.x0)).max()))
        return float(np.abs(g).max()) / size if size > 0.0 else 0.0

    def best(self, status: str, message: str, begin: float) -> Optimum:
        """The least value among designs that keep to the constraints; where none does, the one that violates them least."""
        z = min(self.tried.values(), key=lambda d: (max(d[2] - FEASIBLE, 0.0), d[1]), default=(self.problem.x0,))[0]
        return self.result(z, status, message, begin)

    def result(self, z: np.ndarray, status: str, message: str, begin: float, error: float | None = None) -> Optimum:
        p = self.problem
        p.apply(z)
        values = [value for _, value, _ in self.tried.values()]
        violations = [violation for *_, violation in self.tried.values()]
        return Optimum(
            x=p.unscaled(z),
            value=self.tried[z.tobytes()][1] if self.tried else math.nan,
            history=np.array(values),
            labels=p.labels,
            units=p.units,
            message=message,
            violation=np.maximum(violations, 0.0),
            stats=Stats(time.perf_counter() - begin, {"evaluations": len(values)}, (), self.method),
            status=status,
            error=error,
        )


def _sides(c: Any) -> int:
    return math.isfinite(c.lower) + math.isfinite(c.upper)


def _size(c: Any) -> float:
    """Size by which a constraint is measured: its larger finite limit."""
    return max((abs(limit) for limit in (c.lower, c.upper) if math.isfinite(limit)), default=0.0) or 1.0
