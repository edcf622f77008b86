"""Types that a user sees: a script under strict mypy, and calls that mypy must refuse."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
import signatures
from folders import ROOT

RIGHT = """
import matplotlib.figure
import mbrs as mb
import numpy as np

m = mb.Model("machine", gravity=(0.0, 0.0, -9.81))
k = m.parameter("k", 1.3e5, unit="N/m")
frame = m.body("frame", mass=120.0, inertia=(9.0, 11.0, 14.0), at=(0.1, -0.2, 0.7))
m.bushing("mount", m.ground, "frame", at=(0.1, -0.2, 0.0), k=[k, k, 2 * k, 1e4, 1e4, 1e4], c=[9e2] * 3 + [40.0] * 3)
m.spring_damper("strut", m.ground, frame, at=((0.4, 0.0, 0.0), (0.1, -0.2, 0.7)), k=k / 3, law=mb.Cubic(1e7))

rest: mb.Equilibrium = mb.equilibrium(m)
place: np.ndarray = rest.position(frame)
modes: mb.ModalResult = mb.modes(m, at=rest)
slopes: mb.EigenSensitivity = mb.sensitivity(modes, "k")
matrices: mb.LinearizationSensitivity = mb.sensitivity(mb.linearize(m, at=rest), ["k", "frame.mass"], equilibrium="hold")
moved: mb.EquilibriumSensitivity = mb.sensitivity(rest, "k")
h: mb.FrfResult = mb.frf(m, "frame.force.z", "frame.motion.z", frequency=np.linspace(1.0, 40.0, 300), at=rest)
dh: mb.FrfSensitivity = mb.sensitivity(h, "k")
motion: mb.Trajectory = mb.simulate(m, t=0.5, at=rest)
height: np.ndarray = motion.position("frame")[:, 2]
picture: matplotlib.figure.Figure = modes.plot()
curve: mb.FrequencyResponse = mb.frequency_response(m, inputs="frame.force.z", amplitude=10.0, frequency=(2.0, 9.0), at=rest)
peak: mb.PeriodicSolution = curve.point(0)
largest: float = peak.largest("frame.motion.z")
"""
# Each of these lines is an error of its own.
WRONG = """
import mbrs as mb

m = mb.Model("machine")
mb.equilibrium(m, at=3)
mb.equilibrium("machine")
mb.sensitivity(3.0, "k")
mb.sensitivity(mb.modes(m), "k", equilibrium="maybe")
m.revolute("hinge", m.ground, 3, at=(0, 0, 0), axis="x")
m.body("frame", mass="heavy", inertia=(1, 1, 1))
mb.Cubic([1.0], w="x")
text: str = mb.modes(m).frequency
"""


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """Lines of both scripts in which strict mypy finds errors, and what it says; one run, since it reads the whole package."""
    folder = tmp_path_factory.mktemp("types")
    scripts = {"right.py": RIGHT, "wrong.py": WRONG}
    for name, text in scripts.items():
        (folder / name).write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file=", *scripts]
    env = {**os.environ, "MYPYPATH": str(ROOT / "python"), "MYPY_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(command, env=env, cwd=folder, capture_output=True, text=True, check=False, timeout=600)
    found = [line.split(":") for line in done.stdout.splitlines() if "error:" in line]
    lines = {name: sorted({int(at) for file, at, *_ in found if file == name}) for name in scripts}
    return lines, done.stdout + done.stderr


@pytest.mark.slow
def test_scripts_are_typed_and_mypy_refuses_what_the_package_refuses(checked):
    pytest.importorskip("mypy")
    lines, said = checked
    assert lines["right.py"] == [], said
    assert lines["wrong.py"] == list(range(5, len(WRONG.splitlines()) + 1)), said


# What a file holds is known only when it is read.
UNKNOWN = {("load", "return")}


def test_no_public_argument_and_no_result_is_untyped():
    functions = list(signatures.functions())
    found = {(f.__qualname__, name) for f in functions for name in signatures.untyped(f)}
    assert len(functions) > 600 and found == UNKNOWN


def test_untyped_arguments_are_found():
    def one(a: int | Any, *b: Any, c: list[Any], d=3, **e: float) -> Any: ...  # noqa: F821

    assert list(signatures.untyped(one)) == ["a", "b", "d", "return"]
