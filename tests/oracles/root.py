"""F(x) = 0 by inverse quasi-Newton updates and approximate norm descent, step by step (docs/theory.md (19.1) to (19.4))."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_F1 = NDArray[np.float64]
_Fun = Callable[[_F1], _F1]


@dataclass
class Found:
    """Record of a solve: every iterate, its norm, the last H and why it ended."""

    x: _F1
    H: NDArray[np.float64]
    iterates: list[_F1] = field(default_factory=list)
    norms: list[float] = field(default_factory=list)
    backtracks: int = 0
    evaluations: int = 0
    skipped: int = 0
    fallback: int | None = None
    reason: str = "max-iterations"


def difference_jacobian(fun: _Fun, x: _F1, f: _F1, step: float = 1e-7) -> NDArray[np.float64]:
    """Forward differences with the increment step max(1, |x_j|)."""
    columns = []
    for j in range(len(x)):
        moved = x.copy()
        moved[j] += step * max(1.0, abs(x[j]))
        columns.append((fun(moved) - f) / (moved[j] - x[j]))
    return np.array(columns).T


def _inverse(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(jacobian), dtype=np.float64)


def search(
    fun: _Fun, x: _F1, d: _F1, norm: float, k: int, rho: float, sigma: float, beta: float, most: int
) -> tuple[float, _F1, int]:
    """(lambda, F(x + lambda d), backtracking steps); lambda = 0 where no step passes."""
    eta, length = 1 / (k + 1) ** 2, d @ d
    lam = 1.0
    for i in range(most + 1):
        f = fun(x + lam * d)
        size = np.linalg.norm(f)
        if i == 0 and size <= rho * norm - sigma * length:
            return lam, f, i
        if size <= (1 + eta) * norm - sigma * lam**2 * length:
            return lam, f, i
        lam *= beta
    return 0.0, f, most


def updated(
    H: NDArray[np.float64], s: _F1, y: _F1, f: _F1, lam: float, method: str, curvature: float = 1e-12
) -> NDArray[np.float64] | None:
    """H after the step s from the residual f, or None where the update would spoil it."""
    eye = np.eye(len(s))
    if method == "broyden":
        denominator = s @ H @ y
        ratio = float(s @ s / denominator) if denominator else np.inf
        new = H + np.outer(s - H @ y, s @ H) / denominator if denominator else H
    else:
        ys = y @ s
        if abs(ys) <= curvature * np.linalg.norm(y) * np.linalg.norm(s):
            return None
        ratio = float(-lam * (s @ f) / ys)
        left = eye - np.outer(s, y) / ys
        new = left @ H @ left.T + np.outer(s, s) / ys
    return new if 1e-10 <= abs(ratio) <= 1e10 else None


def root(
    fun: _Fun,
    x0: _F1,
    method: str = "inverse-bfgs",
    jac0: str = "fd",
    tol: float = 1e-10,
    maxiter: int = 500,
    fallback: bool = True,
    restarts: int = 1,
    patience: int = 20,
    H0: NDArray[np.float64] | None = None,
    rho: float = 0.9,
    sigma: float = 1e-3,
    beta: float = 0.5,
    max_backtracks: int = 60,
    invariant: bool = True,
    curvature: float = 1e-12,
) -> Found:
    """The method of `mbrs.root` with whole matrices: O(n^3) per iteration, for checks."""

    def counted(x: _F1) -> _F1:
        out.evaluations += 1
        return np.array(fun(x), dtype=float)

    x = np.array(x0, dtype=float)
    out = Found(x, np.eye(len(x)) if H0 is None else H0.copy())
    f = counted(x)
    first = best = (x, f)
    if H0 is None and jac0 == "fd":
        out.H = _inverse(difference_jacobian(counted, x, f))
    out.iterates, out.norms = [x], [float(np.linalg.norm(f))]
    halved, since, tries, update, unit = out.norms[0], 0, 0, method, 0.0
    k = begun = 0
    while k < maxiter:
        norm = float(np.linalg.norm(f))
        if norm <= tol:
            break
        d = -out.H @ f
        if unit == 0.0:
            unit = min(1.0, norm / float(d @ d)) if invariant else 1.0
        lam, reached, back = search(counted, x, d, norm, k - begun, rho, unit * sigma, beta, max_backtracks)
        out.backtracks += back
        trouble = lam == 0.0
        if not trouble:
            if np.linalg.norm(reached) > tol:
                new = updated(out.H, lam * d, reached - f, f, lam, update, curvature)
                out.skipped += new is None
                out.H = out.H if new is None else new
            x, f, k = x + lam * d, reached, k + 1
            norm = float(np.linalg.norm(f))
            out.iterates.append(x)
            out.norms.append(norm)
            best = (x, f) if norm < np.linalg.norm(best[1]) else best
            if norm <= 0.5 * halved:
                halved, since = norm, k
            trouble = k - since >= patience and norm > tol
        if trouble:
            tries += 1
            if tries > restarts and (not fallback or method == "broyden" or tries > restarts + 2):
                out.reason = "stalled" if lam else "line-search"
                break
            if tries > restarts:
                update = "broyden"
                out.fallback = k if out.fallback is None else out.fallback
            x, f = first if tries == restarts + 2 else best
            halved, since, unit = float(np.linalg.norm(f)), k, 0.0
            begun = k if tries == restarts + 2 else begun
            out.H = _inverse(difference_jacobian(counted, x, f))
    out.x = x
    if np.linalg.norm(f) <= tol:
        out.reason = "converged"
    else:
        out.x = best[0]
    return out
