"""Every scheme in time with drives, couplers and velocity rows: convergence, and core against reference step by step."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.model.tables import tables
from motion_models import disc
from oracles.schemes import simulate as reference_simulate
from test_drives import circle_meet, four_bar, pendulum

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
ORDERS = {"generalized-alpha": 2, "bdf-bfgs": 4}
SETTINGS = [
    ("explicit", dict(rtol=1e-9)),
    ("radau", dict(rtol=1e-9)),
    ("bdf", dict(rtol=1e-9)),
    ("generalized-alpha", dict(step=1e-3)),
    ("bdf-bfgs", dict(step=1e-3)),
]


def rolling(lean=1.2, precession=1.5, mass=2.0, r=0.3, a=0.05, c=0.09):
    """A disc in the steady motion of test_nonholonomic.py, and the height of its centre."""
    sin, cos = np.sin(lean), np.cos(lean)
    s = (a * precession**2 * sin * cos - mass * 9.81 * r * cos) / ((c + mass * r * r) * precession * sin)
    n = np.array([sin, 0, cos])
    q = (np.array([0, 0, 1.0]) - cos * n) / sin
    return disc(lean, r * s * np.cross(n, q), s * n + precession * sin * q), r * sin


@pytest.mark.parametrize("method, how", SETTINGS)
def test_all_schemes_roll_and_follow(method, how):
    traj = mb.simulate(four_bar(mb.Ramp(3.0)), t=[0.3, 0.6], method=method, **how)
    known = [
        circle_meet(0.3 * np.array([np.cos(w), np.sin(w)]), 1.0, np.array([1.0, 0.0]), 0.7)
        for w in np.pi / 2 + 3.0 * traj.t
    ]
    closed = np.abs(traj.point("Q")[:, :2] - known).max()
    m, height = rolling()
    traj = mb.simulate(m, t=[0.3, 0.6], method=method, **how)
    off = np.abs(traj.position("disc")[:, 2] - height).max()
    print(method, closed, off, traj.residual.max())
    assert closed < 1e-12 and off < 2e-7
    assert traj.residual.max() < 1e-9


@pytest.mark.parametrize("method", ["explicit", "radau", "bdf", "generalized-alpha"])
def test_all_schemes_meet_a_kink(method):
    """A late ramp; the rate jumps at .5 s, which is an impact on the pendulum that hangs from the crank."""
    traj = mb.simulate(pendulum(mb.Ramp(2.0, start=0.5)), t=[0.25, 0.75], method=method, rtol=1e-6)
    assert np.abs(traj.joint("hinge") - [0, 0.5]).max() < 1e-12
    assert np.abs(traj.rate[:, 0] - [0, 2]).max() < 1e-12


def swing():
    m = mb.Model("swing", gravity=(0, -9.81, 0))
    inertia = 336.14 / 3
    # both turn as one body at the rate of the drive, so that no start has to project anything
    for name, x in (("A", 1.0), ("B", 3.0)):
        start = dict(velocity=(0, 1.6 * x, 0), angular_velocity=(0, 0, 1.6))
        m.body(name, mass=336.14, inertia=(1.0, inertia, inertia), at=(x, 0, 0), **start)
    m.revolute("m", m.ground, "A", at=(0, 0, 0), axis="z")
    m.revolute("n", "A", "B", at=(2, 0, 0), axis="z")
    m.drive("motor", "m", mb.Sine(0.8, 2.0))
    m.torque("wind", "B", value=(0, 0, mb.Sine(300.0, frequency=0.5)))
    return m


@pytest.mark.parametrize("method", ["generalized-alpha", "bdf-bfgs"])
def test_orders_with_a_drive(method):
    """Error at .5 s against a tight explicit run, over two halvings of the step: at least the order of the scheme."""
    m = swing()
    known = mb.simulate(m, t=[0.5], rtol=1e-12, method="explicit").position("B")
    errors = [
        np.abs(mb.simulate(m, t=[0.5], step=h, method=method).position("B") - known).max() for h in (0.04, 0.02, 0.01)
    ]
    order = np.log2(errors[0] / errors[-1]) / 2
    print(method, errors, order)
    assert order > ORDERS[method] - 0.3


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["generalized-alpha", "explicit"])
def test_reference_steps(method):
    """The same steps in core and reference, a drive and a varying torque in them."""
    m, h, n = swing(), 0.01, 10
    sys = ref.System(tables(m))
    state = ref.drawn_state(sys)
    history = reference_simulate(sys, state, n * h, h, method)
    traj = mb.simulate(m, t=np.arange(1, n + 1) * h, step=h, method=method)
    worst = np.abs(history.positions(sys)[1:] - np.stack([traj.position(b) for b in ("A", "B")], 1)).max()
    print(method, worst)
    assert worst < 1e-9
    assert np.abs(np.ptp(traj.position("B"), axis=0)).max() > 0.01
