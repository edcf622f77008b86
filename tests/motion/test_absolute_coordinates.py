"""coordinates="absolute": bodies with coordinates of their own, all joints as rows. The motion is that of the tree."""

from __future__ import annotations

import pickle
from collections import Counter

import mbrs as mb
import numpy as np
import pytest
from random_models import random_loop, random_tree

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")


def test_the_equations_of_the_swing_are_those_of_the_source():
    """Five rows of each hinge and one of the drive on two bodies with six coordinates; in the tree only the drive is a row."""
    m = mb.examples.swing()
    traj = mb.simulate(m, t=0.3, step=2e-3, method="bdf-bfgs", coordinates="absolute")
    system = traj.snapshot.system
    assert system.n_tree == 12 and Counter(system.topology()["row_joint"]) == {"m": 5, "n": 5, "motor": 1}
    tree = mb.simulate(m, t=0.3, step=2e-3, method="bdf-bfgs")
    assert tree.snapshot.system.n_tree == 2 and len(tree.snapshot.system.topology()["row_joint"]) == 1
    assert traj.position("B") == pytest.approx(tree.position("B"), abs=1e-8)
    assert "H from differences" in str(traj) and "Broyden's" in str(traj)
    assert traj.residual.max() < 1e-9


def random_motion(seed):
    rng = np.random.default_rng(seed)
    if seed % 2:
        return random_loop(rng, ("revolute", "universal", "spherical", "cylindrical"), followers=False)
    return random_tree(rng, 4, ("revolute", "prismatic", "spherical", "cylindrical"), followers=False)


@pytest.mark.some(4)
@pytest.mark.parametrize("method", ["explicit", "radau", "bdf"])
@pytest.mark.parametrize("seed", range(4))
def test_the_motion_is_that_of_the_tree(method, seed):
    m = random_motion(seed)
    times = np.linspace(0.0, 0.4, 5)
    one = mb.simulate(m, t=times, rtol=1e-9, method=method)
    two = mb.simulate(m, t=times, rtol=1e-9, method=method, coordinates="absolute")
    length = one.snapshot.system.characteristic_length
    for body in one.bodies:
        assert np.abs(one.position(body) - two.position(body)).max() < 1e-6 * length, body
        assert np.abs(one.velocity(body) - two.velocity(body)).max() < 1e-5 * length, body
    assert two.energy == pytest.approx(one.energy, rel=1e-6, abs=1e-6)


def test_reactions_and_joint_coordinates_come_from_the_rows():
    m = mb.examples.swing()
    times = np.linspace(0.0, 1.7, 6)
    one, two = (mb.simulate(m, t=times, rtol=1e-10, **given) for given in ({}, {"coordinates": "absolute"}))
    for joint in ("m", "n"):
        a, b = one.reaction(joint), two.reaction(joint)
        assert np.abs(a - b).max() < 1e-5 * np.abs(a).max(), joint
    assert two.joint("m") == pytest.approx(np.pi / 3 * times, abs=1e-8)


def test_flexible_bodies_keep_their_floating_frame():
    m = mb.examples.slider_crank(stiffness=900.0)
    times = np.linspace(0.0, 0.02, 3)
    one, two = (mb.simulate(m, t=times, rtol=1e-8, **given) for given in ({}, {"coordinates": "absolute"}))
    assert two.modal("rod") == pytest.approx(one.modal("rod"), abs=1e-8)
    assert two.position("rod") == pytest.approx(one.position("rod"), abs=1e-8)


def test_it_is_kept_by_pickles_and_goes_on():
    m = mb.examples.swing()
    half = mb.simulate(m, t=0.2, rtol=1e-9, coordinates="absolute")
    again = pickle.loads(pickle.dumps(half))
    assert again.position("B") == pytest.approx(half.position("B"), abs=0) and again.error == pytest.approx(half.error)
    whole = mb.simulate(m, t=0.4, rtol=1e-9, coordinates="absolute")
    rest = mb.simulate(m, t=0.4, rtol=1e-9, coordinates="absolute", at=half.state(0.2))
    assert rest.position("B")[-1] == pytest.approx(whole.position("B")[-1], abs=1e-7)


def test_what_it_does_not_serve_is_named():
    m = mb.examples.swing()
    with pytest.raises(mb.ModelError, match="no sensitivities"):
        mb.simulate(m, t=0.1, step=1e-2, parameters=["A.mass"], coordinates="absolute")
    with pytest.raises(mb.ModelError, match="'tree', 'independent' or 'absolute'"):
        mb.simulate(m, t=0.1, coordinates="cartesian")
    with pytest.raises(mb.ModelError, match="belongs to method"):
        mb.simulate(m, t=0.1, method="bdf", coordinates="tree")
