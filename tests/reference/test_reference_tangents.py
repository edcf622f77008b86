"""M, D, S of the reference against complex steps of a residual made of positions alone, and forces against energies."""

from __future__ import annotations

import numpy as np
import pytest
import reference_residual as rr
from mbrs.reference import State, System, advance, assemble, drawn_state, linearize, so3
from mbrs.reference import dynamics as dyn
from mbrs.reference import joints as jt
from mbrs.reference.assembly import close_loops, constraint_values, mobility, partition, twist_map
from mbrs.reference.kinematics import link_pair, motion, moving, split
from reference_models import Builder, random_quaternion

TOLERANCE = 1e-11  # nine-point differences in time leave about 1e-13 here, and 1e-11 in loops (shorter steps)
KINDS = ["revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free", "fixed"]


def element_force(sys, state, without=()):
    return dyn.elements(sys, moving(state, np.zeros(6 * sys.nb)), without).value[0]


def add_elements(b, rng, i, inner, outer, near):
    """One of everything between two bodies, all numbers invented."""
    full = rng.normal(size=(6, 6))
    K = 3 * full @ full.T
    ends = near + 0.3 * rng.normal(size=(4, 3))
    q = random_quaternion(rng)
    b.bushing(f"bush{i}", inner, outer, ends[0], K, c=0.05 * K, preload=rng.normal(size=6), q=q, at_b=ends[1])
    b.spring(f"spring{i}", inner, outer, ends[2] + 1.0, ends[3], k=8.0, c=0.4, length=0.1, preload=0.3)
    b.torsion(f"torsion{i}", inner, outer, near, rng.normal(size=3), 3.0, 0.2, 0.1, 0.2)
    for kind in ("force", "torque"):
        for follower in (False, True):
            b.load(f"{kind}{i}{follower}", kind, outer, ends[2], rng.normal(size=3), follower)


def add_body(b, rng, name, at):
    inertia, com = (1, 1.2, 0.8, 0.1, 0.05, -0.1), 0.2 * rng.normal(size=3)
    b.body(name, 1 + rng.random(), inertia, at=at, q=random_quaternion(rng), com=com)


def joint_numbers(rng):
    law = dict(k=5 + 5 * rng.random(6), c=rng.random(6), preload=rng.normal(size=6))
    return dict(axis=rng.normal(size=3), axis2=rng.normal(size=3), **law)


def random_tree(kinds, rng, flip):
    b, inner, before = Builder(gravity=(0.3, -9.81, 1.0)), None, np.zeros(3)
    for i, kind in enumerate(kinds):
        here, name = before + rng.normal(size=3), f"b{i}"
        add_body(b, rng, name, here)
        a_b = (name, inner) if flip else (inner, name)
        b.joint(f"j{i}", kind, *a_b, 0.5 * (before + here), **joint_numbers(rng))
        add_elements(b, rng, i, inner, name, 0.5 * (before + here))
        inner, before = name, here
    return System(b.tables())


def random_loop(kinds, rng, distance):
    """ground - b0 - b1 - b2 - ground, and a rod between b0 and b2 if asked for."""
    b = Builder(gravity=(0.3, -9.81, 1.0))
    centres = np.array([[0.0, 0, 0], [0.1, 1, 0], [1, 1.3, 0.4], [1.4, 0.2, -0.3], [1.5, -0.7, 0]])
    for i in range(3):
        add_body(b, rng, f"b{i}", centres[i + 1])
    names = [None, "b0", "b1", "b2", None]
    for i, kind in enumerate(kinds):
        b.joint(f"j{i}", kind, names[i], names[i + 1], 0.5 * (centres[i] + centres[i + 1]), **joint_numbers(rng))
    if distance:
        b.joint("rod", "distance", "b0", "b2", centres[1] + 0.1, at_b=centres[3] - 0.1)
    add_elements(b, rng, 0, "b0", "b2", centres[2])
    return System(b.tables())


def moving_state(sys, state, rng, speed):
    part = partition(sys, state)
    T = twist_map(sys, motion(state), part).value
    rates = speed * rng.normal(size=T.shape[1])
    return State(state.r, state.R, *split(T @ rates)), part, rates


def compare(sys, state, part, rates, step=rr.STEP):
    lin = linearize(sys, state, part.independent)
    M, D, S = rr.matrices(sys, state, part, rates, step)
    worst = {
        n: np.max(np.abs(a - e)) / np.max(np.abs(e)) for n, a, e in (("M", lin.M, M), ("D", lin.D, D), ("S", lin.S, S))
    }
    print(worst)
    return worst


@pytest.mark.some(5)
@pytest.mark.parametrize("speed, flip", [(0.0, False), (0.7, False), (0.7, True)])
@pytest.mark.parametrize("kind", KINDS)
def test_tangents_of_trees(kind, speed, flip):
    """Off equilibrium, at rotated relative poses, both orders of the joint's bodies, at rest and moving."""
    rng = np.random.default_rng([KINDS.index(kind), int(10 * speed), flip])
    sys = random_tree(["revolute", kind] if kind == "fixed" else [kind, "revolute"], rng, flip)
    state = advance(sys, drawn_state(sys), 0.5 * rng.normal(size=sys.ny))
    worst = compare(sys, *moving_state(sys, state, rng, speed))
    assert max(worst.values()) < TOLERANCE


@pytest.mark.oracle
@pytest.mark.parametrize(
    "kinds, distance",
    [
        (("spherical", "universal", "cylindrical", "spherical"), False),
        (("spherical", "universal", "cylindrical", "spherical"), True),
        (("universal", "spherical", "spherical", "planar"), True),
        (("spherical", "prismatic", "spherical", "cylindrical"), False),
        (("cylindrical", "cylindrical", "cylindrical", "universal"), False),
    ],
)
def test_tangents_of_loops(kinds, distance):
    speed, rng = 0.2, np.random.default_rng([len(kinds[0]), distance])
    sys = random_loop(kinds, rng, distance)
    part = partition(sys, drawn_state(sys))
    y = np.zeros(sys.ny)
    y[part.independent] = 0.1 * rng.normal(size=len(part.independent))
    state = close_loops(sys, advance(sys, drawn_state(sys), y), fixed=part.independent)
    assert np.max(np.abs(constraint_values(sys, state, sys.joints))) < 1e-12
    assert mobility(sys).dof > 0
    worst = compare(sys, *moving_state(sys, state, rng, speed), step=0.005)
    assert max(worst.values()) < 1e-9


def test_tangents_of_a_redundant_loop():
    """A planar parallelogram of revolutes, in motion, tilted in space."""
    b, tilt = Builder(gravity=(1, -9, 2)), so3.exp(np.array([0.3, -0.4, 0.2]))
    points = [tilt @ p for p in np.array([[0, 0, 0], [0.3, 1, 0], [1.3, 1.2, 0], [1.1, 0, 0]], float)]
    for i in range(3):
        b.body(f"b{i}", 1.5, (0.1, 0.2, 0.25), at=0.5 * (points[i] + points[i + 1]), com=(0.02, 0.01, 0.03))
    names = [None, "b0", "b1", "b2", None]
    for i in range(4):
        b.joint(f"j{i}", "revolute", names[i], names[i + 1], points[i], axis=tilt[:, 2], k=[2.0], c=[0.3])
    sys = System(b.tables())
    found = mobility(sys)
    assert (found.dof, found.rank, len(found.redundant)) == (1, 2, 3)
    state, part, rates = moving_state(sys, drawn_state(sys), np.random.default_rng(1), 0.5)
    assert max(compare(sys, state, part, rates, 0.005).values()) < 1e-9


@pytest.mark.parametrize("kind", ["bushing", "spring_damper", "torsion"])
def test_element_forces_derive_from_their_energy(kind):
    """Q = -dV/dq with V = e.k.e/2 + preload.e, by complex steps of e alone; the element's own row formulas are not
    used.
    """
    rng = np.random.default_rng(5)
    b = Builder()
    add_body(b, rng, "p", rng.normal(size=3))
    add_body(b, rng, "q", rng.normal(size=3))
    add_elements(b, rng, 0, "p", "q", rng.normal(size=3))
    sys = System(b.tables())
    sys.elements = [e for e in sys.elements if e.kind == kind]
    state = advance(sys, drawn_state(sys), rng.normal(size=12))

    def energy(increment):
        moved = State(
            state.r + increment[:, :3],
            np.array([so3.exp(d) @ R for d, R in zip(increment[:, 3:], state.R, strict=True)]),
            state.v,
            state.w,
        )
        link = sys.elements[0]
        e = jt.coordinate_values(link, link_pair(link, motion(moved)))
        k, _, preload = dyn.law_numbers(link)
        return 0.5 * e @ k @ e + preload @ e

    gradient = [energy(1e-30j * unit.reshape(2, 6)).imag / 1e-30 for unit in np.eye(12)]
    np.testing.assert_allclose(element_force(sys, state, ["damping"]), gradient, rtol=1e-12, atol=1e-12)


def test_joint_spring_forces_derive_from_their_energy():
    """Generalised forces of the joints' own springs are -dV/dy of the tree coordinates."""
    for kind in KINDS[:-1]:
        rng = np.random.default_rng(KINDS.index(kind))
        b = Builder()
        add_body(b, rng, "p", rng.normal(size=3))
        b.joint("j", kind, None, "p", rng.normal(size=3), **joint_numbers(rng))
        sys = System(b.tables())
        state = advance(sys, drawn_state(sys), rng.normal(size=sys.ny))
        link = sys.joints[0]

        def energy(y, sys=sys, state=state, link=link):
            e = jt.coordinate_values(link, link_pair(link, motion(advance(sys, state, y))))
            k, _, preload = dyn.law_numbers(link)
            return 0.5 * e @ k @ e + preload @ e

        gradient = [energy(1e-30j * unit).imag / 1e-30 for unit in np.eye(sys.ny)]
        T = twist_map(sys, motion(state), partition(sys, state)).value
        np.testing.assert_allclose(T.T @ element_force(sys, state, ["damping"]), gradient, rtol=1e-12, atol=1e-12)


def test_damping_follows_the_rates_of_the_coordinates():
    """c e' with e' from differences of e along the motion."""
    rng = np.random.default_rng(8)
    b = Builder()
    add_body(b, rng, "p", rng.normal(size=3))
    add_body(b, rng, "q", rng.normal(size=3))
    add_elements(b, rng, 0, "p", "q", rng.normal(size=3))
    sys = System(b.tables())
    state = assemble(sys, advance(sys, drawn_state(sys), rng.normal(size=12)))
    v = rng.normal(size=(2, 6))
    state = State(state.r, state.R, v[:, :3], v[:, 3:])
    h = 1e-30
    later = State(
        state.r + 1j * h * state.v,
        np.array([so3.exp(1j * h * w) @ R for w, R in zip(state.w, state.R, strict=True)]),
        state.v,
        state.w,
    )
    expected = 0.0
    for link in sys.elements:
        rate = jt.coordinate_values(link, link_pair(link, motion(later))).imag / h
        expected += rate @ dyn.law_numbers(link)[1] @ rate
    power = v.ravel() @ (element_force(sys, state) - element_force(sys, state, ["damping"]))
    assert power == pytest.approx(expected, rel=1e-12)
