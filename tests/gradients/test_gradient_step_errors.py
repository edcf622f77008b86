"""The estimated error of a gradient where longer steps cannot be made, where they lose their order, and where they are few."""

from __future__ import annotations

import math

import mbrs as mb
import numpy as np
import pytest
from mbrs.gradients.motion_gradient import effects_of
from mbrs.gradients.steps import prepare, resampled


def damped(k, c, seed=0):
    """A body on a ball joint and a bushing, in no convenient direction."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=3) * 0.5
    m = mb.Model("damped", gravity=rng.normal(size=3) * 6.0)
    a = m.body("a", mass=1.0, inertia=(0.02, 0.03, 0.04), at=p)
    m.spherical("s", m.ground, a, at=(0, 0, 0))
    m.bushing("d", m.ground, a, at=p, k=(k,) * 3 + (10,) * 3, c=(c,) * 3 + (10,) * 3)
    return m


PSI = [mb.Final(lambda s: s.position("a")[0]), mb.Integral(lambda s: np.sum(s.position("a") * [1.0, -2.0, 0.7]))]
NAMES = ["a.mass", "d.k[0]", "d.c[1]"]


def gradient(m, t=0.5, **how):
    return mb.gradient(m, PSI, NAMES, t=t, **how)


def off(found, true):
    """As `.error` is relative: to the largest effect of a parameter."""
    own, others = effects_of(found, found.gradient), effects_of(true, true.gradient)
    return float((np.abs(own - others).max(axis=1) / np.abs(own).max(axis=1)).max())


@pytest.mark.parametrize("rtol", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("seed", range(2))
def test_steps_that_longer_ones_cannot_follow(seed, rtol):
    """Explicit steps beside the bound of their stability, which those of twice the length leave."""
    m = damped(1e4, 2e3, seed)
    found, true = gradient(m, scheme="explicit", rtol=rtol), gradient(m, scheme="radau", rtol=1e-12)
    error = off(found, true)
    print(f"{rtol:.0e}: error {error:.1e}, said {found.error:.1e}, {found.status}")
    assert found.status == "converged"
    assert error < 3.0 * found.error + 1e-9 and found.error < 1e-3


def test_a_failure_of_all_other_steps_is_told(monkeypatch):
    """Never an exception: no estimate is an unresolved gradient."""
    found = gradient(damped(1e3, 20.0), t=0.2, step=0.01)

    def fails(*_):
        raise mb.ConvergenceError("none")

    monkeypatch.setattr("mbrs.gradients.gradient._gradients", fails)
    assert found.error == math.inf and found.status == "unresolved"


def test_objectives_that_are_not_defined_on_other_ways():
    """A root of what is negative along coarser steps alone, by steps that a motion hardly follows."""
    m = damped(3e3, 5.0)
    plain = mb.gradient(m, mb.Final(lambda s: s.position("a")[0]), "d.k[0]", t=0.5, step=0.05, scheme="ali3p")
    at = plain.value
    coarse = mb.gradient(m, mb.Final(lambda s: s.position("a")[0]), "d.k[0]", t=0.5, step=0.1, scheme="ali3p").value
    side = 1.0 if coarse < at else -1.0
    edge = at - 0.5 * (at - coarse)
    psi = mb.Final(lambda s: np.sqrt(side * (s.position("a")[0] - edge)))
    found = mb.gradient(m, psi, "d.k[0]", t=0.5, step=0.05, scheme="ali3p")
    assert found.error > 0.0 and found.status in ("converged", "unresolved")


@pytest.mark.some(4)
@pytest.mark.parametrize("scheme", ["radau", "bdf", "ali3p", "generalized-alpha"])
@pytest.mark.parametrize(("k", "c"), [(1e4, 2e3), (1e4, 30.0), (30.0, 0.5)])
def test_fixed_steps_tell_their_error(scheme, k, c):
    """Those over a decay lose their order."""
    m = damped(k, c, 1)
    true = gradient(m, scheme="radau", rtol=1e-12)
    ratios = []
    for step in (0.02, 0.01, 0.005):
        found = gradient(m, scheme=scheme, step=step)
        error = off(found, true)
        print(f"{scheme}, k {k:.0e}, c {c:.0e}, {step}: error {error:.1e}, said {found.error:.1e}")
        if error > 1e-8:
            ratios.append(found.error / error)
    # those that are too long for the vibration are told too large
    assert min(ratios, default=1.0) > 1.0 / 3.0 and max(ratios, default=1.0) < 50.0


@pytest.mark.parametrize("scheme", ["explicit", "radau", "bdf", "ali3p"])
def test_steps_by_a_tolerance_tell_their_error(scheme):
    ratios = []
    for seed in range(4):
        m = damped(300.0, 2.0, seed)
        true = gradient(m, scheme="radau", rtol=1e-12)
        found = gradient(m, scheme=scheme, rtol=1e-4 if scheme == "ali3p" else 1e-6)
        error = off(found, true)
        ratios.append(found.error / error)
        print(f"{scheme}, {seed}: error {error:.1e}, said {found.error:.1e}, {len(found.t) - 1} steps")
    assert min(ratios) > 1.0 / 4.0 and np.median(ratios) < 10.0


@pytest.mark.parametrize("ratio", [0.5, 1.09, 1.4, 2.0])
@pytest.mark.parametrize("scheme", ["bdf", "radau"])
def test_resampled_steps_keep_what_is_held(scheme, ratio):
    """Ends, breaks and beginnings of histories; orders for which a history has room."""
    m = damped(300.0, 2.0)
    m.force("late", "a", at=(0.1, 0, 0), value=(mb.Ramp(6.0, start=0.2), 0, 0))
    kind = {"scheme": scheme, "weight": "tangent", "rho": 0.8}
    run = prepare(m, PSI, 0.5, None, 1e-6, None, (), 2**20, **kind)
    late = run.times[np.argmin(np.abs(run.times - 0.2))]
    other, found = resampled(run, ratio, [late])
    assert abs(late - 0.2) < 1e-12
    assert other.times[0] == run.times[0] and other.times[-1] == run.times[-1] and late in other.times
    assert np.all(np.diff(other.times) > 0.0) and found == pytest.approx(ratio, rel=0.3)
    assert len(other.orders) == (len(other.times) - 1 if scheme == "bdf" else 0)
    own = np.array(other.orders)
    if scheme == "bdf":
        begins, old = np.flatnonzero(own < 0), np.flatnonzero(np.array(run.orders) < 0)
        assert np.array_equal(other.times[begins], run.times[old])
        room = np.arange(len(own)) - begins[np.searchsorted(begins, np.arange(len(own)), side="right") - 1] + 1
        assert np.all(np.abs(own) <= room)
