"""Rotors in sheared and slanting wind: the motion that repeats itself with the turn, modes of means, what the means leave out."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_modes_in_wind import AXIS, SPEED, R, flapper

SLANT = AXIS + np.array([0.0, 0.3, 0.0])
PERIOD = 2.0 * np.pi / SPEED


def slanting(model="bem", **more):
    return flapper(6.0, model, root=0.2 * R, direction=SLANT, shear=0.2, reference_height=50.0, **more)


def bladed(gravity=9.81):
    """Flexible blades on a shaft with a flexible end, tilted, under weight."""
    return mb.examples.wind_rotor(modes=2, gravity=gravity)


def test_in_axial_wind_the_average_is_the_steady_motion():
    m = flapper(3.0, "bem", root=0.2 * R)
    steady, averaged = mb.steady_motion(m), mb.steady_motion(m, average=7)
    assert averaged.frame == "multiblade" and averaged.status == "converged" and averaged.error < 1e-11
    assert averaged.torque["shaft"] == pytest.approx(steady.torque["shaft"], rel=1e-9)
    s = mb.modes(m, at=steady).eigenvalue[0]
    modes = mb.modes(m, at=averaged)
    # all blades together as in turning axes; the others a turn slower and faster
    wanted = np.sort(np.abs(s.imag + SPEED * np.array([-1.0, 0.0, 1.0])))
    assert np.sort(np.abs(modes.eigenvalue.imag)) == pytest.approx(wanted, rel=1e-9)
    assert modes.eigenvalue.real == pytest.approx(np.full(3, s.real), rel=1e-9)
    assert np.all(modes.error < 1e-10)


def multipliers(turn):
    """Of x' = A(t) x with A interpolated by NumPy's transform, integrated by SciPy."""
    parts = [np.fft.fft(x, axis=0) / len(x) for x in (turn.M, turn.D, turn.S)]
    k = np.fft.fftfreq(len(turn.M), 1.0 / len(turn.M))
    n = turn.M.shape[1]

    def rate(t, x):
        wave = np.exp(2j * np.pi * k * t / turn.period)
        M, D, S = (np.tensordot(wave, part, 1).real for part in parts)
        z, dz = x.reshape(2, n, -1)
        return np.concatenate([dz, -np.linalg.solve(M, D @ dz + S @ z)]).ravel()

    end = solve_ivp(rate, (0.0, turn.period), np.eye(2 * n).ravel(), rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
    return np.linalg.eigvals(end.reshape(2 * n, 2 * n))


@pytest.mark.parametrize("model", ["none", pytest.param("bem", marks=pytest.mark.slow)])
def test_the_estimate_bounds_the_distance_to_floquet_exponents(model):
    m = slanting(model)
    steady = mb.steady_motion(m, average=25)
    assert steady.status == "converged" and 0.01 < steady.error < 1.0
    modes = mb.modes(m, at=steady)
    exact = multipliers(mb.linearize(m, at=steady).over_turn)
    for s, error in zip(modes.eigenvalue, modes.error, strict=True):
        off = np.min(np.abs(np.log(exact / np.exp(s * PERIOD)))) / PERIOD / abs(s)
        assert 1e-5 < off < error < 10.0 * off + 0.01


@pytest.mark.slow
def test_the_periodic_matrices_are_those_of_the_motion_in_time():
    """Multipliers by disturbed motions of a turn, which know nothing of linearisations."""
    m = slanting("bem")
    steady = mb.steady_motion(m, average=51)
    state = steady.state
    i, n = [1, 2, 3], len(state.q)
    assert n == 4

    def end(q, rate):
        disturbed = type(state)(q, rate)
        return mb.simulate(m, t=[PERIOD], at=disturbed, rtol=1e-8).state(PERIOD)

    columns = []
    for k in range(6):
        ends = []
        for sign in (1.0, -1.0):
            d = sign * 1e-3 * np.eye(6)[k]
            q, rate = state.q.copy(), state.rate.copy()
            q[i] += d[:3]
            rate[i] += SPEED * d[3:]
            last = end(q, rate)
            ends.append(np.concatenate([last.q[i], last.rate[i] / SPEED]))
        columns.append((ends[0] - ends[1]) / 2e-3)
    measured = np.linalg.eigvals(np.array(columns).T)
    known = multipliers(mb.linearize(m, at=steady).over_turn)
    for one in measured:
        assert np.min(np.abs(known - one)) < 5e-3 * abs(one)


def test_flexible_blades_under_weight_repeat_themselves():
    m = bladed()
    steady = mb.steady_motion(m, average=15)
    orbit = steady.state.orbit
    t = orbit.period * np.arange(30) / 30
    traj = mb.simulate(m, t=[*t, orbit.period], at=steady, rtol=1e-9)
    q, rate = (np.array([getattr(traj.state(now), name) for now in t]) for name in ("q", "rate"))
    assert np.ptp(orbit.q[:, 8:]) > 1.0
    assert np.max(np.abs(q - orbit.q)) < 1e-5
    assert np.max(np.abs(rate - orbit.rate)) < 1e-4
    assert traj.state(orbit.period).q[1:] == pytest.approx(orbit.q[0, 1:], abs=1e-5)


@pytest.mark.slow
def test_flexible_blades_in_sheared_wind_repeat_themselves():
    """More azimuths come nearer; between them lie the corners of slopes of polars and of the loads at small radii."""
    off = []
    for n in (15, 45):
        m = bladed()
        wind = mb.aero.wind(8.0, "x", shear=0.2, reference_height=84.0)
        m.aerodynamics("air", mb.examples.wind_rotor_blades(sections=6), wind=wind, inflow="bem")
        steady = mb.steady_motion(m, average=n)
        orbit = steady.state.orbit
        t = orbit.period * np.arange(2 * n) / (2 * n)
        traj = mb.simulate(m, t=[*t, orbit.period], at=steady, rtol=1e-8)
        q = np.array([traj.state(now).q for now in t])
        off.append(np.max(np.abs(q - orbit.q)[:, 8:]) / np.ptp(orbit.q[:, 8:]))
    assert off[0] < 0.02 and off[1] < 2e-3
    modes = mb.modes(m, at=steady)
    # the first mode of the shaft and the blades' edges: hardly any air; flaps: much
    assert np.max(modes.error) > 0.01 > np.median(modes.error)


def test_what_is_saved_is_the_average(tmp_path):
    m = slanting()
    steady = mb.steady_motion(m, average=9)
    steady.save(tmp_path / "a.json")
    again = mb.load(tmp_path / "a.json")
    assert np.array_equal(mb.modes(m, at=again).eigenvalue, mb.modes(m, at=steady).eigenvalue)
    assert np.array_equal(mb.modes(m, n=2, at=steady).eigenvalue, mb.modes(m, at=steady).eigenvalue[:2])


def test_what_cannot_be_averaged_is_refused_by_name():
    m = slanting()
    for bad in (8, 3, 0):
        with pytest.raises(mb.ModelError, match="average must be"):
            mb.steady_motion(m, average=bad)
    with pytest.raises(mb.ModelError, match=r"average=25"):
        mb.steady_motion(m)
    damped = slanting()
    damped.torsion("damper", "hub", "blade1", at=(1, 2, 3), axis="z", law=mb.Maxwell(1.0, 0.1))
    with pytest.raises(mb.ModelError, match="holds no states of laws"):
        mb.steady_motion(damped, average=9)
    with pytest.raises(mb.ModelError, match="three or more equal"):
        mb.steady_motion(slanting(blades=2), average=9)
    with pytest.raises(mb.ModelError, match="belongs to a rotor that turns"):
        mb.steady_motion(m, {"shaft": 0.0}, without=("drives",), average=9)
    with pytest.raises(mb.ModelError, match="averaged over the turn"):
        mb.harmonic_balance(m, at=mb.steady_motion(m, average=9), omega=1.0, force={"blade1.force.z": 1.0})
