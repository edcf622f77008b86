"""A disc that rolls on a plane and wobbles."""

from __future__ import annotations

import numpy as np

from ..model.model import Model
from ..model.rotations import rotation


def rolling_disc(
    mass: float = 1.5,
    radius: float = 0.25,
    lean: float = 0.35,
    spin: float = 8.0,
    turn: float = 0.6,
    gravity: float = 9.81,
) -> Model:
    """A thin uniform "disc" that rolls without slip on the plane z = 0 ("contact"), along x at first.

    ``lean`` rad from upright, ``spin`` rad/s about its own axis and ``turn`` rad/s about the vertical at the start; fast
    enough to stay up: the lean swings. Marker "rim" at the point that touches first. Inertias m r^2/2 and m r^2/4; data
    invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.rolling_disc()).dof
    3
    """
    m = Model("rolling disc", gravity=(0.0, 0.0, -gravity))
    axis = np.array([0.0, np.cos(lean), np.sin(lean)])
    up = np.array([0.0, -np.sin(lean), np.cos(lean)])
    w = spin * axis + turn * np.array([0.0, 0.0, 1.0])
    across = mass * radius**2 / 4
    disc = m.body(
        "disc",
        mass=mass,
        inertia=(across, 2 * across, across),
        at=radius * up,
        orientation=rotation("x", lean),
        velocity=np.cross(w, radius * up),
        angular_velocity=w,
    )
    m.rolling_disc("contact", m.ground, disc, at=((0, 0, 0), radius * up), axis="z", axis2=axis, radius=radius)
    m.marker("rim", disc, at=(0, 0, 0))
    return m
