"""The Rust core and the NumPy reference on the same tables: two derivations, one answer."""

from __future__ import annotations

import numpy as np
import pytest
from mbrs import _core
from mbrs.reference import State, System, derivative, equilibrium, linearize, reactions
from mbrs.reference.assembly import jacobian
from reference_models import hanging_four_bar, ladder
from test_reference_sensitivity import PARAMETERS, loaded_mechanism, unit
from test_reference_tangents import KINDS, random_loop, random_tree

LOOPS = [
    (("spherical", "universal", "cylindrical", "spherical"), True),
    (("universal", "spherical", "spherical", "planar"), True),
    (("spherical", "prismatic", "spherical", "cylindrical"), False),
    (("cylindrical", "cylindrical", "cylindrical", "universal"), False),
]


def core_tables(tables):
    t = {k: v if k == "x" or k.endswith("name") else np.asarray(v, dtype=np.int64) for k, v in tables.items()}
    none = np.zeros(0, dtype=np.int64)
    return {"pose_body": none, "pose_x": none, "tolerance": 1e-7, **t}


def both(t, state, rate, without=()):
    """The core's linearisation, and the reference's at the same bodies' poses with the same independent coordinates."""
    core, sys = _core.System(t), System(t)
    found = core.linearize(state["q"], rate, list(without), raw=True)
    bodies = core.bodies(state["q"], rate)
    arm = np.einsum("nij,nj->ni", bodies["rotation"], np.array([b.com for b in sys.bodies]))
    omega = bodies["angular_velocity"]
    here = State(bodies["position"] + arm, bodies["rotation"], bodies["velocity"] + np.cross(omega, arm), omega)
    independent = [sys.coordinates.index(name) for name in found["coordinates"]]
    assert core.topology()["coordinates"] == sys.coordinates
    assert core.characteristic_length == pytest.approx(sys.length, rel=1e-14)
    return found, linearize(sys, here, independent, without)


def agree(found, expected, tolerance=1e-12):
    damping = np.zeros_like(expected.D) if found["D"] is None else found["D"]
    for name, a, e in (
        ("M", found["M"], expected.M),
        ("D", damping, expected.D),
        ("S", found["S"], expected.S),
        ("T", found["T"], expected.T),
    ):
        scale = max(np.max(np.abs(e), initial=0.0), 1e-12)
        assert np.max(np.abs(a - e), initial=0.0) <= tolerance * scale, name


@pytest.mark.some(7)
@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("kind", KINDS[:-1])
def test_trees_off_equilibrium_at_rest_and_moving(kind, flip):
    rng = np.random.default_rng([KINDS.index(kind), flip])
    t = core_tables(random_tree([kind, "revolute", "spherical"], rng, flip).tables)
    state = _core.System(t).assemble()
    agree(*both(t, state, np.zeros(0)))
    agree(*both(t, state, 0.4 * rng.normal(size=System(t).ny)))


@pytest.mark.parametrize("kinds, distance", LOOPS)
def test_loops_at_equilibrium_and_moving(kinds, distance):
    rng = np.random.default_rng([len(kinds[0]), distance])
    t = core_tables(random_loop(kinds, rng, distance).tables)
    core, sys = _core.System(t), System(t)
    state = core.equilibrium(core.assemble()["q"], [])
    found, expected = both(t, state, np.zeros(0))
    agree(found, expected)
    wrench = np.array(list(reactions(sys, expected.state, expected.lam).values()))
    np.testing.assert_allclose(core.reactions(state["q"], np.zeros(0), []), wrench, atol=1e-10 * np.max(np.abs(wrench)))
    J = jacobian(sys, expected.state)
    free = np.linalg.svd(J)[2][np.linalg.matrix_rank(J, 1e-9) :]
    agree(*both(t, state, 0.3 * free.T @ rng.normal(size=len(free))))


def test_redundant_loops_share_reactions_alike():
    for model in (hanging_four_bar(), ladder(3, "revolute"), ladder(3, "cylindrical"), ladder(2, "spherical")):
        t = core_tables(model.tables())
        state = _core.System(t).assemble()
        found, expected = both(t, state, np.zeros(0))
        agree(found, expected)
        wrench = np.array(list(reactions(System(t), expected.state, expected.lam).values()))
        core_wrench = _core.System(t).reactions(state["q"], np.zeros(0), [])
        np.testing.assert_allclose(core_wrench, wrench, atol=1e-10 * (np.max(np.abs(wrench)) + 1))


@pytest.mark.parametrize("effect", ["gravity", "gyroscopic", "centrifugal", "damping"])
def test_effects_switched_off(effect):
    t = core_tables(random_tree(["spherical", "universal"], np.random.default_rng(1), False).tables)
    state = _core.System(t).assemble()
    agree(*both(t, state, 0.3 * np.random.default_rng(3).normal(size=System(t).ny), (effect,)))


@pytest.mark.oracle
def test_derivatives_that_follow_the_equilibrium():
    """The core's derivatives against complex steps of the reference through the whole chain, to 1e-9."""
    b = loaded_mechanism()
    t = core_tables(b.tables())
    core = _core.System(t)
    state = core.equilibrium(core.assemble()["q"], [])
    found, expected = both(t, state, np.zeros(0))
    independent = expected.partition.independent.tolist()
    directions = [unit(b, *p) for p in PARAMETERS[::3]]
    sparse = [(np.flatnonzero(d).tolist(), d[d != 0].tolist()) for d in directions]
    rates = _core.directions(core, state["q"], np.zeros(0), [], sparse, "equilibrium", True)
    shape = (len(found["coordinates"]),) * 2 + (len(sparse),)
    for name in ("dM", "dD", "dS"):
        row, column, direction, value = rates[name]
        dense = np.zeros(shape)
        np.add.at(dense, (row, column, direction), value)
        rates[name] = dense
    for k, d in enumerate(directions):
        _, rate = derivative(t, d, lambda s: equilibrium(s, expected.state)[0], independent)
        for name, a, e in (("dM", "M", rate.M), ("dD", "D", rate.D), ("dS", "S", rate.S), ("dT", "T", rate.T)):
            scale = np.max(np.abs(e)) + np.max(np.abs(found[a]))
            assert np.max(np.abs(rates[name][:, :, k] - e)) <= 1e-9 * scale, (PARAMETERS[3 * k], name)
