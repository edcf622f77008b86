"""Gradients over steps that the run which chose them kept: the same as over these steps made again, and no work done twice."""

from dataclasses import replace

import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from gradient_scenes import SCENES
from mbrs import _core
from mbrs.gradients.steps import prepare
from mbrs.model.directions import directions
from motion_models import open_chain, silent
from test_gradient_bdf import pushed, top
from test_gradient_pairs import asked_of

SCHEMES = ["radau", "bdf"]
# numbers that a motion may need to be kept whole
WHOLE = 2**23


def chosen(m, scheme, t, rtol, keep=WHOLE, psi=None):
    """A motion to be differentiated, with the steps that a tolerance chose."""
    psi = psi or mb.Final(lambda s: 0.0)
    return prepare(m, [psi], t, None, rtol, None, (), keep, scheme=scheme, weight="tangent", rho=0.8)


def backwards(run, m, seed=5):
    """Values of all quantities, derivatives of a random sum of them by all numbers, and the work of the way forwards."""
    along, asked = directions(m, all_addresses(m)), asked_of(m)
    forward = _core.MotionForward(run.snapshot.system, run.state.q, run.state.rate, [], run.options(asked, along))
    values = forward.values()
    # quantities of different units and sizes
    seeds = np.random.default_rng(seed).normal(size=values.shape) / (np.abs(values).max(axis=0) + 1e-3)
    return values, forward.gradient(seeds)[0], forward.counts()


def compared(m, scheme, t, rtol):
    """Largest differences of values and derivatives, kept and made again, over the largest of both; steps."""
    run = chosen(m, scheme, t, rtol)
    assert run.kept is not None
    (values, slopes, work), (other, again, more) = backwards(run, m), backwards(replace(run, kept=None), m)
    n = len(run.times) - 1
    assert work["steps"] == more["steps"] == n
    sizes = np.abs(other).max(axis=0) + 1e-3
    return np.abs((values - other) / sizes).max(), np.abs(slopes - again).max() / np.abs(again).max(), n


@pytest.mark.some(16)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", SCENES)
def test_kept_steps_are_those_that_are_made_again(name, scheme):
    """Every scene, by all its numbers: both are solved to rounding."""
    value, slope, n = compared(silent(SCENES[name]), scheme, 0.06, 1e-6)
    print(f"{name}, {n} steps: values {value:.1e}, derivatives {slope:.1e}")
    assert value < 1e-9
    assert slope < 1e-8


@pytest.mark.some(3)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    "make", [lambda: top(14.0), pushed, lambda: silent(open_chain)], ids=["top", "pushed", "chain"]
)
def test_through_charts_and_breaks(make, scheme):
    """Rotations through several charts, a load that is not smooth at a time, and many lengths and orders of steps."""
    value, slope, n = compared(make(), scheme, 0.8, 1e-7)
    print(f"{n} steps: values {value:.1e}, derivatives {slope:.1e}")
    assert value < 1e-8
    assert slope < 1e-7


WAYS = [(scheme, {"rtol": 1e-10}) for scheme in ("radau", "bdf", "explicit")]
WAYS += [(scheme, {"step": 1e-3}) for scheme in ("explicit", "radau", "generalized-alpha", "ali3p", "bdf")]


@pytest.mark.some(5)
@pytest.mark.parametrize("method", ["direct", "adjoint"])
@pytest.mark.parametrize(("scheme", "steps"), WAYS)
def test_the_time_at_which_a_load_begins(scheme, steps, method):
    """By differences of values of the explicit method: no stage of a step is behind the break where it ends."""
    m, name, e = pushed(), "push.z_start", 1e-3
    psi, now = mb.Integral(lambda s: s.joint("A") ** 2), m.value(name)
    value = {}
    for k in (-2, -1, 1, 2):
        m.set({name: now + k * e})
        value[k] = mb.gradient(m, psi, "k", t=0.8, rtol=1e-12, scheme="explicit").value
    m.set({name: now})
    exact = (8.0 * (value[1] - value[-1]) - (value[2] - value[-2])) / (12.0 * e)
    found = mb.gradient(m, psi, name, t=0.8, **steps, scheme=scheme, method=method).gradient[0]
    print(f"{found:.9f}, differences {exact:.9f}")
    # fixed steps of order two: 1e-3 of a period of 4 s
    assert found == pytest.approx(exact, rel=1e-6 if "rtol" in steps or scheme in ("explicit", "radau") else 2e-4)


@pytest.mark.some(2)
@pytest.mark.parametrize("method", ["direct", "adjoint"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_motion_is_made_once(scheme, method):
    """Newton's iterations of value and gradient together: those of the motion, and what solving it to rounding adds."""
    m = silent(open_chain)
    body = m.bodies[-1].name
    psi = mb.Final(lambda s: s.position(body)[0])
    alone = mb.simulate(m, 0.5, method=scheme, rtol=1e-9)
    found = mb.gradient(m, psi, all_addresses(m)[:3], t=0.5, rtol=1e-9, scheme=scheme, method=method)
    n, counts = len(found.t) - 1, found.stats.counts
    each, own = counts["iterations"] / n, alone.stats.counts["iterations"] / (len(alone.steps) - 1)
    print(f"{n} steps, {each:.2f} iterations a step, {own:.2f} of the motion alone")
    assert counts["steps"] == n
    assert each < 1.5 * own
    if method == "adjoint":
        # one matrix a step backwards
        forwards = backwards(chosen(m, scheme, 0.5, 1e-9), m)[2]["factorisations"]
        assert counts["factorisations"] == forwards + n


@pytest.mark.some(1)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_what_does_not_fit_is_made_again(scheme):
    """Steps that need more numbers than allowed, other times, other numbers of the model and another start are not taken for kept."""
    m = silent(open_chain)
    run = chosen(m, scheme, 0.3, 1e-6)
    few = chosen(m, scheme, 0.3, 1e-6, keep=100)
    assert few.kept is None
    assert np.array_equal(few.times, run.times)
    x = np.array(run.snapshot.tables["x"], dtype=float)
    moved = replace(run.snapshot, system=run.snapshot.system.with_values(x * (1.0 + 1e-9)))
    others = {
        "times": replace(run, times=run.times * (1.0 - 1e-9)),
        "numbers": replace(run, snapshot=moved),
        "start": replace(run, state=replace(run.state, rate=run.state.rate + 1e-9)),
    }
    for what, other in others.items():
        values, slopes, _ = backwards(other, m)
        again, more, _ = backwards(replace(other, kept=None), m)
        assert np.array_equal(values, again), what
        assert np.array_equal(slopes, more), what


@pytest.mark.parametrize("scheme", SCHEMES)
def test_times_within_the_motion_are_met(scheme):
    """Steps that had to move are made again."""
    m, at = silent(open_chain), [0.0613, 0.3]
    psi = mb.AtTimes(at, lambda s: s.position(m.bodies[-1].name)[0])
    run = chosen(m, scheme, 0.3, 1e-6, psi=psi)
    assert run.kept is None
    assert np.all(np.isin(at, run.times))
