"""Derivatives of the core against complex steps of the reference, for every number that has an address."""

from __future__ import annotations

from functools import partial

import mbrs as mb
import numpy as np
import pytest
from agreement import advanced, all_addresses, drawn, held, relative_difference, show, spinning, worst_of
from mbrs import reference as ref
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from mbrs.system.compiled import compiled
from random_models import TREE_JOINTS, random_loop, random_tree

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
TOLERANCE = 1e-9


def combined(m, address, rng):
    """One direction in x for all numbers of an address, with random weights: a wrong one among them shows with certainty.

    Each number is weighted by its own size, so that large and small ones count alike.
    """
    along = directions(m, address)
    size = np.array([np.abs(np.ravel(m.value(address))).max(initial=0.0) or 1.0])
    weights = size * (0.5 + rng.random(along.n)) * rng.choice([-1.0, 1.0], along.n)
    return along.dense @ weights, weights


def summed(derivative, weights, entries):
    """Along all entries of an array parameter, or the one number."""
    first = derivative.ndim - max(len(entries), 1)
    return derivative.reshape(*derivative.shape[:first], -1) @ weights


def compare(m, state, addresses, follow=False, seed=0):
    """Relative differences of dM, dD, dS, dT and of how the configuration moves, the worst over the addresses of each object.

    Relative to the derivative, or to a thousandth of the matrix itself where the derivative vanishes.
    """
    rng = np.random.default_rng(seed)
    lin = mb.linearize(m, at=state)
    state = getattr(state, "state", state)
    keep = [ref.System(tables(m)).coordinates.index(name) for name in lin.coordinates]
    where = held(m, state, keep)
    state_of = (lambda sys: ref.equilibrium(sys, where(sys))[0]) if follow else where
    worst = {}
    for address in addresses:
        x, weights = combined(m, address, rng)
        d = mb.sensitivity(lin, address, equilibrium="follow" if follow else "hold")
        along = partial(summed, weights=weights, entries=d.parameter_shape)
        base, other = ref.derivative(tables(m), x, state_of, keep)
        pairs = {
            "M": (along(d.M), other.M, base.M.real),
            "D": (0.0 * other.D if d.D is None else along(d.D), other.D, base.D.real),
            "K": (along(d.K), other.K, base.S.real),
            "T": (along(d.T), other.T, base.T.real),
            "rotation": (along(d.rotation), other.rotation, np.ones(1)),
        }
        worst[address] = max(
            relative_difference(a, b, np.array([max(np.abs(b).max(), 1e-3 * np.abs(c).max()), 1e-12]))
            for a, b, c in pairs.values()
        )
    return worst


def check(title, worst):
    name = max(worst, key=worst.__getitem__)
    print(f"{title}: worst {worst[name]:.1e} ({name}) of {len(worst)} addresses")
    assert worst[name] < TOLERANCE, {k: v for k, v in worst.items() if v >= TOLERANCE}


@pytest.mark.oracle
@pytest.mark.parametrize("kind", TREE_JOINTS)
def test_every_number_of_a_tree(kind):
    """Bodies, a joint of each kind on a hinge, and every element with every option, away from the drawn state."""
    rng = np.random.default_rng([10, TREE_JOINTS.index(kind)])
    m = random_tree(rng, 2, (kind, "revolute"), each=True, slack=0.1)
    addresses = [a for a in all_addresses(m) if kind == "revolute" or not _is_element(m, a)]
    check(kind, compare(m, advanced(m, rng, 0.4), addresses))


def _is_element(m, address):
    return address != "gravity" and m.items[address.split(".")[0]].kind in ("element", "load")


@pytest.mark.oracle
@pytest.mark.parametrize(
    "kinds, rod",
    [
        (("spherical", "universal", "cylindrical", "spherical"), True),
        (("universal", "spherical", "spherical", "planar"), False),
        (("spherical", "prismatic", "fixed", "spherical"), False),
    ],
)
def test_every_number_of_a_loop(kinds, rod):
    """Tree and cut joints, both of their points, axes and springs, and a rod."""
    rng = np.random.default_rng([11, len(kinds[0])])
    m = random_loop(rng, kinds, rod=rod)
    addresses = [a for a in all_addresses(m) if not a.startswith(("mount", "strut", "torsion", "spring"))]
    check("-".join(kinds), compare(m, advanced(m, rng, 0.1), addresses))


LOOPS = [
    ("spherical", "universal", "cylindrical", "spherical"),
    ("universal", "spherical", "spherical", "planar"),
    ("spherical", "prismatic", "spherical", "fixed"),
]


@pytest.mark.oracle
@pytest.mark.parametrize("kinds", LOOPS)
def test_every_number_of_a_moving_loop(kinds):
    """B'' turns in time, and how it turns depends on every point and axis of the loop."""
    rng = np.random.default_rng([16, len(kinds[0])])
    m = random_loop(rng, kinds)
    state = spinning(m, advanced(m, rng, 0.1), rng, 0.7)
    assert state.moving
    addresses = [a for a in all_addresses(m) if not a.startswith(("mount", "strut", "torsion", "spring"))]
    addresses = [a for a in addresses if "velocity" not in a]
    check("moving " + "-".join(kinds), compare(m, state, addresses))


@pytest.mark.parametrize("moving", [False, True])
def test_given_velocities_of_a_loop(moving):
    """Differences of the whole analysis at the drawn state, at rest and moving: the velocities are projected on the loop."""
    rng = np.random.default_rng([17, moving])
    m = random_loop(rng, LOOPS[0], moving=moving)
    addresses = ["b1.velocity[0]", "b2.angular_velocity[1]", "b0.velocity[2]"]
    velocity_terms = lambda r: r.G  # noqa: E731
    if moving:
        stiffness = mb.check_gradients(mb.linearize, m, [*addresses, "j1.at_a[0]", "b1.at[1]", "b2.mass"])
        print(stiffness)
        assert stiffness
        assert mb.check_gradients(mb.linearize, m, [*addresses, "j3.at_b[2]", "b1.com[0]"], value=velocity_terms)
    else:
        lin = mb.linearize(m)
        assert lin.G is None
        for address in addresses:
            x, weights = combined(m, address, rng)
            d = mb.sensitivity(lin, address)
            rates = rates_by_differences(m, x)
            with_dampers, without = (
                compiled(m).linearize(lin.state.q, r, [], raw=True)["D"] for r in (rates, np.zeros(0))
            )
            change = with_dampers - without  # G is linear in the rates
            assert relative_difference(d.D[..., 0] * weights[0], change) < 1e-7


def test_a_steady_motion_that_follows():
    """A governor: an arm on a sprung hinge, carried round, lifts with the mass and falls with the spring; its speed stays."""
    m = mb.Model("governor", gravity=(0, 0, -9.81))
    shaft = m.body("shaft", mass=3.0, inertia=(0.1, 0.1, 0.2), at=(0, 0, 0))
    arm = m.body("arm", mass=0.7, inertia=(0.02, 0.03, 0.01), at=(0.3, 0, -0.2))
    m.revolute("bearing", m.ground, shaft, at=(0, 0, 0), axis="z")
    m.revolute("hinge", shaft, arm, at=(0.1, 0, 0), axis="y", k=4.0, c=0.05)
    speed = {"bearing": 7.0}
    steady = mb.steady_motion(m, speed)
    real = ref.System(tables(m))
    names = real.coordinates
    assert np.abs(steady.poses["position"][1] - (0.3, 0, -0.2)).max() > 1e-2
    addresses = ["arm.mass", "arm.com[0]", "hinge.k", "hinge.at[0]", "hinge.axis[0]", "arm.inertia[1,1]", "gravity[2]"]
    found = mb.sensitivity(steady, addresses)
    motion, matrices = [], []
    d = mb.sensitivity(steady.linearization, addresses)
    for p, x in enumerate(directions(m, addresses).dense.T):
        sys = ref.System(tables(m), tables(m)["x"] + 1e-30j * x)
        lin, _ = ref.steady_motion(sys, {names[0]: 7.0})
        origin = lin.state.r - np.array([R @ b.com for R, b in zip(lin.state.R, sys.bodies, strict=True)])
        motion.append(relative_difference(found.position[..., p], origin.imag / 1e-30, np.array([1e-3])))
        for mine, other in ((d.M, lin.M), (d.D, lin.D), (d.S, lin.S)):
            matrices.append(relative_difference(mine[..., p], np.imag(other) / 1e-30, np.abs(other).max() + 0 * x))
    show("governor", {"position": max(motion), "matrices": max(matrices)})
    assert max(*motion, *matrices) < TOLERANCE
    assert mb.check_gradients(lambda m: mb.modes(m, at=mb.steady_motion(m, speed)), m, ["arm.mass", "hinge.k"])


def suspended(rng, kinds=("spherical", "universal", "cylindrical", "spherical")):
    """A sagging loop with stiff joint springs, so that its equilibrium is near the drawing."""
    m = random_loop(rng, kinds, followers=False)
    for joint in m.joints:
        m.set({f"{joint.name}.k": 30 * np.asarray(m.value(f"{joint.name}.k"))})
    return m


@pytest.mark.oracle
@pytest.mark.parametrize("closed", [False, True])
def test_every_number_at_an_equilibrium_that_follows(closed):
    rng = np.random.default_rng([12, closed])
    m = suspended(rng) if closed else random_tree(rng, 2, ("universal", "cylindrical"), each=True)
    eq = mb.equilibrium(m)
    addresses = all_addresses(m)
    if closed:
        addresses = [a for a in addresses if not a.startswith(("mount", "strut", "torsion"))]
    check(f"followed, closed {closed}", compare(m, eq, addresses, follow=True))


def test_equilibrium_positions():
    """d(origin) and the world rotation of every body, from the equilibrium's own sensitivity."""
    rng = np.random.default_rng(13)
    m = suspended(rng)
    eq = mb.equilibrium(m)
    where = held(m, eq.state)
    found = []
    for address in ("b1.mass", "b0.com", "j1.at", "j2.axis", "gravity", "bush0.k", "spring0.preload", "j0.k", "b2.at"):
        if address not in all_addresses(m):
            continue
        x, weights = combined(m, address, rng)
        d = mb.sensitivity(eq, address)
        along = directions(m, address)
        position = (d.position.reshape(*d.position.shape[:2], along.n)) @ weights
        sys = ref.System(tables(m), tables(m)["x"] + 1e-30j * x)
        state = ref.equilibrium(sys, where(sys))[0]
        origin = state.r - np.array([R @ b.com for R, b in zip(state.R, sys.bodies, strict=True)])
        found.append(relative_difference(position, origin.imag / 1e-30))
    show("positions", {"worst": max(found)})
    assert max(found) < TOLERANCE


def test_drawn_state_is_the_derivative_of_the_analysis_itself():
    """Differences of mb.linearize(m) at at=None, assembly and all: what mb.check_gradients sees."""
    rng = np.random.default_rng(14)
    m = random_loop(rng, ("spherical", "universal", "cylindrical", "spherical"))
    check_ = mb.check_gradients(
        mb.linearize, m, ["j1.at_a[0]", "j3.at_b[2]", "b1.at[1]", "b2.mass", "bush0.k[0,1]", "j0.at[2]"]
    )
    print(check_)
    assert check_


def test_velocities_that_a_drawn_state_is_given():
    """A spinning disc: the gyroscopic matrix follows its angular velocity."""
    m = mb.Model("top")
    b = m.body("disc", mass=2.0, inertia=(0.1, 0.1, 0.2), at=(0, 0, 0), angular_velocity=(0, 0, 30.0))
    m.bushing("mount", m.ground, b, at=(0, 0, 0), k=(1e3,) * 3 + (10.0,) * 3)
    lin = mb.linearize(m)
    d = mb.sensitivity(lin, ["disc.angular_velocity[2]"])
    np.testing.assert_allclose(d.G[..., 0], lin.G / 30.0, atol=1e-12)
    assert mb.check_gradients(mb.linearize, m, ["disc.angular_velocity[2]"], value=lambda r: r.G)


@pytest.mark.parametrize("kind", TREE_JOINTS)
def test_moving_trees_at_their_given_velocities(kind):
    """The gyroscopic terms follow the given velocities through their projection on the joints."""
    rng = np.random.default_rng([15, TREE_JOINTS.index(kind)])
    m = random_tree(rng, 2, ("revolute", kind), each=True, forces=False, moving=True)
    lin = mb.linearize(m)
    for address in ("b0.velocity", "b0.angular_velocity"):
        x, weights = combined(m, address, rng)
        d = mb.sensitivity(lin, address)
        rates = rates_by_differences(m, x)
        # without dampers D is linear in the rates
        other = compiled(m).linearize(lin.state.q, rates, [], raw=True)["D"]
        assert relative_difference(d.D @ weights, other, np.array([np.abs(other).max(), 1e-3])) < 1e-7


def rates_by_differences(m, x, h=1e-6):
    """How the projected rates of the drawn state change along x; they are linear in the velocities."""
    t = tables(m)["x"]
    system = compiled(m)
    ends = [system.with_values(t + s * h * x).assemble()["rate"] for s in (1, -1)]
    return (ends[0] - ends[1]) / (2 * h)


def test_parameters_reach_through_expressions():
    """One design variable in a mass, a position and a stiffness: the sum of its parts."""
    m = mb.Model("driven", gravity=(0, 0, -9.81))
    a = m.parameter("a", 0.3)
    b = m.body("b", mass=2 * a, inertia=(0.1 * a, 0.1 * a, 0.1 * a), at=(0, a, -a))
    m.universal("cross", m.ground, b, at=(0, 0, 0), axis="x", axis2="y", k=(5 + a**2, 4), c=(0.1, a))
    d = mb.sensitivity(mb.linearize(m), "a")
    _, other = ref.derivative(tables(m), directions(m, "a").dense[:, 0])
    worst = worst_of([{"M": relative_difference(d.M[..., 0], other.M), "K": relative_difference(d.K[..., 0], other.K)}])
    show("parameter", worst)
    assert max(worst.values()) < TOLERANCE


def test_a_parameter_that_breaks_a_redundant_loop_is_an_error():
    """Tilting one hinge of a planar four-bar takes its freedom away; moving its point along the loop's plane does not."""
    m = mb.examples.four_bar()
    lin = mb.linearize(m)
    for address in ("C.axis[0]", "C.axis[1]", "B.axis[0]"):
        with pytest.raises(mb.NotDifferentiableError, match="breaks a redundant loop"):
            mb.sensitivity(lin, address)
    for address in ("C.at_a[2]", "D.at_b[2]"):
        with pytest.raises(mb.NotDifferentiableError, match="breaks a redundant loop"):
            mb.sensitivity(lin, address)
    fine = [a for a in all_addresses(m) if a.split(".")[0] not in "ABCD" and "velocity" not in a]
    fine += ["A.at[0]", "B.at[1]", "C.at", "D.at_b[0]", "D.at_b[1]", "A.axis[2]", "C.axis[2]"]
    check("four-bar", compare(m, drawn(m), fine))


def test_ladders_keep_their_redundancy_under_most_parameters():
    for joint in ("revolute", "cylindrical"):
        m = mb.examples.ladder(2, joint)
        fine = [
            "B1,1.mass",
            "B1,3.at",
            "B2,2.inertia",
            "F1,1a.k",
            "F2,2b.c",
            "F1,2a.at",
            "F1,2b.orientation",
            "J1,1a.at[0]",
            "J2,2b.at[1]",
        ]
        check(f"ladder {joint}", compare(m, drawn(m), fine))


def test_following_an_unrestrained_equilibrium():
    """A free direction stays where it is, unless the parameter pushes along it."""
    m = mb.Model("adrift")
    k = m.parameter("pull", 0.0)
    a = m.body("a", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    b = m.body("b", mass=2.0, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x")
    m.prismatic("slide", a, b, at=(0.5, 0, 0), axis="x", k=100.0)
    m.force("pull on b", b, value=(k, 0, 0))
    eq = mb.equilibrium(m)
    assert eq.free_directions
    with pytest.raises(mb.SingularError, match="does not follow"):
        mb.sensitivity(eq, "pull")
    assert np.all(mb.sensitivity(eq, "slide.k").position == 0)
    assert mb.sensitivity(eq.linearization, "pull", equilibrium="hold").K.shape == (2, 2, 1)


def test_ports_along_vectors_and_at_points():
    """Derivatives of a transfer function between oblique ports are combinations of those along the axes; names tell the same ports."""
    m = random_tree(np.random.default_rng(11), 3)
    a, b = m.bodies[0], m.bodies[-1]
    n, e = np.array([0.3, -0.7, 0.64]), np.array([0.1, 0.9, 0.2])
    at = np.array(b.values("at")) + [0.1, -0.2, 0.05]
    omega, names = [3.0, 11.0], [f"{a.name}.mass", f"{b.name}.at[1]"]
    h = mb.frf(m, a.force(n), b.motion(e, at=at), omega=omega)
    axes = mb.frf(m, [a.force(x) for x in "xyz"], [b.motion(x, at=at) for x in "xyz"], omega=omega)
    whole = mb.sensitivity(axes, names).value
    u, v = e / np.linalg.norm(e), n / np.linalg.norm(n)
    assert np.allclose(mb.sensitivity(h, names).value[0, 0], np.einsum("i,ijkp,j->kp", u, whole, v), rtol=1e-9, atol=0)
    named = mb.frf(m, h.inputs, h.outputs, omega=omega)
    assert np.array_equal(named.value, h.value) and named.outputs == h.outputs
    for wrong in (f"{a.name}.force.(1,2)", f"{a.name}.torque.x@(1,2,3)", f"{a.name}.force.(1,b,2)"):
        with pytest.raises(mb.errors.ModelError):
            mb.frf(m, wrong, h.outputs, omega=omega)
