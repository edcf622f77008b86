"""Junk as an argument of a method of a result of harmonic balance: an error of mbrs that names it, or it is taken."""

from __future__ import annotations

import re

import mbrs as mb
import numpy as np
import pytest
from junk import JUNK
from mbrs.errors import FileError, MbrsError, ModelError


def duffing(k3=0.1):
    return mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(k3, w=[1.0])])


@pytest.fixture(scope="module")
def made():
    branch = mb.Branch(duffing(), force=[0.1], omega=(0.5, 1.0))
    branch.run(3)
    pair = [dict(force=[0.1], omega=1.0), dict(force=[0.1], omega=2**0.5)]
    return {
        "branch": branch,
        "one": mb.harmonic_balance(duffing(), force=[0.1], omega=0.6, harmonics=3),
        "curve": mb.frequency_response(duffing(), force=[0.1], omega=(0.5, 0.6), harmonics=3, max_points=3),
        "torus": mb.quasi_periodic(duffing(), pair, harmonics=2),
        "tori": mb.quasi_periodic_response(duffing(), pair, scale=(1.0, 1.01), harmonics=2),
        "parameter": mb.parameter_response(duffing, value=(0.1, 0.11), force=[0.1], omega=0.6, harmonics=3),
    }


# An argument of a method, and what an error names.
ARGUMENTS = {
    "branch.switch": (lambda m, x: m["branch"].switch(x), "event"),
    "branch.point": (lambda m, x: m["branch"].point(x), "point"),
    "branch.run": (lambda m, x: m["branch"].run(x), "max_points"),
    "one.displacement": (lambda m, x: m["one"].displacement(x), "t "),
    "one.velocity": (lambda m, x: m["one"].velocity(x), "t "),
    "torus.displacement": (lambda m, x: m["torus"].displacement(x), "t "),
    "torus.velocity": (lambda m, x: m["torus"].velocity(x), "t "),
    "curve.point": (lambda m, x: m["curve"].point(x), "point"),
    "tori.point": (lambda m, x: m["tori"].point(x), "point"),
    "parameter.point": (lambda m, x: m["parameter"].point(x), "point"),
    "curve.at": (lambda m, x: m["curve"].at(x), "event"),
    "parameter.at": (lambda m, x: m["parameter"].at(x), "event"),
    "curve.place": (lambda m, x: m["curve"].place(x), "event"),
    "parameter.place": (lambda m, x: m["parameter"].place(x), "event"),
    "curve.event_amplitude": (lambda m, x: m["curve"].event_amplitude(x), "event"),
    "curve.resume": (lambda m, x: m["curve"].resume(x), "max_points"),
    "parameter.resume": (lambda m, x: m["parameter"].resume(x), "max_points"),
    "one.save": (lambda m, x: m["one"].save(x), "path|cannot"),
    "curve.save": (lambda m, x: m["curve"].save(x), "path|cannot"),
    "load": (lambda m, x: mb.load(x), "path|cannot"),
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_junk_is_named(name, made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, named = ARGUMENTS[name]
    for junk in [None, 3, 10**9, -(10**9), "a", b"a", [1], [[1, 2], [3]], np.nan, {}, object(), *JUNK]:
        if name.endswith(("run", "resume")) and isinstance(junk, int) and not isinstance(junk, bool) and junk > 3:
            continue  # so many points are no mistake
        try:
            call(made, junk)
        except ModelError as problem:
            assert re.search(named, str(problem)), (junk, str(problem))
            assert "constant term" not in str(problem)


@pytest.mark.parametrize("ending", [".nc", ".json", ".csv", ".pkl"])
def test_a_folder_that_is_not_there_is_named(ending, made, tmp_path):
    path = tmp_path / "absent" / f"x{ending}"
    with pytest.raises(FileError, match=r"cannot write .*absent.*give a path in a folder that is there") as caught:
        made["one"].save(path)
    assert (
        isinstance(caught.value, MbrsError) and isinstance(caught.value, OSError) and caught.value.filename == str(path)
    )


def test_paths_of_models_and_bodies_are_checked(tmp_path):
    m = mb.examples.cubic_hexapod()
    for call in (m.save, mb.Model.load, mb.modes(m).save):
        with pytest.raises(ModelError, match="path must be the path of a file"):
            call(None)
    with pytest.raises(FileError, match="folder that is there"):
        m.save(tmp_path / "absent" / "m.toml")


def test_the_last_points_are_counted_from_the_end(made):
    for name in ("branch", "curve", "tori", "parameter"):
        one = made[name]
        n = len(one.chunks) if name == "branch" else len(one)
        assert np.array_equal(one.point(-1).X, one.point(n - 1).X) and not np.array_equal(
            one.point(-1).X, one.point(0).X
        )
