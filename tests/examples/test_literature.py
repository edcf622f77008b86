"""The scripts of examples/literature: each runs, says what its text says, and leaves its pictures; the page of the site
shows all of them.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from folders import DOCS, EXAMPLES

FOLDER = EXAMPLES / "literature"
# What each script must print, and its pictures.
SAYS = {
    "matrices": (["6n = 54, p = 45, q = 60, m = 3: 6 instead of 51"], ["matrices"]),
    "mode_lists": (["127 modes", "Adams is not here"], ["mode_lists"]),
    "transfer_functions": (["B6,1 x to B6,32 y", "torso z to z", "in dB"], ["transfer_functions"]),
    "time_response": (["0.886 mm at most"], ["time_response"]),
    "reduction_cost": (["all constraints"], ["reduction_cost"]),
    "alternating": (["p = 2, m = 5", "a1 = 1.30534547"], ["alternating"]),
    "continuation": (["lagrange, moore-penrose", "folds within 3e-07", "polynomial of order 5"], ["continuation"]),
    "condensation": (["900 unknowns or 15"], ["condensation"]),
    "equations": (["I: 8/17/6e-10", "Newton: 3 iterations"], ["equations"]),
    "solver_words": (["the words alone", "stops after 0 steps", "all steps"], ["solver_words"]),
    "swing": (["bdf-bfgs, absolute coordinates", "lengths, mass and inertia of B are lost"], ["swing"]),
    "rotor": (["antisymmetric", "one flexible body"], ["rotor_modes"]),
    "rotor_motion": (
        ["40.1 m from the axis", "40.1 m from the blade's root", "one body, 9 modes", "inertial frame"],
        ["rotor_displacements", "rotor_coordinates"],
    ),
    "rotor_wake": (
        ["loads of a free wake", "modal method, inertial frame", "rigid rotor beside its wake"],
        ["rotor_wake"],
    ),
    "design_matrix": (["central differences", "off by 0e+00"], ["design_matrix"]),
    "projections": (["distance from the limit", "order 2.0 in h", "after"], ["projections"]),
    "five_bar": (["(-4.22936, 3.21062)", "lengths 2.43192 and 1.84487 m"], ["five_bar"]),
    "particle": (["order 2.0", "adjoint off direct"], ["particle"]),
    "car": (["14 degrees of freedom, 25 bodies", "central difference"], ["car"]),
}


def test_every_script_is_listed_and_shown():
    scripts = {path.stem for path in FOLDER.glob("*.py")} - {"said"}
    assert scripts == set(SAYS)
    page = (DOCS / "literature.md").read_text()
    assert set(re.findall(r"^import (\w+)$", page, re.M)) >= scripts
    assert set(re.findall(r"<!-- figure: ([\w]+)\.png -->", page)) == {
        name for _, names in SAYS.values() for name in names
    }


@pytest.mark.slow
@pytest.mark.parametrize("script", SAYS)
def test_script_runs(script, tmp_path):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "MPLBACKEND": "Agg"}
    command = [sys.executable, str(FOLDER / f"{script}.py"), str(tmp_path)]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    words, pictures = SAYS[script]
    assert [word for word in words if word not in done.stdout] == [], done.stdout
    assert all(key in done.stdout for key in ("the text says", "ours"))
    for name in pictures:
        content = (tmp_path / f"{name}.png").read_bytes()
        assert content.startswith(b"\x89PNG") and len(content) > 8000, name
