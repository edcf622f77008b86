"""Systems of matrices: random symmetric and skew ones, their first-order form, and how well modes solve their equations."""

from __future__ import annotations

import numpy as np
from mbrs.linear.matrices import MechanicalSystem
from mbrs.linear.modal_result import ModalResult

EPS = np.finfo(float).eps


def system(M, C=None, K=None, G=None, N=None) -> MechanicalSystem:
    return MechanicalSystem(M, C, K, G=G, N=N)


def spd(rng: np.random.Generator, n: int, floor: float = 0.1) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a @ a.T + floor * np.eye(n)


def skew(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a - a.T


def parts(s: MechanicalSystem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    zero = np.zeros((s.n, s.n))
    d = (zero if s.C is None else s.C) + (zero if s.G is None else s.G)
    return s.M, d, s.K + (zero if s.N is None else s.N)


def state_matrix(s: MechanicalSystem) -> np.ndarray:
    m, d, k = parts(s)
    return np.block([[np.zeros_like(m), np.eye(s.n)], [-np.linalg.solve(m, k), -np.linalg.solve(m, d)]])


def lapack_ratio(r: ModalResult, s: MechanicalSystem) -> float:
    """Largest |Q(s) x| / (n eps (|s|^2 |M| + |s| |D| + |S|) |x|), 1-norms, in coordinates of unit mass."""
    scale = 1.0 / np.sqrt(np.diag(s.M))
    m, d, k = (a * np.outer(scale, scale) for a in parts(s))
    norms = [np.abs(a).sum(axis=0).max() for a in (m, d, k)]
    worst = 0.0
    sides = [(r.shape, False)] + ([(r.left, True)] if r.left is not None else [])
    for vectors, left in sides:
        x = vectors / scale[:, None]
        turn = (lambda a: a.T) if left else (lambda a: a)
        e = r.eigenvalue
        residual = (turn(m) @ x) * e**2 + (turn(d) @ x) * e + turn(k) @ x
        size = np.abs(e) ** 2 * norms[0] + np.abs(e) * norms[1] + norms[2]
        ratio = np.abs(residual).sum(axis=0) / np.maximum(size, 1e-300) / np.abs(x).sum(axis=0)
        worst = max(worst, float(ratio.max()) / (s.n * EPS))
    return worst
