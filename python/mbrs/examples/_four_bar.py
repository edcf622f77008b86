"""The four-bar linkage of API.md section 2."""

from __future__ import annotations

import numpy as np

from ..geometry import rotation
from ..model import Model


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
