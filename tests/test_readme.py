"""The README: its Python blocks run, its links lead somewhere, its commands are those that `.ci/run` runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from folders import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def run(block: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> dict:
    monkeypatch.chdir(folder)
    names: dict = {}
    exec(compile(block, "README.md", "exec"), names)
    return names


def test_first_script_gives_the_closed_form(monkeypatch, tmp_path, capsys):
    assert len(BLOCKS[0].strip().splitlines()) <= 15
    names = run(BLOCKS[0], monkeypatch, tmp_path)
    # sqrt(2k/m), sqrt(k L^2/(2I)), sqrt(2 k L^2/I): docs/theory.md (23.1)
    squares = [2e5 / 20] * 3 + [1e5 * 0.04 / 0.3] * 2 + [2e5 * 0.04 / 0.15]
    assert np.abs(names["modes"].frequency / np.sqrt(squares) * 2 * np.pi - 1).max() < 1e-12
    printed = capsys.readouterr().out
    assert "15.9155" in printed and "36.7553" in printed and "k_leg" in printed
    assert (tmp_path / "modes.html").stat().st_size > 8000


def test_second_script_shows_what_it_says(monkeypatch, tmp_path, capsys):
    names = run(BLOCKS[1], monkeypatch, tmp_path)
    printed = capsys.readouterr().out
    assert "degrees of freedom: 1 " in printed and "redundant constraints: 3 of 5" in printed
    assert names["A"].shape == (2, 2) and names["eq"].status == "converged"


def test_third_script_finds_the_folds(monkeypatch, tmp_path, capsys):
    names = run(BLOCKS[2], monkeypatch, tmp_path)
    # docs/theory.md (23.5): folds near 1.26960 and 1.11570
    assert [round(event.omega, 5) for event in names["curve"].events] == [1.2696, 1.1157]
    assert "1.26960" in capsys.readouterr().out


def test_fourth_script_moves_the_four_bar(monkeypatch, tmp_path, capsys):
    names = run(BLOCKS[3], monkeypatch, tmp_path)
    traj = names["traj"]
    assert traj.t[-1] == 2.0 and 0 < traj.error < 1e-6
    assert "explicit" in capsys.readouterr().out
    assert len(BLOCKS) == 4


def test_links_lead_to_files():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    assert len(links) >= 6
    assert [link for link in links if not (ROOT / link).is_file()] == []
    picture = (ROOT / "docs/img/quadruped.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and len(picture) > 20000


def test_commands_are_complete_set_ups():
    commands = re.findall(r"^python3 -m venv .*$", README, flags=re.MULTILINE)
    assert commands == [
        "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/mbrs demo",
        "python3 -m venv .venv && .venv/bin/pip install '.[test]' && .venv/bin/pytest",
        "python3 -m venv .venv && .venv/bin/pip install build twine && PYTHON=.venv/bin/python .ci/wheel wheels",
        "python3 -m venv .venv && .venv/bin/pip install '.[test,docs]' && .venv/bin/python docs/build.py",
    ]


def test_versions_are_one():
    found = {
        name: re.search(pattern, (ROOT / name).read_text(encoding="utf-8"), re.M)[1]
        for name, pattern in {
            "Cargo.toml": r'^version = "(.*)"',
            "pyproject.toml": r'^version = "(.*)"',
            "CITATION.cff": r"^version: (.*)$",
            "docs/conf.py": r'^release = version = "(.*)"',
        }.items()
    }
    assert len(set(found.values())) == 1, found


def test_pages_of_the_documentation_have_no_dead_links():
    pages = [ROOT / "CHANGELOG.md", *(p for d in ("docs", "examples", "benches") for p in (ROOT / d).glob("*.md"))]
    dead = [
        f"{page.name}: {link}"
        for page in pages
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8"))
        if not link.startswith(("generated/", "gallery/"))
        and not (page.parent / link).exists()  # the site makes and checks those
    ]
    assert dead == []
