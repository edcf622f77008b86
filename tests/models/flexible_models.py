"""Models with a flexible body for the tests: a rod whose shapes are polynomials, twisted beams, and mechanisms around them."""

from __future__ import annotations

import mbrs as mb
import numpy as np
from mbrs.flexible import ModalBody

GAUSS = np.polynomial.legendre.leggauss(24)


def rod(powers=(2, 3), *, length=1.0, line_mass=2.0, bending=(4.0, 9.0), turning=1e-3, stiffening=True, damping=0.0):
    """A rod along x: displacements (x/L)^p along y and z, q_k in metres at the tip. Invented data.

    Its stiffening is that of an inextensible rod: u_x = -1/2 int (v'^2 + w'^2) dx. ``turning``: polar inertia over the
    length, kg m2.
    """
    x, w = 0.5 * (GAUSS[0] + 1.0) * length, 0.5 * GAUSS[1] * length * line_mass
    modes = [(axis, p) for axis in (1, 2) for p in powers]
    m = len(modes)
    phi, r = np.zeros((m, 3, len(x))), np.zeros((3, len(x)))
    r[0] = x
    for k, (axis, p) in enumerate(modes):
        phi[k, axis] = (x / length) ** p
    K, KG = np.zeros((m, m)), np.zeros((12, m, m))
    places = np.array([[0.0, 0, 0], [0.5 * length, 0, 0], [length, 0, 0]])
    second = np.zeros((3, 3, m, m))
    for k, (axis, p) in enumerate(modes):
        for l_, (other, q) in enumerate(modes):
            if axis != other:
                continue
            curvature = p * (p - 1) * q * (q - 1) * x ** (p + q - 4) / length ** (p + q)
            K[k, l_] = bending[axis - 1] * np.sum(curvature * w) / line_mass
            if stiffening:
                psi = -p * q * x ** (p + q - 1) / (p + q - 1) / length ** (p + q)
                KG[0, k, l_], KG[3, k, l_] = np.sum(w * psi), np.sum(w * psi * x)
                second[:, 0, k, l_] = -p * q * places[:, 0] ** (p + q - 1) / (p + q - 1) / length ** (p + q)

    def shape(at):
        out = np.zeros((6, m))
        for k, (axis, p) in enumerate(modes):
            out[axis, k] = (at / length) ** p
            slope = p * at ** (p - 1) / length**p
            out[5 if axis == 1 else 4, k] = slope if axis == 1 else -slope
        return out

    total = line_mass * length
    return ModalBody(
        total,
        (0.5 * length, 0, 0),
        np.diag([turning * length, total * length**2 / 12, total * length**2 / 12]),
        S=np.einsum("g,kig->ik", w, phi),
        P1=np.einsum("g,jg,kig->kji", w, r, phi),
        P2=np.einsum("g,kjg,lig->klji", w, phi, phi),
        K=K,
        C=damping * K,
        KG=KG,
        nodes=("frame", "mid", "tip"),
        node_position=places,
        node_shape=np.array([shape(p[0]) for p in places]),
        node_quadratic=second,
        note="polynomials, invented",
    )


def cantilever(**options):
    m = mb.Model("cantilever")
    body = m.flexible_body("rod", rod(**options))
    m.fixed("clamp", m.ground, body.node("frame"))
    body.node("tip")
    return m


def tumbling(**options):
    m = mb.Model("tumbling")
    turn = mb.rotation((1, 2, 3), 0.7)
    body = m.flexible_body(
        "rod", rod(**options), at=(0.3, -0.2, 1.0), orientation=turn, velocity=(1, 2, -0.5), angular_velocity=(3, -1, 2)
    )
    # at the origin: there the reference and the core mean the same point, the implicit joint is at the centre of mass
    m.free("loose", m.ground, body.node("frame"))
    body.node("tip")
    return m


def _rigid(m, name, at):
    return m.body(name, mass=0.5, inertia=(0.01, 0.02, 0.015), at=at, com=(0.05, 0.02, -0.03))


def pendulum(**options):
    """Hinge, rod, and a ball on a universal joint at the tip; springs between nodes, a follower load, damping."""
    m = mb.Model("pendulum", gravity=(0.3, 0.2, -9.81))
    body = m.flexible_body("rod", rod(**options))
    m.revolute("hinge", m.ground, body.node("frame"), axis="y", k=30.0, c=0.1)
    ball = _rigid(m, "ball", (1.1, 0, 0))
    m.universal("cardan", body.node("tip"), ball, axis="z", axis2="y", k=(5.0, 6.0), c=(0.1, 0.1))
    m.spring_damper("guy", m.ground, ball, at=((1, 0.3, 1), (1.1, 0, 0)), k=20.0, c=0.5, length=0.9)
    m.bushing("inner", body.node("mid"), ball, at=(0.8, 0, 0), k=(3, 4, 5, 0.1, 0.2, 0.3), c=(0.1,) * 6)
    m.force("push", body.node("mid"), value=(0.1, 1.0, 0.2), frame="body")
    m.torque("twist", body.node("tip"), value=(0.01, 0.02, 0.1))
    m.marker("P", body.node("tip"), at=(1.0, 0.1, 0.0))
    return m


def hanging_by_the_tip(**options):
    """The tree reaches the rod at its tip; a cylindrical joint at its middle carries a ball, reversed."""
    m = mb.Model("by the tip", gravity=(0, 0, -9.81))
    body = m.flexible_body("rod", rod(**options))
    m.spherical("socket", body.node("tip"), m.ground, k=(40.0, 50.0, 60.0))
    ball = _rigid(m, "ball", (0.5, 0, 0.2))
    m.cylindrical("slide", ball, body.node("mid"), at=(0.5, 0, 0.1), axis=(1, 1, 0), k=(30.0, 2.0))
    m.force("pull", body.node("frame"), at=(0, 0.1, 0), value=(0, 0, 5.0))
    return m


def four_bar(**options):
    """A planar four-bar with a flexible coupler, hinges about y: three redundant constraints less what bending frees."""
    m = mb.Model("flexible four-bar", gravity=(0, 0, -9.81))
    inertia = (1e-3, 0.02, 0.02)
    crank = m.body("crank", mass=0.4, inertia=inertia, at=(0, 0, 0.2), orientation=mb.rotation("y", -np.pi / 2))
    rocker = m.body("rocker", mass=0.6, inertia=inertia, at=(1, 0, 0.3), orientation=mb.rotation("y", -np.pi / 2))
    turn = mb.rotation("y", -np.arctan2(0.2, 1.0))
    coupler = m.flexible_body(
        "coupler", rod(length=float(np.hypot(1.0, 0.2)), **options), at=(0, 0, 0.4), orientation=turn
    )
    m.revolute("A", m.ground, crank, at=(0, 0, 0), axis="y", k=60.0, c=0.2)
    m.revolute("B", crank, coupler.node("frame"), axis="y")
    m.revolute("C", rocker, coupler.node("tip"), axis="y", at=(1, 0, 0.6))
    m.revolute("D", m.ground, rocker, at=(1, 0, 0), axis="y")
    return m


MECHANISMS = {
    "cantilever": cantilever,
    "tumbling": tumbling,
    "pendulum": pendulum,
    "by the tip": hanging_by_the_tip,
    "four-bar": four_bar,
}


# --- twisted beams -----

# thick enough to have inertia in every direction; all data invented
BEAM = dict(mass=3.0, EI_flap=400.0, EI_edge=900.0, GJ=50.0, EA=1e5, inertia_flap=0.01, inertia_edge=0.02)


def beam(modes=4, length=2.0, **options):
    """A twisted beam of 6 kg with four or more modes."""
    given = {**BEAM, "elements": 12, "twist": 0.3, "nodes": {"middle": 0.5 * length}, **options}
    return mb.flexible.beam(length, modes=modes, **given)


def flying_beam(**options):
    """A rod thrown into the air, turning."""
    m = mb.Model("flying rod", gravity=(0, 0, -9.81))
    f = m.flexible_body("rod", beam(**options), at=(1, 0, 0), velocity=(1, 2, 3), angular_velocity=(0.3, 4.2, -2.4))
    m.marker("end", f.node("tip"))
    return m


def beam_pendulum(held="root", **options):
    """A rod on a ball joint at its root or at its tip, a bob fixed to the other end, a spring to the middle."""
    m = mb.Model("flexible pendulum", gravity=(0, 0, -9.81))
    f = m.flexible_body("rod", beam(**options), orientation=mb.rotation((1, 2, 0), 0.4))
    other = "tip" if held == "root" else "root"
    points = {name: f.modal.node_position[f.modal.node(name)] @ rotation_of(f).T for name in f.nodes}
    bob = m.body("bob", mass=1.5, inertia=(0.1, 0.12, 0.15), at=points[other])
    m.spherical("hang", m.ground, f.node(held))
    m.fixed("carry", f.node(other), bob)
    anchor = points["middle"] + np.array([0.3, 0.4, 0.5])
    m.spring_damper("string", m.ground, f.node("middle"), at=(anchor, points["middle"]), k=60.0, c=0.4)
    return m


def rotation_of(body):
    """Body to world, as drawn."""
    from mbrs.reference import so3

    return so3.from_quaternion(np.array(body.values("orientation")))


def rotor_blade(speed_joint=True, modes=4, **options):
    """One WindPACT blade (a stand-in, docs/theory.md (23.14)) on a hub that turns about z; flap is along z."""
    data = mb.examples.windpact_blade()
    blade = mb.flexible.beam(
        data.station, mass=data.mass, EI_flap=data.EI_flap, EI_edge=data.EI_edge, modes=modes, elements=30, **options
    )
    m = mb.Model("one blade")
    hub = m.body("hub", mass=100.0, inertia=(10.0, 10.0, 10.0))
    f = m.flexible_body("blade", blade, at=(1.75, 0, 0))
    if speed_joint:
        m.revolute("shaft", m.ground, hub, at=(0, 0, 0), axis="z")
    else:
        m.fixed("shaft", m.ground, hub, at=(0, 0, 0))
    m.fixed("root", hub, f.node("root"))
    m.marker("end", f.node("tip"))
    return m, blade
