"""``mbrs sweep study.toml``: a study from a file, its errors, Ctrl-C and going on."""

from __future__ import annotations

import json
import os
import re

import mbrs as mb
import numpy as np
import pytest
import sweep_scenes as scenes
from click.testing import CliRunner
from mbrs.cli import main
from mbrs.design.study import read

STUDY = """
model = "stage.toml"
store = "runs"

[designs]
method = "latin_hypercube"
n = 12
seed = 4
[designs.ranges]
k = [100.0, 900.0]
"b.mass" = [0.7, 2.3]
[designs.units]
k = "N/m"

[outputs]
analysis = "modes"
sensitivities = ["k"]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    scenes.model().save(tmp_path / "stage.toml")
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def mbrs(*arguments):
    return CliRunner().invoke(main, ["sweep", *arguments])


def test_a_study_gives_what_the_call_gives(folder):
    done = mbrs("study.toml", "--out", "runs.nc", "--threads", "2")
    assert done.exit_code == 0, done.output
    assert "12 designs: 12 done" in done.output and "frequency[0]" in done.output
    ranges = {"k": (100.0, 900.0), "b.mass": (0.7, 2.3)}
    direct = mb.sweep(scenes.model(), mb.design.latin_hypercube(ranges, 12, 4), mb.outputs.modes(sensitivities=["k"]))
    kept = mb.load(folder / "runs.nc")
    assert kept["frequency"] == pytest.approx(direct["frequency"], rel=1e-12) and kept.designs.units == ("N/m", "")
    again = mbrs("study.toml", "--json")
    data = json.loads(again.stdout)
    assert data["analysis"] == "sweep" and np.allclose(data["outputs"]["frequency"], direct["frequency"], rtol=1e-12)
    assert data["designs"]["k"] == direct["k"].tolist() and data["states"] == ["done"] * 12
    assert [p.name for p in folder.glob("runs/chunk*")]


@pytest.mark.parametrize(
    ("old", "new", "n"),
    [
        ('"latin_hypercube"\nn = 12', '"sobol"\nscramble = false\nn = 8', 8),
        ('"latin_hypercube"\nn = 12', '"saltelli"\nn = 4', 16),
        ('method = "latin_hypercube"\nn = 12\nseed = 4', 'method = "full_factorial"\nlevels = 3', 9),
        ("[designs.units]", "[designs.values]\nmark = [1.0, 2.0, 3.0]\n[designs.units]", 12),
    ],
)
def test_every_way_of_sampling_can_be_named(folder, old, new, n):
    text = STUDY.replace(old, new)
    if "values" in new:
        text = text.replace('method = "latin_hypercube"\nn = 12\nseed = 4', 'method = "full_factorial"')
    (folder / "study.toml").write_text(text)
    assert len(read("study.toml").designs) == n


def test_tables_and_normal_designs_from_files(folder):
    mb.design.full_factorial({"k": (200.0, 300.0)}, 4).save("table.csv")
    head, tail = (
        STUDY.split("[designs]")[0],
        "[outputs]\nanalysis = 'frf'\ninputs = 'b.force.x'\noutputs = ['b.motion.y']\n",
    )
    tail += "frequency = [0.5, 0.9]\n"
    (folder / "study.toml").write_text(head + "[designs]\nmethod = 'from_table'\nfile = 'table.csv'\n" + tail)
    assert read("study.toml").run()["H"].shape == (4, 1, 1, 2)
    normal = (
        "[designs]\nmethod = 'normal'\nn = 5\ncorrelation = [[1.0, 0.5], [0.5, 1.0]]\n[designs.mean]\nk = 400.0\n'b.mass' = 1.5\n"
        "[designs.sd]\nk = 4.0\n'b.mass' = 0.1\n[designs.bounds]\nk = [399.0, 402.0]\n"
    )
    (folder / "study.toml").write_text(head + normal + tail)
    designs = read("study.toml").designs
    assert len(designs) == 5 and designs["k"].min() >= 399.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('model = "stage.toml"', "", "no 'model'"),
        ('"stage.toml"', '"../stage.toml"', "out of the folder"),
        ('store = "runs"', 'store = "/tmp/elsewhere"', "out of the folder"),
        ('store = "runs"', 'store = "."', "out of the folder"),
        ('store = "runs"', 'colour = "red"', "'colour'"),
        ('"latin_hypercube"', '"random"', "no method"),
        ("n = 12", "", "no 'n'"),
        ("n = 12", "n = 'twelve'", "n must be an integer"),
        ("n = 12", "count = 12", "'count'"),
        ("[100.0, 900.0]", "[100.0, 900.0, 3.0]", r"\[low, high\]"),
        ("[100.0, 900.0]", "[900.0, 100.0]", "is empty"),
        ('"b.mass"', '"b.weight"', "weight"),
        ('analysis = "modes"', 'analysis = "poems"', "poems"),
        ('analysis = "modes"\n', "", "analysis"),
        ('analysis = "modes"', 'analysis = "modes"\nshapes = true', "'shapes'"),
        ('analysis = "modes"\nsensitivities = ["k"]', 'function = "os:abort"', "--functions"),
        ('k = "N/m"', 'k = "N/mm"', "the model in N/m"),
        ('"stage.toml"', '"nothing.toml"', "nothing.toml"),
        ("[outputs]", "[outputs", "study.toml"),
        ('store = "runs"', 'executor = "two"', "number of threads"),
    ],
)
def test_what_is_wrong_in_a_study_is_named(folder, old, new, message):
    assert old in STUDY
    (folder / "study.toml").write_text(STUDY.replace(old, new))
    done = mbrs("study.toml")
    text = " ".join(done.output.split())
    assert done.exit_code == 1 and "Traceback" not in text

    assert re.search(message, text), text


def test_functions_run_only_when_allowed(folder, monkeypatch):
    (folder / "study.toml").write_text(STUDY.split("[outputs]")[0] + '[outputs]\nfunction = "sweep_scenes:frequency"\n')
    assert mbrs("study.toml").exit_code == 1
    done = mbrs("study.toml", "--functions")
    assert done.exit_code == 0 and "f[0]" in done.output


def test_ctrl_c_ends_with_130_and_the_same_command_goes_on(folder, monkeypatch):
    from mbrs.design import outputs

    # by Python, one by one
    monkeypatch.setattr("mbrs.design.chunk.fast_plan", lambda *_: None)
    (folder / "study.toml").write_text(STUDY.replace('"modes"', '"equilibrium"'))
    real, calls = outputs.Equilibrium.compute, []

    def cut(self, model, at):
        calls.append(1)
        if len(calls) == 6:
            raise KeyboardInterrupt
        return real(self, model, at)

    monkeypatch.setattr(outputs.Equilibrium, "compute", cut)
    done = mbrs("study.toml", "--out", "part.json")
    assert done.exit_code == 130 and "5 of 12 designs" in " ".join(done.output.split())
    assert mb.load(folder / "part.json").status == "interrupted"
    done = mbrs("study.toml")
    assert done.exit_code == 0 and len(calls) == 6 + 7


def test_an_ending_that_says_nothing_is_refused_before_anything_is_computed(folder):
    done = mbrs("study.toml", "--out", "runs.png")
    assert done.exit_code == 2 and ".nc, .json" in done.output and not (folder / "runs").exists()


def test_mutated_studies_give_named_errors_only(folder):
    rng = np.random.default_rng(int(os.environ.get("MBRS_JITTER") or 1))
    data = STUDY.encode()
    for _ in range(300):
        cut = bytearray(data)
        for place in rng.integers(len(cut), size=rng.integers(1, 5)):
            cut[place] = rng.integers(256)
        (folder / "mutated.toml").write_bytes(bytes(cut))
        try:
            found = read("mutated.toml")
        except mb.MbrsError:
            continue
        assert len(found.designs) < 1e6 and found.store.is_relative_to(folder.resolve())
