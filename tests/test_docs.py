"""The pages of docs/ that teach: their code runs and what they list is there."""

from __future__ import annotations

import re
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
from mbrs.motion.simulate import METHODS
from mbrs.motion.trajectory import Trajectory

PAGE = (Path(__file__).parents[1] / "docs" / "motion.md").read_text()


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
