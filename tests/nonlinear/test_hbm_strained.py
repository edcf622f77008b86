"""Laws with memory that an equilibrium strains: harmonic balance about it against motions in time that forget their start."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.nonlinear.system import nonlinear_system

AXIS = np.array([0.48, -0.6, 0.64])


def hung(law, k=1000.0, c=14.0, mass=2.3):
    """A body on an inclined rail whose weight strains its spring and the law beside it."""
    m = mb.Model("hung", gravity=(0.7, -1.9, -9.3))
    b = m.body("b", mass=mass, inertia=(0.31, 0.23, 0.17))
    m.prismatic("rail", m.ground, b, at=(0.13, -0.4, 0.21), axis=AXIS, k=k, c=c, law=law)
    return m


LAWS = {
    "bouc-wen": mb.BoucWen(700.0, 0.15, 60.0, 35.0, 1.0),
    "sharp bouc-wen": mb.BoucWen(700.0, 0.3, 4100.0, -900.0, 2.0),
    "lugre": mb.LuGre(2.1, 3.3, 0.05, 900.0, 4.0, 1.3),
    "maxwell": mb.Maxwell([600.0, 310.0], [0.031, 0.42]),
    "jenkins": mb.Jenkins(700.0, 4.7),
    "iwan": mb.Iwan([300.0, 410.0], [1.7, 5.9]),
    "van der pol": mb.VanDerPol(800.0),
}


@pytest.mark.parametrize("name", LAWS)
def test_the_cycle_is_the_one_that_a_motion_settles_to(name):
    """Displacements over one period, of the static part as well, after so many periods that the start is forgotten: sliders must
    slip both ways, or many cycles are possible."""
    m = hung(LAWS[name])
    at = mb.equilibrium(m)
    push, omega = {"jenkins": 31.0, "iwan": 63.0}.get(name, 7.7), 19.0
    made = mb.harmonic_balance(m, omega=omega, inputs="b.force.x", amplitude=push, at=at, harmonics=31, tol=2e-3)
    assert made.status == "converged", made.reason
    load = m.copy()
    load.force("shake", load.bodies[0], value=(lambda t: push * np.cos(omega * t), 0.0, 0.0))
    periods = 60
    t = (periods + np.linspace(0, 1, 65)) * made.period
    run = mb.simulate(load, t=np.concatenate([[0.0], t]), at=at, rtol=1e-7)
    x = run.q[1:, 0] - at.state.q[0]
    told = made.displacement(t - periods * made.period)[0]
    size = np.ptp(x)
    assert np.ptp(told) > 1e-3 and np.max(np.abs(told - x)) < 5e-3 * size, np.max(np.abs(told - x)) / size


@pytest.mark.parametrize("name", ["jenkins", "iwan"])
def test_sliders_that_stick_are_springs(name):
    """Motions that are too small to slip: the linear system with their stiffness, wherever the equilibrium is."""
    law = LAWS[name]
    m = hung(law)
    at = mb.equilibrium(m)
    made = mb.harmonic_balance(m, omega=11.0, inputs="b.force.x", amplitude=1e-3, at=at, harmonics=3)
    k = 1000.0 + sum(law.numbers()[::2])
    unslipped = 1000.0 + sum(
        k for k, f in zip(law.numbers()[::2], law.numbers()[1::2], strict=True) if k * abs(at.state.q[0]) < f
    )
    drive = 1e-3 * AXIS[0]
    x = drive / (k - 2.3 * 11.0**2 + 14.0j * 11.0)
    amplitude = np.hypot(*made.X[0, 1:3])
    if unslipped == k:
        assert abs(amplitude / abs(x) - 1) < 1e-9 and abs(made.X[0, 0]) < 1e-12
    else:
        assert abs(x) * 0.9 < amplitude < 3 * abs(x)
    assert made.verify() < 1e-4


@pytest.mark.parametrize("name", LAWS)
def test_nothing_moves_where_nothing_pushes(name):
    """At the equilibrium itself the elements hold no force."""
    m = hung(LAWS[name])
    system = nonlinear_system(m, at=mb.equilibrium(m))
    made = mb.harmonic_balance(system, omega=13.0, force=np.zeros(1), harmonics=3)
    assert np.max(np.abs(made.X)) < 1e-12
