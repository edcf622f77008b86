"""Units of a user's own parameters: labels that tables show."""

import pickle

import mbrs as mb
import pytest
from mbrs._lib.text import unit_note
from mbrs.errors import ModelError
from mbrs.model.directions import directions
from mbrs.model.model import Model
from mbrs.model.toml import dumps, loads


def labelled():
    m = mb.Model("labelled", gravity=(0, 0, -9.81))
    k, V = m.parameter("k", 5.0, unit="N/m"), m.parameter("V", [1.0, 2.0, 3.0], unit="m")
    bare = m.parameter("bare", 3.0)
    b = m.body("b", mass=bare, inertia=(1, 1, 1), at=(V[1], 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=k * k)
    return m


def test_a_parameter_has_the_unit_it_was_given():
    m = labelled()
    found = directions(m, ["V", "k", "V[1]", "bare", "b.mass"])
    assert found.units == ("m", "m", "m", "N/m", "m", "", "kg")


@pytest.mark.parametrize(
    "way",
    [lambda m: loads(dumps(m), Model), lambda m: m.copy(), lambda m: pickle.loads(pickle.dumps(m))],
    ids=["file", "copy", "pickle"],
)
def test_the_label_stays(way):
    again = way(labelled())
    assert directions(again, ["V[2]", "k", "bare"]).units == ("m", "N/m", "")
    assert again.value("rail.k") == 25.0 and again.value("V").tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("unit", [3, None, ["m"]])
def test_a_unit_is_text(unit):
    m = mb.Model("m")
    with pytest.raises(ModelError, match="unit of parameter 'p' must be text"):
        m.parameter("p", 1.0, unit=unit)
    assert "p" not in m


def tables_of(m, parameters):
    """All tables of derivatives that a user prints."""
    psi = mb.Final(lambda s: s.position("b")[0])
    found = mb.gradient(m, psi, parameters, t=0.1, step=0.05)
    traj = mb.simulate(m, t=0.1, step=0.05, method="ali3p", parameters=parameters)
    modes = mb.modes(m, at=mb.equilibrium(m))
    return [
        str(found),
        str(found.sensitivity(parameters)),
        traj.sensitivity_table("b.position"),
        str(mb.sensitivity(modes, parameters)),
    ]


def test_tables_show_units_and_tell_how_to_give_one():
    m = mb.Model("shown", gravity=(0, 0, -9.81))
    k, both = m.parameter("k0", 50.0, unit="N/m"), m.parameter("both", 1.0)
    b = m.body("b", mass=both, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=(1, 0, -1), k=k, c=both)
    for text in tables_of(m, ["k0", "both"]):
        print(text)
        assert "N/m" in text
    for text in tables_of(m, ["k0", "both"])[:3]:
        assert "no unit was given for both; pass unit= to m.parameter" in text
    for text in tables_of(m, ["k0"])[:3]:
        assert "no unit" not in text


def test_the_note_is_short():
    note = unit_note([f"p{i}" for i in range(9)], [""] * 9)
    assert "p3 and 5 more" in note and "p4" not in note
    assert unit_note(["a"], ["m"]) is None
