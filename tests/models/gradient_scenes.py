"""Small scenes that hold every joint, element, law, load and drive at least once, for derivatives by all their numbers.

Data invented. Velocities need not fit the joints: the start is made consistent, and that is differentiated, too.
"""

from __future__ import annotations

from collections.abc import Callable

import mbrs as mb
import numpy as np
from mbrs.model.laws import Polynomial1D, TableLaw
from random_models import N_FREE

SCENES: dict[str, Callable[[], mb.Model]] = {}


def scene(make):
    """Enter a function under its name."""
    SCENES[make.__name__] = make
    return make


def _inertia(seed):
    root = np.random.default_rng(seed).normal(size=(6, 3))
    return np.trace(root.T @ root) / 40 * np.eye(3) - root.T @ root / 40


def _body(m, name, at, seed=0, **given):
    rng = np.random.default_rng(seed)
    moving = {"velocity": 0.3 * rng.normal(size=3), "angular_velocity": 0.5 * rng.normal(size=3)}
    return m.body(
        name, mass=1.0 + 0.3 * seed, inertia=_inertia(seed), com=0.05 * rng.normal(size=3), at=at, **{**moving, **given}
    )


def _far(m, body):
    """Farther than all other points, of which two that coincide would give the characteristic length a kink."""
    m.spring_damper("far", m.ground, body, at=((-3.0, -2.0, 1.0), (0.5, 0.2, 0.0)), k=0.5)


def _frame(kind):
    if kind in ("fixed", "free"):
        return {"orientation": mb.rotation((1, 2, 0.5), 0.4)}
    if kind == "screw":
        return {"axis": (0.2, 0.3, 1.0), "pitch": 0.21}
    return {"axis": (0.2, 0.3, 1.0), "axis2": (1.0, 0.1, -0.23)} if kind == "universal" else {"axis": (0.2, 0.3, 1.0)}


def _forces(kind):
    n = {**N_FREE, "screw": 1}[kind]
    if n == 0:
        return {}
    up = 1.0 + 0.2 * np.arange(n)
    return {"k": 6.0 * up, "c": 0.2 * up, "preload": 0.3 * up}


def tree(kind):
    """A chain of two: the joint from ground, and once more the other way round."""

    def make():
        m = mb.Model(kind, gravity=(0.5, -3.0, 1.0))
        a, b = _body(m, "a", (0.5, 0.1, 0), 1), _body(m, "b", (1.1, 0.2, 0.3), 2)
        _far(m, a)
        m.revolute("foot", m.ground, a, at=(0, 0, 0), axis=(0.1, 1.0, 0.2), k=4.0)
        getattr(m, kind)("J", a, b, at=(0.8, 0.1, 0.1), **_frame(kind), **_forces(kind))
        c = _body(m, "c", (1.6, 0.2, 0.5), 3)
        getattr(m, kind)("back", c, b, at=((1.4, 0.2, 0.4), (1.42, 0.21, 0.38)), **_frame(kind), **_forces(kind))
        return m

    make.__name__ = f"tree_{kind}"
    return scene(make)


def loop(kind):
    """Two bodies and the joint between them, held by a ball and a rod: one of the three is cut."""

    def make():
        m = mb.Model(kind, gravity=(0.5, -3.0, 1.0))
        a, b = _body(m, "a", (0.5, 0.1, 0), 1), _body(m, "b", (1.1, 0.2, 0.3), 2)
        _far(m, a)
        m.spherical("ball", m.ground, a, at=(0, 0, 0), axis=(0.1, 0.3, 1), k=(2.0, 1.0, 3.0))
        m.distance("rod", b, m.ground, at=((1.3, 0.2, 0.4), (1.5, -0.8, 0.5)))
        getattr(m, kind)("J", a, b, at=(0.8, 0.1, 0.1), **_frame(kind), **_forces(kind))
        return m

    make.__name__ = f"loop_{kind}"
    return scene(make)


for _kind in (*N_FREE, "screw"):
    tree(_kind)
    if _kind != "free":
        loop(_kind)


@scene
def ring():
    """A four-bar with balls, one of its joints cut whichever it is."""
    m = mb.Model("ring", gravity=(0.5, -3.0, 1.0))
    a, b, c = (
        _body(m, n, p, s) for n, p, s in (("a", (0, 0.5, 0), 1), ("b", (0.6, 1.0, 0.1), 2), ("c", (1.2, 0.5, 0), 3))
    )
    m.revolute("R1", m.ground, a, at=(0, 0, 0), axis=(0.1, 0, 1), k=3.0)
    _far(m, a)
    m.spherical("S1", a, b, at=(0, 1, 0), axis=(0.1, 0.3, 1), k=(1.0, 2.0, 1.0), c=(0.1, 0.1, 0.2))
    m.universal("U1", b, c, at=(1.2, 1, 0.1), axis=(0.5, 0.2, 1), axis2=(1, 0, -0.5), k=(2.0, 1.0))
    m.revolute("R2", m.ground, c, at=(1.2, 0, 0), axis=(0.3, 0.5, 1))
    return m


@scene
def slot():
    """A crank whose pin slides in the slot of a lever."""
    m = mb.Model("slot", gravity=(0.5, -3.0, 1.0))
    a, b = _body(m, "a", (0.4, 0.2, 0), 1), _body(m, "b", (0.5, -0.4, 0.1), 2)
    _far(m, a)
    m.revolute("crank", m.ground, a, at=(0, 0, 0), axis=(0.1, 0.2, 1), k=4.0)
    m.spherical("lever", m.ground, b, at=(0.3, -1.0, 0.1), axis=(0.1, 0.3, 1), k=(2.0, 1.0, 3.0))
    m.point_on_line("J", b, a, at=(0.7, 0.3, 0.05), axis=(0.3, 1.0, -0.2), k=6.0, c=0.2, preload=0.3)
    return m


@scene
def knife():
    m = mb.Model("knife", gravity=(0, 0, -9.81))
    a = m.body(
        "a", mass=1.3, inertia=(0.05, 0.06, 0.07), at=(0, 0, 0), velocity=(0.8, 0, 0), angular_velocity=(0, 0, 1.1)
    )
    m.planar("ice", m.ground, a, at=(0, 0, 0), axis=(0.02, 0.03, 1))
    m.knife_edge("edge", m.ground, a, at=(0.1, 0, 0), axis=(0.03, 1, 0.02))
    m.spring_damper("spring", m.ground, a, at=((2.0, 0.5, 0), (0.2, 0.05, 0)), k=6.0, c=0.1, length=0.4)
    return m


@scene
def disc():
    m = mb.Model("disc", gravity=(0, 0, -9.81))
    r = 0.3
    a = m.body(
        "a", mass=1.3, inertia=(0.03, 0.06, 0.03), at=(0, 0, r), velocity=(0.6, 0, 0), angular_velocity=(0, 2.0, 0.2)
    )
    m.rolling_disc("roll", m.ground, a, at=((0, 0, 0), (0, 0, r)), axis="z", axis2="y", radius=r)
    m.torque("push", a, value=(0.02, 0.1, 0.03))
    return m


def _driven(name, motion, coordinate="revolute"):
    def make():
        m = mb.Model(name, gravity=(0.5, -3.0, 1.0))
        a, b = _body(m, "a", (0.5, 0.1, 0), 1), _body(m, "b", (1.1, 0.2, 0.3), 2)
        joint = getattr(m, coordinate)("J", m.ground, a, at=(0, 0, 0), axis=(0.1, 1.0, 0.2))
        _far(m, a)
        m.spherical("S", a, b, at=(0.8, 0.1, 0.1), axis=(0.1, 0.3, 1), k=(2.0, 3.0, 1.0), c=(0.1, 0.1, 0.1))
        m.drive("motor", joint, motion())
        return m

    make.__name__ = name
    return scene(make)


_driven("drive_sine", lambda: mb.Sine(0.4, frequency=2.0, phase=0.3, offset=0.1))
_driven("drive_omega", lambda: mb.Sine(0.4, omega=9.0, phase=0.3))
_driven("drive_ramp", lambda: mb.Ramp(1.5, offset=0.1, start=-0.05))
_driven("drive_polynomial", lambda: mb.Polynomial([0.1, 0.5, -2.0, 3.0]), "prismatic")
_driven("drive_table", lambda: mb.Table([-0.5, 0.07, 0.2, 0.6], [0.0, 0.1, 0.15, 0.1]), "prismatic")


@scene
def driven_loop():
    m = ring()
    m.drive("motor", "R2", mb.Sine(0.1, frequency=1.0))
    return m


@scene
def coupled():
    m = mb.Model("coupled", gravity=(0.5, -3.0, 1.0))
    a, b = _body(m, "a", (0.5, 0.1, 0), 1), _body(m, "b", (1.1, 0.2, 0.3), 2)
    _far(m, a)
    m.revolute("R1", m.ground, a, at=(0, 0, 0), axis=(0.1, 1.0, 0.2), k=4.0)
    m.cylindrical("C", m.ground, b, at=(1, 0, 0), axis=(0.1, 0.3, 1), k=(8.0, 2.0))
    m.coupler("gear", "R1", "C", 0.7, second_coordinate="rz", offset=0.05)
    return m


def _lawful(name, law, kind="prismatic", speed=0.8):
    def make():
        m = mb.Model(name)
        a = m.body("a", mass=0.8, inertia=(0.1, 0.2, 0.3), at=(0.2, 0, 0), velocity=(speed, 0, 0))
        m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x", k=5.0, preload=1.0, law=law())
        b = m.body("b", mass=0.8, inertia=(0.1, 0.2, 0.3), at=(0.7, 0.2, 0), velocity=(-0.5, 0.2, 0))
        m.spring_damper("link", a, b, at=((0.2, 0, 0), (0.7, 0.2, 0)), k=10.0, law=law())
        m.planar("table", m.ground, b, at=(0.7, 0.2, 0), axis="z")
        return m

    make.__name__ = f"law_{name}"
    return scene(make)


_lawful("cubic", lambda: mb.Cubic(300.0))
_lawful("polynomial", lambda: Polynomial1D([0.1, 2.0, -3.0, 40.0]))
_lawful("polynomial_velocity", lambda: Polynomial1D([0.0, 1.0, 5.0], velocity=[0.0, 0.3, 0.4]))
_lawful("gap", lambda: mb.Gap(500.0, -0.2))
_lawful("gap_smooth", lambda: mb.Gap(500.0, 0.01, smoothing=0.06))
_lawful("gap_both", lambda: mb.Gap(500.0, 0.01, smoothing=0.06, bilateral=True))
_lawful("friction", lambda: mb.CoulombTanh(0.8, 0.3))
_lawful("hertz", lambda: mb.Hertz(900.0, 1.5, -0.1))
_lawful("table", lambda: TableLaw([-1.0, -0.3, 0.11, 0.4, 1.0], [-9.0, -2.0, 0.7, 3.0, 8.0]))
_lawful("van_der_pol", lambda: mb.VanDerPol(1.3))
_lawful("jenkins", lambda: mb.Jenkins(40.0, 90.0))
_lawful("jenkins_sliding", lambda: mb.Jenkins(100.0, 0.5))
_lawful("iwan", lambda: mb.Iwan([100.0, 50.0], [0.5, 90.0]))
_lawful("maxwell", lambda: mb.Maxwell([30.0, 11.0], [0.03, 0.4]))


def _hysteretic(name, law):
    """Laws whose curve of first loading, on which a motion starts, has a kink at zero: springs that are drawn strained."""

    def make():
        m = mb.Model(name)
        a = m.body("a", mass=0.8, inertia=(0.1, 0.2, 0.3), at=(0.2, 0, 0), velocity=(0.8, 0, 0))
        m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x", k=5.0, preload=1.0)
        b = m.body("b", mass=0.8, inertia=(0.1, 0.2, 0.3), at=(0.7, 0.2, 0), velocity=(-0.5, 0.2, 0))
        m.spring_damper("link", a, b, at=((0.2, 0, 0), (0.7, 0.2, 0)), k=10.0, length=0.6, law=law())
        m.spring_damper("stay", m.ground, a, at=((-0.6, 0.3, 0.1), (0.2, 0, 0)), k=3.0, length=0.7, law=law())
        m.planar("table", m.ground, b, at=(0.7, 0.2, 0), axis="z")
        return m

    make.__name__ = f"law_{name}"
    return scene(make)


_hysteretic("bouc_wen", lambda: mb.BoucWen(60.0, 0.2, 30.0, 11.0, 1.3))
_hysteretic("lugre", lambda: mb.LuGre(0.5, 0.8, 0.3, 60.0, 0.4, 0.1))


@scene
def elements():
    m = mb.Model("elements", gravity=(0.5, -3.0, 1.0))
    a, b = _body(m, "a", (0.5, 0.1, 0), 1, orientation=mb.rotation((1, 0, 2), 0.3)), _body(m, "b", (1.1, 0.2, 0.3), 2)
    root = np.random.default_rng(5).normal(size=(6, 6))
    full = root @ root.T + 3 * np.eye(6)
    m.bushing(
        "mount",
        m.ground,
        a,
        at=(0, 0.1, 0),
        k=full,
        c=0.05 * full,
        orientation=mb.rotation("y", 0.4),
        preload=(1, 2, 3, 0.1, 0.2, 0.3),
    )
    m.bushing(
        "bearing", a, b, at=((0.8, 0.1, 0.1), (0.82, 0.1, 0.12)), k=(30, 40, 50, 2, 3, 4), c=(1, 1, 1, 0.1, 0.1, 0.1)
    )
    m.torsion("twist", a, b, at=(0.8, 0.1, 0.1), axis=(0.2, 1, 0), k=2.0, c=0.1, angle=0.1, preload=0.2)
    m.spring_damper("spring", m.ground, b, at=((1, -1, 0.2), (1.2, 0.2, 0.3)), k=15.0, c=0.3, length=0.9)
    m.spring_damper("drawn", a, b, at=((0.4, 0.3, 0), (1.0, 0.4, 0.3)), k=15.0, c=0.3, preload=0.7)
    m.marker("tip", b, at=(1.3, 0.1, 0.2))
    return m


@scene
def loads():
    m = mb.Model("loads", gravity=(0.5, -3.0, 1.0))
    a, b = _body(m, "a", (0.5, 0.1, 0), 1), _body(m, "b", (1.1, 0.2, 0.3), 2)
    m.force("push", a, at=(0.4, 0.2, 0.1), value=(1.0, 2.0, -0.5))
    m.force("follow", b, at=(1.2, 0.2, 0.1), value=(1.0, 2.0, -0.5), frame="body")
    m.torque("turn", a, value=(0.1, 0.2, 0.3))
    m.torque("turn_along", b, value=(0.1, 0.2, 0.3), frame="body")
    m.force(
        "swing",
        b,
        at=(1.0, 0.3, 0.2),
        value=(mb.Sine(2.0, frequency=3.0, phase=0.2), 0.0, mb.Polynomial([0.3, 1.0])),
        frame="body",
    )
    m.force(
        "late",
        a,
        at=(0.4, 0.2, 0.1),
        value=(mb.Ramp(40.0, start=0.045), 0.0, mb.Table([0.0, 0.07, 0.2], [0.0, 1.0, 0.3])),
    )
    return m


def _pull(t):
    return np.array([2.0 * np.sin(5.0 * t), 1.0, 0.5 * t])


def _swing(t):
    return 0.2 * np.sin(3.0 * t), 0.6 * np.cos(3.0 * t), -1.8 * np.sin(3.0 * t)


@scene
def python_functions():
    """A drive and loads that are Python functions, a rack on the driven hinge."""
    m = mb.Model("python", gravity=(0.5, -3.0, 1.0))
    a, b = _body(m, "a", (0.5, 0.1, 0), 1), _body(m, "b", (1.1, 0.2, 0.3), 2)
    _far(m, a)
    joint = m.revolute("J", m.ground, a, at=(0, 0, 0), axis=(0.1, 1.0, 0.2))
    m.spherical("S", a, b, at=(0.8, 0.1, 0.1), axis=(0.1, 0.3, 1), k=(2.0, 3.0, 1.0), c=(0.1, 0.1, 0.1))
    m.drive("motor", joint, _swing)
    rack = _body(m, "rack", (0.1, 2.0, 0.3), 3)
    m.prismatic("rail", m.ground, rack, at=(0, 2.0, 0), axis=(1, 0.2, 0))
    m.coupler("gear", "J", "rail", 0.4)
    m.spring_damper("link", rack, b, at=((0.1, 2.0, 0.3), (1.1, 0.2, 0.3)), k=8.0, c=0.2)
    m.force("pull", b, at=(1.2, 0.2, 0.1), value=_pull)
    m.force("follow", b, at=(1.2, 0.3, 0.1), value=_pull, frame="body")
    return m
