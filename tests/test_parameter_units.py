"""Units of a user's own parameters: those of the numbers that they feed, blank where these contradict one another."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.parameter_units import slot_units, unit_note
from mbrs.tables import directions


def fed(value=2.0, **places):
    """The unit of a parameter p that feeds some numbers of a sprung mass, each by a function of it."""
    m = mb.Model("fed", gravity=(0, 0, -9.81))
    p = m.parameter("p", value)

    def number(name, plain):
        return places[name](p) if name in places else plain

    b = m.body("b", mass=number("mass", 1.0), inertia=(1, 1, number("inertia", 1.0)), at=(number("at", 1.0), 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=number("joint", 5.0))
    ends = ((0, 0, 0), (number("point", 1.0), 0, 0))
    m.spring_damper("s", m.ground, b, at=ends, k=number("k", 3.0), c=number("c", 0.1), length=number("length", 1.0))
    m.spring_damper("t", m.ground, b, at=((0, 1, 0), (1, 0, 0)), k=1.0, law=mb.Cubic(number("law", 1.0)))
    return directions(m, ["p"]).units[0]


UNITS = [
    ({"k": lambda p: p}, "N/m"),
    ({"c": lambda p: p}, "N s/m"),
    ({"mass": lambda p: p}, "kg"),
    ({"inertia": lambda p: 0.5 * p}, "kg m2"),
    ({"k": lambda p: p, "joint": lambda p: 2 * p}, "N/m"),
    ({"at": lambda p: p / 2, "point": lambda p: 1 - p, "length": lambda p: abs(0.5 * p) + 0.1}, "m"),
    ({"length": lambda p: np.hypot(p, 0.3)}, "m"),
    # the stiffness is certain, the factor of the damper has a unit of its own
    ({"k": lambda p: p, "c": lambda p: 0.01 * p}, "N/m"),
    ({"k": lambda p: p, "law": lambda p: p}, "N/m"),
]
BLANK = [
    {"k": lambda p: p, "mass": lambda p: p},
    {"mass": lambda p: 0.02 * p},
    {"k": lambda p: p * p},
    {"k": lambda p: 1 / p},
    {"length": lambda p: np.exp(p)},
    {"law": lambda p: p},
    {},
]


@pytest.mark.parametrize(("places", "unit"), UNITS, ids=lambda v: v if isinstance(v, str) else "+".join(v))
def test_what_is_fed_tells_the_unit(places, unit):
    assert fed(**places) == unit


@pytest.mark.parametrize("places", BLANK, ids=lambda v: "+".join(v) or "nothing")
def test_what_contradicts_or_tells_nothing_leaves_it_blank(places):
    assert fed(**places) == ""


def test_entries_of_arrays_have_their_own():
    m = mb.Model("array", gravity=(0, 0, -1))
    V = m.parameter("V", [1.0, 2.0, 3.0])
    b = m.body("b", mass=V[0], inertia=(1, 1, 1), at=(V[1], 0, 0))
    m.revolute("j", m.ground, b, at=(0, 0, 0), axis="y", k=V[2])
    found = directions(m, ["V", "V[1]", "b.mass"])
    assert found.units == ("kg", "m", "N m/rad", "m", "kg")


def test_shared_parts_of_an_expression_are_walked_once():
    """Sixty doublings of a sum are sixty nodes, but 2^60 paths."""
    m = mb.Model("doubled")
    p = m.parameter("p", 1.0)
    total = p
    for _ in range(60):
        total = total + total
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=total)
    assert directions(m, ["p"]).units == ("N/m",)


def test_units_follow_a_changed_structure():
    m = mb.Model("growing")
    p = m.parameter("p", 1.0)
    b = m.body("b", mass=p, inertia=(1, 1, 1), at=(0, 0, 0))
    assert directions(m, ["p"]).units == ("kg",)
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=p)
    assert directions(m, ["p"]).units == ("",)


def test_every_slot_of_the_zoo_has_one_unit():
    """Numbers that two addresses share have the same unit by both, so that the order of objects does not matter."""
    from gradient_scenes import SCENES

    for make in SCENES.values():
        m = make()
        units = slot_units(m)
        for item in m.items.values():
            for field in item.fields().values():
                if field.kind not in ("axis", "orientation"):
                    for slots, unit in zip(field.slots, field.units, strict=True):
                        assert {units[field.store or item.store, s] for s in slots} == {unit}


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


def test_tables_show_units_and_say_why_one_is_missing():
    m = mb.Model("shown", gravity=(0, 0, -9.81))
    k, both = m.parameter("k0", 50.0), m.parameter("both", 1.0)
    b = m.body("b", mass=both, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=(1, 0, -1), k=k, c=both)
    for text in tables_of(m, ["k0", "both"]):
        print(text)
        assert "N/m" in text
    for text in tables_of(m, ["k0", "both"])[:3]:
        assert "no unit is known of both" in text
    for text in tables_of(m, ["k0"])[:3]:
        assert "no unit" not in text


def test_the_note_is_short():
    note = unit_note([f"p{i}" for i in range(9)], [""] * 9)
    assert "p3 and 5 more" in note and "p4" not in note
    assert unit_note(["a"], ["m"]) is None
