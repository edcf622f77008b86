"""The command line with stand-in analyses: usage, exit codes, JSON, files."""

from __future__ import annotations

import importlib
import json
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result
from mbrs.cli import main, parse_frequency
from mbrs.errors import MbrsWarning, NameNotFoundError
from small_results import isolator_modes, isolator_sensitivity, row_frf


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[str, tuple[Any, ...], dict[str, Any]]]:
    """Stand-ins for the public analyses; records what they were called with."""
    mb = importlib.import_module("mbrs")
    made: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = []

    def stub(name: str, result: Any) -> None:
        def call(*args: Any, **keywords: Any) -> Any:
            made.append((name, args, keywords))
            if isinstance(result, BaseException):
                raise result
            return result

        monkeypatch.setattr(mb, name, call, raising=False)

    results = {
        "modes": isolator_modes(),
        "frf": row_frf(),
        "sensitivity": isolator_sensitivity(),
        "equilibrium": "rest",
    }
    for name, result in results.items():
        stub(name, result)
    stub("effects", [SimpleNamespace(name="damping", on=np.True_, why="c was given")])
    stub("System", SimpleNamespace(dof=6))
    load = staticmethod(lambda path, functions=False: f"model of {Path(path).name}")
    monkeypatch.setattr(mb, "Model", type("Model", (), {"load": load}), raising=False)
    monkeypatch.chdir(tmp_path)
    Path("m.toml").write_text("")
    return made


def _run(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments))


def test_modal_prints_a_table_and_passes_options_on(calls: list[Any]) -> None:
    result = _run("modal", "m.toml", "--n", "20", "--without", "damping", "--without", "gravity", "--at", "equilibrium")
    assert result.exit_code == 0 and result.stdout == f"{isolator_modes()}\n"
    assert calls[-1] == ("modes", ("model of m.toml",), {"at": "rest", "without": ("damping", "gravity"), "n": 20})


def test_json_is_all_that_is_printed(calls: list[Any]) -> None:
    data = json.loads(_run("modal", "m.toml", "--json").stdout)
    assert (
        data["analysis"] == "modal" and data["frequency"][5] == pytest.approx(36.7553, abs=5e-5) and "shape" not in data
    )
    assert len(json.loads(_run("modal", "m.toml", "--json", "--shapes").stdout)["shape"]) == 6
    effects = [{"name": "damping", "on": True, "why": "c was given"}]
    checked = json.loads(_run("check", "m.toml", "--json").stdout)
    assert checked == {"analysis": "check", "file": "m.toml", "dof": 6, "effects": effects}


def test_frf_passes_ports_and_frequencies_on(calls: list[Any]) -> None:
    result = _run("frf", "m.toml", "--input", "p.force.z", "--output", "p.motion.z", "--output", "p.motion.x",
                  "--frequency", "1:200", "--json")  # fmt: skip
    assert result.exit_code == 0
    passed = calls[-1][2]
    assert passed["inputs"] == ["p.force.z"] and passed["outputs"] == ["p.motion.z", "p.motion.x"]
    assert passed["frequency"] == (1.0, 200.0) and passed["kind"] == "receptance"
    value = json.loads(result.stdout)["value"]
    assert np.array(value["re"]).shape == np.array(value["im"]).shape == (1, 1, 800)
    _run("frf", "m.toml", "--input", "base.z", "--output", "p.motion.z", "--frequency", "5")
    assert calls[-1][2]["kind"] == "transmissibility" and calls[-1][2]["frequency"].tolist() == [5.0]


def test_sens_asks_for_every_parameter(calls: list[Any]) -> None:
    result = _run("sens", "m.toml", "--parameter", "k_leg", "--parameter", "p.inertia[0,1]", "--n", "3")
    assert result.exit_code == 0 and result.stdout == f"{isolator_sensitivity()}\n"
    assert calls[-2][0] == "modes" and calls[-2][2] == {"n": 3}
    assert calls[-1][1][1] == ["k_leg", "p.inertia[0,1]"]


def test_out_chooses_the_format_by_its_ending(calls: list[Any]) -> None:
    assert "wrote r.json" in _run("modal", "m.toml", "--out", "r.json").stderr
    assert importlib.import_module("mbrs").load("r.json").damping.tolist() == isolator_modes().damping.tolist()
    _run("modal", "m.toml", "--out", "r.html")
    assert "mbrsViewer" in Path("r.html").read_text()
    _run("frf", "m.toml", "--input", "a.force.z", "--output", "a.motion.z", "--frequency", "1:60:5", "--out", "f.html")
    assert Path("f.html").read_text().count("<svg") == 1
    _run("sens", "m.toml", "--parameter", "k_leg", "--out", "s.html")
    assert "payload.mass" in Path("s.html").read_text()
    _run("sens", "m.toml", "--parameter", "k_leg", "--out", "s.pkl")
    assert pickle.loads(Path("s.pkl").read_bytes()).parameters[0] == "k_leg"


@pytest.mark.parametrize("name", ["a.png", "a.toml", "a", "a.JSONL", "a.nc.gz"])
def test_an_unknown_ending_is_refused_before_anything_is_computed(calls: list[Any], name: str) -> None:
    result = _run("modal", "m.toml", "--out", name)
    assert result.exit_code == 2 and calls == [] and not Path(name).exists()
    assert all(ending in result.stderr.replace("\n", " ") for ending in (".nc", ".json", ".csv", ".pkl", ".html"))


def test_a_file_that_cannot_be_written_is_one_message(calls: list[Any]) -> None:
    result = _run("modal", "m.toml", "--out", "absent/r.json")
    assert result.exit_code == 1 and "cannot write absent/r.json: No such file" in result.stderr


def test_a_format_that_needs_an_extra_names_it(calls: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def save(*_: Any) -> None:
        raise ModuleNotFoundError("No module named 'xarray'", name="xarray")

    monkeypatch.setattr(type(isolator_sensitivity()), "save", save)
    result = _run("sens", "m.toml", "--parameter", "k_leg", "--out", "r.nc")
    assert result.exit_code == 1 and "pip install 'mbrs-dynamics[xarray]'" in result.stderr


def test_errors_of_mbrs_are_one_message_and_exit_code_1(calls: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise NameNotFoundError("no parameter is called 'k_lag' [in m]; did you mean 'k_leg'?")

    monkeypatch.setattr("mbrs.sensitivity", fail)
    result = _run("sens", "m.toml", "--parameter", "k_lag")
    assert result.exit_code == 1 and result.stdout == ""
    assert result.stderr == "error: no parameter is called 'k_lag' [in m]; did you mean 'k_leg'?\n"


def test_ctrl_c_gives_130(calls: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mbrs.modes", interrupt)
    result = _run("modal", "m.toml")
    assert result.exit_code == 130 and "Traceback" not in result.stderr


def test_an_interrupted_result_is_printed_and_saved_and_gives_130(tmp_path: Path) -> None:
    """The motion so far, from the file of a real model; the time of the interrupt is that of a function of the model."""
    mb = importlib.import_module("mbrs")
    mb.examples.four_bar().save(tmp_path / "m.toml")
    whole, simulate = [], mb.simulate

    def cut(m: Any, **options: Any) -> Any:
        whole.append(simulate(m, **options))
        raise mb.Interrupted("the motion was interrupted at t = 0.02 s", whole[0])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mb, "simulate", cut)
        out = tmp_path / "cut.json"
        result = _run("simulate", str(tmp_path / "m.toml"), "--t", "0.02", "--out", str(out))
    assert result.exit_code == 130 and "interrupted at t = 0.02 s; this is the result so far" in result.stderr
    assert str(whole[0]) in result.stdout and mb.load(out).t.tolist() == whole[0].t.tolist()


def test_fewer_modes_than_asked_for_are_told(calls: list[Any]) -> None:
    found = len(importlib.import_module("mbrs").modes("m").eigenvalue)
    assert f"asked for {found + 1} modes; there are {found}" in _run("modal", "m.toml", "--n", str(found + 1)).stderr
    assert _run("modal", "m.toml", "--n", str(found)).stderr == ""


def test_the_state_of_a_motion_is_its_start() -> None:
    assert "State from which the motion starts." in _run("simulate", "--help").stdout
    assert "State about which the model is linearised." in _run("modal", "--help").stdout


def test_a_bug_is_not_dressed_up_as_a_user_error(calls: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def bug(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("inside")

    monkeypatch.setattr("mbrs.modes", bug)
    assert isinstance(_run("modal", "m.toml").exception, ZeroDivisionError)


def test_warnings_are_one_line_each(calls: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def warn(*_: Any, **__: Any) -> str:
        warnings.warn("the grid misses 2 resonances", MbrsWarning, stacklevel=2)
        return "table"

    monkeypatch.setattr("mbrs.frf", warn)
    with warnings.catch_warnings():
        result = _run("frf", "m.toml", "--input", "base.z", "--output", "p.motion.z", "--frequency", "5")
    assert result.stderr == "warning: the grid misses 2 resonances\n" and result.stdout == "table\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ["modal", "absent.toml"],
        ["modal"],
        ["modal", "m.toml", "--n", "0"],
        ["modal", "m.toml", "--at", "moon"],
        ["frf", "m.toml", "--input", "a", "--output", "b"],
        ["frf", "m.toml", "--input", "a", "--output", "b", "--frequency", "200:1"],
        ["frf", "m.toml", "--input", "a", "--output", "b", "--frequency", "1:2:1.5"],
        ["frf", "m.toml", "--input", "a", "--output", "b", "--frequency", "1:2:3:4"],
        ["frf", "m.toml", "--input", "a", "--output", "b", "--frequency", "nan"],
        ["frf", "m.toml", "--input", "a", "--output", "b", "--frequency", ""],
        ["sens", "m.toml"],
        ["nonsense"],
    ],
)
def test_wrong_usage_gives_2(calls: list[Any], arguments: list[str]) -> None:
    result = _run(*arguments)
    assert result.exit_code == 2 and "Error" in result.stderr
    assert calls == []


def test_frequencies_are_read() -> None:
    assert parse_frequency("1:200") == (1.0, 200.0)
    assert parse_frequency("0:10:11").tolist() == list(range(11))
    assert parse_frequency("1,2.5,1e2").tolist() == [1.0, 2.5, 100.0]
    with pytest.raises(click.BadParameter, match="write 1:200"):
        parse_frequency("1-200")


def test_help_is_quick_to_import() -> None:
    code = "import sys, mbrs.cli; assert not {'scipy', 'matplotlib', 'rich'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})


def test_convert_writes_what_the_ending_says(tmp_path: Path) -> None:
    mb = importlib.import_module("mbrs")
    m = mb.Model("one", gravity=(0.3, -9.0, 1.0))
    m.revolute(
        "hinge",
        m.ground,
        m.body("rod", mass=1.7, inertia=(0.1, 0.2, 0.25), at=(0.1, 0.2, 0.3)),
        at=(0, 0, 0),
        axis=(1, 2, 3),
    )
    m.save(tmp_path / "a.toml")
    done = _run("convert", str(tmp_path / "a.toml"), str(tmp_path / "b.urdf"))
    assert done.exit_code == 0 and "wrote" in done.stderr and "gravity: model 'one'" in " ".join(done.stderr.split())
    pytest.importorskip("lxml")
    assert _run("convert", str(tmp_path / "b.urdf"), str(tmp_path / "c.toml")).exit_code == 0
    again = mb.Model.load(tmp_path / "c.toml")
    assert again.value("rod.mass") == 1.7 and again.joints[0].type == "revolute"
    for out, text in (("d.stl", "known are .toml, .urdf"), ("d.xml", "(MJCF) is only read")):
        failed = _run("convert", str(tmp_path / "a.toml"), str(tmp_path / out))
        assert failed.exit_code == 1 and text in failed.stderr and not (tmp_path / out).exists()


def test_functions_of_a_file_are_imported_when_asked_for(tmp_path):
    import mbrs as mb
    from click.testing import CliRunner
    from mbrs.cli import main

    path = mb.examples.quarter_car().save(tmp_path / "car.toml")
    refused = CliRunner().invoke(main, ["check", str(path)])
    assert refused.exit_code == 1
    done = CliRunner().invoke(main, ["check", "--functions", str(path)])
    assert done.exit_code == 0 and "degrees of freedom" in done.output
