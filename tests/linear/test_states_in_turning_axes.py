"""States of laws and of the air where the axes of a steady motion turn against them: lag dampers of a rotor, lagging inflow."""

from __future__ import annotations

from types import SimpleNamespace

import mbrs as mb
import numpy as np
import pytest
from mbrs.linear.turning_frames import modal_generator
from scipy.integrate import solve_ivp
from scipy.optimize import linear_sum_assignment
from test_modes_in_wind import AXIS, SPEED, R, flapper

TURNS = 8.0


def lagging_blades(law, kx=3000.0, ky=5000.0, blades=3):
    """Blades that lag about hinges of a hub on springs; ``law``: each has `mb.Maxwell`, else a dashpot and a spring in series."""
    m = mb.Model("lag dampers")
    box = {"mass": 1.0, "inertia": (0.1, 0.1, 0.1), "at": (0, 0, 0)}
    along, across = m.body("along", **box), m.body("across", **box)
    m.prismatic("px", m.ground, along, at=(0, 0, 0), axis="x", k=kx, c=10.0)
    m.prismatic("py", along, across, at=(0, 0, 0), axis="y", k=ky, c=10.0)
    hub = m.body("hub", mass=20.0, inertia=(1, 1, 2), at=(0, 0, 0), angular_velocity=(0, 0, TURNS))
    m.drive("turning", m.revolute("shaft", across, hub, at=(0, 0, 0), axis="z"), mb.Ramp(TURNS))
    arm, length, k, tau = 0.3, 2.0, 150.0, 0.08
    for i in range(blades):
        psi = 2 * np.pi * i / blades
        u, v = np.array([np.cos(psi), np.sin(psi), 0.0]), np.array([-np.sin(psi), np.cos(psi), 0.0])
        turned = {
            "at": arm * u, "orientation": np.stack([u, v, [0.0, 0.0, 1.0]], axis=1), "angular_velocity": (0, 0, TURNS),
            "velocity": tuple(TURNS * arm * v),
        }  # fmt: skip
        hinge = {"at": arm * u, "axis": "z"}
        inner = hub if law else m.body(f"light{i}", mass=1e-6, inertia=(1e-6,) * 3, **turned)
        blade = m.body(f"blade{i}", mass=5.0, inertia=(0.01, 1.7, 1.7), com=(length / 2, 0, 0), **turned)
        if law:
            m.revolute(f"lag{i}", hub, blade, k=20.0, **hinge)
            m.torsion(f"damper{i}", hub, blade, law=mb.Maxwell(k, tau if law is True else law[i]), **hinge)
        else:
            m.revolute(f"dashpot{i}", hub, inner, c=k * tau, **hinge)
            m.revolute(f"spring{i}", inner, blade, k=k, **hinge)
            m.torsion(f"centring{i}", hub, blade, k=20.0, **hinge)
    return m


def every_root(s):
    """With the conjugates: double real roots are real or a pair, by rounding."""
    return np.concatenate([s, s[s.imag > 0].conj()])


@pytest.mark.parametrize("stiffness", [(3000.0, 5000.0), (4000.0, 4000.0)])
@pytest.mark.parametrize("blades", [3, 4])
def test_lag_dampers_of_a_rotor_are_their_springs_and_dashpots(stiffness, blades):
    """The same dampers with a light body between spring and dashpot have no states."""
    roots = []
    for law in (True, False):
        m = lagging_blades(law, *stiffness, blades)
        steady = mb.steady_motion(m)
        assert steady.frame == "multiblade"
        roots.append(every_root(mb.modes(m, at=steady).eigenvalue))
    found, known = roots
    known = known[np.abs(known) < 1e5]  # the light bodies against their dashpots
    assert len(found) == len(known)
    row, column = linear_sum_assignment(np.abs(found[:, None] - known))
    assert np.max(np.abs(found[row] / known[column] - 1)) < 1e-4


@pytest.mark.filterwarnings("ignore:the frequency points miss")
def test_transfer_functions_know_that_states_turn():
    omega = np.array([3.0, 8.0, 12.0])
    found = []
    for law in (True, False):
        m = lagging_blades(law)
        steady = mb.steady_motion(m)
        found.append(mb.frf(m, "along.force.x", "along.motion.x", omega=omega, at=steady).value[0, 0])
    assert found[0] == pytest.approx(found[1], rel=1e-5)


def test_dampers_are_equal_but_for_rounding():
    known, found = (
        mb.modes(m, at=mb.steady_motion(m)).eigenvalue
        for m in (lagging_blades((0.08,) * 3), lagging_blades((0.08, 0.08 * (1 + 1e-11), 0.08 * (1 - 1e-11))))
    )
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(known), rel=1e-8)


@pytest.mark.parametrize("last", [0.09, 0.08 * (1 + 1e-7)])
def test_unequal_dampers_are_constant_in_no_axes(last):
    m = lagging_blades((0.08, 0.08, last))
    with pytest.raises(mb.ModelError, match=r"the law on element 'damper.*' is constant in no axes"):
        mb.modes(m, at=mb.steady_motion(m))


def test_lagging_inflow_in_axes_that_stand_has_the_roots_of_axes_that_turn():
    """All blades together as they are; the others seen a turn slower and faster."""
    m = flapper(3.0, "dynamic-inflow", root=0.2 * R, sections=3)
    turning, standing = mb.steady_motion(m), mb.steady_motion(m, average=5)
    assert turning.frame != "multiblade" and standing.frame == "multiblade"
    s, seen = (mb.modes(m, at=at).eigenvalue for at in (turning, standing))
    s = np.concatenate([s, s.conj()])
    one = np.unique(np.round(s, 6))
    known = np.concatenate([one + 1j * SPEED * k for k in (-1, 0, 1)])
    for root in seen:
        assert np.min(np.abs(known - root)) < 1e-5 * max(1.0, abs(root))
    for root in one:
        if root.imag > 1.0:
            assert np.min(np.abs(seen - root)) < 1e-5 * abs(root)


# --- averages over a turn -----

PERIOD = 2.0 * np.pi / SPEED
# the ground is far below the blades, where shear is smooth
SLANT = {
    "direction": AXIS + np.array([0.0, 0.3, 0.0]), "shear": 0.2, "reference_height": 23.0, "ground": -20.0, "root": 0.4 * R,
}  # fmt: skip
LAWS = {"dynamic inflow": ("dynamic-inflow", {}), "attached flow": ("none", {"attached": True})}


def slanting(laws, sections=2):
    model, more = LAWS[laws]
    return flapper(6.0, model, sections=sections, laws=more, **SLANT)


def turn_in_own_coordinates(m, steady):
    """(2 n + m, 2 n + m) what a turn makes of hinge angles, their rates and each blade's own states: the core's matrices at the azimuths,
    interpolated by NumPy's transform and integrated by SciPy; no multiblade coordinates, no means.
    """
    system, orbit = mb.linearize(m, at=steady).snapshot.system, steady.state.orbit
    found = []
    for q, v, a, z in zip(orbit.q, orbit.rate, orbit.acceleration, orbit.states, strict=True):
        r = system.linearize(q, v, ["drives"], [], a.tolist(), raw=True, held=z.tolist())
        air = system.air_states(q, v, ["drives"], a.tolist(), None, z.tolist())
        at = [i for i, name in enumerate(r["coordinates"]) if name.startswith("flap")]
        n, own = len(at), air["own"]
        M, D, S, E = r["M"][np.ix_(at, at)], r["D"][np.ix_(at, at)], r["S"][np.ix_(at, at)], air["effect"][at]
        upper = np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, len(own)))])
        middle = np.linalg.solve(M, np.hstack([-S, -D, E]))
        found.append(np.vstack([upper, middle, np.hstack([air["by_place"][:, at], air["by_rate"][:, at], own])]))
    waves, k = np.fft.fft(found, axis=0) / len(found), np.fft.fftfreq(len(found), 1.0 / len(found))

    def rate(t, x):
        A = np.tensordot(np.exp(2j * np.pi * k * t / PERIOD), waves, 1).real
        return (A @ x.reshape(len(A), -1)).ravel()

    size = len(found[0])
    end = solve_ivp(rate, (0.0, PERIOD), np.eye(size).ravel(), rtol=1e-9, atol=1e-11, method="DOP853")
    return end.y[:, -1].reshape(size, size)


@pytest.mark.slow
@pytest.mark.parametrize("laws", LAWS)
def test_the_estimate_bounds_the_distance_to_floquet_exponents_with_states(laws):
    m = slanting(laws)
    steady = mb.steady_motion(m, average=15)
    assert steady.status == "converged" and steady.error > 1e-3
    modes = mb.modes(m, at=steady)
    exact = np.linalg.eigvals(turn_in_own_coordinates(m, steady))
    assert len(modes.eigenvalue) > 3
    off = np.array([np.min(np.abs(np.log(exact / np.exp(s * PERIOD)))) / PERIOD / abs(s) for s in modes.eigenvalue])
    assert np.max(off) > 1e-4
    assert np.all(off < modes.error + 1e-6), (off, modes.error)


@pytest.mark.slow
@pytest.mark.parametrize("laws", LAWS)
def test_the_matrices_over_a_turn_are_those_of_the_motion_in_time(laws):
    """Disturbed motions of a turn, which know nothing of linearisations; one direction of everything at once."""
    m = slanting(laws)
    steady = mb.steady_motion(m, average=21)
    state = steady.state
    known = turn_in_own_coordinates(m, steady)
    places = np.flatnonzero(np.arange(len(state.memory)) % (len(state.memory) // 6) != len(state.memory) // 6 - 1)
    assert state.memory[places] == pytest.approx(state.orbit.states[0])
    direction = np.random.default_rng(3).standard_normal(6 + len(places))
    direction[:6] *= np.repeat([1.0, SPEED], 3)

    ends = []
    for sign in (1.0, -1.0):
        q, rate, memory = state.q.copy(), state.rate.copy(), state.memory.copy()
        q[1:] += sign * 1e-4 * direction[:3]
        rate[1:] += sign * 1e-4 * direction[3:6]
        memory[places] += sign * 1e-4 * direction[6:]
        begin = type(state)(q, rate, memory=memory)
        last = mb.simulate(m, t=[PERIOD], at=begin, rtol=1e-9).state(PERIOD)
        ends.append(np.concatenate([last.q[1:], last.rate[1:], last.memory[places]]))
    measured, wanted = (ends[0] - ends[1]) / 2e-4, known @ direction
    size = np.concatenate([np.full(3, 1.0), np.full(3, SPEED), np.full(len(places), 1.0)])
    # the tolerance of the motion over the disturbance
    assert np.max(np.abs(measured - wanted) / size) < 1e-5 * np.max(np.abs(wanted) / size)


def test_what_is_saved_holds_the_states(tmp_path):
    m = slanting("dynamic inflow")
    steady = mb.steady_motion(m, average=5)
    steady.save(tmp_path / "a.json")
    assert np.array_equal(mb.modes(m, at=mb.load(tmp_path / "a.json")).eigenvalue, mb.modes(m, at=steady).eigenvalue)


@pytest.mark.parametrize("speed", [1e-12, 1e-3, 1.0, 1e5])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e4])
def test_shapes_that_turn_back_do_so_at_any_speed_and_size(speed, size):
    """Two shapes across a random axis turn into each other, one alone does not, and one along the axis stays."""
    rng = np.random.default_rng(4)
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    length, along = size * rng.uniform(0.5, 2.0), rng.uniform(0.1, 1.0, size=5)
    w = speed * Q[:, 0]

    def generator(*columns):
        shape = np.zeros((5, 6, len(columns)))
        for k, c in enumerate(columns):
            shape[:, :3, k] = length * along[:, None] ** 2 * Q[:, c]
        points = length * along[:, None] * Q[:, 0]
        return modal_generator(SimpleNamespace(n_modes=len(columns), line_position=points, line_shape=shape), w, length)

    turned = np.linalg.det(Q) * speed * np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert generator(1, 2) == pytest.approx(turned, rel=1e-12, abs=1e-12 * speed)
    assert generator(1) is None
    assert np.abs(generator(0)).max() < 1e-12 * speed
