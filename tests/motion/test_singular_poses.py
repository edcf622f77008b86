"""Motions past poses in which rows lose rank: right, or stopped with the pose and its joints, never on the other branch in silence.

Not held by "bdf-bfgs" (docs/motion.md).
"""

from __future__ import annotations

import warnings

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from mbrs.errors import ConvergenceError
from scipy.integrate import solve_ivp

# two branches of the motion meet where all links align: lengths that differ by any noise make another linkage there
pytestmark = pytest.mark.exact

# Errors over the tolerance that motions of 10 s with some ten passes reach without a loss, and the least that a pose may leave which is
# passed without a crossing (measured: 3e-6)
AMPLIFIED, LEAST = 1e5, 1e-5
LOST = 1e-2


def rod(m, name, ends, mass, velocities, turning):
    start, end = (np.array(e) for e in ends)
    along = end - start
    length = np.linalg.norm(along)
    along /= length
    across = np.eye(3) - np.outer(along, along)
    inertia = mass * length**2 * (across / 12 + 1e-4 * np.outer(along, along))
    place, velocity = (start + end) / 2, (velocities[0] + velocities[1]) / 2
    return m.body(
        name, mass=mass, inertia=inertia, at=tuple(place), velocity=tuple(velocity), angular_velocity=tuple(turning)
    )


def parallelograms(seed):
    """A row of one to three in a random plane, of random size and speed: model, and place of its tip over time."""
    r = np.random.default_rng(seed)
    n = int(r.choice([1, 1, 2, 3]))
    turn = np.linalg.qr(r.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    e1, e2, e3 = turn.T
    size = 10.0 ** r.uniform(-1, 1)
    post, beam = size * r.uniform(0.7, 1.4, 2)
    post_mass, beam_mass = r.uniform(0.5, 2, 2)
    gravity = -9.81 * size * r.uniform(0.7, 1.3) * e2
    speed, drawn, origin = r.uniform(0.3, 3.0), r.uniform(-0.3, 0.3), 0.3 * size * r.normal(size=3)

    def up(angle):
        return np.sin(angle)[..., None] * e1 + np.cos(angle)[..., None] * e2

    def slope(angle):
        return np.cos(angle)[..., None] * e1 - np.sin(angle)[..., None] * e2

    m = mb.Model("row", gravity=tuple(gravity))
    top, moving, still = post * up(np.array(drawn)), speed * post * slope(np.array(drawn)), np.zeros(3)
    feet = [origin + i * beam * e1 for i in range(n + 1)]
    posts = [rod(m, f"post{i}", (f, f + top), post_mass, (still, moving), -speed * e3) for i, f in enumerate(feet)]
    beams = [
        rod(m, f"beam{i}", (feet[i] + top, feet[i + 1] + top), beam_mass, (moving, moving), still) for i in range(n)
    ]
    axis = tuple(e3)
    for i in range(n + 1):
        m.revolute(f"foot{i}", m.ground, posts[i], at=tuple(feet[i]), axis=axis)
    for i in range(n):
        m.revolute(f"left{i}", posts[i], beams[i], at=tuple(feet[i] + top), axis=axis)
        m.revolute(f"right{i}", posts[i + 1], beams[i], at=tuple(feet[i + 1] + top), axis=axis)
    m.marker("tip", posts[0], at=tuple(origin + top))
    inertia = (n + 1) * post_mass * post**2 / 3 + n * beam_mass * post**2
    weight = ((n + 1) * post_mass / 2 + n * beam_mass) * post

    def tip(times):
        def rates(_, y):
            return [y[1], weight / inertia * (gravity @ slope(np.array(y[0])))]

        angle = solve_ivp(
            rates, (0, times[-1]), [drawn, speed], method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times
        ).y[0]
        return origin + post * up(angle)

    return m, tip, post


def moved(m, times, **options):
    """The trajectory, and why it stopped or None."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        try:
            return mb.simulate(m, times, **options), None
        except ConvergenceError as stop:
            return stop.result, str(stop)


WAYS = [
    ("explicit", None, (1e-4, 1e-7, 1e-9, 1e-11, 1e-12, 3e-13, 1e-13)),
    ("explicit", "independent", (1e-8, 1e-11, 1e-13)),
    ("radau", None, (1e-6, 1e-9, 1e-11)),
    ("bdf", None, (1e-6, 1e-8, 1e-9, 1e-10)),
    ("generalized-alpha", None, (1e-4,)),
    ("ali3p", None, (1e-4,)),
]


def is_named(why):
    """True if a message names the joints of the pose and what helps where no drive leads there."""
    joints = any(f"'{kind}" in why for kind in ("foot", "left", "right"))
    return joints and "lose rank" in why and "start elsewhere" in why and "drive" not in why


def passes(method, coordinates, tolerances, seeds):
    """How many of the motions finish, how many are wrong as far as they go, and of how many."""
    times, finished, wrong, tried = np.linspace(0, 10.0, 11), 0, 0, 0
    for seed in seeds:
        m, tip, post = parallelograms(seed)
        truth = tip(times)
        for rtol in tolerances:
            traj, why = moved(m, times, method=method, coordinates=coordinates, rtol=rtol)
            places = traj.point("tip")
            error = np.abs(places - truth[: len(places)]).max() / post
            print(
                f"seed {seed}, {method} {coordinates or ''} {rtol:.0e}: {error:.1e}, {traj.stats.counts.get('detours', 0)} "
                f"crossings, {traj.stats.counts.get('crossings again', 0)} again, {why or 'finished'}"
            )
            wrong += error >= min(LOST, max(AMPLIFIED * rtol, LEAST)) and rtol <= 1e-5
            assert why is None or is_named(why)
            finished, tried = finished + (why is None), tried + 1
    return finished, wrong, tried


@pytest.mark.some(3)
@pytest.mark.parametrize(("method", "coordinates", "tolerances"), WAYS)
def test_right_or_stopped_with_the_pose(method, coordinates, tolerances):
    finished, wrong, tried = passes(method, coordinates, tolerances[-2:], range(1))
    assert finished >= 0.5 * tried and not wrong


def test_bdf_finishes_nearly_all_of_some_rows():
    """Eleven of twelve (measured): steps that were short before the poses cross them by long ones."""
    finished, wrong, tried = passes("bdf", None, (1e-8, 1e-9, 1e-10), range(4))
    assert finished >= 10 and tried == 12 and not wrong


@pytest.mark.slow
@pytest.mark.parametrize(("method", "coordinates", "tolerances"), WAYS)
def test_many_are_right_or_stopped_with_the_pose(method, coordinates, tolerances):
    """Known misses, measured: "explicit" is on the other branch before it stops in one row at 1e-11, "bdf" 1.2e-5 off in one at 1e-10."""
    finished, wrong, tried = passes(method, coordinates, tolerances, range(12))
    print(f"{method} {coordinates or ''}: {finished} of {tried} finish, {wrong} wrong")
    assert finished >= 0.7 * tried and wrong <= 1


def pulled(seed, speed=0.2):
    """A drive pulls the slider of a crank until crank and rod are in line: model, and when that is."""
    r = np.random.default_rng(seed)
    crank, length, angle = r.uniform(0.1, 0.5), r.uniform(0.6, 1.0), r.uniform(0.6, 1.2)
    pin = crank * np.array([np.cos(angle), np.sin(angle), 0.0])
    slider = np.array([pin[0] + np.sqrt(length**2 - pin[1] ** 2), 0.0, 0.0])
    m = mb.Model("pulled", gravity=(0, -9.81, 0))
    bodies = [("crank", pin / 2), ("rod", (pin + slider) / 2), ("block", slider)]
    first, second, block = (m.body(n, mass=1.0, inertia=(0.01, 0.02, 0.02), at=tuple(p)) for n, p in bodies)
    m.revolute("main", m.ground, first, at=(0, 0, 0), axis="z")
    m.revolute("crankpin", first, second, at=tuple(pin), axis="z")
    m.revolute("wrist", second, block, at=tuple(slider), axis="z")
    m.prismatic("guide", m.ground, block, at=tuple(slider), axis="x")
    m.drive("winch", "guide", lambda t: speed * t)
    return m, (crank + length - slider[0]) / speed


@pytest.mark.some(4)
@pytest.mark.parametrize("method", ["explicit", "radau", "bdf", "bdf-bfgs", "generalized-alpha", "ali3p"])
def test_a_drive_that_cannot_go_on_is_named(method):
    for seed in range(1):
        m, end = pulled(seed)
        traj, why = moved(m, 2 * end, method=method, rtol=1e-4)
        work = traj.stats.counts["force evaluations"]
        print(f"{method}, seed {seed}: {work} evaluations, {why}")
        assert "the drive 'winch'" in why and "lose rank" in why
        assert "let the drive end before it" in why and "start elsewhere" not in why and len(why) <= 500
        assert abs(traj.steps[-1] - end) < 1e-3 * end and work < 1e5


def test_a_linkage_far_from_its_singular_poses_looks_for_none():
    """Each look ahead factorises the mass matrix."""
    counts = mb.simulate(zoo.slider_crank().model, 1.0, rtol=1e-6, method="bdf").stats.counts
    print(counts)
    assert counts["mass factorisations"] < 3 * counts["steps"]
