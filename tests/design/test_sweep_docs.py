"""The page on many designs: its script and its study run."""

from __future__ import annotations

import re
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
from click.testing import CliRunner
from folders import DOCS
from mbrs.cli import main

PAGE = (DOCS / "sweeps.md").read_text()


@pytest.mark.slow
def test_the_script_of_the_page_runs_and_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    script = PAGE.split("```python\n")[1].split("```")[0].replace("n=200", "n=20")
    scope: dict = {}
    exec(script, scope)
    runs = scope["runs"]
    # sqrt(2 k / m) of the cube
    assert np.allclose(runs["frequency[0]"], np.sqrt(2 * runs["k_leg"] / runs["payload.mass"]) / (2 * np.pi), rtol=1e-9)
    assert "20 designs: 20 done" in capsys.readouterr().out
    before = sorted(p.name for p in (tmp_path / "hexapod-runs").iterdir())
    again: dict = {}
    exec(script, again)
    assert np.array_equal(again["runs"].seconds, runs.seconds)
    assert before == sorted(p.name for p in (tmp_path / "hexapod-runs").iterdir())


def test_the_study_of_the_page_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mb.examples.cubic_hexapod().save("hexapod.toml")
    Path("study.toml").write_text(PAGE.split("```toml\n")[1].split("```")[0].replace("n = 200", "n = 20"))
    done = CliRunner().invoke(main, ["sweep", "study.toml"])
    assert done.exit_code == 0 and "20 designs: 20 done" in done.output, done.output


def test_the_page_names_what_exists():
    for name in re.findall(r"^\| `(\w+)", PAGE.split("## Designs")[1].split("## Outputs")[0], re.M):
        assert hasattr(mb.design, name)
