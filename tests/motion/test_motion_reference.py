"""The plain integrators, SciPy's and the transcripts of schemes, against true motions: orders, constraints, energy. They are the
yardstick of `test_motion_zoo`, so they are checked by themselves first.
"""

from __future__ import annotations

import motion_problems as zoo
import motion_truths as true
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.errors import ConvergenceError
from mbrs.model.tables import tables
from mbrs.reference.motion import velocity_rows
from mbrs.reference.simulate import begin, rows
from oracles import schemes
from oracles.schemes import SCHEMES

pytestmark = pytest.mark.oracle

# what each problem is integrated over here, s: plain NumPy is slow
SHORT = {name: make().t / 10 for name, make in zoo.SMOOTH.items()}


def places(system, history):
    """Origins of bodies and positions of markers (n_t, 3) by name."""
    at, t = history.positions(system), system.tables
    out = {b.name: at[:, i] for i, b in enumerate(system.bodies)}
    for name, body, x in zip(t["marker_name"], t["marker_body"], t["marker_x"], strict=True):
        b = system.bodies[body]
        local = b.R.T @ (system.x[x : x + 3] - b.centre)
        states = [i.motion.state for i in history.instants]
        out[name] = np.array([state.r[body] + state.R[body] @ local for state in states])
    return out


def run(problem, method, n, t):
    s = ref.System(tables(problem.model))
    history = SCHEMES[method](s, begin(s, ref.drawn_state(s)), t / n, n)
    return s, history, problem.error(history.t, places(s, history))


@pytest.mark.parametrize("name", zoo.SMOOTH)
def test_explicit_agrees_with_the_hand_written_equations(name):
    """Two derivations of the same motion, to the accuracy of the latter."""
    problem = zoo.SMOOTH[name]()
    _, _, error = run(problem, "explicit", 20, SHORT[name])
    print(f"{name}: {error:.1e} m")
    assert error < 1e-11 * max(problem.length, 1.0)


@pytest.mark.parametrize("name", ["double_pendulum", "bead_on_arm", "free_body", "skate"])
@pytest.mark.parametrize(("method", "order"), [("generalized-alpha", 2), ("bdf", 4)])
def test_orders(name, method, order):
    """Halving the step: the error's slope is the order; BDF4 approaches it from below."""
    errors = [run(zoo.SMOOTH[name](), method, n, SHORT[name])[2] for n in (32, 64)]
    slope = np.log2(errors[0] / errors[1])
    print(f"{name}, {method}: errors {errors[0]:.1e}, {errors[1]:.1e}, order {slope:.2f}")
    assert abs(slope - order) < 0.25


@pytest.mark.parametrize("method", SCHEMES)
@pytest.mark.parametrize("name", ["four_bars", "spherical_pendulum", "skate"])
def test_constraints_hold(name, method):
    """Rows of both levels after every step, and their rates after the schemes that end with `consistent`."""
    s, history, _ = run(zoo.SMOOTH[name](), method, 10, SHORT[name])
    gap, slip = 0.0, 0.0
    for i in history.instants:
        phi, J = rows(s, i.motion)
        gap, slip = max(gap, np.max(np.abs(phi))), max(slip, np.max(np.abs(J @ i.motion.rate)))
    print(f"{name}, {method}: positions {gap:.1e}, velocities {slip:.1e}, {int(np.sum(velocity_rows(s)))} of them only")
    assert gap < 1e-12
    assert slip < 1e-11


def test_bricard_keeps_its_energy():
    """One redundant row of thirty-six closes on itself: the oracle's own check where no closed form is."""
    m = zoo.bricard().model
    s = ref.System(tables(m))
    history = ref.simulate(s, ref.drawn_state(s), [0.1, 0.2], rtol=1e-12)
    energy = history.energies(s)
    print(f"energy {energy}, height {history.positions(s)[-1, :, 1]}")
    assert np.ptp(energy) < 1e-10
    assert np.ptp(history.positions(s)[:, 0, 1]) > 0.05


def test_five_bar_agrees_with_the_published_reconstruction():
    """docs/theory.md (23.12), positions at 1 s and 5 s."""
    at = true.five_bar([1.0, 5.0]).reshape(2, 6)
    expected = [
        (-1.12019484, -0.86322854, 0.18620239, -2.10553537, 1.74592044, -1.20150019),
        (-1.05939605, -0.93684577, 0.11596832, -2.30378344, 1.60020280, -1.28052981),
    ]
    print(f"five-bar: {np.abs(at - expected).max():.1e} m")
    assert np.abs(at - expected).max() < 1e-8


def test_swing_agrees_with_the_check_values():
    """docs/theory.md (23.11)."""
    angles = true.swing([0.5, 1.0, 2.0, 3.0, 5.0])
    expected = [-0.835430375, -2.363025261, -2.081860121, -0.818461015, -0.393332826]
    assert np.abs(angles - expected).max() < 1e-9


def test_free_spin_is_jacobis():
    """The quaternion's rates against the closed form of the spin."""
    t = np.linspace(0, 3, 7)
    spin = true.free_spin(t, zoo.FREE_INERTIA, zoo.FREE_SPIN[0], zoo.FREE_SPIN[2])
    R = true.free_rotation(t, zoo.FREE_INERTIA, zoo.FREE_SPIN)
    moment = R @ (zoo.FREE_INERTIA * spin)[:, :, None]
    error = np.abs(moment[:, :, 0] - zoo.FREE_INERTIA * zoo.FREE_SPIN).max()
    print(f"moment of momentum constant to {error:.1e}")
    assert error < 1e-11


def test_top_nutates_as_lagrange_found():
    """Height of the top's centre between the turning points of u'^2 = f(u), energy and both momenta constant."""
    spin, rate = 150.0, np.cross([0.0, 150.0, -4.61538], [0.0, 1.0, 0.0])
    t = np.linspace(0, 2, 201)
    e = true.symmetric_top_axis(t, 15.0, 1.0, 15.234375, 0.46875, spin, (0, 1, 0), rate)
    J, S, weight = 15.234375, 0.46875 * spin, 15.0 * true.G
    momentum, level = J * -4.61538, 0.5 * J * 4.61538**2
    # J^2 u'^2 = 2 J (E - weight u) (1 - u^2) - (L_z - S u)^2
    roots = np.roots(
        [2 * J * weight, -2 * J * level - S**2, -2 * J * weight + 2 * momentum * S, 2 * J * level - momentum**2]
    )
    allowed = np.sort(roots[np.abs(roots) <= 1 + 1e-12].real)
    print(f"height between {e[:, 2].min():.9f} and {e[:, 2].max():.9f}; turning points {allowed}")
    assert np.abs(np.linalg.norm(e, axis=1) - 1).max() < 1e-11
    assert e[:, 2].min() > allowed[0] - 1e-9 and e[:, 2].max() < allowed[1] + 1e-9
    assert e[:, 2].min() - allowed[0] < 1e-3 and allowed[1] - e[:, 2].max() < 1e-3


def test_truths_are_tight():
    """Tightening the tolerance by ten does not move them: what the tests below may ask for."""
    loose = true.solved(lambda _, y: [y[1], np.sin(y[0])], [0.1, 0.0], [5.0], rtol=1e-12)
    tight = true.solved(lambda _, y: [y[1], np.sin(y[0])], [0.1, 0.0], [5.0])
    assert np.abs(loose - tight).max() < 1e-10


def test_unsolved_step_says_so():
    """Four turns within four steps: no vector of rotation can tell."""
    problem = zoo.heavy_top()
    s = ref.System(tables(problem.model))
    with pytest.raises(ConvergenceError, match="smaller step"):
        schemes.simulate(s, ref.drawn_state(s), 0.3, 0.03, "bdf")
