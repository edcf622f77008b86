"""Pseudo-arclength continuation of harmonic balance in omega, plain NumPy with a fixed step: the oracle of the core's
branches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mbrs.reference import hbm_balance


def _corrected(
    system: Any,
    force: Any,
    harmonics: Sequence[int],
    n_samples: int,
    z: np.ndarray,
    t: np.ndarray,
    centre: np.ndarray,
    ds: float,
) -> tuple[np.ndarray, np.ndarray]:
    for _ in range(30):
        R, J, R_omega = hbm_balance.residual(system, z[:-1], force, z[-1], harmonics, n_samples)
        A = np.vstack([np.column_stack([J, R_omega]), t])
        step = np.linalg.solve(A, -np.append(R, t @ (z - centre) - ds))
        z = z + step
        if np.max(np.abs(step)) < 1e-11 * max(1.0, np.max(np.abs(z))):
            tangent = np.linalg.solve(A, np.append(np.zeros(len(R)), 1.0))
            return z, tangent / np.linalg.norm(tangent)
    raise RuntimeError("the corrector did not converge")


def branch(
    system: Any,
    force: Any,
    omega: tuple[float, float],
    harmonics: Sequence[int],
    n_samples: int,
    ds: float,
    most: int = 5000,
) -> np.ndarray:
    """Points (n, (2H+1) dof + 1) of [y, omega] from omega[0] until omega[1] is passed."""
    X = hbm_balance.harmonic_balance(system, force, omega[0], harmonics, n_samples)
    z = np.append(X.T.ravel(), omega[0])
    t = np.zeros(len(z))
    t[-1] = np.sign(omega[1] - omega[0])
    z, t = _corrected(system, force, harmonics, n_samples, z, t, z, 0.0)
    points = [z]
    while (omega[1] - z[-1]) * (omega[1] - omega[0]) > 0 and len(points) < most:
        z, t = _corrected(system, force, harmonics, n_samples, z + ds * t, t, z, ds)
        points.append(z)
    return np.array(points)


def fold(system: Any, force: Any, z: np.ndarray, harmonics: Sequence[int], n_samples: int) -> np.ndarray:
    """[y, omega] with a singular dR/dy near z: Newton on R = 0, J v = 0, |v| = 1, slopes of J by differences."""
    n = len(z) - 1

    def equations(s: np.ndarray) -> np.ndarray:
        R, J, _ = hbm_balance.residual(system, s[:n], force, s[n], harmonics, n_samples)
        v = s[n + 1 :]
        return np.concatenate([R, J @ v, [v @ v - 1]])

    _, J, _ = hbm_balance.residual(system, z[:n], force, z[n], harmonics, n_samples)
    s = np.concatenate([z, np.linalg.svd(J)[2][-1]])
    for _ in range(30):
        here = equations(s)
        slopes = np.empty((len(s), len(s)))
        for i in range(len(s)):
            h = 1e-6 * max(1.0, abs(s[i]))
            e = np.zeros(len(s))
            e[i] = h
            slopes[:, i] = (equations(s + e) - equations(s - e)) / (2 * h)
        step = np.linalg.solve(slopes, -here)
        s = s + step
        if np.max(np.abs(step)) < 1e-11:
            return s[: n + 1]
    raise RuntimeError("the fold was not found")
