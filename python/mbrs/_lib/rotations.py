"""Rotations and twists of plain numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def twist_at(twist: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """The same rigid motion (6, n) at a point displaced by ``arm`` (3,)."""
    moved = twist.copy()
    moved[:3] -= skew(arm) @ twist[3:]
    return moved


def skew(a: Sequence[float] | np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3): skew(a) @ b = a x b."""
    x, y, z = np.moveaxis(np.asarray(a), -1, 0)
    zero = 0.0 * x
    return np.stack([np.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))], -2)


def matrix_to_quaternion(r: np.ndarray) -> np.ndarray:
    """The unit quaternion of a rotation matrix: the eigenvector of Bar-Itzhack's symmetric matrix, w >= 0.

    Source: Bar-Itzhack, J. Guidance 23(6), 2000 (nearest rotation for a matrix that is only nearly orthonormal).
    """
    k = np.empty((4, 4))
    trace = np.trace(r)
    skew = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    k[0, 0] = trace
    k[0, 1:] = k[1:, 0] = skew
    k[1:, 1:] = r + r.T - trace * np.eye(3)
    q = np.linalg.eigh(k)[1][:, -1]
    return q if q[0] >= 0.0 else -q


def cross(a: Sequence[float], b: Sequence[float]) -> list[float]:
    """a x b without the overhead of arrays."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def quaternion_rate(q: Sequence[float], i: int) -> list[float]:
    """d q by a small rotation about world axis i: 1/2 (0, e_i) (x) q."""
    w, v = q[0], q[1:4]
    e = [0.0, 0.0, 0.0]
    e[i] = 1.0
    turned = cross(e, v)
    return [-0.5 * v[i], *(0.5 * (w * e[j] + turned[j]) for j in range(3))]


def quaternion_matrix(q: Sequence[float] | np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), scalar first, of any positive length."""
    unit = np.asarray(q, dtype=float)
    unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    s = skew(unit[..., 1:])
    return np.asarray(np.eye(3) + 2.0 * (unit[..., :1, None] * s + s @ s))
