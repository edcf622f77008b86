"""The augmented Lagrangian of ALI3-P made visible: penalty factor, passes, residuals around the projections."""

from __future__ import annotations

import jitter
import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest

NAMES = [f"{what} residual {when} projection" for what in ("velocity", "acceleration") for when in ("before", "after")]


def leaning_four_bar():
    """A four-bar in a plane that is no plane of the axes, with gravity and a spring; lengths in metres, mass of a gram."""
    R = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    at = lambda x, y: R @ np.array([x, y, 0.0]) + [3.0, -1.0, 2.0]  # noqa: E731
    m = mb.Model("leaning", gravity=R @ [0.0, -9.81, 0.0])
    places = {"a": (0.15, 0.45), "b": (0.75, 1.0), "c": (1.1, 0.55)}
    bodies = {
        name: m.body(name, mass=1e-3, inertia=(1e-4, 2e-4, 2.2e-4), at=at(*place), orientation=R)
        for name, place in places.items()
    }
    a, b, c = bodies.values()
    joints = (("A", m.ground, a, (0, 0)), ("B", a, b, (0.3, 0.9)), ("C", b, c, (1.2, 1.1)), ("D", c, m.ground, (1, 0)))
    for name, one, other, place in joints:
        m.revolute(name, one, other, at=at(*place), axis=R[:, 2])
    m.spring_damper("s", m.ground, b, at=(at(-0.4, 0.3), at(0.75, 1.0)), k=0.2, c=1e-3)
    return m


@pytest.fixture(scope="module")
def limit():
    return mb.simulate(leaning_four_bar(), t=0.5, method="ali3p", step=1e-2)


def test_the_residuals_of_the_projections_are_told(limit):
    measures = limit.stats.measures
    assert list(measures) == NAMES
    before, after, accelerations, projected = measures.values()
    assert 1e-7 < before < 1.0 and 1e-6 < accelerations < 100.0
    assert after < 1e-12 and projected < 1e-10
    assert "multiplier passes" not in limit.stats.counts
    # what the trapezoidal rule misses between the rows shrinks with the step
    half = mb.simulate(leaning_four_bar(), t=0.5, method="ali3p", step=5e-3).stats.measures
    assert 3.5 < before / half[NAMES[0]] < 4.5


@pytest.mark.parametrize(("penalty", "passes"), [(1e2, 1), (1e2, 4), (1e5, 1), (1e5, 3)])
def test_each_pass_divides_the_residual_by_the_penalty(penalty, passes, limit):
    traj = mb.simulate(leaning_four_bar(), t=0.5, method="ali3p", step=1e-2, penalty=penalty, passes=passes)
    measures, counts = traj.stats.measures, traj.stats.counts
    assert measures["penalty factor"] == penalty and measures["passes"] == passes
    solved = counts["iterations"] + counts["velocity projections"] + counts["acceleration projections"]
    assert passes * (solved - 2) <= counts["multiplier passes"] <= passes * solved
    before, after = (measures[name] for name in NAMES[:2])
    assert after < before * (3.0 / penalty) ** passes + 1e-15 + jitter.level()
    assert after > before * (0.3 / penalty) ** passes or after < 1e-15 + jitter.level()
    # the step is solved whatever the passes; only what the projections leave differs
    assert np.abs(traj.position("b") - limit.position("b")).max() < 1e-8


def test_a_penalty_belongs_to_this_method():
    m = leaning_four_bar()
    with pytest.raises(mb.ModelError, match='belong to method="ali3p"'):
        mb.simulate(m, t=0.1, penalty=1e6)
    with pytest.raises(mb.ModelError, match="give penalty="):
        mb.simulate(m, t=0.1, method="ali3p", passes=3)
    with pytest.raises(mb.ModelError, match="penalty= must be a positive number"):
        mb.simulate(m, t=0.1, method="ali3p", penalty=-1.0)
    with pytest.raises(mb.ModelError, match="leave out penalty="):
        mb.simulate(m, t=0.1, method="ali3p", step=0.01, penalty=1e6, parameters="s.k")


def test_a_tree_has_nothing_to_penalise():
    m = mb.Model("pendulum", gravity=(0, 0, -9.81))
    b = m.body("rod", mass=1.0, inertia=(0.1, 0.1, 0.01), at=(0.3, 0.1, -0.5))
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=(0.2, 1.0, 0.1))
    one = mb.simulate(m, t=0.5, method="ali3p", step=1e-2, penalty=1e3, passes=2)
    other = mb.simulate(m, t=0.5, method="ali3p", step=1e-2)
    assert np.array_equal(one.joint("hinge"), other.joint("hinge"))
    assert "multiplier passes" not in one.stats.counts and one.stats.measures[NAMES[0]] == 0.0


def test_steps_are_not_solved_below_rounding():
    """What the last correction leaves is foreseen by how fast they shrink."""
    counts = mb.simulate(zoo.governor().model, 0.5, method="ali3p", step=1e-3).stats.counts
    print(counts)
    assert counts["iterations"] < 1.6 * counts["steps"]
