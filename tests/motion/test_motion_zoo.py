"""`mb.simulate` over the zoo of motions: true errors against tolerances and estimates, steps against those of mbrs.reference,
orders, constraints, energy, work counts. Every test prints what it measured.
"""

from __future__ import annotations

import functools
import warnings

import jitter
import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.errors import ModelError
from mbrs.model.tables import tables
from mbrs.reference.simulate import begin
from mbrs.studies.measures import motion_difference
from oracles.explicit import explicit
from oracles.generalized_alpha import generalized_alpha

TOLERANCES = 10.0 ** -np.arange(3.0, 11.0)
# parallelograms pass the pose in which they are flat: with bars unequal by noise the branches part there, and the motion has no
# finite condition
NAMES = [n for n in zoo.SMOOTH if jitter.seed() is None or "four_bars" not in n]


@functools.cache
def problem(name):
    return zoo.SMOOTH[name]()


@functools.cache
def tight(name, end=None):
    """A run to compare rotations with as well, and whose places the truth confirms: the tightest tolerance for which it
    does, since `test_the_singular_pose_at_every_tolerance` is another matter.
    """
    p = problem(name)
    times = np.linspace(0.0, end or p.t, 9)
    for rtol in (1e-12, 3e-12, 3e-13, 3e-11, 1e-10):
        traj = simulated(name, t=times, rtol=rtol, method="explicit")
        if p.error(traj.t, p.places(traj)) < 1e-10 * max(1.0, p.length):
            return traj
    raise AssertionError(f"no tight run of {name} agrees with its truth")


def times_of(name):
    """Outputs at which runs are compared: one alone could be right by chance."""
    return np.linspace(0.0, problem(name).t, 9)


def simulated(name, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        return mb.simulate(problem(name).model, **options)


def off(traj, other):
    """What `traj.error` estimates: the largest |dx|/L_c and angle between two runs with the same outputs."""
    return motion_difference(traj, other)


@pytest.mark.some(8)
@pytest.mark.parametrize("name", NAMES)
def test_tight_runs_are_true(name):
    """Against closed forms and equations written by hand."""
    p = problem(name)
    error = p.error(tight(name).t, p.places(tight(name)))
    print(f"{name}: {error:.1e} m")
    assert error < 1e-10 * max(1.0, p.length)


@pytest.mark.some(1)
@pytest.mark.parametrize(
    "coordinates",
    [None, "tree", "independent"],
)
# lengths that differ by any noise make another linkage at a pose where two branches meet
@pytest.mark.exact
def test_the_singular_pose_at_every_tolerance(coordinates):
    """The four-bar passes the pose in which its links align on the branch on which it arrives, however short its steps."""
    p, wrong = problem("four_bars"), {}
    for rtol in 10.0 ** -np.arange(3.0, 13.1, 0.5):
        traj = simulated("four_bars", t=[p.t], rtol=max(rtol, 1e-13), method="explicit", coordinates=coordinates)
        error = p.error(traj.t, p.places(traj))
        if error > 100 * rtol + 1e-4:
            wrong[f"{rtol:.0e}"] = f"{error:.1e} m"
    print(f"wrong branch or lost: {wrong or 'never'}")
    assert not wrong


def test_auto_is_within_a_hundred_tolerances():
    """The method chosen by the scene, all outputs, against the truth."""
    for name in zoo.SMOOTH:
        p = problem(name)
        traj = simulated(name, t=np.linspace(0.0, p.t, 33), rtol=1e-8)
        error = p.error(traj.t, p.places(traj))
        print(f"{name:20s} {traj.method:18s} {error:.1e} m, {len(traj.steps) - 1} steps")
        assert error < 1e-6 * p.length


@functools.cache
def errors(name, method):
    """True and estimated errors over the tolerances."""
    true, estimated = [], []
    for rtol in TOLERANCES:
        traj = simulated(name, t=times_of(name), rtol=rtol, method=method)
        true.append(off(traj, tight(name)))
        estimated.append(traj.error)
    return np.array(true), np.array(estimated)


def test_achieved_error_follows_the_tolerance():
    """Slope of log(true error) over log(tolerance), 1e-3 to 1e-10: between .8 and 1.2 on at least twelve problems."""
    slopes = {}
    for name in NAMES:
        true, _ = errors(name, "explicit")
        known = true > 0.0  # zero where a run is the one that all are compared with
        slopes[name] = float(np.polyfit(np.log10(TOLERANCES[known]), np.log10(true[known]), 1)[0])
        print(f"{name:20s} slope {slopes[name]:.2f}, errors {true[0]:.1e} ... {true[-1]:.1e}")
    assert sum(0.8 <= s <= 1.2 for s in slopes.values()) >= 12


@pytest.mark.slow
def test_error_estimates():
    """Over at least 200 runs with random tolerances and ends: true/estimated within [.01, 10] in 95 %, and how many
    lie within a factor of ten either way.
    """
    rng = np.random.default_rng(4)
    ratios = []
    for i in range(210):
        name = NAMES[i % len(NAMES)]
        p = problem(name)
        end = p.t * rng.uniform(0.3, 1.0)
        times = np.linspace(0.0, end, 9)
        traj = simulated(name, t=times, rtol=10.0 ** rng.uniform(-9.0, -4.0), method="explicit")
        ratios.append(off(traj, tight(name, end)) / traj.error)
    ratios = np.array(ratios)
    bounded = np.mean((ratios >= 0.01) & (ratios <= 10.0))
    near = np.mean((ratios >= 0.1) & (ratios <= 10.0))
    low, middle, high = np.quantile(ratios, [0.025, 0.5, 0.975])
    print(
        f"true/estimated: median {middle:.2f}, 95 % within {low:.3f} ... {high:.2f}; {100 * near:.1f} % within ten either way"
    )
    print(f"within [.01, 10]: {100 * bounded:.1f} % of {len(ratios)}")
    assert bounded >= 0.95


# --- step by step -----

SCHEMES = {"explicit": explicit, "generalized-alpha": generalized_alpha}


@pytest.mark.oracle
@pytest.mark.parametrize("name", zoo.SMOOTH)
@pytest.mark.parametrize("method", SCHEMES)
def test_every_step_is_that_of_the_reference(name, method):
    """Six steps from the same start: poses, rates and accelerations. An implicit step stops at 1e-9 of its change."""
    p = problem(name)
    s = ref.System(tables(p.model))
    h = p.t / (1000 if name == "heavy_top" else 100)  # the fast top turns by half a radian in its longer steps
    history = SCHEMES[method](s, begin(s, ref.drawn_state(s)), h, 6)
    traj = simulated(name, t=6 * h, step=h, method=method)
    assert np.allclose(traj.t, history.t, rtol=0, atol=1e-14)
    position = np.stack([traj.position(b.name) for b in s.bodies], axis=1)
    gap = np.abs(position - history.positions(s)).max() / p.length
    size = np.abs(history.rates).max()
    rate = np.abs(traj.rate - history.rates).max() / size
    a = np.array([i.a for i in history.instants])
    acceleration = np.abs(traj.acceleration - a).max() / np.abs(a).max()
    print(f"{name}, {method}: positions {gap:.1e}, rates {rate:.1e}, accelerations {acceleration:.1e}")
    limit = 1e-12 if method == "explicit" else 1e-8
    assert gap < limit and rate < 10 * limit and acceleration < 100 * limit


@pytest.mark.parametrize(
    "name",
    [n for n in NAMES if n in ("double_pendulum", "four_bars", "spherical_pendulum", "free_body", "swing", "skate")],
)
@pytest.mark.parametrize(("method", "order"), [("generalized-alpha", 2), ("bdf-bfgs", 4)])
def test_orders(name, method, order):
    """Halving the step."""
    p = problem(name)
    true = []
    for n in (200, 400):
        traj = simulated(name, t=times_of(name), step=p.t / n, method=method)
        true.append(off(traj, tight(name)))
    slope = np.log2(true[0] / true[1])
    print(f"{name}, {method}: {true[0]:.1e}, {true[1]:.1e}, order {slope:.2f}")
    assert abs(slope - order) < 0.3


# --- what holds -----

METHODS_HERE = ["auto", "generalized-alpha", "bdf", "bdf-bfgs"]


@pytest.mark.parametrize("method", METHODS_HERE)
def test_constraints_at_every_output(method):
    """At most 1e-10 of the scales of length and velocity, on three levels, wherever outputs lie."""
    for name in ("four_bars", "slider_crank", "spherical_pendulum", "five_bar", "skate", "swing", "rolling_disc"):
        p = problem(name)
        end = 0.2 * p.t
        how = {"rtol": 1e-7} if method == "auto" else {"step": end / 60}
        traj = simulated(name, t=np.linspace(0.0, end, 47), method=method, **how)
        worst = traj.residual.max(axis=0)
        print(f"{name:20s} {method}: {worst[0]:.1e}, {worst[1]:.1e}, {worst[2]:.1e}")
        assert worst[0] < 1e-10 and worst[1] < 1e-10 and worst[2] < 1e-10


@pytest.mark.parametrize("name", [n for n in zoo.SMOOTH if zoo.SMOOTH[n]().conserves])
def test_energy(name):
    """Drift of the sum over the kinetic energy at its largest."""
    p = problem(name)
    energy = simulated(name, t=p.t, rtol=1e-9).energy
    drift = np.ptp(energy.total) / energy.kinetic.max()
    print(f"{name}: {drift:.1e}")
    assert drift < 1e-6


@pytest.mark.oracle
def test_bricard_against_the_reference():
    p = zoo.bricard(0.4)
    times = np.linspace(0.0, p.t, 4)
    traj = mb.simulate(p.model, t=times, rtol=1e-10)
    error = p.error(times, p.places(traj))
    print(f"Bricard: {error:.1e} m, energy {np.ptp(traj.energy.total):.1e} J, constraints {traj.residual.max():.1e}")
    assert error < 1e-8


@pytest.mark.parametrize("make", [zoo.gap, zoo.quarter_car])
def test_motions_that_are_not_smooth(make):
    """A stop, and a road whose acceleration jumps: the error still falls with the tolerance."""
    p, found = make(), []
    for rtol in (1e-5, 1e-7, 1e-9):
        traj = mb.simulate(p.model, t=np.linspace(0.0, p.t, 21), rtol=rtol)
        found.append(p.error(traj.t, p.places(traj)))
    print(f"{p.name}: " + ", ".join(f"{e:.1e}" for e in found))
    assert found[2] < 1e-6 and found[2] < found[0]


# --- what it costs -----


def test_absent_effects_cost_nothing():
    """An open tree has no multipliers and no projections; an explicit scene no tangents and no factorisations."""
    counts = dict(simulated("chain", t=0.2, rtol=1e-6, method="explicit").stats.counts)
    print(counts)
    for absent in (
        "tangents",
        "factorisations",
        "velocity projections",
        "position projections",
        "multiplier solutions",
    ):
        assert counts.get(absent, 0) == 0
    assert counts["force evaluations"] > 0
    loop = dict(simulated("four_bars", t=0.2, rtol=1e-6, method="explicit").stats.counts)
    assert loop.get("tangents", 0) == 0 and loop["velocity projections"] > 0


def test_the_derivative_free_solver_computes_no_tangent():
    counts = dict(simulated("double_pendulum", t=0.1, step=1e-3, method="bdf-bfgs").stats.counts)
    print(counts)
    assert counts.get("tangents", 0) == 0


def test_work_is_the_same_every_time():
    """Counts are deterministic, so that they can prove what a scene costs."""
    one, two = (simulated("slider_crank", t=0.3, rtol=1e-7).stats.counts for _ in range(2))
    assert dict(one) == dict(two)


def test_tighter_costs_more_and_a_longer_run_in_proportion():
    evaluations = [simulated("five_bar", t=1.0, rtol=r).stats.counts["force evaluations"] for r in (1e-4, 1e-7, 1e-10)]
    print(evaluations)
    assert evaluations[0] < evaluations[1] < evaluations[2]


# --- studies -----


def test_accuracy_study_of_a_motion():
    """Without a reference the tightest run is taken, and errors fall with the tolerance."""
    m = mb.examples.slider_crank()
    study = mb.accuracy_study(mb.simulate, m, t=1.0, method="explicit", rtol=10.0 ** -np.arange(3, 10), repeat=1)
    errors = [p.error for p in study.points]
    print(study)
    assert np.polyfit(np.arange(6), np.log10(errors[:-1]), 1)[0] < -0.6
    assert study.recommend(error=1e-5) is not None


def test_motion_difference_is_a_distance():
    one, two = (simulated("free_body", t=[0.0, end], rtol=1e-8) for end in (0.2, 0.3))
    assert motion_difference(one, one) == 0.0
    with pytest.raises(ModelError, match="different times"):
        motion_difference(one, two)
