"""Derivatives by every number of drives, couplers, rolling discs and loads that vary, against complex steps of the reference."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from mbrs.system.compiled import compiled
from mbrs.system.state import State
from motion_models import disc
from test_imposed_rows import scene
from test_sensitivity import check, compare

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
KINDS = ("drive", "coupler", "load")


@pytest.mark.oracle
def test_every_number_at_a_held_state():
    """Element x parameter over all that imposes a row or varies in time, and over the joints with velocity rows."""
    m = scene(5)
    state = State(compiled(m).assemble(True)["q"], np.zeros(0))
    names = [n for n, item in m.items.items() if item.kind in KINDS] + ["disc on plate", "edge"]
    addresses = [a for a in all_addresses(m) if a.split(".")[0] in names]
    assert {a.partition(".")[2] for a in addresses} >= {
        "amplitude",
        "coefficients",
        "t",
        "value",
        "ratio",
        "radius",
        "x_omega",
    }
    check("imposed", compare(m, state, addresses))


def carriage():
    """A mass on a spring on a driven carriage, geared to a pendulum that hangs from it."""
    m = mb.Model("carriage", gravity=(0, -9.81, 0))
    a = m.body("cart", mass=3.0, inertia=(1, 1, 1), at=(0, 0, 0))
    b = m.body("mass", mass=2.0, inertia=(1, 1, 1), at=(1, 0, 0))
    c = m.body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, -1, 0))
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x")
    m.prismatic("slide", a, b, at=(1, 0, 0), axis=(1, 0.2, 0), k=50.0, c=0.4)
    m.revolute("hinge", a, c, at=(0, 0, 0), axis="z", k=3.0)
    m.drive("shaker", "rail", mb.Sine(0.1, 5.0, phase=0.7))
    m.coupler("gear", "hinge", "slide", 0.3, offset=0.05)
    m.spring_damper("rope", m.ground, b, at=((0.2, 1, 0), (1, 0.1, 0)), k=20.0)
    m.torque("wind", c, value=(0, 0, mb.Polynomial([0.5, 1.0])))
    return m


@pytest.mark.oracle
def test_every_number_at_an_equilibrium_that_follows():
    m = carriage()
    addresses = [a for a in all_addresses(m) if m.items.get(a.split(".")[0]) is not None]
    check("followed", compare(m, mb.equilibrium(m), addresses, follow=True))


@pytest.mark.parametrize(
    "address", ["shaker.amplitude", "shaker.phase", "gear.ratio", "gear.offset", "wind.z_coefficients[0]"]
)
def test_frequencies_against_differences(address):
    m = carriage()
    s = mb.sensitivity(mb.modes(m, at=mb.equilibrium(m)), [address])
    h, found = 1e-5, []
    start = m.value(address)
    for step in (-2, -1, 1, 2):
        m.set({address: start + h * step})
        found.append(mb.modes(m, at=mb.equilibrium(m)).frequency)
    known = (8 * (found[2] - found[1]) - (found[3] - found[0])) / (12 * h)
    print(address, s.frequency[:, 0], known)
    assert np.allclose(s.frequency[:, 0], known, rtol=1e-7, atol=1e-9)
    assert np.abs(known).max() > 1e-6


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_gradients_of_a_driven_and_of_a_rolling_motion(method):
    """ALI3-P against differences of its own objective: numbers of a drive, a coupler, a load that varies, a rolling disc."""
    m = carriage()
    m.set({"gear.offset": 0.0, "shaker.phase": 0.0})  # drawn closed: where assembly moves to is not part of this test
    cases = [
        (m, "mass", ["shaker.amplitude", "shaker.omega", "gear.ratio", "wind.z_coefficients[1]"]),
        (disc(1.2, (0, 0.8, 0), (-2.5, 0, 0.4)), "disc", ["rolling.radius", "disc.mass"]),
    ]
    for model, body, names in cases:

        def value(names, how, model=model, body=body):
            psi = mb.Integral(lambda at: np.sum(at.position(body) ** 2))
            return mb.gradient(model, psi, names, t=0.3, step=5e-3, method=how)

        found = value(names, method)
        for name, slope in zip(names, found.gradient, strict=True):
            start = model.value(name)
            h = 1e-5 * max(1.0, abs(start))
            ends = []
            for s in (-h, h):
                model.set({name: start + s})
                ends.append(value(names[:1], "direct").value)
            model.set({name: start})
            known = (ends[1] - ends[0]) / (2 * h)
            print(method, name, slope, known)
            assert slope == pytest.approx(known, rel=1e-5, abs=1e-9), name
