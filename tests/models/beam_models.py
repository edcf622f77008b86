"""Small models with flexible bodies, for the tests."""

from __future__ import annotations

import mbrs as mb
import numpy as np

# thick enough to have inertia in every direction; all data invented
ROD = dict(mass=3.0, EI_flap=400.0, EI_edge=900.0, GJ=50.0, EA=1e5, inertia_flap=0.01, inertia_edge=0.02)


def rod(modes=4, length=2.0, **options):
    """A twisted beam of 6 kg with four or more modes."""
    given = {**ROD, "elements": 12, "twist": 0.3, "nodes": {"middle": 0.5 * length}, **options}
    return mb.flexible.beam(length, modes=modes, **given)


def flying(**options):
    """A rod thrown into the air, turning."""
    m = mb.Model("flying rod", gravity=(0, 0, -9.81))
    f = m.flexible_body("rod", rod(**options), at=(1, 0, 0), velocity=(1, 2, 3), angular_velocity=(0.3, 4.2, -2.4))
    m.marker("end", f.node("tip"))
    return m


def pendulum(held="root", **options):
    """A rod on a ball joint at its root or at its tip, a bob fixed to the other end, a spring to the middle."""
    m = mb.Model("flexible pendulum", gravity=(0, 0, -9.81))
    f = m.flexible_body("rod", rod(**options), orientation=mb.rotation((1, 2, 0), 0.4))
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
