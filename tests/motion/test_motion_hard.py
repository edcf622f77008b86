"""Hard cases of motion in time; each prints its measured error (pytest -s). Data invented unless a source is named."""

from __future__ import annotations

import dataclasses
import warnings

import jitter
import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from mbrs.errors import AssemblyError, ConvergenceError, MbrsError, MbrsWarning, ModelError
from scipy.integrate import solve_ivp
from scipy.special import ellipk

METHODS = ("explicit", "generalized-alpha", "radau", "bdf")
# tolerance at which each method is asked, and what it has to reach in characteristic lengths
ASKED = {"explicit": (1e-9, 1e-7), "generalized-alpha": (1e-5, 1e-3), "radau": (1e-8, 1e-6), "bdf": (1e-8, 1e-5)}


@pytest.mark.slow
# four-bars pass poses where two branches meet; lengths that differ by any noise make another linkage there
@pytest.mark.exact
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("make", [zoo.four_bars, zoo.bricard], ids=lambda f: f.__name__)
def test_redundant_constraints(make, method):
    problem = make()
    rtol, limit = ASKED[method]
    traj = mb.simulate(problem.model, np.linspace(0, problem.t, 11), rtol=rtol, method=method)
    error = problem.error_of(traj)
    print(f"{problem.name}, {method}: error {error:.1e}, constraints {traj.residual.max():.1e}")
    assert error < limit and traj.residual[:, 0].max() < 1e-10


PASSED = {
    "explicit": (1e-5, 1e-9),
    "radau": (1e-6, 1e-8),
    "bdf": (1e-6, 1e-8),
    "generalized-alpha": (1e-3, 1e-5, 1e-6),
    "ali3p": (1e-3, 1e-5, 1e-6),
}


@pytest.mark.some(3)
# lengths that differ by any noise make another linkage at a pose where two branches meet
@pytest.mark.exact
@pytest.mark.parametrize("method", PASSED)
@pytest.mark.parametrize(
    ("n", "speed"), [(1, 1.0), (1, 2.0), (1, 5.0), *(pytest.param(3, v, marks=pytest.mark.slow) for v in (1.0, 2.0))]
)
def test_passing_the_singular_pose_of_the_parallelogram(n, speed, method):
    """All links align twice per turn, where loops lose rank; the branch of the parallelogram has to be kept."""
    problem = zoo.four_bars(n, t=6.0, speed=speed)
    for rtol in PASSED[method]:
        traj = mb.simulate(problem.model, np.linspace(0, problem.t, 61), rtol=rtol, method=method)
        y = traj.point("tip")[:, 1]
        passes = int(np.sum(np.diff(np.sign(y)) != 0))
        error = problem.error_of(traj)
        print(
            f"{n} four-bar, {method}, rtol {rtol:.0e}: {passes} passes, {traj.stats.counts.get('detours', 0)} detours, "
            f"error {error:.1e}"
        )
        assert passes >= 3 and error < 3e3 * rtol and traj.residual.max() < 1e-10


@pytest.mark.parametrize("method", [*METHODS, "ali3p", "bdf-bfgs"])
def test_a_balance_stays_at_rest(method):
    """Upright links in an unstable balance: rounding is all there is, and nothing is relative to it."""
    problem = zoo.four_bars(1, t=1.0, speed=0.0)
    traj = mb.simulate(problem.model, problem.t, rtol=1e-6, method=method)
    moved = np.abs(traj.point("tip") - traj.point("tip")[0]).max()
    print(f"{method}: moved {moved:.1e} m in {len(traj.steps) - 1} steps")
    assert moved < 1e-7


@pytest.mark.parametrize("t", [1.0, np.linspace(0, 1.0, 21)], ids=["at the steps", "between"])
def test_bushings_of_1e12(t):
    """The vibration of 1e6 rad/s moves nothing that the tolerance sees: steps go over it."""
    problem = zoo.bushings(stiff=1e12 / 900)
    traj = mb.simulate(problem.model, t, rtol=1e-6)
    error = problem.error_of(traj)
    print(f"1e12 N/m, {traj.method}: error {error:.1e} in {len(traj.steps) - 1} steps")
    assert traj.method == "radau" and error < 1e-4 and len(traj.steps) < 2000


@pytest.mark.parametrize("ratio", [1e6, 1e-6])
def test_mass_ratio(ratio):
    problem = zoo.double_pendulum(ratio)
    traj = mb.simulate(problem.model, np.linspace(0, 1, 11), rtol=1e-9)
    error = problem.error_of(traj)
    print(f"mass ratio {ratio:.0e}: error {error:.1e}")
    assert error < 1e-8


@pytest.mark.some(2)
@pytest.mark.parametrize("method", METHODS)
def test_steps_of_1e_7(method):
    """Neither positions nor multipliers lose digits by 1/h^2."""
    problem = zoo.four_bars()
    end = 2e-4
    fine = mb.simulate(problem.model, end, step=1e-7, method=method)
    error = problem.error_of(fine)
    coarse = mb.simulate(problem.model, end, step=1e-5, method="explicit")
    force = np.abs(fine.multipliers[-1] - coarse.multipliers[-1]).max() / np.abs(coarse.multipliers[-1]).max()
    print(f"{method}: {len(fine.t)} points, position {error:.1e}, multipliers {force:.1e}")
    assert error < 1e-12 and force < 1e-8


@pytest.mark.slow
def test_a_thousand_seconds_of_a_double_pendulum():
    problem = zoo.double_pendulum()
    traj = mb.simulate(problem.model, np.linspace(0, 1000, 501), rtol=1e-9)
    drift = np.abs(traj.energy.total - traj.energy.total[0]).max() / np.ptp(traj.energy.kinetic)
    print(f"1000 s: {len(traj.steps) - 1} steps, energy {drift:.1e} of the kinetic")
    assert drift < 1e-4 and traj.residual.max() < 1e-10


def test_a_thousand_turns_of_a_rotor():
    """An unbalanced rotor under gravity: a turn takes 4 K(4 g'/w^2)/w (closed form), so after 1000 it is where it was."""
    w, m_, r, inertia = 40.0, 2.0, 0.1, 0.05
    g = m_ * 9.81 * r / (inertia + m_ * r * r)
    turn = 4 * ellipk(4 * g / w**2) / w
    m = mb.Model("rotor", gravity=(0, -9.81, 0))
    b = m.body(
        "rotor", mass=m_, inertia=(inertia,) * 3, at=(0, -r, 0), velocity=(w * r, 0, 0), angular_velocity=(0, 0, w)
    )
    m.revolute("shaft", m.ground, b, at=(0, 0, 0), axis="z")
    traj = mb.simulate(m, [0.0, 1000 * turn], rtol=1e-11)
    error = abs(traj.joint("shaft")[-1] - 2000 * np.pi)
    print(f"1000 turns: {error:.1e} rad, {len(traj.steps) - 1} steps")
    assert error < 1e-5


def test_inconsistent_starts_are_projected_and_impossible_ones_refused():
    problem = zoo.four_bars()
    start = mb.simulate(problem.model, [0.0, 0.1], rtol=1e-9).state(0.1)
    off = start.q.copy()
    off[0] += 1e-3
    moved = dataclasses.replace(start, q=off, rate=start.rate * np.linspace(0.9, 1.1, len(start.rate)))
    with pytest.warns(MbrsWarning) as said:
        traj = mb.simulate(problem.model, 0.2, at=moved)
    texts = " ".join(str(w.message) for w in said)
    print(texts)
    assert "initial positions" in texts and "initial velocitys" not in texts and "velocit" in texts
    assert traj.residual.max() < 1e-10
    m = mb.Model("too short", gravity=(0, 0, -9.81))
    a = m.body("a", mass=1.0, inertia=(0.1,) * 3, at=(0.5, 0, 0))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.distance("rod", m.ground, a, at=((5, 0, 0), (1, 0, 0)), length=1.0)
    with pytest.raises((AssemblyError, MbrsError), match="rod"):
        mb.simulate(m, 1.0)


@pytest.mark.parametrize("method", METHODS)
def test_a_drive_with_a_kink(method):
    """A carriage follows a broken line; the pendulum on it swings by u" = -(g u)/l for small angles: here by pieces, DOP853."""
    g, length = 9.81, 0.5
    m = mb.Model("carriage", gravity=(0, 0, -g))
    carriage = m.body("carriage", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0))
    bob = m.body("bob", mass=0.3, inertia=(0.0, 0.0, 0.0), at=(0, 0, -length))
    rail = m.prismatic("rail", m.ground, carriage, at=(0, 0, 0), axis="x")
    m.revolute("pivot", carriage, bob, at=(0, 0, 0), axis="y")
    m.drive("motor", rail, mb.Table([0.0, 0.5, 1.0, 2.0], [0.0, 0.4, 0.1, 0.1], kind="linear"))
    rates = [0.8, -0.6, 0.0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        traj = mb.simulate(m, [0.0, 0.3, 0.5, 0.8, 1.0, 1.6], rtol=ASKED[method][0], method=method)
    # angle from the vertical, w: a kink of the rail by dv turns it by -dv cos/l at once
    # a body without a given velocity starts with that of the drives, here the whole pendulum with the carriage
    y, here, out = np.array([0.0, 0.0]), 0.0, {0.0: 0.0}
    for k, stop in enumerate([0.5, 1.0, 1.6]):
        times = [t for t in (0.3, 0.5, 0.8, 1.0, 1.6) if here < t <= stop]
        found = solve_ivp(
            lambda t, y: [y[1], -g / length * np.sin(y[0])], (here, stop), y, "DOP853", times, rtol=1e-12, atol=1e-13
        )
        out.update(zip(times, found.y[0], strict=True))
        y, here = found.y[:, -1], stop
        if k < 2:
            y = y + [0.0, -(rates[k + 1] - rates[k]) * np.cos(y[0]) / length]
    exact = np.array([out[t] for t in traj.t])
    ours = np.arcsin((traj.position("bob")[:, 0] - traj.position("carriage")[:, 0]) / length)
    error = np.abs(ours - exact).max()
    print(f"kinks, {method}: angle {error:.1e} rad")
    assert error < {"explicit": 1e-9, "generalized-alpha": 1e-5, "radau": 1e-7, "bdf": 1e-6}[method]


def stick_slip_truth(times, mass, k, kt, slip, speed, c=0.0, push=lambda t: 0.0):
    """A mass on a spring k, a damper c and a Jenkins slider (kt, slip), by pieces between slip and stick; DOP853 with events."""
    state, z, here, out = np.array([0.0, speed]), 0.0, 0.0, {}
    times = [t for t in times if t > 0]
    sticking = True
    direction = 1.0
    while here < times[-1]:
        if sticking:
            force = lambda u, z=z: kt * (u - z)  # noqa: E731
            ends = [lambda t, y, z=z: kt * (y[0] - z) - slip, lambda t, y, z=z: kt * (y[0] - z) + slip]
            ends[0].direction, ends[1].direction = 1.0, -1.0
        else:
            force = lambda u, d=direction: d * slip  # noqa: E731
            ends = [lambda t, y: y[1]]
            ends[0].direction = -direction
        for e in ends:
            e.terminal = True
        slope = lambda t, y, f=force: [y[1], (push(t) - k * y[0] - c * y[1] - f(y[0])) / mass]  # noqa: E731
        found = solve_ivp(
            slope, (here, times[-1]), state, "DOP853", rtol=1e-12, atol=1e-14, events=ends, dense_output=True
        )
        for t in times:
            if here < t <= found.t[-1]:
                out[t] = float(found.sol(t)[0])
        here, state = found.t[-1], found.y[:, -1]
        if sticking:
            direction = np.sign(state[1])
        else:
            z = state[0] - direction * slip / kt
        sticking = not sticking
    return np.array([out[t] for t in times])


@pytest.mark.some(2)
@pytest.mark.parametrize("method", METHODS)
def test_stick_slip(method):
    mass, k, kt, slip, speed = 1.0, 60.0, 800.0, 3.0, 1.5
    m = mb.Model("slider")
    b = m.body("mass", mass=mass, inertia=(0.1,) * 3, at=(0, 0, 0), velocity=(speed, 0, 0))
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis="x", k=k, law=mb.Jenkins(kt, slip))
    times = np.linspace(0.0, 2.0, 21)
    exact = stick_slip_truth(times, mass, k, kt, slip, speed)
    errors = [
        np.abs(mb.simulate(m, times, step=h, method=method).position("mass")[1:, 0] - exact).max() for h in (1e-3, 1e-4)
    ]
    print(f"stick-slip, {method}: {errors[0]:.1e} m with 1e-3 s, {errors[1]:.1e} m with 1e-4 s")
    # memory is marched with the steps
    assert errors[1] < 0.05 * errors[0] and errors[1] < 1e-6


@pytest.mark.some(2)
@pytest.mark.parametrize(("method", "factor"), [("explicit", 5), ("radau", 50), ("bdf", 100)])
def test_turns_of_a_slider_from_rest(method, factor):
    """Fifteen turns of a slider, from rest under a force that grows from nothing: the error falls with the tolerance."""
    m = mb.Model("slider")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=100.0, c=0.2, law=mb.Jenkins(400.0, 2.0))
    m.force("push", b, at=(0, 0, 0), value=(mb.Sine(5.0, omega=9.0), 0, 0))
    exact = stick_slip_truth([5.0], 1.0, 100.0, 400.0, 2.0, 0.0, 0.2, lambda t: 5.0 * np.sin(9.0 * t))[0]
    for rtol in (1e-4, 1e-6, 1e-8, 1e-10):
        traj = mb.simulate(m, [5.0], rtol=rtol, method=method)
        error = abs(traj.position("b")[-1, 0] - exact)
        print(f"{method}, rtol {rtol:.0e}: {error:.1e} m, {traj.stats.counts['kinks met']} met")
        assert error < factor * rtol + 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_a_gap_that_closes_at_speed(method):
    problem = zoo.gap(stop=1e6)
    rtol = {"explicit": 1e-8, "generalized-alpha": 1e-4, "radau": 1e-7, "bdf": 1e-7}[method]
    traj = mb.simulate(problem.model, np.linspace(0, 2, 21), rtol=rtol, method=method)
    error = problem.error_of(traj)
    print(f"gap of 1e6 N/m, {method}: error {error:.1e}, {len(traj.steps) - 1} steps")
    assert error < {"explicit": 1e-6, "generalized-alpha": 1e-3, "radau": 1e-5, "bdf": 1e-4}[method]


@pytest.mark.parametrize(
    ("late", "error", "text"),
    [
        (float("nan"), ModelError, "push.*must be finite"),
        (ZeroDivisionError("it broke"), ZeroDivisionError, "it broke"),
    ],
    ids=["nan", "raises"],
)
def test_a_python_force_that_fails_on_the_way(late, error, text):
    """What a function of the user raises comes out as it is; a number that is none names the function."""

    def force(t):
        if t > 0.35:
            if isinstance(late, Exception):
                raise late
            return late
        return 1.0

    m = mb.Model("pushed")
    b = m.body("mass", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0))
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis="x")
    m.force("push", b, at=(0, 0, 0), value=(force, 0, 0))
    with pytest.raises(error, match=text) as caught:
        mb.simulate(m, 1.0, max_step=0.05)
    print(caught.value)
    assert error is ModelError or "push" in "".join(caught.value.__notes__)


@pytest.mark.slow
def test_outputs_far_denser_and_far_sparser_than_steps():
    problem = zoo.spherical_pendulum()
    dense = mb.simulate(problem.model, np.linspace(0, 2, 20001), rtol=1e-9)
    sparse = mb.simulate(problem.model, [2.0], rtol=1e-9)
    apart = np.abs(dense.position("mass")[-1] - sparse.position("mass")[-1]).max()
    error = problem.error_of(dense)
    print(f"{len(dense.t)} outputs in {len(dense.steps) - 1} steps: {error:.1e}; one output: {apart:.1e} apart")
    assert len(dense.steps) < 100 and error < 1e-7 and apart < 1e-12 and len(sparse.t) == 1


def test_an_undamped_mode_that_bdf_amplifies_is_named():
    m = mb.Model("two masses")
    a = m.body("slow", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0), velocity=(0.1, 0, 0))
    b = m.body("fast", mass=1.0, inertia=(0.1,) * 3, at=(1, 0, 0), velocity=(0.1, 0, 0))
    m.prismatic("guide", m.ground, a, at=(0, 0, 0), axis="x", k=1.0)
    m.prismatic("second", a, b, at=(1, 0, 0), axis="x", k=1e4)
    with pytest.warns(MbrsWarning, match="amplifies mode 1"):
        mb.simulate(m, 3.0, step=1e-2, method="bdf")


def test_a_step_that_underflows_says_when_and_what():
    """A spring that becomes rigid at once: 1e30 N/m from a gap of 0.1 m; the mass meets it at t = 0.1 s."""
    m = mb.Model("wall")
    b = m.body("mass", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0), velocity=(1.0, 0, 0))
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis="x", law=mb.Gap(1e40, 0.1))
    with pytest.raises(ConvergenceError, match="guide") as caught:
        mb.simulate(m, 1.0, rtol=1e-8, method="explicit", max_steps=100000)
    print(caught.value)
    assert caught.value.result.t[-1] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize("kind", ["joint", "torsion", "cylindrical", "slider"])
@pytest.mark.parametrize("method", [*METHODS, "bdf-bfgs"])
def test_springs_of_hinges_wind_up_over_turns(kind, method):
    """J phi" = -k phi swings by 15.5 rad; a slider of k_t on a hinge slips at its limit however often that turns."""
    k, inertia, w0 = 0.1, 1.5, 4.0
    m = mb.Model("spring")
    b = m.body("wheel", mass=1.0, inertia=(1.0, 1.0, inertia), at=(0, 0, 0), angular_velocity=(0, 0, w0))
    times = np.linspace(0.0, 8.0, 9)
    if kind == "cylindrical":
        m.cylindrical("hinge", m.ground, b, at=(0, 0, 0), axis="z", k=(1.0, k))
    elif kind == "slider":
        m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z", law=mb.Jenkins(50.0, 0.3))
    else:
        m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z", k=k if kind == "joint" else None)
    if kind == "torsion":
        m.torsion("spring", m.ground, b, at=(0, 0, 0), axis="z", k=k)
    rtol, limit = ASKED.get(method, (1e-7, 1e-4))
    traj = mb.simulate(m, times, rtol=rtol, method=method)
    angle = traj.joint("hinge") if kind != "cylindrical" else traj.joint("hinge")[:, 1]
    if kind == "slider":
        # it sticks at first, for 0.006 rad; then J phi" = -0.3
        exact = w0 * times - 0.1 * times**2
        limit = max(limit, 0.05)
    else:
        w = np.sqrt(k / inertia)
        exact = w0 / w * np.sin(w * times)
    error = np.abs(angle - exact).max()
    print(f"{kind}, {method}: {error:.1e} rad of {np.abs(exact).max():.1f}")
    assert error < 30 * limit
    if kind != "slider":
        assert np.ptp(traj.energy.total) < 30 * limit * traj.energy.kinetic[0]
        # a restart knows how far it is wound up
        half = mb.simulate(m, [4.0], rtol=rtol, method=method)
        rest = mb.simulate(m, [8.0], rtol=rtol, method=method, at=half.state())
        assert rest.rate[-1] == pytest.approx(traj.rate[-1], abs=100 * limit)
        # and so does a linearisation
        assert mb.linearize(m, at=half.state()).K[-1, -1] == pytest.approx(k, rel=1e-6)


def test_auto_sees_friction_that_holds_later():
    """The block slides at first, where the law is flat, then sticks: 4 N / (1e-6 m/s 2 kg) = 2e6 1/s."""
    m = mb.Model("block")
    b = m.body("block", mass=2.0, inertia=(0.1,) * 3, at=(0, 0, 0), velocity=(3.0, 0, 0))
    m.prismatic("floor", m.ground, b, at=(0, 0, 0), axis="x", law=mb.CoulombTanh(4.0, 1e-6))
    traj = mb.simulate(m, 3.0, rtol=1e-6)
    error = abs(traj.position("block")[-1, 0] - 9.0 / 4.0)
    print(f"{traj.method}: {len(traj.steps) - 1} steps, {error:.1e} m")
    assert traj.method == "radau" and "stiff" in traj.stats.route and len(traj.steps) < 500 and error < 1e-5
    without = mb.simulate(m, 3.0, rtol=1e-6, without=("friction",))
    assert without.method == "explicit"


@pytest.mark.parametrize("method", ["explicit", "radau", "bdf", "generalized-alpha", "bdf-bfgs"])
def test_a_table_that_wakes_up_is_not_passed_over(method):
    """A push of 4 ms after a third of a second of nothing: 10 N s sqrt(2 pi) 4e-3 of 1 kg."""
    times = np.linspace(0.0, 1.0, 1001)
    width = 4e-3
    m = mb.Model("pushed")
    b = m.body("mass", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0))
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis="x")
    m.force("push", b, at=(0, 0, 0), value=(mb.Table(times, 10 * np.exp(-(((times - 0.33) / width) ** 2) / 2)), 0, 0))
    for rtol in (1e-3, 1e-6):
        traj = mb.simulate(m, 1.0, rtol=rtol, method=method)
        error = abs(traj.velocity("mass")[-1, 0] - 10 * np.sqrt(2 * np.pi) * width)
        print(f"{method}, {rtol:.0e}: {error:.1e} m/s in {len(traj.steps) - 1} steps, estimated {traj.error:.1e} m")
        assert error < 30 * rtol


@pytest.mark.parametrize("method", ["auto", *METHODS, "bdf-bfgs", "ali3p"])
@pytest.mark.parametrize("how", [dict(rtol=1e-6), dict(step=0.1)], ids=["controlled", "fixed"])
def test_a_scene_that_cannot_move(method, how):
    """Welded to the ground: nothing moves, and the weld carries the weight."""
    m = mb.Model("welded", gravity=(0, 0, -9.81))
    b = m.body("block", mass=2.0, inertia=(0.1,) * 3, at=(1, 0, 0))
    m.fixed("weld", m.ground, b, at=(0, 0, 0))
    traj = mb.simulate(m, 1.0, method=method, **how)
    assert traj.status == "finished" and traj.t[-1] == 1.0 and traj.error == 0.0
    assert np.abs(traj.position("block")[-1] - [1, 0, 0]).max() <= jitter.level()
    assert traj.reaction("weld")[-1] == pytest.approx([0, 0, 19.62, 0, -19.62, 0])


def test_an_end_that_steps_cannot_reach_is_said():
    with pytest.raises(ConvergenceError, match="would not reach the end"):
        mb.simulate(zoo.double_pendulum().model, 1e16)
