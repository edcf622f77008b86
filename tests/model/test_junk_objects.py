"""Junk in any argument of what a model is made of: our own errors, short, or it is taken."""

from __future__ import annotations

import inspect
import warnings

import mbrs as mb
import numpy as np
import pytest
from junk import JUNK


def leaning():
    """Two bodies on leaning joints, for objects to be added."""
    m = mb.Model("pendulum", gravity=(0.3, -1.2, -9.1))
    a = m.body("a", mass=1.7, inertia=(0.11, 0.23, 0.19), at=(0.4, -0.3, -0.7))
    b = m.body("b", mass=0.9, inertia=(0.21, 0.13, 0.17), at=(0.9, -0.2, -1.1))
    m.revolute("h", m.ground, a, at=(0.1, 0.2, 0.3), axis=(0.5, -0.7, 0.3))
    m.spherical("s", a, b, at=(0.6, -0.3, -0.9))
    m.marker("p", b, at=(1.1, 0.2, -1.3))
    return m


AXIS = {"a": "a", "b": "b", "at": (0.5, 0.1, -0.2), "axis": (0.3, 0.2, 1.0)}
POINTS = {"a": "ground", "b": "b", "at": ((0, 0, 0), (1.0, 0.3, -0.9))}
OBJECTS = {
    "body": {"mass": 1.0, "inertia": (0.1, 0.12, 0.13)},
    **{kind: AXIS for kind in ("revolute", "prismatic", "cylindrical", "planar", "knife_edge", "point_on_line")},
    **{kind: {k: AXIS[k] for k in ("a", "b", "at")} for kind in ("fixed", "free", "spherical")},
    "screw": AXIS | {"pitch": 0.1},
    "universal": AXIS | {"axis2": (1.0, 0.0, -0.3)},
    "rolling_disc": {"a": "ground", "b": "b", "at": (0.9, -0.2, -1.1), "axis": (0, 1, 0), "radius": 0.3},
    "distance": POINTS,
    "spring_damper": POINTS | {"k": 30.0},
    "torsion": {"a": "a", "b": "b", "axis": (1, 0, 0.2), "k": 3.0},
    "bushing": {k: AXIS[k] for k in ("a", "b", "at")} | {"k": np.arange(1.0, 7.0)},
    "force": {"body": "a", "value": (1.0, 2.0, 3.0)},
    "torque": {"body": "a", "value": (1.0, 2.0, 3.0)},
    "marker": {"body": "a", "at": (0.1, 0.2, 0.3)},
    "parameter": {"value": 3.0},
    "drive": {"joint": "h", "motion": mb.Sine(0.3, 2.0)},
    "coupler": {"first": "h", "second": "s", "ratio": 2.0},
    "constraint": {"fun": lambda t, u: u[0] - u[1], "motions": ["h.rz", "b.motion.x"]},
    "force_law": {"law": lambda t, u, v: -u, "motions": ["a.motion.x", "a.motion.y"]},
}
LAWS = {
    mb.BoucWen: (60.0, 0.3, 40.0, 20.0),
    mb.CoulombTanh: (2.0, 0.1),
    mb.Cubic: (3.0,),
    mb.FunctionLaw: (lambda t, u, v: u,),
    mb.Gap: (1e3, 0.1),
    mb.Hertz: (1e3,),
    mb.Iwan: ([1.0, 2.0], [0.1, 0.2]),
    mb.Jenkins: (10.0, 1.0),
    mb.LuGre: (2.0, 3.0, 0.05, 500.0),
    mb.Maxwell: (80.0, 0.2),
    mb.Polynomial1D: ([1.0, 2.0],),
    mb.TableLaw: ([0.0, 1.0], [0.0, 2.0]),
    mb.VanDerPol: (1.0,),
    mb.VaryingStiffness: (0.4,),
}


def refusals(call, argument, given):
    """How many of the values are refused; all errors are of the family and short. What a function raises is its own affair."""
    refused = 0
    for junk in JUNK:
        if argument == "derivatives" and callable(junk):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                call(**(given | {argument: junk}))
            except mb.MbrsError as problem:
                refused += 1
                assert 15 < len(str(problem)) <= 500, (junk, str(problem))
            except Exception as problem:
                raise AssertionError(f"{junk!r:.60}: {type(problem).__name__}: {problem}") from problem
    return refused


def arguments(call):
    return [name for name in inspect.signature(call).parameters if name not in ("self", "args", "given")]


@pytest.mark.some(6)
@pytest.mark.parametrize("kind", OBJECTS)
def test_an_object_with_junk(kind):
    for argument in arguments(getattr(mb.Model, kind)):
        given = {"name": "new"} | OBJECTS[kind]
        assert refusals(lambda **made: getattr(leaning(), kind)(**made), argument, given) > 5, argument


@pytest.mark.some(4)
@pytest.mark.parametrize("law", LAWS)
def test_a_law_with_junk(law):
    names = arguments(law)
    for argument in names:
        given = dict(zip(names, LAWS[law], strict=False))
        assert refusals(law, argument, given) > 5, argument


def test_long_names_do_not_make_long_messages():
    """Names may have any length; what is said of them is to be read."""
    long = "bracket " * 90
    for kind, given in OBJECTS.items():
        for argument in given:
            with pytest.raises(mb.ModelError) as refused:
                getattr(leaning(), kind)(long, **given | {argument: long})
            assert len(str(refused.value)) <= 500, (kind, argument, str(refused.value))
    m = leaning()
    m.body(long, mass=1.0, inertia=(1, 1, 1))
    assert m.value(f"{long}.mass") == 1.0
