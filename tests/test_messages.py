"""What a newcomer reads: messages without repetitions, methods with their reasons, modules that are there."""

from __future__ import annotations

import re
import subprocess
import sys

import mbrs as mb
import pytest


@pytest.fixture(scope="module")
def four_bar():
    return mb.examples.four_bar()


UNKNOWN = {
    "name": lambda m: m["cranck"],
    "joint": lambda m: mb.simulate(m, t=0.01).joint("Q"),
    "body": lambda m: mb.equilibrium(m).position("Q"),
    "element": lambda m: mb.simulate(m, t=0.01).element_force("Q"),
    "port": lambda m: mb.frf(m, "Q.force.z", "coupler.motion.x", frequency=[1.0], at=mb.equilibrium(m)),
    "parameter": lambda m: mb.sensitivity(mb.equilibrium(m), ["Q.mass"]),
    "effect": lambda m: mb.modes(m, at=mb.equilibrium(m), without=["Q"]),
    "option": lambda m: mb.problem(m, mb.Final(lambda s: s.point("P2")[0]), "pull.value[0]", t=0.1, stp=1e-3),
}


@pytest.mark.parametrize("what", UNKNOWN)
def test_known_names_are_listed_once(four_bar, what):
    with pytest.raises(mb.MbrsError) as refused:
        UNKNOWN[what](four_bar)
    text = str(refused.value)
    assert len(re.findall(r"\bknown\b|\bdid you mean\b", text)) == 1, text


def test_a_time_before_the_start_is_written_as_it_was_given(four_bar):
    with pytest.raises(mb.ModelError, match=r"^t=-1 s lies before the start at 0 s$"):
        mb.simulate(four_bar, t=-1.0)


def test_the_reason_of_a_method_names_its_bounds():
    m = mb.Model("block")
    b = m.body("block", mass=1.7, inertia=(0.1, 0.2, 0.3), at=(0.3, -0.2, 0.5), velocity=(0.1, 0.2, -0.3))
    m.bushing("rubber", m.ground, b, at=(0.2, -0.2, 0.1), k=(310.0, 290.0, 370.0, 17.0, 13.0, 11.0))
    route = mb.simulate(m, t=1.0).stats.route
    assert "not stiff" in route and "implicit steps pay above 3e2" in route and "above 4e1" in route


@pytest.mark.some(1)
@pytest.mark.parametrize("name", ["plot.motion.plot", "view.motion.motion", "plot.nonlinear.curve", "view.modes.modes"])
def test_modules_that_docstrings_name_are_there_without_an_import(name):
    code = f"import mbrs as mb; print(callable(mb.{name}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "True", done.stderr
