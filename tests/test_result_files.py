"""Files of results: they give back the same object, which goes on; damaged or made by hand they are named."""

from __future__ import annotations

import csv
import hashlib
import json
import pickle
import sys

import every_result
import mbrs as mb
import numpy as np
import pytest
from every_result import drawn
from mbrs.results import Result

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
ALL = pytest.mark.parametrize("name", every_result.MAKE)


@pytest.fixture
def results():
    """Results whose estimates are known: a file keeps what was known when it was saved."""

    def known(name):
        found = every_result.made(name)
        assert found.status
        return found

    return known


def _same(one, other):
    assert type(one) is type(other) and str(one) == str(other) and repr(one) == repr(other)
    assert one.stats == other.stats and one.status == other.status
    mine, its = one.labelled(), other.labelled()
    assert list(mine) == list(its)
    for quantity, (dims, value, unit, label) in mine.items():
        assert (dims, unit, label) == (its[quantity][0], *its[quantity][2:])
        a, b = np.asarray(value), np.asarray(its[quantity][1])
        assert a.dtype == b.dtype and a.tobytes() == b.tobytes(), quantity


@pytest.mark.some(55)
@ALL
@pytest.mark.parametrize("ending", [".json", ".nc", ".JSON"])
def test_files_give_the_same_object_back(results, name, ending, tmp_path):
    path = results(name).save(tmp_path / f"result{ending}")
    again = mb.load(path)
    _same(results(name), again)
    _same(again, mb.load(again.save(tmp_path / f"again{ending}")))
    assert again.plot().axes


@ALL
def test_pickles_come_back_and_are_never_loaded(results, name, tmp_path):
    path = results(name).save(tmp_path / "result.pkl")
    _same(results(name), pickle.loads(path.read_bytes()))
    with pytest.raises(mb.errors.ModelError, match="a pickle can run any program"):
        mb.load(path)


@ALL
def test_tables_of_numbers_are_complete(results, name, tmp_path):
    columns = results(name).columns()
    lines = list(csv.reader((results(name).save(tmp_path / "result.csv")).read_text().splitlines()))
    assert lines[0] == list(columns)
    for place, column in enumerate(columns.values()):
        texts = [line[place] for line in lines[1:]]
        if column.dtype.kind in "fiu":
            assert np.array_equal(np.array([float(x) for x in texts]), column, equal_nan=True)
        else:
            assert texts == [str(x) for x in column.tolist()]
    with pytest.raises(mb.errors.ModelError, match=r"is only written; known are \.json, \.nc"):
        mb.load(tmp_path / "result.csv")


@pytest.mark.parametrize("name", ["a.png", "a", "a.txt", "a.toml", "a.nc4", "a.pickle", ".nc"])
def test_unknown_endings_are_refused_and_the_known_ones_listed(results, name, tmp_path):
    with pytest.raises(mb.errors.ModelError, match=r"known are \.csv, \.fmu, \.json, \.nc, \.parquet, \.pkl"):
        results("ModalResult").save(tmp_path / name)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".json", ".nc"])
def test_a_loaded_result_goes_on(results, ending, tmp_path):
    def loaded(name):
        return mb.load(results(name).save(tmp_path / f"{name}{ending}"))

    modes = loaded("ModalResult")
    derivative = mb.sensitivity(results("ModalResult"), ["k", "b.mass"]).frequency
    assert np.array_equal(mb.sensitivity(modes, ["k", "b.mass"]).frequency, derivative)
    assert "mbrsViewer" in modes.animate().html()
    rest = loaded("Equilibrium")
    assert np.array_equal(
        mb.modes(rest.model, at=rest).eigenvalue, mb.modes(rest.model, at=mb.equilibrium(drawn())).eigenvalue
    )
    assert list(rest.reactions) == ["A", "B"]
    h = mb.sensitivity(loaded("FrfResult"), ["k"])
    assert np.array_equal(h.value, mb.sensitivity(results("FrfResult"), ["k"]).value)
    curve = loaded("FrequencyResponse").resume(5)
    # the last point is found again, as the first of the new ones
    assert curve.omega[:12] == pytest.approx(results("FrequencyResponse").omega, rel=1e-9) and len(curve) == 17
    assert curve.point(16).verify(full=False).balanced < 1e-6
    motion = loaded("Trajectory")
    assert motion.error == results("Trajectory").error > 0.0
    on = mb.simulate(motion.model, t=[0.4, 0.5], at=motion.state(0.4))
    assert np.array_equal(
        on.position("b"), mb.simulate(drawn(), t=[0.4, 0.5], at=results("Trajectory").state(0.4)).position("b")
    )


def test_a_model_that_changed_since_keeps_the_numbers_of_the_result(tmp_path):
    m = drawn()
    rest = mb.equilibrium(m)
    text = str(rest)
    m.set({"k": 91.0})
    again = mb.load(rest.save(tmp_path / "rest.json"))
    assert str(again) == text and again.model.value("k") == 91.0
    with pytest.raises(mb.errors.ModelError, match="was changed after"):
        mb.sensitivity(again, ["k"])


def test_python_functions_of_a_model_are_imported_when_asked_for_only(tmp_path, monkeypatch):
    (tmp_path / "pulls.py").write_text("CALLS = []\ndef pull(t):\n    return (0.3 * t, 0.0, 0.0)\n")
    monkeypatch.syspath_prepend(tmp_path)
    import pulls

    m = drawn()
    m.force("f", "b", at=(0.71, 0.23, -0.31), value=pulls.pull)
    motion = mb.simulate(m, t=[0.0, 0.1])
    path = motion.save(tmp_path / "motion.json")
    monkeypatch.delitem(sys.modules, "pulls")
    with pytest.raises(mb.errors.ModelError, match="functions=True"):
        mb.load(path)
    assert "pulls" not in sys.modules
    _same(motion, mb.load(path, functions=True))
    m.force("g", "b", at=(0.71, 0.23, -0.31), value=lambda t: (0.0, t, 0.0))
    with pytest.raises(mb.errors.ModelError, match="to_netcdf"):
        mb.simulate(m, t=[0.0, 0.1]).save(tmp_path / "lambda.json")


@pytest.mark.some(3)
@pytest.mark.parametrize("ending", [".json", ".nc"])
@pytest.mark.parametrize("name", ["ModalResult", "Trajectory", "FrequencyResponse"])
def test_damaged_files_are_named(results, name, ending, tmp_path):
    """Cut, flipped, overwritten, doubled: never another error, never another result."""
    good = results(name).save(tmp_path / f"good{ending}").read_bytes()
    rng = np.random.default_rng(5)
    path = tmp_path / f"bad{ending}"
    for _ in range(150):
        data = bytearray(good)
        kind, place = rng.integers(4), int(rng.integers(len(good)))
        if kind == 0:
            data = data[:place]
        elif kind == 1:
            data[place] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            data[place : place + 40] = rng.bytes(40)
        else:
            data[place:place] = data[: int(rng.integers(1, 200))]
        path.write_bytes(data)
        with pytest.raises(mb.errors.MbrsError, match=r"bad\."):
            mb.load(path)
    for text in (b"", b"{}", b"[]", b"null", rng.bytes(500), b'{"sha256": "', b"\x89HDF\r\n\x1a\n"):
        path.write_bytes(text)
        with pytest.raises(mb.errors.MbrsError, match=r"bad\."):
            mb.load(path)
    with pytest.raises(mb.errors.ModelError, match="cannot read"):
        mb.load(tmp_path / f"absent{ending}")


def _mutated(tree, rng):
    """One entry of a tree replaced by something else."""
    if isinstance(tree, dict | list) and len(tree) and rng.random() < 0.93:
        keys = list(tree) if isinstance(tree, dict) else range(len(tree))
        key = keys[int(rng.integers(len(keys)))]
        copy = dict(tree) if isinstance(tree, dict) else list(tree)
        if rng.random() < 0.05:
            del copy[key]
        else:
            copy[key] = _mutated(tree[key], rng)
        return copy
    junk = [
        None,
        -1,
        10**30,
        1.5,
        "x",
        "os",
        [],
        {},
        {"~": "record", "class": "Popen", "at": 0, "state": {}},
        {"~": "made"},
        [[[]]],
    ]
    return junk[int(rng.integers(len(junk)))]


@pytest.mark.parametrize("mutations", [50, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["ModalResult", "Equilibrium", "FrfResult", "PeriodicSolution", "CampbellResult"])
def test_files_that_were_made_by_hand_end_in_a_result_or_a_named_error(results, name, mutations, tmp_path):
    """With a right checksum around wrong content."""
    text = results(name).save(tmp_path / "good.json").read_text()
    data = json.loads(text)["data"]
    rng = np.random.default_rng(17)
    path, named = tmp_path / "made.json", 0
    for _ in range(mutations):
        body = json.dumps(_mutated(data, rng))
        checksum = hashlib.sha256(body.encode()).hexdigest()
        path.write_text(f'{{"sha256": "{checksum}",\n"data": {body}}}\n')
        try:
            assert isinstance(mb.load(path), Result)
        except mb.errors.MbrsError as reason:
            named += 1
            assert "made.json" in str(reason)
    assert named > mutations / 3


def test_files_carry_format_and_version_and_newer_ones_are_refused(results, tmp_path):
    path = results("ModalResult").save(tmp_path / "a.json")
    data = json.loads(path.read_text())["data"]
    assert data["mbrs"]["format"] == 3 and data["mbrs"]["version"] == mb.__version__
    assert "[[body]]" in path.read_text()
    data["mbrs"]["format"] = 4
    body = json.dumps(data)
    path.write_text(f'{{"sha256": "{hashlib.sha256(body.encode()).hexdigest()}",\n"data": {body}}}\n')
    with pytest.raises(mb.errors.ModelError, match="has the format 4"):
        mb.load(path)
