"""The needle: one model through every layer, core against reference. All data invented.

A cart glides on the ground (x, y, angle); a knife edge behind its centre forbids its lateral motion there; a spring
with a cubic part holds it; a pendulum hangs from it, and a Jenkins slider acts in the hinge.
"""

from __future__ import annotations

import dataclasses

import jitter
import mbrs as mb
import numpy as np
import pytest
import scipy.linalg
from mbrs import _core
from mbrs.errors import ModelError
from mbrs.model.tables import tables
from mbrs.nonlinear.system import nonlinear_system
from mbrs.reference import System as Reference
from mbrs.reference import hbm_balance
from mbrs.reference import linearize as reference_linearize
from mbrs.reference import modes as reference_modes
from mbrs.reference import motion as rm
from mbrs.reference.assembly import assemble, mobility
from mbrs.reference.kinematics import drawn_state
from mbrs.reference.simulate import begin, simulate
from mbrs.system.compiled import compiled
from oracles.runge_kutta import integrate
from oracles.runge_kutta import start as start_motion

K3, K_SLIDER, SLIP = 4e4, 6.0, 0.4
REAR = 0.2
FAST = (1.0, 1.2)  # m/s and rad/s: enough for the slider to slip


def needle(speed=0.0, spin=0.0, laws=True, slip=SLIP, damping=True):
    """The cart starts at ``speed`` along x and ``spin`` about z, as the knife edge allows; the pendulum moves along."""
    m = mb.Model("needle", gravity=(0, 0, -9.81))
    start = dict(velocity=(speed, REAR * spin, 0), angular_velocity=(0, 0, spin))
    cart = m.body("cart", mass=2.0, inertia=(0.02, 0.05, 0.06), **start)
    arm = (speed, REAR * spin + 0.05 * spin, 0)
    bob = m.body(
        "bob", mass=0.5, inertia=(0.01, 0.01, 0.002), at=(0.05, 0, -0.3), velocity=arm, angular_velocity=(0, 0, spin)
    )
    c = (0.5, 0.5, 0.1) if damping else None
    m.planar("floor", m.ground, cart, at=(0, 0, 0), axis="z", k=(0, 0, 2.0), c=c)
    m.revolute("hinge", cart, bob, at=(0.05, 0, 0), axis="y", law=mb.Jenkins(K_SLIDER, slip) if laws else None)
    m.knife_edge("knife", m.ground, cart, at=(-REAR, 0, 0), axis="y")
    k = m.parameter("k", 300.0)
    ends = ((-0.6, 0.1, 0.02), (-0.1, 0.05, 0.01))
    m.spring_damper(
        "spring", m.ground, cart, at=ends, k=k, c=0.8 if damping else None, law=mb.Cubic(K3) if laws else None
    )
    return m


def both(m, x=None):
    """The reference system and its motion from the core's start."""
    t = tables(m)
    sys = Reference(t) if x is None else Reference(t, x)
    core = compiled(m)
    return sys, core, core.assemble()


def reference_motion(m, h, n, x=None):
    sys, _, drawn = both(m, x)
    rate = drawn["rate"] if len(drawn["rate"]) else np.zeros(sys.ny)
    return sys, integrate(sys, start_motion(sys, assemble(sys, drawn_state(sys)), rate), h, n)


# --- Tables, System, laws -----


def test_tables_and_system():
    t = tables(needle())
    assert list(t["law_type"]) == [0, 9] and list(t["law_n"]) == [1, 2]
    assert [t["x"][i] for i in t["law_x"]] == pytest.approx([K3, K_SLIDER], rel=1e-12)
    system = mb.System(needle())
    assert (system.n_tree, system.dof, system.n_rows) == (4, 3, 1)
    sys = Reference(t)
    # one slider, and the turns of two hinges
    found = mobility(sys)
    assert (sys.ny, found.dof, sys.n_memory) == (4, 3, 3)
    assert tuple(np.array(sys.coordinates)[found.partition.independent]) == system.coordinates


def test_a_moving_model_still_counts_its_freedoms():
    assert mb.System(needle(0.3, 0.5)).dof == 3


# --- linearisation and modes -----


def test_linearisation_equals_the_reference():
    m = needle()
    lin = mb.linearize(m)
    sys = Reference(tables(m))
    independent = [sys.coordinates.index(c) for c in lin.coordinates]
    reference = reference_linearize(sys, drawn_state(sys), independent)
    for name in "MCK":
        ours, theirs = getattr(lin, name), getattr(reference, name)
        assert np.max(np.abs(ours - theirs)) <= 1e-10 * np.max(np.abs(theirs)), name
    assert np.max(np.abs(reference.N)) < 1e-12 and lin.error < 1e-12
    hinge = lin.coordinates.index("hinge")
    assert lin.K[hinge, hinge] == pytest.approx(K_SLIDER + 0.5 * 9.81 * 0.3, rel=1e-12)  # the slider sticks


def test_modes_are_those_left_by_the_velocity_row():
    """Against the reference, and against the pencil of all four coordinates with the row and its multiplier: the same
    roots and one more at zero, the displacement that a velocity row leaves constant."""
    m = needle()
    result = mb.modes(m)
    assert result.n == 3
    sys = Reference(tables(m))
    there = reference_linearize(sys, drawn_state(sys))
    ours, theirs = by_height(result.roots), by_height(reference_modes(there.M, there.C, K=there.K).roots)
    assert np.max(np.abs(ours - theirs)) < 1e-10 * np.max(np.abs(theirs))
    roots = _pencil_roots(m)
    order = np.argsort(np.abs(roots))
    assert abs(roots[order[0]]) < 1e-9 and len(roots) == 7
    assert np.max(np.abs(by_height(roots[order[1:]]) - ours)) < 1e-8 * np.max(np.abs(ours))


def by_height(s):
    """Roots of vibration, all different, in the order of their imaginary parts."""
    return s[np.argsort(s.imag)]


def _pencil_roots(m):
    """Finite eigenvalues of M y" + D y' + S y + J^T mu = 0, J y' = 0 in all tree coordinates."""
    without_knife = needle_without_knife()
    free = mb.linearize(without_knife)
    sys = Reference(tables(m))
    J = rm.tree_map(sys, drawn_state(sys))[1].value.T
    n, r = free.n, len(J)
    A, E = np.zeros((2 * n + r,) * 2), np.zeros((2 * n + r,) * 2)
    A[:n, n : 2 * n], E[: 2 * n, : 2 * n] = np.eye(n), scipy.linalg.block_diag(np.eye(n), free.M)
    A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n], A[n : 2 * n, 2 * n :] = -free.K, -free.C, -J.T
    A[2 * n :, n : 2 * n] = J
    alpha, beta = scipy.linalg.eig(A, E, right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-7 * np.abs(alpha)
    return alpha[finite] / beta[finite]


def needle_without_knife():
    m = mb.Model("free needle", gravity=(0, 0, -9.81))
    cart = m.body("cart", mass=2.0, inertia=(0.02, 0.05, 0.06))
    bob = m.body("bob", mass=0.5, inertia=(0.01, 0.01, 0.002), at=(0.05, 0, -0.3))
    m.planar("floor", m.ground, cart, at=(0, 0, 0), axis="z", k=(0, 0, 2.0), c=(0.5, 0.5, 0.1))
    m.revolute("hinge", cart, bob, at=(0.05, 0, 0), axis="y", law=mb.Jenkins(K_SLIDER, SLIP))
    ends = ((-0.6, 0.1, 0.02), (-0.1, 0.05, 0.01))
    m.spring_damper("spring", m.ground, cart, at=ends, k=300.0, c=0.8, law=mb.Cubic(K3))
    return m


def test_a_loaded_velocity_row_has_geometric_stiffness():
    """A lateral push at the knife is carried by it; the push keeps its direction, the knife turns with the cart."""
    F = 7.0
    m = mb.Model("pushed", gravity=None)
    cart = m.body("cart", mass=2.0, inertia=(0.02, 0.05, 0.06))
    m.planar("floor", m.ground, cart, at=(0, 0, 0), axis="z", k=(50.0, 0, 2.0))
    m.knife_edge("knife", m.ground, cart, at=(-REAR, 0, 0), axis="y")
    m.force("push", cart, at=(-REAR, 0, 0), value=(0, F, 0))
    lin = mb.linearize(m)
    sys = Reference(tables(m))
    part = [sys.coordinates.index(c) for c in lin.coordinates]
    reference = reference_linearize(sys, drawn_state(sys), part)
    assert np.max(np.abs(lin.K - reference.K)) < 1e-12 and np.max(np.abs(reference.S - lin.K)) > 1.0
    assert lin.multipliers == pytest.approx([F]) and lin.error < 1e-12


def test_a_moving_state_with_a_velocity_row_is_refused():
    m = needle(0.3, 0.5)
    with pytest.raises(ModelError, match="'knife' moves on a curve or speeds up"):
        mb.linearize(m)
    sys = Reference(tables(m))
    with pytest.raises(ModelError, match="at rest"):
        reference_linearize(sys, drawn_state(sys))


# --- harmonic balance -----


def test_elements_of_a_model_equal_the_reference():
    m = needle()
    system = nonlinear_system(m)
    sys = Reference(tables(m))
    part = [sys.coordinates.index(c) for c in system.coordinates]
    reference = reference_linearize(sys, drawn_state(sys), part, without=("law-slopes",))
    for name in "MCK":
        assert np.max(np.abs(getattr(system, name) - getattr(reference, name))) < 1e-10 * np.max(np.abs(reference.K))
    rows = rm.law_rows(sys, reference)
    assert [law.code for law in system.elements] == [law.code for law, _, _ in rows] == [0, 9]
    for ours, (law, u, w) in zip(system.elements, rows, strict=True):
        assert np.max(np.abs(ours.w - w)) < 1e-12 and abs(u) < 1e-14
        assert ours.numbers() == list(law.p)


def test_harmonic_balance_equals_the_reference():
    m = needle()
    port = m["cart"].force("x")
    one = mb.harmonic_balance(m, force=port, amplitude=6.0, frequency=1.9, harmonics=7)
    assert one.status == "converged"
    slid = np.abs(one.displacement(np.linspace(0, one.period, 200))[list(one.system.coordinates).index("hinge")]).max()
    assert slid * K_SLIDER > 1.5 * SLIP  # the slider slips, so this is not a linear solution
    sys = Reference(tables(m))
    part = [sys.coordinates.index(c) for c in one.system.coordinates]
    lin = reference_linearize(sys, drawn_state(sys), part, without=("law-slopes",))
    kinds = {0: mb.Cubic, 9: mb.Jenkins}
    elements = [kinds[law.code](*law.p, w=w) for law, _, w in rm.law_rows(sys, lin)]
    reference = mb.MechanicalSystem(lin.M, lin.C, lin.K, elements=elements)
    force = 6.0 * lin.T[0]  # the force's row of T: translation x of the first body's origin
    X = hbm_balance.harmonic_balance(reference, force, one.omega, range(1, 8), one.n_samples, one.X * 1.001)
    assert np.max(np.abs(one.X - X)) < 1e-10 * np.max(np.abs(X))


def test_a_displaced_law_is_counted_from_the_state():
    """A mass on a spring k u + k3 u^3 under its weight: the elements equal the polynomial shifted by hand."""
    m = mb.Model("hung", gravity=(0, 0, -9.81))
    b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="z", k=100.0, c=1.0, law=mb.Cubic(5e3))
    at = mb.equilibrium(m)
    system = nonlinear_system(m, at=at)
    u = np.roots([5e3, 0, 100.0, 9.81])
    u0 = float(u[np.abs(u.imag) < 1e-12].real[0])
    (law,) = system.elements
    sign = law.w[0]
    assert abs(sign) == pytest.approx(1.0)
    assert law.numbers() == pytest.approx([0.0, 3 * 5e3 * u0**2, 3 * 5e3 * u0 * sign, 5e3], rel=1e-9)
    total = float(system.K[0, 0]) + law.numbers()[1]
    assert total == pytest.approx(float(mb.linearize(m, at=at).K[0, 0]), rel=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        mb.Polynomial1D([0.3, 1.0, 2.0, -1.0], [0.2, 0.4]),
        mb.Gap(50.0, 0.05),
        mb.Gap(50.0, 0.05, smoothing=0.01),
        mb.Gap(50.0, 0.05, bilateral=True),
        mb.Hertz(40.0, 1.5, 0.02),
        mb.TableLaw([-1.0, 0.0, 0.5, 1.0], [-2.0, 0.0, 1.5, 4.0]),
        mb.CoulombTanh(0.3, 0.1),
        mb.Cubic(3.0),
    ],
)
def test_shifted_laws_are_the_law_less_its_value(law):
    from mbrs.nonlinear.shifted_laws import shifted

    w, u0 = np.array([1.0]), 0.08
    parts = shifted(law.code, law.numbers(), w, u0, "here")
    u, v = np.linspace(-0.5, 0.4, 31), np.linspace(-0.3, 0.6, 31)
    total = sum(part.w[0] * part.force(part.w[0] * u, part.w[0] * v) for part in parts)
    assert np.max(np.abs(total - (law.force(u0 + u, v) - law.force(u0)))) < 1e-14


def test_a_varying_stiffness_cannot_be_displaced():
    m = mb.Model("hung", gravity=(0, 0, -9.81))
    b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="z", k=100.0, law=mb.VaryingStiffness(1.0))
    with pytest.raises(ModelError, match="'rail' is displaced"):
        nonlinear_system(m, at=mb.equilibrium(m))


# --- motion -----


@pytest.mark.oracle
def test_motion_with_a_sliding_hinge_is_where_small_steps_lead():
    """The reference's Runge-Kutta steps hold the slider within a step: they come closer to the motion as the step."""
    m = needle(*FAST)
    traj = mb.simulate(m, t=np.linspace(0, 0.12, 13), rtol=1e-10, method="explicit")
    errors = []
    for n in (60, 120, 240):
        sys, history = reference_motion(m, 0.12 / n, n)
        there = np.array([rm.positions(sys, one) for one in history[:: n // 12]])
        ours = np.stack([traj.position(body) for body in traj.bodies], axis=1)
        errors.append(np.abs(ours - there).max())
    print("error of the reference's steps", errors)
    assert errors[0] < 1e-4 and errors[2] < 0.35 * errors[0]
    assert np.max(np.abs(traj.memory[-1])) > 0.01  # the slider has moved
    system = compiled(m)
    slip = [system.rate_mismatch(r, v) for r, v in zip(traj.q, traj.rate, strict=True)]
    assert max(slip) < 1e-13  # the knife edge holds at every output


@pytest.mark.oracle
def test_motion_without_slip_equals_the_reference():
    m = needle(*FAST, slip=1e6)
    times = np.linspace(0, 0.12, 7)
    traj = mb.simulate(m, t=times, rtol=1e-11, method="explicit")
    sys, _, drawn = both(m)
    start = begin(sys, assemble(sys, drawn_state(sys)), drawn["rate"])
    there = simulate(sys, start, times[1:]).positions(sys)
    ours = np.stack([traj.position(body) for body in traj.bodies], axis=1)
    assert np.abs(np.ptp(there, axis=0)).max() > 0.1
    assert ours == pytest.approx(there, abs=1e-9)


def spring_energy(sys, there):
    """The laws' share: k3 u^4 / 4 of the cubic, k (u - z)^2 / 2 of the slider's spring."""
    state = rm.with_rates(sys, there.state, there.rate)
    (_, u, _, _), (_, a, _, _) = rm.law_motions(sys, state)
    return 0.25 * K3 * u**4 + 0.5 * K_SLIDER * (a - there.memory[0]) ** 2


@pytest.mark.slow
def test_energy_is_kept_without_slip_and_lost_with_it():
    for slip, bounds in ((1e6, (-1e-7, 1e-7)), (SLIP, (-1.0, -1e-3))):
        sys, history = reference_motion(needle(0.5, 1.2, slip=slip, damping=False), 2e-3, 100)
        energy = [rm.energy(sys, there) + spring_energy(sys, there) for there in history]
        change = (energy[-1] - energy[0]) / (0.5 * 2.5 * 0.5**2)
        assert bounds[0] < change < bounds[1]


def test_work_counts():
    """What is absent is not counted at all."""
    counts = mb.simulate(needle(0.5), t=[0.0, 0.01], method="explicit").stats.counts
    assert counts["multiplier solutions"] > 0 and counts["memory updates"] > 0
    plain = mb.simulate(needle_plain(), t=[0.0, 0.01], method="explicit").stats.counts
    assert plain["force evaluations"] > 0 and not {"multiplier solutions", "memory updates"} & set(plain)
    with_laws, without = mb.linearize(needle()).stats.counts, mb.linearize(needle(laws=False)).stats.counts
    assert with_laws["law tangents"] == 2 and "law tangents" not in without
    core = compiled(needle())
    drawn = core.assemble()
    left_out = core.linearize(drawn["q"], np.zeros(0), ["law-slopes"])["counts"]
    assert "law tangents" not in left_out


def needle_plain():
    m = mb.Model("plain", gravity=(0, 0, -9.81))
    bob = m.body("bob", mass=0.5, inertia=(0.01, 0.01, 0.002), at=(0.05, 0, -0.3))
    m.revolute("hinge", m.ground, bob, at=(0, 0, 0), axis="y")
    return m


# --- the explicit scheme by itself -----


def tumbling(kind):
    """A body with three moments of inertia, held at a point or free, pulled by a bushing; reversed joints too."""
    m = mb.Model(kind, gravity=(0, 0, -9.81))
    spin = np.array([1.0, 5.0, 0.3])
    at = (0.1, 0.0, -0.2)
    velocity = np.cross(spin, at) if "spherical" in kind else (0.3, 0.1, 2.0)
    body = m.body("top", mass=1.0, inertia=(0.02, 0.03, 0.045), at=at, velocity=velocity, angular_velocity=spin)
    if kind == "spherical":
        m.spherical("ball", m.ground, body, at=(0, 0, 0))
    elif kind == "spherical reversed":
        m.spherical("ball", body, m.ground, at=(0, 0, 0))
    elif kind == "free reversed":
        m.free("float", body, m.ground, at=(0, 0, 0))
    elif kind == "universal":
        m = mb.Model(kind, gravity=(0, 0, -9.81))
        body = m.body(
            "top",
            mass=1.0,
            inertia=(0.02, 0.03, 0.045),
            at=at,
            angular_velocity=(3.0, 0, 4.0),
            velocity=np.cross((3.0, 0, 4.0), at),
        )
        m.universal("cross", body, m.ground, at=(0, 0, 0), axis="z", axis2="x")
    m.bushing("rubber", m.ground, body, at=at, k=(20, 30, 25, 0.1, 0.2, 0.1))
    return m


@pytest.mark.oracle
@pytest.mark.parametrize("kind", ["spherical", "spherical reversed", "free", "free reversed", "universal"])
def test_tumbling_equals_the_reference(kind):
    m, times = tumbling(kind), np.linspace(0, 0.2, 5)
    traj = mb.simulate(m, t=times, rtol=1e-11, method="explicit")
    sys, _, drawn = both(m)
    there = simulate(sys, begin(sys, assemble(sys, drawn_state(sys)), drawn["rate"]), times[1:]).positions(sys)
    assert np.abs(np.ptp(there, axis=0)).max() > 0.02
    assert traj.position("top") == pytest.approx(there[:, 0], abs=1e-10)


def test_a_free_top_keeps_energy_and_angular_momentum():
    """Torque-free: only the scheme's error changes them."""
    m = mb.Model("top")
    inertia = np.array([0.02, 0.03, 0.045])
    m.body("top", mass=1.0, inertia=inertia, angular_velocity=(0.1, 5.0, 0.2))
    drift = []
    for rtol in (1e-5, 1e-11):
        traj = mb.simulate(m, t=np.linspace(0, 2, 9), rtol=rtol, method="explicit")
        R, w = traj.rotation("top"), traj.angular_velocity("top")
        L = np.einsum("tij,j,tkj,tk->ti", R, inertia, R, w)
        drift.append(np.abs(L - inertia * (0.1, 5.0, 0.2)).max())
        assert np.abs(R @ np.moveaxis(R, 1, 2) - np.eye(3)).max() < 1e-13
    assert drift[0] < 1e-4 and drift[1] < 1e-10


def test_a_four_bar_stays_closed():
    m = mb.examples.four_bar()
    m.set({"crank.angular_velocity": (0.0, 0.0, 30.0)})  # the core projects the velocities of the other bars
    core = compiled(m)
    traj = mb.simulate(m, t=np.linspace(0, 0.4, 41), method="explicit")
    assert max(np.ptp(traj.position(body), axis=0).max() for body in traj.bodies) > 0.3
    sys = Reference(tables(m))
    gaps, slips = [], []
    for relative, rate in zip(traj.q, traj.rate, strict=True):
        gaps.append(loop_gap(sys, core, relative))
        slips.append(core.rate_mismatch(relative, rate))
    print("four-bar: gap", max(gaps), "rate", max(slips))
    # the motion starts as drawn: with jitter each of the eight points at the joints lies off by its share
    drawn = jitter.level() * 2 * sum(np.linalg.norm(m.value(f"{j.name}.at")) for j in m.joints)
    assert gaps[0] < 1e-14 + drawn and max(gaps[1:]) < 1e-14 and max(slips) < 1e-13


def loop_gap(sys, core, relative):
    """Values of the cut rows from the poses that the core reports."""
    from mbrs.reference.assembly import constraint_values

    bodies = core.bodies(relative, np.zeros(0))
    R = bodies["rotation"]
    r = np.array([bodies["position"][i] + R[i] @ b.com for i, b in enumerate(sys.bodies)])
    state = dataclasses.replace(drawn_state(sys), r=r, R=R)
    return np.max(np.abs(constraint_values(sys, state, sys.cut))) / sys.length


# --- duals -----


def test_derivatives_survive_numbers_that_are_zero():
    """A dual number that is zero but for its derivative must not count as absent: preload and coupling at zero."""
    m = mb.Model("zero")
    body = m.body("b", mass=1.0, inertia=(1, 2, 3))
    k = np.diag([10.0, 20.0, 30.0, 4.0, 5.0, 6.0])
    m.bushing("mount", m.ground, body, at=(0.1, 0.2, 0.0), k=k, preload=(0,) * 6)
    core, t = compiled(m), tables(m)
    drawn = core.assemble()
    start = int(t["element_x"][0])
    for at in (start + 10 + 2, start + 82 + 1, start + 82 + 4):  # k[x, z], preload y, preload ry
        row, column, _, value = _core.directions(core, drawn["q"], np.zeros(0), [], [([at], [1.0])], "hold", False)[
            "dS"
        ]
        exact = np.zeros((6, 6))
        np.add.at(exact, (row, column), value)
        ends = []
        for d in (-1e-4, 1e-4):
            x = t["x"].copy()
            x[at] += d
            ends.append(core.with_values(x).linearize(drawn["q"], np.zeros(0), [], raw=True)["S"])
        assert np.max(np.abs(exact)) > 0.04
        assert np.max(np.abs(exact - (ends[1] - ends[0]) / 2e-4)) < 1e-9
