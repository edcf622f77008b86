"""Forces and lengths of springs, and rates of joints, along motions: against differences in time, energies of the core, Newton's law."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest

TURN = mb.rotation((0.31, -0.83, 0.46), 0.7)
pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")


def difference(y, h):
    """Derivative by time in the middle of seven equal steps, sixth order."""
    return (45 * (y[4] - y[2]) - 9 * (y[5] - y[1]) + (y[6] - y[0])) / (60 * h)


H = 1e-3


def times(t, h=H):
    return np.concatenate([[0.0], t + h * np.arange(-3, 4)])


def two(seed, kind=None):
    rng = np.random.default_rng(seed)
    m = mb.Model("two", gravity=(0.4, -9.3, 1.7))
    for name in "ab":
        moves = {"velocity": rng.normal(size=3), "angular_velocity": rng.normal(size=3)} if kind is None else {}
        own = {"at": rng.normal(size=3), "orientation": rng.normal(size=4)}
        m.body(name, mass=rng.uniform(0.5, 2.0), inertia=rng.uniform(0.9, 1.1, 3), **own, **moves)
    return m, rng


def sprung(seed):
    m, rng = two(seed)
    m.spring_damper("s", "a", "b", at=rng.normal(size=(2, 3)), k=31.0, c=0.7, preload=2.3)
    m.spring_damper("law", m.ground, "a", at=rng.normal(size=(2, 3)), length=0.7, k=11.0, law=mb.Cubic(3.1))
    m.bushing(
        "bush", "a", "b", at=rng.normal(size=3), orientation=TURN, k=rng.uniform(3, 9, 6), c=rng.uniform(0.1, 0.3, 6)
    )
    m.torsion("t", m.ground, "b", at=(0, 0, 0), axis=rng.normal(size=3), k=5.0, c=0.3, angle=0.2)
    return m


@pytest.mark.parametrize("seed", range(3))
def test_deformations_have_their_rates_and_forces_their_energies(seed):
    m = sprung(seed)
    traj = mb.simulate(m, t=times(0.3), rtol=1e-11, method="explicit")
    for name in ("s", "law", "bush", "t"):
        e, rate = traj.deformation(name)[1:], traj.deformation_rate(name)[1:]
        assert rate[3] == pytest.approx(difference(e, H), rel=1e-7, abs=1e-7)
        assert traj.element_force(name).shape == traj.deformation(name).shape
    e, f = traj.deformation("s"), traj.element_force("s")
    assert f == pytest.approx(2.3 + 31.0 * e + 0.7 * traj.deformation_rate("s"), rel=1e-12)
    assert traj.energy.stored["s"] == pytest.approx(2.3 * e + 15.5 * e**2, rel=1e-9)
    e = traj.deformation("law")
    assert e == pytest.approx(traj.length("law") - 0.7, rel=1e-12)
    assert traj.element_force("law") == pytest.approx(11.0 * e + 3.1 * e**3, rel=1e-12)
    assert traj.energy.stored["law"] == pytest.approx(5.5 * e**2 + 3.1 / 4 * e**4, rel=1e-9)
    k = np.diag([m.value(f"bush.k[{i}]") for i in range(6)])
    e = traj.deformation("bush")
    assert traj.energy.stored["bush"] == pytest.approx(0.5 * np.einsum("ti,ij,tj->t", e, k, e), rel=1e-9)
    assert traj.energy.stored["t"] == pytest.approx(2.5 * traj.deformation("t") ** 2, rel=1e-9)
    assert traj.deformation("s")[0] == pytest.approx(0.0, abs=1e-12) and traj.deformation("t")[0] == pytest.approx(-0.2)


@pytest.mark.parametrize("seed", range(3))
def test_springs_push_as_newton_says(seed):
    """One body on one spring at its centre of mass, and one that is held by a bushing that does not turn."""
    rng = np.random.default_rng(seed)
    m = mb.Model("one", gravity=(0.4, -9.3, 1.7))
    at, foot = rng.normal(size=3), rng.normal(size=3)
    m.body("b", mass=1.3, inertia=(1, 1, 1), at=at, velocity=rng.normal(size=3))
    m.spring_damper("s", m.ground, "b", at=(foot, at), k=21.0, c=0.9, law=mb.CoulombTanh(0.7, 0.3))
    traj = mb.simulate(m, t=times(0.4), rtol=1e-11, method="explicit")
    direction = traj.position("b")[4] - foot
    pull = -traj.element_force("s")[4] * direction / np.linalg.norm(direction)
    assert traj.length("s")[4] == pytest.approx(np.linalg.norm(direction))
    assert 1.3 * (difference(traj.velocity("b")[1:], H) - [0.4, -9.3, 1.7]) == pytest.approx(pull, rel=1e-6, abs=1e-6)


KINDS = ("revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("framed", [False, True])
def test_joints_have_their_rates(kind, framed):
    m, rng = two(7, kind)
    axis = rng.normal(size=3)
    given = {"orientation": rng.normal(size=4)} if framed else {}
    if not framed and kind not in ("spherical", "free"):
        given["axis"] = axis
    if not framed and kind == "universal":
        given["axis2"] = np.cross(axis, rng.normal(size=3))
    m.spherical("ball", m.ground, "a", at=rng.normal(size=3), k=(3.0, 4.0, 5.0))
    getattr(m, kind)("J", "a", "b", at=rng.normal(size=3), **given)
    m.bushing("hold", "a", "b", at=(0, 0, 0), k=(60.0,) * 3 + (5.0,) * 3)
    traj = mb.simulate(m, t=times(0.25), rtol=1e-11, method="explicit")
    q, rate = np.reshape(traj.joint("J"), (8, -1)), np.reshape(traj.joint_rate("J"), (8, -1))
    assert rate[4] == pytest.approx(difference(q[1:], H), rel=1e-6, abs=1e-7) and np.abs(rate[4]).max() > 1e-2
    assert traj.joint_rate("J").shape == traj.joint("J").shape


def test_wheel_loads_of_a_flexible_model():
    """Springs at nodes: the tip of a beam that hangs on a spring."""
    beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=400.0, EI_edge=1600.0, modes=3, attach=["tip"])
    m = mb.Model("wing", gravity=(0, 0, -9.81))
    wing = m.flexible_body("wing", beam, orientation=TURN)
    m.fixed("clamp", m.ground, wing.node("root"))
    tip = wing.node("tip")
    m.spring_damper("s", m.ground, tip, at=(tip.at + [0.1, 0.2, -0.7], tip.at), k=130.0)
    traj = mb.simulate(m, t=[0.0, 0.1, 0.2])
    gap = np.linalg.norm(traj.position("wing.tip") - (tip.at + [0.1, 0.2, -0.7]), axis=1)
    assert traj.length("s") == pytest.approx(gap) and np.ptp(gap) > 1e-4
    noise = 130.0 * 2 * jitter.level() * np.linalg.norm(tip.at + [0.1, 0.2, -0.7])  # of the two ends
    assert traj.element_force("s") == pytest.approx(130.0 * (gap - np.sqrt(0.54)), rel=1e-9, abs=1e-12 + noise)


def test_wrong_names_are_told():
    m = sprung(0)
    m.spring_damper("slides", m.ground, "a", at=((0, 0, 9), (0, 0, 0)), law=mb.Jenkins(30.0, 0.1))
    m.fixed("weld", "b", m.body("c", mass=1, inertia=(1, 1, 1), at=(5, 5, 5)), at=(5, 5, 5))
    traj = mb.simulate(m, t=[0.0, 0.01])
    with pytest.raises(mb.errors.NameNotFoundError, match="did you mean 'bush'"):
        traj.element_force("bus")
    with pytest.raises(mb.errors.ModelError, match="not a spring_damper"):
        traj.length("t")
    with pytest.raises(mb.errors.ModelError, match="no free coordinates"):
        traj.joint_rate("weld")
    assert traj.deformation("slides").shape == (2,)


def test_coarse_outputs_lose_no_turns():
    """A flywheel winds a soft spring up by several turns from output to output: its force is k times the angle, its energy stays."""
    m, axis = mb.Model("winder"), np.array([0.31, -0.83, 0.46])
    b = m.body("wheel", mass=1.3, inertia=(0.21, 0.21, 0.21), angular_velocity=37.0 * axis / np.linalg.norm(axis))
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=axis)
    m.torsion("spring", m.ground, b, at=(0, 0, 0), axis=axis, k=0.017, c=0.0, angle=0.4)
    traj = mb.simulate(m, t=np.linspace(0, 4, 7), rtol=1e-11)
    inertia = 0.21
    omega = np.sqrt(0.017 / inertia)
    angle = 0.4 + -0.4 * np.cos(omega * traj.t) + 37.0 / omega * np.sin(omega * traj.t)
    assert np.diff(angle).max() > 3 * np.pi
    assert traj.deformation("spring") == pytest.approx(angle - 0.4, rel=1e-8, abs=1e-8)
    assert traj.element_force("spring") == pytest.approx(0.017 * (angle - 0.4), rel=1e-8, abs=1e-9)


def test_a_slider_has_the_force_of_its_state():
    """A driven slider: its force is the clipped sum of the increments of its displacement."""
    m = mb.Model("slider")
    b = m.body("cart", mass=2.3, inertia=(1, 1, 1))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=(0.31, -0.83, 0.46))
    m.drive("shaker", "rail", mb.Sine(amplitude=0.13, omega=7.1))
    axis = np.array([0.31, -0.83, 0.46]) / np.linalg.norm([0.31, -0.83, 0.46])
    m.spring_damper("slides", m.ground, b, at=(-2.0 * axis, (0, 0, 0)), law=mb.Jenkins(30.0, 1.1))
    traj = mb.simulate(m, t=np.linspace(0, 2, 2001), rtol=1e-9)
    u, force = traj.deformation("slides"), [0.0]
    force[0] = float(np.clip(30.0 * u[0], -1.1, 1.1))
    for step in np.diff(u):
        force.append(float(np.clip(force[-1] + 30.0 * step, -1.1, 1.1)))
    assert np.abs(force).max() == pytest.approx(1.1)
    # a stick of one output less at each reversal
    assert traj.element_force("slides") == pytest.approx(np.array(force), abs=30.0 * np.abs(np.diff(u)).max())
