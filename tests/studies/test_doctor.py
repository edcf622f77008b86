"""``mbrs doctor`` tells what is installed and finds what is broken."""

import json
from types import SimpleNamespace

import mbrs as mb
import numpy as np
import pytest
from click.testing import CliRunner
from mbrs.cli import main
from mbrs.studies import doctor


def test_this_installation_is_sound_and_the_report_names_its_parts():
    result = CliRunner().invoke(main, ["doctor"])
    assert result.exit_code == 0, result.output
    for word in ("numpy", "scipy", np.__version__, "cores", "BLAS", "passed", "motion of a hinge"):
        assert word in result.output
    data = json.loads(CliRunner().invoke(main, ["doctor", "--json"]).output)
    assert data["passed"] and len(data["checks"]) == 3
    assert all(check["error"] < 0.1 * doctor.ALLOWED for check in data["checks"])


def test_a_core_that_computes_wrong_numbers_is_found(monkeypatch):
    exact = mb.modes

    def wrong(*args, **given):
        return SimpleNamespace(frequency=np.asarray(exact(*args, **given).frequency) * (1.0 + 2.0 * doctor.ALLOWED))

    monkeypatch.setattr(doctor, "modes", wrong)
    report = doctor.examine()
    assert [check.passed for check in report.checks] == [False, True, True]
    assert "WRONG" in str(report) and "reinstall" in str(report)


@pytest.mark.parametrize("problem", [RuntimeError("boom"), OSError("library not found")])
def test_what_fails_is_reported_and_exit_code_is_1(monkeypatch, problem):
    def fail(*args, **given):
        raise problem

    monkeypatch.setattr(doctor, "simulate", fail)
    result = CliRunner().invoke(main, ["doctor"])
    assert result.exit_code == 1
    assert str(problem) in result.output and "reinstall" in result.output


def test_a_missing_package_is_named(monkeypatch):
    found = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: "" if name == "scipy" else found(name))
    report = doctor.examine()
    assert not report.passed
    assert "MISSING" in str(report)
