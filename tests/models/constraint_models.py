"""Models with constraints given as functions, beside the same mechanisms of joints. Data invented, no axis along x, y or z."""

from __future__ import annotations

import mbrs as mb
import numpy as np

GRAVITY = np.array([1.3, -2.1, -9.2])
PIVOT, ARM = np.array([0.31, -0.22, 0.47]), np.array([0.5, 0.6, -0.7])
ROD = float(np.linalg.norm(ARM))


def frame(seed):
    """A right-handed frame that no world axis is part of."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.array([1.0, 1.0, np.linalg.det(q)])


def bob(name="pendulum"):
    m = mb.Model(name, gravity=tuple(GRAVITY))
    inertia = ((0.11, 0.01, 0.02), (0.01, 0.13, -0.015), (0.02, -0.015, 0.09))
    return m, m.body("bob", mass=1.7, inertia=inertia, at=tuple(PIVOT + ARM), com=(0.1, 0.05, -0.2))


def pendulum(kind):
    """A body whose point keeps its distance "L" from a pivot, on a soft bushing: of a rod, or of a function of its motions."""
    m, body = bob()
    length = m.parameter("L", ROD, unit="m")
    m.bushing(
        "soft", m.ground, body, at=tuple(PIVOT + ARM), k=(20, 30, 10, 5, 7, 9), c=(0.1, 0.2, 0.1, 0.05, 0.02, 0.03)
    )
    motions = [body.motion("x"), "bob.motion.y", "bob.motion.z"]
    if kind == "rod":
        m.distance("rod", m.ground, body, at=(tuple(PIVOT), tuple(PIVOT + ARM)), length=length)
    elif kind == "function":
        m.constraint("rod", lambda t, u: (u + ARM) @ (u + ARM) - length**2, motions)
    else:
        m.constraint("rod", lambda t, u: (u + ARM) @ (u + ARM) - ROD**2, motions, derivatives=slopes)
    return m


def slopes(t, u):
    """First and second derivatives of |u + ARM|^2 by t and u."""
    second = np.zeros((4, 4))
    second[1:, 1:] = 2 * np.eye(3)
    return np.r_[0, 2 * (u + ARM)], second


def ball(kind):
    """A body held at a pivot of its own: by a spherical joint, or by three functions of the motions of that point."""
    m, body = bob("ball")
    place = tuple(PIVOT + 0.3 * ARM)
    if kind == "joint":
        m.spherical("ball", m.ground, body, at=place)
    else:
        m.constraint("ball", lambda t, u: u, [body.motion(axis, at=place) for axis in "xyz"])
    m.bushing(
        "soft", m.ground, body, at=tuple(PIVOT + ARM), k=(20, 30, 10, 5, 7, 9), c=(0.1, 0.2, 0.1, 0.05, 0.02, 0.03)
    )
    return m


class Bead:
    """A bead on y = 0.4 sin 2x + 0.3 x of a tilted plane."""

    R, start, x0, v0 = frame(4), np.array([0.3, -0.2, 0.5]), 0.2, 0.9
    gravity = 9.81 * R @ np.array([0.3, -0.9, 0.2])

    @staticmethod
    def f(x):
        return 0.4 * np.sin(2 * x) + 0.3 * x

    def place(self, x):
        return self.start + self.R @ np.array([x, self.f(x), 0 * x])

    def model(self, k=0.0):
        first = self.place(self.x0)
        slope = 0.8 * np.cos(2 * self.x0) + 0.3
        m = mb.Model("bead", gravity=tuple(self.gravity))
        m.body(
            "bead",
            mass=0.7,
            inertia=(0.01, 0.02, 0.015),
            at=tuple(first),
            velocity=tuple(self.v0 * self.R @ [1, slope, 0]),
        )

        def wire(t, u):
            p = self.R.T @ (u + first - self.start)
            return [p[1] - self.f(p[0]), p[2]]

        m.constraint("wire", wire, ["bead.motion.x", "bead.motion.y", "bead.motion.z"])
        if k:
            m.bushing("upright", m.ground, "bead", at=tuple(first), k=(0, 0, 0, k, k, k))
        return m


def driven_arm(kind):
    """A hinge that follows 0.7 sin(3 t + 0.3): by a drive, or by a constraint with time in it."""
    m = mb.Model("driven", gravity=tuple(GRAVITY))
    arm = m.body("arm", mass=1.3, inertia=(0.1, 0.2, 0.15), at=(0.3, 0.1, -0.2))
    tip = m.body("tip", mass=0.4, inertia=(0.01, 0.02, 0.03), at=(0.6, 0.2, -0.3))
    hinge = m.revolute("hinge", m.ground, arm, at=(0, 0, 0), axis=(0.3, 0.5, 0.81))
    m.universal("cross", arm, tip, at=(0.5, 0.1, -0.25), axis=(0.2, 1, 0.1), axis2=(1, -0.2, 0))
    if kind == "drive":
        m.drive("motor", hinge, mb.Sine(0.7, 3.0, phase=0.3))
    else:
        m.constraint("motor", lambda t, u: u - 0.7 * np.sin(3 * t + 0.3), [hinge])
    return m


def skate(kind, pull=0.0):
    """A skate on tilted ice whose blade is not along its middle: a knife edge, or a row of velocities."""
    R, blade = frame(7), np.array([0.25, 0.22, -0.05])
    m = mb.Model("skate", gravity=tuple(3 * R[:, 0] - 9 * R[:, 2]))
    velocity = {} if pull else {"velocity": tuple(0.8 * R[:, 0]), "angular_velocity": tuple(1.1 * R[:, 2])}
    s = m.body("skate", mass=1.4, inertia=(0.2, 0.3, 0.4), at=(0.2, 0.3, -0.1), com=(0.02, 0.05, -0.03), **velocity)
    m.planar("ice", m.ground, s, at=tuple(blade), orientation=R)
    if pull:
        m.bushing("pull", m.ground, s, at=(0.1, 0.2, 0.3), k=(30, 20, 10, pull, 2, 3), c=(0.1, 0.2, 0.1, 0, 0, 0))
    if kind == "joint":
        m.knife_edge("edge", m.ground, s, at=tuple(blade), axis=tuple(R[:, 1]))
    else:
        m.velocity_constraint("edge", lambda t, u: [-np.sin(u[2]), np.cos(u[2]), 0.0], ["ice.x", "ice.y", "ice.rz"])
    return m


AXIS = np.array([0.3, 0.5, 0.81]) / np.linalg.norm([0.3, 0.5, 0.81])


def cam(drive=None, preload=0.0):
    """Two arms on askew hinges, the second of which follows a curved function of the first; the first may be driven."""
    m = mb.Model("cam", gravity=tuple(GRAVITY))
    a = m.body("a", mass=1.3, inertia=(0.1, 0.2, 0.15), at=(0.3, 0.1, -0.2))
    b = m.body("b", mass=0.8, inertia=(0.05, 0.02, 0.04), at=(1.1, -0.2, 0.3))
    first = m.revolute("first", m.ground, a, at=(0, 0, 0), axis=AXIS, k=2.0, preload=preload)
    second = m.revolute("second", m.ground, b, at=(1.0, 0.1, 0.2), axis=(-0.4, 0.7, 0.5), k=1.5)
    bend = m.parameter("bend", 0.8)
    m.constraint("cam", lambda t, u: u[1] - 0.4 * np.sin(u[0]) - bend * u[0] ** 2 + 0.3 * u[0] * u[1], [first, second])
    m.spring_damper("tie", a, b, at=((0.4, 0.2, -0.1), (1.2, -0.1, 0.1)), k=25.0, c=0.3)
    if drive is not None:
        m.drive("hold", first, drive)
    return m
