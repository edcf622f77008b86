"""Harmonics that are left out and meet a natural frequency: the stated error of harmonic balance holds them."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import solve_ivp

M = np.diag([1.0, 0.02])


def resonant(natural, zeta, law):
    """A mass with a law, and a small one on a spring beside it: the second natural frequency is the given one."""
    k = 0.02 * natural**2
    for _ in range(50):
        K = np.array([[1 + k, -k], [-k, k]])
        k *= natural**2 / np.linalg.eigvals(np.linalg.solve(M, K)).real.max()
    return mb.MechanicalSystem(M, np.diag([0.05, 0.0]) + 2 * zeta / natural * K, K, elements=[law])


def laws(rng):
    """A law of each kind, odd, so that only odd harmonics answer, and what it is in plain numbers."""
    friction, speed = rng.uniform(0.08, 0.12), rng.uniform(0.08, 0.12)
    stiffness, gap = rng.uniform(4.0, 6.0), rng.uniform(0.25, 0.35)
    w = [1.0, 0.0]
    return {
        "friction": (mb.CoulombTanh(friction, speed, w=w), lambda u, v: friction * np.tanh(v / speed)),
        "stop": (
            mb.Gap(stiffness, gap, bilateral=True, w=w),
            lambda u, v: stiffness * (max(u - gap, 0.0) + min(u + gap, 0.0)),
        ),
    }


def distance(one, other, n=1500):
    """Largest distance of two motions of one period, over the largest coefficient."""
    t = np.linspace(0, one.period, n)
    return np.max(np.abs(one.displacement(t) - other.displacement(t))) / np.max(np.abs(other.X))


@pytest.mark.parametrize("kind", ["friction", "stop"])
@pytest.mark.parametrize("seed", range(3))
def test_a_resonance_of_a_harmonic_that_was_left_out_is_in_the_error(seed, kind):
    rng = np.random.default_rng([seed, len(kind)])
    omega, H = rng.uniform(0.6, 0.8), int(rng.choice([5, 7]))
    top = min(2 * H + 1, H + 6)
    order = int(rng.choice([n for n in range(top + 1, top + 6) if n % 2]))
    s = resonant(order * omega, 10.0 ** rng.uniform(-4, -3), laws(rng)[kind][0])
    given = dict(force=[rng.uniform(0.4, 0.6), 0], omega=omega)
    one = mb.harmonic_balance(s, harmonics=H, **given)
    fine = mb.harmonic_balance(s, harmonics=61, x0=one, **given)
    assert fine.error < 1e-4
    assert one.error > distance(one, fine) / 3


@pytest.mark.parametrize("condense", [False, "modal", "sparse"])
def test_condensed_systems_are_no_exception(condense):
    """Two more masses on springs, which are condensed."""
    omega = 0.7
    pair = resonant(15 * omega, 3e-4, mb.CoulombTanh(0.1, 0.1, w=[1.0, 0.0]))
    mass, K, C = (np.zeros((4, 4)) for _ in range(3))
    mass[:2, :2], K[:2, :2], C[:2, :2] = pair.M, pair.K, pair.C
    mass[[2, 3], [2, 3]] = 0.3, 0.2
    for i, j, k in ((0, 2, 0.4), (2, 3, 0.7)):
        spring = np.eye(4)[i] - np.eye(4)[j]
        K += k * np.outer(spring, spring)
        C += 0.02 * k * np.outer(spring, spring)
    elements = [mb.CoulombTanh(0.1, 0.1, w=np.eye(4)[0]), mb.Cubic(1e-9, w=np.eye(4)[1])]
    s = mb.MechanicalSystem(mass, C, K, elements=elements)
    given = dict(force=[0.5, 0, 0, 0], omega=omega)
    one = mb.harmonic_balance(s, harmonics=7, condense=condense, **given)
    fine = mb.harmonic_balance(s, harmonics=41, **given)
    assert (condense is False) == (one.stats.route == "full")
    assert one.error > distance(one, fine) / 3


@pytest.mark.parametrize("seed", range(2))
def test_automatic_harmonics_reach_the_resonance(seed):
    rng = np.random.default_rng(seed)
    tol = 1e-3
    s = resonant(15 * 0.7, 10 ** rng.uniform(-4.0, -3.5), mb.CoulombTanh(0.1, 0.1, w=[1.0, 0.0]))
    fine = mb.harmonic_balance(s, force=[0.5, 0], omega=0.7, harmonics=61)
    one = mb.harmonic_balance(s, force=[0.5, 0], omega=0.7, harmonics="auto", tol=tol)
    assert one.status == "converged" and one.harmonics[-1] >= 15
    assert distance(one, fine) < 3 * tol
    curve = mb.frequency_response(s, force=[0.5, 0], omega=[0.69, 0.7], harmonics="auto", tol=tol)
    assert curve.status == "converged" and distance(curve.point(1), fine) < 3 * tol


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["friction", "stop"])
def test_the_error_holds_the_distance_from_the_motion_of_scipy(kind):
    """Newton's method on the state after a period, integrated by DOP853."""
    rng = np.random.default_rng(7)
    omega = 0.7
    law, force = laws(rng)[kind]
    s = resonant(15 * omega, 3e-4, law)
    one = mb.harmonic_balance(s, force=[0.5, 0], omega=omega, harmonics=7)

    def rate(t, y):
        load = np.array([0.5 * np.cos(omega * t) - force(y[0], y[2]), 0.0])
        return [*y[2:], *np.linalg.solve(M, load - s.C @ y[2:] - s.K @ y[:2])]

    def flow(y, t=None):
        return solve_ivp(rate, (0, one.period), y, method="DOP853", rtol=1e-9, atol=1e-11, t_eval=t).y

    y = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
    for _ in range(5):
        steps = 1e-6 * np.eye(4)
        slopes = np.stack([(flow(y + d)[:, -1] - flow(y - d)[:, -1]) / 2e-6 for d in steps], axis=1)
        y = y + np.linalg.solve(np.eye(4) - slopes, flow(y)[:, -1] - y)
    t = np.linspace(0, one.period, 400)
    off = np.max(np.abs(flow(y, t)[:2] - one.displacement(t))) / np.max(np.abs(one.X))
    assert one.error > off / 3


def test_a_resonance_of_a_combination_is_in_the_error_of_a_torus():
    """8 w1 + 3 w2, of which five orders hold nothing."""
    w1, w2 = 0.7, 0.7 * 2**0.5 / 1.1
    s = resonant(8 * w1 + 3 * w2, 1e-4, mb.CoulombTanh(0.1, 0.1, w=[1.0, 0.0]))
    forces = [dict(force=[0.4, 0], omega=w1), dict(force=[0.4, 0], omega=w2)]
    one = mb.quasi_periodic(s, forces, harmonics=5)
    fine = mb.quasi_periodic(s, forces, harmonics=11, x0=one)
    t = np.linspace(0, 400, 6000)
    off = np.max(np.abs(one.displacement(t) - fine.displacement(t))) / np.max(np.abs(fine.X))
    assert one.error > off / 3


@pytest.mark.parametrize("seed", range(6))
def test_the_error_of_smooth_systems_without_resonance_stays_near_the_true_one(seed):
    """Strongly damped, so that no harmonic resonates: at most ten times the distance from a motion with many more harmonics."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3))
    K = A @ A.T + np.eye(3)
    w = rng.normal(size=3)
    law = (mb.Cubic(0.4, w=w), mb.VanDerPol(0.4, w=w), mb.CoulombTanh(0.2, 0.6, w=w))[seed % 3]
    s = mb.MechanicalSystem(np.eye(3), 0.2 * K, K, elements=[law])
    given = dict(force=rng.normal(size=3), omega=0.8 * np.sqrt(np.linalg.eigvalsh(K)[0]))
    one = mb.harmonic_balance(s, harmonics=5, **given)
    fine = mb.harmonic_balance(s, harmonics=31, x0=one, **given)
    assert distance(one, fine) / 3 < one.error < 10 * distance(one, fine) + 1e-12
