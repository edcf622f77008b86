"""Every example script runs and leaves readable pictures; every example model gives the numbers of the plain reference.

`reference_numbers.json` is made by `mbrs.reference` alone (`reference_numbers.py`).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
from folders import EXAMPLES
from mbrs.model.tables import tables
from reference_numbers import CASES
from scenes import same_tables

NUMBERS = json.loads(Path(__file__).with_name("reference_numbers.json").read_text())
# tests/examples/test_nonlinear_examples.py runs those of examples/nonlinear
TOPICS = ("", "linear", "loops", "rotors", "motion", "gradients", "designs", "mornings")
SCRIPTS = {p.name: p for topic in TOPICS for p in sorted((EXAMPLES / topic).glob("*.py"))}

# What each script must say and leave behind.
SAYS = {
    "api_1_modes.py": (["15.9155", "36.7553"], ["modes.html"]),
    "api_2_loops.py": (["redundant constraints: 3 of 5", "Campbell"], []),
    "api_3_nonlinear.py": (["fold        1.115700", "k = (2, -1)", "period 6.66328", "largest rail"], []),
    "api_4_motion.py": (["finished", "success: true"], ["run.html"]),
    "api_5_gradients.py": (["psi = 0.72", "shape of the gradient: (2, 3)", "(11, 6, 3)"], []),
    "api_6_accuracy.py": (
        ["accuracy study", "without", "1.0e-05", "Relative difference of the peak"],
        ["accuracy.png"],
    ),
    "api_9_files.py": (["shoulder", "update of 2 parameters", "100000"], ["measured.png"]),
    "api_10_literature.py": (
        ["inverse-bfgs", "finished", "the core beside the NumPy reference", "power"],
        ["rotor.html"],
    ),
    "api_7_designs.py": (
        ["200 designs: 200 done", "agree: True", "56848.9"],
        ["designs-scatter.png", "designs-correlation.png"],
    ),
    "car.py": (
        ["14 degrees of freedom", "adjoint against direct", "rear_spring_c", "converged"],
        ["car-tornado.png", "car-sensitivity.png", "car-convergence.png", "car-ride.png", "car.html"],
    ),
    "chain.py": (["springs only", "60", "along the hinges 2.605771 Hz"], ["chain-modes.png", "chain-modes.html"]),
    "falling_chain.py": (["end off by"], ["falling-chain.png", "falling-chain.html"]),
    "five_bar_gradient.py": (["2.4319", "1.8448", "converged"], ["five-bar-convergence.png"]),
    "four_bar_identification.py": (
        ["standard errors", "mb.problem: converged", "mount.c[1]"],
        ["four-bar-identification.png"],
    ),
    "flexible_boom.py": (["length -1.740", "gradient and differences agree: True"], ["flexible-boom.png"]),
    "four_bars.py": (["30 redundant"], ["four-bars.png", "four-bars-reactions.png", "four-bars.html"]),
    "bead_on_a_wire.py": (["constraint 'wire': 2 rows of positions", "closed form"], ["bead.png"]),
    "gap_problem.py": (["rejected", "energy kept"], ["gap-problem.png", "gap-problem-error.png"]),
    "known_values.py": (["-4.22881105", "3.8939684", "errors fell by"], []),
    "heavy_top.py": (["precession 2.2465", "finished"], ["heavy-top.png", "heavy-top.html"]),
    "hexapod.py": (["36.7553", "k_leg"], ["hexapod-transmissibility.png", "hexapod-sensitivity.png"]),
    "ladder.py": (["redundant"], ["ladder-modes.png", "ladder-modes.html"]),
    "bracket_with_gap.py": (["no stop: True", "moves up: True"], ["bracket.png"]),
    "designs_on_dask.py": (["all designs done: True", "a plain call: True"], []),
    "pendulum_as_fmu.py": (["problems that fmpy finds: 0", "as the model does: True"], []),
    "updated_hexapod.py": (["within their intervals: True"], ["update.html", "update.png"]),
    "arm_from_urdf.py": (["derivatives agree: True"], ["arm.html"]),
    "nonholonomic.py": (["changes its sign: True", "edge.at[0]"], []),
    "quadruped.py": (["18 modes", "k_foot", "torso.motion.z"], ["quadruped-transfer-function.png"]),
    "journal_bearing.py": (["K[0, 1]", "C[1, 1]"], []),
    "shaft_in_hole.py": (["largest radius", "largest difference"], []),
    "quarter_car.py": (["damper 2800", "finished"], ["quarter-car.png", "quarter-car-power.png", "quarter-car.html"]),
    "rolling_disc.py": (["leans between 20.1 and 33.2"], ["rolling-disc.png", "rolling-disc.html"]),
    "rotor.py": (["rigid", "Campbell"], ["rotor-campbell.png"]),
    "rigid_rotor_in_wind.py": (
        ["prescribed wake", "unsteady wake", "thrust falls to"],
        ["rotor-performance.png", "rotor-wake.png", "rotor-pitch-step.png"],
    ),
    "rotor_in_wind.py": (
        [
            "48 sections, inflow free-wake",
            "air at 'blade1': 16 sections",
            "free wake:",
            "momentum:",
            "largest power coefficient",
        ],
        [
            "rotor-in-wind-motion.png",
            "rotor-in-wind-blade.png",
            "rotor-in-wind-loads.png",
            "rotor-in-wind-performance.png",
            "rotor-in-wind.html",
        ],
    ),
    "slider_crank.py": (
        ["stroke 300.0 mm", "redundant", "the middle of the rod bends by"],
        ["slider-crank.png", "slider-crank.html", "slider-crank-elastic.png"],
    ),
    "stewart_platform.py": (["12 modes", "k_strut"], ["stewart-response.png", "stewart-transmissibility.png"]),
    "sweep_optuna.py": (["best distance", "best design: True"], []),
    "sweep_scipy.py": (["c_leg", "of 12 Hz: True"], []),
    "swing.py": (["-0.835430375 rad, check value -0.835430375", "motor"], ["swing.png", "swing.html"]),
    "tree.py": (["12 of 381 modes", "B6,32.motion.y / B6,1.force.x"], ["tree-transfer-function.png"]),
    "wind_rotor.py": (
        ["collective", "1.2868", "off by 1.4%", "flapwise displacement at 85 %"],
        ["wind-rotor-campbell.png", "wind-rotor-motion.png", "wind-rotor.html"],
    ),
    "wafer_stage.py": (["14 modes", "k_mount"], ["wafer-stage-transmissibility.png"]),
}
# Scripts that are run with more than the folder: shorter motions than by default.
SHORTER = {"rotor_in_wind.py": ["0.7"], "api_10_literature.py": ["0.5"]}


def test_every_script_is_listed():
    assert sorted(SAYS) == sorted(SCRIPTS)


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS)
def test_script_runs(script, tmp_path):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "MPLBACKEND": "Agg", "COLUMNS": "140"}
    command = [sys.executable, str(SCRIPTS[script]), str(tmp_path), *SHORTER.get(script, ())]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    words, files = SAYS[script]
    missing = [word for word in words if word.lower() not in done.stdout.lower()]
    assert not missing, f"{missing} not in\n{done.stdout}"
    for name in files:
        content = (tmp_path / name).read_bytes()
        start = b"\x89PNG" if name.endswith(".png") else b"<!doctype html>"
        assert content[:15].lower().startswith(start.lower()) and len(content) > 8000, name


def test_every_model_has_its_numbers():
    assert list(NUMBERS) == list(CASES)


@pytest.fixture(scope="module")
def from_file(tmp_path_factory):
    """Each case as a file holds it: what a test writes, it reads again."""
    folder = tmp_path_factory.mktemp("models")
    return lambda name: mb.Model.load(CASES[name].model().save(folder / f"{name}.toml"))


@pytest.mark.parametrize("name", CASES)
def test_the_file_is_the_model(name, from_file):
    assert same_tables(tables(from_file(name)), tables(CASES[name].model())) == []


@pytest.fixture(scope="module")
def computed(from_file):
    """Modes of each case, computed once by the core from the TOML file."""
    found = {}

    def modes(name):
        if name not in found:
            m = from_file(name)
            at = mb.equilibrium(m) if CASES[name].at_equilibrium else None
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mb.MbrsWarning)
                found[name] = m, at, mb.modes(m, at=at)
        return found[name]

    return modes


@pytest.mark.parametrize("name", list(NUMBERS))
def test_modes_agree_with_the_reference(name, computed):
    _, _, modes = computed(name)
    expected, n = NUMBERS[name], len(NUMBERS[name]["frequency"])
    assert modes.n == expected["dof"]
    f, zeta = np.array(expected["frequency"]), np.array(expected["damping"], dtype=float)
    rigid = modes.kind[:n] == "rigid"
    assert np.array_equal(rigid, f == 0.0)
    error = np.abs(modes.frequency[:n] - f)[~rigid] / f[~rigid]
    # The reference itself loses digits where it subtracts stiffnesses in absolute coordinates; it says how many.
    allowed = 1e-10 * np.maximum(modes.condition[:n][~rigid], 1.0) + np.array(expected["rounding"])[~rigid]
    print(f"{name}: frequencies within {error.max():.1e} of the reference")
    assert np.all(error <= allowed)
    assert np.all(np.abs(modes.damping[:n] - zeta)[~rigid] <= allowed)


@pytest.mark.parametrize("name", list(NUMBERS))
def test_transfer_function_agrees_with_the_reference(name, computed):
    m, at, _ = computed(name)
    case, expected = CASES[name], NUMBERS[name]["H"]
    body, axis = case.force
    load = f"torque.{axis[1:]}" if axis.startswith("r") else f"force.{axis}"
    ports = f"{body}.{load}", f"{case.motion[0]}.motion.{case.motion[1]}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        h = mb.frf(m, *ports, frequency=expected["frequency"], at=at).value[0, 0]
    error = np.abs(h / (np.array(expected["re"]) + 1j * np.array(expected["im"])) - 1)
    print(f"{name}: transfer function within {error.max():.1e} of the reference")
    assert error.max() < 1e-8


@pytest.mark.parametrize("name", [n for n in NUMBERS if CASES[n].parameters])
def test_sensitivities_agree_with_the_reference(name, computed):
    _, _, modes = computed(name)
    expected, n = NUMBERS[name], len(NUMBERS[name]["frequency"])
    s = mb.sensitivity(modes, list(CASES[name].parameters))
    labels = s.labels
    assert list(labels) == expected["labels"]
    ours = np.asarray(s.frequency, dtype=float)[:n]
    # Members of a repeated group have no order of their own: compare sorted values.
    groups = [g for g in modes.clusters if g[-1] < n]
    whole = [i for i in range(n) if not any(i in g for g in modes.clusters) and modes.kind[i] != "rigid"]
    worst = 0.0
    for p, column in enumerate(expected["sensitivity"]):
        theirs = np.array(column, dtype=float)
        # a derivative that vanishes is compared on the scale of f/p
        size = np.nanmax(expected["frequency"]) / max(abs(np.max(np.abs(modes.system.model.value(labels[p])))), 1e-3)
        scale = max(np.nanmax(np.abs(theirs)), 1e-6 * size)
        pairs = [
            (ours[whole, p], theirs[whole]),
            *((np.sort(ours[list(g), p]), np.sort(theirs[list(g)])) for g in groups),
        ]
        worst = max(worst, *(np.max(np.abs(a - b), initial=0.0) / scale for a, b in pairs))
    print(f"{name}: sensitivities within {worst:.1e} of the reference")
    assert worst < 1e-8
