"""Harmonic balance condensed onto chosen coordinates, harmonic by harmonic, in plain NumPy.

x_l = Z_ll^-1 (f_l - Z_ln x_n), so that (Z_nn - Z_nl Z_ll^-1 Z_ln) x_n + F(x_n) = f_n - Z_nl Z_ll^-1 f_l for each
harmonic.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mbrs.reference import hbm_balance


def condensed_blocks(
    system: Any, force: Any, omega: float, harmonics: Sequence[int], kept: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Complex S (n_n, n_n) and g (n_n,) of the constant term and of every harmonic."""
    M, C, K = hbm_balance.dense(system)
    f = hbm_balance.force_vector(system, force, harmonics)
    rest = np.setdiff1d(np.arange(system.n), kept)
    S, g = [], []
    for j, h in enumerate([0, *harmonics]):
        w = h * omega
        Z = K - w**2 * M + 1j * w * C
        f_h = f[0] + 0j if j == 0 else f[2 * j - 1] - 1j * f[2 * j]
        solved = np.linalg.solve(Z[np.ix_(rest, rest)], np.column_stack([Z[np.ix_(rest, kept)], f_h[rest]]))
        S.append(Z[np.ix_(kept, kept)] - Z[np.ix_(kept, rest)] @ solved[:, :-1])
        g.append(f_h[kept] - Z[np.ix_(kept, rest)] @ solved[:, -1])
    return S, g


def solve(
    system: Any, force: Any, omega: float, harmonics: Sequence[int], n_samples: int, kept: np.ndarray, X: np.ndarray
) -> np.ndarray:
    """Coefficients (n_n, 2H+1) of the kept coordinates by Newton's method from X."""
    S, g = condensed_blocks(system, force, omega, harmonics, kept)
    n, n_c = len(kept), 2 * len(harmonics) + 1
    A, b = np.zeros((n * n_c, n * n_c)), np.zeros(n * n_c)
    A[:n, :n], b[:n] = S[0].real, g[0].real
    for j in range(1, len(S)):
        cos, sin = slice((2 * j - 1) * n, 2 * j * n), slice(2 * j * n, (2 * j + 1) * n)
        A[cos, cos], A[cos, sin], A[sin, cos], A[sin, sin] = S[j].real, S[j].imag, -S[j].imag, S[j].real
        b[cos], b[sin] = g[j].real, -g[j].imag
    gamma = hbm_balance.evaluation(harmonics, n_samples)
    inverse, D = np.linalg.pinv(gamma), hbm_balance.rates(np.asarray(harmonics) * omega)
    phase = 2 * np.pi * np.arange(n_samples) / n_samples
    y = X.T.ravel()
    for _ in range(50):
        R, J = A @ y - b, A.copy()
        for law in system.elements:
            w = law.w[kept]
            c = y.reshape(n_c, n) @ w
            f, f_u, f_v = hbm_balance.sampled(law, gamma @ c, gamma @ D @ c, phase)
            R = R + np.kron(inverse @ f, w)
            J = J + np.kron(inverse @ (f_u[:, None] * gamma + f_v[:, None] * (gamma @ D)), np.outer(w, w))
        step = np.linalg.solve(J, -R)
        y = y + step
        if np.max(np.abs(step)) < 1e-12 * np.max(np.abs(y)):
            return y.reshape(n_c, n).T
    raise RuntimeError("Newton's method did not converge")
