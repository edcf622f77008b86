"""Air on blades that move and bend: powers, forces, tangents and schemes against what shares no code with them."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from air_models import polars, rotor, vane

RNG = np.random.default_rng(20)


def motion(m, t=0.02, n=3, **options):
    return mb.simulate(m, t=np.linspace(0.0, t, n), **{"rtol": 1e-9, **options})


@pytest.mark.parametrize("flexible", [True, False])
def test_the_power_of_the_coordinates_is_that_of_the_sections(flexible):
    """M (a with air - a without) is the generalised force; times the rates it is the sum of force times velocity of the strips."""
    m = vane(flexible=flexible)
    traj = motion(m)
    still = motion(m, without=("aerodynamics",))
    state = traj.state(0.02)
    free = mb.simulate(m, t=[0.02], at=state, without=("aerodynamics",), rtol=1e-9)
    change = traj.acceleration[-1] - free.acceleration[-1]
    mass = mb.linearize(m, at=state).M
    power = traj.rate[-1] @ mass @ change
    assert power == pytest.approx(traj.power[-1], rel=1e-9)
    assert abs(traj.power[-1]) > 1.0 and still.t[-1] == traj.t[-1]


def test_forces_are_those_of_a_short_script():
    """From positions and velocities of nodes alone, with the polars' own interpolation."""
    m = vane(shear=0.21, reference_height=7.0, up=(0.2, -0.3, 1.0), ground=-9.0)
    traj = motion(m)
    air, blade = m.airs[0], m.airs[0].blades[0]
    known = {p.name: p for p in polars()}
    loads = traj.aero("arm")
    wind = mb.aero.wind(13.7, m.value("air.direction"), 0.21, 7.0, (0.2, -0.3, 1.0), -9.0)
    total = 0.0
    for k in range(5):
        node = f"arm.air{k + 1}"
        R, v, w = traj.rotation(node)[-1], traj.velocity(node)[-1], traj.angular_velocity(node)[-1]
        twist, chord = blade["twist"][k] + 0.07, blade["chord"][k]
        ahead = R @ [0.0, np.cos(twist), -np.sin(twist)]
        rear = (0.31 - 0.75) * chord * ahead
        u = wind.velocity(traj.position(node)[-1] + rear) - v - np.cross(w, rear)
        normal, along = u @ R[:, 2], -u @ R[:, 1]
        alpha, speed = np.arctan2(normal, along) - twist, np.hypot(normal, along)
        share = blade["share"][k]
        c = [
            (1 - s) * known[p].coefficients(alpha)
            for p, s in ((blade["polar"][k], share), (blade["second_polar"][k], 1 - share))
        ]
        cl, cd, cm = np.sum(c, axis=0)
        across = u - (u @ R[:, 0]) * R[:, 0]
        force = 0.5 * 1.31 * chord * (speed * cl * np.cross(across, R[:, 0]) + cd * speed * across)
        assert loads.angle_of_attack[-1, k] == pytest.approx(np.mod(alpha + np.pi, 2 * np.pi) - np.pi, rel=1e-10)
        assert loads.force[-1, k] == pytest.approx(force, rel=1e-9, abs=1e-9)
        assert loads.circulation[-1, k] == pytest.approx(0.5 * chord * speed * cl, rel=1e-9)
        moment = 0.5 * 1.31 * chord**2 * speed**2 * cm * R[:, 0]
        arm = (0.31 - blade["aerodynamic_center"][k]) * chord * ahead
        total += blade["width"][k] * (force @ (v + np.cross(w, arm)) + moment @ w)
    assert traj.power[-1] == pytest.approx(total, rel=1e-9)
    assert air.inflow == "none"


@pytest.mark.parametrize(("inflow", "flexible"), [("none", True), ("none", False), ("bem", True)])
def test_linearised_forces_are_the_slopes_of_the_forces(inflow, flexible):
    """Accelerations beside an equilibrium in wind: -M^-1 (K dq + (C + G) dv), by central differences of initial accelerations."""
    m = vane(flexible=flexible, inflow=inflow)
    eq = mb.equilibrium(m)
    lin = mb.linearize(m, at=eq)
    n = len(lin.M)
    inverse = np.linalg.inv(lin.M)
    K, C = (sum(part for part in parts if part is not None) for parts in ((lin.K, lin.N), (lin.C, lin.G)))
    exact = [-inverse @ K, -inverse @ C]

    def acceleration(dq, dv):
        state = mb.simulate(m, t=[0.0], at=eq, rtol=1e-9).state()
        moved = type(state)(state.q + dq, dv, "given")
        return mb.simulate(m, t=[0.0], at=moved, rtol=1e-9).acceleration[0]

    for k, step in ((0, 1e-5), (1, 1e-4)):
        found = np.empty((n, n))
        for i in range(n):
            e = step * np.eye(n)[i]
            pair = [acceleration(*((s * e, 0 * e) if k == 0 else (0 * e, s * e))) for s in (1.0, -1.0)]
            found[:, i] = (pair[0] - pair[1]) / (2 * step)
        size = np.abs(inverse) @ np.abs(K if k == 0 else C)
        assert np.all(np.abs(found - exact[k]) <= 3e-6 * size.max(axis=1)[:, None])
    without = mb.linearize(m, at=eq, without=("aerodynamics",))
    assert np.max(np.abs(lin.C - without.C)) > 1e-2 * np.max(np.abs(lin.C))


@pytest.mark.parametrize("inflow", ["none", "bem"])
def test_a_parked_blade_in_wind_across_its_chord_has_tangents(inflow):
    """The wind has no component along the body's y axis, exactly: the same modes as in wind that is turned by 1e-7."""

    def eigenvalues(side):
        m = mb.Model("parked")
        body = m.body("blade", mass=30.0, inertia=(1.0, 90.0, 90.0), com=(3.0, 0.0, 0.0), at=(0, 0, 0))
        m.revolute("flap", m.ground, body, at=(0, 0, 0), axis="y", k=2e5)
        blade = mb.aero.blade([1.0, 6.0], 0.5, 0.1, polars()[0], body="blade", sections=5)
        wind = mb.aero.wind(9.0, (side, 1.3 * side, 1.0))
        m.aerodynamics("air", [blade], wind=wind, inflow=inflow, axis="z")
        return mb.modes(m, at=mb.equilibrium(m)).eigenvalue

    exact = eigenvalues(0.0)
    assert np.all(np.isfinite(exact)) and exact.real[0] < -0.1
    assert exact == pytest.approx(eigenvalues(1e-7), rel=1e-6)


@pytest.mark.some(2)
@pytest.mark.parametrize("method", ["explicit", "radau", "generalized-alpha", "bdf", "bdf-bfgs", "ali3p"])
def test_all_schemes_agree(method):
    m = vane(sections=3)
    exact = motion(m, t=0.1, method="explicit", rtol=1e-10)
    traj = motion(m, t=0.1, method=method, rtol=1e-6)
    assert np.max(np.abs(traj.q - exact.q)) < 2e-4 * np.max(np.abs(exact.q - exact.q[0]))


@pytest.mark.parametrize("wind", [4.0, 9.0, 31.0])
def test_a_rigid_rotor_is_that_of_blade_elements_and_momentum(wind):
    """Sections by sections: the induced velocities of `mbrs.aero.momentum`, which are solved in NumPy."""
    from mbrs.aero.momentum import inflow

    m, blade = rotor(wind=wind, sections=9)
    traj = mb.simulate(m, t=np.array([0.0, 0.3]), rtol=1e-8)
    loads = traj.aero("blade2")
    one = mb.aero.rotor(blade, 3, hub_radius=1.5, tip_radius=18.0)
    r = loads.place
    flow = inflow(one.annuli(r), np.full(len(r), wind), 2.1 * r)
    # the wind is taken at three quarters of the chord, which turns with the blade a little ahead of its line
    assert loads.angle_of_attack[-1] == pytest.approx(flow.angle_of_attack, abs=0.02)
    curve = mb.aero.performance(one, tip_speed_ratio=[2.1 * 18.0 / wind])
    m, _ = rotor(wind=wind, sections=48)
    traj = mb.simulate(m, t=np.array([0.0, 0.3]), rtol=1e-8)
    assert traj.power[-1] == pytest.approx(float(curve.power(wind)[0]), rel=0.02)


def test_without_air_nothing_is_left_of_it():
    m = vane()
    without = motion(m, without=("aerodynamics",))
    m2 = vane(speed=0.0)
    assert mb.effects(m)["aerodynamics"].on and not mb.effects(mb.Model("empty"))["aerodynamics"].on
    assert np.any(without.q != motion(m).q) and np.any(without.q != motion(m2).q)
    with pytest.raises(mb.ModelError, match="without air"):
        without.aero("arm")


def test_angles_that_no_polar_holds_are_named():
    a = np.radians([-12.0, 0.0, 4.0])
    short = mb.aero.polar(a, 2 * np.pi * a, 0.01 + a**2, name="short")
    other = mb.Model("other")
    body = other.body("wing", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    other.revolute("hinge", other.ground, body, at=(0, 0, 0), axis="x", k=1e4)
    blade = mb.aero.blade([1.0, 2.0], 0.3, 0.0, short, body="wing", sections=3)
    other.aerodynamics("air", [blade], wind=mb.aero.wind(5.0, "z"))
    with pytest.raises(
        mb.ModelError, match=r"'short' covers -12 to 4 degrees, but at t = 0 s .* section 1 of 3 of 'wing', at 1"
    ):
        mb.simulate(other, t=0.1)


def test_an_effect_study_leaves_out_flexibility_too():
    """Nodes that only the flexible motion follows are not compared."""
    m = mb.examples.wind_rotor(modes=2)
    blades = mb.examples.wind_rotor_blades(sections=4)
    m.aerodynamics("air", blades, wind=mb.aero.wind(8.0), inflow="bem")
    study = mb.effect_study(mb.simulate, m, t=0.05, rtol=1e-3)
    change = {run.effect: run.change for run in study.runs}
    assert 1e-6 < change["flexibility"] < 1.0 and 1e-6 < change["aerodynamics"] < 1.0 and "induced velocity" in change
