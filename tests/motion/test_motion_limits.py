"""Where motions are hardest to be honest about: contacts, rounding, ends of tables, absurd loads, results without outputs."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ConvergenceError


class Bouncing:
    """A ball that falls on a spring without damping, along a random direction, in random units."""

    def __init__(self, seed, stiff):
        rng = np.random.default_rng(seed)
        self.length, self.mass = 10.0 ** rng.uniform(-1, 2), 10.0 ** rng.uniform(-1, 2)
        axis = rng.normal(size=3)
        self.axis = axis / np.linalg.norm(axis)
        self.g = self.length * rng.uniform(5.0, 15.0)
        self.drop = self.length * rng.uniform(0.3, 0.6)
        self.k = stiff * self.mass * self.g / self.length
        self.at = self.length * rng.normal(size=3)
        self.fall = np.sqrt(2 * self.drop / self.g)

    def model(self):
        m = mb.Model("bouncing ball", gravity=tuple(self.g * self.axis))
        b = m.body("ball", mass=self.mass, inertia=(self.mass * self.length**2,) * 3, at=self.at)
        # a law on a prismatic joint: its coordinate is how far the ball fell
        m.prismatic("rail", m.ground, b, at=self.at, axis=self.axis, law=mb.Gap(self.k, self.drop))
        m.marker("far", m.ground, at=self.at + self.length * np.array([0.6, -0.5, 0.62]))
        return m

    def fallen(self, t):
        """Parabola, harmonic contact, parabola, ..."""
        w, v = np.sqrt(self.k / self.mass), self.g * self.fall
        contact = 2 * (np.pi - np.arctan(v * w / self.g)) / w
        since = np.mod(np.asarray(t) + self.fall, 2 * self.fall + contact)
        flying = self.drop - 0.5 * self.g * (self.fall**2 - (since - self.fall) ** 2)
        held = since - 2 * self.fall
        pressed = self.drop + self.g / w**2 * (1 - np.cos(w * held)) + v / w * np.sin(w * held)
        return np.where(held < 0, flying, pressed)

    def error(self, traj):
        found = (traj.position("ball") - self.at) @ self.axis
        return np.abs(found - self.fallen(traj.t)).max() / self.length

    def energy(self, traj):
        return np.ptp(np.asarray(traj.energy)) / (self.mass * self.g * self.drop)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("stiff", [1e3, 1e6])
def test_outputs_between_steps_without_tangents_are_as_good_as_the_steps(stiff, seed):
    ball = Bouncing(seed, stiff)
    t = 5.3 * ball.fall
    at_steps = mb.simulate(ball.model(), t, rtol=1e-8, method="bdf-bfgs")
    between = mb.simulate(ball.model(), np.linspace(0, t, 173), rtol=1e-8, method="bdf-bfgs")
    errors = ball.error(at_steps), ball.error(between)
    print(f"k {stiff:.0e}: steps {errors[0]:.1e}, between {errors[1]:.1e}, energy {ball.energy(between):.1e}")
    assert max(errors) < 3e-7 and errors[1] < 10 * errors[0] + 1e-8
    assert ball.energy(between) < 1e-5


def test_start_steps_without_tangents_estimate_their_error():
    """Whatever they are made of: a sum over parts, not zero."""
    import motion_problems as zoo

    traj = mb.simulate(zoo.gap(1e6).model, 0.3, rtol=1e-6, method="bdf-bfgs")
    assert np.all(traj.local_error[:3] > 0) and np.all(traj.local_error <= 1)


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("method", ["ali3p", "generalized-alpha"])
@pytest.mark.parametrize("stiff", [1e3, 1e6])
def test_methods_of_order_two_pass_contacts(stiff, method, seed):
    ball = Bouncing(seed, stiff)
    t = 3.3 * ball.fall
    for rtol in (1e-4, 1e-6):
        traj = mb.simulate(
            ball.model(), t, rtol=rtol, method=method, rho=1.0 if method == "generalized-alpha" else None
        )
        print(f"{method}, k {stiff:.0e}, rtol {rtol:.0e}: {len(traj.steps)} steps, error {ball.error(traj):.1e}")
        assert traj.status == "finished" and ball.error(traj) < 30 * rtol


@pytest.mark.filterwarnings("error::mbrs.errors.KinkWarning")
@pytest.mark.parametrize("stiff", [1e3, 1e4, 1e5])
def test_a_gradient_takes_its_steps_across_a_contact(stiff):
    ball = Bouncing(1, stiff)
    t, mass = 2.1 * ball.fall, ball.mass
    made = mb.gradient(ball.model(), mb.Final(lambda s: s.position("ball") @ ball.axis), "ball.mass", t=t)
    assert made.status == "converged"
    assert made.value - ball.at @ ball.axis == pytest.approx(ball.fallen(t), abs=1e-5 * ball.length)
    ends = []
    for ball.mass in (mass * (1 - 1e-5), mass * (1 + 1e-5)):
        ends.append(float(ball.fallen(t)))
    exact = (ends[1] - ends[0]) / (2e-5 * mass)
    assert made.gradient == pytest.approx(exact, rel=1e-4)


def spinning(seed):
    rng = np.random.default_rng(seed)
    m = mb.Model("door", gravity=tuple(9.0 * rng.normal(size=3)))
    b = m.body("b", mass=2.3, inertia=(0.7, 0.9, 1.1), at=rng.normal(size=3))
    m.revolute("hinge", m.ground, b, at=rng.normal(size=3), axis=rng.normal(size=3))
    return m


@pytest.mark.parametrize("seed", range(4))
def test_the_estimate_does_not_fall_below_rounding(seed):
    m, times = spinning(seed), np.linspace(0, 4.0, 9)
    traj, other = (mb.simulate(m, times, rtol=r, method="explicit") for r in (1e-13, 3e-13))
    # two runs differ by what rounding and truncation make of either
    apart = np.abs(traj.position("b") - other.position("b")).max() / traj.snapshot.system.characteristic_length
    print(f"apart {apart:.1e}, estimate {traj.error:.1e}")
    assert traj.error > 1e-14 and traj.error > 0.1 * apart


@pytest.mark.parametrize("lines", [True, False])
def test_the_last_output_at_the_end_of_a_table_is_consistent(lines):
    rng = np.random.default_rng(3)
    for _ in range(3):
        t, y = np.cumsum(rng.uniform(0.3, 2.0, 5)), np.cumsum(rng.uniform(0.2, 1.5, 5))
        t, y = t - t[0], y - y[0]
        m = spinning(int(rng.integers(100)))
        m.drive("d", "hinge", mb.Table(t, y, kind="linear" if lines else "cubic") if lines else mb.Table(t, y))
        for method in ("explicit", "bdf", "generalized-alpha"):
            traj = mb.simulate(m, t=t[-1], rtol=1e-6, method=method)
            worst = traj.residual.max(axis=0)
            print(method, lines, worst)
            assert worst[0] < 1e-10 and worst[1] < 1e-8


def test_a_motion_that_stops_before_its_first_output_has_empty_results():
    m = spinning(5)
    m.force("f", "b", value=lambda t: (1.0, 2.0, 1e308) if t > 0.1 else (1.0, 2.0, 0.3))
    with pytest.raises(ConvergenceError) as caught:
        mb.simulate(m, t=[0.7, 1.0])
    traj = caught.value.result
    assert len(traj.t) == 0 and traj.energy.total.shape == (0,) and traj.residual.shape == (0, 3)
    assert traj.position("b").shape == (0, 3) and traj.joint("hinge").shape[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_absurd_loads_and_speeds_stop_with_a_reason(seed):
    rng = np.random.default_rng(seed)
    for load, speed in ((1e12, 0.0), (0.0, 1e8)):
        m = mb.Model("absurd", gravity=(0, 0, -9.81))
        a = m.body("a", mass=1.0, inertia=(0.1, 0.2, 0.3), at=rng.normal(size=3), velocity=speed * rng.normal(size=3))
        b = m.body("b", mass=2.0, inertia=(0.3, 0.2, 0.3), at=rng.normal(size=3))
        m.spherical("ball", m.ground, a, at=(0, 0, 0))
        m.spherical("joint", a, b, at=rng.normal(size=3))
        if load:
            m.force("f", b, value=load * rng.normal(size=3))
        try:
            traj = mb.simulate(m, t=1.0, step=0.01, method="bdf-bfgs")
            counts, why = traj.stats.counts, traj.status
        except ConvergenceError as error:
            counts, why = error.result.stats.counts, str(error)
        print(load, speed, counts, why[:120])
        # 16 x 4096 parts of start steps with twelve evaluations each, at most
        assert counts["force evaluations"] < 900_000


def test_a_step_that_cannot_be_made_says_why():
    rng = np.random.default_rng(8)
    m = mb.Model("struck", gravity=(0, 0, -9.81))
    b = m.body("b", mass=1.3, inertia=(0.2, 0.3, 0.4), at=rng.normal(size=3))
    m.force("f", b, value=lambda t: (1e4 if t > 0.2371 else 0.0, 0.0, 0.0))
    with pytest.raises(ConvergenceError, match=r"no step is short enough.*jumps or changes faster"):
        mb.simulate(m, 0.5, rtol=1e-13, method="ali3p")


@pytest.mark.parametrize("seed", range(3))
def test_a_fast_hinge_takes_no_more_steps_than_a_slow_one(seed):
    """Angles over a step are counted by rates; the axis goes through the centre of mass, so that the turn is even."""
    rng = np.random.default_rng(seed)
    axis, at = rng.normal(size=3), rng.normal(size=3)
    axis = axis / np.linalg.norm(axis)
    steps, times = [], np.array([0.0, 0.37, 5.1, 10.0])
    for speed in (10.0, 1000.0):
        m = mb.Model("spinning", gravity=(0, 0, -9.81))
        b = m.body("b", mass=2.0, inertia=(0.4, 0.5, 0.6), at=at, angular_velocity=speed * axis)
        m.revolute("hinge", m.ground, b, at=at, axis=axis)
        traj = mb.simulate(m, 10.0)
        between = mb.simulate(m, times)
        steps.append(len(traj.steps) - 1)
        turned = np.ravel(between.joint("hinge")) - between.joint("hinge")[0]
        assert np.abs(turned - speed * times).max() < 1e-7 * speed
        assert traj.joint("hinge")[-1] - traj.joint("hinge")[0] == pytest.approx(10.0 * speed, rel=1e-8)
    print("steps", steps)
    assert steps[1] <= 2 * steps[0]


@pytest.mark.parametrize("seed", range(3))
def test_turns_are_counted_where_the_rate_swings(seed):
    """A door that turns over and over under its weight: the angle of DOP853."""
    from scipy.integrate import solve_ivp

    rng = np.random.default_rng(seed)
    arm, inertia = rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.5)
    m = mb.Model("looping", gravity=(0, -9.81, 0))
    w = 14.0 + 3.0 * seed
    b = m.body(
        "b", mass=1.0, inertia=(inertia,) * 3, at=(arm, 0, 0), velocity=(0, w * arm, 0), angular_velocity=(0, 0, w)
    )
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z")
    times = np.linspace(0, 6.0, 31)
    slope = lambda _, y: [y[1], -9.81 * arm * np.cos(y[0]) / (inertia + arm**2)]  # noqa: E731
    truth = solve_ivp(slope, (0, 6.0), [0.0, w], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times).y[0]
    for rtol in (1e-4, 1e-8):
        found = np.ravel(mb.simulate(m, times, rtol=rtol).joint("hinge"))
        print(f"rtol {rtol:.0e}: {np.abs(found - truth).max():.1e} rad of {truth[-1]:.0f}")
        assert np.abs(found - truth).max() < 1e4 * rtol
