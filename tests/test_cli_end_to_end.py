"""The command line on real models: the isolator's closed form, and the page of the demo.

Most calls are made in this process; the demo and `check` run as the shell runs them.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import re
import subprocess
import sys
import warnings
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
from click.testing import CliRunner, Result
from mbrs.cli import main

# Isolator of docs/theory.md (23.1): six legs along the edges of a cube give 2 k in every direction and 2 c likewise.
K, C, M = 2e5, 60.0, 20.0


def _mbrs(*arguments: str, cwd: Path, code: int = 0) -> Result:
    with contextlib.chdir(cwd), warnings.catch_warnings():
        done = CliRunner().invoke(main, list(arguments))
    assert done.exit_code == code and isinstance(done.exception, (SystemExit, type(None))), done.output
    return done


def _shell(*arguments: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "COLUMNS": "120", **environment}
    done = subprocess.run(
        [sys.executable, "-m", "mbrs.cli", *arguments], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    return done


@pytest.fixture
def isolator(tmp_path: Path) -> Path:
    mb.examples.cubic_hexapod().save(tmp_path / "isolator.toml")
    return tmp_path


def test_check_tells_degrees_of_freedom_and_effects(isolator: Path) -> None:
    text = _shell("check", "isolator.toml", cwd=isolator).stdout
    assert "payload" in text or "1 bod" in text
    assert "damping" in text and "gravity" in text
    data = json.loads(_mbrs("check", "isolator.toml", "--json", cwd=isolator).stdout)
    on = {effect["name"] for effect in data["effects"] if effect["on"]}
    assert on == {"damping"} and data["dof"] == 6 and data["n_bodies"] == 1


def test_modal_gives_the_closed_form(isolator: Path) -> None:
    data = json.loads(_mbrs("modal", "isolator.toml", "--n", "6", "--json", cwd=isolator).stdout)
    f = np.sqrt(K / M) / (2 * np.pi)
    expected = f * np.array([1, 1, 1, np.sqrt(4 / 3), np.sqrt(4 / 3), np.sqrt(16 / 3)])
    assert data["frequency"] == pytest.approx(expected, rel=1e-10)
    assert data["damping"][0] == pytest.approx(C / (2 * np.sqrt(K * M)), rel=1e-9)
    assert data["stats"]["counts"]
    table = _mbrs("modal", "isolator.toml", cwd=isolator).stdout
    assert "15.915" in table and "36.755" in table


def test_leaving_damping_out_changes_the_result(isolator: Path) -> None:
    data = json.loads(_mbrs("modal", "isolator.toml", "--without", "damping", "--json", cwd=isolator).stdout)
    assert data["damping"] == pytest.approx([0.0] * 6, abs=1e-12)


def test_frf_gives_the_closed_form(isolator: Path) -> None:
    ports = ["--input", "payload.force.z", "--output", "payload.motion.z"]
    done = _mbrs("frf", "isolator.toml", *ports, "--frequency", "1:200:50", "--json", cwd=isolator)
    data = json.loads(done.stdout)
    w = 2 * np.pi * np.linspace(1, 200, 50)
    value = np.array(data["value"]["re"])[0, 0] + 1j * np.array(data["value"]["im"])[0, 0]
    assert value == pytest.approx(1 / (K - w**2 * M + 1j * w * C), rel=1e-9)
    base = ["--input", "base.z", "--output", "payload.motion.z"]
    data = json.loads(_mbrs("frf", "isolator.toml", *base, "--frequency", "5,20", "--json", cwd=isolator).stdout)
    w = 2 * np.pi * np.array([5.0, 20.0])
    value = np.array(data["value"]["re"])[0, 0] + 1j * np.array(data["value"]["im"])[0, 0]
    assert value == pytest.approx((K + 1j * w * C) / (K - w**2 * M + 1j * w * C), rel=1e-9)


def test_sens_gives_the_closed_form(isolator: Path) -> None:
    arguments = ["--parameter", "k_leg", "--parameter", "payload.mass", "--json"]
    data = json.loads(_mbrs("sens", "isolator.toml", *arguments, cwd=isolator).stdout)
    f = np.sqrt(K / M) / (2 * np.pi)
    assert data["frequency"][0] == pytest.approx([f / (2 * 1e5), -f / (2 * M)], rel=1e-8)


def test_pages_are_written(isolator: Path) -> None:
    _mbrs("modal", "isolator.toml", "--out", "modes.html", cwd=isolator)
    page = (isolator / "modes.html").read_text(encoding="utf-8")
    assert "mbrsViewer" in page and "36.755" in page and "://" not in page
    _mbrs("sens", "isolator.toml", "--parameter", "k_leg", "--out", "sens.html", cwd=isolator)
    assert "<svg" in (isolator / "sens.html").read_text(encoding="utf-8")


def test_netcdf_and_pickle_come_back(isolator: Path) -> None:
    ports = ["--input", "payload.force.z", "--output", "payload.motion.z", "--frequency", "1,5"]
    _mbrs("frf", "isolator.toml", *ports, "--out", "h.pkl", cwd=isolator)
    assert pickle.loads((isolator / "h.pkl").read_bytes()).value.shape == (1, 1, 2)
    pytest.importorskip("h5py")
    xarray = pytest.importorskip("xarray")
    _mbrs("frf", "isolator.toml", *ports, "--out", "h.nc", cwd=isolator)
    with xarray.open_dataset(isolator / "h.nc", engine="h5netcdf") as data:
        w = 2 * np.pi * np.array([1.0, 5.0])
        assert data["H"].values[0, 0] == pytest.approx(1 / (K - w**2 * M + 1j * w * C), rel=1e-9)


def test_a_wrong_name_is_one_clear_message(isolator: Path) -> None:
    done = _mbrs("sens", "isolator.toml", "--parameter", "k_lag", cwd=isolator, code=1)
    assert done.stdout == "" and "k_lag" in done.stderr and "k_leg" in done.stderr
    (isolator / "bad.toml").write_text("[[body]\n")
    assert "bad.toml" in _mbrs("modal", "bad.toml", cwd=isolator, code=1).stderr


def test_the_demo_works_with_the_base_install(tmp_path: Path) -> None:
    """xarray is made impossible to import: the demo must not miss it."""
    blocker = "import sys; sys.modules['xarray'] = None\n"
    (tmp_path / "sitecustomize.py").write_text(blocker)
    path = os.pathsep.join([str(tmp_path), *(p for p in sys.path if p)])
    done = _shell("demo", cwd=tmp_path, PYTHONPATH=path)
    assert "15.915" in done.stdout and "k_leg" in done.stdout and "wrote mbrs-demo.html" in done.stdout
    page = (tmp_path / "mbrs-demo.html").read_text(encoding="utf-8")
    assert page.count("<svg") >= 3 and "mbrsViewer" in page
    assert not re.search(r"https?:|src=(?!\"data:)|@import", page)


@pytest.fixture
def clearance(tmp_path: Path) -> Path:
    mb.examples.clearance_oscillator().save(tmp_path / "clearance.toml")
    return tmp_path


NLFR = ("nlfr", "clearance.toml", "--input", "mass.force.x", "--amplitude", "3", "--output", "mass.motion.x")


def test_nlfr_is_the_curve_of_the_package(clearance: Path) -> None:
    data = json.loads(_mbrs(*NLFR, "--frequency", "5:25", "--harmonics", "1,3,5,7", "--json", cwd=clearance).stdout)
    curve = mb.frequency_response(
        mb.Model.load(clearance / "clearance.toml"),
        inputs="mass.force.x",
        amplitude=3.0,
        frequency=(5, 25),
        harmonics=[1, 3, 5, 7],
    )
    assert data["amplitude"][0] == pytest.approx(curve.amplitude("mass.motion.x").tolist(), rel=1e-9)
    assert [e["kind"] for e in data["events"]] == ["fold", "fold"] and data["status"] == "converged"
    assert data["stable"].count(False) == int(np.sum(~curve.stable))
    text = _mbrs(*NLFR, "--frequency", "5:25", "--harmonics", "1,3,5,7", cwd=clearance).stdout
    assert "fold" in text and "|mass.motion.x|" in text


def test_nlfr_follows_the_level_and_sweeps_down(clearance: Path) -> None:
    level = json.loads(
        _mbrs(*NLFR, "--frequency", "14", "--level", "0.1:2", "--harmonics", "5", "--json", cwd=clearance).stdout
    )
    assert level["level"][0] == pytest.approx(0.1) and set(level["frequency"]) == {14.0}
    down = json.loads(_mbrs(*NLFR, "--frequency", "5:25", "--down", "--harmonics", "5", "--json", cwd=clearance).stdout)
    assert down["frequency"][0] == 25.0 and [e["kind"] for e in down["events"]] == ["fold", "fold"]


def test_nlfr_writes_a_page_and_refuses_nonsense(clearance: Path) -> None:
    _mbrs(*NLFR, "--frequency", "5:25", "--harmonics", "5", "--out", "page.html", cwd=clearance)
    page = (clearance / "page.html").read_text()
    # the unstable part is drawn dashed in the colour of the stable one, the grid has another
    drawn = re.findall(r'style="fill: none; (stroke-dasharray: [^;]+; )?[^"]*stroke: (#1f5fa8)', page)
    assert {bool(dashes) for dashes, _ in drawn} == {True, False}
    assert "neither auto" in _mbrs(*NLFR, "--frequency", "5:25", "--harmonics", "x", cwd=clearance, code=2).stderr
    assert "not a factor" in _mbrs(*NLFR, "--frequency", "5:25", "--level", "a", cwd=clearance, code=2).stderr
    assert "2 for 1" in _mbrs(*NLFR, "--amplitude", "3", "--frequency", "5:25", cwd=clearance, code=2).stderr
    wrong = _mbrs("nlfr", "clearance.toml", "--input", "mas.force.x", "--output", "rail", "--frequency", "5:6",
                  cwd=clearance, code=1).stderr  # fmt: skip
    assert "did you mean" in wrong and "mass" in wrong


def test_simulate_is_the_motion_of_the_package(tmp_path: Path) -> None:
    m = mb.examples.four_bar()
    m.save(tmp_path / "four_bar.toml")
    call = ("simulate", "four_bar.toml", "--t", "0:0.4:9", "--rtol", "1e-8", "--output", "P2", "--output", "A")
    data = json.loads(_mbrs(*call, "--json", cwd=tmp_path).stdout)
    traj = mb.simulate(m, t=np.linspace(0.0, 0.4, 9), rtol=1e-8)
    assert data["outputs"]["P2"] == pytest.approx(traj.point("P2"), abs=1e-12)
    assert data["outputs"]["A"] == pytest.approx(traj.joint("A"), abs=1e-12)
    assert data["status"] == "finished" and data["stats"]["counts"] == traj.stats.counts
    text = _mbrs("simulate", "four_bar.toml", "--t", "0.1", "--out", "run.html", cwd=tmp_path).stdout
    assert "coupler.x" in text and "constraints hold" in text
    assert "<html" in (tmp_path / "run.html").read_text().lower()


def test_simulate_refuses_nonsense(tmp_path: Path) -> None:
    mb.examples.four_bar().save(tmp_path / "m.toml")
    for times in ("x", "1:2", "0:1:2.5", "nan", ""):
        assert "is not a valid time" in _mbrs("simulate", "m.toml", "--t", times, cwd=tmp_path, code=2).stderr
    wrong = _mbrs("simulate", "m.toml", "--t", "0.1", "--output", "crnk", cwd=tmp_path, code=1).stderr
    assert "crnk" in wrong
    refused = _mbrs("simulate", "m.toml", "--t", "0.1", "--method", "euler", cwd=tmp_path, code=1).stderr
    assert "no method 'euler'" in refused and "generalized-alpha" in refused
