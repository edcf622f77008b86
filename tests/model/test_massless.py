"""Bodies with rotational inertia and no mass: accepted where every coordinate still moves inertia, refused by name where not."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import InertiaError, MbrsError, SingularError
from scipy.integrate import solve_ivp
from scipy.linalg import eigh


def arm(seed):
    """A rod without mass on a hinge carries a heavy one: the model, its equations by hand, sizes."""
    r = np.random.default_rng(seed)
    l1, c2, i1, i2, m2, k1, k2 = r.uniform(0.5, 2.0, 7)
    m = mb.Model("arm", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=0.0, inertia=(i1, i1, i1), at=(0.3 * l1, 0, 0))
    load = m.body("load", mass=m2, inertia=(i2, i2, i2), at=(l1 + c2, 0, 0))
    m.revolute("A", m.ground, rod, at=(0, 0, 0), axis="z", k=k1)
    m.revolute("B", rod, load, at=(l1, 0, 0), axis="z", k=k2)

    def mass(d):
        return np.array([[i1 + m2 * l1**2, m2 * l1 * c2 * np.cos(d)], [m2 * l1 * c2 * np.cos(d), i2 + m2 * c2**2]])

    stiffness = np.array([[k1 + k2, -k2], [-k2, k2]])

    def rates(_, y):
        (a, b), (u, v) = y[:2], y[2:]
        turning = m2 * l1 * c2 * np.sin(a - b) * np.array([-(v**2), u**2])
        weight = -m2 * 9.81 * np.array([l1 * np.cos(a), c2 * np.cos(b)])
        return np.concatenate([y[2:], np.linalg.solve(mass(a - b), turning + weight - stiffness @ y[:2])])

    return m, rates, (mass(0.0), stiffness), (l1, c2)


@pytest.mark.some(3)
@pytest.mark.parametrize("method", ["explicit", "radau", "bdf", "bdf-bfgs", "generalized-alpha", "ali3p"])
def test_a_rod_without_mass_moves_by_its_inertia(method):
    rtol = 1e-5 if method in ("generalized-alpha", "ali3p") else 1e-8
    for seed in range(3):
        m, rates, _, (l1, c2) = arm(seed)
        a, b = solve_ivp(rates, (0, 1.5), np.zeros(4), method="DOP853", rtol=1e-12, atol=1e-12).y[:2, -1]
        truth = [l1 * np.cos(a) + c2 * np.cos(b), l1 * np.sin(a) + c2 * np.sin(b), 0.0]
        error = np.abs(mb.simulate(m, t=1.5, rtol=rtol, method=method).position("load")[-1] - truth).max()
        print(f"{method}, seed {seed}: {error:.1e} m")
        assert error < 100 * rtol


@pytest.mark.parametrize("seed", range(5))
def test_modes_of_a_rod_without_mass(seed):
    m, _, (mass, stiffness), _ = arm(seed)
    found = mb.modes(m, without=("gravity",)).frequency
    known = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    assert np.allclose(np.sort(found), known, rtol=1e-12)


JOINTS = {
    "S": lambda m, b: m.prismatic("S", m.ground, b, at=(0, 0, 0), axis="x", k=3.0),
    "S.x": lambda m, b: m.planar("S", m.ground, b, at=(0, 0, 0), axis="z", k=(1.0, 1.0, 1.0)),
    "b.x": lambda m, b: m.bushing("S", m.ground, b, at=(0, 0, 0), k=(1.0,) * 6),
}


@pytest.mark.parametrize("analysis", [lambda m: mb.simulate(m, t=0.1), mb.modes], ids=["simulate", "modes"])
@pytest.mark.parametrize("coordinate", JOINTS)
def test_coordinates_that_move_no_inertia_are_named(coordinate, analysis):
    m = mb.Model("bare")
    JOINTS[coordinate](m, m.body("b", mass=0.0, inertia=(1, 1, 1), at=(0.5, 0, 0)))
    with pytest.raises(SingularError, match=rf"'{coordinate}' (moves|carries) no inertia"):
        analysis(m)


@pytest.mark.parametrize(("mass", "inertia"), [(0.0, (0, 0, 0)), (-1.0, (1, 1, 1)), (0.0, (-1, 1, 1))])
def test_what_no_body_has_is_refused(mass, inertia):
    with pytest.raises(InertiaError):
        mb.Model("m").body("b", mass=mass, inertia=inertia)
    assert issubclass(InertiaError, MbrsError)
