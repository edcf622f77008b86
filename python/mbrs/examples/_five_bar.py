"""The five-bar with two springs on which gradients of motions are usually tried."""

from __future__ import annotations

import math

from ..model.model import Model
from ._links import rod

_POINTS = {"A": (0.0, 0.0), "P1": (-1.0, -1.0), "P2": (0.5, -2.0), "P3": (2.0, -1.0), "B": (1.0, 0.0)}
_BARS = (("crank", "A", "P1", 1.0), ("left", "P1", "P2", 1.5), ("right", "P2", "P3", 1.5), ("rocker", "P3", "B", 1.0))


def five_bar(gravity: float = 9.81, stiffness: float = 100.0) -> Model:
    """Four uniform rods "crank", "left", "right", "rocker" between ground hinges "A" and "B", two springs from A.

    ``gravity`` m/s2 downwards (-y), ``stiffness`` N/m of both springs, which are unstretched as drawn (``spring1.length``,
    ``spring2.length``). Hinges "A", "H1", "H2", "H3", "B" about z, markers "P1", "P2", "P3" at the inner ones. Two degrees
    of freedom. The layout was found by a search (docs/theory.md (23.12)); no source gives the data.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.five_bar()).dof
    2
    """
    m = Model("five-bar", gravity=(0.0, -gravity, 0.0))
    bars = [rod(m, name, [_POINTS[p], _POINTS[q]], mass) for name, p, q, mass in _BARS]
    links = [m.ground, *bars, m.ground]
    for i, (name, at) in enumerate(_POINTS.items()):
        m.revolute(name.replace("P", "H"), links[i], links[i + 1], at=(*at, 0.0), axis="z")
    for i in (1, 2, 3):
        m.marker(f"P{i}", bars[i], at=(*_POINTS[f"P{i}"], 0.0))
    for name, bar, end in (("spring1", bars[3], "P3"), ("spring2", bars[2], "P2")):
        length = math.dist(_POINTS["A"], _POINTS[end])
        ends = ((0.0, 0.0, 0.0), (*_POINTS[end], 0.0))
        m.spring_damper(name, m.ground, bar, at=ends, k=stiffness, length=length)
    return m


def ice_skate(b: float = 1.0) -> Model:
    """A body on ice whose blade "edge" lets it move along its own x only, pulled by a spring: nonholonomic.

    ``b`` scales the distance of the blade in front of the centre of mass, 0.1 m. Data invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.ice_skate()
    """
    m = Model("ice skate")
    body = m.body(
        "skate",
        mass=1.0,
        inertia=(0.05, 0.06, 0.08),
        at=(0, 0, 0),
        velocity=(1.0, -0.05 * b, 0),
        angular_velocity=(0, 0, 0.5),
    )
    m.planar("ice", m.ground, body, at=(0, 0, 0), axis="z")
    m.knife_edge("edge", m.ground, body, at=(0.1 * b, 0, 0), axis="y")
    m.spring_damper("spring", m.ground, body, at=((0, 1.0, 0), (0.1, 0, 0)), k=10.0, length=0.0)
    return m
