"""`mb.compare`: the reference agrees with results of every kind, and a wrong result is found."""

import json
from dataclasses import replace

import mbrs as mb
import numpy as np
import pytest
from cranks import DUFFING, OSCILLATOR, TONES, bent_shaft, crank
from mbrs.studies import compare as module

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
    "response": lambda: mb.response(
        crank(),
        np.linspace(0.0, 2.3, 47),
        {"coupler.force.x": lambda t: np.sin(3.1 * t)},
        ["coupler.motion.x", "coupler.motion.y"],
        at=mb.equilibrium(crank()),
    ),
    "steady motion": lambda: mb.steady_motion(bent_shaft(), {"shaft": 40.0}),
    "limit cycle": lambda: mb.limit_cycle(
        mb.MechanicalSystem([[1.3]], [[-0.4]], [[2.1]], elements=[mb.VanDerPol(0.4, w=[1.0])]), harmonics=21
    ),
    "frequency response": lambda: mb.frequency_response(
        OSCILLATOR, force=[0.0, 0.31], omega=(0.5, 2.9), harmonics=[1, 3, 5]
    ),
    "quasi-periodic": lambda: mb.quasi_periodic(DUFFING, TONES, harmonics=5),
    "quasi-periodic response": lambda: mb.quasi_periodic_response(DUFFING, TONES, scale=(1.0, 1.1), harmonics=5),
    "simulate": lambda: mb.simulate(crank(), t=0.17, rtol=1e-9),
    "simulate open": lambda: mb.simulate(crank(False), t=0.11, rtol=1e-9),
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


def slider(law):
    m = mb.Model("cart", gravity=(0, 0, -9.81))
    cart = m.body("cart", mass=2.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(0.3, 0, 0))
    m.prismatic("rail", m.ground, cart, at=(0, 0, 0), axis="x", k=20.0, law=law)
    return m


def test_motion_of_a_slider_is_compared_but_not_one_that_slips():
    assert mb.compare(mb.simulate(slider(mb.Cubic(30.0)), t=0.4, rtol=1e-9))
    with pytest.raises(mb.ModelError, match="'rail' has a law that slips"):
        mb.compare(mb.simulate(slider(mb.Jenkins(50.0, 2.0)), t=0.4, rtol=1e-9))


def test_a_body_that_turns_over_is_compared(monkeypatch):
    """By more than half a turn between the times that are compared."""
    monkeypatch.setattr(module, "_TIMES", 1)
    m = mb.Model("spin")
    m.body("top", mass=1.0, inertia=(1, 2, 3), at=(0, 0, 0), angular_velocity=(0.1, 12.0, 0.1))
    assert mb.compare(mb.simulate(m, t=0.4, rtol=1e-9))


def test_large_models_are_refused_with_their_size(monkeypatch):
    monkeypatch.setattr(module, "MOST_FREEDOMS", 1)
    with pytest.raises(mb.ModelError, match="2 degrees of freedom"):
        mb.compare(RESULTS["modes of matrices"]())
    with pytest.raises(mb.ModelError, match="3 degrees of freedom"):
        mb.compare(RESULTS["simulate open"]())
