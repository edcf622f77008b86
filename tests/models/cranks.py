"""Small systems for comparisons: rods in a leaning plane, a bent shaft, oscillators with cubic springs. Data invented."""

import mbrs as mb
import numpy as np

AXIS = np.array([0.36, -0.48, 0.8])
SIDE = np.array([0.8, 0.6, 0.0])


def crank(loop=True):
    """Rods in a leaning plane, hinged, with a spring beside and a damper; closed to a four-bar or open."""
    up = np.cross(AXIS, SIDE)
    point = {"A": 0.0 * up, "B": 0.31 * SIDE + 0.83 * up, "C": 1.22 * SIDE + 1.07 * up, "D": 1.13 * SIDE}
    m = mb.Model("crank", gravity=tuple(-9.7 * up + 0.4 * AXIS))
    rods = {}
    for name, a, b, mass in (("crank", "A", "B", 1.3), ("coupler", "B", "C", 0.7), ("rocker", "C", "D", 2.1)):
        middle = 0.5 * (point[a] + point[b])
        rods[name] = m.body(name, mass=mass, inertia=(0.11, 0.13, 0.07), com=tuple(middle + 0.01), at=tuple(middle))
    m.revolute("A", m.ground, rods["crank"], at=tuple(point["A"]), axis=tuple(AXIS), k=3.1, c=0.2)
    m.revolute("B", rods["crank"], rods["coupler"], at=tuple(point["B"]), axis=tuple(AXIS))
    m.revolute("C", rods["coupler"], rods["rocker"], at=tuple(point["C"]), axis=tuple(AXIS), k=0.0 if loop else 5.7)
    if loop:
        m.revolute("D", m.ground, rods["rocker"], at=tuple(point["D"]), axis=tuple(AXIS))
    m.spring_damper("s", m.ground, rods["crank"], at=(tuple(-SIDE + 0.6 * up), tuple(point["B"])), k=217.0, c=1.9)
    m.marker("tip", rods["coupler"], at=tuple(point["C"]))
    return m


def bent_shaft():
    """A disc on a shaft in a sprung gimbal."""
    m = mb.Model("bent shaft", gravity=(0, 0, -9.81))
    g = m.body("gimbal", mass=1.0, inertia=(0.01, 0.012, 0.014), at=(0, 0, 0), com=(0.01, 0, 0.02))
    d = m.body("disc", mass=2.0, inertia=(0.02, 0.02, 0.03), at=(0, 0, 0.1))
    m.universal(
        "support", m.ground, g, at=(0, 0, 0), axis="x", axis2="y", k=(90.0, 120.0), c=(0.1, 0.2), preload=(0.4, -0.3)
    )
    m.revolute("shaft", g, d, at=(0, 0, 0.1), axis="z")
    return m


OSCILLATOR = mb.MechanicalSystem(
    [[1.3, 0.1], [0.1, 0.7]],
    [[0.12, 0.0], [0.0, 0.05]],
    [[3.1, -0.9], [-0.9, 2.2]],
    elements=[mb.Cubic(0.8, w=[1.0, -1.0])],
)
DUFFING = mb.examples.two_tone_duffing()[0]
TONES = [{"force": [-0.25j], "omega": 1.9}, {"force": [-0.21j], "omega": 1.9 * np.sqrt(2)}]
