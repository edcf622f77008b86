"""Linkages with closed loops whose degrees of freedom are known facts, drawn in convenient axes with random sizes.

Each function takes a random generator and returns a `Model`; `invariance/changes.py` turns it, moves it, changes its units,
order and digits. `FAMILIES` says how many degrees of freedom each has. The numbers of constraints say little: in most of these
some are redundant. Sources: J. E. Baker, Mech. Mach. Theory 14 (1979) 253-267 (Bennett, Goldberg, Bricard); P. T. Sarrus,
C. R. Acad. Sci. 36 (1853) 1036; K. H. Hunt, Kinematic Geometry of Mechanisms, Oxford 1978, chapters 1 and 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import mbrs as mb
import numpy as np
from problems import Problem

Z = np.array([0.0, 0.0, 1.0])


def spread(rng, low=0.4, high=1.6) -> float:
    """A size that is no round number."""
    return float(rng.uniform(low, high))


def body(m, rng, name, at):
    """A body of about 1 kg and .1 m."""
    a, b = rng.uniform(0.01, 0.02, 2)
    return m.body(name, mass=spread(rng), inertia=(a, b, 0.8 * (a + b)), at=tuple(at))


def closed_chain(rng, name, points, axes, kinds=None):
    """ground - bar 1 - bar 2 - ... - ground by joints at the points, about the axes; hinges where ``kinds`` says nothing."""
    m = mb.Model(name)
    n = len(points)
    bars = [m.ground]
    bars += [body(m, rng, f"bar{i}", (np.asarray(points[i - 1]) + points[i]) / 2) for i in range(1, n)]
    for i in range(n):
        kind = "revolute" if kinds is None else kinds[i]
        given = {} if kind == "spherical" else {"axis": tuple(axes[i])}
        getattr(m, kind)(f"joint{i}", bars[i], bars[(i + 1) % n], at=tuple(points[i]), **given)
    return m


# --- one body held twice or three times -----


def held(rng, kinds, where, axis=Z):
    """One body on ground by several joints with one axis direction, at the given points."""
    m = mb.Model("held body")
    b = body(m, rng, "body", rng.normal(size=3))
    for i, (kind, at) in enumerate(zip(kinds, where, strict=True)):
        given = {} if kind == "spherical" else {"axis": tuple(axis)}
        getattr(m, kind)(f"joint{i}", m.ground, b, at=tuple(at), **given)
    return m


def along(rng, n):
    """n different points on the z axis."""
    return [(0.0, 0.0, z) for z in np.cumsum(rng.uniform(0.3, 1.3, n))]


def door(rng):
    """Two hinges on one axis."""
    return held(rng, ["revolute"] * 2, along(rng, 2))


def door_at_one_point(rng):
    """Two hinges on one axis, both at one point."""
    return held(rng, ["revolute"] * 2, along(rng, 1) * 2)


def shaft_rcc(rng):
    """A shaft in one fixed and two loose bearings."""
    return held(rng, ["revolute", "cylindrical", "cylindrical"], along(rng, 3))


def shaft_ccc(rng):
    """A shaft in three loose bearings: it turns and slides."""
    return held(rng, ["cylindrical"] * 3, along(rng, 3))


def shaft_rrr(rng):
    """A shaft in three fixed bearings."""
    return held(rng, ["revolute"] * 3, along(rng, 3))


def drawer(rng):
    """Two parallel slides."""
    return held(rng, ["prismatic"] * 2, rng.normal(size=(2, 3)))


def plate_on_two_planes(rng):
    """A plate that glides on one plane, held to it twice."""
    return held(rng, ["planar"] * 2, rng.normal(size=(2, 3)) * (1, 1, 0))


def hinge_and_ball_at_one_point(rng):
    """A ball joint at the point of a hinge adds nothing."""
    return held(rng, ["revolute", "spherical"], along(rng, 1) * 2)


def hinge_and_ball_on_the_axis(rng):
    """A ball joint on the axis of a hinge: it adds nothing, wherever it is on it."""
    return held(rng, ["revolute", "spherical"], along(rng, 2))


def hinge_and_ball_off_the_axis(rng):
    """A ball joint beside the axis of a hinge locks it."""
    return held(rng, ["revolute", "spherical"], [(0, 0, spread(rng)), (spread(rng), 0, spread(rng))])


def two_balls(rng):
    """Two ball joints leave the turning about their line."""
    return held(rng, ["spherical"] * 2, along(rng, 2))


def two_balls_at_one_point(rng):
    """Two ball joints at one point are one."""
    return held(rng, ["spherical"] * 2, along(rng, 1) * 2)


def three_balls_in_line(rng):
    """Three ball joints on a line leave the turning about it."""
    return held(rng, ["spherical"] * 3, along(rng, 3))


def three_balls_in_a_triangle(rng):
    """Three ball joints that are not on a line lock the body."""
    return held(rng, ["spherical"] * 3, rng.normal(size=(3, 3)))


def ball_and_loose_bearing(rng):
    """A ball joint on the axis of a loose bearing leaves the turning about it."""
    return held(rng, ["spherical", "cylindrical"], along(rng, 2))


# --- one loop -----


def quadrilateral(rng):
    """Four points of a plane, no two sides parallel or of a length, as a crank, a coupler and a rocker."""
    x = np.array([(0.0, 0.0, 0.0), (0.3, 0.8, 0.0), (1.2, 1.0, 0.0), (1.1, 0.0, 0.0)])
    return x + 0.1 * rng.uniform(-1, 1, (4, 3)) * (1, 1, 0)


def four_bar(rng):
    """Four parallel hinges."""
    return closed_chain(rng, "four-bar", quadrilateral(rng), [Z] * 4)


def four_bar_with_ball(rng):
    """Three parallel hinges and a ball joint: as the planar one, with less that is redundant."""
    return closed_chain(rng, "four-bar with ball", quadrilateral(rng), [Z] * 4, ["revolute"] * 3 + ["spherical"])


def triangle(rng):
    """Three parallel hinges: a frame."""
    return closed_chain(rng, "triangle", quadrilateral(rng)[:3], [Z] * 3)


def bennett(rng):
    """Bennett's linkage: a skew quadrilateral with opposite sides equal, each hinge normal to both of its bars."""
    a, b = rng.uniform(0.3, 1.0, 3), rng.uniform(0.3, 1.0, 3)
    half_turn = np.array([-1, -1, 1])
    a[1] *= -1
    points = np.array([a, b, a * half_turn, b * half_turn])
    sides = np.roll(points, -1, axis=0) - points
    return closed_chain(rng, "Bennett", points, [np.cross(sides[i - 1], sides[i]) for i in range(4)])


def bricard(rng):
    """Bricard's line-symmetric linkage: three hinges and their images under half a turn about a line."""
    half_turn = np.array([-1, -1, 1])
    points = np.array([(1.0, 0.1, -0.5), (0.7, 0.8, 0.1), (-0.2, 1.0, 0.6)]) + 0.2 * rng.normal(size=(3, 3))
    axes = rng.normal(size=(3, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    return closed_chain(rng, "Bricard", np.vstack([points, points * half_turn]), np.vstack([axes, axes * half_turn]))


def hinges(rng, n):
    """n hinges in general position."""
    angle = 2 * np.pi * np.arange(n) / n
    points = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)]) + 0.2 * rng.normal(size=(n, 3))
    axes = rng.normal(size=(n, 3))
    return closed_chain(rng, f"{n} hinges", points, axes / np.linalg.norm(axes, axis=1)[:, None])


def six_hinges(rng):
    """Six hinges in general position are a frame."""
    return hinges(rng, 6)


def seven_hinges(rng):
    """Seven hinges in general position move."""
    return hinges(rng, 7)


# --- several loops -----


def three_cranks(rng):
    """A parallelogram with a third equal crank between the two."""
    m = mb.Model("three cranks")
    length, angle, base = spread(rng), rng.uniform(0.5, 2.5), spread(rng, 1.0, 2.0)
    arm = length * np.array([np.cos(angle), np.sin(angle), 0.0])
    coupler = body(m, rng, "coupler", arm + (base / 2, 0.1, 0))
    for i, x in enumerate((0.0, base, base * rng.uniform(0.2, 0.8))):
        foot = np.array([x, 0.2 * i, 0.0])
        crank = body(m, rng, f"crank{i}", foot + arm / 2)
        m.revolute(f"foot{i}", m.ground, crank, at=tuple(foot), axis="z")
        m.revolute(f"head{i}", crank, coupler, at=tuple(foot + arm), axis="z")
    return m


def braced_four_bar(rng):
    """A four-bar with a strut from the foot of the crank to the head of the rocker: a frame."""
    points = quadrilateral(rng)
    m = closed_chain(rng, "braced four-bar", points, [Z] * 4)
    strut = body(m, rng, "strut", (points[0] + points[2]) / 2)
    m.revolute("strut foot", m.ground, strut, at=tuple(points[0]), axis="z")
    m.revolute("strut head", strut, "bar2", at=tuple(points[2]), axis="z")
    return m


def sarrus(rng):
    """Sarrus' linkage: a table on two legs of three parallel hinges each; it goes straight up and down."""
    m = mb.Model("Sarrus")
    height = spread(rng)
    table = body(m, rng, "table", (0, 0, height))
    between = rng.uniform(0.6, 2.4)  # angle between the legs
    for i, angle in enumerate((0.3, 0.3 + between)):
        out, axis = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        foot, knee, head = (
            spread(rng) * out,
            2.1 * out + height * rng.uniform(0.3, 0.7) * Z,
            spread(rng) * out + height * Z,
        )
        shin, thigh = body(m, rng, f"shin{i}", (foot + knee) / 2), body(m, rng, f"thigh{i}", (knee + head) / 2)
        for label, a, b, at in (
            ("foot", m.ground, shin, foot),
            ("knee", shin, thigh, knee),
            ("head", thigh, table, head),
        ):
            m.revolute(f"{label}{i}", a, b, at=tuple(at), axis=tuple(axis))
    return m


# --- singular as drawn -----


def flat_parallelogram(rng):
    """A parallelogram drawn flat: two branches of motion meet there."""
    crank, base = spread(rng), spread(rng, 2.0, 3.0)
    points = [(0, 0, 0), (crank, 0, 0), (crank + base, 0, 0), (base, 0, 0)]
    return closed_chain(rng, "flat parallelogram", np.array(points, float), [Z] * 4)


def two_collinear_bars(rng):
    """Two bars in line between two fixed hinges: shaky, the middle gives way to second order only."""
    a, b = spread(rng), spread(rng)
    return closed_chain(rng, "collinear bars", np.array([(0, 0, 0), (a, 0, 0), (a + b, 0, 0)]), [Z] * 3)


@dataclass
class Family(Problem):
    """``model`` draws a linkage from a random generator; its answer holds the degrees of freedom or what singular poses are called."""

    @property
    def name(self) -> str:
        return self.model.__name__


def families(dof, source, *draw):
    return [Family(one, {"dof": dof}, source) for one in draw]


LINES = "joints on one line share the motions about and along it"
PLANES = "Hunt, Kinematic Geometry of Mechanisms: Gruebler's count in the plane, 3 (n - 1) - 2 j"
SPACE = "Hunt, Kinematic Geometry of Mechanisms: 6 (n - 1) - 5 j hinges in general position"
FAMILIES = [
    *families(
        1, LINES, door, door_at_one_point, shaft_rcc, shaft_rrr, hinge_and_ball_at_one_point, hinge_and_ball_on_the_axis
    ),
    *families(1, LINES, two_balls, three_balls_in_line, ball_and_loose_bearing),
    *families(2, LINES, shaft_ccc),
    *families(0, "no line through all joints", hinge_and_ball_off_the_axis, three_balls_in_a_triangle),
    *families(1, "two slides along one direction are one", drawer),
    *families(3, "two joints that repeat each other are one", plate_on_two_planes, two_balls_at_one_point),
    *families(1, PLANES, four_bar, four_bar_with_ball),
    *families(0, PLANES, triangle, braced_four_bar),
    *families(
        1, "equal cranks turn alike, however many: three_cranks repeats a row of its parallelogram", three_cranks
    ),
    *families(1, "Baker, Mech. Mach. Theory 14 (1979) 253-267", bennett, bricard),
    *families(0, SPACE, six_hinges),
    *families(1, SPACE, seven_hinges),
    *families(1, "Sarrus, C. R. Acad. Sci. 36 (1853) 1036", sarrus),
]
SINGULAR = [
    Family(
        flat_parallelogram,
        {"words": "bifurcation|branch|singular"},
        "two branches of motion meet where all bars are in line",
    ),
    Family(
        two_collinear_bars, {"words": "shaky|second order|infinitesimal"}, "the middle moves by the root of a strain"
    ),
]
