"""What the stages of the explicit scheme integrate where there are constraints: independent coordinates, chosen and switched,
beside tree coordinates that are projected. Every test prints what it measured.
"""

from __future__ import annotations

import functools

import jitter
import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from flexed import flexed
from mbrs import reference as ref
from mbrs.errors import ModelError
from mbrs.model.tables import tables
from mbrs.reference.simulate import begin
from oracles.explicit import explicit
from test_drives import four_bar as drawn_four_bar

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
CONSTRAINED = ("four_bars", "slider_crank", "five_bar", "spherical_pendulum", "swing", "skate", "rolling_disc")


def independent(m, **options):
    return mb.simulate(m, method="explicit", coordinates="independent", **options)


def driven_four_bar():
    """Redundant hinges, and one freedom less than none but for them."""
    return drawn_four_bar(mb.Ramp(3.0))


def belt():
    """A coupler on the hinge that closes a four-bar."""
    m = drawn_four_bar()
    w = m.body("wheel", mass=1.0, inertia=(0.5, 0.5, 0.3), at=(2, 0, 0))
    m.revolute("axle", m.ground, w, at=(2, 0, 0), axis="z")
    m.coupler("belt", mb.System(m).loops[0].joint, "axle", 2.0)
    return m


def elastic_crank():
    rigid = mb.examples.slider_crank()
    return flexed(rigid, "rod", 300.0, damping=0.01)


def ball_bar():
    """A four-bar of balls: a rod between two cranks about different axes, which spins freely; three rotations within a loop."""
    m = mb.Model("ball bar", gravity=(3.0, -9.81, 2.0))  # invented
    a = m.body("crank", mass=1.0, inertia=(0.02, 0.02, 0.02), at=(0, 0.1, 0))
    b = m.body("rod", mass=0.5, inertia=(0.04, 0.04, 0.05), at=(0.35, 0.35, 0.2), angular_velocity=(0, 0, 0))
    c = m.body("rocker", mass=1.5, inertia=(0.03, 0.03, 0.03), at=(0.7, 0.25, 0.4))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.spherical("B", a, b, at=(0, 0.2, 0))
    m.spherical("C", b, c, at=(0.7, 0.5, 0.4))
    m.revolute("D", m.ground, c, at=(0.7, 0, 0.4), axis=(1, 0, 0.4))
    return m


SCENES = {
    **{name: functools.partial(lambda n: zoo.SMOOTH[n]().model, name) for name in CONSTRAINED},
    "Bricard": lambda: zoo.bricard().model,
    "drive": driven_four_bar,
    "coupler": belt,
    "balls": ball_bar,
    "stewart": mb.examples.stewart_platform,
}


@pytest.mark.oracle
@pytest.mark.parametrize("name", SCENES)
def test_every_step_is_that_of_the_reference(name):
    """Choice, closing, rates and accelerations by another program: six steps from the same start."""
    m = SCENES[name]()
    s, h = ref.System(tables(m)), 2e-3
    history = explicit(s, begin(s, ref.drawn_state(s)), h, 6, coordinates="independent")
    traj = independent(m, t=6 * h, step=h)
    position = np.stack([traj.position(b.name) for b in s.bodies[: s.n_bodies]], axis=1)
    gap = np.abs(position - history.positions(s)).max() / s.length
    rate = np.abs(traj.rate - history.rates).max() / max(1.0, np.abs(history.rates).max())
    print(f"{name}: positions {gap:.1e}, rates {rate:.1e}; {traj.stats.route}")
    # over six steps from other places rounding grows as jitter does
    assert gap < 1e-12 + 10 * jitter.level() and rate < 1e-11 + 100 * jitter.level()


@pytest.mark.parametrize("name", [*SCENES, "elastic"])
def test_both_coordinates_move_alike(name):
    """Two discretisations of one motion; all rows are met by both."""
    m = elastic_crank() if name == "elastic" else SCENES[name]()
    end = 0.05 if name in ("elastic", "stewart") else 0.6
    times = np.linspace(0, end, 7)
    ways = [mb.simulate(m, t=times, rtol=1e-9, method="explicit", coordinates=c) for c in ("tree", "independent")]
    apart = np.abs(ways[0].poses["position"] - ways[1].poses["position"]).max()
    worst = [traj.residual.max() for traj in ways]
    print(f"{name}: apart {apart:.1e} m, constraints {worst[0]:.1e} and {worst[1]:.1e}; {ways[1].stats.route}")
    assert apart < 1e-7 and worst[1] < 1e-8


def test_switches_are_counted_told_and_not_seen():
    """A weight on a wire goes round: no two coordinates serve all the time. Dense output against the truth."""
    p = zoo.spherical_pendulum()
    times = np.linspace(0, p.t, 401)
    traj = independent(p.model, t=times, rtol=1e-9)
    switches = traj.stats.counts["coordinate switches"]
    error = p.error(times, p.places(traj))
    jump = np.abs(np.diff(traj.position("mass"), n=4, axis=0)).max()
    print(f"{switches} switches, {error:.1e} m over {len(times)} outputs, fourth differences {jump:.1e} m; {traj}")
    assert switches >= 1 and f"{switches} switch" in str(traj)
    assert error < 1e-7 and traj.residual.max() < 1e-9


def test_without_constraints_nothing_is_chosen():
    m = zoo.SMOOTH["chain"]().model
    counts = [
        dict(mb.simulate(m, t=0.2, rtol=1e-6, method="explicit", coordinates=c).stats.counts)
        for c in (None, "tree", "independent")
    ]
    print(counts[2])
    assert counts[0] == counts[1] == counts[2]
    assert not {"coordinate choices", "row evaluations", "reduced factorisations"} & set(counts[2])


def test_no_tangent_and_few_multipliers():
    """Multipliers are solved for at the ends of steps alone, and where a step looks for a singular pose ahead: not at its twelve stages."""
    traj = independent(zoo.SMOOTH["four_bars"]().model, t=0.3, rtol=1e-6)
    n = traj.stats.counts
    print(dict(n))
    assert not n.get("tangents") and n["reduced factorisations"] >= 11 * n["steps"]
    assert n["mass factorisations"] <= 2 * (n["steps"] + n.get("rejected steps", 0)) + 3


@pytest.mark.parametrize(("n", "way"), [(1, "tree"), (10, "independent")])
def test_the_scene_chooses(n, way):
    """One loop is projected; many loops with one freedom get independent coordinates, and say so."""
    m = mb.examples.four_bars(n)
    chosen = mb.simulate(m, t=0.3, rtol=1e-6)
    forced = mb.simulate(m, t=0.3, rtol=1e-6, method="explicit", coordinates=way)
    print(chosen.stats.route)
    assert np.array_equal(chosen.rate, forced.rate)
    assert ("few freedoms" in chosen.stats.route) == (way == "independent")


@pytest.mark.slow
@pytest.mark.exact
@pytest.mark.parametrize("way", ["tree", "independent"])
def test_out_of_a_singular_pose(way):
    """Starting where all links lie in one line, on the branch of the parallelogram: the rank grows at the first step. Only links that
    are equal to the last bit can be there: noise on their lengths moves the start by its root and parts the branches.
    """
    m = mb.Model("in line", gravity=(0, -9.81, 0))
    bars = [
        m.body("crank", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(0.5, 0, 0), velocity=(0, 0.5, 0), angular_velocity=(0, 0, 1)),
        m.body("coupler", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(1.5, 0, 0), velocity=(0, 1, 0)),
        m.body("rocker", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(1.5, 0, 0), velocity=(0, 0.5, 0), angular_velocity=(0, 0, 1)),
    ]  # fmt: skip
    points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 0, 0)]
    for name, one, two, at in zip("ABCD", [m.ground, *bars], [*bars, m.ground], points, strict=True):
        m.revolute(name, one, two, at=at, axis="z")
    traj = mb.simulate(m, t=np.linspace(0, 0.5, 11), rtol=1e-7, method="explicit", coordinates=way)
    turned = np.abs(traj.poses["orientation"][:, 1] - [1, 0, 0, 0]).max()
    energy = np.ptp(traj.energy.total)
    print(f"{way}: coupler turned by {2 * turned:.1e}, energy {energy:.1e} J, {traj.stats.route}")
    assert turned < 1e-6 and energy < 1e-5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "explicit", "coordinates": "minimal"}, "'independent' or 'absolute', got 'minimal'"),
        ({"method": "explicit", "coordinates": 3}, "'independent' or 'absolute', got 3"),
        ({"method": "bdf", "coordinates": "tree"}, "belongs to method=\"explicit\", not to 'bdf'"),
        ({"coordinates": "tree"}, "belongs to method=\"explicit\", not to 'auto'"),
        ({"method": "explicit", "coordinates": "tree", "form": "ggl"}, "not to 'explicit'"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(ModelError, match=message):
        mb.simulate(mb.examples.four_bars(1), t=0.1, **options)
