"""Models with a flexible body for the tests: a rod whose shapes are polynomials, and mechanisms around it."""

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
    for k, (axis, p) in enumerate(modes):
        for l_, (other, q) in enumerate(modes):
            if axis != other:
                continue
            curvature = p * (p - 1) * q * (q - 1) * x ** (p + q - 4) / length ** (p + q)
            K[k, l_] = bending[axis - 1] * np.sum(curvature * w) / line_mass
            if stiffening:
                psi = -p * q * x ** (p + q - 1) / (p + q - 1) / length ** (p + q)
                KG[0, k, l_], KG[3, k, l_] = np.sum(w * psi), np.sum(w * psi * x)

    def shape(at):
        out = np.zeros((6, m))
        for k, (axis, p) in enumerate(modes):
            out[axis, k] = (at / length) ** p
            slope = p * at ** (p - 1) / length**p
            out[5 if axis == 1 else 4, k] = slope if axis == 1 else -slope
        return out

    places = np.array([[0.0, 0, 0], [0.5 * length, 0, 0], [length, 0, 0]])
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
