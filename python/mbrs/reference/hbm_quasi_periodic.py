"""Quasi-periodic balance on a torus of phases in plain NumPy, by evaluation matrices: the oracle of the core."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from . import hbm_balance, hbm_laws


def solve(
    system: Any,
    terms: np.ndarray,
    omega: np.ndarray,
    indices: np.ndarray,
    n_samples: Sequence[int],
    X: np.ndarray,
    tolerance: float = 1e-12,
) -> np.ndarray:
    """Coefficients (dof, 2 n_k + 1) by Newton's method from X; ``terms`` (n_k + 1, n) are complex forces."""
    M, C, K = hbm_balance.dense(system)
    D = hbm_balance.rates(indices @ omega)
    linear = np.kron(np.eye(len(D)), K) + np.kron(D, C) + np.kron(D @ D, M)
    f = np.zeros((len(D), system.n))
    f[0], f[1::2], f[2::2] = terms[0].real, terms[1:].real, -terms[1:].imag
    tau = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in n_samples), indexing="ij")
    phases = np.tensordot(indices, np.array(tau), axes=1).reshape(len(indices), -1)
    gamma = np.empty((phases.shape[1], len(D)))
    gamma[:, 0], gamma[:, 1::2], gamma[:, 2::2] = 1.0, np.cos(phases).T, np.sin(phases).T
    inverse = gamma.T / np.sum(gamma**2, axis=0)[:, None]  # the columns are orthogonal on the grid
    y = X.T.ravel()
    for _ in range(60):
        R, J = linear @ y - f.ravel(), linear.copy()
        for law in system.elements:
            c = y.reshape(len(D), system.n) @ law.w
            value, f_u, f_v = hbm_laws.force(law, gamma @ c, gamma @ D @ c, tau[0].ravel())
            R = R + np.kron(inverse @ value, law.w)
            J = J + np.kron(inverse @ (f_u[:, None] * gamma + f_v[:, None] * (gamma @ D)), np.outer(law.w, law.w))
        step = np.linalg.solve(J, -R)
        y = y + step
        if np.max(np.abs(step)) <= tolerance * np.max(np.abs(y)):
            return y.reshape(len(D), system.n).T
    raise RuntimeError("Newton's method did not converge")
