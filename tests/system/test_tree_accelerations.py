"""Accelerations of open trees by the recursion over their bodies, beside M a = -h of the plain reference."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.model.tables import tables
from mbrs.reference.simulate import begin
from random_models import hinged_chain, random_tree


def started(m):
    """The first instant of a motion: rates, accelerations, work."""
    traj = mb.simulate(m, 1e-9, step=1e-9, method="explicit")
    return traj.rate[0], traj.acceleration[0], traj.stats.counts


@pytest.mark.some(6)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", range(16))
def test_random_trees_accelerate_as_the_reference_says(seed):
    """All joint types, half of them reversed, arbitrary axes, springs, laws, loads; dense M of the reference in absolute coordinates."""
    rng = np.random.default_rng(1000 + seed)
    m = random_tree(rng, n=2 + seed, moving=True)
    rate, found, counts = started(m)
    s = ref.System(tables(m))
    expected = begin(s, ref.drawn_state(s), rate).a
    apart = np.abs(found - expected).max() / np.abs(expected).max()
    print(f"{len(expected)} coordinates: {apart:.1e}")
    assert counts["tree recursions"] > 0 and "mass factorisations" not in counts
    assert apart < 1e-12 + 10 * jitter.level()


def coaxial(shift, inertia=1e-30):
    """Two hinges in a row about the same axis, of which only the second moves a body with inertia."""
    m = mb.Model("coaxial", gravity=(0.3, -2.0, 9.0))
    axis = np.array([0.36, 0.48, 0.8])
    light = m.body("light", mass=1e-30, inertia=(inertia,) * 3, at=(0, 0, 0))
    heavy = m.body("heavy", mass=1.0, inertia=(0.1, 0.2, 0.25), at=(0.3, 0.1, -0.2))
    m.revolute("first", m.ground, light, at=(0, 0, 0), axis=axis)
    m.revolute("second", light, heavy, at=(shift, 0.0, 0.0), axis=axis)
    return m


def test_coordinates_without_inertia_of_their_own():
    """Axes apart: the heavy body alone moves both. Axes that coincide: M is singular, which the recursion leaves to the other route."""
    assert started(coaxial(0.2))[2]["tree recursions"] > 0
    _, found, counts = started(coaxial(0.0))
    m = mb.Model("one hinge", gravity=(0.3, -2.0, 9.0))
    heavy = m.body("heavy", mass=1.0, inertia=(0.1, 0.2, 0.25), at=(0.3, 0.1, -0.2))
    m.revolute("hinge", m.ground, heavy, at=(0, 0, 0), axis=(0.36, 0.48, 0.8))
    expected = started(m)[1]
    print(found, expected, counts)
    assert "mass factorisations" in counts and abs(found.sum() - expected[0]) < 1e-9 * abs(expected[0])


@pytest.mark.parametrize("part, route", [(2e-13, "mass factorisations"), (2e-11, "tree recursions")])
def test_inertia_that_is_rounding_beside_the_bodies_farther_out_is_left_to_factors(part, route):
    """The light body alone resists turns of the first hinge against the second; over the inertia of both about their axis."""
    axis, place = np.array([0.36, 0.48, 0.8]), np.array([0.3, 0.1, -0.2])
    about = axis**2 @ [0.1, 0.2, 0.25] + np.sum(np.cross(axis, place) ** 2)
    assert started(coaxial(0.0, part * about))[2].get(route, 0) > 0


def test_long_chains_take_one_recursion_an_evaluation():
    """Both routes on a chain of 40 hinges: the reference solves with M, whose condition grows with n^4."""
    m = hinged_chain(40)
    rate, found, counts = started(m)
    s = ref.System(tables(m))
    expected = begin(s, ref.drawn_state(s), rate).a
    apart = np.abs(found - expected).max() / np.abs(expected).max()
    print(f"apart {apart:.1e}; {counts}")
    assert apart < 1e-9 and counts["tree recursions"] == counts["force evaluations"]
