"""Small promises of motions: chaos is told, drives that get stuck are named soon, estimates of methods that damp, starts that do not
close, starts of flexible bodies, damped motions over long times.
"""

from __future__ import annotations

import time
import warnings

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from flexible_models import MECHANISMS, cantilever
from mbrs.errors import ConvergenceError, MbrsWarning, ModelError
from scipy.linalg import expm

METHODS = ["auto", "explicit", "radau", "bdf", "bdf-bfgs", "generalized-alpha", "ali3p"]


def four_bar(rng, rod=None):
    """A linkage in a random plane; a rod in place of the last hinge where its length is given, which need not be the drawn one."""
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    at = [R @ p for p in np.array([[0.0, 0, 0], [0.7, 0.7, 0], [1.6, 0.9, 0], [1.5, 0, 0]])]
    m, before = mb.Model("linkage", gravity=R @ [0.3, -9.0, 0.4]), None
    for i in range(3):
        b = m.body(f"bar{i}", mass=1.0 + rng.random(), inertia=(0.05, 0.06, 0.07), at=0.5 * (at[i] + at[i + 1]))
        m.revolute(f"hinge{i}", before or m.ground, b, at=at[i], axis=R[:, 2])
        before = b
    if rod is None:
        m.revolute("hinge3", before, m.ground, at=at[3], axis=R[:, 2])
    else:
        m.distance("rod", m.ground, before, at=(at[3] + R @ [0.4, 0.2, 0.3], at[3]), length=rod)
    m.marker("tip", before, at=at[2])
    return m


# --- chaos -----


def double_pendulum(rng):
    """Two rods about one oblique axis, drawn upwards."""
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    m, before, place = mb.Model("pendulum", gravity=R @ [0, -9.81, 0]), None, np.zeros(3)
    for name, angle in (("upper", 1.9 + 0.3 * rng.random()), ("lower", 2.2 + 0.5 * rng.random())):
        way = R @ [np.cos(angle), np.sin(angle), 0]
        b = m.body(name, mass=1.0, inertia=(0.1, 0.1, 0.1), at=place + way / 2)
        m.revolute(f"{name} hinge", before or m.ground, b, at=place, axis=R[:, 2])
        before, place = b, place + way
    return m


@pytest.mark.parametrize("seed", range(3))
def test_chaos_is_told_with_the_error(seed):
    m, times = double_pendulum(np.random.default_rng(seed)), np.linspace(0, 30, 61)
    traj = mb.simulate(m, times)
    with pytest.warns(MbrsWarning, match=r"amplifies errors.*depends sensitively on its start.*from t = [\d.]+ s on"):
        error = traj.error
    assert error > 0.1
    # over a short time it can be followed, and nothing is said
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert mb.simulate(m, np.linspace(0, 1, 21)).error < 1e-4


@pytest.mark.some(3)
@pytest.mark.parametrize("method", ["auto", "radau", "generalized-alpha"])
def test_regular_motions_are_not_called_sensitive(method):
    for name in ("double_pendulum", "spring_pendulum", "five_bar", "free_body", "bead_on_arm", "slider_crank"):
        problem = zoo.SMOOTH[name]()
        for how in ({"rtol": 1e-4}, {"step": problem.t / 200}):
            with warnings.catch_warnings():
                warnings.filterwarnings("error", message="the motion amplifies")
                assert mb.simulate(problem.model, np.linspace(0, problem.t, 11), method=method, **how).error < 0.1


# --- drives -----


@pytest.mark.parametrize("method", METHODS)
def test_a_drive_into_an_impossible_pose_gives_up_soon_and_is_named(method):
    m = four_bar(np.random.default_rng(1))
    m.drive("motor", "hinge0", mb.Ramp(2.0))
    began = time.process_time()
    with pytest.raises(ConvergenceError, match=r"'motor'.*beyond this pose the loops cannot be closed") as caught:
        mb.simulate(m, 5.0, method=method, rtol=1e-4)
    steps = len(caught.value.result.steps)
    print(f"{method}: {steps} steps, {time.process_time() - began:.2f} s")
    # a tenth of a second; of order two, whose tolerance is that of all five seconds, as many steps as half a second needs
    assert steps < (30_000 if method in ("generalized-alpha", "ali3p") else 500)


# --- estimates -----


@pytest.mark.some(4)
@pytest.mark.parametrize("method", ["bdf", "bdf-bfgs", "radau", "generalized-alpha", "ali3p"])
def test_methods_that_damp_tell_their_error_in_flexible_scenes(method):
    """An elastic slider-crank, four-bar and pendulum at 1e-3, against the explicit method, which damps nothing."""
    for name in sorted(MECHANISMS):
        m, times = MECHANISMS[name](damping=0.0), np.linspace(0, 0.15, 13)
        traj = mb.simulate(m, times, rtol=1e-3, method=method)
        exact = mb.simulate(m, times, rtol=1e-11, method="explicit")
        bodies = [b.name for b in m.bodies]
        length = traj.snapshot.system.characteristic_length
        error = max(np.linalg.norm(traj.position(b) - exact.position(b), axis=1).max() for b in bodies) / length
        print(f"{name}, {method}: error {error:.1e}, said {traj.error:.1e}")
        assert error < 5 * traj.error + 1e-12


# --- starts -----


@pytest.mark.parametrize("seed", range(3))
def test_a_start_that_does_not_close_is_differentiable(seed):
    """The rod is shorter than drawn: closing it moves all bars, and derivatives go through that."""
    names = ["rod.length", "bar1.mass", "hinge2.at[0]", "bar2.at[1]"]

    def tip(change=None, by=0.0):
        m = four_bar(np.random.default_rng(seed), rod=0.49)
        if change:
            m.set({change: m.value(change) + by})
        return m, mb.simulate(m, 0.2, step=0.01, method="ali3p").point("tip")[-1]

    m, _ = tip()
    found = mb.simulate(m, 0.2, step=0.01, method="ali3p", parameters=names).sensitivity("tip.position")
    found = np.asarray(found)[-1]
    for i, name in enumerate(names):
        near, far = ((tip(name, e)[1] - tip(name, -e)[1]) / (2 * e) for e in (1e-4, 2e-4))
        assert found[:, i] == pytest.approx((4 * near - far) / 3, abs=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("seed", range(2))
def test_a_flexible_body_starts_where_it_is_bent(seed):
    """A clamped rod without gravity is linear in small deflections: exp(t A) of its matrices."""
    rng = np.random.default_rng(seed)
    m = cantilever(damping=1e-3, stiffening=False)
    at_rest = mb.linearize(m)
    q, rate = 1e-6 * rng.normal(size=4), 1e-4 * rng.normal(size=4)
    start = at_rest.state.deformed(m, "rod", q, rate)
    times = np.linspace(0.0, 0.5, 6)
    traj = mb.simulate(m, times, rtol=1e-10, at=start)
    M, C, K = at_rest.M, at_rest.C, at_rest.K
    A = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    exact = np.array([expm(A * t) @ np.concatenate([q, rate]) for t in times])
    assert np.abs(traj.modal("rod") - exact[:, :4]).max() < 1e-4 * np.abs(exact[:, :4]).max()
    assert np.abs(traj.modal_rate("rod") - exact[:, 4:]).max() < 1e-4 * np.abs(exact[:, 4:]).max()
    assert np.array_equal(traj.modal("rod")[0], q) and np.array_equal(start.deformed(m, m["rod"], q).rate, start.rate)
    with pytest.raises(ModelError, match="'clamp' is not a flexible body of 'cantilever'; it has: 'rod'"):
        start.deformed(m, "clamp", q)
    with pytest.raises(ModelError, match="q= of 'rod'"):
        start.deformed(m, "rod", q[:2])


# --- long times -----


@pytest.mark.slow
@pytest.mark.parametrize("method", ["generalized-alpha", "ali3p"])
def test_a_thousand_seconds_of_a_damped_motion_cost_what_a_hundred_cost(method):
    """It is at rest after a hundred; its error is that of the tolerance, which order two needs these steps for."""
    m = mb.Model("pendulum", gravity=(0.3, -9.81, 0.2))
    bob = m.body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0.1, -0.2))
    m.revolute("pivot", m.ground, bob, at=(0, 0, 0), axis=(0.1, 0.3, 1.0), c=0.2)
    steps = []
    for t in (100.0, 1000.0):
        times = np.linspace(0, t, 301)[1:]
        traj = mb.simulate(m, times, rtol=1e-3, method=method)
        exact = mb.simulate(m, times, rtol=1e-10, method="explicit")
        error = np.abs(traj.position("bob") - exact.position("bob")).max() / traj.snapshot.system.characteristic_length
        steps.append(len(traj.steps))
        print(f"{method}, {t:g} s: {steps[-1]} steps, error {error:.1e}, said {traj.error:.1e}", traj.stats.counts)
        assert 5e-5 < error < 2e-3 and error < 5 * traj.error
    assert steps[1] < 1.5 * steps[0]
