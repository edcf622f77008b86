"""Steps by a tolerance end at kinks of laws: motions against their exact pieces, work, and laws that chatter."""

from __future__ import annotations

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from kinked_motions import SCENES, Numbers, by_pieces, dry, stops
from test_motion_limits import Bouncing

ORDER_TWO = ["generalized-alpha", "ali3p"]
HIGH = ["explicit", "radau", "bdf", "bdf-bfgs"]
# of kinks and their steps
WORK = ("kinks met", "kinks passed over", "steps to kinks")


def motion(scene, method, rtol):
    traj = mb.simulate(scene.model, np.linspace(0, scene.t, 41), rtol=rtol, method=method)
    error, counts = scene.error(traj), traj.stats.counts
    print(
        f"{method} at {rtol:.0e}: error {error:.1e}, said {traj.error:.1e}, {len(traj.steps) - 1} steps, "
        f"{[counts.get(k, 0) for k in ('rejected steps', *WORK)]}"
    )
    return traj, error


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("method", [*HIGH, *ORDER_TWO])
@pytest.mark.parametrize("name", SCENES)
def test_the_error_is_the_one_that_is_told(name, method, seed):
    scene = SCENES[name](seed)
    traj, error = motion(scene, method, 1e-4 if method in ORDER_TWO else 1e-7)
    assert traj.stats.counts["kinks met"] > 2
    assert error < 3 * traj.error + 1e-9


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SCENES)
def test_the_error_of_histories_that_begin_at_kinks_is_told(name, seed):
    """Each history of "bdf-bfgs" begins with 1e-8 at best, which finer tolerances do not better."""
    traj, error = motion(SCENES[name](seed), "bdf-bfgs", 1e-9)
    assert traj.error / 3 < error < 3 * traj.error


def smooth(seed):
    """The block of the scene of dry friction without any law."""
    n = Numbers(np.random.default_rng([seed, 5]))

    def truth(times):
        def rates(t, y, sides):
            return np.array([y[1], (n.force(t) - n.k * y[0] - n.c * y[1]) / n.mass])

        return by_pieces(rates, lambda t, y, s: np.ones(1), None, [0.0, n.speed], (1,), times)

    return n.scene(None, truth)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_steps_of_bdf_behind_kinks_are_as_accurate_as_others(rtol, seed):
    """Friction changes the motion little: its kinks may not change the error much."""
    errors = [motion(scene, "bdf", rtol)[1] for scene in (smooth(seed), SCENES["dry"](seed))]
    assert errors[1] < 3 * errors[0]


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", SCENES)
def test_a_tolerance_is_that_of_the_whole_motion(name, rtol):
    assert motion(SCENES[name](1), "bdf-bfgs", rtol)[1] < rtol


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_steps_end_at_kinks_that_errors_show(rtol, seed):
    """Friction of ten tolerances of the push, and of a tenth of one."""
    (strong, error), (weak, small) = (motion(dry(seed, part * rtol), "radau", rtol) for part in (10.0, 0.1))
    assert strong.stats.counts["kinks met"] >= 5 and error < 3 * rtol
    assert not any(weak.stats.counts.get(k, 0) for k in WORK) and small < 3 * rtol


@pytest.mark.parametrize("seed", range(3))
def test_steps_behind_kinks_are_not_short_for_nothing(seed):
    """One or two from corner to corner of a measured curve."""
    counts = motion(SCENES["cornered"](seed), "explicit", 1e-3)[0].stats.counts
    assert counts["steps"] < 2.5 * counts["kinks met"]


def test_a_step_that_leaves_a_kink_and_comes_back_is_seen():
    """The block is behind a corner within a step alone, and farther from it on the side that it came from."""
    assert motion(SCENES["cornered"](0), "explicit", 1e-4)[1] < 30e-4


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("method", HIGH)
def test_a_stiff_contact_is_not_stepped_over(method, seed):
    """A ball that just touches feels nothing of the contact yet: the next step must not go over all its vibrations."""
    ball = Bouncing(seed, 1e6)
    for rtol in (1e-4, 1e-6):
        traj = mb.simulate(ball.model(), 3.3 * ball.fall, rtol=rtol, method=method)
        print(f"{method}, {rtol:.0e}: error {ball.error(traj):.1e}, {traj.stats.counts['kinks met']} kinks met")
        assert traj.stats.counts["kinks met"] == 4
        assert ball.error(traj) < 100 * rtol


def test_steps_behind_contacts_are_good_at_once():
    """Of a spring that does not act yet the error is that of its first vibration: few steps are made again."""
    balls = [Bouncing(seed, stiff) for seed in range(3) for stiff in (1e4, 1e6, 1e8)]
    counts = [mb.simulate(b.model(), 3.3 * b.fall, rtol=1e-4, method="bdf").stats.counts for b in balls]
    print([c["rejected steps"] for c in counts])
    assert all(c["kinks met"] == 4 for c in counts)
    assert sum(c["rejected steps"] for c in counts) < 45


@pytest.mark.parametrize("method", HIGH)
def test_hinges_with_hysteresis_reverse_more_often_than_steps_end(method):
    m = mb.Model("chain", gravity=(3.0, -8.0, 2.0))
    before = m.ground
    for i in range(6):
        link = m.body(f"link{i}", mass=1.0, inertia=(0.004, 0.01, 0.012), at=(0.2 * i + 0.1, 0.0, 0.0))
        law = mb.BoucWen(20.0, 0.2, 2.0, 1.0, 1.0)
        m.revolute(f"hinge{i}", before, link, at=(0.2 * i, 0, 0), axis=(0.1, 0.2, 0.9), c=0.01, law=law)
        before = link
    traj = mb.simulate(m, 0.3, rtol=1e-4, method=method)
    assert not any(traj.stats.counts.get(k, 0) for k in WORK)


def counts_of(law, method, **more):
    """Two blocks on oblique rails, one behind the other, under a spring law or more."""
    m = mb.Model("blocks", gravity=(1.0, -8.0, 3.0))
    a = m.body("a", mass=2.0, inertia=(1.0, 1.2, 1.4), at=(0.1, 0.2, 0.3))
    b = m.body("b", mass=1.0, inertia=(1.0, 1.2, 1.4), at=(0.4, 0.1, 0.3))
    m.revolute("hinge", m.ground, a, at=(0.0, 0.3, 0.1), axis=(0.3, 0.5, 0.8))
    m.revolute("elbow", a, b, at=(0.3, 0.0, 0.2), axis=(0.7, -0.2, 0.4), c=0.1, law=law)
    traj = mb.simulate(m, 1.0, method=method, **more)
    # the stop has tangents of its own
    return {k: n for k, n in traj.stats.counts.items() if k not in (*WORK, "law tangents")}, traj.stats.counts


# "bdf-bfgs" begins the motion of a model with kinks in another way
@pytest.mark.exact  # both models get noise of their own
@pytest.mark.parametrize("method", ["explicit", "radau", "bdf", *ORDER_TWO])
def test_a_stop_that_is_never_met_costs_no_evaluation(method):
    rtol = 1e-4 if method in ORDER_TWO else 1e-7
    spring = mb.Polynomial1D([0.0, 30.0])
    plain, _ = counts_of([spring], method, rtol=rtol)
    beside, all_counts = counts_of([spring, mb.Gap(1e5, 50.0)], method, rtol=rtol)
    assert beside == plain
    assert not any(all_counts.get(k, 0) for k in WORK)


@pytest.mark.parametrize("method", [*HIGH, *ORDER_TWO])
def test_fixed_steps_are_those_that_were_asked_for(method):
    scene = stops(3, stiff=100.0)
    traj = mb.simulate(scene.model, scene.t, step=scene.t / 2000, method=method)
    assert len(traj.steps) == 2001 and np.ptp(np.diff(traj.steps)) < 1e-9 * scene.t
    assert not any(traj.stats.counts.get(k, 0) for k in WORK)


@pytest.mark.parametrize("method", HIGH)
@pytest.mark.parametrize("stiff", [1e4, 1e6])
def test_stops_are_met_and_not_groped_for(stiff, method):
    """A kink costs a few steps that are made again, not the many that shrink to it."""
    problem = zoo.gap(stop=stiff)
    counts = mb.simulate(problem.model, np.linspace(0, 2, 21), rtol=1e-8, method=method).stats.counts
    print(f"{method}, {stiff:.0e}: {counts['steps']} steps, {[counts.get(k, 0) for k in ('rejected steps', *WORK)]}")
    assert counts["kinks met"] > 5
    assert counts["steps to kinks"] <= 4 * counts["kinks met"]


def held_by_friction(law, push=0.5):
    """A block that friction brings to rest on an oblique rail, and a weak push that lets it go again."""
    axis = np.array([0.48, -0.6, 0.64])
    m = mb.Model("brake")
    b = m.body("block", mass=2.0, inertia=(1.0, 1.0, 1.0), at=(0.3, -0.2, 0.1), velocity=tuple(3.0 * axis))
    m.prismatic("rail", m.ground, b, at=(0.3, -0.2, 0.1), axis=axis, law=law)
    m.force("push", b, at=(0.3, -0.2, 0.1), value=[mb.Sine(push * 12.0 * a, 2.0) for a in axis])
    return m


@pytest.mark.parametrize("method", [*HIGH, *ORDER_TWO])
def test_bristles_that_stick_and_quiver_end_no_countless_steps(method):
    law = mb.LuGre(8.0, 10.0, 0.05, 1e5, 300.0, 0.4)
    rtol = 1e-3 if method in ORDER_TWO else 1e-6
    traj = mb.simulate(held_by_friction(law), 4.0, rtol=rtol, method=method, max_steps=200_000)
    counts = traj.stats.counts
    print(method, counts["steps"], [counts.get(k, 0) for k in ("rejected steps", *WORK)])
    assert counts.get("steps to kinks", 0) < 100 + 0.2 * counts["steps"]


@pytest.mark.parametrize("method", HIGH)
def test_a_force_that_jumps_back_and_forth_does_not_hold_the_motion_up(method):
    """Dry friction that would stick: the rate passes zero in every step, until the push is stronger."""
    law = mb.FunctionLaw(lambda t, u, v: 8.0 * np.tanh(v / 1e-3) + 2.0 * np.where(v > 0, 1.0, -1.0))
    traj = mb.simulate(held_by_friction(law, push=0.9), 2.0, rtol=1e-4, method=method, max_steps=300_000)
    counts = traj.stats.counts
    print(method, counts["steps"], [counts.get(k, 0) for k in ("rejected steps", *WORK)])
    assert traj.status == "finished"
