"""Follower loads and rotating damping in models of any size: circulatory terms scale as everything else."""

import changes
import mbrs as mb
import numpy as np
import pytest
import units


def flutter(axis):
    """A body on a bushing under a torque that turns with it: the torque makes circulatory terms."""
    m = mb.Model("flutter")
    b = m.body("b", mass=1.0, inertia=(0.2, 0.3, 0.4), at=(0, 0, 1))
    m.bushing("k", m.ground, b, at=(0, 0, 0), k=(30, 30, 30, 20, 20, 20))
    m.torque("t", b, value=tuple(axis), frame="body")
    return changes.turned(np.random.default_rng(2))(m)


def rotor(rate=60.0):
    """A disc on a soft support with damping that turns with it."""
    m = mb.Model("rotor")
    h = m.body("hub", mass=1.0, inertia=(0.02, 0.01, 0.01), at=(0, 0, 0))
    m.revolute("spin", m.ground, h, at=(0, 0, 0), axis="x")
    d = m.body("disc", mass=3.0, inertia=(0.1, 0.06, 0.06), at=(0, 0, 0))
    m.free("shaft", h, d, at=(0, 0, 0), k=(1e3, 1e3, 1e3, 50.0, 40.0, 40.0), c=(1.0, 2.0, 2.0, 0.1, 0.1, 0.1))
    return changes.turned(np.random.default_rng(3))(m), {"spin": rate}


SIZES = [1e-2, 1e-4, 1e-5, 1e-6, 1e-8]


@pytest.mark.some(2)
@pytest.mark.parametrize("size", SIZES)
def test_a_follower_torque_in_any_size(size):
    for seed in range(5):
        m = flutter(np.random.default_rng(seed).normal(size=3))
        expected = mb.modes(m)
        small = mb.modes(units.in_units(size)(m))
        assert small.status == "converged"
        assert np.sort(small.omega) == pytest.approx(np.sort(expected.omega), rel=1e-9)
        assert small.roots.real.max() == pytest.approx(expected.roots.real.max(), abs=1e-8)


@pytest.mark.parametrize("size", SIZES)
def test_rotating_damping_in_any_size(size):
    m, speed = rotor()
    expected = mb.modes(m, at=mb.steady_motion(m, speed))
    small = units.in_units(size)(m)
    found = mb.modes(small, at=mb.steady_motion(small, speed))
    a, b = (x.roots[np.lexsort((x.roots.real, np.round(x.roots.imag, 4)))] for x in (expected, found))
    assert a == pytest.approx(b, rel=1e-7, abs=1e-5)
