"""Blades in wind for tests: polars, flexible and rigid blades on random axes."""

from __future__ import annotations

import mbrs as mb
import numpy as np


def polars():
    """Two sections over all angles."""
    a = np.radians(np.arange(-180.0, 181.0, 7.5))
    thin = mb.aero.polar(
        a,
        np.pi * np.sin(2 * a) + 0.11 * np.cos(a) ** 2,
        0.008 + 1.3 * np.sin(a) ** 4,
        -0.04 * np.cos(a),
        thickness=0.18,
        name="thin",
    )
    thick = mb.aero.polar(a, 2.1 * np.sin(2 * a), 0.03 + 1.2 * np.sin(a) ** 4, thickness=0.40, name="thick")
    return thin, thick


def vane(sections=5, inflow="none", flexible=True, seed=3, **wind):
    """A blade of 3 m that bends and swings about a leaning hinge with a spring; body axes leaning too."""
    rng = np.random.default_rng(seed)
    thin, thick = polars()
    turn = mb.rotation(rng.normal(size=3), rng.uniform(0.5, 2.5))
    at = rng.normal(size=3)
    m = mb.Model("vane", gravity=(0.3, -1.1, -9.7))
    if flexible:
        beam = mb.flexible.beam(3.1, mass=1.7, EI_flap=910.0, EI_edge=3300.0, modes=3, damping=[0.02, 0.02, 0.02])
        arm = m.flexible_body("arm", beam, at=at, orientation=turn)
        root = arm.node("root")
    else:
        arm = root = m.body("arm", mass=4.0, inertia=(0.4, 3.1, 3.3), com=(1.5, 0.02, -0.01), at=at, orientation=turn)
    m.revolute("hinge", m.ground, root, at=at, axis=rng.normal(size=3), k=7300.0, c=61.0)
    blade = mb.aero.blade(
        [0.35, 1.2, 3.1], [0.42, 0.51, 0.23], [0.31, 0.12, -0.04], [thin, thick], thickness=[0.4, 0.3, 0.19],
        aerodynamic_center=[0.25, 0.26, 0.24], body="arm", line=0.31, sections=sections,
    )  # fmt: skip
    given = {"speed": 13.7, "direction": rng.normal(size=3), **wind}
    m.aerodynamics("air", [blade], wind=mb.aero.wind(**given), density=1.31, inflow=inflow, pitch=0.07)
    return m


def _wind(speed, shear):
    """Along x; the reference height is 25 m, and the rotor's hub is there."""
    return mb.aero.wind(speed, "x", shear, 25.0, "z", -25.0) if shear else mb.aero.wind(speed)


def rotor(inflow="bem", sections=24, speed=2.1, wind=9.0, count=3, shear=0.0, **more):
    """A rigid rotor of stiff blades that turn about x at a given speed; blade 1 points to z when drawn."""
    thin, _ = polars()
    m = mb.Model("rotor")
    hub = m.body("hub", mass=100.0, inertia=(50.0, 50.0, 50.0), at=(0, 0, 0), angular_velocity=(speed, 0, 0))
    bearing = m.revolute("bearing", m.ground, hub, at=(0, 0, 0), axis="x")
    m.drive("turning", bearing, mb.Ramp(speed))
    blades = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        out = np.array([0.0, -np.sin(angle), np.cos(angle)])
        axes = np.stack([out, np.cross([1.0, 0.0, 0.0], out), [1.0, 0.0, 0.0]], axis=1)
        name = f"blade{i + 1}"
        body = m.body(name, mass=50.0, inertia=(1.0, 200.0, 200.0), at=1.5 * out, orientation=axes,
                      velocity=1.5 * speed * axes[:, 1], angular_velocity=(speed, 0, 0))  # fmt: skip
        m.fixed(f"root{i + 1}", hub, body, at=1.5 * out)
        blades.append(
            mb.aero.blade(
                [1.5, 6.0, 18.0],
                [1.6, 2.1, 0.7],
                np.radians([21.0, 11.0, 0.5]),
                thin,
                body=name,
                root=1.5,
                sections=sections,
            )
        )
    m.aerodynamics("air", blades, wind=_wind(wind, shear), inflow=inflow, **more)
    return m, blades[0]
