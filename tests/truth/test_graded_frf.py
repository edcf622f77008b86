"""Receptances of chains with very soft and very stiff springs against arithmetic in 50 digits."""

from __future__ import annotations

import mbrs as mb
import mpmath
import numpy as np
import pytest
from problems import spring_row


def chain(masses, springs, dampers):
    """K and C of masses in a row, the first spring and damper to ground."""
    return np.diag(masses), spring_row(dampers), spring_row(springs)


def exact(M, C, K, omega):
    """(K - w^2 M + i w C)^-1 of the entries as doubles, in 50 digits."""
    with mpmath.workdps(50):
        w = mpmath.mpf(float(omega))
        z = mpmath.matrix(K.tolist()) - mpmath.matrix(M.tolist()) * w**2 + mpmath.matrix(C.tolist()) * mpmath.mpc(0, w)
        return np.array((z**-1).tolist(), dtype=complex)


@pytest.mark.filterwarnings("ignore:the frequency points miss")
@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("springs", [(1.0, 1e12), (1e12, 1.0), (1.0, 1e12, 3.0), (1e12, 1.0, 1e6)])
def test_receptances_of_graded_chains(springs, damped):
    rng = np.random.default_rng(17)
    masses = rng.uniform(0.7, 1.9, len(springs))
    dampers = rng.uniform(0.01, 0.05, len(springs)) if damped else np.zeros(len(springs))
    M, C, K = chain(masses, springs, dampers)
    system = mb.MechanicalSystem(M=M, C=C if damped else None, K=K)
    soft = np.sqrt(1.0 / masses.sum()) / (2 * np.pi)
    frequency = np.array([0.13, 0.71, 1.9, 37.0, 1.1e3]) * soft
    found = mb.frf(system, np.eye(len(springs)), np.eye(len(springs)), frequency=frequency)
    for k, f in enumerate(frequency):
        truth = exact(M, C, K, 2 * np.pi * f)
        off = np.abs(found.value[:, :, k] - truth).max() / np.abs(truth).max()
        assert off <= 1e-9 and off <= 4.0 * found.error + 1e-15
        if len(springs) == 2:
            # every digit, in every entry, however small
            assert found.value[:, :, k] == pytest.approx(truth, rel=1e-14, abs=0.0)
