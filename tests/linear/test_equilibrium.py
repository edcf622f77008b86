"""Equilibria against closed forms and the reference, what is unstable or unrestrained, and the reactions."""

from __future__ import annotations

from itertools import pairwise

import jitter
import mbrs as mb
import numpy as np
import problems
import pytest
from agreement import difference, reference_state, show
from mbrs import reference as ref
from mbrs.model.rotations import rotation
from mbrs.model.tables import tables
from random_models import random_loop, random_tree

TOLERANCE = 1e-10


def same_as_reference(m, eq):
    """Distance of the reference's equilibrium, found from the core's drawn state by its own Newton iteration, in m and rad."""
    sys = ref.System(tables(m))
    theirs = ref.equilibrium(sys)[0]
    ours = reference_state(m, eq.state, sys)
    return max(np.abs(ours.r - theirs.r).max(), np.abs(ours.R - theirs.R).max())


def test_a_rod_drawn_level_falls_and_hangs():
    p = problems.level_rod()
    eq = mb.equilibrium(p.model)
    error = np.abs(eq.position("rod") - p.answer["position"]["rod"]).max()
    frequency = abs(mb.modes(p.model, at=eq).frequency[0] - problems.hanging_rod().answer["frequency"][0])
    show("level rod", {"position": error, "frequency": frequency})
    assert error < 1e-12 and frequency < 1e-12
    assert eq.stable and eq.status == "converged" and eq.residual < 1e-12


def test_an_inverted_rod_is_in_balance_but_unstable():
    p = problems.inverted_rod()
    with pytest.warns(mb.MbrsWarning, match="'inverted rod' is unstable: it started in balance already"):
        eq = mb.equilibrium(p.model)
    assert not eq.stable and "UNSTABLE" in str(eq)
    np.testing.assert_allclose(eq.position("rod"), (0, 0.5, 0), atol=1e-14)


def test_an_inverted_rod_drawn_slightly_off_falls():
    m = mb.Model("falling", gravity=(0, -9.81, 0))
    r = problems.rod(m, "rod", (0.5e-3, 0.5, 0), 1.0, angle=np.pi / 2 - 1e-3)
    m.revolute("hinge", m.ground, r, at=(0, 0, 0), axis="z")
    eq = mb.equilibrium(m)
    assert eq.stable
    np.testing.assert_allclose(eq.position("rod"), (0, -np.hypot(0.5e-3, 0.5), 0), atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_hanging_masses(n):
    """A chain drawn hanging, and one drawn stretched out level that has to fall."""
    p = problems.hanging_masses(n)
    error = np.abs(mb.modes(p.model).frequency - p.answer["frequency"]).max() / p.answer["frequency"].max()
    print(f"{n} hanging masses: error {error:.1e}")
    assert error < 1e-12


@pytest.mark.parametrize("n", [2, 4, 8])
def test_a_chain_drawn_level_falls(n):
    m = mb.Model("level chain", gravity=(0, -9.81, 0))
    before = m.ground
    for i in range(n):
        b = problems.rod(m, f"b{i}", (i + 0.5, 0, 0), 1.0)
        m.revolute(f"h{i}", before, b, at=(i, 0, 0), axis="z")
        before = b
    eq = mb.equilibrium(m)
    error = max(np.abs(eq.position(f"b{i}") - (0, -i - 0.5, 0)).max() for i in range(n))
    print(f"chain of {n} drawn level: error {error:.1e}, {eq.iterations} iterations")
    assert eq.stable and error < 1e-10
    assert eq.iterations <= {2: 11, 4: 44, 8: 44}[n]  # near the end by Newton's method


def test_catenary():
    """A chain of hinged rods between two supports: symmetric, and its horizontal reaction satisfies the discrete catenary."""
    m, n, sag = mb.Model("catenary", gravity=(0, -9.81, 0)), 9, 0.05
    points = np.array([[i * 0.9, -sag * i * (n - i), 0] for i in range(n + 1)])
    bodies = [m.ground]
    for i in range(n):
        d = points[i + 1] - points[i]
        length = float(np.linalg.norm(d))
        bodies.append(
            problems.rod(
                m, f"b{i}", tuple(0.5 * (points[i] + points[i + 1])), length, angle=float(np.arctan2(d[1], d[0]))
            )
        )
    bodies.append(m.ground)
    for i in range(n + 1):
        m.revolute(f"h{i}", bodies[i], bodies[i + 1], at=tuple(points[i]), axis="z")
    eq = mb.equilibrium(m)
    assert eq.stable
    # the tension at each hinge turns by what hangs between: H is constant, V changes by one weight
    forces = np.array([eq.reactions[f"h{i}"][:3] for i in range(n + 1)])
    errors = {
        "H": np.ptp(forces[:, 0]) / 9.81,
        "V": np.abs(np.diff(forces[:, 1]) + 9.81).max() / 9.81
        if forces[0, 1] > forces[-1, 1]
        else np.abs(np.diff(forces[:, 1]) - 9.81).max(),
        "symmetry": np.abs(forces[:, 1] + forces[::-1, 1]).max() / 9.81,
    }
    # each rod turns under its own weight about its middle: slope = (V before + V after) / 2 / H
    slopes = []
    for i in range(n):
        x = eq.rotation(f"b{i}")[:, 0]
        mean = 0.5 * (forces[i] + forces[i + 1])
        slopes.append(abs(x[0] * mean[1] - x[1] * mean[0]) / np.linalg.norm(mean))
    errors["slope"] = max(slopes)
    show("catenary", errors)
    assert max(errors.values()) < 1e-9


def test_a_sagging_spring():
    p = problems.spring_pendulum()
    eq = mb.equilibrium(p.model)
    error = np.abs(eq.position("mass") - p.answer["position"]["mass"]).max()
    frequency = abs(mb.modes(p.model, at=eq).frequency[0] / p.answer["frequency"][0] - 1)
    show("sagging mass", {"position": error, "frequency": frequency})
    assert error < 1e-13 and frequency < 1e-12


def test_a_taut_string_vibrates_by_its_tension():
    """Preloads that balance: the drawn state is the equilibrium, its lateral stiffness is geometric."""
    p = problems.preloaded_string()
    eq = mb.equilibrium(p.model)
    error = np.abs(mb.modes(p.model, at=eq).frequency / p.answer["frequency"] - 1).max()
    print(f"taut string: error {error:.1e}")
    assert np.abs(eq.position("bead")).max() < 1e-15 + jitter.level() and error < 1e-12


@pytest.mark.parametrize("load", [0.5, 0.95, 1.05, 2.0])
def test_a_link_beyond_its_buckling_load(load):
    """k (phi - drawn) = P l sin phi below and above P l = k: the deflected, stable branch."""
    p = problems.buckled_link(load * 10.0, angle=0.02)
    eq = mb.equilibrium(p.model)
    phi = np.arctan2(*eq.rotation("link")[[1, 0], 0])
    frequency = mb.modes(p.model, at=eq).frequency[0]
    show(
        f"load {load}", {"phi": abs(phi - p.answer["phi"]), "frequency": abs(frequency / p.answer["frequency"][0] - 1)}
    )
    assert eq.stable
    assert abs(phi - p.answer["phi"]) < 1e-11 and abs(frequency / p.answer["frequency"][0] - 1) < 1e-10
    if load == 0.5:
        assert eq.iterations <= 2


def test_a_straight_column_above_its_load_is_unstable():
    """Two links, springs at base and middle: buckling at (3 - sqrt 5)/2 k/l."""
    critical = (3 - np.sqrt(5)) / 2 * 10.0
    for load, stable in ((critical * (1 - 1e-6), True), (critical * (1 + 1e-6), False)):
        m = mb.Model("column")
        a, b = problems.rod(m, "a", (0.5, 0, 0), 1.0), problems.rod(m, "b", (1.5, 0, 0), 1.0)
        m.revolute("base", m.ground, a, at=(0, 0, 0), axis="z", k=10.0)
        m.revolute("middle", a, b, at=(1, 0, 0), axis="z", k=10.0)
        m.force("push", b, at=(2, 0, 0), value=(-load, 0, 0))
        if stable:
            assert mb.equilibrium(m).stable
        else:
            with pytest.warns(mb.MbrsWarning, match="unstable"):
                assert not mb.equilibrium(m).stable


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("part, stable", [(1e-10, True), (1e-8, False)])
def test_a_stiffness_that_is_negative_by_rounding_does_not_fall(part, stable):
    """A bushing whose x and y together have hardly any stiffness."""
    m = mb.Model("neutral", gravity=(0, 0, 0))
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    stiffness = np.eye(6)
    stiffness[0, 1] = stiffness[1, 0] = 1.0
    stiffness[1, 1] = 1.0 - 2.0 * part
    m.bushing("s", m.ground, b, at=(1, 0, 0), k=stiffness)
    try:
        found = mb.equilibrium(m).stable
    except mb.ConvergenceError:  # noise on the numbers pushes it: it falls without end
        found = False
    assert found == stable


def test_an_unstable_end_of_a_search_is_not_called_a_balanced_start():
    """Two links under a force along the second and a small one across: the search ends off the drawn pose, unstable."""
    m = mb.Model("pushed column")
    a, b = problems.rod(m, "a", (0.5, 0, 0), 1.0), problems.rod(m, "b", (1.5, 0, 0), 1.0)
    m.revolute("base", m.ground, a, at=(0, 0, 0), axis="z", k=10.0)
    m.revolute("middle", a, b, at=(1, 0, 0), axis="z", k=10.0)
    m.force("push", b, at=(2, 0, 0), value=(-30.0, 0, 0), frame="body")
    m.force("side", b, at=(2, 0, 0), value=(0, 0.01, 0))
    with pytest.warns(mb.MbrsWarning, match="is unstable: the search ended there") as said:
        eq = mb.equilibrium(m)
    moved = abs(eq.position("b")[1])
    print(f"moved by {moved:.1e} m in {eq.iterations} iterations; {said[0].message}")
    assert not eq.stable and eq.iterations > 0 and moved > 1e-4 and eq.residual < 1e-12


def test_a_follower_force_bends_until_the_moments_balance():
    """A link on a spring under a force that stays across it: k phi = P l at any angle."""
    m = mb.Model("follower")
    b = problems.rod(m, "link", (0.5, 0, 0), 1.0)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z", k=10.0)
    m.force("push", b, at=(1, 0, 0), value=(0, 22.0, 0), frame="body")
    eq = mb.equilibrium(m)
    phi = np.arctan2(*eq.rotation("link")[[1, 0], 0])
    print(f"follower: error {abs(phi - 2.2):.1e}")
    assert abs(phi - 2.2) < 1e-12


def test_a_free_body_under_balanced_loads_stays():
    m = mb.Model("free")
    b = m.body("b", mass=2.0, inertia=(1, 2, 2.5), at=(0.3, -0.2, 0.9))
    m.force("left", b, at=(0.3, -0.2, 0.9), value=(-5, 0, 0))
    m.force("right", b, at=(1.3, -0.2, 0.9), value=(5, 0, 0))
    eq = mb.equilibrium(m)
    assert np.abs(eq.position("b") - (0.3, -0.2, 0.9)).max() <= jitter.level()
    # stretched by the pair: restoring against turning across it, free along and about the line and in translation
    assert len(eq.free_directions) == 4
    assert eq.stable


def test_an_unrestrained_direction_that_is_pushed_is_named():
    m = mb.Model("pushed")
    a = m.body("a", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    m.revolute("hinge", m.ground, a, at=(0, 0, 0), axis="z", k=100.0)
    m.prismatic("open rail", a, b, at=(1, 0, 0), axis="x")
    m.force("push", b, value=(1.0, 0, 0))
    with pytest.raises(mb.SingularError, match=r"nothing restrains the direction open rail .*add a spring"):
        mb.equilibrium(m)


@pytest.mark.parametrize("seed", range(3))
def test_a_free_direction_is_named_by_its_large_coordinates(seed):
    """Two rails, one on the other, and a spring in whose direction a tenth of the first one's way undoes the second one's."""
    rng = np.random.default_rng([44, seed])
    first, second, _ = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
    at, along = rng.normal(size=3), (0.1 * first + second) / np.hypot(0.1, 1.0)
    m = mb.Model("rails")
    a = m.body("a", mass=1.0, inertia=(1, 1, 1), at=at)
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=at)
    m.prismatic("long way", m.ground, a, at=at, axis=first)
    m.prismatic("short way", a, b, at=at, axis=second)
    k = np.zeros((6, 6))
    k[:3, :3] = 100.0 * np.outer(along, along)
    m.bushing("spring", m.ground, b, at=at, k=k)
    m.force("push", a, at=at, value=tuple(5.0 * first))
    with pytest.raises(mb.SingularError, match=r"nothing restrains the direction long way") as caught:
        mb.equilibrium(m)
    assert "short way" not in str(caught.value)


def test_a_body_in_free_fall_is_named():
    m = mb.Model("falling", gravity=(0, 0, -9.81))
    m.body("stone", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    with pytest.raises(mb.SingularError, match=r"direction stone\.z"):
        mb.equilibrium(m)


@pytest.mark.some(2)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", range(4))
def test_random_trees_reach_the_reference_equilibrium(seed):
    rng = np.random.default_rng([30, seed])
    m = random_tree(rng, 3, ("revolute", "universal", "prismatic", "cylindrical", "spherical"), followers=False)
    for joint in m.joints:
        m.set({f"{joint.name}.k": 20 * np.asarray(m.value(f"{joint.name}.k"))})
    eq = mb.equilibrium(m)
    found = {"apart": same_as_reference(m, eq), "lin": max(difference(m, eq.state).values()), "residual": eq.residual}
    show(f"random tree {seed}", found)
    assert found["apart"] < TOLERANCE and found["lin"] < TOLERANCE and found["residual"] < 1e-12


@pytest.mark.some(1)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", range(3))
def test_random_loops_reach_the_reference_equilibrium(seed):
    rng = np.random.default_rng([31, seed])
    m = random_loop(rng, ("spherical", "universal", "cylindrical", "spherical"), rod=seed == 2, followers=seed == 1)
    for joint in m.joints:
        if joint.type != "distance":
            m.set({f"{joint.name}.k": 20 * np.asarray(m.value(f"{joint.name}.k"))})
    eq = mb.equilibrium(m)
    found = {"apart": same_as_reference(m, eq), "lin": max(difference(m, eq.state).values()), "residual": eq.residual}
    show(f"random loop {seed}", found)
    assert found["apart"] < TOLERANCE and found["lin"] < TOLERANCE and found["residual"] < 1e-12


def test_the_error_estimate_bounds_the_distance():
    """`error` is the last Newton step; the distance to the closed form is not much more."""
    p = problems.buckled_link(15.0, angle=0.02)
    eq = mb.equilibrium(p.model)
    phi = np.arctan2(*eq.rotation("link")[[1, 0], 0])
    assert abs(phi - p.answer["phi"]) < 1e-14 + 100 * eq.error + 10 * jitter.level()


def test_effects_can_be_left_out():
    p = problems.spring_pendulum()
    eq = mb.equilibrium(p.model, without=("gravity",))
    np.testing.assert_allclose(eq.position("mass"), (0, 0, -0.5), atol=1e-14)


# --- reactions -----


def test_reactions_of_a_statically_determinate_frame():
    """An L frame on a pin and a roller: moments by hand."""
    m = mb.Model("frame")
    b = m.body("frame", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.spherical("pin", m.ground, b, at=(0, 0, 0))
    m.distance("tie", m.ground, b, at=((2, -1, 0), (2, 0, 0)))
    m.distance("tie y", m.ground, b, at=((1, 0, -1), (1, 0, 0)))
    m.distance("tie z", m.ground, b, at=((0, 1, -1), (0, 1, 0)))
    m.force("load", b, at=(1, 0, 0), value=(3.0, -8.0, 2.0))
    eq = mb.equilibrium(m)
    noise = 1e-12 + 2 * 8.0 * jitter.level()  # of the directions of ties that carry up to 8 N
    r = eq.reactions
    # moments about the pin: z: -8 * 1 + 2 T = 0; y: -(1 * 2) - (1 * T_y) = 0; x: 1 * T_z = 0
    np.testing.assert_allclose(r["tie"][:3], (0, 4, 0), atol=noise)
    np.testing.assert_allclose(r["tie y"][:3], (0, 0, -2), atol=noise)
    np.testing.assert_allclose(r["tie z"][:3], (0, 0, 0), atol=noise)
    np.testing.assert_allclose(r["pin"], (-3, 4, 0, 0, 0, 0), atol=noise)


def test_the_reaction_is_on_the_second_body():
    """A hanging rod: its hinge pulls it up; drawn the other way round, the rod pulls ground down."""
    for reverse, sign in ((False, 1), (True, -1)):
        m = mb.Model("rod", gravity=(0, -9.81, 0))
        r = problems.rod(m, "rod", (0, -0.5, 0), 1.0, mass=2.0, angle=-np.pi / 2)
        m.revolute("hinge", *((r, m.ground) if reverse else (m.ground, r)), at=(0, 0, 0), axis="z")
        np.testing.assert_allclose(mb.equilibrium(m).reactions["hinge"], (0, sign * 19.62, 0, 0, 0, 0), atol=1e-12)


def test_moments_are_about_the_joints_point():
    """A cantilever: the clamp carries the moment of the tip load about the clamp."""
    m = mb.Model("cantilever")
    b = problems.rod(m, "beam", (0.5, 0, 0), 1.0)
    m.fixed("clamp", m.ground, b, at=(0, 0, 0))
    m.force("tip", b, at=(1, 0, 0), value=(0, 0, -10.0))
    np.testing.assert_allclose(mb.equilibrium(m).reactions["clamp"], (0, 0, 10, 0, -10, 0), atol=1e-13)


@pytest.mark.parametrize("at", [0.5, 0.3])
def test_redundant_supports_share_the_same_in_metres_and_millimetres(at):
    """Two clamps: half each for a load in the middle; elsewhere some share, but one that no unit changes."""
    shares = []
    for unit in (1.0, 1000.0):
        p = problems.two_supports(unit, at=at)
        r = mb.equilibrium(p.model).reactions
        total = (r["left"] + r["right"])[2] / unit
        shares.append(r["left"][2] / unit / 100.0)
        assert total == pytest.approx(100.0, rel=1e-12)
    print(f"load at {at}: shares {shares[0]:.12f} (m), {shares[1]:.12f} (mm)")
    assert abs(shares[0] - shares[1]) < 1e-12
    if at == 0.5:
        assert abs(shares[0] - 0.5) < 1e-12


def test_redundant_reactions_balance_and_have_the_least_norm():
    """The four-bar of spatial hinges: every body is in balance, and no self-stress of the loop is left in the reactions."""
    m = mb.examples.four_bar()
    eq = mb.equilibrium(m)
    sys = ref.System(tables(m))
    state = reference_state(m, eq.state, sys)
    f = ref.dynamics.applied_residual(sys, state, np.zeros(6 * sys.nb))
    total = f.copy()
    for joint, link in zip(m.joints, sys.joints, strict=True):
        wrench = eq.reactions[joint.name]
        end = link.b
        R, c = (np.eye(3), np.zeros(3)) if end.body < 0 else (state.R[end.body], state.r[end.body])
        point = c + R @ end.s
        for body, sign in ((link.b.body, -1.0), (link.a.body, 1.0)):
            if body >= 0:
                k = 6 * body
                total[k : k + 3] += sign * wrench[:3]
                total[k + 3 : k + 6] += sign * (wrench[3:] + np.cross(point - state.r[body], wrench[:3]))
    scale = np.abs(f).max()
    print(f"four-bar: balance {np.abs(total).max() / scale:.1e}")
    assert np.abs(total).max() / scale < 1e-11


def test_large_ladder():
    """Forty layers of redundant loops: equilibrium, reactions and stability in one go."""
    m = mb.examples.ladder(40, "revolute", gravity=(0.0, -9.81, 0.0))
    eq = mb.equilibrium(m)
    print(f"ladder of 40 layers: residual {eq.residual:.1e}, {eq.iterations} iterations, stable {eq.stable}")
    assert eq.residual < 1e-11
    weight = sum(m.value(f"{b.name}.mass") for b in m.bodies) * 9.81
    carried = eq.reactions["J1,1a"][1] + eq.reactions["J1,2a"][1]
    bushings = 0.0  # drawn hinges keep the bushings unstrained, so all weight is in the joints
    assert carried + bushings == pytest.approx(weight, rel=1e-9)


def test_a_search_that_gives_up_carries_its_best_state():
    """A rod pushed by a follower force that only spins it: no equilibrium exists."""
    m = mb.Model("spinner")
    b = problems.rod(m, "rod", (0.5, 0, 0), 1.0)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z")
    m.torque("motor", b, value=(0, 0, 1.0), frame="body")
    with pytest.raises((mb.SingularError, mb.ConvergenceError)) as caught:
        mb.equilibrium(m)
    assert "hinge" in str(caught.value) or "restrain" in str(caught.value)


def test_start_from_a_given_state():
    """`at=` an equilibrium of the same model with other values: continuation in a parameter."""
    p = problems.spring_pendulum()
    eq = mb.equilibrium(p.model)
    p.model.set({"spring.k": 400.0})
    again = mb.equilibrium(p.model, at=eq)
    np.testing.assert_allclose(again.position("mass")[2], -0.5 - 2 * 9.81 / 400, atol=1e-13)
    assert again.iterations <= eq.iterations + 1


def test_rotations_up_to_half_a_turn():
    """A wheel on a torsion spring wound up by almost half a turn: k phi = M."""
    m = mb.Model("wheel")
    b = m.body("wheel", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), orientation=rotation("x", 0.4))
    m.revolute("shaft", m.ground, b, at=(0, 0, 0), axis=(1, 2, 2), k=2.0)
    axis = np.array([1, 2, 2]) / 3
    for moment in (1.0, -4.0, 6.2):
        m2 = m.copy()
        m2.torque("wind", "wheel", value=tuple(moment * axis))
        eq = mb.equilibrium(m2)
        turn = eq.rotation("wheel") @ rotation_matrix("x", 0.4).T
        angle = np.arctan2(
            axis @ np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]),
            np.trace(turn) - 1,
        )
        print(f"wheel wound by {moment}: error {abs(angle - moment / 2):.1e}")
        assert abs(angle - moment / 2) < 1e-12


def rotation_matrix(axis, angle):
    return ref.so3.from_quaternion(np.asarray(rotation(axis, angle)))


@pytest.mark.parametrize(("stiffness", "free"), [(3e-11, False), (1e-13, True), (0.0, True)])
def test_what_a_weak_spring_holds_is_not_free(stiffness, free):
    """Two bodies on a rail, one spring of stiffness one between them and a weak one to the ground."""
    m = mb.Model("rail")
    held = m.body("a", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    loose = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(2, 0, 0))
    m.prismatic("held", m.ground, held, at=(1, 0, 0), axis="x", k=stiffness)
    m.prismatic("loose", m.ground, loose, at=(2, 0, 0), axis="x")
    m.spring_damper("s", held, loose, at=((1, 0, 0), (2, 0, 0)), k=1.0)
    assert (mb.equilibrium(m).free_directions != ()) == free


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (1.3, -4.4, -8.1)], ids=["weightless", "heavy"])
def test_loops_and_drives_close_from_the_place_of_other_numbers(gravity):
    """A sweep of a driven four-bar in an oblique plane, each place sought from the one before: it is that from the drawing."""
    turn = rotation_matrix("x", 0.7) @ rotation_matrix("z", -0.4)
    at = [tuple(turn @ p) for p in ((0, 0, 0), (0.13, 0.9, 0), (1.1, 1.2, 0), (1.3, 0, 0))]
    axis = tuple(turn @ (0, 0, 1))
    m = mb.Model("driven four-bar", gravity=gravity)
    middles = [tuple(0.5 * (np.array(p) + q)) for p, q in pairwise(at)]
    bodies = [m.body(n, mass=1.3, inertia=(0.1, 0.12, 0.09), at=p) for n, p in zip("abc", middles, strict=True)]
    for i, (name, a, b) in enumerate(zip("ABCD", [m.ground, *bodies], [*bodies, m.ground], strict=True)):
        m.revolute(name, a, b, at=at[i], axis=axis)
    m.drive("motor", "A", mb.Ramp(rate=0.0, offset=m.parameter("angle", 0.0, unit="rad")))
    before = mb.equilibrium(m)
    for angle in (1e-3, 3e-3, 0.2, 0.5):
        m.set({"angle": angle})
        before, fresh = mb.equilibrium(m, at=before), mb.equilibrium(m)
        off = max(np.abs(before.position(b.name) - fresh.position(b.name)).max() for b in bodies)
        crank = np.linalg.norm(before.position("a") - np.array(middles[0]))
        print(f"{angle}: {before.status}, off {off:.1e}, error {before.error:.1e}")
        assert off < 1e-12 and before.status == "converged"
        assert abs(crank - 2 * np.linalg.norm(middles[0]) * np.sin(angle / 2)) < 1e-12
