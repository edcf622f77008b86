"""Flexible bodies in the core against the reference (particles), closed forms and themselves."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from agreement import reference_state
from flexible_models import MECHANISMS, cantilever, four_bar, pendulum, rod, tumbling
from mbrs.model.tables import modal_part, tables
from mbrs.reference import System, linearize
from mbrs.system.compiled import compiled
from mbrs.system.state import State

SCHEMES = {"generalized-alpha": {}, "radau": {}, "bdf": {}, "explicit": {}}


def random_state(model, rng, size=0.1, moving=True):
    """A state of an open tree off its drawn one, with modal coordinates and rates."""
    core = compiled(model)
    q = core.assemble()["q"].copy()
    modal_part(tables(model), q)[:] = size * rng.standard_normal(modal_part(tables(model), q).shape)
    return q, rng.standard_normal(core.n_tree) if moving else np.zeros(0)


@pytest.mark.some(12)
@pytest.mark.parametrize("without", [(), ("constraint-force-stiffness",), ("preload-stiffness",)], ids=str)
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", ["tumbling", "pendulum", "by the tip", "cantilever"])
def test_the_linearisation_agrees_with_particles(name, moving, without):
    """Shapes of second order included; terms that ``without`` names are those of the same frames."""
    model = MECHANISMS[name](damping=1e-3)
    rng = np.random.default_rng([len(name), moving])
    relative, rate = random_state(model, rng, moving=moving)
    found = compiled(model).linearize(relative, rate, list(without), raw=True)
    system = System(tables(model))
    state = reference_state(model, State(relative, rate), system)
    assert compiled(model).topology()["coordinates"] == system.coordinates
    expected = linearize(system, state, [system.coordinates.index(c) for c in found["coordinates"]], without)
    for key in ("M", "D", "S"):
        a, e = found[key], getattr(expected, key)
        a = np.zeros_like(e) if a is None else a
        assert np.max(np.abs(a - e)) <= 1e-10 * np.max(np.abs(e)), key


@pytest.mark.parametrize("without", [(), ("constraint-force-stiffness",)], ids=str)
def test_a_closed_loop_agrees_with_particles(without):
    model = four_bar()
    core = compiled(model)
    eq = mb.equilibrium(model)
    found = core.linearize(eq.state.q, np.zeros(0), list(without), raw=True)
    system = System(tables(model))
    state = reference_state(model, eq.state, system)
    expected = linearize(system, state, [system.coordinates.index(c) for c in found["coordinates"]], without)
    for key in ("M", "S"):
        assert np.max(np.abs(found[key] - getattr(expected, key))) <= 1e-9 * np.max(np.abs(getattr(expected, key)))
    # bending out of the plane frees none of the redundant ones: hinge axes stay parallel in the drawn state
    assert mb.System(model).n_tree - mb.System(model).rank == len(found["coordinates"])


def test_frequencies_are_those_of_the_body():
    body = rod((2, 3, 4))
    # powers of x are almost dependent: the condition of their matrices is 1e5
    noise = 1e5 * jitter.level()
    assert mb.modes(cantilever(powers=(2, 3, 4))).frequency == pytest.approx(body.frequencies(), rel=1e-10 + noise)
    free = mb.Model("free")
    free.flexible_body("rod", body, orientation=mb.rotation((1, 2, 3), 1.0))
    found = mb.modes(free)
    assert np.count_nonzero(found.frequency == 0.0) == 6
    assert found.frequency[6:] == pytest.approx(body.frequencies(fixed=False)[6:], rel=1e-9 + noise)


def cranked(**options):
    """The pendulum without gravity and loads, which is in balance as it is drawn."""
    m = mb.Model("cranked")
    body = m.flexible_body("rod", rod(**options))
    m.revolute("hinge", m.ground, body.node("frame"), axis="y", k=30.0)
    ball = m.body("ball", mass=0.5, inertia=(0.01, 0.02, 0.015), at=(1.1, 0, 0), com=(0.05, 0.02, -0.03))
    m.universal("cardan", body.node("tip"), ball, axis="z", axis2="y", k=(5.0, 6.0))
    m.bushing("inner", body.node("mid"), ball, at=(0.8, 0, 0), k=(3, 4, 5, 0.1, 0.2, 0.3))
    return m


def test_a_stiff_body_is_the_rigid_one():
    rigid, distance = mb.modes(cranked(), without=("flexibility",)), []
    for stiff in (1e4, 1e5):
        found = mb.modes(cranked(bending=(4.0 * stiff, 9.0 * stiff)))
        lowest = np.sort(found.frequency)[: len(rigid.frequency)]
        distance.append(np.max(np.abs(lowest / np.sort(rigid.frequency) - 1.0)))
    assert distance[1] < 1e-4
    assert 7.0 < distance[0] / distance[1] < 13.0  # compliance is linear in 1/stiffness


def moments(model, traj):
    """Linear and angular momentum about the world origin (n_t, 6) of a single free flexible body, by its integrals."""
    b = model["rod"].modal
    q, speed = traj.modal("rod"), traj.modal_rate("rod")
    S2, P12 = b.KG[:3], b.KG[3:].reshape(3, 3, *b.K.shape).transpose(2, 3, 1, 0)
    out = []
    for i in range(len(traj.t)):
        R = traj.rotation("rod")[i]
        v, w = R.T @ traj.velocity("rod")[i], R.T @ traj.angular_velocity("rod")[i]
        h = b.mass * b.com + b.S @ q[i] + 0.5 * S2 @ q[i] @ q[i]
        N0 = 0.5 * np.trace(b.inertia) * np.eye(3) - b.inertia + b.mass * np.outer(b.com, b.com)
        first = np.einsum("kij,k->ij", b.P1, q[i]) + 0.5 * np.einsum("klij,k,l->ij", P12, q[i], q[i])
        N = N0 + first + first.T + np.einsum("klij,k,l->ij", b.P2, q[i], q[i])
        Q = b.P1 + np.einsum("lkij,l->kij", b.P2, q[i]) + np.einsum("klij,l->kij", P12, q[i])
        turning = np.array([[p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]] for p in Q])
        linear = b.mass * v + np.cross(w, h) + (b.S + np.einsum("ikl,l->ik", S2, q[i])) @ speed[i]
        angular = np.cross(h, v) + (np.trace(N) * np.eye(3) - N) @ w + turning.T @ speed[i]
        linear, angular = R @ linear, R @ angular
        out.append(np.r_[linear, angular + np.cross(traj.position("rod")[i], linear)])
    return np.array(out)


@pytest.mark.parametrize("stiffening", [False, True])
def test_a_tumbling_body_keeps_energy_and_momentum(stiffening):
    model = tumbling(stiffening=stiffening, bending=(0.2, 0.5))
    traj = mb.simulate(model, t=np.linspace(0, 1.0, 21), rtol=1e-9, method="explicit")
    energy, momentum = traj.energy.total, moments(model, traj)
    assert np.ptp(traj.modal("rod"), axis=0).max() > 0.01  # it bends
    assert np.ptp(energy) <= 1e-10 * energy[0]
    assert np.max(np.abs(momentum - momentum[0])) <= 1e-9 * np.max(np.abs(momentum))


def test_rotation_raises_the_flap_frequency():
    """Southwell: omega^2 = omega_0^2 + a Omega^2. For flap of a cantilever at zero hub radius a tends to 1.193 (A. Bokaian,
    J. Sound Vib. 139 (1990); R. D. Blevins, Formulas for Natural Frequency, table 8-18).
    """
    flap = []
    for speed in (0.0, 2.0):
        m = mb.Model("rotor")
        shaft = m.body("hub", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), angular_velocity=(0, 0, speed))
        m.revolute("shaft", m.ground, shaft, at=(0, 0, 0), axis="z")
        blade = m.flexible_body(
            "blade", rod((2, 3, 4, 5), bending=(4.0, 4.0), turning=0.0), angular_velocity=(0, 0, speed)
        )
        m.fixed("root", shaft, blade.node("frame"))
        m.drive("motor", "shaft", mb.Ramp(speed))
        at = mb.steady_motion(m, speed={"shaft": speed}) if speed else mb.equilibrium(m)
        modes = mb.modes(m, at=at)
        z = np.abs(modes.shape[[c.startswith("blade.q") for c in modes.coordinates]])
        moves = z[4:].max(axis=0) > 100 * z[:4].max(axis=0)
        flap.append(np.sort(modes.omega[moves & (modes.omega > 0)])[0])
    southwell = (flap[1] ** 2 - flap[0] ** 2) / 2.0**2
    assert southwell == pytest.approx(1.193, abs=0.01)


def test_schemes_agree():
    model = pendulum(damping=1e-3)
    ends = {}
    for method in ("explicit", "radau", "bdf", "generalized-alpha", "ali3p", "bdf-bfgs"):
        control = {"rtol": 1e-8} if method in ("explicit", "radau", "bdf") else {"step": 1e-3}
        traj = mb.simulate(model, t=np.linspace(0, 0.3, 4), method=method, **control)
        assert traj.status == "finished"
        ends[method] = np.r_[traj.point("P")[-1], traj.modal("rod")[-1]]
    for method, end in ends.items():
        assert np.max(np.abs(end - ends["explicit"])) < (1e-6 if method in ("radau", "bdf") else 2e-4), method


def test_a_loop_moves_and_keeps_its_energy():
    model = four_bar()
    model.set({"A.c[0]": 0.0} if model["A"].shapes.get("c") == (1,) else {"A.c": 0.0})
    ends = []
    for method, control in (("explicit", {"rtol": 1e-9}), ("radau", {"rtol": 1e-8}), ("bdf", {"rtol": 1e-8})):
        traj = mb.simulate(model, t=np.linspace(0, 0.4, 9), method=method, **control)
        energy = traj.energy.total
        assert np.ptp(energy) <= 1e-6 * np.ptp(traj.energy.kinetic), method
        assert np.max(traj.residual[:, :2]) < 1e-9
        ends.append(np.r_[traj.position("crank")[-1], traj.modal("coupler")[-1]])
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_campbell_of_a_blade_follows_southwell():
    m = mb.Model("rotor")
    hub = m.body("hub", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.revolute("shaft", m.ground, hub, at=(0, 0, 0), axis="z")
    blade = m.flexible_body("blade", rod((2, 3, 4, 5), bending=(4.0, 4.0), turning=0.0))
    m.fixed("root", hub, blade.node("frame"))
    diagram = mb.campbell(m, "shaft", speed=np.array([1.0, 2.0, 3.0]))
    lowest = np.array([np.min(f[f > 1e-6]) for f in np.asarray(diagram.frequency).reshape(3, -1)])
    square = (2 * np.pi * lowest) ** 2
    rise = np.diff(square) / np.diff(np.array([1.0, 4.0, 9.0]))
    assert rise == pytest.approx(1.193, abs=0.02)


@pytest.mark.parametrize("root", ["frame", "mid", "tip", None])
def test_given_velocities_whatever_the_root(root):
    model = mb.Model("thrown")
    velocity, omega = np.array([1.0, 2.0, -0.5]), np.array([3.0, -1.0, 2.0])
    turn = mb.rotation((1, 2, 3), 0.7)
    body = model.flexible_body(
        "rod", rod(), at=(0.3, -0.2, 1.0), orientation=turn, velocity=velocity, angular_velocity=omega
    )
    if root is not None:
        model.free("loose", model.ground, body.node(root))
    lin = mb.linearize(model)
    assert lin.poses["velocity"][0] == pytest.approx(velocity, abs=1e-12)
    assert lin.poses["angular_velocity"][0] == pytest.approx(omega, abs=1e-12)
    # one body, one motion, whatever carries it
    traj = mb.simulate(model, t=[0.0, 0.2], rtol=1e-9, method="explicit")
    if root is None:
        assert traj.status == "finished"
        return
    plain = mb.Model("plain")
    plain.flexible_body("rod", rod(), at=(0.3, -0.2, 1.0), orientation=turn, velocity=velocity, angular_velocity=omega)
    other = mb.simulate(plain, t=[0.0, 0.2], rtol=1e-9, method="explicit")
    assert traj.position("rod")[-1] == pytest.approx(other.position("rod")[-1], abs=1e-7)
    assert traj.modal("rod")[-1] == pytest.approx(other.modal("rod")[-1], abs=1e-7)


def test_motion_of_ground_shakes_the_modes():
    model = cantilever()
    body, lin = model["rod"].modal, mb.linearize(cantilever())
    turning = np.array([[p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]] for p in body.P1])
    assert lin.ground_coupling == pytest.approx(np.hstack([body.S.T, turning]), abs=1e-14 + 10 * jitter.level())
    h = mb.frf(model, mb.base_motion("z"), "rod.tip.motion.z", frequency=[1e-3, 0.3], kind="transmissibility")
    assert h.value[0, 0, 0] == pytest.approx(1.0, abs=1e-4)
