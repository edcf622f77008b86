"""The reference against answers known in closed form, and equilibria of trees and loops."""

from __future__ import annotations

import numpy as np
import pytest
from mbrs.errors import ModelError
from mbrs.reference import (
    State,
    System,
    advance,
    assemble,
    drawn_state,
    equilibrium,
    linearize,
    modes,
    reactions,
)
from mbrs.reference.assembly import mobility
from mbrs.reference.so3 import from_quaternion
from reference_models import Builder, cubic_hexapod, hanging_four_bar, hanging_rod, ladder, quaternion


def frequencies(lin):
    return modes(lin.M, lin.C, lin.G, lin.K, lin.N).frequency


@pytest.mark.parametrize("model, expected", [(hanging_rod, 0.610521), (hanging_four_bar, 0.546066)])
def test_constraint_force_stiffness(model, expected):
    """sqrt(m g l/2 / (m l^2/3)) / 2 pi and sqrt(2 g / (5/3)) / 2 pi."""
    sys = System(model().tables())
    state, _, residual = equilibrium(sys)
    assert residual < 1e-12
    assert round(float(frequencies(linearize(sys, state))[0]), 6) == expected
    assert frequencies(linearize(sys, state, without=("constraint-force-stiffness",)))[0] < 1e-6
    assert frequencies(linearize(sys, state, without=("gravity",)))[0] < 1e-6


@pytest.mark.parametrize("model", [hanging_rod, hanging_four_bar])
def test_equilibrium_from_far_away(model):
    sys = System(model().tables())
    y = np.zeros(sys.ny)
    y[0] = 0.9
    state = assemble(sys, advance(sys, drawn_state(sys), y))
    assert np.max(np.abs(state.r - drawn_state(sys).r)) > 0.1
    state, _, residual = equilibrium(sys, state)
    assert residual < 1e-12
    np.testing.assert_allclose(state.r, drawn_state(sys).r, atol=1e-10)


def test_reactions_of_a_hanging_rod_and_of_a_redundant_door():
    sys = System(hanging_rod().tables())
    state, lam, _ = equilibrium(sys)
    np.testing.assert_allclose(reactions(sys, state, lam)["hinge"], [0, 9.81, 0, 0, 0, 0], atol=1e-12)
    b = Builder(gravity=(0, 0, -10))
    b.body("door", 3.0, (1, 1, 1), at=(0.5, 0, 0))
    b.joint("low", "revolute", None, "door", (0, 0, -1))
    b.joint("high", "revolute", None, "door", (0, 0, 1))
    sys = System(b.tables())
    state, lam, _ = equilibrium(sys)
    wrench = reactions(sys, state, lam)
    total = sum(w[:3] for w in wrench.values())
    moment = sum(w[3:] + np.cross([0, 0, z], w[:3]) for w, z in ((wrench["low"], -1), (wrench["high"], 1)))
    np.testing.assert_allclose(total, [0, 0, 30], atol=1e-12)
    np.testing.assert_allclose(moment, [0, -15, 0], atol=1e-12)
    np.testing.assert_allclose(wrench["low"][2], wrench["high"][2])  # the least norm shares evenly


def test_least_norm_reactions_do_not_depend_on_units():
    """The same door in metres and in millimetres (mass in kg, so that forces scale by 1000 and moments by 1e6)."""
    answers = []
    for unit in (1.0, 1000.0):
        b = Builder(gravity=(0, 0, -10 * unit))
        b.body("door", 3.0, np.array([1, 1, 1]) * unit**2, at=(0.5 * unit, 0, 0))
        b.joint("low", "revolute", None, "door", (0, 0, -1 * unit))
        b.joint("high", "fixed", None, "door", (0, 0.2 * unit, 1.5 * unit))
        sys = System(b.tables())
        state, lam, _ = equilibrium(sys)
        w = reactions(sys, state, lam)
        answers.append(np.concatenate([np.r_[v[:3] / unit, v[3:] / unit**2] for v in w.values()]))
    np.testing.assert_allclose(*answers, rtol=1e-9, atol=1e-9)


def test_cubic_hexapod():
    """omega^2 = k/m * 6/3 (translations), k a^2/2 ... : 15.9155 x 3, 18.3776 x 2, 36.7553 Hz, docs/theory.md (23.1)."""
    sys = System(cubic_hexapod().tables())
    lin = linearize(sys, drawn_state(sys))
    m = modes(lin.M, None, None, lin.K, None)
    k, mass, inertia, edge = 1e5, 20.0, 0.15, 0.2
    translation, tilt = np.sqrt(2 * k / mass), np.sqrt(k * edge**2 / 2 / inertia)
    expected = np.array([translation] * 3 + [tilt] * 2 + [2 * tilt]) / (2 * np.pi)
    np.testing.assert_allclose(m.frequency, expected, rtol=1e-12)
    np.testing.assert_allclose(expected, [15.9155] * 3 + [18.3776] * 2 + [36.7553], atol=5e-5)
    assert [len(g) for g in m.groups] == [3, 2]
    damped = modes(lin.M, lin.C, lin.G, lin.K, lin.N)
    np.testing.assert_allclose(damped.damping, np.pi * damped.frequency * 30.0 / k, rtol=1e-10)  # c = (30/1e5) k


@pytest.mark.parametrize(
    "kind, rows, rank, dof", [("revolute", 15, 6, 3), ("cylindrical", 12, 6, 12), ("spherical", 9, 9, 18)]
)
def test_ladder_ranks(kind, rows, rank, dof):
    """docs/theory.md (23.4): N = 3 layers."""
    sys = System(ladder(3, kind).tables())
    found = mobility(sys)
    assert (found.rank, found.dof, len(found.redundant), len(sys.cut)) == (rank, dof, rows - rank, 3)
    lin = linearize(sys, drawn_state(sys))
    assert lin.M.shape == (dof, dof)


def test_spinning_disc():
    """A disc on a massless bearing with isotropic tilting stiffness k: lambda^2 I_t - i lambda I_p Omega + k = 0 for
    the tilt
    phi_x + i phi_y, so the whirl speeds are (I_p Omega +- sqrt((I_p Omega)^2 + 4 I_t k)) / (2 I_t).
    """
    I_t, I_p, k, speed = 0.2, 0.35, 50.0, 40.0
    b = Builder()
    b.body("frame", 1e-3, (0.0, 0.0, 0.0))
    b.body("disc", 2.0, (I_t, I_t, I_p), w=(0, 0, speed))
    b.joint("gimbal", "universal", None, "frame", (0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0), k=[k, k])
    b.joint("shaft", "revolute", "frame", "disc", (0, 0, 0))
    sys = System(b.tables())
    lin = linearize(sys, drawn_state(sys))
    np.testing.assert_allclose(lin.residual, 0, atol=1e-12)
    m = modes(lin.M, lin.C, lin.G, lin.K, lin.N)
    root = np.sqrt((I_p * speed) ** 2 + 4 * I_t * k)
    expected = np.sort(np.abs([0, I_p * speed - root, I_p * speed + root])) / (2 * I_t)
    np.testing.assert_allclose(np.abs(m.eigenvalue), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(m.eigenvalue.real, 0, atol=1e-11)
    assert np.max(np.abs(lin.G)) == pytest.approx(I_p * speed)
    without = linearize(sys, drawn_state(sys), without=("gyroscopic",))
    assert np.max(np.abs(without.G)) == 0


def test_centrifugal_stiffness_of_a_pendulum_on_a_rotor():
    """Point mass on a rod hinged at radius a of a wheel, swinging in its plane: omega^2 = Omega^2 a / l (textbook)."""
    a, length, speed = 0.7, 0.4, 9.0
    b = Builder()
    b.body("wheel", 5.0, (1, 1, 1e9), w=(0, 0, speed))
    b.body("bob", 1.0, (1e-9, 1e-9, 1e-9), at=(a + length, 0, 0), v=(0, speed * (a + length), 0), w=(0, 0, speed))
    b.joint("axle", "revolute", None, "wheel", (0, 0, 0))
    b.joint("hinge", "revolute", "wheel", "bob", (a, 0, 0))
    sys = System(b.tables())
    lin = linearize(sys, drawn_state(sys))
    omega = np.max(np.abs(modes(lin.M, lin.C, lin.G, lin.K, lin.N).eigenvalue))
    assert omega == pytest.approx(speed * np.sqrt(a / length), rel=1e-6)  # the heavy wheel holds its speed to 1e-9


def test_follower_force_makes_a_circulatory_matrix():
    """Two hinged bars under a follower load (Ziegler's column): S = [[k1 + k2 - P l, P l - k2], [-k2, k2]] in absolute
    angles (P compressive), so its skew part does not vanish.
    """
    P, k, length = 3.0, 10.0, 0.5
    b = Builder()
    for i in range(2):
        b.body(f"bar{i}", 1.0, (0.1, 0.1, 0.1), at=((i + 0.5) * length, 0, 0))
    b.joint("j0", "revolute", None, "bar0", (0, 0, 0), k=[k])
    b.joint("j1", "revolute", "bar0", "bar1", (length, 0, 0), k=[k])
    b.load("push", "force", "bar1", (2 * length, 0, 0), (-P, 0, 0), follower=True)
    sys = System(b.tables())
    lin = linearize(sys, drawn_state(sys))
    to_relative = np.array([[1, 0], [1, 1]])  # absolute angles from joint angles
    absolute = np.array([[2 * k - P * length, P * length - k], [-k, k]])
    np.testing.assert_allclose(lin.S, to_relative.T @ absolute @ to_relative, atol=1e-12)


def test_assembly_of_two_points_and_of_a_given_length():
    b = Builder(gravity=(0, -10, 0))
    b.body("bar", 1.0, (0.1, 0.1, 0.1), at=(0.6, 0.1, 0))
    b.body("rod", 1.0, (0.1, 0.1, 0.1), at=(1.5, -0.5, 0))
    b.joint("a", "revolute", None, "bar", (0, 0, 0), at_b=(0.1, 0.1, 0))
    b.joint("b", "revolute", "bar", "rod", (1.1, 0.1, 0), at_b=(1.2, 0, 0))
    b.joint("link", "distance", None, "rod", (0, -1.0, 0), at_b=(1.7, -0.9, 0), length=1.6)
    sys = System(b.tables())
    state = assemble(sys, drawn_state(sys))
    end = state.r[1] + state.R[1] @ sys.joints[2].b.s
    assert np.linalg.norm(end - [0, -1, 0]) == pytest.approx(1.6, abs=1e-12)
    assert mobility(sys).dof == 1
    assert equilibrium(sys, state)[2] < 1e-12


def test_poses_and_origins():
    """T holds the twist of the origin; a state from quaternions is the drawn one."""
    b = Builder()
    b.body(
        "p", 2.0, (1, 2, 2), at=(1, 2, 3), q=quaternion((1, 2, 0), 0.7), com=(0.1, -0.2, 0.3), v=(1, 0, 2), w=(0, 1, -1)
    )
    b.joint("j", "free", None, "p", (0, 0, 0), axis=(1, 1, 0))
    sys = System(b.tables())
    state = drawn_state(sys)
    again = State(state.r, from_quaternion(quaternion((1, 2, 0), 0.7))[None], state.v, state.w)
    np.testing.assert_allclose(again.R, state.R, atol=1e-15)
    lin = linearize(sys, state)
    rates = np.linalg.solve(lin.T, [1, 0, 2, 0, 1, -1])
    np.testing.assert_allclose(lin.state.v, state.v)
    assert np.all(np.isfinite(rates))
    moved = advance(sys, State(state.r, state.R, state.v, state.w), np.array([1e-7, 0, 0, 0, 2e-7, 0]))
    before, after = (s.r[0] - s.R[0] @ sys.bodies[0].com for s in (state, moved))
    np.testing.assert_allclose((after - before) / 1e-7, lin.T[:3] @ [1, 0, 0, 0, 2, 0], atol=1e-6)


def test_what_the_reference_refuses():
    b = hanging_rod()
    with pytest.raises(ModelError, match="unknown effect"):
        linearize(System(b.tables()), drawn_state(System(b.tables())), without=("wind",))
    table = dict(law_owner_kind=[1], law_owner=[0], law_component=[0], law_type=[7], law_n=[4], law_x=[0])
    with pytest.raises(ModelError, match="table laws"):
        System({**b.tables(), **table})
