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


def relative(rng, damped):
    """A random tree of masses, springs and dampers, in coordinates of mixed units."""
    n = int(rng.integers(2, 7))
    springs, masses = 10.0 ** rng.uniform(-6, 6, n), 10.0 ** rng.uniform(-6, 6, n)
    rows = np.eye(n)
    for i in range(1, n):
        before = rng.integers(-1, i)
        if before >= 0:
            rows[i, before] = -1.0
    M, K = np.diag(masses), rows.T @ np.diag(springs) @ rows
    rates = rng.uniform(0.005, 0.05, n) * np.sqrt(springs * masses)
    C = rows.T @ np.diag(rates) @ rows if damped else None
    unit = 2.0 ** rng.integers(-12, 13, n)
    return tuple(None if a is None else a * np.outer(unit, unit) for a in (M, C, K))


@pytest.mark.some(2)
@pytest.mark.filterwarnings("ignore:the frequency points miss")
@pytest.mark.parametrize("count", [5, 30])
@pytest.mark.parametrize("damped", [False, True])
def test_every_entry_of_graded_relatives(damped, count):
    """Masses and stiffnesses over 12 decades: entries as small as they may be have the digits that the result states."""
    rng = np.random.default_rng(23)
    for _ in range(25):
        M, C, K = relative(rng, damped)
        n, omega = len(M), 10.0 ** rng.uniform(-5, 5, count)
        found = mb.frf(mb.MechanicalSystem(M=M, C=C, K=K), np.eye(n), np.eye(n), omega=omega)
        for k in range(0, count, max(1, count // 5)):
            truth = exact(M, np.zeros((n, n)) if C is None else C, K, omega[k])
            own = np.abs(np.diag(truth))
            # rounding of nothing
            zero = 1e-13 * np.sqrt(np.outer(own, own))
            off = np.abs(found.value[:, :, k] - truth)
            relative_error = np.where(off <= zero, 0.0, off / np.maximum(np.abs(truth), 1e-300))
            assert relative_error.max() <= (1e-13 if count <= 8 else 1e-9)
