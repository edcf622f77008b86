"""The nonholonomic point mass of docs/theory.md (23.13), y' = b z x', as a mechanism."""

from __future__ import annotations

from ..model.model import Model

START, SPEED = (1.0, 0.0, 0.5), 1.0
# The point on ground (m) beside which z is shown, out of the way of x and y.
_CORNER = (3.0, 0.0)


def nonholonomic_particle(mass: float = 1.0, stiffness: float = 10.0, b: float = 1.0, light: float = 1e-9) -> Model:
    """A point (x, y, z) of mass m on springs k to the origin whose velocity obeys y' = b z x'; starts at (1, 0, 0.5), x' = 1.

    Parameters "m" (kg), "k" (N/m), "b" (1/m). z is the place of a slider of mass m: a slotted arm through its pin, hinged at
    the distance 1/b, turns by atan(b z); a coupler turns the carriage (x, y) alike, and a knife edge lets it move along
    its own x only. Bodies "carriage" (at (x, y, 0)) and "slider" (at (3 - z, 0, 0)); "arm" and "block" weigh ``light`` (kg,
    kg m2), and results differ by as much from those of the point.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.nonholonomic_particle()
    """
    m = Model("nonholonomic particle")
    p, k, r = m.parameter("m", mass, unit="kg"), m.parameter("k", stiffness, unit="N/m"), m.parameter("b", b)
    x, y, z = START
    little = (light, light, light)
    pin = (_CORNER[0] - z, _CORNER[1], 0.0)
    pivot = (_CORNER[0], _CORNER[1] - 1 / r, 0.0)
    carriage = m.body("carriage", mass=p, inertia=little, at=(x, y, 0), velocity=(SPEED, r * z * SPEED, 0))
    slider = m.body("slider", mass=p, inertia=(1, 1, 1), at=pin)
    arm = m.body("arm", mass=light, inertia=little, at=(_CORNER[0], _CORNER[1] - 1 / b, 0.0))
    block = m.body("block", mass=light, inertia=little, at=pin)
    plane = m.planar("plane", m.ground, carriage, at=(x, y, 0), axis="z")
    m.prismatic("rail", m.ground, slider, at=pin, axis="x")
    hinge = m.revolute("hinge", m.ground, arm, at=pivot, axis="z")
    m.prismatic("slot", arm, block, at=pin, axis=(-z, 1 / r, 0))
    m.spherical("pin", slider, block, at=pin)
    m.coupler("steering", hinge, plane, 1.0, second_coordinate="rz")
    m.knife_edge("edge", m.ground, carriage, at=(x, y, 0), axis=(-r * z, 1, 0))
    zeros = (0, 0, 0, 0)
    m.bushing("spring", m.ground, carriage, at=((0, 0, 0), (x, y, 0)), k=(k, k, *zeros))
    m.bushing("slider spring", m.ground, slider, at=((*_CORNER, 0), pin), k=(k, 0, *zeros))
    return m
