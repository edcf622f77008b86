"""Options of `mb.root` in three groups, each checked when it is made and in the form that the core takes: the line search, where the
iteration ends or begins anew, and the estimate of the inverse Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._lib.checks import UNFIT, positive, real_array, real_number, shown
from ..errors import ModelError

METHODS = ("inverse-bfgs", "broyden")
# Iterations within which the norm must halve: fewer leave iterations that would still have converged, more spend evaluations on
# those that would not; docs/root.md measures both.
PATIENCE = 20
_ENDLESS = 2**62  # counts beyond it are never reached
# Above this H itself would take more than 32 MB and most of the time.
_LARGEST_DENSE = 2000


@dataclass(frozen=True)
class LineSearch:
    """Constants of the line search."""

    rho: float
    sigma1: float
    sigma2: float
    beta: float
    max_backtracks: int
    invariant: bool

    def __post_init__(self) -> None:
        positive("sigma1", self.sigma1)
        positive("sigma2", self.sigma2)
        _fraction("rho", self.rho)
        _fraction("beta", self.beta)
        _count("max_backtracks", self.max_backtracks)

    @property
    def core(self) -> dict[str, Any]:
        """Arguments of the core."""
        return {
            "rho": self.rho,
            "sigma1": self.sigma1,
            "sigma2": self.sigma2,
            "beta": self.beta,
            "max_backtracks": _count("max_backtracks", self.max_backtracks),
            "invariant": bool(self.invariant),
        }


@dataclass(frozen=True)
class Limits:
    """The norm at which the iteration ends, its limits, and what is tried when the norm no longer falls."""

    tol: float
    maxiter: int
    maxfev: int | None
    patience: int
    restarts: int
    fallback: bool

    def __post_init__(self) -> None:
        positive("tol", self.tol)
        for name in ("maxiter", "patience", "restarts"):
            _count(name, getattr(self, name))
        if self.maxfev is not None:
            _count("maxfev", self.maxfev)

    @property
    def core(self) -> dict[str, Any]:
        """Arguments of the core."""
        return {
            "tolerance": float(self.tol),
            "max_iterations": _count("maxiter", self.maxiter),
            "max_evaluations": _ENDLESS if self.maxfev is None else _count("maxfev", self.maxfev),
            "patience": _count("patience", self.patience),
            "restarts": _count("restarts", self.restarts),
            "fallback": bool(self.fallback),
        }


@dataclass(frozen=True)
class Estimate:
    """The inverse Jacobian: where it comes from, which update it has, which updates are left out, and how it is stored."""

    method: str
    jac0: Any
    fd_step: float
    memory: int | str | None
    sparsity: Any
    curvature: float
    determinant: tuple[float, float]

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ModelError(f"method {self.method!r} is not known; choose from {', '.join(METHODS)}")
        positive("fd_step", self.fd_step)
        if not 0 <= real_number("curvature", self.curvature) < 1:
            raise ModelError(f"curvature is {shown(self.curvature)}; give a number from 0, less than 1")
        _interval(self.determinant)

    def pairs(self, n: int) -> int | None:
        """The number of pairs (s, y) that are kept instead of H of n unknowns; None: H itself."""
        if self.memory is None:
            return None
        if isinstance(self.memory, str):
            if self.memory != "auto":
                raise ModelError(f'memory is {shown(self.memory)}; give a number of pairs, None or "auto"')
            return None if n <= _LARGEST_DENSE else 30
        if _count("memory", self.memory) == 0:
            raise ModelError("memory is 0; keep at least one pair, or None for the whole matrix")
        return int(self.memory)

    def core(self, n: int) -> dict[str, Any]:
        """Arguments of the core for n unknowns."""
        from_identity = isinstance(self.jac0, str) and self.jac0 == "identity"
        return {
            "broyden": self.method == "broyden",
            "curvature": self.curvature,
            "determinant": _interval(self.determinant),
            "differences": None if from_identity else float(self.fd_step),
            "pattern": _pattern(self.sparsity, n),
            "memory": self.pairs(n),
        }


def without_additions(search: LineSearch, limits: Limits, estimate: Estimate) -> tuple[LineSearch, Limits, Estimate]:
    """The algorithm of the source alone; arguments that ask for an addition are refused."""
    for name, value, usual in (
        ("restarts", limits.restarts, 1),
        ("patience", limits.patience, PATIENCE),
        ("memory", estimate.memory, "auto"),
        ("sparsity", estimate.sparsity, None),
    ):
        if value is not usual and not (np.isscalar(value) and value == usual):
            raise ModelError(f"plain=True is the algorithm without {name}=; leave out one of them")
    return (
        replace(search, invariant=False),
        replace(limits, patience=_ENDLESS, restarts=0, fallback=False),
        replace(estimate, memory=None, curvature=0.0),
    )


def _fraction(name: str, value: Any) -> None:
    if not 0 < real_number(name, value) < 1:
        raise ModelError(f"{name} is {shown(value)}; give a number between 0 and 1")


def _count(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise ModelError(f"{name} is {shown(value)}; give a whole number, 0 or more")
    return min(int(value), _ENDLESS)


def _interval(determinant: Sequence[float]) -> tuple[float, float]:
    low, high = real_array("determinant", determinant, (2,), "give the least and the largest ratio")
    if not 0 <= low < high:
        raise ModelError(f"determinant is ({low:g}, {high:g}); the first must be the smaller one and not negative")
    return low, high


def _pattern(sparsity: Any, n: int) -> tuple[list[int], list[int]] | None:
    if sparsity is None:
        return None
    import scipy.sparse

    try:
        pattern = scipy.sparse.csc_matrix(sparsity)
    except UNFIT:
        raise ModelError(f"sparsity must be an array or sparse matrix ({n}, {n})") from None
    if pattern.shape != (n, n):
        raise ModelError(f"sparsity has shape {pattern.shape}; it must be ({n}, {n})")
    pattern.sum_duplicates()
    return pattern.indptr.tolist(), pattern.indices.tolist()
