"""A four-bar linkage of spatial hinges, and a row of four-bars."""

from __future__ import annotations

import numpy as np

from ..model.model import Model
from ..model.rotations import rotation
from ._links import rod


def four_bar(width: float = 1.0, height: float = 1.0, mass: float = 1.0, gravity: float = 9.81) -> Model:
    """A rectangular four-bar of three uniform rods above its ground hinges, on a bushing: one loop, one degree of
    freedom.

    ``width`` and ``height`` m, ``mass`` kg of each rod, ``gravity`` m/s2 downwards (-y). Joints "A" to "D" about z
    (planar loop of spatial hinges: three redundant constraints), bushing "mount", torque "motor", force "pull", marker
    "P2". Rod inertia m l^2/12; the slight inertia about the rods' axes and the bushing are invented.
    """
    m = Model("four-bar", gravity=(0.0, -gravity, 0.0))
    upright = rotation("z", np.pi / 2)
    post = (1e-3, mass * height**2 / 12, mass * height**2 / 12)
    beam = (1e-3, mass * width**2 / 12, mass * width**2 / 12)
    a = m.body("crank", mass=mass, inertia=post, at=(0, height / 2, 0), orientation=upright)
    b = m.body("coupler", mass=mass, inertia=beam, at=(width / 2, height, 0))
    c = m.body("rocker", mass=mass, inertia=post, at=(width, height / 2, 0), orientation=upright)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("B", a, b, at=(0, height, 0), axis="z")
    m.revolute("C", b, c, at=(width, height, 0), axis="z")
    m.revolute("D", c, m.ground, at=(width, 0, 0), axis="z")
    middle = (width / 2, height, 0)
    m.bushing("mount", m.ground, b, at=middle, k=(1e4, 1e4, 1e4, 10, 10, 10), c=(10, 10, 10, 0, 0, 0))
    m.torque("motor", a, value=(0, 0, 0.5))
    m.force("pull", b, at=middle, value=(1.0, 0, 0))
    m.marker("P2", b, at=(width, height, 0))
    return m


def four_bars(n: int = 1, speed: float = 1.0, gravity: float = 9.81) -> Model:
    """The IFToMM benchmark "N four-bar mechanism": n + 1 upright rods "post0" ... on ground, n couplers "beam0" ... on
    top, all 1 m and 1 kg.

    ``speed`` m/s of the upper pins along x at the start, ``gravity`` m/s2 downwards (-y). Hinges about z: "foot0" ...,
    "left0" ..., "right0" ...; marker "tip" on the first post's upper pin. One degree of freedom; all links align once in
    every half turn. Spatial bodies: 3 n redundant constraints. Source: Gonzalez, Dopico, Gonzalez and Cuadrado,
    Multibody Syst. Dyn. 16 (2006) 65-83.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.four_bars(2)).dof
    1
    """
    m = Model(f"{n} four-bars", gravity=(0.0, -gravity, 0.0))
    top = (speed, 0.0)
    posts = [rod(m, f"post{i}", [(i, 0), (i, 1)], 1.0, [(0, 0), top]) for i in range(n + 1)]
    beams = [rod(m, f"beam{i}", [(i, 1), (i + 1, 1)], 1.0, [top, top]) for i in range(n)]
    for i, post in enumerate(posts):
        m.revolute(f"foot{i}", m.ground, post, at=(i, 0, 0), axis="z")
    for i, beam in enumerate(beams):
        m.revolute(f"left{i}", posts[i], beam, at=(i, 1, 0), axis="z")
        m.revolute(f"right{i}", posts[i + 1], beam, at=(i + 1, 1, 0), axis="z")
    m.marker("tip", posts[0], at=(0, 1, 0))
    return m
