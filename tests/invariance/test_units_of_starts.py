"""Starts of motions, and their times, whatever the units: what contradicts, what follows a first guess, which instant is meant."""

from __future__ import annotations

import warnings

import descriptions
import mbrs as mb
import numpy as np
import pytest
from units import in_units

UNITS = [(1e-6, 1.0, 1.0), (1e6, 1e-3, 1.0), (3e-4, 1e5, 1e-9), (1.0, 1.0, 1e-12), (2e5, 1e-7, 3e8)]


def pendulums(wrong):
    """Two links that turn about their hinge at 0.3 and -0.2 rad/s, the second given ``wrong`` more along the first one."""
    m = mb.Model("pendulums", gravity=(0, 0, -9.81))
    spin = np.array([0.0, 0.3, 0.0])
    a = m.body(
        "a",
        mass=1.0,
        inertia=(0.1, 0.1, 0.1),
        at=(0.4, 0.1, 0),
        velocity=np.cross(spin, (0.4, 0.1, 0)),
        angular_velocity=spin,
    )
    m.revolute("first", m.ground, a, at=(0, 0, 0), axis="y")
    v = np.cross(spin, (0.9, 0.1, 0)) + np.cross((0, -0.2, 0), (0.5, 0, 0)) + np.array([wrong, 0.0, 0.0])
    b = m.body("b", mass=0.5, inertia=(0.1, 0.1, 0.1), at=(1.4, 0.1, 0), velocity=v, angular_velocity=(0, -0.2, 0))
    m.revolute("second", a, b, at=(0.9, 0.1, 0), axis="y")
    return m


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("wrong", [2e-10, 2e-8])
def test_velocities_that_contradict_joints_are_told(units, wrong):
    m = in_units(*units).apply(descriptions.Description.of(pendulums(wrong))).model()
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        mb.simulate(m, t=1e-3 * units[2])
    told = [str(w.message) for w in seen if "contradict" in str(w.message)]
    assert len(told) == (wrong > 1e-9), told


def guided():
    """A crank and a rod whose end slides; the crank is guessed where it is not drawn."""
    m = mb.Model("guided", gravity=(0, 0, -9.81))
    crank = m.body("crank", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.1, 0, 0.2), pose=((0.11, 0, 0.19), (1, 0, 0, 0)))
    rod = m.body("rod", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.6, 0, 0.2))
    slider = m.body("slider", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1.0, 0, 0))
    m.revolute("main", m.ground, crank, at=(0, 0, 0), axis="y")
    m.revolute("pin", crank, rod, at=(0.2, 0, 0.4), axis="y")
    m.revolute("end", rod, slider, at=(1.0, 0, 0), axis="y")
    m.prismatic("guide", m.ground, slider, at=(1.0, 0, 0), axis="x", k=20.0)
    return m


def moved_aside():
    """A slider that starts where its first guess has moved it."""
    m = mb.Model("aside")
    p = m.body("p", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0), pose=((0.3, 0, 0), (1, 0, 0, 0)))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=10.0)
    return m


def change_of_start(units, names):
    m = in_units(*units).apply(descriptions.Description.of(guided())).model()
    return mb.simulate(m, t=0.1 * units[2], step=0.02 * units[2], method="ali3p", parameters=names)


@pytest.mark.parametrize("units", UNITS)
def test_numbers_beside_a_first_guess_have_derivatives(units):
    names = ["pin.at[0]", "guide.k", "rod.mass"]
    here, there = change_of_start((1.0, 1.0, 1.0), names), change_of_start(units, names)
    a, b = np.asarray(here.sensitivity("slider.position")), np.asarray(there.sensitivity("slider.position"))
    length, mass, time = units
    parameter = np.array([length, mass / time**2, mass])
    assert np.allclose(b / length * parameter, a, rtol=1e-4, atol=1e-6 * np.abs(a).max(axis=(0, 1)))


@pytest.mark.parametrize("units", UNITS)
def test_a_guess_that_moves_the_start_is_told(units):
    m = in_units(*units).apply(descriptions.Description.of(moved_aside())).model()
    traj = mb.simulate(m, t=0.1 * units[2], method="ali3p", parameters=["p.at[0]"])
    with pytest.raises(mb.errors.NotDifferentiableError, match="pose="):
        traj.sensitivity("p.position")


@pytest.mark.parametrize("time", [1e-12, 1e-3, 1e9])
def test_an_instant_that_is_not_an_output_is_refused(time):
    m = in_units(1.0, 1.0, time).apply(descriptions.Description.of(pendulums(0.0))).model()
    traj = mb.simulate(m, t=0.3 * time, step=0.1 * time, method="ali3p", parameters=["a.mass"])
    assert traj.sensitivity_table("b.position", t=(0.1 + 0.2) * time)
    with pytest.raises(mb.ModelError, match="not an output time"):
        traj.sensitivity_table("b.position", t=0.29 * time)
