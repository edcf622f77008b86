"""Outputs between steps against outputs at the ends of the same steps: mechanisms at random, trees and loops, stiff, with kinks.

The truth is a tight run by another scheme, or the motion piece by piece.
"""

from __future__ import annotations

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from kinked_motions import SCENES
from test_radau import ball_and_rod, oblique_four_bar, tilted_pendulum

WITHIN = np.array([0.07, 0.31, 0.5, 0.66, 0.94])
METHODS = {
    "explicit": {"method": "explicit"},
    "radau": {"method": "radau"},
    "order 9": {"method": "radau", "order": 9},
    "bdf": {"method": "bdf"},
    "bdf-bfgs": {"method": "bdf-bfgs"},
    "generalized-alpha": {"method": "generalized-alpha"},
    "ali3p": {"method": "ali3p"},
}
TIGHT = {"explicit": {"method": "radau", "order": 9, "rtol": 1e-12}}
OTHERWISE = {"method": "explicit", "rtol": 1e-13}


def sprung_pair(rng):
    """Two free bodies between oblique bushings, one of them a thousand times as stiff: decays and vibrations beside slow turns."""
    m = mb.Model("sprung pair", gravity=rng.normal(size=3) * 5)
    before, place = m.ground, np.zeros(3)
    for name, k in (("soft", 30.0), ("stiff", 3e4)):
        way = rng.normal(size=3)
        body = m.body(name, mass=1.0 + rng.random(), inertia=0.2 + 0.1 * rng.random(3), at=place + way / 2)
        m.bushing(f"{name} bushing", before, body, at=place, k=(k,) * 3 + (k,) * 3, c=(0.02 * k,) * 6)
        before, place = body, place + way
    return m


def within(steps):
    """The ends of steps, and places in each of them."""
    steps = np.asarray(steps)
    inside = (steps[:-1, None] + np.diff(steps)[:, None] * WITHIN).ravel()
    return np.unique(np.concatenate([steps[1:], inside]))


def places_and_rates(traj):
    names = [b.name for b in traj.snapshot.model.bodies]
    length = traj.snapshot.system.characteristic_length
    rates = [traj.velocity(n) / length for n in names] + [traj.angular_velocity(n) for n in names]
    return np.stack([traj.position(n) for n in names]) / length, np.stack(rates)


def errors(model, t, rtol, truth, **how):
    """Largest errors at the ends of the steps of a run, and of one with outputs between them too: (places, rates over the largest)."""
    at_ends = mb.simulate(model, t, rtol=rtol, **how)
    between = mb.simulate(model, within(at_ends.steps), rtol=rtol, **how)
    found = []
    for traj in (at_ends, between):
        pairs = zip(places_and_rates(traj), places_and_rates(truth(traj.t)), strict=True)
        found.append(
            [np.abs(own - exact).max() / (np.abs(exact).max() if k else 1.0) for k, (own, exact) in enumerate(pairs)]
        )
    places, rates = np.transpose(found)
    print(
        f"{how}, {rtol:.0e}: ends and between {places}, rates {rates}, {len(at_ends.steps) - 1}, {len(between.steps) - 1} steps"
    )
    return places, rates


@pytest.mark.some(7)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("make", [tilted_pendulum, oblique_four_bar, ball_and_rod], ids=lambda f: f.__name__)
def test_outputs_are_as_accurate_between_steps_as_at_their_ends(make, method, seed):
    m, truth = make(np.random.default_rng([seed, 7])), TIGHT.get(method, OTHERWISE)
    order_two = method in ("generalized-alpha", "ali3p")
    for rtol in (1e-4,) if order_two else (1e-4, 1e-6, 1e-8):
        places, rates = errors(m, 0.6, rtol, lambda times: mb.simulate(m, times, **truth), **METHODS[method])
        # rounding, and what the truth itself is off
        assert places[1] <= 3 * places[0] + 1e-11, (rtol, places)
        assert rates[1] <= 4 * rates[0] + 1e-10, (rtol, rates)


@pytest.mark.some(3)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("method", ["explicit", "radau", "order 9", "bdf", "bdf-bfgs"])
def test_outputs_of_stiff_scenes(method, seed):
    """Where something fast holds explicit steps short, or dies out, ends are far better than asked, and outputs are still better."""
    m, truth = sprung_pair(np.random.default_rng([seed, 7])), TIGHT.get(method, OTHERWISE)
    for rtol in (1e-4, 1e-6):
        places, rates = errors(m, 0.6, rtol, lambda times: mb.simulate(m, times, **truth), **METHODS[method])
        assert places[1] <= max(3 * places[0], rtol / 5), (rtol, places)
        # of fast motions rates count by what they move
        assert rates[1] <= max(4 * rates[0], 10 * rtol), (rtol, rates)


@pytest.mark.some(4)
@pytest.mark.parametrize("method", ["explicit", "radau", "order 9", "bdf"])
@pytest.mark.parametrize("name", SCENES)
def test_outputs_behind_kinks_are_as_accurate_as_the_steps(name, method):
    """Against the motion piece by piece."""
    scene, how = SCENES[name](2), METHODS[method]
    for rtol in (1e-5, 1e-7):
        steps = mb.simulate(scene.model, scene.t, rtol=rtol, **how).steps
        times = np.concatenate([[0.0], within(steps)])
        errors = [scene.error(mb.simulate(scene.model, t, rtol=rtol, **how)) for t in (steps, times)]
        print(f"{name}, {method}, {rtol:.0e}: {errors} in {len(steps) - 1} steps")
        # bristles hold explicit steps short
        assert errors[1] <= max(3 * errors[0], rtol / 30 if name == "bristles" else 1e-10)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("order", [5, 9])
def test_outputs_within_a_layer_that_a_step_goes_over(order, seed):
    """A fast decay at the start that the ends of long steps do not feel: outputs within it are right, and only they cost steps."""
    rng = np.random.default_rng([seed, 8])
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    problem, how = zoo.governor(t=0.3, turned=turned), {"method": "radau", "order": order}
    layer = np.geomspace(3e-6, 3e-3, 25)
    for rtol in (1e-6, 1e-8):
        traj = mb.simulate(problem.model, np.append(layer, problem.t), rtol=rtol, **how)
        late = mb.simulate(problem.model, np.array([0.15, problem.t]), rtol=rtol, **how)
        error = problem.error_of(traj)
        print(f"{error:.1e} in {len(traj.steps) - 1} steps, {len(late.steps) - 1} without outputs in the layer")
        assert error < 2 * rtol
        assert len(traj.steps) <= len(late.steps) + 30
