"""Gradients of "bdf": every scene, differences of the same steps, order, stiff springs, checkpoints, charts, breaks, given times."""

from dataclasses import replace

import jitter
import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from gradient_scenes import SCENES
from mbrs import _core
from mbrs.examples import five_bar
from mbrs.model.directions import directions
from mbrs.system.snapshot import Snapshot
from motion_models import open_chain, silent, spatial_loop
from test_gradient import FIVE_BAR, LENGTHS, differences, drift, everything, worst
from test_gradient_pairs import BDF_TIMES, asked_of, run_of
from test_gradient_radau import SKEW, SMOOTH, errors_of_motion_and_derivatives, place, two_masses, two_masses_by_hand

BDF = {"scheme": "bdf"}
FIXED = np.arange(11) * 6e-3


def runs(m):
    """The same motion with fixed steps and with steps and orders of a run with a tolerance."""
    x = np.array(Snapshot.of(m).tables["x"], dtype=float)
    return {"fixed": run_of(m, x, "bdf", FIXED), "variable": run_of(m, x, "bdf", BDF_TIMES)}


def apart(run, m):
    """Largest difference of adjoint and direct over the largest derivative by any number, of random weights at all steps."""
    along, asked = directions(m, all_addresses(m)), asked_of(m)
    run = replace(run, inner=True)
    made = run.direct(asked, along)
    read = run.nodes.quadrature != 0.0
    read[: len(run.times)] = True
    seeds = np.random.default_rng(3).normal(size=made["values"].shape) * read[:, None]
    forward = _core.MotionForward(run.snapshot.system, run.state.q, run.state.rate, [], run.options(asked, along))
    back = forward.gradient(seeds)[0]
    exact = np.einsum("tc,tcp->p", seeds, made["derivatives"])
    return np.abs(back - exact).max() / np.abs(exact).max()


@pytest.mark.some(8)
@pytest.mark.parametrize("name", SCENES)
def test_adjoint_is_direct_in_every_scene(name):
    m = silent(SCENES[name])
    for kind, run in runs(m).items():
        error = apart(run, m)
        print(f"{name}, {kind}: adjoint - direct {error:.1e}")
        assert error < 1e-9


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_a_stiff_spring_beside_a_soft_one_has_its_closed_form(method):
    """Steps that go over the fast vibration; the exponential of the equations, by complex steps."""
    now, t = {"stiff": 3.1e7, "soft": 5.3, "mass": 0.9}, 2.3
    goals = [mb.Final(lambda s: SKEW @ s.position("b") - 1.0), mb.Final(lambda s: SKEW @ s.velocity("b"))]
    value, slope = found = mb.gradient(two_masses(**now), goals, list(now), t=t, rtol=1e-9, method=method, **BDF)
    exact = np.array(
        [np.imag(two_masses_by_hand(**{**now, p: x * (1 + 1e-30j)}, t=t)) / (1e-30 * x) for p, x in now.items()]
    ).T
    sizes = np.array(list(now.values()))
    error = np.abs((slope - exact) * sizes).max() / np.abs(exact * sizes).max()
    miss = np.abs(value - two_masses_by_hand(**now, t=t)).max()
    print(f"{len(found.t) - 1} steps, values {miss:.1e}, slopes {error:.1e}")
    assert len(found.t) < 400
    assert miss < 1e-6
    assert error < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("make", list(SMOOTH), ids=lambda f: f.__name__)
def test_motion_and_derivatives_have_the_order_of_the_scheme(make):
    """Steps are so short that the leading term alone counts: with four times as long ones orders of the loop are up to 4.8."""
    errors = errors_of_motion_and_derivatives(make, "bdf", (0.00125, 0.000625))
    orders = np.log2(np.divide(*errors))
    print(f"{make.__name__}: errors {errors[1]}, orders {orders}")
    assert np.all(np.abs(orders - 4.0) < 0.3)


@pytest.mark.some(1)
@pytest.mark.parametrize("make", [open_chain, spatial_loop], ids=lambda f: f.__name__)
def test_differences_of_the_same_steps(make):
    m = silent(make)
    names = SMOOTH[make]
    psi = mb.Integral(everything(m))
    slope = mb.gradient(m, psi, names, t=0.2, step=0.01, **BDF).gradient
    # truncation of the differences, which falls with the fourth power, is below their rounding
    error = worst(slope, differences(m, psi, names, part=2e-4, t=0.2, step=0.01, **BDF))
    print(f"{make.__name__}: differences {error:.1e}")
    assert error < 1e-9


@pytest.mark.some(2)
@pytest.mark.parametrize("method", ["direct", "adjoint"])
@pytest.mark.parametrize(
    "steps", [{"step": 0.005}, {"rtol": 1e-8}, {"rtol": 1e-11}], ids=["step", "rtol 1e-8", "rtol 1e-11"]
)
def test_the_known_gradient_and_what_the_run_says_of_it(steps, method):
    """First steps of a tight tolerance are some microseconds long: rows of rates follow accelerations by as little."""
    found = mb.gradient(silent(five_bar), mb.Integral(drift), LENGTHS, t=1.0, method=method, **steps, **BDF)
    effects = np.abs(np.asarray(found.gradient) * found.where).max()
    true = np.abs((np.asarray(found.gradient) - FIVE_BAR[1.0][1]) * found.where).max() / effects
    print(f"{len(found.t) - 1} steps, error {true:.1e}, estimated {found.error:.1e}")
    assert abs(found.value - FIVE_BAR[1.0][0]) < 1e-5
    # the known gradient has eight digits
    assert true < 3.0 * found.error + 1e-8
    assert found.error < 100.0 * true + 1e-8


def test_values_are_those_of_the_motion():
    """Steps by a tolerance are solved to rounding in the gradient, to a part of the tolerance in the motion."""
    m = silent(spatial_loop)
    psi = mb.Final(place(m))
    for control, close in (({"step": 0.01}, 1e-10), ({"rtol": 1e-8}, 1e-7)):
        traj = mb.simulate(m, 0.5, method="bdf", **control)
        value = mb.gradient(m, psi, "spring.c", t=0.5, **control, **BDF).value
        body = m.bodies[-1].name
        own = float(np.sum(traj.position(body)[-1] * [1.0, -2.0, 0.5]))
        print(f"{control}: {abs(value - own):.1e}")
        assert abs(value - own) < close


def test_checkpoints_give_the_same():
    """Matrices and guesses begin anew at a checkpoint: the same to what Newton's method leaves."""
    m = silent(spatial_loop)
    psi = mb.Integral(place(m))
    for control in ({"step": 0.01}, {"rtol": 1e-6}):
        whole, parts = (
            mb.gradient(m, psi, SMOOTH[spatial_loop], t=0.4, method="adjoint", keep=keep, **control, **BDF)
            for keep in (2**23, 0)
        )
        assert parts.stats.counts["checkpoints"] > 1
        assert parts.gradient == pytest.approx(np.asarray(whole.gradient), rel=1e-9)


def test_given_times_draw_steps_to_them():
    """Steps by a tolerance end at the times, and the gradient stays as accurate."""
    m, at = silent(open_chain), [0.0613, 0.11, 0.3, 0.5]
    psi = mb.AtTimes(at, place(m))
    names = SMOOTH[open_chain]
    exact = mb.gradient(m, psi, names, t=0.5, rtol=1e-11, scheme="explicit").gradient
    found = mb.gradient(m, psi, names, t=0.5, rtol=1e-8, **BDF)
    print(f"{len(found.t) - 1} steps, error {worst(found.gradient, exact):.1e}")
    assert np.all(np.isin(at, found.t))
    assert worst(found.gradient, exact) < 1e-5


def top(spin):
    """A body on a ball joint that turns through several charts, and a free one beside it."""
    m = mb.Model("tops", gravity=(0.3, -0.2, -9.0))
    a = m.body("a", mass=0.7, inertia=(0.02, 0.03, 0.04), at=(0.1, 0.2, 0.3), angular_velocity=(1.0, 2.0, spin))
    b = m.body("b", mass=0.4, inertia=(0.01, 0.02, 0.015), at=(1.1, 0.2, 0.4), angular_velocity=(spin, -1.0, 3.0))
    m.spherical("ball", m.ground, a, at=(0, 0, 0))
    m.spring_damper("cord", a, b, at=((0.1, 0.2, 0.5), (1.1, 0.25, 0.4)), k=m.parameter("k", 9.0), c=0.1)
    return m


@pytest.mark.some(1)
@pytest.mark.parametrize("steps", [{"step": 0.01}, {"rtol": 1e-7}], ids=["step", "rtol"])
def test_rotations_through_many_charts(steps):
    """Both ways agree, and with differences where the steps are fixed ones."""
    m, names = top(14.0), ["k", "a.mass", "b.inertia[1,1]", "a.angular_velocity[0]"]
    psi = mb.Integral(lambda s: np.sum(s.rotation("b") * np.arange(9).reshape(3, 3)) + s.position("a")[0])
    direct, adjoint = (mb.gradient(m, psi, names, t=0.9, method=way, **steps, **BDF) for way in ("direct", "adjoint"))
    error = worst(adjoint.gradient, direct.gradient)
    print(f"{len(direct.t) - 1} steps, adjoint - direct {error:.1e}")
    assert error < 1e-9
    if "step" in steps:
        error = worst(direct.gradient, differences(m, psi, names, part=1e-4, t=0.9, **steps, **BDF))
        print(f"differences {error:.1e}")
        assert error < 1e-7


def pushed():
    m = mb.Model("pushed", gravity=(0, 0, -9.81))
    a = m.body("a", mass=m.parameter("mass", 1.3), inertia=(0.1, 0.2, 0.3), at=(0.4, 0, 0))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="y", k=m.parameter("k", 3.0), c=0.2)
    m.force("push", a, at=(0.8, 0, 0), value=(0, 0, mb.Ramp(6.0, start=0.2137)))
    return m


def test_breaks_begin_a_history_anew():
    """A load that is not smooth at a time: both ways agree, and with differences of the same steps."""
    m = pushed()
    psi, names = mb.Integral(lambda s: s.joint("A") ** 2), ["mass", "k"]
    for steps in ({"step": 0.02}, {"rtol": 1e-7}):
        found = [
            mb.gradient(m, psi, names, t=0.8, method=way, **steps, **BDF).gradient for way in ("direct", "adjoint")
        ]
        assert worst(found[1], found[0]) < 1e-9
    exact = mb.gradient(m, psi, names, t=0.8, rtol=1e-11, scheme="explicit").gradient
    print(f"error {worst(found[0], exact):.1e}")
    assert worst(found[0], exact) < 1e-5


def test_given_times_beside_a_break():
    """The history begins anew at the break all the same, and the times have steps of their own."""
    m, start = silent(pushed), 0.2137
    at = [2e-6, 3e-3, start - 2e-4, start + 1e-3, 0.5]
    psi, names = mb.AtTimes(at, lambda s: s.joint("A")), ["mass", "k"]
    exact = mb.gradient(m, psi, names, t=0.5, rtol=1e-11, scheme="explicit")
    for way in ("direct", "adjoint"):
        found = mb.gradient(m, psi, names, t=0.5, rtol=1e-8, method=way, **BDF)
        error = worst(found.gradient, exact.gradient)
        print(f"{way}: {len(found.t) - 1} steps, value {abs(found.value - exact.value):.1e}, error {error:.1e}")
        assert np.all(np.isin(at, found.t)) and np.abs(found.t - start).min() <= start * jitter.level()
        assert error < 1e-5
        assert abs(found.value - exact.value) < 1e-6


def test_a_step_that_counts_on_a_history_that_is_not_there_says_so():
    m = silent(pushed)
    x = np.array(Snapshot.of(m).tables["x"], dtype=float)
    start = float(x[np.argmin(np.abs(x - 0.2137))])
    run = replace(run_of(m, x, "bdf", BDF_TIMES), times=np.array([0.0, 0.1, start, 0.3]))
    for orders, text in (
        ((1, 1, -1), "from t = 0 s"),
        ((-1, 1, 1), rf"from t = {start!r} s".replace(".", r"\.")),
        ((-1, 1), "2 orders for 3"),
    ):
        with pytest.raises(mb.errors.ModelError, match=text):
            replace(run, orders=orders).direct(asked_of(m), None)


def test_a_trajectory_has_its_derivatives_over_time():
    m = silent(five_bar)
    goals = [mb.Final(lambda s, i=i: s.point("P2")[i]) for i in range(3)]
    for control in ({"step": 0.01}, {"rtol": 1e-6}):
        traj = mb.simulate(m, t=0.3, method="bdf", parameters=LENGTHS, **control)
        final = mb.gradient(m, goals, LENGTHS, t=0.3, method="adjoint", **control, **BDF)
        assert np.allclose(traj.sensitivity("P2")[-1], final.gradient, rtol=1e-9, atol=1e-12)
