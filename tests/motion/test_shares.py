"""The error of a whole motion by the methods of order two is that of the tolerance, whether local errors die out, stay or grow."""

from __future__ import annotations

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest

METHODS = ("generalized-alpha", "ali3p")


@pytest.mark.some(6)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", sorted(zoo.SMOOTH))
def test_the_tolerance_is_that_of_the_whole_motion(name, method):
    problem = zoo.SMOOTH[name]()
    for rtol in (1e-3, 1e-4):
        traj = mb.simulate(problem.model, [problem.t], rtol=rtol, method=method)
        error = problem.error_of(traj)
        counts = traj.stats.counts
        print(
            f"{name}, {method}, {rtol:.0e}: error {error / rtol:.2f} tolerances, estimate {traj.error / rtol:.2f}, {counts['steps']} "
            f"steps, {counts.get('trial steps', 0)} of trials"
        )
        assert 0.01 * rtol < error < 2 * rtol
        assert 0.2 < traj.error / error < 20


@pytest.mark.parametrize("method", METHODS)
def test_damped_motions_take_no_steps_for_errors_that_die_out(method):
    """A damped pendulum over ten and a hundred seconds at the same tolerance: the second takes few more steps."""
    m = mb.Model("pendulum", gravity=(0, -9.81, 0))
    bob = m.body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0, 0))
    m.revolute("pivot", m.ground, bob, at=(0, 0, 0), axis="z", c=1.0)
    steps = []
    for t in (10.0, 100.0):
        counts = mb.simulate(m, [t], rtol=1e-3, method=method).stats.counts
        steps.append(counts["steps"] + counts.get("trial steps", 0))
    print(f"{method}: {steps} steps")
    assert steps[1] < 6 * steps[0] and np.isfinite(steps).all()


def test_a_trial_costs_little_and_tells_how_much_of_errors_lasts():
    problem = zoo.SMOOTH["four_bars"]()
    traj = mb.simulate(problem.model, [0.3 * problem.t], rtol=1e-6, method="ali3p")
    error, counts = problem.error_of(traj), traj.stats.counts
    print(f"{error:.1e}, {counts}")
    assert error < 1.5e-6 and 0 < counts["trial steps"] < 0.15 * counts["steps"]
