"""The pages of docs/ that teach: their code runs and what they list is there."""

from __future__ import annotations

import re
import runpy

import mbrs as mb
import numpy as np
import pytest
from folders import DOCS
from mbrs._lib import formats
from mbrs.motion.options import METHODS
from mbrs.motion.trajectory import Trajectory

PAGE = (DOCS / "motion.md").read_text()


def test_the_page_on_motion_is_true(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    exec(PAGE.split("```python\n")[1].split("```")[0], scope)
    traj = scope["traj"]
    assert traj.status == "finished" and (tmp_path / "crane.html").exists()
    # 4 m of travel by the end, and the truth is within ten times the estimate
    assert traj.joint("rail")[-1] == pytest.approx(4.0, abs=1e-9)
    fine = mb.simulate(scope["m"], t=traj.t[1:], rtol=1e-12)
    assert np.abs(fine.point("hook") - traj.point("hook")[1:]).max() < 10 * traj.error * 10.0


def test_the_page_on_motion_names_what_exists():
    methods = re.findall(r'^\| "([a-z0-9-]+)" \|', PAGE.split("## Which method")[1].split("##")[0], re.M)
    assert sorted(methods) == sorted(METHODS)
    for name in re.findall(r"`\.(\w+)", PAGE.split("## What a trajectory holds")[1].split("##")[0]):
        fields = {*dir(Trajectory), *Trajectory.__dataclass_fields__, "kinetic", "stored"}
        assert name in fields, name


FILES = DOCS / "files.md"


def test_the_page_on_files_is_true(tmp_path, monkeypatch):
    pytest.importorskip("lxml")
    pytest.importorskip("pyuff")
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    with pytest.warns(mb.OmissionWarning, match="limit: joint 'shoulder'"):
        exec(FILES.read_text().split("```python\n")[1].split("```")[0], scope)
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {"arm.urdf", "arm.toml", "modes.uff", "modes.vtu", "h.uff", "plate.mat"}
    # the stiffness of two torsion springs over the inertia about the hinges, drawn: a 2 x 2 problem
    M = np.array([[3 * 0.2**2 + 0.05 + 2 * (0.4**2 + 0.15**2) + 0.03, 2 * 0.15**2 + 0.03], [2 * 0.15**2 + 0.03] * 2])
    wanted = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, np.diag([4e3, 2e3]))).real)) / (2 * np.pi)
    assert np.allclose(scope["modes"].frequency, wanted, rtol=1e-3)


def test_the_table_of_formats_is_complete():
    rows = re.findall(r"^\| (`\.[^|]*) \|[^|]*\|[^|]*\| (yes)? ?\| (yes)? ?\|", FILES.read_text(), re.M)
    table = {
        ending: (bool(read), bool(write)) for cell, read, write in rows for ending in re.findall(r"`(\.\w+)`", cell)
    }
    known = {ending: [False, False] for ending in table}
    for holds in ("model", "result", "matrices"):
        for i, action in enumerate(("read", "write")):
            for ending in formats.known(holds, action):
                known[ending][i] = True
    assert table == {ending: tuple(found) for ending, found in known.items()}


def test_the_pictures_of_the_conventions_are_drawn(tmp_path, monkeypatch):
    pytest.importorskip("pint")
    monkeypatch.chdir(tmp_path)
    block = (DOCS / "conventions.md").read_text().split("## Pictures")[1].split("```python\n")[1].split("```")[0]
    scope: dict = {}
    exec(block, scope)
    assert (tmp_path / "crane.png").exists() and "wind (force): 80 N, on hook" in (tmp_path / "crane.html").read_text()


def test_the_page_on_measurements_is_true(tmp_path, monkeypatch):
    pytest.importorskip("pyuff")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    for block in (DOCS / "measurements.md").read_text().split("```python\n")[1:]:
        exec(block.split("```")[0], scope)
    low, high = scope["fit"].interval(0.999).T
    assert np.all((low < [1e5, 30.0, 20.0]) & (high > [1e5, 30.0, 20.0])) and scope["fit"].status == "converged"
    assert scope["both"].checks == () and (tmp_path / "fit.html").exists() and (tmp_path / "both.png").exists()
    assert scope["best"].status == "converged" and mb.modes(scope["m"]).frequency[0] == pytest.approx(12.0, rel=1e-3)


def test_the_picture_of_the_architecture_is_what_its_script_draws():
    script = runpy.run_path(str(DOCS / "img" / "architecture.py"))
    assert script["PICTURE"].read_text(encoding="utf-8") == script["picture"]()


def test_files_that_answer_questions_are_there():
    """The table of docs/architecture.md names one file to a question, and the word that the answer is about is in it."""
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+) \| (.*) \|$", page.split("## Questions a reader asks")[1].split("\n## ")[0], re.M)[
        2:
    ]
    assert len(rows) >= 12
    words = {
        "stiffness of a bushing": "x y z rx ry rz", "axis of a hinge": "CONSTRAINTS", "equilibrium converged": "BALANCED",
        "Campbell diagram": "def campbell", "TOML file": "Lines and columns", "file of a result": "FORMAT",
        "does `mb.simulate` choose": "not stiff", "new law": "impl Law", "new joint": "impl Joint", "new file format": "register(",
    }  # fmt: skip
    for question, files in rows:
        named = [DOCS.parent / name for name in re.findall(r"`((?:python|rust)/[^`]+)`", files)]
        assert named and all(path.exists() for path in named), question
        for about, word in words.items():
            if about in question:
                assert word in named[-1].read_text(encoding="utf-8"), (question, word)
    assert all(any(about in question for question, _ in rows) for about in words)
