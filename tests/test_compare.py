"""`mb.compare`: the reference agrees with results of every kind, and a wrong result is found."""

import json
from dataclasses import replace

import mbrs as mb
import numpy as np
import pytest
from mbrs.studies import compare as module

AXIS = np.array([0.36, -0.48, 0.8])
SIDE = np.array([0.8, 0.6, 0.0])


def crank(loop=True):
    """Rods in a leaning plane, hinged, with a spring beside and a damper; closed to a four-bar or open."""
    up = np.cross(AXIS, SIDE)
    point = {"A": 0.0 * up, "B": 0.31 * SIDE + 0.83 * up, "C": 1.22 * SIDE + 1.07 * up, "D": 1.13 * SIDE}
    m = mb.Model("crank", gravity=tuple(-9.7 * up + 0.4 * AXIS))
    rods = {}
    for name, a, b, mass in (("crank", "A", "B", 1.3), ("coupler", "B", "C", 0.7), ("rocker", "C", "D", 2.1)):
        middle = 0.5 * (point[a] + point[b])
        rods[name] = m.body(name, mass=mass, inertia=(0.11, 0.13, 0.07), com=tuple(middle + 0.01), at=tuple(middle))
    m.revolute("A", m.ground, rods["crank"], at=tuple(point["A"]), axis=tuple(AXIS), k=3.1, c=0.2)
    m.revolute("B", rods["crank"], rods["coupler"], at=tuple(point["B"]), axis=tuple(AXIS))
    m.revolute("C", rods["coupler"], rods["rocker"], at=tuple(point["C"]), axis=tuple(AXIS), k=0.0 if loop else 5.7)
    if loop:
        m.revolute("D", m.ground, rods["rocker"], at=tuple(point["D"]), axis=tuple(AXIS))
    m.spring_damper("s", m.ground, rods["crank"], at=(tuple(-SIDE + 0.6 * up), tuple(point["B"])), k=217.0, c=1.9)
    m.marker("tip", rods["coupler"], at=tuple(point["C"]))
    return m


OSCILLATOR = mb.MechanicalSystem(
    [[1.3, 0.1], [0.1, 0.7]],
    [[0.12, 0.0], [0.0, 0.05]],
    [[3.1, -0.9], [-0.9, 2.2]],
    elements=[mb.Cubic(0.8, w=[1.0, -1.0])],
)

RESULTS = {
    "linearize": lambda: mb.linearize(crank(), at=mb.equilibrium(crank())),
    "linearize open": lambda: mb.linearize(crank(False)),
    "modes": lambda: mb.modes(crank(), at=mb.equilibrium(crank())),
    "modes open": lambda: mb.modes(crank(False), at=mb.equilibrium(crank(False))),
    "modes of matrices": lambda: mb.modes(OSCILLATOR),
    "equilibrium": lambda: mb.equilibrium(crank()),
    "equilibrium open": lambda: mb.equilibrium(crank(False)),
    "frf": lambda: mb.frf(
        crank(),
        inputs="coupler.force.x",
        outputs="tip.motion.y",
        frequency=np.linspace(0.2, 7.0, 23),
        at=mb.equilibrium(crank()),
    ),
    "harmonic balance": lambda: mb.harmonic_balance(OSCILLATOR, force=[0.0, 0.31], omega=1.37, harmonics=9),
    "simulate": lambda: mb.simulate(crank(), t=0.41, rtol=1e-9),
    "simulate open": lambda: mb.simulate(crank(False), t=0.23, rtol=1e-9),
}


@pytest.mark.parametrize("name", RESULTS)
def test_the_reference_agrees(name):
    table = mb.compare(RESULTS[name]())
    print(table)
    assert bool(table), str(table)
    assert len(table.labels) == len(table.difference) >= 1


def test_a_wrong_digit_is_found_and_named():
    modes = RESULTS["modes"]()
    table = mb.compare(replace(modes, eigenvalue=modes.eigenvalue * (1.0 + 1e-7)))
    assert not bool(table)
    assert dict(zip(table.labels, table.agree, strict=True))["natural frequency"] == np.False_
    assert "no" in str(table).split()


def test_the_table_is_a_result_like_others(tmp_path):
    table = mb.compare(RESULTS["modes"]())
    assert "natural frequency" in str(table.to_xarray())
    assert table.plot() is not None
    path = table.save(tmp_path / "table.json")
    assert "natural frequency" in json.dumps(json.loads(path.read_text()))


@pytest.mark.parametrize("wrong", [None, 3.0, "modes", mb.MechanicalSystem([[1.0]], K=[[2.0]])])
def test_what_is_no_result_is_refused(wrong):
    with pytest.raises(mb.ModelError, match="compare takes one of"):
        mb.compare(wrong)


def test_large_models_are_refused_with_their_size(monkeypatch):
    monkeypatch.setattr(module, "MOST_FREEDOMS", 1)
    with pytest.raises(mb.ModelError, match="2 degrees of freedom"):
        mb.compare(RESULTS["modes of matrices"]())
    with pytest.raises(mb.ModelError, match="3 degrees of freedom"):
        mb.compare(RESULTS["simulate open"]())
