"""`verify()`: distances from motions in time, against the equations that were balanced and against all equations of a model."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest


def tell(name, one, found):
    print(f"{name}: estimated {one.error:.1e}, {found}")


def pendulum():
    """A rod hanging from a hinge: its full equation is known, I phi'' + c phi' + m g l sin(phi) = M cos(w t)."""
    m = mb.Model("pendulum", gravity=(0, -9.81, 0))
    rod = m.body("rod", mass=1.0, inertia=(1 / 12, 1e-3, 1 / 12), at=(0, -0.5, 0))
    m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="z", c=0.05, law=mb.Cubic(1.0))
    return m


def test_linear_geometry_has_one_distance():
    # a mass on a rail: its geometry is linear, so that both distances are of the same motion
    m = mb.examples.clearance_oscillator()
    one = mb.harmonic_balance(m, inputs="mass.force.x", amplitude=3.0, frequency=9.0, harmonics=31)
    found = one.verify()
    tell("clearance oscillator", one, found)
    assert float(found) == found.full and found.full == pytest.approx(found.balanced, rel=0.05)


def test_engine_on_cubic_mounts():
    m = mb.examples.engine_on_mounts()
    at = mb.equilibrium(m)
    distances = []
    for amplitude in (20.0, 200.0):
        one = mb.harmonic_balance(m, inputs="crank.force.z", amplitude=amplitude, frequency=9.0, at=at)
        found = one.verify()
        tell(f"engine, {amplitude:g} N", one, found)
        assert found.balanced < 1e-6 and found.balanced < found.full < 1e-4
        distances.append(found.full)
    # what the geometry adds grows with the motion
    assert 3 < distances[1] / distances[0] < 40


def test_ladder_with_a_gap():
    m = mb.examples.ladder_with_gap()
    for amplitude, frequency in ((0.05, 2.0), (0.8, 3.0)):
        one = mb.harmonic_balance(
            m, inputs="B3,3.force.x", amplitude=amplitude, frequency=frequency, harmonics=list(range(1, 22, 2))
        )
        found = one.verify(rtol=1e-8)
        tell(f"ladder, {amplitude:g} N", one, found)
        assert found.balanced < 100 * one.error + 1e-6 and found.full < 100 * one.error + 1e-5


@pytest.mark.parametrize("amplitude", [0.01, 0.1, 0.5])
def test_the_full_equation_of_a_pendulum(amplitude):
    # the error of the linearised geometry is known here: that of m g l phi for m g l sin(phi)
    from scipy.integrate import solve_ivp

    m = pendulum()
    one = mb.harmonic_balance(m, inputs="rod.torque.z", amplitude=amplitude, omega=2.0, harmonics=9)
    found = one.verify(rtol=1e-11)
    tell(f"pendulum, {amplitude:g} N m", one, found)
    weight, inertia = 9.81 * 0.5, 1 / 12 + 0.25

    def rate(t, y):
        moment = amplitude * np.cos(2.0 * t) - weight * np.sin(y[0]) - 0.05 * y[1] - y[0] ** 3
        return [y[1], moment / inertia]

    t = np.linspace(0, one.period, 65)
    x = one.displacement(t)[0]
    start = [x[0], one.velocity(0.0)[0, 0]]
    exact = solve_ivp(rate, (0, t[-1]), start, method="DOP853", t_eval=t, rtol=1e-12, atol=1e-14).y[0]
    # rods of one metre between centre and hinge: the angle is the larger measure
    expected = np.max(2 * np.abs(np.sin((exact - x) / 2))) / np.max(2 * np.abs(np.sin(x / 2)))
    assert found.full == pytest.approx(expected, rel=1e-3, abs=1e-9)
    assert found.balanced < 1e-7


def test_sliders_start_where_the_motion_has_left_them():
    m = mb.examples.stewart_platform(friction=2.0)
    given = dict(inputs="platform.force.z", amplitude=20.0, frequency=30.0)
    one = mb.harmonic_balance(m, harmonics=list(range(1, 20, 2)), **given)
    found = one.verify(rtol=1e-7)
    tell("Stewart platform, struts that slip", one, found)
    assert one.error < 1e-4 and found.full < 1e-3


def test_forces_given_as_vectors_and_phases():
    m = mb.examples.engine_on_mounts()
    at = mb.equilibrium(m)
    by_port = mb.harmonic_balance(
        m, inputs=["crank.force.z", "block.torque.x"], amplitude=[20.0, 3j], frequency=9.0, at=at
    )
    by_vector = mb.harmonic_balance(m, force=np.asarray(by_port.force), frequency=9.0, at=at)
    a, b = by_port.verify(), by_vector.verify()
    tell("ports", by_port, a)
    tell("vectors", by_vector, b)
    assert a.full < 1e-4 and b.full < 1e-4


def test_a_point_of_a_branch_over_level_and_over_a_number_of_the_model():
    m = mb.examples.engine_on_mounts(gravity=0.0)
    curve = mb.frequency_response(
        m, inputs="crank.force.z", amplitude=20.0, frequency=9.0, level=(1.0, 5.0), harmonics=5, stability=False
    )
    found = curve.point(-1).verify()
    tell("level 5", curve.point(-1), found)
    assert found.full < 1e-4
    rail = mb.examples.clearance_oscillator()
    branch = mb.parameter_response(
        rail, "rail.k", value=(8e3, 9e3), inputs="mass.force.x", amplitude=1.0, frequency=5.0, stability=False
    )
    found = branch.point(-1).verify()
    tell("k = 9 kN/m", branch.point(-1), found)
    assert found.full is not None and found.full < 1e-6 and rail.value("rail.k") == pytest.approx(8e3)


def test_a_torus_and_a_limit_cycle_of_a_model():
    m = pendulum()
    pair = [
        dict(inputs="rod.torque.z", amplitude=0.05, omega=2.0),
        dict(inputs="rod.torque.z", amplitude=0.05, omega=2.9),
    ]
    torus = mb.quasi_periodic(m, pair, harmonics=7)
    found = torus.verify(cycles=3)
    tell("pendulum, two torques", torus, found)
    assert found.balanced < 1e-6 and found.balanced < found.full < 5e-2
    rail = mb.Model("self-excited")
    b = rail.body("mass", mass=1.0, inertia=(1, 1, 1))
    rail.prismatic("rail", rail.ground, b, at=(0, 0, 0), axis="x", k=1.0, c=-1.0, law=mb.VanDerPol(1.0))
    cycle = mb.limit_cycle(rail, harmonics=25)
    found = cycle.verify()
    tell("van der Pol on a rail", cycle, found)
    assert found.full == pytest.approx(found.balanced, abs=1e-7) and found.full < 1e-5


def test_what_cannot_be_integrated_says_why():
    matrices = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
    found = mb.harmonic_balance(matrices, force=[0.18], omega=0.9).verify()
    assert found.full is None and found.why == "" and float(found) == found.balanced
    assert "full" not in str(found) and pickle.loads(pickle.dumps(found)) == found
    with pytest.raises(mb.ModelError, match="no model"):
        mb.harmonic_balance(matrices, force=[0.18], omega=0.9).verify(full=True)
    m = pendulum()
    one = mb.harmonic_balance(m, inputs="rod.torque.z", amplitude=0.1, omega=2.0)
    assert one.verify(full=False).full is None
    m.set({"rod.mass": 2.0})
    found = one.verify()
    assert found.full is None and "changed" in found.why and "changed" in str(found)
    with pytest.raises(mb.ModelError, match="changed"):
        one.verify(full=True)
    turning = pendulum()
    turning.drive("motor", "hinge", mb.Ramp(1.0))
    with pytest.raises(mb.ModelError):
        mb.harmonic_balance(turning, inputs="rod.torque.z", amplitude=0.1, omega=2.0).verify(full=True)


@pytest.mark.parametrize("given", [dict(rtol=-1.0), dict(rtol=np.nan), dict(rtol=1.0), dict(full="yes")])
def test_bad_input(given):
    one = mb.harmonic_balance(pendulum(), inputs="rod.torque.z", amplitude=0.1, omega=2.0)
    with pytest.raises(mb.ModelError):
        one.verify(**given)
