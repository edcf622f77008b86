"""Limit cycles whatever the units of coordinates, forces and time: found alike, with the same motion in those units."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.nonlinear import cycle_start


def oscillator(u, s, e, t):
    """Van der Pol's, with a coordinate in units ``u``."""
    return linear([[1.0]], [[-1.0]], [[1.0]], u, e, t, [mb.VanDerPol(e * t / s**4, w=[s / u[0]])])


def rubbing(u, s, e, t):
    """Rayleigh's oscillator under a weight: friction that falls with the speed, then rises with its cube."""
    law = mb.Polynomial1D([3.0 * e / s], velocity=[0.0, -0.4 * e * t / s**2, 0.0, 0.3 * e * t**3 / s**4], w=[s / u[0]])
    return linear([[2.0]], [[0.0]], [[5.0]], u, e, t, [law])


def deflection_and_angle(u, s, e, t):
    """A deflection that is driven, and a rotor beside it."""
    laws = [
        mb.VanDerPol(40.0 * e * t / s**4, w=[s / u[0], 0.3 * s / u[1]]),
        mb.Cubic(40.0 * e / s**4, w=[0.0, s / u[1]]),
    ]
    M, C, K = [[1.2, 0.05], [0.05, 0.4]], [[-0.8, 0.01], [0.01, 0.5]], [[90.0, 6.0], [6.0, 25.0]]
    return linear(M, C, K, u, e, t, laws)


def linear(M, C, K, u, e, t, laws):
    """A system whose coordinates are counted in units 1 / ``u``, energies in 1 / ``e``, times in 1 / ``t``."""
    unit = e / np.outer(u, u)
    return mb.MechanicalSystem(unit * t**2 * M, C=unit * t * C, K=unit * K, elements=laws)


def amplitudes(cycle, u):
    X = cycle.X[:, :9] / u[:, None]
    return np.hstack([X[:, :1], np.hypot(X[:, 1::2], X[:, 2::2])])


MADE = [oscillator, rubbing, deflection_and_angle]
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 4))]


def units(made, *seed):
    """None, and random ones."""
    n = 2 if made is deflection_and_angle else 1
    rng = np.random.default_rng(seed)
    return (np.ones(n), 1.0, 1.0, 1.0), (10 ** rng.uniform(-6, 6, n), *10 ** rng.uniform(-6, 6, 3))


@pytest.mark.parametrize("method", ["harmonic-balance", pytest.param("collocation", marks=pytest.mark.slow)])
@pytest.mark.parametrize("made", MADE)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_cycle(made, method, seed):
    plain, other = units(made, seed, 5)
    here, there = (mb.limit_cycle(made(*u), harmonics=9, method=method) for u in (plain, other))
    t, close = other[-1], 1e-9 if method == "harmonic-balance" else 1e-5
    print(f"periods {here.period:.9f}, {there.period / t:.9f}, {here.status}, {here.error:.1e}, {there.error:.1e}")
    assert there.period == pytest.approx(t * here.period, rel=close) and there.status == here.status
    a, b = amplitudes(here, plain[0]), amplitudes(there, other[0])
    assert np.allclose(b, a, rtol=0, atol=20 * close * np.abs(here.X).max())


@pytest.mark.slow
@pytest.mark.parametrize("made", MADE)
@pytest.mark.parametrize("seed", range(3))
def test_a_motion_that_repeats_itself(made, seed):
    """The start that is found by integration in time."""
    plain, other = units(made, seed, 6)
    starts = [cycle_start.by_integration(made(*u), {0: np.zeros(len(u[0]))}) for u in (plain, other)]
    assert None not in starts
    here, there = starts
    print(f"rates {here.omega:.9f}, {there.omega * other[-1]:.9f}")
    assert there.omega * other[-1] == pytest.approx(here.omega, rel=1e-4)
