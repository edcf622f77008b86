"""Drives, couplers and loads that vary in time: motions, linear analyses that hold them, motion against closed forms."""

from __future__ import annotations

import pickle

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import AssemblyError, ConvergenceError, MbrsError, ModelError, NameNotFoundError
from mbrs.model.tables import tables
from mbrs.reference.reader import read_motions
from mbrs.system.compiled import compiled

ROD = (1e-3, 1 / 12, 1 / 12)


def crank_angle(t):
    """A function that can be imported by name."""
    return 0.3 * np.sin(4 * t), 1.2 * np.cos(4 * t), -4.8 * np.sin(4 * t)


def crank_value(t):
    return 0.3 * np.sin(4 * t)


def wind(t):
    return np.array([2.0 * t, -1.0, 0.5 * t * t])


def pendulum(motion=None, k=None):
    """A uniform rod of 1 kg and 1 m on a hinge about z."""
    m = mb.Model("pendulum", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=1.0, inertia=ROD, at=(0.5, 0, 0))
    m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="z", k=k)
    if motion is not None:
        m.drive("motor", "hinge", motion)
    return m


def four_bar(motion=None, k=None):
    """Crank .3 m, coupler 1 m, rocker .7 m, base 1 m; spatial hinges, three of its constraints redundant."""
    m = mb.Model("driven four-bar", gravity=(0, -9.81, 0))
    a, c = 0.3, 0.7
    p, q = np.array([0, a, 0.0]), circle_meet(np.array([0, a]), 1.0, np.array([1.0, 0]), c)
    q = np.array([*q, 0.0])

    def rod(name, start, end):
        d = end - start
        turn = mb.rotation("z", np.arctan2(d[1], d[0]))
        length = np.linalg.norm(d)
        inertia = (1e-3, length**2 / 12, length**2 / 12)
        return m.body(name, mass=1.0, inertia=inertia, at=0.5 * (start + end), orientation=turn)

    crank, coupler = rod("crank", np.zeros(3), p), rod("coupler", p, q)
    rocker = rod("rocker", q, np.array([1.0, 0, 0]))
    m.revolute("A", m.ground, crank, at=(0, 0, 0), axis="z", k=k)
    m.revolute("B", crank, coupler, at=p, axis="z")
    m.revolute("C", coupler, rocker, at=q, axis="z")
    m.revolute("D", rocker, m.ground, at=(1, 0, 0), axis="z")
    m.marker("Q", coupler, at=q)
    if motion is not None:
        m.drive("motor", "A", motion)
    return m


def circle_meet(p, r, q, s):
    """The upper of the two points at r from p and s from q."""
    d = q - p
    along = (r * r - s * s + d @ d) / (2 * d @ d)
    foot, normal = p + along * d, np.array([-d[1], d[0]])
    return foot + normal * np.sqrt(r * r / (d @ d) - along * along)


# --- motions -----


@pytest.mark.parametrize(
    "motion, value",
    [
        (mb.Ramp(0.4, 0.1), lambda t: 0.1 + 0.4 * t),
        (mb.Sine(0.3, 4.0, phase=0.2, offset=-0.1), lambda t: -0.1 + 0.3 * np.sin(4 * t + 0.2)),
        (mb.Sine(0.3, frequency=0.5), lambda t: 0.3 * np.sin(np.pi * t)),
        (mb.Polynomial([0.1, 0.2, -0.3, 0.4]), lambda t: 0.1 + 0.2 * t - 0.3 * t**2 + 0.4 * t**3),
        (crank_angle, crank_value),
        (crank_value, crank_value),
    ],
)
def test_a_driven_hinge_follows_its_motion(motion, value):
    """Angle, rate and the torque J phi'' + m g l cos(phi) of the driven rod, J = 1/12 + 1/4."""
    traj = mb.simulate(pendulum(motion), t=np.linspace(0, 1.5, 7), rtol=1e-9)
    phi, h = value(traj.t), 1e-4
    second = (value(traj.t + h) - 2 * phi + value(traj.t - h)) / h**2
    torque = second / 3 + 0.5 * 9.81 * np.cos(phi)
    print("angle", np.abs(traj.joint("hinge") - phi).max(), "torque", np.abs(traj.drive_force("motor") - torque).max())
    assert np.abs(traj.joint("hinge") - phi).max() < 1e-12
    assert np.abs(traj.drive_force("motor") - torque).max() < 1e-6
    assert np.abs(traj.reaction("motor")[:, 5] - torque).max() < 1e-6
    # the hinge itself carries no torque about its axis
    assert np.abs(traj.reaction("hinge")[:, 5]).max() < 1e-12


def test_a_spline_through_points_of_a_sine():
    """Natural spline of 41 points against scipy's, and many turns of a steady rate."""
    from scipy.interpolate import CubicSpline

    t = np.linspace(0, 2, 41)
    v = np.sin(2 * t) ** 2
    spline = CubicSpline(t, v, bc_type="natural")
    traj = mb.simulate(pendulum(mb.Table(t, v)), t=[0.333, 1.21, 1.9], rtol=1e-8)
    assert np.abs(traj.joint("hinge") - spline(traj.t)).max() < 1e-12
    # the noise of the points over their distance in time
    assert np.abs(traj.rate[:, 0] - spline(traj.t, 1)).max() < 1e-11 + 100 * jitter.level()
    turns = mb.simulate(pendulum(mb.Ramp(30.0)), t=[1.0, 10.0], rtol=1e-6)
    assert np.abs(turns.joint("hinge") - 30.0 * turns.t).max() < 1e-9


@pytest.mark.exact  # noise moves the kink to the other side of the instant asked for
def test_a_kink_is_met_exactly():
    """A ramp that starts late: the angle stays zero, then grows; the rate jumps, at the kink itself it is the one that follows."""
    traj = mb.simulate(pendulum(mb.Ramp(2.0, start=0.5)), t=[0.25, 0.5, 0.75], rtol=1e-8)
    assert np.allclose(traj.joint("hinge"), [0, 0, 0.5], atol=1e-12)
    assert np.allclose(traj.rate[:, 0], [0, 2, 2], atol=1e-12)
    assert traj.residual.max() < 1e-12


@pytest.mark.parametrize("t", [0.0, 0.31, 1.0, 1.9, 2.5])
def test_motions_of_core_and_reference(t):
    """Value, rate and acceleration of every kind, read off the rows of driven sliders."""
    motions = [
        mb.Ramp(0.4, 0.1, 0.3), mb.Sine(0.3, 4.0, phase=0.2, offset=-0.1), mb.Sine(0.3, frequency=0.7), crank_angle,
        mb.Polynomial([0.1, 0.2, -0.3, 0.4]), mb.Table([0, 0.5, 1.1, 2], [0.3, 0.9, -0.2, 0.5]),
        mb.Table([0, 0.5, 1.1, 2], [0.3, 0.9, -0.2, 0.5], kind="linear"), mb.Table([0, 2], [1, 3]),
    ]  # fmt: skip
    m = mb.Model("sliders")
    for i, motion in enumerate(motions):
        b = m.body(f"b{i}", mass=1.0, inertia=(1, 1, 1), at=(i, 0, 0))
        m.prismatic(f"s{i}", m.ground, b, at=(i, 0, 0), axis="z")
        m.drive(f"d{i}", f"s{i}", motion)
    core = compiled(m)
    made = core.rows(np.zeros(len(motions)), np.zeros(len(motions)), t, [])
    known = np.array([f(t) for f in read_motions(tables(m), tables(m)["x"])])
    for i, name in enumerate(("phi", "rates", "bias")):
        assert np.abs(made[name] + known[:, i]).max() < 1e-13, name


# --- closed forms of motion -----


def test_two_body_swing():
    """docs/theory.md (23.11): A turns at 60 deg/s, B swings; theta_B of the planar equation (assumed uniform rods of 2 m)."""
    mass, length = 336.14, 2.0
    inertia = mass * length**2 / 12
    m = mb.Model("swing", gravity=(0, -9.81, 0))
    a = m.body("A", mass=mass, inertia=(1.0, inertia, inertia), at=(1, 0, 0))
    b = m.body("B", mass=mass, inertia=(1.0, inertia, inertia), at=(3, 0, 0))
    m.revolute("m", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("n", a, b, at=(2, 0, 0), axis="z")
    m.drive("motor", "m", mb.Ramp(np.pi / 3))
    # theta_B' = 0 at the start: B translates with n, and turns back against A
    m.set(
        {"A.velocity": (0, np.pi / 3, 0), "A.angular_velocity": (0, 0, np.pi / 3), "B.velocity": (0, 2 * np.pi / 3, 0)}
    )
    traj = mb.simulate(m, t=[0.5, 1, 2, 3, 5], rtol=1e-11)
    theta = traj.joint("m") + traj.joint("n")
    known = np.array([-0.835430375, -2.363025261, -2.081860121, -0.818461015, -0.393332826])
    print("swing", np.abs(theta - known).max())
    assert np.abs(theta - known).max() < 2e-8


def test_driven_four_bar_against_its_geometry():
    """The coupler point of a crank that turns at 3 rad/s: intersection of two circles; redundant constraints throughout."""
    m = four_bar(mb.Ramp(3.0))
    traj = mb.simulate(m, t=np.linspace(0.1, 4.0, 14), rtol=1e-8)
    angle = np.pi / 2 + 3.0 * traj.t
    known = [circle_meet(0.3 * np.array([np.cos(w), np.sin(w)]), 1.0, np.array([1.0, 0.0]), 0.7) for w in angle]
    worst = np.abs(traj.point("Q")[:, :2] - known).max()
    print("four-bar", worst)
    assert worst < 1e-10
    assert np.abs(traj.velocity("crank")[:, 0] + 0.45 * np.sin(angle)).max() < 1e-10


def test_power_of_a_drive_is_the_change_of_energy():
    traj = mb.simulate(four_bar(mb.Sine(0.6, 4.0)), t=np.linspace(0, 1, 401), rtol=1e-10)
    power = traj.drive_force("motor") * 2.4 * np.cos(4 * traj.t)
    h = traj.t[1] - traj.t[0]
    work = np.cumsum(np.r_[0, (power[1:] + power[:-1]) / 2 * h])
    change = np.asarray(traj.energy) - traj.energy.total[0]
    print("work", np.abs(work - change).max(), np.abs(change).max())
    assert np.abs(work - change).max() < 2e-4 * np.abs(change).max()


def test_a_gear_pair_under_torque():
    """J1 phi1" = T - r f, J2 phi2" = f with phi2 = r phi1: phi1" = T / (J1 + r^2 J2); through several turns."""
    m = mb.Model("gears")
    a = m.body("pinion", mass=1.0, inertia=(0.1, 0.1, 0.02), at=(0, 0, 0))
    b = m.body("wheel", mass=1.0, inertia=(0.5, 0.5, 0.3), at=(0.3, 0, 0))
    m.revolute("first", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("second", m.ground, b, at=(0.3, 0, 0), axis="z")
    ratio = -np.sqrt(2) / 4  # no ratio of whole numbers of teeth, so that turns must be counted
    m.coupler("mesh", "first", "second", ratio)
    m.torque("motor", a, value=(0, 0, 1.0))
    alpha = 1.0 / (0.02 + ratio**2 * 0.3)
    traj = mb.simulate(m, t=[1.0, 3.0], rtol=1e-9)
    assert np.abs(traj.joint("first") - 0.5 * alpha * traj.t**2).max() < 1e-7
    assert np.abs(traj.joint("second") - ratio * traj.joint("first")).max() < 1e-9
    assert traj.joint("first")[-1] > 20 * np.pi
    assert np.allclose(traj.drive_force("mesh"), 0.3 * ratio * alpha, rtol=1e-8)


def test_rack_and_screw():
    """A rack falls and turns its pinion: a = m g / (m + J/r^2). A screw: both coordinates of one cylindrical joint."""
    m = mb.Model("rack", gravity=(0, -9.81, 0))
    p = m.body("pinion", mass=1.0, inertia=(0.1, 0.1, 0.02), at=(0, 0, 0))
    r = m.body("bar", mass=2.0, inertia=(0.1, 0.1, 0.1), at=(0.1, 0, 0))
    m.revolute("turn", m.ground, p, at=(0, 0, 0), axis="z")
    m.prismatic("slide", m.ground, r, at=(0.1, 0, 0), axis="y")
    m.coupler("mesh", "turn", "slide", 0.1)
    traj = mb.simulate(m, t=[0.5, 2.0], rtol=1e-9)
    a = -2 * 9.81 / (2 + 0.02 / 0.01)
    assert np.abs(traj.joint("slide") - 0.5 * a * traj.t**2).max() < 1e-8
    assert np.abs(traj.joint("turn") - 5 * a * traj.t**2).max() < 1e-7
    m = mb.Model("screw", gravity=(0, 0, -9.81))
    nut = m.body("nut", mass=0.5, inertia=(0.1, 0.1, 0.01), at=(0, 0, 0))
    m.cylindrical("thread", m.ground, nut, at=(0, 0, 0), axis="z")
    lead = 0.02 / (2 * np.pi)
    m.coupler("lead", "thread", "thread", lead, first_coordinate="rz", second_coordinate="z")
    traj = mb.simulate(m, t=[1.0], rtol=1e-9)
    a = -0.5 * 9.81 / (0.5 + 0.01 / lead**2)
    assert np.abs(traj.joint("thread")[0, 0] - 0.5 * a) < 1e-10


def test_a_coupler_on_a_joint_that_closes_a_loop():
    """The hinge D of a four-bar drives a flywheel: energy stays, the wheel turns with D."""
    m = four_bar()
    w = m.body("wheel", mass=1.0, inertia=(0.5, 0.5, 0.3), at=(2, 0, 0))
    m.revolute("axle", m.ground, w, at=(2, 0, 0), axis="z")
    assert mb.System(m).loops[0].joint in ("C", "D")
    m.coupler("belt", mb.System(m).loops[0].joint, "axle", 2.0)
    assert mb.System(m).dof == 1
    traj = mb.simulate(m, t=np.linspace(0, 1, 11), rtol=1e-9)
    closing = traj.joint(mb.System(m).loops[0].joint)
    assert np.abs(traj.joint("axle") - 2 * closing).max() < 1e-9 and np.abs(closing).max() > 0.1
    assert np.ptp(np.asarray(traj.energy)) < 1e-7


@pytest.mark.parametrize(
    "value", [wind, (mb.Ramp(2.0), -1.0, mb.Polynomial([0, 0, 0.5])), (lambda t: 2 * t, -1, mb.Table([0, 9], [0, 40]))]
)
def test_a_force_that_varies(value):
    """x" = 2 t, y" = -1 of a free body of 1 kg."""
    m = mb.Model("blown")
    b = m.body("leaf", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.force("wind", b, value=value)
    traj = mb.simulate(m, t=[1.0, 2.0], rtol=1e-10)
    assert np.abs(traj.position("leaf")[:, 0] - traj.t**3 / 3).max() < 1e-9
    assert np.abs(traj.position("leaf")[:, 1] + traj.t**2 / 2).max() < 1e-9
    at_zero = mb.linearize(m).residual
    assert np.allclose(np.abs(at_zero[:2]), [0, 1])


def test_a_follower_torque_that_varies():
    """A torque about the body's own axis, which turns with it."""
    m = mb.Model("spun")
    b = m.body("top", mass=1.0, inertia=(0.1, 0.1, 0.2), at=(0, 0, 0), orientation=mb.rotation("x", 0.7))
    axis = np.array([0, -np.sin(0.7), np.cos(0.7)])
    m.torque("spin", b, value=tuple(mb.Sine(float(a), 3.0) for a in axis), frame="body")
    traj = mb.simulate(m, t=[0.4, 1.0], rtol=1e-10)
    known = (1 - np.cos(3 * traj.t)) / 3 / 0.2
    assert np.abs(traj.angular_velocity("top") - known[:, None] * axis).max() < 1e-9


# --- linear analyses hold drives -----


def test_linear_analyses_hold_a_drive_at_its_first_value():
    held = four_bar(mb.Sine(0.4, 7.0, phase=0.3), k=30.0)
    assert mb.System(held).dof == 0 and mb.System(four_bar()).dof == 1
    eq = mb.equilibrium(held)
    free = mb.equilibrium(held, without=("drives",))
    assert not np.allclose(eq.position("crank"), free.position("crank"))
    assert np.allclose(free.position("crank"), mb.equilibrium(four_bar(k=30.0)).position("crank"), atol=1e-9)
    angle = np.pi / 2 + 0.4 * np.sin(0.3)
    assert np.allclose(eq.position("crank"), [0.15 * np.cos(angle), 0.15 * np.sin(angle), 0], atol=1e-12)
    assert abs(eq.reactions["motor"][5]) > 0.1
    assert mb.effects(held)["drives"].on and not mb.effects(four_bar())["drives"].on


def test_a_held_drive_is_a_fixed_joint_to_vibration():
    """A slider on springs whose carriage is driven: modes and transfer function as with a fixed carriage."""

    def model(driven):
        m = mb.Model("carriage")
        a = m.body("carriage", mass=3.0, inertia=(1, 1, 1), at=(0, 0, 0))
        b = m.body("mass", mass=2.0, inertia=(1, 1, 1), at=(1, 0, 0))
        if driven:
            m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x")
            m.drive("shaker", "rail", mb.Sine(0.0, 5.0))
        else:
            m.fixed("rail", m.ground, a, at=(0, 0, 0))
        m.prismatic("slide", a, b, at=(1, 0, 0), axis="x", k=50.0, c=0.4)
        return m, b

    (m, b), (n, c) = model(True), model(False)
    assert np.allclose(mb.modes(m).eigenvalue, mb.modes(n).eigenvalue, rtol=1e-12)
    h, g = (mb.frf(x, inputs=y.force("x"), outputs=y.motion("x"), omega=[1.0, 5.0, 9.0]) for x, y in ((m, b), (n, c)))
    assert np.allclose(h.value, g.value, rtol=1e-12)
    off = mb.modes(m, without=("drives",))
    assert len(off.eigenvalue) == 2 and off.frequency[0] < 1e-6


def test_velocities_of_a_drive_enter_a_motion_but_not_a_linearisation():
    m = pendulum(mb.Ramp(3.0))
    assert not mb.linearize(m).state.moving
    assert mb.simulate(m, t=[0.1]).rate[0, 0] == pytest.approx(3.0)


def bent_shaft(drive):
    """A rotor with its mass off the axis on a soft bearing; the shaft turns at 20 rad/s, driven or not."""
    m = mb.Model("bent shaft")
    h = m.body("housing", mass=2.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
    r = m.body("rotor", mass=1.0, inertia=(0.02, 0.02, 0.03), at=(0, 0, 0))
    d = m.body("arm", mass=0.3, inertia=(1e-3, 1e-3, 1e-3), at=(0.2, 0, 0))
    other = m.body("counterweight", mass=0.3, inertia=(1e-3, 1e-3, 1e-3), at=(-0.2, 0, 0))
    m.bushing("bearing", m.ground, h, at=(0, 0, 0), k=(5e3, 5e3, 5e3, 80, 80, 80), c=(5, 5, 5, 0.1, 0.1, 0.1))
    m.revolute("shaft", h, r, at=(0, 0, 0), axis="z", c=0.01)
    m.prismatic("slot", r, d, at=(0.2, 0, 0), axis="x", k=2e3, c=1.0)
    m.prismatic("other slot", r, other, at=(-0.2, 0, 0), axis="x", k=2e3, c=1.0)
    if drive:
        m.drive("motor", "shaft", mb.Ramp(20.0))
    return m


def test_steady_motion_of_a_driven_shaft():
    """As without the drive at the same speed; the driven coordinate alone is gone, and the drive gives the torque."""
    free = mb.steady_motion(bent_shaft(False), {"shaft": 20.0})
    held = mb.steady_motion(bent_shaft(True))
    assert free.frame == held.frame == "rotating"
    assert held.speed == {"shaft": pytest.approx(20.0)}
    assert held.torque["shaft"] == pytest.approx(free.torque["shaft"], rel=1e-9)
    assert held.torque["shaft"] == pytest.approx(0.2, rel=1e-9)
    one, two = free.linearization, held.linearization
    assert set(one.coordinates) - set(two.coordinates) == {"shaft"}
    keep = [one.coordinates.index(c) for c in two.coordinates]
    for name in "MCGK":
        a, b = getattr(one, name)[np.ix_(keep, keep)], getattr(two, name)
        assert np.abs(a - b).max() < 1e-9 * np.abs(a).max(), name
    slot = mb.simulate(bent_shaft(True), t=[0.01], at=held, rtol=1e-9)
    assert slot.rate[0, list(slot.snapshot.system.topology()["coordinates"]).index("shaft")] == pytest.approx(20.0)


def test_steady_motion_through_a_gear():
    m = mb.Model("gears")
    for i, name in enumerate(("pinion", "wheel")):
        b = m.body(name, mass=1.0, inertia=(0.1, 0.1, 0.02), at=(i, 0, 0))
        m.revolute(f"axle {name}", m.ground, b, at=(i, 0, 0), axis="z", c=0.1 * (i + 1))
    m.coupler("mesh", "axle pinion", "axle wheel", -0.5)
    m.drive("motor", "axle pinion", mb.Ramp(8.0))
    found = mb.steady_motion(m)
    assert found.speed == {"axle pinion": pytest.approx(8.0), "axle wheel": pytest.approx(-4.0)}
    assert found.torque["axle pinion"] == pytest.approx(0.8 + 0.5 * 0.8)


# --- models with drives as models -----


def test_saved_and_pickled(tmp_path):
    m = four_bar(crank_angle)
    m.parameter("u", 2.0)
    m.force("wind", "rocker", value=wind)
    m.force("gust", "rocker", value=(mb.Sine(m["u"], frequency=3.0), crank_value, 2.0 * m["u"]))
    m.coupler("belt", "C", "D", 0.5 * m["u"], offset=0.01)
    for again in (mb.Model.load(m.save(tmp_path / "m.toml"), functions=True), pickle.loads(pickle.dumps(m)), m.copy()):
        one, two = tables(m), tables(again)
        assert one.keys() == two.keys()
        for key in one.keys() - {"functions"}:
            assert np.array_equal(one[key], two[key]), key
        assert [f.function for f in one["functions"]] == [f.function for f in two["functions"]]
    m = pendulum(lambda t: 0.1 * t)
    m.copy()
    for save in (lambda: m.save(tmp_path / "n.toml"), lambda: pickle.dumps(m)):
        with pytest.raises(ModelError, match=r"motor.*cannot be saved.*top level"):
            save()


def test_addresses_of_motions():
    m = pendulum(mb.Sine(0.3, 4.0))
    m.force("f", "rod", value=(0, mb.Table([0, 1, 2], [1, 2, 3]), 0))
    m.set({"motor.amplitude": 0.5, "f.y_value[1]": 5.0})
    assert m.value("motor.amplitude") == 0.5 and m.value("f.y_value").tolist() == [1, 5, 3]
    traj = mb.simulate(m, t=[0.3])
    assert traj.joint("hinge")[0] == pytest.approx(0.5 * np.sin(1.2), abs=1e-12)
    with pytest.raises(ModelError, match="must increase"):
        m.set({"f.y_t": [0, 2, 1]})
    assert m.value("f.y_t").tolist() == [0, 1, 2]


# --- what must not pass -----

BAD = {
    "unknown joint": (lambda m: m.drive("d", "hinje", mb.Ramp(1)), NameNotFoundError, "hinge"),
    "a body": (lambda m: m.drive("d", "rod", mb.Ramp(1)), ModelError, "must be a joint, but 'rod' is a body"),
    "a fixed joint": (lambda m: m.drive("d", "weld", mb.Ramp(1)), ModelError, "no free coordinate"),
    "a coordinate that is fixed": (lambda m: m.drive("d", "hinge", 1.0, "x"), ModelError, "one of rz"),
    "no coordinate": (lambda m: m.drive("d", "ball", 1.0), ModelError, "several, name one of rx, ry, rz"),
    "no motion": (lambda m: m.drive("d", "hinge", "fast"), ModelError, "d must be a real number"),
    "two drives": (
        lambda m: (m.drive("d", "hinge", 1.0), m.drive("e", "hinge", 2.0)),
        ModelError,
        "moved by drive 'd' already",
    ),
    "table backwards": (
        lambda m: m.drive("d", "hinge", mb.Table([0, 2, 1], [0, 1, 2])),
        ModelError,
        "d.t must increase",
    ),
    "table in a load": (
        lambda m: m.force("f", "rod", value=(mb.Table([1, 1], [0, 1]), 0, 0)),
        ModelError,
        "f.t must increase",
    ),
    "table too short": (lambda m: m.drive("d", "hinge", mb.Table([0], [0])), ModelError, "at least two"),
    "uneven table": (lambda m: m.drive("d", "hinge", mb.Table([0, 1], [0, 1, 2])), ModelError, "as many times"),
    "a function that returns nan": (lambda m: m.drive("d", "hinge", lambda t: np.nan), ModelError, "d has a.*finite"),
    "a function that raises": (
        lambda m: m.drive("d", "hinge", lambda t: 1 / t),
        ZeroDivisionError,
        "division by zero",
    ),
    "a function of nothing": (lambda m: m.drive("d", "hinge", lambda: 1.0), ModelError, "d has a .*the time alone"),
    "a function of text": (lambda m: m.drive("d", "hinge", lambda t: "no"), ModelError, "returned 'no'"),
    "a vector function for a number": (
        lambda m: m.force("f", "rod", value=(wind, 0, 0)),
        ModelError,
        "return 1 numbers",
    ),
    "a number for a vector": (lambda m: m.force("f", "rod", value=crank_value), ModelError, "return 3 numbers"),
    "a bare motion as force": (lambda m: m.force("f", "rod", value=mb.Ramp(1)), ModelError, "put the motion into one"),
    "nan in a motion": (lambda m: m.drive("d", "hinge", mb.Ramp(np.nan)), ModelError, "d.rate must be a finite"),
    "both frequencies": (lambda m: mb.Sine(1, 2, frequency=3), ModelError, "exactly one"),
    "coupled with itself": (lambda m: m.coupler("c", "hinge", "hinge", 1.0), ModelError, "two different ones"),
    "unknown coupled joint": (lambda m: m.coupler("c", "hinge", "bal", 1.0), NameNotFoundError, "ball"),
    "nan ratio": (lambda m: m.coupler("c", "hinge", "ball", np.nan, second_coordinate="rz"), ModelError, "c.ratio"),
    "a taken name": (lambda m: m.drive("rod", "hinge", 1.0), MbrsError, "already taken"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_leaves_the_model_as_it_was(case):
    m = pendulum()
    m.body("bob", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    m.spherical("ball", "rod", "bob", at=(1, 0, 0))
    m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(5, 0, 0))
    m.fixed("weld", m.ground, "plate", at=(5, 0, 0))
    make, error, text = BAD[case]
    with pytest.raises(error, match=text):
        make(m)
    m.drive("afterwards", "ball", 0.0, "rx")
    assert mb.System(m).dof in (2, 3)


def test_a_drive_that_the_loop_cannot_follow():
    with pytest.raises(AssemblyError, match=r"drive 'motor' asks for a value of joint 'D'|cannot close"):
        m = four_bar()
        m.drive("motor", "D", 3.0)
        mb.System(m)
    m = four_bar(mb.Ramp(1.0))
    m.drive("second", "D", mb.Ramp(1.0))
    with pytest.raises(ConvergenceError) as caught:
        mb.simulate(m, t=1.0, rtol=1e-6)
    assert caught.value.result is None or caught.value.result.t[-1] < 1.0


def test_a_function_that_is_no_number_on_the_way_is_named():
    def motion(t):
        return np.nan if t > 0.5 else (0.2 * t, 0.2, 0.0)

    for m in (pendulum(motion), pendulum()):
        if not m.drives:
            m.torque("load", "rod", value=(0, 0, lambda t: np.sum(motion(t))))
        with pytest.raises(ModelError, match=r"(motor|load).* has a function that returned .*nan.* at t = 0\.[5-9]"):
            mb.simulate(m, t=1.0, rtol=1e-6)


@pytest.mark.parametrize("names", [("alpha", "rz"), ("beta", "rx")])
def test_angles_of_a_universal_joint_have_the_names_of_its_coordinates(names):
    ends = []
    for name in names:
        m = mb.Model("cardan", gravity=(0, -9.81, 0))
        b = m.body("b", mass=1.0, inertia=(0.1, 0.2, 0.3), at=(1, 0, 0))
        m.universal("joint", m.ground, b, at=(0, 0, 0), axis="z", axis2="x")
        assert any(c.endswith(names[0]) for c in mb.System(m).coordinates)
        m.drive("motor", "joint", mb.Ramp(1.0), name)
        ends.append(mb.simulate(m, [0.5]).joint("joint")[-1])
    assert np.array_equal(*ends) and 0.5 in np.round(ends[0], 12)


@pytest.mark.parametrize("method", ["explicit", "radau"])
def test_steps_that_end_at_breaks_leave_no_gap(method):
    """A mass at 3 m/s whose thrust rises from four instants on: what each step lacks of its end is missing from the way."""
    starts, rate = (0.21, 0.37, 0.7, 0.83), 4.0
    m = mb.Model("pushed")
    b = m.body("b", mass=2.0, inertia=(1, 1, 1), velocity=(3.0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x")
    for i, start in enumerate(starts):
        m.force(f"push{i}", b, at=(0, 0, 0), value=(mb.Ramp(rate=rate, start=start), 0, 0))
    exact = 3.0 + sum(rate / 2.0 * (1.0 - start) ** 3 / 6.0 for start in starts)
    found = mb.simulate(m, t=1.0, rtol=1e-12, method=method).position("b")[-1, 0]
    assert found == pytest.approx(exact, rel=2e-12)


@pytest.mark.exact
@pytest.mark.parametrize("method", ["generalized-alpha", "bdf"])
def test_breaks_beside_the_grid_of_fixed_steps_are_on_it(method):
    """Steps of 12 where a thrust begins to rise beside the end of the seventh one, and where a second one does so behind it."""
    h, axis = 0.0137, np.array([0.48, 0.6, 0.64])

    def steps(*off):
        m = mb.Model("pushed")
        b = m.body("b", mass=2.0, inertia=(1, 1, 1), velocity=3.0 * axis)
        m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=axis)
        for i, part in enumerate(off):
            m.force(f"push{i}", b, at=(0, 0, 0), value=tuple(mb.Ramp(rate=4.0 * a, start=(7 + part) * h) for a in axis))
        return len(mb.simulate(m, t=12 * h, step=h, method=method).steps) - 1

    assert [steps(off) for off in (0.0, -1e-7, 1e-10)] == [12, 12, 12]
    # by themselves further away
    assert [steps(off) for off in (-1e-5, 1e-8)] == [13, 13]
    # and beside each other where they are instants of their own
    assert [steps(0.3, 0.3 + off) for off in (1e-14, 3e-12)] == [13, 14]
