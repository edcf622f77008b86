"""Constraints given as functions in linear analyses: against joints, closed forms and differences of forces."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from constraint_models import AXIS, Bead, ball, cam, driven_arm, frame, pendulum, skate


@pytest.mark.parametrize("kind", ["function", "derivatives"])
def test_a_pendulum_of_a_function_is_that_of_a_rod(kind):
    """Equilibrium, roots and transfer functions; the row is the square of the rod's."""
    one, other = pendulum("rod"), pendulum(kind)
    a, b = mb.equilibrium(one), mb.equilibrium(other)
    assert b.status == "converged"
    assert b.position("bob") == pytest.approx(a.position("bob"), abs=1e-12)
    roots = [mb.modes(m, at=at).roots for m, at in ((one, a), (other, b))]
    assert roots[1] == pytest.approx(roots[0], rel=1e-11)
    H = [
        mb.frf(m, "bob.force.x", ["bob.motion.y", "bob.motion.rz"], frequency=[0.3, 0.9, 2.0], at=at).value
        for m, at in ((one, a), (other, b))
    ]
    assert np.abs(H[1] - H[0]).max() < 1e-11 * np.abs(H[0]).max()


def test_three_rows_are_a_ball_joint():
    a, b = (mb.modes(m, at=mb.equilibrium(m)) for m in (ball("joint"), ball("function")))
    assert mb.System(ball("function")).dof == 3
    assert b.roots == pytest.approx(a.roots, rel=1e-11)


def test_response_in_time_is_that_of_a_rod():
    t = np.linspace(0, 2, 41)
    y = [
        mb.response(m, t, {"bob.force.x": np.sin(3 * t)}, ["bob.motion.z"], at=mb.equilibrium(m))
        for m in map(pendulum, ("rod", "function"))
    ]
    assert np.abs(y[1].value - y[0].value).max() < 1e-11 * np.abs(y[0].value).max()


def test_frequency_of_a_bead_in_its_trough():
    """omega^2 = (-g_y f"(x)) / (1 + f'^2) where f' = -g_x/g_y: the multiplier times the curvature of the function is all the stiffness."""
    case = Bead()
    gx, gy, _ = case.R.T @ case.gravity
    f1, f2 = (lambda x: 0.8 * np.cos(2 * x) + 0.3), (lambda x: -1.6 * np.sin(2 * x))
    m = case.model(k=50.0)
    eq = mb.equilibrium(m)
    x = (case.R.T @ (eq.position("bead") - case.start))[0]
    assert gx + gy * f1(x) == pytest.approx(0, abs=1e-9)
    omega = np.sqrt(-gy * f2(x) / (1 + f1(x) ** 2))
    found = 2 * np.pi * mb.modes(m, at=eq).frequency
    print(x, omega, found)
    assert np.abs(found / omega - 1).min() < 1e-11


def test_stiffness_is_the_slope_of_the_force_that_holds_it():
    """K of the one free angle against central differences of the torque of a drive; gravity, springs and the multiplier act."""
    place, h = -0.4, 1e-3

    def torque(z):
        return mb.equilibrium(cam(z)).reactions["hold"][3:] @ AXIS

    slope = (8 * (torque(place + h) - torque(place - h)) - torque(place + 2 * h) + torque(place - 2 * h)) / (12 * h)
    m = cam(preload=-torque(place))
    lin = mb.linearize(m, at=mb.equilibrium(m, at=mb.equilibrium(cam(place)).state))
    print(lin.K, slope)
    assert lin.K[0, 0] == pytest.approx(slope, rel=1e-8)


def test_sensitivities_against_differences():
    """Frequencies of the cam by a parameter of its function, a stiffness and a mass."""
    m = cam()
    names = ["bend", "tie.k", "b.mass"]
    found = mb.sensitivity(mb.modes(m, at=mb.equilibrium(m)), names)
    for i, name in enumerate(names):
        value, f = float(m.value(name)), []
        for step in (1e-4, -1e-4):
            other = m.copy()
            other.set({name: value * (1 + step)})
            f.append(mb.modes(other, at=mb.equilibrium(other)).frequency[0])
        slope = (f[0] - f[1]) / (2e-4 * value)
        assert found.frequency[0, i] == pytest.approx(slope, rel=1e-6), name


def test_a_row_of_velocities_is_a_knife_edge():
    """At rest in an equilibrium on a slope."""
    a, b = (mb.modes(m, at=mb.equilibrium(m)) for m in (skate("joint", 4.0), skate("function", 4.0)))
    assert mb.System(skate("function")).dof == 2
    assert b.roots == pytest.approx(a.roots, rel=1e-10)


def test_a_row_of_velocities_rolls_straight_ahead_as_a_knife_edge_does():
    """A sled whose centre of mass is behind its blade, on level ice: the root v m a/(J + m a^2) to positive real parts, three zeros."""
    R, blade, behind = frame(7), np.array([0.25, 0.22, -0.05]), 0.1
    roots = []
    for kind in ("joint", "function"):
        m = mb.Model("sled")
        at, velocity = tuple(blade - behind * R[:, 0]), tuple(0.8 * R[:, 0])
        sled = m.body("sled", mass=1.4, inertia=(0.3, 0.3, 0.3), at=at, velocity=velocity)
        m.planar("ice", m.ground, sled, at=tuple(blade), orientation=R)
        if kind == "joint":
            m.knife_edge("edge", m.ground, sled, at=tuple(blade), axis=tuple(R[:, 1]))
        else:
            m.velocity_constraint("edge", lambda t, u: [-np.sin(u[2]), np.cos(u[2]), 0.0], ["ice.x", "ice.y", "ice.rz"])
        roots.append(np.sort(mb.modes(m).roots.real))
    expected = 0.8 * 1.4 * behind / (0.3 + 1.4 * behind**2)
    assert roots[0] == pytest.approx([0, 0, 0, expected], abs=1e-12) and roots[1] == pytest.approx(roots[0], abs=1e-12)


def test_linear_analyses_hold_time_at_zero():
    a, b = (mb.modes(driven_arm(kind), at=mb.equilibrium(driven_arm(kind))) for kind in ("drive", "function"))
    assert b.roots == pytest.approx(a.roots, rel=1e-11) and len(a.roots) == 4


def test_a_moving_state_with_time_in_its_rows_is_refused_by_name():
    m = driven_arm("function")
    with pytest.raises(mb.MbrsError, match=r"'motor'.*changes with time.*simulate"):
        mb.linearize(m, at=mb.simulate(m, t=0.3).state())


def test_harmonic_balance_is_that_of_a_rod():
    """With a hardening spring beside the constraint."""
    curves = []
    for kind in ("rod", "function"):
        m = pendulum(kind)
        m.spring_damper("hard", m.ground, "bob", at=((2.0, 0.3, 0.2), (1.0, 0.5, 0.1)), law=mb.Cubic(300.0))
        at = mb.equilibrium(m)
        curves.append(mb.harmonic_balance(m, inputs="bob.force.x", amplitude=0.5, frequency=0.8, harmonics=5, at=at))
    for k, name in ((1, "ry"), (2, "ry"), (1, "rx")):
        a, b = (c.amplitude(f"{stem}.{name}", k) for c, stem in zip(curves, ("bob", "bob motion"), strict=True))
        assert b == pytest.approx(a, rel=1e-9), (name, k)


def test_the_reference_refuses_by_name():
    m = pendulum("function")
    with pytest.raises(mb.ModelError, match="'rod'"):
        mb.compare(mb.modes(m, at=mb.equilibrium(m)))


def test_effects_name_velocity_rows():
    assert mb.effects(skate("function"))["nonholonomic"].why == "edge"


@pytest.mark.slow
def test_lowest_modes_of_a_large_model():
    """The sparse route knows such rows: the modes are those of the joint that says the same."""

    def held(pin):
        m = mb.Model("row of bodies")
        last = m.ground
        for i in range(70):
            body = m.body(f"b{i}", mass=1.1, inertia=(0.1, 0.13, 0.17), at=(i + 1.0, 0.0, 0.0))
            m.bushing(f"s{i}", last, body, at=(i + 0.5, 0.0, 0.0), k=(1e4, 1.3e4, 1.7e4, 2e4, 1.1e4, 1.9e4))
            last = body
        pin(m, last)
        return mb.modes(m, n=5)

    def rows(m, body):
        m.constraint("pin", lambda t, u: [u[0], u[1], u[2]], [body.motion(axis) for axis in "xyz"])

    found, known = held(rows), held(lambda m, body: m.spherical("pin", m.ground, body, at=(70.0, 0.0, 0.0)))
    assert "sparse" in known.stats.route and "sparse" in found.stats.route
    assert found.frequency == pytest.approx(known.frequency, rel=1e-8)
