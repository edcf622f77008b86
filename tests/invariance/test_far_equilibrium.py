"""Equilibrium of models far from the origin of the world: it is found, as well as rounding of places resolves stiff parts."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from changes import moved, turned
from mbrs.system.compiled import compiled
from random_models import random_loop, random_tree
from units import in_units

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
KINDS = ("planar", "spherical", "universal", "prismatic", "revolute", "cylindrical", "free")
LOOPS = [
    ("spherical", "universal", "cylindrical", "spherical"),
    ("revolute", "free", "universal", "planar", "spherical"),
]


def graded(seed):
    """A random tree or loop in which half of the springs are stiffer by up to nine orders, and three distances of up to 1e6."""
    rng = np.random.default_rng([seed, 7])
    if rng.random() < 0.6:
        m = random_tree(rng, int(rng.integers(1, 5)), tuple(rng.choice(KINDS, 3)))
    else:
        m = random_loop(rng, LOOPS[int(rng.integers(2))], rod=bool(rng.integers(2)))
    stiffen_half(m, rng)
    return m, 10 ** np.random.default_rng(seed).uniform(0, 6, 3)


def graded_loop(seed):
    """Such a loop, and the random numbers that go on behind it."""
    rng = np.random.default_rng([seed, 77])
    m = random_loop(rng, LOOPS[int(rng.integers(2))], rod=bool(rng.integers(2)))
    stiffen_half(m, rng)
    return m, rng


def stiffen_half(m, rng):
    factor = 10 ** rng.uniform(0, 9)
    stiff = [f"{e.name}.k" for e in m.elements if rng.random() < 0.5]
    m.set({address: np.asarray(m.value(address)) * factor for address in stiff})


def angles(a, b):
    """Largest angle between the bodies of two results, rad."""
    turned_by = np.einsum("bij,bkj->bik", a.poses["rotation"], b.poses["rotation"])
    return np.abs(turned_by - np.eye(3)).max()


def off_and_stated(m, rng, distance):
    """Distance between the equilibria of the same points far away and near to the origin, and the sum of their stated errors."""
    length = compiled(m).characteristic_length
    change = turned(rng, distance * length)
    far = change(m)
    found, near = mb.equilibrium(far), mb.equilibrium(moved(-change.shift)(far))
    off = np.abs(found.poses["position"] - near.poses["position"] - change.shift).max() / length
    stated = found.error + near.error
    print(
        f"{distance:.0e}: {found.status}, {found.iterations}, off {off:.1e}, {angles(found, near):.1e}, stated {stated:.1e}"
    )
    return max(off, angles(found, near)), stated


@pytest.mark.parametrize("seed", [8, 72, 157, 181, *(pytest.param(s, marks=pytest.mark.slow) for s in range(60))])
def test_the_error_far_from_the_origin_is_stated(seed):
    """In mixed units, at distances of up to 1e4 lengths: the stated errors are at least a third of the distance between the equilibria of
    the same points far away and near to the origin."""
    if jitter.level():
        pytest.skip("noise on far places moves points")
    rng = np.random.default_rng([seed, 8])
    m, _ = graded(seed)
    unit = 10 ** rng.uniform(-3, 3)
    m = in_units(unit, 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-2, 2))(m)
    for distance in (*10 ** rng.uniform(0, 4, 2), 1e4):
        off, stated = off_and_stated(m, rng, distance)
        assert off <= 3 * stated


@pytest.mark.parametrize("n", [5, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("distance", [1.0, 1e2, 1e4, 1e6])
def test_the_error_of_graded_loops_is_stated(distance, n):
    """Loops alone: the stated errors are at least a third of the distance, and in the median at most a hundred times as much."""
    if jitter.level():
        pytest.skip("noise on far places moves points")
    shares, eps = [], np.finfo(float).eps
    for seed in range(n):
        m, rng = graded_loop(seed)
        off, stated = off_and_stated(m, rng, distance)
        # places and angles are compared with the rounding of their differences
        assert off <= 3 * stated + 4 * eps
        shares.append(off / stated)
    assert np.median(shares) > 0.01


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(s, marks=pytest.mark.slow) for s in range(2, 60))])
def test_far_from_the_origin_an_equilibrium_is_found(seed):
    """The same points, with what their places far away leave of them, near to the origin."""
    if jitter.level():
        pytest.skip("noise on far places moves points")
    m, distances = graded(seed)
    for distance in distances:
        change = turned(np.random.default_rng(seed), distance)
        far = change(m)
        found, near = mb.equilibrium(far), mb.equilibrium(moved(-change.shift)(far))
        length = compiled(m).characteristic_length
        off = np.abs(found.poses["position"] - near.poses["position"] - change.shift).max() / length
        rounding = np.finfo(float).eps * distance / length
        print(f"{distance:.0e}: {found.status}, off {off:.1e}, error {found.error:.1e}, rounding {rounding:.1e}")
        assert off < m.tolerance + found.error + near.error
        assert found.status == "converged" or found.doubts


@pytest.mark.parametrize(
    ("of", "seed"),
    [(graded, 8), (graded_loop, 37), *(pytest.param(graded, s, marks=pytest.mark.slow) for s in range(60))],
)
def test_a_search_ends_in_every_world(of, seed):
    """And soon: where Newton's method stops at a singular stiffness, as it may with moments that follow bodies, it does not depend on the
    world whether the search goes on; along a stiff strut steps are as long as elsewhere."""
    m, _ = of(seed)
    length = compiled(m).characteristic_length
    for world in range(8):
        change = turned(np.random.default_rng([seed, world]), length)
        found = mb.equilibrium(moved(-change.shift)(change(m)))
        print(f"world {world}: {found.status} after {found.iterations} iterations, error {found.error:.1e}")
        assert found.error < m.tolerance and found.iterations < 100
