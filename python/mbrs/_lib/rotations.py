"""Rotations and twists of plain numbers."""

from __future__ import annotations

import numpy as np


def twist_at(twist: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """The same rigid motion (6, n) at a point displaced by ``arm`` (3,)."""
    moved = twist.copy()
    moved[:3] -= skew(arm) @ twist[3:]
    return moved


def skew(a: np.ndarray) -> np.ndarray:
    """(3, 3) matrix of the cross product: skew(a) @ b = a x b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) rotation of a quaternion (4,), scalar first, of any length but 0."""
    q = np.asarray(quaternion, dtype=float)
    s = skew(q[1:])
    return np.eye(3) + (2.0 / (q @ q)) * (q[0] * s + s @ s)
