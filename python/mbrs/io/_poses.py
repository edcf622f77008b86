"""Poses of frames: rotation matrices (3, 3) and points (3,)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .._lib.rotations import skew

Array = np.ndarray


def rotation_matrix(axis: Sequence[float] | Array, angle: float) -> Array:
    """The rotation (3, 3) about a direction, not zero, by an angle in rad (Rodrigues)."""
    a = np.asarray(axis, dtype=float)
    a = a / np.linalg.norm(a)
    s = skew(a)
    # 1 - cos without cancellation
    return np.eye(3) + np.sin(angle) * s + 2.0 * np.sin(0.5 * angle) ** 2 * (s @ s)


def roll_pitch_yaw(r: float, p: float, y: float) -> Array:
    """Rz(y) Ry(p) Rx(r), the fixed axes of URDF."""
    return rotation_matrix((0, 0, 1), y) @ rotation_matrix((0, 1, 0), p) @ rotation_matrix((1, 0, 0), r)


def roll_pitch_yaw_of(R: Array) -> tuple[float, float, float]:
    """The angles of `roll_pitch_yaw`, with a pitch in [-pi/2, pi/2].

    Roll and pitch are taken from R with the yaw turned back, so that near a pitch of +-pi/2, where the yaw is arbitrary, its rounding
    does not harm the product of the three.
    """
    y = float(np.arctan2(R[1, 0], R[0, 0]))
    c, s = np.cos(y), np.sin(y)
    pitch = float(np.arctan2(-R[2, 0], R[0, 0] * c + R[1, 0] * s))
    roll = float(np.arctan2(R[0, 2] * s - R[1, 2] * c, R[1, 1] * c - R[0, 1] * s))
    return roll, pitch, y


@dataclass(frozen=True)
class Frame:
    """The pose of a frame in the one around it."""

    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))

    def __matmul__(self, inner: Frame) -> Frame:
        return Frame(self.R @ inner.R, self.p + self.R @ inner.p)

    def point(self, local: Sequence[float] | Array) -> Array:
        """A point of this frame in the one around it."""
        return self.p + self.R @ np.asarray(local, dtype=float)

    def within(self, outer: Frame) -> Frame:
        """This frame seen from another one of the same surroundings."""
        return Frame(outer.R.T @ self.R, outer.R.T @ (self.p - outer.p))


@dataclass(frozen=True)
class Inertia:
    """Mass (kg), centre of mass and tensor about it (kg m2), in the axes of some frame."""

    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    tensor: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def moved(self, frame: Frame) -> Inertia:
        """The same in the frame around it."""
        return Inertia(self.mass, frame.point(self.com), frame.R @ self.tensor @ frame.R.T)

    def __add__(self, other: Inertia) -> Inertia:
        mass = self.mass + other.mass
        if mass == 0.0:
            return self
        com = (self.mass * self.com + other.mass * other.com) / mass
        d = self.com - other.com
        # Steiner for two bodies: their reduced mass at their distance
        spread = self.mass * other.mass / mass * ((d @ d) * np.eye(3) - np.outer(d, d))
        return Inertia(mass, com, self.tensor + other.tensor + spread)

    @property
    def symmetric(self) -> Array:
        """The tensor without the rounding of rotations that parts its products."""
        return 0.5 * (self.tensor + self.tensor.T)
