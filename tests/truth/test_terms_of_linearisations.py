"""Which terms a linearisation has must not depend on units, and rounding is no term."""

from __future__ import annotations

import warnings

import jitter
import mbrs as mb
import numpy as np
import pytest

LENGTHS = [1.0, 3e-2, 1.7e-3, 2e-5, 1e-6, 4e-8]


def in_units(length: float, seed: int, load: bool) -> mb.Model:
    """A body on a bushing under a torque that follows it, drawn in this length: all frequencies are the same."""
    rng = np.random.default_rng(seed)
    at, k, kt = rng.standard_normal(3), rng.uniform(20, 40, 3), rng.uniform(10, 30, 3)
    inertia, torque = rng.uniform(0.3, 0.5, 3), rng.standard_normal(3)
    m = mb.Model("follower")
    b = m.body("b", mass=1.3, inertia=inertia * length**2, at=at * length)
    m.bushing("k", m.ground, b, at=rng.standard_normal(3) * length, k=np.r_[k, kt * length**2])
    if load:
        m.torque("t", b, value=torque * length**2, frame="body")
    return m


@pytest.mark.parametrize("seed", range(4))
def test_circulation_does_not_depend_on_units(seed):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        found = [mb.modes(in_units(length, seed, True)) for length in LENGTHS]
        assert all(mb.linearize(in_units(length, seed, True)).N is not None for length in LENGTHS)
    for r in found[1:]:
        assert np.allclose(r.eigenvalue, found[0].eigenvalue, rtol=1e-8) and list(r.kind) == list(found[0].kind)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("length", LENGTHS)
def test_symmetric_bearings_have_no_circulation(seed, length):
    """A 6 x 6 bushing that might couple across, but whose numbers are symmetric except for rounding of a rotation."""
    rng = np.random.default_rng([90, seed])
    m = in_units(length, seed, False)
    q = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    unit = np.r_[np.ones(3), np.full(3, length)]
    k = (q @ np.diag(10.0 ** rng.uniform(0, 4, 6)) @ q.T) * np.outer(unit, unit)
    k[0, 1] *= 1 + 4e-16
    m.bushing("full", m.ground, m["b"], at=rng.standard_normal(3) * length, k=k)
    lin = mb.linearize(m)
    # jitter parts the two points of a bushing, and the moments of that load are circulation off balance: k times the distance
    points = np.abs([m.value(f"{name}.at") for name in ("k", "full")]).max()
    size = np.sqrt(np.diag(lin.K))
    allowed = 100 * jitter.level() * (1 + points / length) * np.outer(size, size)
    assert lin.N is None or (jitter.seed() is not None and np.all(np.abs(lin.N) <= allowed))


@pytest.mark.parametrize("seed", range(30))
def test_rounding_of_gravity_is_no_stiffness(seed):
    """A wheel on an arbitrary axis through its centre of mass, turned anyhow, under gravity: nothing holds it."""
    rng = np.random.default_rng([7, seed])
    m = mb.Model("wheel", gravity=tuple(10 * rng.standard_normal(3)))
    axis, at = rng.standard_normal(3), rng.standard_normal(3)
    q = rng.standard_normal(4)
    b = m.body("b", mass=1.7, inertia=(0.2, 0.3, 0.4), at=at, orientation=q / np.linalg.norm(q))
    m.revolute("hinge", m.ground, b, at=at, axis=axis)
    c = m.body("c", mass=0.7, inertia=(0.2, 0.3, 0.4), at=at)
    m.revolute("second", b, c, at=at, axis=rng.standard_normal(3))
    r = mb.modes(m)
    if jitter.seed() is None:
        assert list(r.kind) == ["rigid", "rigid"] and np.all(r.frequency == 0.0)
    # with jitter the wheel is a pendulum whose arm is the noise of four points: s^2 = m g arm / inertia
    arm = 4 * jitter.level() * np.abs(at).max()
    assert np.all(r.omega**2 <= (1.7 + 0.7) * np.linalg.norm(m.gravity) * arm / 0.2)


def test_a_free_point_mass_under_gravity_is_a_singular_model_of_the_family():
    m = mb.Model("point", gravity=(0.1, 0.2, -9.81))
    m.body("p", mass=1.0, inertia=(0, 0, 0), at=(0.3, 0.4, 0.5))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        with pytest.raises(mb.SingularError, match="p\\.rx"):
            mb.modes(m)
    with pytest.warns(mb.MbrsWarning, match="p\\.z"):
        mb.linearize(m)
