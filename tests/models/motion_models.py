"""Models for tests of motion and of its gradients. Data invented."""

import warnings

import mbrs as mb
import numpy as np

G = 9.81


def open_chain():
    """A spherical, a universal, a prismatic joint and a free body; a bushing, a cubic law, a follower force."""
    m = mb.Model("open chain", gravity=(0.3, -9.81, 0.5))
    spin = np.array([0.5, 1.0, -0.4])

    def turning(at):
        # a rigid rotation about the spherical joint: velocities that fit all joints of the chain
        return {"at": at, "velocity": np.cross(spin, at), "angular_velocity": spin}

    a = m.body("a", mass=1.2, inertia=(0.05, 0.06, 0.04), **turning((0.3, 0, 0.1)))
    b = m.body("b", mass=0.8, inertia=(0.03, 0.02, 0.04), com=(0.02, 0, 0.01), **turning((0.8, 0.1, 0)))
    c = m.body("c", mass=0.5, inertia=(0.01, 0.02, 0.02), **turning((1.2, 0.1, 0.2)))
    d = m.body("d", mass=0.7, inertia=(0.02, 0.03, 0.02), at=(0.5, -0.6, 0.3), velocity=(0.2, 0, -0.1))
    m.spherical("S", m.ground, a, at=(0, 0, 0), k=(3.0, 2.0, 4.0))
    m.universal("U", a, b, at=(0.6, 0.05, 0), axis="z", axis2="y", c=(0.05, 0.04))
    m.prismatic("P", b, c, at=(1.0, 0.1, 0.1), axis=(1, 0.2, 0.1), k=50.0, law=mb.Cubic(300.0))
    m.bushing("bush", a, d, at=(0.5, -0.3, 0.1), k=(80, 90, 70, 2, 3, 2), c=(0.5, 0.4, 0.3, 0.02, 0.02, 0.02))
    m.force("pull", c, at=(1.2, 0.15, 0.2), value=(0.4, 0.2, -0.3), frame="body")
    m.spring_damper("spring", m.ground, d, at=((0.2, -1.0, 0.4), (0.5, -0.7, 0.3)), k=40.0, c=0.3, length=0.3)
    m.marker("tip", c, at=(1.3, 0.1, 0.2))
    return m


def spatial_loop():
    """A closed loop without redundancy: revolute, spherical, spherical and a distance joint."""
    m = mb.Model("spatial loop", gravity=(0, 0, -9.81))
    a = m.body("crank", mass=0.6, inertia=(0.01, 0.02, 0.02), at=(0.1, 0, 0.2), orientation=mb.rotation("y", 0.3))
    b = m.body("rocker", mass=0.9, inertia=(0.02, 0.03, 0.03), at=(0.9, 0.3, 0.3))
    m.revolute("R1", m.ground, a, at=(0, 0, 0), axis=(0, 1, 0.1), k=1.5)
    m.revolute("R2", m.ground, b, at=(1, 0.3, 0), axis=(0.1, 1, 0), c=0.05)
    m.distance("rod", a, b, at=((0.2, 0.05, 0.4), (0.8, 0.25, 0.6)))
    m.spring_damper("spring", a, b, at=((0.1, 0, 0.3), (0.9, 0.3, 0.4)), k=60.0, c=0.2, length=0.7)
    return m


def blade():
    """A body on ice with a knife edge, pulled by a spring: nonholonomic."""
    m = mb.Model("blade", gravity=(0, 0, -9.81))
    a = m.body(
        "blade",
        mass=1.3,
        inertia=(0.05, 0.06, 0.07),
        at=(0, 0, 0),
        velocity=(0.8, -0.11, 0),
        angular_velocity=(0, 0, 1.1),
    )
    m.planar("ice", m.ground, a, at=(0, 0, 0), axis="z")
    m.knife_edge("edge", m.ground, a, at=(0.1, 0, 0), axis=(0, 1, 0))
    m.spring_damper("spring", m.ground, a, at=((1.0, 0.5, 0), (0.2, 0.05, 0)), k=6.0, c=0.1, length=0.4)
    return m


def silent(make):
    """A model without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make()


def disc(lean=np.pi / 2, velocity=(0, 0, 0), spin=(0, 0, 0), mass=2.0, radius=0.3, transverse=0.05, axial=0.09):
    """A disc whose axis is at ``lean`` from the vertical, in the x-z plane; it stands on the ground z = 0."""
    m = mb.Model("disc", gravity=(0, 0, -G))
    n = np.array([np.sin(lean), 0, np.cos(lean)])
    centre = (0, 0, radius * np.sin(lean))
    b = m.body(
        "disc",
        mass=mass,
        inertia=(transverse, transverse, axial),
        at=centre,
        orientation=mb.rotation("y", lean),
        velocity=velocity,
        angular_velocity=spin,
    )
    m.rolling_disc("rolling", m.ground, b, at=((0.7, -0.4, 0), centre), axis="z", axis2=n, radius=radius)
    return m
