"""`mb.check_gradients` at double roots: right derivatives are confirmed, wrong ones are not."""

from __future__ import annotations

import importlib
from types import SimpleNamespace

import jitter
import mbrs as mb
import numpy as np
import pytest
from scipy.spatial.transform import Rotation


def symmetric_top(rng):
    """A body of revolution on equal springs around its axis: every root but those of its own axis is double."""
    m = mb.Model("top")
    R, r, k = (
        Rotation.random(random_state=int(rng.integers(10**6))).as_matrix(),
        rng.uniform(0.3, 0.7),
        rng.uniform(50.0, 90.0),
    )
    inertia = R @ np.diag([1.0, 1.0, 1.7]) @ R.T
    b = m.body("b", mass=float(rng.uniform(1.0, 3.0)), inertia=inertia, at=(0, 0, 0))
    for i in range(3):
        angle = 2.0 * np.pi * i / 3.0 + 0.3
        arm = R @ np.array([r * np.cos(angle), r * np.sin(angle), 0.4 * r])
        foot = R @ np.array([2.3 * r * np.cos(angle), 2.3 * r * np.sin(angle), -1.3 * r])
        out = R @ np.array([-1.1 * r * np.sin(angle), 1.1 * r * np.cos(angle), 0.9 * r])
        m.spring_damper(f"s{i}", m.ground, b, at=(foot, arm), k=k, c=0.01 * k)
        m.spring_damper(f"t{i}", m.ground, b, at=(arm + out, arm), k=0.7 * k, c=0.01 * k)
    return m


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(4))
def test_double_roots_that_a_parameter_splits_are_confirmed(seed):
    rng = np.random.default_rng(seed)
    m = symmetric_top(rng)
    found = mb.modes(m)
    assert any(len(group) > 1 for group in found.clusters), "the model has no double roots"
    names = ["s0.k", "t1.c", f"s{seed % 3}.at_b[{seed % 3}]", f"t{seed % 3}.at_a[{(seed + 1) % 3}]", "b.mass"]
    check = mb.check_gradients(mb.modes, m, names)
    print(check)
    assert check
    # and the halves do go apart along one of them
    rates = mb.sensitivity(mb.modes(m), names).eigenvalue
    assert max(np.ptp(rates[list(g)].imag, axis=0).max() for g in found.clusters if len(g) > 1) > 1e-3


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("wrong", [lambda d: 1.001 * d, lambda d: -d, lambda d: d[::-1], lambda d: d + 1e-3j])
def test_wrong_derivatives_are_still_found(wrong, monkeypatch):
    module = importlib.import_module("mbrs.studies.gradients")

    m = symmetric_top(np.random.default_rng(7))
    right = module.sensitivity

    def changed(result, parameters):
        return SimpleNamespace(eigenvalue=wrong(np.asarray(right(result, parameters).eigenvalue)))

    monkeypatch.setattr(module, "sensitivity", changed)
    assert not mb.check_gradients(mb.modes, m, ["s0.k", "t1.at_a[0]"])


@pytest.mark.parametrize("size", [1e3, 1.0, 1e-3, 1e-6])
def test_small_and_large_parts_are_checked_alike(size):
    """Lengths over ``size``, stiffness and inertia over its square: the same frequency, derivatives over the values the same."""
    rng = np.random.default_rng(3)
    m = mb.Model("seesaw", gravity=(0, 0, 0))
    k, J, d = (m.parameter(n, v * size**p) for n, v, p in (("k", 9.1, 2), ("J", 0.23, 2), ("d", 0.37, 1)))
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, rng.normal(size=3))
    b = m.body("b", mass=0.9, inertia=(J, J, J), at=[x * d for x in across])
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=axis, k=k)
    found = mb.check_gradients(mb.modes, m, ["k", "J", "d"])
    inertia = J.value + 0.9 * d.value**2 * (across @ across)
    f = np.sqrt(k.value / inertia) / (2 * np.pi)
    share = -0.5 / inertia * np.array([J.value, 1.8 * d.value**2 * (across @ across)])
    exact = f * np.array([0.5, *share]) / [k.value, J.value, d.value]
    derivative = np.array([mb.sensitivity(mb.modes(m), p).frequency.ravel()[0] for p in ("k", "J", "d")])
    assert np.abs(derivative / exact - 1.0).max() < 1e-9 + 1e3 * jitter.level()
    assert np.all(found.ok) and np.all(found.noise < 1e-7)


@pytest.mark.parametrize("address", ["b.com[0]", "b.inertia[0, 1]", "s0.at_a[2]"])
@pytest.mark.parametrize("length, mass", [(1.0, 1.0), (1e-6, 1e-12), (3e4, 7e9)])
def test_numbers_that_are_zero_have_the_step_of_their_kind(length, mass, address):
    """A body on springs in units of any size: derivatives along what is zero are confirmed, and wrong ones are not."""
    rng = np.random.default_rng(5)
    m = mb.Model("zeros", gravity=(0, 0, 0))
    inertia = np.diag([1.0, 1.3, 1.7]) * mass * length**2
    b = m.body("b", mass=mass, inertia=inertia, at=(0, 0, 0), com=(0.0, 0.1 * length, 0.2 * length))
    for i in range(7):
        foot, arm = rng.normal(size=(2, 3)) * length * [[2.0], [0.5]]
        foot[2] *= i > 0
        m.spring_damper(f"s{i}", m.ground, b, at=(foot, arm), k=float(mass * rng.uniform(50.0, 90.0)))
    assert m.value(address) == 0.0
    found = mb.check_gradients(mb.modes, m, [address])
    print(f"{found.error[0]:.1e}, noise {found.noise[0]:.1e}")
    assert found.ok[0] and found.noise[0] < 1e-6
