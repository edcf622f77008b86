"""The example models that move: their files hold them, and builders take what they say."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.model.tables import tables
from scenes import same_tables

MODELS = {
    "car": mb.examples.car,
    "heavy_top": mb.examples.heavy_top,
    "four_bars": lambda: mb.examples.four_bars(3),
    "slider_crank": mb.examples.slider_crank,
    "quarter_car": mb.examples.quarter_car,
    "swing": mb.examples.swing,
    "rolling_disc": mb.examples.rolling_disc,
    "gap_problem": mb.examples.gap_problem,
    "falling_chain": lambda: mb.examples.pendulum_chain(40),
}
DOF = {
    "car": 14,
    "heavy_top": 3,
    "four_bars": 1,
    "slider_crank": 1,
    "quarter_car": 2,
    "swing": 1,
    "rolling_disc": 3,
    "gap_problem": 1,
}


@pytest.fixture
def from_file(tmp_path):
    """A model as a file holds it: what a test writes, it reads again."""
    return lambda name: mb.Model.load(MODELS[name]().save(tmp_path / f"{name}.toml"), functions=True)


@pytest.mark.parametrize("name", MODELS)
def test_the_file_is_the_model(name, from_file):
    loaded, made = tables(from_file(name)), tables(MODELS[name]())
    functions = [[f.function for f in t.get("functions", ())] for t in (loaded, made)]
    assert functions[0] == functions[1]
    assert [key for key in same_tables(loaded, made) if key != "functions"] == []


@pytest.mark.parametrize("name", ["heavy_top", "quarter_car", "swing", "rolling_disc", "car"])
def test_the_file_moves_as_the_model(name, from_file):
    """Velocities and drives come back from the file."""
    one, two = (mb.simulate(m, t=0.1, rtol=1e-8) for m in (from_file(name), MODELS[name]()))
    assert np.array_equal(one.t, two.t)
    for body in one.bodies:
        assert np.array_equal(one.position(body), two.position(body))


@pytest.mark.parametrize("name", DOF)
def test_degrees_of_freedom(name):
    assert mb.System(MODELS[name]()).dof == DOF[name]


@pytest.mark.parametrize("name", MODELS)
def test_starts_agree_with_the_joints(name):
    """Drawn velocities need no projection: a warning would be an error here."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("error", mb.MbrsWarning)
        mb.simulate(MODELS[name](), t=1e-3, rtol=1e-6)


def test_quarter_car_rests_as_drawn():
    """Springs carry the weight: until the road rises, wheel and body have no acceleration."""
    traj = mb.simulate(mb.examples.quarter_car(), t=[0.0, 1e-3], rtol=1e-8)
    assert np.abs(traj.acceleration[0, 1:]).max() < (1e-12 + 20 * jitter.level()) * 9.81
    assert abs(traj.acceleration[0, 0]) > 1.0


def test_bump_is_its_own_derivative():
    from mbrs.examples._quarter_car import BUMP_TIME, bump

    for t in np.linspace(0.01, BUMP_TIME - 0.01, 7):
        h = 1e-5
        values = [bump(t + k * h) for k in (-1, 0, 1)]
        assert (values[2][0] - values[0][0]) / (2 * h) == pytest.approx(values[1][1], rel=1e-6)
        assert (values[2][1] - values[0][1]) / (2 * h) == pytest.approx(values[1][2], rel=1e-5, abs=1e-4)
    assert bump(-0.1) == bump(BUMP_TIME + 0.1) == (0.0, 0.0, 0.0)
