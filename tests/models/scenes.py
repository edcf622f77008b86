"""Models for tests of the model layer: one with every kind of object, every option and expressions in all of them."""

from __future__ import annotations

import numpy as np
from mbrs.model.model import Model
from mbrs.model.rotations import rotation


class FakeLaw:
    """A law as the model layer sees one."""

    code = 7

    def __init__(self, *values):
        self.values = list(values)


def everything() -> Model:
    m = Model("everything", gravity=(0.1, -9.81, 0.2))
    length, V = m.parameter("L", 1.25), m.parameter("V 2", np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    odd = m.parameter("lambda", 2.0)
    a = m.body("a", mass=1.0 + odd, inertia=(0.05, 0.1, 0.1), at=(0, length / 2, 0), orientation=rotation("z", 0.3))
    b = m.body(
        "b",
        mass=V[0, 1],
        inertia=[[2.0, -0.1, 0.2], [-0.1, 1.5, 0.05], [0.2, 0.05, 1.0]],
        at=(0.5, 1, 0),
        com=(0.01, length**2, 0),
        velocity=(0.1, 0, -0.0),
        angular_velocity=(0, odd, 1),
    )
    c = m.body(
        "c",
        mass=3,
        inertia=(1, 1, 1),
        at=(2, 2, 2),
        orientation=rotation((1, 2, 3), np.sin(length)),
        pose=((1, 2, 3), None),
    )
    d = m.body("d", mass=3, inertia=(1, 1, 1), at=(-1, 0, 0))
    m.fixed("fixed", a, d, at=(0, 1, 1))
    m.revolute("revolute", m.ground, a, at=(0, 0, 0), axis="-y", k=odd, c=1.0, preload=0.5, law=FakeLaw(1.0, length**2))
    m.prismatic("prismatic", a, b, at=(0, length, 0), axis=(0, np.sin(length), 1), k=(3.0,))
    m.cylindrical("cylindrical", b, "c", at=(1, 0, 0), axis="x", k=(1.0, 2.0), c=(0.1, odd))
    m.universal("universal", c, d, at=(1, 0, 0), axis="z", axis2=(0, -2, 0), k=(1, 2))
    m.universal("cross", c, d, at=(1, 0, 0), orientation=rotation("x", 0.2))
    laws = [None, FakeLaw(odd), None]
    m.spherical("spherical", b, c, at=((1, 1, 0), (1, 1, length / 10)), k=(1, 2, odd), law=laws)
    m.planar("planar", m.ground, d, at=(1, 0, 0), axis=(1, 1, 0), k=(1, 2, 3), preload=(1, 2, 3))
    m.free("free", a, d, at=(0, 0, 0), k=(1, 2, 3, 4, 5, 6), orientation=np.eye(3))
    m.distance("rod", a, c, at=((0, 0, 0), (1, 1, 1)), length=1.5)
    m.distance("drawn rod", a, c, at=((0, 0, 0), (1, 1, 1)))
    m.knife_edge("knife", m.ground, d, at=(0, 0, 0), axis="y")
    m.rolling_disc("disc", m.ground, d, at=((0, 0, 0), (0, 0, 0.3)), axis="z", axis2="x", radius=0.3)
    m.spring_damper(
        "spring", a, c, at=((0, 0, 0), (3, 3, np.hypot(length, 3) - (length - (1 - length)))), k=1, length=2
    )
    m.spring_damper("drawn spring", a, c, at=((0, 0, 0), (0, 4, 3)), k=odd / (length / 2), c=3.0, preload=-2.0)
    six = V.symbols.ravel() * 1e4
    m.bushing("mount", m.ground, b, at=(0.5, 1, 0), k=six, c=(10, 10, 10, 0, 0, 0), law={"x": [FakeLaw(1), FakeLaw(2)]})
    full = np.arange(36.0).reshape(6, 6)
    m.bushing(
        "bearing", m.ground, b, at=((0.5, 1, 0), (0.5, 1, 0.1)), k=full, orientation=rotation("y", 1), preload=range6()
    )
    m.torsion("twist", a, b, at=(0, 0, 1), axis=(0, 2, 0), k=1.0, c=2.0, angle=0.2, preload=0.1)
    m.torque("motor", a, value=(0, 0, 0.5))
    m.force("pull", b, at=(0.5, 1, 0), value=(odd, 0, 0), frame="body")
    m.force("push", a, value=(0, 1, 0))
    m.marker("tip", b, at=(1, length, 0), orientation=rotation("z", 0.5))
    m.marker("world mark", m.ground, at=(0, 0, 0))
    return m


def range6():
    return (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def same_tables(one, two):
    """Names of the entries in which two Tables differ, bit by bit."""
    assert one.keys() == two.keys()

    def bits(v):
        return v if isinstance(v, list | dict) else (v.dtype, v.shape, v.tobytes())

    return [key for key in one if bits(one[key]) != bits(two[key])]
