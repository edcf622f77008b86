"""Texts with units in models of SI units: the same numbers as typed by hand, wrong dimensions refused, nothing without units="SI"."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError
from mbrs.model.tables import tables

pytest.importorskip("pint")
MM, INCH, POUND = 1e-3, 0.0254, 0.45359237


def build(units):
    """The same model, once typed with units and once converted by hand with factors that any table of units has."""
    t = units == "SI"

    def pick(text, number):
        return text if t else number

    m = mb.Model("typed", gravity=pick(("0 m/s^2", 0, "-981 cm/s^2"), (0, 0, -9.81)), units=units)
    k = m.parameter("k", pick("3.7 N/mm", 3.7e3), unit="" if t else "N/m")
    a = m.body("a", mass=pick("12.5 lb", 12.5 * POUND), inertia=pick(["3 kg cm^2", "4 kg cm2", 5e-4], [3e-4, 4e-4, 5e-4]),
               at=pick(["3 in", 0.2, "-70 mm"], [3 * INCH, 0.2, -70 * MM]),
               angular_velocity=pick(("60 rpm", 0, 0), (2 * np.pi, 0, 0)))  # fmt: skip
    b = m.body("b", mass=pick("430 g", 0.43), inertia=pick([["30 kg cm^2", 0, 0], [0, "40 kg cm^2", 0], [0, 0, "50 kg cm^2"]],
               np.diag([3e-3, 4e-3, 5e-3]).tolist()), at=(0.3, 0.1, 0.2))  # fmt: skip
    m.revolute(
        "A",
        m.ground,
        a,
        at=pick(("1 ft", 0, 0), (12 * INCH, 0, 0)),
        axis="y",
        k=pick("7 N mm/deg", 7e-3 * 180 / np.pi),
        c=0.2,
    )
    m.cylindrical("B", a, b, at=(0.2, 0.1, 0.3), axis=(1, 2, 3), k=pick(("2 kN/m", "3 N cm/rad"), (2e3, 0.03)))
    m.spring_damper("s", m.ground, b, at=pick((("0 m", 0, "900 mm"), (0.3, 0.1, 0.2)), ((0, 0, 0.9), (0.3, 0.1, 0.2))), k=k,
                    c=pick("11 N s/m", 11.0), length=pick("65 cm", 0.65))  # fmt: skip
    m.bushing("bush", a, b, at=(0, 0, 0), k=pick(["1 kN/mm"] * 3 + ["5 N m/rad"] * 3, [1e6] * 3 + [5.0] * 3))
    m.torsion("t", m.ground, a, at=(0, 0, 0), axis="y", k=pick("3 N m/rad", 3.0), angle=pick("30 deg", np.pi / 6))
    m.force("f", b, value=pick(("3 kN", mb.Sine(2.0, frequency=1.0), 0), (3e3, mb.Sine(2.0, frequency=1.0), 0)))
    m.torque("q", a, value=pick(("3 N mm", 0, 0), (3e-3, 0, 0)))
    m.set({"b.mass": pick("440 g", 0.44), "k": pick("4.1 N/mm", 4100.0), "b.at[1]": pick("12 mm", 0.012)})
    return m


def test_numbers_with_units_are_the_numbers():
    typed, plain = build("SI"), build(None)
    a, b = tables(typed), tables(plain)
    assert a["x"] == pytest.approx(b["x"], rel=1e-14, abs=0.0)
    assert all(np.array_equal(a[key], b[key]) for key in a if key not in ("x",))
    assert typed.space.units == {"k": "N/m"} and typed.value("k") == pytest.approx(4100.0, rel=1e-15)


def test_models_with_units_come_back(tmp_path):
    m = build("SI")
    again = mb.Model.load(m.save(tmp_path / "m.toml"))
    assert again.units == m.copy().units == pickle.loads(pickle.dumps(m)).units == "SI"
    assert np.array_equal(tables(again)["x"], tables(m)["x"]) and "mm" not in m.file_text()
    again.set({"b.mass": "1 kg"})
    assert "units" not in build(None).file_text()
    text = (
        '[model]\nname = "m"\nunits = "SI"\n\n[parameters]\nL = "80 mm"\n\n[[body]]\nname = "b"\nmass = "2 lb"\n'
        'inertia = [1, 1, 1]\nat = ["2*L", "3 in", 0]\n'
    )
    (tmp_path / "hand.toml").write_text(text)
    m = mb.Model.load(tmp_path / "hand.toml")
    assert m.value("b.mass") == pytest.approx(2 * POUND) and m.value("b.at") == pytest.approx([0.16, 3 * INCH, 0.0])
    assert m.space.units["L"] == "m"
    (tmp_path / "hand.toml").write_text(text.replace('units = "SI"\n', ""))
    with pytest.raises(ModelError, match=r"line 5, .*units='SI'"):
        mb.Model.load(tmp_path / "hand.toml")


@pytest.mark.parametrize(
    ("text", "unit", "label"),
    [("5 N/mm", "", "N/m"), ("5 deg", "", "rad"), ("3 N m", "", "N m"), ("7 lb", "", "kg"), ("12 %", "", ""), ("5 GPa", "", "N/m2"),
     ("2 mm^4", "", "m4"), ("3 N m/rad", "N m/rad", "N m/rad"), ("9 kg/m", "", "kg/m")],
)  # fmt: skip
def test_parameters_are_labelled(text, unit, label):
    m = mb.Model("m", units="SI")
    m.parameter("p", text, unit=unit)
    assert m.space.units["p"] == label
    scale = {
        "5 N/mm": 5e3,
        "5 deg": np.radians(5),
        "3 N m": 3,
        "7 lb": 7 * POUND,
        "12 %": 0.12,
        "5 GPa": 5e9,
        "2 mm^4": 2e-12,
    }
    assert m.value("p") == pytest.approx(scale.get(text, float(text.split()[0])))


def test_wrong_dimensions_are_refused():
    m = mb.Model("m", units="SI")
    for given, message in (
        ({"mass": "3 mm"}, r"b\.mass must be in kg"),
        ({"mass": "3 florps"}, "not known"),
        ({"mass": "3"}, "real number"),
        ({"at": ("3 kg", 0, 0)}, "must be in m"),
        ({"angular_velocity": ("3 Hz", 0, 0)}, "rpm"),
        ({"mass": "9**9**9 kg"}, "real number"),
        ({"mass": "1 m^99999999"}, "such as"),
        ({"mass": "1 kg" + "*kg" * 100}, "real number"),
    ):
        with pytest.raises(ModelError, match=message):
            m.body("b", **{"mass": 1.0, "inertia": (1, 1, 1), **given})
    b = m.body("b", mass=1, inertia=(1, 1, 1))
    with pytest.raises(ModelError, match="must be in N m/rad"):
        m.torsion("t", m.ground, b, at=(0, 0, 0), axis="x", k="3 N/m")
    with pytest.raises(ModelError, match="must be in N/m"):
        m.bushing("t", m.ground, b, at=(0, 0, 0), k=("3 N m/rad",) * 6)
    with pytest.raises(ModelError, match="must be one of them"):
        m.parameter("k", "3 N/mm", unit="N/mm")
    with pytest.raises(ModelError, match="must be in kg"):
        m.set({"b.mass": "3 s"})
    with pytest.raises(ModelError, match="units= must be"):
        mb.Model("m", units="imperial")
    assert len(m.bodies) == 1 and not m.elements


def test_other_models_take_numbers_only():
    m = mb.Model("m")
    for action in (
        lambda: m.body("b", mass="1 kg", inertia=(1, 1, 1)),
        lambda: m.body("b", mass=1, inertia=(1, 1, 1), at=("1 m", 0, 0)),
        lambda: m.parameter("p", "1 m"),
        lambda: mb.Model("g", gravity=("1 m/s2", 0, 0)),
        lambda: m.set({"c.mass": "1 kg"}),
    ):
        if not m.bodies:
            m.body("c", mass=1, inertia=(1, 1, 1))
        with pytest.raises(ModelError, match="units='SI'"):
            action()
