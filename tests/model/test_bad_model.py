"""Wrong input: each raises an error of its own that names the object and the remedy, and leaves the model as it was."""

from __future__ import annotations

import inspect
import math
import warnings

import numpy as np
import pytest
from junk import JUNK
from mbrs import examples
from mbrs.errors import DuplicateNameError, InertiaError, MbrsError, MbrsWarning, ModelError, NameNotFoundError
from mbrs.model import toml
from mbrs.model.directions import directions
from mbrs.model.model import Model
from mbrs.model.rotations import rotation
from mbrs.model.tables import tables
from mbrs.model.toml import dumps
from scenes import FakeLaw, everything, same_tables

BODY = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0)}
PAIR = ((0, 0, 0), (0, 0, 1))


def loads(text, source="<text>", functions=False):
    return toml.loads(text, Model, source, functions)


@pytest.fixture
def m():
    model = Model("m")
    model.body("a", **BODY)
    model.body("b", **BODY)
    model.parameter("k", 2.0)
    return model


def other_body():
    return Model("other").body("a", **BODY)


CASES = [
    # bodies
    (lambda m: m.body("c", mass=0.0, inertia=(0, 0, 0)), InertiaError, "c.mass must be positive"),
    (lambda m: m.body("c", mass=-1.0, inertia=(1, 1, 1)), InertiaError, "c.mass must be positive"),
    (lambda m: m.body("c", mass=-1, inertia=(1, 1, 1)), InertiaError, "c.mass"),
    (lambda m: m.body("c", mass=math.nan, inertia=(1, 1, 1)), ModelError, "c.mass must be a finite number"),
    (lambda m: m.body("c", mass="1", inertia=(1, 1, 1)), ModelError, "c.mass must be a real number"),
    (lambda m: m.body("c", mass=None, inertia=(1, 1, 1)), ModelError, "c.mass"),
    (lambda m: m.body("c", mass=True, inertia=(1, 1, 1)), ModelError, "c.mass"),
    (lambda m: m.body("c", mass=1j, inertia=(1, 1, 1)), ModelError, "c.mass"),
    (lambda m: m.body("c", mass=[1.0], inertia=(1, 1, 1)), ModelError, "c.mass"),
    (lambda m: m.body("c", mass=1, inertia=1.0), InertiaError, "c.inertia must be (3,)"),
    (lambda m: m.body("c", mass=1, inertia=(1, 1)), InertiaError, "c.inertia must be (3,)"),
    (lambda m: m.body("c", mass=1, inertia=(1, 1, -1)), InertiaError, "negative principal moment"),
    (lambda m: m.body("c", mass=1, inertia=(1, 1, 2.1)), InertiaError, "exceeds the sum"),
    (lambda m: m.body("c", mass=1, inertia=(1, 1, 2 + 1e-8)), InertiaError, "exceeds the sum"),
    (lambda m: m.body("c", mass=1, inertia=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]), InertiaError, "negative principal"),
    (lambda m: m.body("c", mass=1, inertia=[[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]]), InertiaError, "symmetric"),
    (lambda m: m.body("c", mass=1, inertia=(0, 1, math.inf)), ModelError, "c.inertia must be a finite"),
    (lambda m: m.body("c", mass=1, inertia=(0, 0, m["k"]), at=(0, 0)), ModelError, "c.at must be 3 numbers"),
    (lambda m: m.body("c", **BODY, at=0.0), ModelError, "c.at must be 3 numbers"),
    (lambda m: m.body("c", **BODY, at=((0, 0, 0),)), ModelError, "c.at must be 3 numbers"),
    (lambda m: m.body("c", **BODY, at=np.zeros((3, 1))), ModelError, "c.at must be 3 numbers"),
    (lambda m: m.body("c", **BODY, at=(0, 0, (1, 2))), ModelError, "c.at must be a real number"),
    (lambda m: m.body("c", **BODY, at="xyz"), ModelError, "c.at"),
    (lambda m: m.body("c", **BODY, at=(0, 0, np.inf)), ModelError, "c.at must be a finite number"),
    (lambda m: m.body("c", **BODY, orientation=(1, 0, 0)), ModelError, "c.orientation must be a quaternion"),
    (lambda m: m.body("c", **BODY, orientation=(0, 0, 0, 0)), ModelError, "zero quaternion"),
    (lambda m: m.body("c", **BODY, orientation=np.ones((3, 3))), ModelError, "not a rotation matrix"),
    (lambda m: m.body("c", **BODY, orientation=-np.eye(3)), ModelError, "not a rotation matrix"),
    (lambda m: m.body("c", **BODY, pose=(0, 0, 0)), ModelError, "c.pose must be (origin, orientation)"),
    (lambda m: m.body("c", **BODY, pose=((0, 0), None)), ModelError, "c.pose"),
    (lambda m: m.body("c", **BODY, velocity=(1, 2)), ModelError, "c.velocity"),
    (lambda m: m.body("c", mass=Model("o").parameter("p", 1.0), inertia=(1, 1, 1)), ModelError, "another model"),
    # names
    (lambda m: m.body("a", **BODY), DuplicateNameError, "'a'"),
    (lambda m: m.body("k", **BODY), DuplicateNameError, "'k'"),
    (lambda m: m.body("ground", **BODY), DuplicateNameError, "'ground'"),
    (lambda m: m.parameter("a", 1.0), DuplicateNameError, "'a'"),
    (lambda m: m.parameter("k", 1.0), DuplicateNameError, "'k'"),
    (lambda m: m.parameter("gravity", 1.0), ModelError, "gravity"),
    (lambda m: m.marker("a", "b", at=(0, 0, 0)), DuplicateNameError, "'a'"),
    (lambda m: m.body("", **BODY), ModelError, "must not be empty"),
    (lambda m: m.body("x.y", **BODY), ModelError, "'.'"),
    (lambda m: m.body("x[0]", **BODY), ModelError, "'['"),
    (lambda m: m.body(3, **BODY), ModelError, "must be a string"),
    (lambda m: m.fixed("j", "a", "bb", at=(0, 0, 0)), NameNotFoundError, "did you mean 'b'"),
    (lambda m: m.fixed("j", "a", "k", at=(0, 0, 0)), NameNotFoundError, "no body"),
    (lambda m: m.fixed("j", "a", None, at=(0, 0, 0)), ModelError, "needs a body"),
    (lambda m: m.fixed("j", "a", other_body(), at=(0, 0, 0)), ModelError, "belongs to another model"),
    (lambda m: m.fixed("j", "a", Model("o").ground, at=(0, 0, 0)), ModelError, "belongs to another model"),
    (lambda m: m["aa"], NameNotFoundError, "did you mean 'a'"),
    (lambda m: m[["a"]], ModelError, "indexed by names"),
    (lambda m: m[0], ModelError, "indexed by names"),
    (lambda m: Model(""), ModelError, "non-empty"),
    (lambda m: Model("x", gravity=9.81), ModelError, "gravity must be 3 numbers"),
    (lambda m: setattr(m, "gravity", (0, 0, np.nan)), ModelError, "gravity must be a finite"),
    # joints
    (lambda m: m.fixed("j", "a", "a", at=(0, 0, 0)), ModelError, "with itself"),
    (lambda m: m.fixed("j", m.ground, "ground", at=(0, 0, 0)), ModelError, "with itself"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0)), ModelError, "j.axis is missing"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis=(0, 0, 0)), ModelError, "zero vector"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis=(0, 0, m["k"] * 0)), ModelError, "zero vector"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis="w"), ModelError, "j.axis must be 'x'"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis=(1, 0)), ModelError, "j.axis"),
    (
        lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis="z", orientation=(1, 0, 0, 0)),
        ModelError,
        "are both given",
    ),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis="z", k=(1, 2)), ModelError, "one for each free"),
    (lambda m: m.cylindrical("j", "a", "b", at=(0, 0, 0), axis="z", k=1.0), ModelError, "j.k must be 2 numbers"),
    (lambda m: m.spherical("j", "a", "b", at=(0, 0, 0), c=(1, 2)), ModelError, "j.c must be 3 numbers"),
    (lambda m: m.revolute("j", "a", "b", at=((0, 0, 0), (0, 0)), axis="z"), ModelError, "j.at"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0, 0), axis="z"), ModelError, "j.at must be 3 numbers"),
    (lambda m: m.universal("j", "a", "b", at=(0, 0, 0), axis="z"), ModelError, "j.axis2 is missing"),
    (lambda m: m.universal("j", "a", "b", at=(0, 0, 0), axis="z", axis2=(0, 1, 1e-3)), ModelError, "perpendicular"),
    (lambda m: m.universal("j", "a", "b", at=(0, 0, 0), axis="z", axis2="z"), ModelError, "perpendicular"),
    (lambda m: m.distance("j", "a", "b", at=(0, 0, 0)), ModelError, "two points"),
    (lambda m: m.distance("j", "a", "b", at=((1, 0, 0), (1, 0, 0))), ModelError, "coincident"),
    (lambda m: m.distance("j", "a", "b", at=PAIR, length=-1), ModelError, "j.length must not be negative"),
    (lambda m: m.rolling_disc("j", "a", "b", at=PAIR, axis="z", axis2="x"), ModelError, "j.radius is missing"),
    (lambda m: m.rolling_disc("j", "a", "b", at=PAIR, axis="z", axis2="x", radius=0), ModelError, "positive"),
    (lambda m: m.rolling_disc("j", "a", "b", at=PAIR, axis="z", axis2="z", radius=1), ModelError, "parallel"),
    (lambda m: m.revolute("j", "a", "b", at=(0, 0, 0), axis="z", law=3), ModelError, "j.law must be a law"),
    (lambda m: m.spherical("j", "a", "b", at=(0, 0, 0), law=FakeLaw(1)), ModelError, "j.law must be 3 laws"),
    (lambda m: m.spherical("j", "a", "b", at=(0, 0, 0), law={"z": FakeLaw(1)}), ModelError, "no coordinates 'z'"),
    # elements
    (lambda m: m.spring_damper("s", "a", "b", at=PAIR), ModelError, "does nothing"),
    (lambda m: m.spring_damper("s", "a", "b", at=(0, 0, 0), k=1), ModelError, "s.at must be two points"),
    (lambda m: m.spring_damper("s", "a", "b", at=((1, 2, 3), (1, 2, 3)), k=1), ModelError, "coincident"),
    (lambda m: m.spring_damper("s", "a", "b", at=((1e5, 0, 0), (1e5 + 1e-9, 0, 0)), k=1), ModelError, "coincident"),
    (lambda m: m.spring_damper("s", "a", "b", at=PAIR, k=1, length=-0.1), ModelError, "s.length"),
    (lambda m: m.spring_damper("s", "a", "b", at=PAIR, k=(1, 2)), ModelError, "s.k must be a real number"),
    (lambda m: m.spring_damper("s", "a", "b", at=PAIR, k=math.nan), ModelError, "s.k must be a finite"),
    (lambda m: m.spring_damper("s", "a", "a", at=PAIR, k=1), ModelError, "with itself"),
    (lambda m: m.spring_damper("s", "a", "b", at=PAIR, law=FakeLaw(math.nan)), ModelError, "s.law"),
    (lambda m: m.spring_damper("s", "a", "b", at=PAIR, law=Cubic_with_w()), ModelError, "MechanicalSystem"),
    (lambda m: m.bushing("s", "a", "b", at=(0, 0, 0), k=(1, 2, 3)), ModelError, "s.k must be 6 numbers"),
    (lambda m: m.bushing("s", "a", "b", at=(0, 0, 0), k=np.ones((3, 3))), ModelError, "s.k must be 6 numbers"),
    (lambda m: m.bushing("s", "a", "b", at=(0, 0, 0), k=[1] * 6, preload=1), ModelError, "s.preload"),
    (lambda m: m.torsion("s", "a", "b", at=PAIR, axis="z", k=1), ModelError, "one point"),
    (lambda m: m.torsion("s", "a", "b", at=(0, 0, 0), axis=(0, 0, 0), k=1), ModelError, "zero vector"),
    # loads and markers
    (lambda m: m.force("f", m.ground, value=(1, 0, 0)), ModelError, "on ground"),
    (lambda m: m.force("f", "a", value=1.0), ModelError, "f.value must be 3 numbers"),
    (lambda m: m.force("f", "a", at=PAIR, value=(1, 0, 0)), ModelError, "one point"),
    (lambda m: m.force("f", "a", value=(1, 0, 0), frame="local"), ModelError, "f.frame must be 'world' or 'body'"),
    (lambda m: m.torque("f", "c", value=(1, 0, 0)), NameNotFoundError, "no body"),
    (lambda m: m.marker("p", "a", at=(0, 0)), ModelError, "p.at must be 3 numbers"),
    # addresses
    (lambda m: directions(m, "q"), NameNotFoundError, "no parameter"),
    (lambda m: directions(m, "a.mas"), NameNotFoundError, "did you mean 'mass'"),
    (lambda m: directions(m, "aa.mass"), NameNotFoundError, "did you mean 'a'"),
    (lambda m: directions(m, "a.at[3]"), ModelError, "out of range"),
    (lambda m: directions(m, "a.at[-1]"), ModelError, "out of range"),
    (lambda m: directions(m, "a.at[0,1]"), ModelError, "1 numbers in its index"),
    (lambda m: directions(m, "a.mass[0]"), ModelError, "one number"),
    (lambda m: directions(m, "a.at[x]"), ModelError, "whole numbers"),
    (lambda m: directions(m, "k[0]"), ModelError, "one number"),
    (lambda m: directions(m, "a"), NameNotFoundError, "is a body"),
    (lambda m: directions(m, "a.at.x"), ModelError, "must read like"),
    (lambda m: directions(m, []), ModelError, "no parameter was named"),
    (lambda m: directions(m, [3]), ModelError, "must be a string"),
    (lambda m: directions(m, "gravity[2]"), NameNotFoundError, "no gravity"),
    (lambda m: m.set({"k": (1, 2)}), ModelError, "has the shape ()"),
    (lambda m: m.set({"a.at": 1.0}), ModelError, "a.at has the shape (3,)"),
    (lambda m: m.set({"a.mass": m["k"]}), ModelError, "plain numbers"),
    (lambda m: m.set({"a.mass": math.inf}), ModelError, "must be finite"),
    (lambda m: m.set({"a.orientation[1]": 0.1}), ModelError, "set a.orientation whole"),
    (lambda m: m.set({"a.orientation": (0, 0, 0, 0)}), ModelError, "zero quaternion"),
    (lambda m: m.set("k"), ModelError, "takes a mapping"),
    (lambda m: rotation((0, 0, 0), 1.0), ModelError, "zero vector"),
    (lambda m: rotation("z", math.nan), ModelError, "finite"),
    (lambda m: rotation("q", 1.0), ModelError, "'x', 'y', 'z'"),
    (lambda m: m["a"].force("w"), ModelError, "a.force"),
    (lambda m: m["a"].force("z", at=(0, 0)), ModelError, "a.force"),
    (lambda m: m["a"].force((0, 0, 0)), ModelError, "zero vector"),
    (lambda m: m["a"].force((0, 0, m["k"])), ModelError, "plain numbers"),
    (lambda m: m["a"].force("z", at=(0, 0, m["k"])), ModelError, "define a marker"),
    (lambda m: tables(Model("empty")), ModelError, "no body"),
    # examples
    (lambda m: examples.from_code("XL3RF1"), ModelError, "TL7SF1"),
    (lambda m: examples.chain(0), ModelError, "positive whole number"),
    (lambda m: examples.chain(2, joint="hinge"), ModelError, "joint must be one of"),
    (lambda m: examples.chain(2, springs=-1), ModelError, "springs"),
    (lambda m: examples.chain(2, along="w"), ModelError, "along"),
    (lambda m: examples.chain(2, stiffness=1), ModelError, "no option stiffness"),
    (lambda m: examples.cubic_hexapod_points(edge=0.0), ModelError, "edge"),
    (lambda m: examples.wafer_stage(mounts=5), ModelError, "mounts"),
]


class Cubic_with_w(FakeLaw):
    w = (1.0,)

    def __init__(self):
        super().__init__(1.0)


@pytest.mark.parametrize(("action", "error", "words"), CASES)
def test_wrong_input(m, action, error, words):
    before, names = tables(m), set(m.items)
    with pytest.raises(error) as caught:
        action(m)
    assert words in str(caught.value)
    assert not same_tables(before, tables(m)) and set(m.items) == names
    # The same name is free for a second, correct try.
    if "c" not in m:
        m.body("c", **BODY)


def test_the_error_classes_are_ours():
    assert issubclass(NameNotFoundError, ModelError) and issubclass(InertiaError, ModelError)


@pytest.mark.parametrize("inertia", [(0, 0, 0), (0, 1, 1), (1, 1, 2), (1, 1, 2 + 1e-10), np.diag([3.0, 4.0, 5.0])])
def test_possible_inertias_pass(m, inertia):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        m.body("c", mass=1.0, inertia=inertia)


def test_planar_inertia_warns(m):
    with pytest.warns(MbrsWarning, match=r"c.inertia \(0, 0, 2\) is planar data") as caught:
        m.body("c", mass=1.0, inertia=(0, 0, 2.0))
    assert m.value("c.inertia")[2, 2] == 2.0
    with pytest.warns(MbrsWarning, match="planar data") as again:
        m.set({"c.inertia": (0, 0, 3.0)})
    assert [w.filename for w in (*caught, *again)] == [__file__] * 2


def test_a_parameter_may_not_drive_a_body_out_of_existence(m):
    m.body("c", mass=m["k"] - 1.0, inertia=(1, 1, 1))
    m.set({"k": 1.5})
    with pytest.raises(InertiaError, match=r"c\.mass"):
        m.set({"k": 0.5})
    assert m.value("k") == 1.5 and m.value("c.mass") == 0.5


def test_a_set_may_not_collapse_a_spring(m):
    m.spring_damper("s", "a", "b", at=PAIR, k=1.0)
    with pytest.raises(ModelError, match="coincident"):
        m.set({"s.at_b": (0, 0, 0)})
    assert m.value("s.at_b").tolist() == [0, 0, 1]


CORRECT = {
    "body": BODY,
    "marker": {"body": "a", "at": (0, 0, 0)},
    "parameter": {"value": 1.0},
    **{joint: {"a": "a", "b": "b", "at": (0, 0, 0)} for joint in ("fixed", "spherical", "free")},
    **{
        joint: {"a": "a", "b": "b", "at": (0, 0, 0), "axis": "z"}
        for joint in ("revolute", "prismatic", "cylindrical", "planar", "knife_edge", "point_on_line")
    },
    "universal": {"a": "a", "b": "b", "at": (0, 0, 0), "axis": "z", "axis2": "x"},
    "distance": {"a": "a", "b": "b", "at": PAIR},
    "screw": {"a": "a", "b": "b", "at": (0, 0, 0), "axis": "z", "pitch": 0.01},
    "rolling_disc": {"a": "a", "b": "b", "at": PAIR, "axis": "z", "axis2": "x", "radius": 0.1},
    "spring_damper": {"a": "a", "b": "b", "at": PAIR, "k": 1.0},
    "bushing": {"a": "a", "b": "b", "at": (0, 0, 0), "k": (1,) * 6},
    "torsion": {"a": "a", "b": "b", "at": (0, 0, 0), "axis": "z", "k": 1.0},
    "force": {"body": "a", "value": (1, 0, 0)},
    "torque": {"body": "a", "value": (1, 0, 0)},
}


@pytest.mark.some(5)
@pytest.mark.parametrize("method", CORRECT)
def test_junk_in_any_argument_is_refused_in_words_or_fits(method):
    """Nothing but our own errors may come out, and what is taken must give finite Tables that survive a file."""
    refused = taken = 0
    for argument in inspect.signature(getattr(Model, method)).parameters:
        for junk in JUNK:
            if argument == "self":
                continue
            m = Model("m")
            m.body("a", **BODY)
            m.body("b", **BODY)
            before = tables(m)
            given = {"name": "new", **CORRECT[method], argument: junk}
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", MbrsWarning)
                    getattr(m, method)(**given)
            except MbrsError:
                refused += 1
                assert not same_tables(before, tables(m)), (argument, junk)
            else:
                taken += 1
                assert np.isfinite(tables(m)["x"]).all(), (argument, junk)
                if argument != "name":
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore", MbrsWarning)
                        assert not same_tables(tables(m), tables(loads(dumps(m)))), (argument, junk)
    assert refused > 50 and taken > 2


@pytest.mark.parametrize(
    "address", ["a.mass", "a.at", "a.at[0]", "a.inertia", "a.orientation", "k", "V", "s.length", "gravity"]
)
def test_junk_in_set_is_refused_in_words_or_fits(address):
    for junk in JUNK:
        m = Model("m", gravity=(0, 0, 1))
        m.body("a", **BODY)
        m.parameter("k", 1.0)
        m.parameter("V", (1.0, 2.0, 3.0))
        m.spring_damper("s", m.ground, "a", at=PAIR, k=m["k"])
        before = tables(m)
        try:
            m.set({address: junk})
        except MbrsError:
            assert not same_tables(before, tables(m)), junk
        else:
            assert np.isfinite(tables(m)["x"]).all(), junk
        for wrong in (junk, f"a.{junk}", f"a.at[{junk}]"):
            try:
                m.set({wrong: 1.0})
            except (MbrsError, TypeError) as error:
                assert isinstance(error, MbrsError) or "unhashable" in str(error)


def test_unknown_names_among_many_are_found_quickly():
    m = Model("many")
    for i in range(3000):
        m.body(f"B{i}", **BODY)
    with pytest.raises(NameNotFoundError, match="did you mean 'B"):
        m.fixed("j", "B1x", "B2", at=(0, 0, 0))


def test_unattached_bodies_and_loads_without_joints_are_fine():
    assert len(tables(everything())["body_x"]) == 4
