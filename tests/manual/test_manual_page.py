"""The verification manual itself: cases assert, write what they found, and docs/build.py runs every file that has one."""

from __future__ import annotations

import json
import re
import runpy

import pytest
from folders import ROOT

GIVEN = dict(topic="modes", source="x = 1", within=1e-6)


def test_a_case_asserts_and_is_recorded(case, tmp_path, monkeypatch):
    monkeypatch.setenv("MBRS_MANUAL", str(tmp_path))
    case("two numbers", ours=[1.0, 2.0 + 1e-9], known=[1.0, 2.0], estimate=1e-8, unit="m", **GIVEN)
    record = json.loads((tmp_path / "two-numbers.json").read_text())
    assert record["known"] == "2" and record["count"] == 2 and record["distance"] == pytest.approx(5e-10, rel=1e-6)
    assert record["file"] == "tests/manual/test_manual_page.py" and record["estimate"] == 1e-8
    with pytest.raises(AssertionError, match="distance"):
        case("far", ours=1.1, known=1.0, **GIVEN)
    with pytest.raises(AssertionError, match="not known"):
        case("vague", ours=1.0, known=1.0, uncertainty=1e-3, **GIVEN)
    with pytest.raises(AssertionError):
        case("no number", ours=float("nan"), known=1.0, **GIVEN)


def test_every_case_is_run_by_the_build():
    listed = runpy.run_path(str(ROOT / "docs" / "build.py"))["CASES"]
    using = {
        p
        for p in (ROOT / "tests").rglob("test_*.py")
        if re.search(r"\bcase\([^)]*topic=", p.read_text(encoding="utf-8"), re.S)
    }
    covered = {
        p for name in listed for p in ([ROOT / name] if (ROOT / name).is_file() else (ROOT / name).rglob("test_*.py"))
    }
    assert using and using <= covered, using - covered
