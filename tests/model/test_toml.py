"""Models as files: the same Tables come back, and mistakes are found by line and column."""

from __future__ import annotations

import re

import numpy as np
import pytest
from mbrs import examples
from mbrs.errors import DuplicateNameError, InertiaError, ModelError, NameNotFoundError
from mbrs.model import laws, toml
from mbrs.model.model import Model
from mbrs.model.tables import tables
from mbrs.model.toml import dumps
from mbrs.system.effects import effects
from scenes import everything, same_tables

BUILDERS = [
    everything,
    examples.cubic_hexapod,
    examples.four_bar,
    examples.quadruped,
    examples.stewart_platform,
    examples.wafer_stage,
    lambda: examples.rotor(speed=12.5),
    lambda: examples.from_code("LL3CF2"),
]


def loads(text, source="<text>", functions=False):
    return toml.loads(text, Model, source, functions)


@pytest.mark.parametrize("build", BUILDERS)
def test_round_trip_is_bitwise(build, tmp_path):
    m = build()
    path = m.save(tmp_path / "m.toml")
    again = Model.load(path)
    assert not same_tables(tables(m), tables(again))
    assert dumps(again) == dumps(m) == path.read_text()
    assert again.name == m.name


def with_laws():
    m = Model("laws")
    k, V = m.parameter("k3", 2.0), m.parameter("V", [1.0, 2.0, 3.0])
    b = m.body("b", mass=1, inertia=(1, 1, 1))
    several = [laws.Cubic(k), laws.Jenkins(1e3, k * 2), laws.Polynomial1D(list(V), velocity=[0, 1])]
    m.spring_damper("s", m.ground, b, at=((0, 0, 0), (0, 0, 1)), law=several)
    m.revolute("r", m.ground, b, at=(0, 0, 0), axis="z", law=laws.Gap(1e3, 0.1, bilateral=True))
    m.bushing("f", m.ground, b, at=(0, 0, 0), law={"x": laws.VanDerPol(k), "rz": [laws.Hertz(1.0)]})
    return m


def test_the_laws_of_the_package_come_back():
    m = with_laws()
    again = loads(dumps(m))
    again.set({"V[1]": 5.0})
    m.set({"V[1]": 5.0})
    assert not same_tables(tables(m), tables(again))
    assert m.value("s.law").tolist() == [2, 1000, 4, 1, 5, 3, 0, 1, 0]
    table = effects(again)
    assert {"friction", "contact", "damping"} <= set(table.on)
    assert table["damping"].why == "2 of 3 springs have damping" and table["contact"].why == "contact law on f, r"


def test_expressions_stay_alive():
    m = loads(dumps(everything()))
    m.set({"L": 1.4, "V 2[0,1]": 9.0})
    other = everything()
    other.set({"L": 1.4, "V 2[0,1]": 9.0})
    assert not same_tables(tables(m), tables(other))


def test_what_was_set_is_saved():
    m = everything()
    m.set({"drawn spring.length": 4.5, "fixed.at_b[0]": 0.125, "V 2": np.full((2, 3), 0.1)})
    again = loads(dumps(m))
    assert not same_tables(tables(m), tables(again))


def test_awkward_names_and_numbers():
    m = Model('quotes " and \\ and \u00fc\x7f')
    m.parameter('k "1" = #2', 5e-324)
    b = m.body("tab\there 'x'", mass=0.1 + 0.2, inertia=(1.7976931348623157e308, 1e308, 1e308), at=(-0.0, 1e-320, 3e22))
    m.spring_damper(
        "s = [x]".replace("[", "(").replace("]", ")"), m.ground, b, at=((0, 0, 0), (1, 0, 0)), k=m['k "1" = #2'] * 2
    )
    again = loads(dumps(m))
    assert not same_tables(tables(m), tables(again)) and again.name == m.name
    assert again.parameters == m.parameters


def test_what_a_person_writes():
    m = loads(
        """
        [parameters]
        k = 1000          # whole numbers are numbers
        V = [1, 2, 3, 4, 5, 6]
        [[body]]
        name = "ball"
        mass = "2*k/1e3"
        inertia = [1, 1, 1]
        [[joint]]
        type = "revolute"
        name = "hinge"
        a = "ground"
        b = "ball"
        at = [0, 0, 0]
        axis = "-y"
        k = "k**2 + 1"
        [[element]]
        type = "bushing"
        name = "mount"
        a = "ground"
        b = "ball"
        at = [[0, 0, 0],
              [0, 0, "0.5*k"]]
        k = "V"
        """
    )
    assert (
        m.value("ball.mass") == 2.0 and m.value("hinge.k") == 1e6 + 1 and m.value("hinge.axis").tolist() == [0, -1, 0]
    )
    assert m.value("mount.k").tolist() == [1, 2, 3, 4, 5, 6] and m.value("mount.at_b[2]") == 500.0


GOOD = """[model]
name = "m"
gravity = [0, 0, -9.81]

[parameters]
k = 5.0

[[body]]
name = "one"
mass = 1.0
inertia = [1, 1, 1]
at = [
  0, 0,
  1,
]

[[body]]
name = "two"
mass = "k + 1"
inertia = [1, 1, 1]

[[joint]]
type = "revolute"
name = "hinge"
a = "ground"
  b = "two"
at = [0, 0, 0]
axis = "z"

[[element]]
type = "spring_damper"
name = "spring"
a = "one"
b = "two"
at = [[0, 0, 0], [0, 0, 1]]
k = "k"
law = { u = [{ type = "Cubic", code = 1, values = ["2*k"] }] }
"""


def test_the_good_file_is_good():
    m = loads(GOOD)
    assert len(m.bodies) == 2 and m.value("spring.law[0]") == 10.0


@pytest.mark.parametrize(
    ("old", "new", "place", "error", "words"),
    [
        ('mass = "k + 1"', 'mass = "kk + 1"', (19, 1), ModelError, "did you mean 'k'"),
        ('mass = "k + 1"', 'mass = "k - 9"', (19, 1), InertiaError, "positive"),
        ('mass = "k + 1"', "mass = 1.0.0", (19, 11), ModelError, "line"),
        ('mass = "k + 1"', "mass = nan", (19, 1), ModelError, "finite"),
        ('mass = "k + 1"', "mess = 1.0", (19, 1), NameNotFoundError, "did you mean 'mass'"),
        ('mass = "k + 1"\n', "", (17, 1), ModelError, "lacks mass"),
        ('name = "two"', 'name = "one"', (18, 1), DuplicateNameError, "taken"),
        ('name = "two"', "name = 2", (18, 1), ModelError, "must be a string"),
        ('type = "revolute"', 'type = "revolut"', (23, 1), NameNotFoundError, "did you mean 'revolute'"),
        ('  b = "two"', '  b = "tow"', (26, 3), NameNotFoundError, "did you mean 'two'"),
        ('axis = "z"', 'axis = "w"', (28, 1), ModelError, "no parameter"),
        ('axis = "z"', "axis = [0, 0, 0]", (28, 1), ModelError, "zero vector"),
        ("k = 5.0", "k = []", (6, 1), ModelError, "empty"),
        ("gravity = [0, 0, -9.81]", "gravity = [0, 0]", (3, 1), ModelError, "3 numbers"),
        ("gravity = [0, 0, -9.81]", "gravitation = 1", (3, 1), NameNotFoundError, "did you mean 'gravity'"),
        ("[parameters]", "[parameter]", (5, 1), NameNotFoundError, "did you mean 'parameters'"),
        ("  1,\n]", "  1, 2,\n]", (12, 1), ModelError, "3 numbers"),
        ("[0, 0, 1]]", "[0, 0, 0]]", (35, 1), ModelError, "coincident"),
        ('["2*k"]', '["2*q"]', (37, 1), ModelError, "no parameter"),
        ("code = 1", 'code = "x"', (37, 1), ModelError, "law"),
        ('k = "k"', "k = true", (36, 1), ModelError, "real number"),
        ("[[joint]]", "[joint]", (22, 1), ModelError, "two brackets"),
        ("inertia = [1, 1, 1]\nat", "inertia = [1, 1, 3]\nat", (11, 1), InertiaError, "exceeds"),
    ],
)
def test_mistakes_are_located(old, new, place, error, words, tmp_path):
    assert GOOD.count(old) >= 1
    path = tmp_path / "bad.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(error) as caught:
        Model.load(path)
    message = str(caught.value)
    assert words in message
    found = re.match(re.escape(str(path)) + r": line (\d+), column (\d+): ", message)
    assert found, message
    assert (int(found[1]), int(found[2])) == place, message


def test_unreadable_files(tmp_path):
    with pytest.raises(ModelError, match="cannot read"):
        Model.load(tmp_path / "absent.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="not UTF-8"):
        Model.load(tmp_path / "binary.toml")
    with pytest.raises(ModelError, match="end of the file"):
        loads('[model]\nname = "x', "x.toml")
