"""Ground that turns under gravity, against the same model on a carrier body that a torque turns."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest

OMEGA = np.array([0.2, 1.0, 2.7, 6.0, 15.0, 40.0])
OUTPUTS = ["lower.motion.x", "lower.motion.y", "upper.motion.z", "lower.motion.rx", "upper.motion.rz"]
PIVOT = 1e3


def arm(m, base):
    """A sprung, damped arm in space with a preloaded stay, on ground or on a carrier. Invented data."""
    upper = m.body("upper", mass=2.0, inertia=(0.05, 0.04, 0.03), at=(0.3, 0.1, -0.4))
    lower = m.body("lower", mass=1.0, inertia=(0.02, 0.01, 0.02), at=(0.5, -0.1, -0.9), com=(0.02, 0.0, 0.01))
    m.universal("shoulder", base, upper, at=(0.1, 0, 0), axis="x", axis2="y", k=(40.0, 50.0), c=(0.3, 0.2))
    m.revolute("elbow", upper, lower, at=(0.4, 0.1, -0.7), axis=(0.3, 1.0, 0.1), k=12.0, c=0.1)
    m.spring_damper("stay", base, lower, at=((0.8, 0, 0), (0.5, -0.1, -0.9)), k=150.0, c=1.0, preload=8.0)
    return m


def on_ground():
    m = mb.Model("arm", gravity=(0.4, -1.0, -9.81))
    return arm(m, m.ground)


def on_carrier(axis):
    """The arm on a carrier whose pivot is preloaded until its equilibrium is the drawn angle."""
    m = mb.Model("arm on a carrier", gravity=(0.4, -1.0, -9.81))
    carrier = m.body("carrier", mass=3.0, inertia=(0.7, 0.8, 0.9), at=(0, 0, 0))
    m.revolute("pivot", m.ground, carrier, at=(0, 0, 0), axis=axis, k=PIVOT, preload=0.0)
    arm(m, carrier)
    for _ in range(12):
        found = mb.equilibrium(m)
        turn = found.rotation("carrier")
        spin = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        m.set({"pivot.preload": m.value("pivot.preload") + PIVOT * spin["xyz".index(axis)]})
    assert np.abs(turn - np.eye(3)).max() < 1e-13
    return m, found


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_transfer_functions_equal_those_of_a_carrier_turned_by_a_torque(axis):
    """Motion per motion of the carrier: how the carrier is held and driven drops out."""
    m = on_ground()
    other, found = on_carrier(axis)
    base = mb.base_motion("r" + axis)
    h = mb.frf(m, base, OUTPUTS, omega=OMEGA, at=mb.equilibrium(m)).value[:, 0]
    driven = mb.frf(other, f"carrier.torque.{axis}", [*OUTPUTS, f"carrier.motion.r{axis}"], omega=OMEGA, at=found)
    expected = driven.value[:-1, 0] / driven.value[-1, 0]
    error = np.abs(h - expected).max() / np.abs(h).max()
    print(f"base.r{axis}: {error:.1e}")
    assert error < 1e-9


def test_a_plumb_stays_plumb_when_ground_turns_slowly():
    """A hanging pendulum does not follow the slow turning of its support: absolute rotation -> 0, relative -> -1."""
    m = mb.Model("plumb", gravity=(0, 0, -9.81))
    rod = m.body("rod", mass=1.3, inertia=(0.02, 0.02, 0.001), at=(0, 0, -0.4))
    m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="y")
    h = mb.frf(m, mb.base_motion("ry"), "rod.motion.ry", omega=[1e-7]).value[0, 0, 0]
    assert abs(h) < 1e-12


def test_time_response_and_state_space_agree_with_the_transfer_function():
    m = on_ground()
    at = mb.equilibrium(m)
    base, omega = mb.base_motion("ry"), 2.7
    h = mb.frf(m, base, "lower.motion.x", omega=[omega], at=at).value[0, 0, 0]
    t = np.linspace(0.0, 60.0, 24001)
    y = mb.response(m, t=t, loads={base: np.sin(omega * t)}, outputs="lower.motion.x", at=at).value[0]
    late = t > 50.0
    assert np.abs(y[late] - (h * np.exp(1j * omega * t[late])).imag).max() < 1e-4 * np.abs(h)
    ss = mb.state_space(m, base, "lower.motion.x", at=at)
    assert ss.B.shape[1] == ss.D.shape[1] == 1
    state = ss.C @ np.linalg.solve(1j * omega * np.eye(len(ss.A)) - ss.A, ss.B) + ss.D
    assert abs(state[0, 0] - h) < 1e-9 * abs(h)


def test_sensitivities_of_a_turned_base():
    m = on_ground()

    def analysis(model):
        at = mb.equilibrium(model)
        return mb.frf(model, [mb.base_motion("rx"), "upper.force.y"], OUTPUTS[:3], omega=OMEGA[:4], at=at)

    check = mb.check_gradients(analysis, m, ["lower.mass", "stay.k", "elbow.at[0]", "gravity[0]", "gravity[2]"])
    print(check)
    assert check


def test_loads_fixed_in_space_are_refused():
    m = on_ground()
    m.force("wind", m.items["lower"], value=(1.0, 0, 0))
    with pytest.raises(mb.ModelError, match=r"wind.*keeps its direction"):
        mb.frf(m, mb.base_motion("rx"), "lower.motion.x", omega=[1.0])
