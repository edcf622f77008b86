"""Uniform rods in the plane of a drawing, with velocities that fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..model.model import Model
from ..model.rotations import rotation

# Inertia of a rod about its own axis over that across it: invented, and of no effect in plane motion.
SLIGHT = 0.012


def rod(
    m: Model,
    name: str,
    ends: Sequence[Any],
    mass: float,
    velocities: Sequence[Any] | None = None,
) -> Any:
    """A uniform rod between two points (x, y) whose ends move at the velocities (vx, vy), across it alike."""
    (p, q) = (np.array([*e, 0.0]) for e in ends)
    along = q - p
    length = float(np.linalg.norm(along))
    across = mass * length**2 / 12
    motion: dict[str, Any] = {}
    if velocities is not None:
        v, w = (np.array([*e, 0.0]) for e in velocities)
        motion = dict(velocity=(v + w) / 2, angular_velocity=np.cross(along, w - v) / length**2)
    return m.body(
        name,
        mass=mass,
        inertia=(SLIGHT * across, across, across),
        at=(p + q) / 2,
        orientation=rotation("z", float(np.arctan2(along[1], along[0]))),
        **motion,
    )
