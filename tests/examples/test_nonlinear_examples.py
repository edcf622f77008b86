"""The nonlinear examples run, their pictures are there, and every error they print is as small as it should be."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import mbrs as mb
import numpy as np
import pytest
from folders import EXAMPLES

SCRIPTS = sorted(p.name for p in (EXAMPLES / "nonlinear").glob("*.py"))
ROW = re.compile(r"^(?P<what>.+?)  +(?P<found>\S+)  +(?P<known>\S+)  +(?P<error>\d\.\de[+-]\d\d)  +(?P<source>.+)$")

# Rows that a table must have at least, the largest error of each kind of row (by a word in it), and the pictures. Where
# the reference is printed with few digits, these decide; where harmonics are few, the estimate in the row does.
EXPECTED = {
    "clearance.py": (5, {"closed form": 1e-13, "x(0)": None}, ["clearance-curve", "clearance-orbit"]),
    "coupled_pendulum.py": (2, {"SciPy": 1e-6}, ["coupled-pendulum"]),
    "duffing.py": (
        11,
        {"6 digits": 2e-6, "(23.5)": 2e-8, "(23.6)": 1e-8},
        ["duffing-curve", "duffing-harmonics"],
    ),
    "engine.py": (
        8,
        {"plain": 1e-9, "multiplier": None, "geometry": 5e-3, "distance": 1e-3},
        ["engine-curves"],
    ),
    "jenkins.py": (6, {"linear": 1e-12, "closed form": 1e-6, "distance": 1e-4}, ["jenkins-curves"]),
    "ladder_gap.py": (
        7,
        {"transfer function": 1e-11, "J1,1a(0)": None, "geometry": 5e-3, "distance": 1e-3},
        ["ladder-gap"],
    ),
    "neimark_sacker.py": (6, {"multiplier": 1e-8, "angle": 1e-8}, ["neimark-sacker-curve"]),
    # seven of the ten digits of the smallest coefficients are significant
    "quasi_periodic.py": (12, {"(23.9)": 1e-7}, ["quasi-periodic-spectrum", "quasi-periodic-branch"]),
    "stewart_friction.py": (
        8,
        {"stuck": 1e-10, "plain": 1e-9, "geometry": 5e-3, "distance": 1e-3},
        ["stewart-friction"],
    ),
    "unilateral_spring.py": (6, {"x(0)": 2e-2}, ["unilateral-curve", "unilateral-orbit"]),
    "van_der_pol.py": (3, {"mu = 20": 1e-6, "mu": 1e-9}, ["van-der-pol-1", "van-der-pol-20"]),
}


def test_every_script_has_its_expectations():
    assert sorted(EXPECTED) == SCRIPTS


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS)
def test_script_agrees_with_its_references(script, tmp_path):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "MPLBACKEND": "Agg"}
    command = [sys.executable, str(EXAMPLES / "nonlinear" / script), str(tmp_path)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    least, limits, pictures = EXPECTED[script]
    rows = [m for line in done.stdout.partition("relative error")[2].splitlines() if (m := ROW.match(line))]
    print(*(f"{m['what']}: {m['error']} ({m['source']})" for m in rows), sep="\n")
    assert len(rows) >= least
    for m in rows:
        word = next(w for w in limits if w in m.group(0))
        estimate = re.search(r"estimate (\S+)", m["source"])
        # an estimate tells the order of magnitude
        limit = limits[word] if limits[word] is not None else max(10 * float(estimate[1]), 1e-8)
        assert float(m["error"]) <= limit, m.group(0)
    for name in pictures:
        content = (tmp_path / f"{name}.png").read_bytes()
        assert content.startswith(b"\x89PNG") and len(content) > 8000, name


@pytest.mark.slow
def test_relaxation_example_says_that_it_is_not_resolved():
    poor = mb.limit_cycle(mb.examples.van_der_pol(20.0), harmonics=15)
    assert poor.status == "unresolved" and abs(poor.period / 34.68232331 - 1) > 0.5 and poor.error > 0.1


def test_friction_and_play_of_the_models_are_laws_of_their_joints():
    plain, rough = mb.examples.stewart_platform(), mb.examples.stewart_platform(friction=2.0)
    assert len(mb.nonlinear_system(plain).elements) == 0 and len(mb.nonlinear_system(rough).elements) == 6
    m = mb.examples.engine_on_mounts()
    loaded = mb.nonlinear_system(m, at=mb.equilibrium(m))
    # twelve cubic laws; those along the load are displaced and become full polynomials
    kinds = [type(law).__name__ for law in loaded.elements]
    assert len(kinds) == 12 and kinds.count("Polynomial1D") >= 4
    ladder = mb.nonlinear_system(mb.examples.ladder_with_gap())
    assert len(ladder.elements) == 1 and np.allclose(ladder.elements[0].w, 0.2)


def test_level_of_the_engine_where_the_linear_model_holds():
    m = mb.examples.engine_on_mounts()
    at = mb.equilibrium(m)
    one = mb.harmonic_balance(m, inputs=m["crank"].force("z"), amplitude=1e-3, frequency=12.0, at=at)
    linear = mb.frf(mb.linearize(m, at=at), "crank.force.z", "crank.motion.z", frequency=[12.0]).value[0, 0, 0]
    ours = one.coefficient("crank.motion.z")
    print(f"engine at 1 mN: differs from the transfer function by {abs(ours / (1e-3 * linear) - 1):.1e}")
    assert abs(ours / (1e-3 * linear) - 1) < 1e-8


def test_the_page_on_nonlinear_vibration_is_true(tmp_path, monkeypatch):
    """Its code runs, and it names every reason for which a branch ends."""
    from mbrs.nonlinear.branch_points import MEANING

    page = (EXAMPLES.parent / "docs" / "nonlinear.md").read_text()
    monkeypatch.setenv("MPLBACKEND", "Agg")
    scope: dict[str, object] = {}
    exec(page.split("```python\n")[1].split("```")[0], scope)
    assert scope["curve"].status == "converged" and [e.kind for e in scope["curve"].events] == ["fold", "fold"]
    assert [status for status in MEANING if f'"{status}"' not in page] == []
