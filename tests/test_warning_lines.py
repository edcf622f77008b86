"""Warnings show the line of the script that led to them, and one function makes them."""

from __future__ import annotations

import warnings
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
from folders import ROOT


def leaning_door(**start):
    m = mb.Model("door", gravity=(0.31, -1.7, -9.64))
    leaf = m.body("leaf", mass=23.0, inertia=(1.9, 2.6, 0.74), at=(0.41, 0.13, 0.97), **start)
    m.revolute("hinge", m.ground, leaf, at=(0.0, 0.07, 0.4), axis=(0.07, -0.11, 0.99))
    m.spring_damper("closer", m.ground, leaf, at=((0.3, 0.6, 1.1), (0.55, 0.2, 1.3)), k=310.0, c=8.0)
    return m, leaf


def planar_inertia(folder):
    mb.Model("plate").body("plate", mass=1.3, inertia=(0, 0, 0.21))


def out_of_balance(folder):
    mb.modes(leaning_door()[0])


def linearised_out_of_balance(folder):
    mb.linearize(leaning_door()[0])


def missed_resonance(folder):
    m = mb.MechanicalSystem(np.diag([1.3, 2.1]), 1e-4 * np.eye(2), [[913.0, -400.0], [-400.0, 520.0]])
    mb.frf(m, inputs=[0], outputs=[0], frequency=np.array([0.3, 9.1]))


def left_out(folder):
    m, leaf = leaning_door()
    m.bushing("mount", m.ground, leaf, at=(0.2, 0.1, 0.3), k=(7e3, 6e3, 5e3, 11, 13, 17))
    m.save(folder / "door.urdf")


def contradicting_velocities(folder):
    mb.simulate(leaning_door(velocity=(0.3, 0.4, -0.7))[0], t=0.01)


WARNS = [
    planar_inertia,
    out_of_balance,
    linearised_out_of_balance,
    missed_resonance,
    left_out,
    contradicting_velocities,
]


@pytest.mark.parametrize("script", WARNS, ids=lambda f: f.__name__)
def test_a_warning_shows_the_line_of_the_script(script, tmp_path):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        script(tmp_path)
    ours = [w for w in seen if issubclass(w.category, mb.MbrsWarning)]
    assert ours, "nothing was warned of"
    assert {Path(w.filename).name for w in ours} == {Path(__file__).name}, [(w.filename, str(w.message)) for w in ours]


def test_one_function_warns():
    package = ROOT / "python" / "mbrs"
    if not package.is_dir():
        pytest.skip("an installed package has no sources beside it")
    callers = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if "warnings.warn(" in path.read_text(encoding="utf-8")
    ]
    assert callers == ["_lib/warning.py"]
