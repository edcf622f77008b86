"""`mb.compare`: the reference agrees with results of every kind, and a wrong result is found."""

import json
from dataclasses import replace

import mbrs as mb
import numpy as np
import pytest
from cranks import OSCILLATOR, crank
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
