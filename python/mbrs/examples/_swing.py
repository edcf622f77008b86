"""The two-body swing of the derivative-free solver's paper."""

from __future__ import annotations

import math

from ..model.model import Model
from ..model.motions import Ramp
from ._links import rod


def swing(length: float = 2.0, mass: float = 336.14, rate: float = math.pi / 3, gravity: float = 9.81) -> Model:
    """Rod "A" turned about z at a constant ``rate`` (60 deg/s) by the hinge "m", rod "B" hinged freely to its end by "n";
    both level at the start, the second not turning.

    ``mass`` kg of each, ``length`` m, ``gravity`` m/s2 downwards (-y); drive "motor", marker "end" on B. The paper (J.
    Algorithms Comput. Technol. 2017, doi 10.1177/1748301817729990) gives the mass of A and the rate; lengths, B's mass and
    uniform rods are assumed (docs/theory.md (23.11)).

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.swing()).dof
    1
    """
    m = Model("two-body swing", gravity=(0.0, -gravity, 0.0))
    lift = (0.0, rate * length)
    a = rod(m, "A", [(0, 0), (length, 0)], mass, [(0, 0), lift])
    b = rod(m, "B", [(length, 0), (2 * length, 0)], mass, [lift, lift])
    driven = m.revolute("m", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("n", a, b, at=(length, 0, 0), axis="z")
    m.drive("motor", driven, Ramp(rate))
    m.marker("end", b, at=(2 * length, 0, 0))
    return m
