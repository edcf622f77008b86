"""Solves that keep the imaginary part analytic: pivots from the real part, transposes where textbooks conjugate."""

from __future__ import annotations

import numpy as np

from .so3 import Array

RANK_TOLERANCE = 1e-9


def pivots(A: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Columns that a column-pivoted QR factorisation of the real part takes before the diagonal falls below
    tolerance |R_00|.
    """
    import scipy.linalg

    if A.size == 0:
        return np.zeros(0, dtype=int)
    r, order = scipy.linalg.qr(A.real, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(r))
    rank = int(np.sum(diagonal > tolerance * max(diagonal[0], 1e-300)))
    return order[:rank]


def orthogonal(A: Array) -> tuple[Array, Array]:
    """A = Q R with Q^T Q = 1 (transpose, also for complex A), by Gram and Schmidt, twice for orthogonality; full
    column rank.
    """
    Q, n = np.array(A, dtype=np.result_type(A, float)), A.shape[1]
    R = np.zeros((n, n), dtype=Q.dtype)
    for j in range(n):
        for _ in range(2):
            h = Q[:, :j].T @ Q[:, j]
            Q[:, j] = Q[:, j] - Q[:, :j] @ h
            R[:j, j] += h
        R[j, j] = np.sqrt(np.sum(Q[:, j] * Q[:, j]))
        Q[:, j] = Q[:, j] / R[j, j]
    return Q, R


def minimum_norm(A: Array, b: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """The least-norm one of the least-squares solutions of A x = b, A of any rank: A = L X with L of full column rank.

    L is an orthonormal basis of the range from pivoted columns, so X = L^T A has full row rank.
    """
    keep = pivots(A, tolerance)
    if keep.size == 0:
        return np.zeros((A.shape[1], *b.shape[1:]), dtype=np.result_type(A, b))
    L, _ = orthogonal(A[:, keep])
    Q, R = orthogonal((L.T @ A).T)
    return Q @ np.linalg.solve(R.T, L.T @ b)
