"""M, C, G, K, N and T of the core against the NumPy reference: all joints and elements, at rest and moving, open and closed."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from agreement import advanced, difference, drawn, show, spinning, worst_of
from mbrs import reference as ref
from mbrs.model.tables import tables
from mbrs.reference.assembly import mobility
from mbrs.system.compiled import compiled
from random_models import TREE_JOINTS, random_loop, random_tree

TOLERANCE = 1e-10
LOOPS = [
    (("spherical", "universal", "cylindrical", "spherical"), False),
    (("spherical", "universal", "cylindrical", "spherical"), True),
    (("universal", "spherical", "spherical", "planar"), True),
    (("spherical", "prismatic", "spherical", "cylindrical"), False),
    (("cylindrical", "cylindrical", "cylindrical", "universal"), False),
    (("revolute", "spherical", "spherical", "revolute", "cylindrical"), False),
    (("spherical", "planar", "fixed", "spherical"), True),
]


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(2, 6), marks=pytest.mark.slow)], ids=["few", "more"])
@pytest.mark.parametrize("kind", TREE_JOINTS)
def test_trees_of_each_joint(kind, seeds):
    """Three bodies on one kind of joint, reversed or not: drawn, advanced, and moving there."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng([seed, TREE_JOINTS.index(kind)])
        m = random_tree(rng, 3, ("revolute", kind), each=True)
        found.append(difference(m, drawn(m)))
        state = advanced(m, rng, 0.7)
        found.append(difference(m, state))
        found.append(difference(m, spinning(m, state, rng, 0.8)))
    worst = worst_of(found)
    show(kind, worst)
    assert max(worst.values()) < TOLERANCE


@pytest.mark.slow
def test_trees_of_mixed_joints():
    found = []
    for seed in range(30):
        rng = np.random.default_rng([1, seed])
        m = random_tree(rng, int(rng.integers(1, 7)), followers=bool(seed % 2))
        state = advanced(m, rng, 0.5)
        found.append(difference(m, state))
        found.append(difference(m, spinning(m, state, rng, 1.0)))
    worst = worst_of(found)
    show("mixed trees", worst)
    assert max(worst.values()) < TOLERANCE


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 12), marks=pytest.mark.slow)], ids=["few", "more"])
def test_two_point_joints_of_trees(seeds):
    """Joints drawn with two points that assembly brings together."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng([2, seed])
        m = random_tree(rng, 4, slack=0.3)
        assert_same_drawn_state(m)
        found.append(difference(m, drawn(m)))
    worst = worst_of(found)
    show("two-point joints", worst)
    assert max(worst.values()) < TOLERANCE


def assert_same_drawn_state(m):
    """Assembly is by the same rule in both."""
    sys = ref.System(tables(m))
    theirs = ref.assembly.drawn_and_assembled(sys)
    ours = reference_pose(m, sys)
    np.testing.assert_allclose(ours.r, theirs.r, atol=1e-11)
    np.testing.assert_allclose(ours.R, theirs.R, atol=1e-11)


def reference_pose(m, sys):
    from agreement import reference_state

    return reference_state(m, drawn(m), sys)


@pytest.mark.some(3)
@pytest.mark.parametrize("kinds, rod", LOOPS)
def test_loops(kinds, rod):
    """One or two loops, at an advanced state, at rest and moving (B'' turns in time)."""
    found = []
    for seed in range(3):
        rng = np.random.default_rng([3, seed, len(kinds), rod])
        m = random_loop(rng, kinds, rod=rod)
        state = advanced(m, rng, 0.1)
        found.append(difference(m, state))
        found.append(difference(m, spinning(m, state, rng, 0.5)))
    worst = worst_of(found)
    show(f"{'-'.join(kinds)} rod {rod}", worst)
    assert max(worst.values()) < TOLERANCE


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("kinds, rod", LOOPS[:2])
def test_given_velocities_are_projected_on_loops(kinds, rod):
    """The core's own projected velocities, whatever they are, satisfy the joints and give the reference's matrices."""
    rng = np.random.default_rng([4, rod])
    m = random_loop(rng, kinds, rod=rod, moving=True)
    state = drawn(m)
    assert state.moving
    worst = difference(m, state)
    show("projected velocities", worst)
    assert max(worst.values()) < TOLERANCE


@pytest.mark.parametrize("share, status", [(1e-7, "converged"), (1e-5, "off-equilibrium")])
def test_a_millionth_of_the_forces_may_be_out_of_balance(share, status):
    m = mb.Model("weight", gravity=(0, 0, -10.0))
    b = m.body("b", mass=2.0, inertia=(1, 1, 1), at=(0, 0, -1))
    m.prismatic("rail", m.ground, b, at=(0, 0, -1), axis="z")
    m.spring_damper("s", m.ground, b, at=((0, 0, 0), (0, 0, -1)), k=100.0, preload=20.0 * (1.0 - share))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        assert mb.linearize(m).status == status


def test_inconsistent_velocities_are_reported():
    m = mb.Model("slider")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0.5, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x")
    with pytest.warns(mb.MbrsWarning, match=r"velocities of 'slider' contradict its joints.*0\.5 m/s"):
        lin = mb.linearize(m)
    np.testing.assert_allclose(lin.poses["velocity"], [[1, 0, 0]], atol=1e-14)


@pytest.mark.some(2)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize(
    "effect", ["gravity", "gyroscopic", "centrifugal", "preload-stiffness", "constraint-force-stiffness", "damping"]
)
def test_every_effect_can_be_left_out_in_the_same_sense(effect):
    """What `without=` leaves out is the same set of terms in both."""
    found = []
    for seed in range(4):
        rng = np.random.default_rng([5, seed])
        m = random_tree(rng, 4) if seed % 2 else random_loop(rng, *LOOPS[0][:1])
        state = advanced(m, rng, 0.1)
        found.append(difference(m, state, (effect,)))
        found.append(difference(m, spinning(m, state, rng, 0.5), (effect,)))
    worst = worst_of(found)
    show(f"without {effect}", worst)
    assert max(worst.values()) < TOLERANCE


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_examples():
    """Every shipped example, as drawn."""
    e = mb.examples
    models = [
        e.chain(5),
        e.chain(3, None),
        e.tree(4, "spherical"),
        *(e.ladder(3, joint) for joint in ("revolute", "prismatic", "cylindrical", "spherical")),
        e.four_bar(),
        e.cubic_hexapod(),
        e.quadruped(),
        e.stewart_platform(),
        e.wafer_stage(),
        e.rotor(),
    ]
    for m in models:
        worst = difference(m, drawn(m))
        show(m.name, worst)
        assert max(worst.values()) < TOLERANCE


def test_the_tree_is_the_same():
    """Coordinate names, cut joints, degrees of freedom, characteristic length."""
    for seed in range(20):
        rng = np.random.default_rng([6, seed])
        m = random_tree(rng, 5) if seed % 2 else random_loop(rng, LOOPS[seed % 7][0], rod=LOOPS[seed % 7][1])
        sys, topology = ref.System(tables(m)), compiled(m).topology()
        assert topology["coordinates"] == sys.coordinates
        assert [b for b, *_ in topology["tree"]] == [sys.bodies[t.outer].name for t in sys.tree]
        assert topology["cut"] == [link.name for link in sys.cut]
        assert compiled(m).characteristic_length == pytest.approx(sys.length, rel=1e-14)
        assert mb.System(m).dof == mobility(sys).dof


def test_momentum_of_a_common_rigid_motion():
    """`ground_coupling` = T^T M times the rigid motion of all bodies, from the body mass matrices."""
    rng = np.random.default_rng(7)
    m = random_loop(rng, LOOPS[0][0])
    lin = mb.linearize(m, at=advanced(m, rng, 0.1))
    expected = np.zeros_like(lin.ground_coupling)
    for i, mass in enumerate(lin.body_mass_matrices):
        x, y, z = lin.poses["position"][i]
        rigid = np.eye(6)
        rigid[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        expected += lin.T[6 * i : 6 * i + 6].T @ mass @ rigid
    np.testing.assert_allclose(lin.ground_coupling, expected, atol=1e-12 * np.abs(expected).max())


def test_the_mass_matrix_is_that_of_the_bodies():
    """M = sum of T_i^T M_i T_i."""
    rng = np.random.default_rng(8)
    m = random_tree(rng, 5)
    lin = mb.linearize(m, at=advanced(m, rng, 0.5))
    T = lin.T.reshape(len(lin.bodies), 6, lin.n)
    expected = np.einsum("bij,bik,bkl->jl", T, lin.body_mass_matrices, T)
    np.testing.assert_allclose(lin.M, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(4))
def test_a_free_turning_stays_rigid_in_a_plane(seed):
    """Arms on springs on a free hub, all in one plane: centrifugal terms cancel in the hub's row, and no velocity term says so."""
    rng = np.random.default_rng(seed)
    m = mb.Model("hub with arms")
    hub = m.body("hub", mass=2.0, inertia=(0.3,) * 3, at=(*rng.normal(0, 0.1, 2), 0))
    m.revolute("bearing", m.ground, hub, at=(0, 0, 0), axis="z")
    for k in range(3):
        angle, r = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.2)
        place = r * np.array([np.cos(angle), np.sin(angle), 0.0])
        arm = m.body(f"arm{k}", mass=rng.uniform(0.1, 3), inertia=(0.02,) * 3, at=place)
        m.revolute(f"root{k}", hub, arm, at=0.3 * place, axis="z", k=10 ** rng.uniform(2, 6))
    at = mb.steady_motion(m, {"bearing": 3.7})
    linear, found = mb.linearize(m, at=at), mb.modes(m, at=at)
    rates = linear.K / np.sqrt(np.outer(np.diag(linear.M), np.diag(linear.M)))
    print(f"largest entry of the hub's row {np.abs(rates[0]).max():.1e}, of all {np.abs(rates).max():.1e} 1/s2")
    assert found.kind[0] == "rigid" and found.eigenvalue[0] == 0.0 and np.all(found.kind[1:] == "vibration")


def test_a_soft_spring_of_a_fast_shaft_is_kept():
    """1e-6 N m/rad on a shaft of 1 kg m2 at 1000 rad/s: terms of inertia are 1e12 times larger, and cancel."""
    m = mb.Model("shaft")
    b = m.body("rotor", mass=1.0, inertia=(0.5, 0.5, 1.0), at=(0, 0, 0), angular_velocity=(0, 0, 1000.0))
    m.revolute("bearing", m.ground, b, at=(0, 0, 0), axis="z", k=1e-6)
    assert mb.linearize(m).K[0, 0] == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.exact
def test_a_lever_of_some_hundred_last_digits_is_one():
    """A spring along the x axis but for 1e-13: k_xy = k cos sin."""
    m = mb.Model("lever")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.free("joint", m.ground, b, at=(0, 0, 0))
    m.spring_damper("oblique", m.ground, b, at=((1, 1e-13, 0), (0, 0, 0)), k=1.0)
    assert mb.linearize(m).K[0, 1] == pytest.approx(1e-13, rel=1e-9, abs=0.0)


@pytest.mark.exact
def test_what_two_springs_across_leave_of_each_other_is_kept():
    """k_xy of one less 1e-13, on coordinates of stiffness six: a few hundred times the rounding of the sum."""
    m = mb.Model("across")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.free("joint", m.ground, b, at=(0, 0, 0))
    for name, across in (("one", 1.0), ("other", 1e-13 - 1.0)):
        k = np.zeros((6, 6))
        k[:2, :2] = [[3.0, across], [across, 3.0]]
        m.bushing(name, m.ground, b, at=(0, 0, 0), k=k)
    assert mb.linearize(m).K[0, 1] == pytest.approx(1e-13, rel=1e-2, abs=0.0)


@pytest.mark.exact
def test_a_spring_that_is_stretched_by_more_than_rounding_is_out_of_balance():
    """By 1e-13 of its length: nothing else acts, and the model is not where its spring lets it rest."""
    m = mb.Model("stretched")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(1 + 1e-13, 0, 0))
    m.prismatic("rail", m.ground, b, at=(1, 0, 0), axis="x")
    m.spring_damper("s", m.ground, b, at=((0, 0, 0), (1 + 1e-13, 0, 0)), k=3.0, length=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        assert mb.linearize(m).status == "off-equilibrium"
