"""Coordinates of joints: angles that grow over turns, quaternions, and what they save."""

import dataclasses

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.motion import options
from mbrs.system.compiled import compiled

METHODS = tuple(method for method in options.METHODS if method != "auto")


def direction(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def rotors(rng, rate, axis=None, gear=None, k=None):
    """Two discs on a common, leaning shaft, the second on the first; ``gear`` couples them, ``k`` is a torsion spring between them."""
    axis = direction(rng) if axis is None else axis
    at = rng.normal(size=3)
    m = mb.Model("rotors")
    J = rng.uniform(0.2, 0.9, 2)
    made = [
        m.body(
            name,
            mass=1.0,
            inertia=j * np.eye(3),
            at=at,
            angular_velocity=w * axis,
        )
        for name, j, w in zip("ab", J, rate, strict=True)
    ]
    for body, name in zip(made, ("first", "second"), strict=True):
        m.revolute(name, m.ground, body, at=at, axis=axis)
    if gear is not None:
        m.coupler("gear", "first", "second", gear)
    if k is not None:
        m.torsion("spring", made[0], made[1], at=at, axis=axis, k=k)
    return m, J


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("geared", [False, True])
def test_fast_hinges_take_the_steps_of_slow_ones(method, geared):
    """The motion is linear in time: neither the angle nor the gear that reads it makes work."""
    steps, found = [], []
    for speed in (10.0, 1000.0):
        rng = np.random.default_rng(4)
        ratio = -0.3721
        m, _ = rotors(rng, (speed, ratio * speed), gear=ratio if geared else None)
        traj = mb.simulate(m, [0.0, 10.0], rtol=1e-6, method=method)
        steps.append(len(traj.steps) - 1)
        found.append(np.array([traj.joint("first")[-1] / speed, traj.joint("second")[-1] / (ratio * speed)]))
    print(f"{method}{' geared' if geared else ''}: {steps} steps")
    assert steps[1] <= 2 * steps[0]
    assert np.abs(np.array(found) - 10.0).max() < 1e-6


@pytest.mark.some(6)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(3))
def test_a_torsion_spring_winds_over_turns(seed, method):
    """phi = w/W sin(W t), W^2 = k (1/J1 + 1/J2), through several turns and over a restart."""
    rng = np.random.default_rng(seed)
    k, w = rng.uniform(0.5, 1.5), 40.0
    m, J = rotors(rng, (-3.0, w - 3.0), k=k)
    W = np.sqrt(k * np.sum(1 / J))
    assert w / W > 4 * np.pi
    times = np.linspace(0.0, 2 * np.pi / W, 14)
    first = mb.simulate(m, times[:5], rtol=1e-8, method=method)
    second = mb.simulate(m, times[4:], rtol=1e-8, method=method, at=first.state(times[4]))
    phi = np.concatenate([t.joint("second") - t.joint("first") for t in (first, second)])
    exact = w / W * np.sin(W * np.concatenate([times[:5], times[4:]]))
    assert np.abs(phi - exact).max() < 2e-4


@pytest.mark.parametrize("seed", range(3))
def test_an_equilibrium_winds_over_turns(seed):
    rng = np.random.default_rng(seed)
    axis = direction(rng)
    m, _ = rotors(rng, (0.0, 0.0), axis=axis, k=2.0)
    m.revolute("stop", m.ground, m.body("c", mass=1.0, inertia=np.eye(3), at=(0, 0, 0)), at=(0, 0, 0), axis="z", k=1.0)
    m.torsion("hold", m.ground, "a", at=(0, 0, 0), axis=axis, k=1.0)
    m.torque("wind", "b", value=9.0 * axis)
    eq = mb.equilibrium(m)
    assert eq.state.q[:2] == pytest.approx([9.0, 9.0 + 4.5], rel=1e-9)


def oblique(degrees, rng):
    """A disc on a hinge at an angle to the axis of a torsion spring, in a random position."""
    z = direction(rng)
    x = np.cross(z, direction(rng))
    x /= np.linalg.norm(x)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    hinge = c * z + s * x
    m = mb.Model("oblique")
    b = m.body("b", mass=1.0, inertia=0.3 * np.eye(3), at=(0, 0, 0), angular_velocity=5.0 * hinge)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=hinge)
    m.torsion("spring", m.ground, b, at=(0, 0, 0), axis=z, k=1e-3)
    return m


@pytest.mark.parametrize("seed", range(4))
def test_turns_about_nearly_parallel_hinges_count(seed):
    """Energy stays over turns at 40 degrees; at 50, where the angle need not turn with the hinge, a jump is named."""
    times = np.linspace(0.0, 4.0, 9)
    traj = mb.simulate(oblique(40.0, np.random.default_rng(seed)), times, rtol=1e-10)
    assert np.ptp(np.asarray(traj.energy)) < 1e-7 * 3.75
    try:
        traj = mb.simulate(oblique(50.0, np.random.default_rng(seed)), times, rtol=1e-10)
    except mb.ConvergenceError as problem:
        assert "'spring'" in str(problem) and "half a turn" in str(problem)
    else:
        assert np.ptp(np.asarray(traj.energy)) < 1e-7 * 3.75


def test_a_free_body_on_a_torsion_spring_stops_at_half_a_turn():
    m = mb.Model("loose")
    b = m.body("b", mass=1.0, inertia=np.eye(3), at=(0, 0, 0), angular_velocity=(0, 0, 2.0))
    m.torsion("spring", m.ground, b, at=(0, 0, 0), axis="z", k=0.01)
    with pytest.raises(mb.ConvergenceError, match=r"'spring'.*half a turn") as problem:
        mb.simulate(m, np.linspace(0.0, 5.0, 51))
    assert problem.value.result.t[-1] < 2.0


def test_a_quaternion_has_length_one():
    m = mb.Model("ball")
    b = m.body("b", mass=1.0, inertia=np.eye(3), at=(0.3, 0, 0))
    m.spherical("ball", m.ground, b, at=(0, 0, 0))
    drawn = mb.linearize(m).state
    for size, fine in ((1 + 1e-5, True), (1 + 1e-3, False), (0.0, False)):
        at = dataclasses.replace(drawn, q=size * drawn.q)
        if fine:
            assert compiled(m).bodies(at.q, np.zeros(0))["position"][0] == pytest.approx(
                (0.3, 0, 0), abs=1e-15 + jitter.level()
            )
        else:
            with pytest.raises(mb.MbrsError, match="quaternion"):
                mb.linearize(m, at=at)
