"""Harmonic balance in plain NumPy, by evaluation matrices instead of an FFT: the oracle of the core.

Coefficients (dof, 2H+1) [a0, a1, b1, ...]; as a vector harmonic by harmonic, all coordinates of one coefficient
together.
T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56 (1989) 149-154.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from . import hbm_laws


def dense(system: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C + G, K + N as dense arrays."""

    def array(a: Any) -> np.ndarray:
        if a is None:
            return np.zeros((system.n, system.n))
        return np.asarray(a.toarray() if hasattr(a, "toarray") else a, dtype=float)

    return array(system.M), array(system.C) + array(system.G), array(system.K) + array(system.N)


def evaluation(harmonics: Sequence[int], n_samples: int) -> np.ndarray:
    """Gamma (n_samples, 2H+1): samples from coefficients."""
    tau = 2 * np.pi * np.arange(n_samples) / n_samples
    columns = [np.ones(n_samples)]
    for h in harmonics:
        columns += [np.cos(h * tau), np.sin(h * tau)]
    return np.array(columns).T


def rates(frequencies: np.ndarray) -> np.ndarray:
    """Matrix of d/dt on coefficients, for the circular frequencies of the harmonics."""
    D = np.zeros((2 * len(frequencies) + 1,) * 2)
    for j, w in enumerate(frequencies):
        D[2 * j + 1, 2 * j + 2], D[2 * j + 2, 2 * j + 1] = w, -w
    return D


def force_vector(system: Any, force: Any, harmonics: Sequence[int], subharmonic: int = 1) -> np.ndarray:
    """Force coefficients (2H+1, n)."""
    out = np.zeros((2 * len(harmonics) + 1, system.n))
    for h, f in (force if isinstance(force, Mapping) else {1: force}).items():
        f = np.asarray(f, complex)
        if h == 0:
            out[0] = f.real
        else:
            j = list(harmonics).index(h * subharmonic)
            out[2 * j + 1], out[2 * j + 2] = f.real, -f.imag
    return out


def residual(
    system: Any, y: np.ndarray, force: Any, omega: float, harmonics: Sequence[int], n_samples: int, subharmonic: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R, dR/dy, dR/domega at the vector y (2H+1) n."""
    M, C, K = dense(system)
    h = np.asarray(harmonics) / subharmonic
    D, D_omega = rates(h * omega), rates(h)
    eye = np.eye(len(D))
    linear = np.kron(eye, K) + np.kron(D, C) + np.kron(D @ D, M)
    linear_omega = np.kron(D_omega, C) + np.kron(D_omega @ D + D @ D_omega, M)
    R = linear @ y - force_vector(system, force, harmonics, subharmonic).ravel()
    J, R_omega = linear.copy(), linear_omega @ y
    gamma = evaluation(harmonics, n_samples)
    inverse = np.linalg.pinv(gamma)
    phase = 2 * np.pi * np.arange(n_samples) / n_samples * subharmonic
    for law in system.elements:
        c = y.reshape(-1, system.n) @ law.w
        if law.has_memory:
            f, df = hbm_laws.march(law, gamma @ c, gamma)
            F, dF, F_omega = inverse @ f, inverse @ df, np.zeros(len(c))
        else:
            f, f_u, f_v = hbm_laws.force(law, gamma @ c, gamma @ D @ c, phase)
            F = inverse @ f
            dF = inverse @ (f_u[:, None] * gamma + f_v[:, None] * (gamma @ D))
            F_omega = inverse @ (f_v * (gamma @ D_omega @ c))
        R = R + np.kron(F, law.w)
        R_omega = R_omega + np.kron(F_omega, law.w)
        J = J + np.kron(dF, np.outer(law.w, law.w))
    return R, J, R_omega


def harmonic_balance(
    system: Any,
    force: Any,
    omega: float,
    harmonics: Sequence[int],
    n_samples: int,
    X: np.ndarray | None = None,
    subharmonic: int = 1,
    tolerance: float = 1e-12,
) -> np.ndarray:
    """Coefficients (dof, 2H+1) by plain Newton iterations from X."""
    n_c = 2 * len(harmonics) + 1
    y = np.zeros(n_c * system.n) if X is None else np.asarray(X, float).T.ravel()
    for _ in range(100):
        R, J, _ = residual(system, y, force, omega, harmonics, n_samples, subharmonic)
        step = np.linalg.solve(J, -R)
        y = y + step
        if np.max(np.abs(step)) <= tolerance * max(np.max(np.abs(y)), 1e-300):
            return y.reshape(n_c, system.n).T
    raise RuntimeError("Newton's method did not converge")
