"""Air as an object of a model: files, copies, addresses, nodes that it adds, bad input."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest
from air_models import polars, rotor, vane
from mbrs.model.tables import tables
from scenes import same_tables


@pytest.mark.parametrize("make", [lambda: rotor()[0], lambda: vane(shear=0.2, reference_height=30.0, ground=-3.0)])
def test_saved_copied_and_printed(make, tmp_path):
    m = make()
    again = mb.Model.load(m.save(tmp_path / "air.toml"))
    for other in (again, pickle.loads(pickle.dumps(m)), m.copy(), mb.Model.load(again.save(tmp_path / "twice.toml"))):
        assert same_tables(tables(other), tables(m)) == []
    assert "aerodynamics" in str(m) and again.airs[0].polars == m.airs[0].polars


def test_numbers_have_addresses_and_expressions():
    m = vane()
    m.set({"air.speed": 7.0, "air.density": 1.1, "air.pitch": -0.2})
    assert (m.value("air.speed"), m.value("air.density"), m.value("air.pitch")) == (7.0, 1.1, -0.2)
    other = mb.Model("other")
    speed = other.parameter("wind", 4.0)
    other.body("wing", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    thin, _ = polars()
    blade = mb.aero.blade([1.0, 2.0], 0.3, 0.0, thin, body="wing", sections=3)
    other.aerodynamics("air", [blade], wind={"speed": 2 * speed, "direction": "y"})
    other.set({"wind": 5.0})
    assert other.value("air.speed") == 10.0
    assert mb.Model.load is not None and 'speed = "2' in other.file_text()


def test_flexible_blades_get_nodes_at_their_sections():
    """Their shapes are those of the line; the numbers of other bodies keep their places."""
    m = mb.Model("two")
    beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=10.0, EI_edge=40.0, modes=2, nodes={"middle": 1.0})
    one = m.flexible_body("one", beam)
    two = m.flexible_body("two", beam, at=(0, 3, 0))
    before = two.integrals.values()
    thin, _ = polars()
    made = [mb.aero.blade([0.0, 2.0], 0.2, 0.0, thin, body=one.name, sections=3)]
    m.aerodynamics("air", made, wind=mb.aero.wind(1.0))
    assert two.integrals.values() == before and two.nodes == beam.nodes
    assert one.nodes == (*beam.nodes, "air1", "air2", "air3")
    # the middle strip is where the node "middle" is
    k = one.nodes.index("air2")
    middle = one.nodes.index("middle")
    assert one.modal.node_position[k] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    assert one.modal.node_shape[k] == pytest.approx(one.modal.node_shape[middle], abs=1e-9)


def blade(**changes):
    thin, _ = polars()
    given = {"stations": [0.5, 2.0], "chord": 0.3, "twist": 0.1, "polar": thin, "body": "arm", "sections": 3, **changes}
    return mb.aero.blade(**given)


WIND = {"speed": 5.0, "direction": "x"}
BAD = {
    "must be a list of what mb.aero.blade gives": {"blades": []},
    "must be what mb.aero.blade gives": {"blades": ["arm"]},
    "name no body that carries them": {"blades": lambda: [blade(body=None)]},
    "no body": {"blades": lambda: [blade(body="leg")]},
    "whose line goes from 0 to 3.1 m": {"blades": lambda: [blade(stations=[0.5, 4.0])]},
    "inflow must be one of none, bem": {"inflow": "magic"},
    "coupling must be one of loose, tight": {"coupling": "strong"},
    "density must be positive": {"density": 0.0},
    "must be a finite number": {"wind": {"speed": np.nan, "direction": "x"}},
    "air.speed must not be negative, got -3": {"wind": {"speed": -3.0}},
    "air.shear must not be negative": {"wind": {"speed": 3.0, "shear": -0.2, "reference_height": 80.0}},
    "air.options belong to inflows with steps of their own, got stall with 'bem'": {
        "inflow": "bem",
        "options": {"stall": 4.0},
    },
    "has shear and no reference_height": {"wind": {"speed": 3.0, "shear": 0.2}},
    "has no entry 'velocity'": {"wind": {"velocity": 3.0}},
    "must be what mb.aero.wind gives": {"wind": 3.0},
    "lack root, first, last": {"blades": [{"body": "arm"}]},
}


@pytest.fixture(scope="module")
def beam():
    return mb.flexible.beam(3.1, mass=1.7, EI_flap=910.0, EI_edge=3300.0, modes=2)


@pytest.mark.parametrize("words", BAD)
def test_bad_input_changes_nothing(words, beam):
    m = mb.Model("one")
    arm = m.flexible_body("arm", beam)
    m.fixed("clamp", m.ground, arm.node("root"))
    before = tables(m)
    given = {"blades": lambda: [blade()], "wind": WIND, **BAD[words]}
    given["blades"] = given["blades"]() if callable(given["blades"]) else given["blades"]
    with pytest.raises(mb.ModelError, match=words):
        m.aerodynamics("air", **given)
    assert not m.airs and same_tables(tables(m), before) == []


@pytest.mark.some(2)
@pytest.mark.parametrize(
    "name, value", [("speed", -3.0), ("shear", -0.1), ("density", 0.0), ("reference_height", -1.0)]
)
def test_numbers_are_checked_when_they_change(name, value):
    m = vane(shear=0.2, reference_height=7.0)
    before = m.value(f"air.{name}")
    with pytest.raises(mb.ModelError, match=f"air.{name} must"):
        m.set({f"air.{name}": value})
    assert m.value(f"air.{name}") == before


def test_a_name_is_used_once():
    m = vane()
    with pytest.raises(mb.ModelError, match="'air'"):
        m.aerodynamics("air", [blade(stations=[0.5, 1.0])], wind=WIND)
