"""Rows of drives, couplers, knife edges and rolling discs: core, reference, and complex steps of the reference."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from agreement import reference_state
from mbrs import reference as ref
from mbrs.model.tables import tables
from mbrs.reference import motion as rm
from mbrs.reference.assembly import constraint_values, jacobian
from mbrs.reference.simulate import begin, simulate
from mbrs.system.compiled import compiled
from mbrs.system.state import State

STEP = 1e-30


def scene(seed=0):
    """A floor, a disc that rolls on a tilted plate, a knife edge, joints of all kinds that are driven or coupled. Invented."""
    rng = np.random.default_rng(seed)
    m = mb.Model("rows", gravity=(0.3, -0.2, -9.81))

    def body(name, at, **more):
        q = rng.normal(size=4)
        return m.body(
            name, mass=1 + rng.random(), inertia=(0.3, 0.4, 0.5), at=at, orientation=q / np.linalg.norm(q), **more
        )

    plate, arm, bob = body("plate", (0, 0, 0)), body("arm", (1, 0, 0.2)), body("bob", (1.5, 0.4, 0))
    disc, sled, head = body("disc", (0.3, 0.2, 0.6)), body("sled", (0, 2, 0)), body("head", (0.5, 2, 0.3))
    m.universal("plate joint", m.ground, plate, at=(0, 0, 0), axis=(0.1, 0, 1), axis2=(1, 0, -0.1))
    m.cylindrical("thread", plate, arm, at=(0.5, 0, 0.1), axis=(1, 0.2, 0.3))
    m.spherical("ball", bob, arm, at=(1.2, 0.2, 0))
    m.planar("floor", m.ground, sled, at=(0, 2, 0), axis="z")
    m.revolute("neck", head, sled, at=(0.2, 2, 0), axis=(0, 1, 0.2))
    lean = np.array([0.9, 0.2, 0.4])
    n, z = lean / np.linalg.norm(lean), np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
    height = 0.5 * np.sqrt(1 - (n @ z) ** 2)
    foot = np.array([0.3, 0.2, 0.6]) - height * z
    m.rolling_disc("disc on plate", plate, disc, at=(foot, (0.3, 0.2, 0.6)), axis=z, axis2=n, radius=0.5)
    m.knife_edge("edge", m.ground, sled, at=(-0.2, 2, 0), axis=(0, 1, 0.1))
    m.drive("d alpha", "plate joint", mb.Sine(0.3, 2.0, phase=0.1), "rz")
    m.drive("d beta", "plate joint", mb.Polynomial([0.01, 0.3, -0.2]), "rx")
    m.drive("d slide", "thread", mb.Table([0, 0.5, 1.2, 2], [0.0, 0.1, 0.05, 0.2]), "z")
    m.drive("d ball", "ball", mb.Ramp(0.4, 0.02, 0.1), "ry")
    m.drive("d floor", "floor", mb.Sine(0.2, frequency=0.4), "x")
    m.coupler("gear", "thread", "neck", -0.7, first_coordinate="rz", offset=0.03)
    m.coupler("rack", "neck", "floor", 0.3, second_coordinate="y")
    m.coupler("odd", "ball", "floor", 0.4, first_coordinate="rx", second_coordinate="rz")
    m.force("push", sled, value=(mb.Sine(2.0, 3.0, offset=0.5), 0.3, mb.Polynomial([1, 2])), frame="body")
    m.torque("twist", arm, value=(0.1, mb.Table([0, 1], [0.4, 2], kind="linear"), 0.0))
    for i, name in enumerate(("plate", "arm", "bob", "sled", "head")):
        m.bushing(f"mount {i}", m.ground, name, at=(0.1 * i, 0.3, 0.2), k=np.full(6, 200.0), c=np.full(6, 1.0))
    return m


def anywhere(m, seed):
    """A state that need not satisfy any row, with rates, in core and reference, at a time."""
    rng = np.random.default_rng(seed)
    core = compiled(m)
    sys = ref.System(tables(m))
    start = core.assemble()
    relative = start["q"]
    state = State(relative, 0.6 * rng.normal(size=sys.ny))
    there = reference_state(m, State(relative, np.zeros(0)), sys)
    return core, sys, state, there


@pytest.mark.parametrize("t", [0.0, 0.37, 1.6])
def test_rows_of_core_and_reference(t):
    """Phi, J, J v + Phi_t and the bias."""
    m = scene()
    core, sys, state, there = anywhere(m, 1)
    made = core.rows(state.q, state.rate, t, [])
    sys.t = t
    J = jacobian(sys, there)
    velocity = rm.velocity_rows(sys)
    phi = np.zeros(len(velocity))
    phi[~velocity] = constraint_values(sys, there, sys.cut)
    moving = rm.with_rates(sys, there, state.rate)
    first, second = rm.explicit_rates(sys)
    try:
        turning = rm.tree_map(sys, moving, moving=True)[1].derivative(1).T @ state.rate
    except ValueError:
        turning = None
    worst = {
        "phi": np.abs(made["phi"] - phi).max(),
        "jacobian": np.abs(made["jacobian"] - J).max(),
        "rates": np.abs(made["rates"] - (J @ state.rate + first)).max(),
        "bias": np.abs(made["bias"] - turning - second).max(),
    }
    print(t, worst)
    assert max(worst.values()) < 1e-12
    assert np.abs(first).max() > 0 and np.abs(made["bias"]).max() > 0.1


def test_rows_against_complex_steps():
    """J from steps of the tree coordinates, the bias from a step in time: Phi(y + i h v + ..., t + i h) of the reference."""
    m = scene()
    core, sys, state, there = anywhere(m, 2)
    t = 0.37
    made = core.rows(state.q, state.rate, t, [])
    position = ~rm.velocity_rows(sys)
    for k in range(sys.ny):
        moved = ref.advance(sys, there, 1j * STEP * np.eye(sys.ny)[k])
        sys.t = t
        column = constraint_values(sys, moved, sys.cut).imag / STEP
        assert np.abs(made["jacobian"][position, k] - column).max() < 1e-12
    # along the motion: advance by v and let the rows J v + Phi_t change
    moved = ref.advance(sys, there, 1j * STEP * state.rate)
    carried = jacobian(sys, moved) @ state.rate
    second = rm.explicit_rates(sys)[1]
    assert np.abs(made["bias"] - carried.imag / STEP - second).max() < 1e-12
    h = 1e-4
    rates = [core.rows(state.q, state.rate, t + s, [])["rates"] for s in (-h, h)]
    assert np.abs((rates[1] - rates[0]) / (2 * h) - second).max() < 1e-6


@pytest.mark.parametrize("effect", ["drives", "nonholonomic"])
def test_an_effect_that_is_left_out_leaves_its_rows_out(effect):
    m = scene()
    core, sys, state, _ = anywhere(m, 3)
    made = core.rows(state.q, state.rate, 0.2, [effect])
    names = np.array(core.topology()["row_joint"])
    still = ~made["jacobian"].any(axis=1) & (made["phi"] == 0) & (made["rates"] == 0) & (made["bias"] == 0)
    gone = [n.startswith("d ") for n in names] if effect == "drives" else rm.velocity_rows(sys)
    assert still.tolist() == list(gone)
    assert mb.linearize(m, without=(effect,)).M.shape[0] == mb.System(m).dof + sum(gone)
    assert mb.effects(m)[effect].on


@pytest.mark.slow
def test_linearisation_agrees():
    """M, C, K at a held state away from the drawn one; all rows among the constraints."""
    m = scene()
    start = compiled(m).assemble(True)
    state = State(start["q"], np.zeros(0))
    lin = mb.linearize(m, at=state)
    sys = ref.System(tables(m))
    keep = [sys.coordinates.index(name) for name in lin.coordinates]
    other = ref.linearize(sys, reference_state(m, state, sys), keep)
    for ours, theirs in ((lin.M, other.M), (lin.C, other.C), (lin.K, other.K), (lin.N, other.N)):
        assert np.abs((0 if ours is None else ours) - theirs).max() < 1e-10 * max(np.abs(other.K).max(), 1)


@pytest.mark.parametrize("seed", range(4))
def test_an_equilibrium_with_all_rows_does_not_hang_on_the_last_bit(seed):
    """Nothing holds the disc on its tilted plate but its edge: it has no place of rest until a mount holds it as it does the others."""
    m = scene(seed)
    m.bushing("mount disc", m.ground, "disc", at=(0.3, 0.2, 0.6), k=np.full(6, 200.0), c=np.full(6, 1.0))
    eq = mb.equilibrium(m)
    assert eq.status == "converged" and eq.stable and eq.residual < 1e-13
    for name, wrench in eq.reactions.items():
        assert np.all(np.isfinite(wrench)), name
    m.set({"bob.mass": m.value("bob.mass") * (1 + 1e-13)})
    again = mb.equilibrium(m)
    assert again.iterations == eq.iterations
    assert np.abs(again.poses["position"] - eq.poses["position"]).max() < 1e-11


@pytest.mark.oracle
def test_motion_equals_the_reference():
    """All rows, loads that vary included, against SciPy's integration of the reference's equations."""
    m, times = scene(), np.linspace(0, 0.1, 6)
    traj = mb.simulate(m, t=times, rtol=1e-11, method="explicit")
    sys = ref.System(tables(m))
    drawn = compiled(m).assemble()
    there = simulate(sys, begin(sys, reference_state(m, State(drawn["q"], np.zeros(0)), sys), drawn["rate"]), times[1:])
    known = there.positions(sys)
    ours = np.stack([traj.position(body) for body in traj.bodies], axis=1)
    print("positions differ by", np.abs(ours - known).max())
    assert np.abs(np.ptp(known, axis=0)).max() > 0.01
    assert ours == pytest.approx(known, abs=1e-9)
