"""A disc spinning in an elastically held housing: gyroscopic splitting of its whirl modes. All data are invented."""

from __future__ import annotations

from ..model.model import Model
from ..model.shapes import Box, Cylinder

# Invented: kg, kg m2; N/m, N m/rad, N s/m.
_HOUSING, _DISC = (4.0, (0.02, 0.02, 0.03)), (6.0, (0.03, 0.03, 0.055))
_MOUNT_K, _MOUNT_C = (8e5, 8e5, 2e6, 9e3, 9e3, 2e4), (40.0, 40.0, 80.0, 0.5, 0.5, 1.0)


def rotor(speed: float = 0.0, overhang: float = 0.12) -> Model:
    """An overhung disc "disc" on the revolute joint "shaft" (axis z) in a body "housing" on an isotropic bushing
    "mount".

    Parameters
    ----------
    speed
        rad/s: initial angular velocity of the disc about z.
    overhang
        m: of the disc above the housing.

    Returns
    -------
    Model
        2 bodies, 7 degrees of freedom, one of them the rigid spin. ``mb.campbell(m, "shaft", speed=...)`` splits the
        tilting and lateral modes into backward and forward whirl. All data are invented.
    """
    m = Model("rotor")
    housing = m.body("housing", mass=_HOUSING[0], inertia=_HOUSING[1], at=(0, 0, 0), shape=Box((0.1, 0.1, 0.04)))
    spin = (0.0, 0.0, speed) if speed else None
    # as large as its moment of inertia about the axis says
    shape = [Cylinder(0.135, 0.02), Cylinder(0.008, overhang, at=(0, 0, -overhang / 2))]
    disc = m.body("disc", mass=_DISC[0], inertia=_DISC[1], at=(0, 0, overhang), angular_velocity=spin, shape=shape)
    m.bushing("mount", m.ground, housing, at=(0, 0, 0), k=_MOUNT_K, c=_MOUNT_C)
    m.revolute("shaft", housing, disc, at=(0, 0, overhang / 2), axis="z")
    return m
