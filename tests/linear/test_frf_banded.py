"""Transfer functions of chains, whose matrices have a narrow band in some order, against solutions in 50 digits."""

from __future__ import annotations

import warnings

import mpmath
import numpy as np
import pytest
from mbrs.errors import MbrsWarning
from mbrs.linear.frf import frf
from mbrs.linear.matrices import MechanicalSystem
from problems import spring_row


def chain(rng, n, unsymmetric):
    """A chain with dampers to ground whose coordinates are shuffled, in units of different sizes; parts that turn it if wanted."""
    mixed = rng.permutation(n)
    unit = 10.0 ** rng.uniform(-3, 3, n)

    def given(A):
        return (unit[:, None] * A * unit)[np.ix_(mixed, mixed)]

    K = spring_row(1e4 * rng.uniform(0.5, 2.0, n))
    skew = np.diag(rng.normal(size=n - 1), 1) - np.diag(rng.normal(size=n - 1), -1)
    skew = 0.5 * (skew - skew.T)
    G, N = (given(5.0 * skew), given(200.0 * skew)) if unsymmetric else (None, None)
    C = np.diag(rng.uniform(0.5, 2.0, n))
    return MechanicalSystem(given(np.diag(rng.uniform(1, 2, n))), given(C), given(K), G=G, N=N)


def exact(system, places, omega):
    with mpmath.workdps(50):
        parts = [(1, system.K), (1, system.N), (1j * mpmath.mpf(omega), system.C), (1j * mpmath.mpf(omega), system.G)]
        Z = -(mpmath.mpf(omega) ** 2) * mpmath.matrix(system.M.tolist())
        for factor, A in parts:
            if A is not None:
                Z += factor * mpmath.matrix(A.tolist())
        x = mpmath.lu_solve(Z, mpmath.matrix(np.eye(system.n)[:, places[0]].tolist()))
        return np.array([complex(x[int(p)]) for p in places])


@pytest.mark.some(1)
@pytest.mark.parametrize("unsymmetric", [False, True])
def test_every_entry_keeps_its_digits(unsymmetric):
    rng = np.random.default_rng([3, unsymmetric])
    n = 40
    system = chain(rng, n, unsymmetric)
    places = [int(p) for p in rng.choice(n, 6, replace=False)]
    # to far above the highest root, where entries fall by orders from mass to mass
    omega = np.concatenate([np.linspace(2.0, 250.0, 25), [400.0, 2000.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MbrsWarning)
        h = frf(system, places, places, omega=omega)
    assert h.stats.route == "banded"
    for k in (0, 9, 26):
        expected = exact(system, places, float(omega[k]))
        gap = np.max(np.abs(h.value[:, 0, k] / expected - 1))
        print(f"{omega[k]}: {gap:.1e}, smallest over largest {np.abs(expected).min() / np.abs(expected).max():.0e}")
        assert gap < 1e-11


def test_resonances_and_rigid_motion_without_damping_are_infinite():
    n, places = 41, [0, 7, 14, 21, 28, 40]
    K = spring_row(np.ones(n))
    K[0, 0] = K[-1, -1] = 1.0  # free at both ends
    resonance = 2 * np.sin(0.5 * np.pi * 13 / n)
    omega = np.concatenate([[0.0, np.sqrt(2.0), resonance], np.linspace(0.013, 1.9, 20)])
    with pytest.warns(MbrsWarning, match="move freely"):
        h = frf(MechanicalSystem(np.eye(n), None, K), places, places, omega=omega)
    assert h.stats.route == "banded"
    assert np.all(np.isinf(h.value[:, :, 0])) and np.all(np.abs(h.value[0, 0, 2]) > 1e10)
    # at sqrt(2), between two resonances, leading blocks are in resonance
    for k in (1, *range(3, 23)):
        expected = np.linalg.inv(K - omega[k] ** 2 * np.eye(n))[np.ix_(places, places)]
        assert np.max(np.abs(h.value[:, :, k] - expected)) < 1e-10 * np.max(np.abs(expected))
