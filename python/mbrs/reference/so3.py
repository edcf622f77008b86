"""Rotations, written so that a complex step passes through: branches look at real parts, squares are products,
never moduli.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

# |B_2k| / (2k)! = 2 zeta(2k) / (2 pi)^2k, the series of 1/t^2 - (1 + cos t) / (2 t sin t) in powers of t^2
_COTANGENT_SERIES = [
    2.0 * sum(float(j) ** (-2 * k) for j in range(1, 40)) / (2.0 * np.pi) ** (2 * k) if k > 5 else exact
    for k, exact in enumerate([0.0, 1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160] + [0.0] * 12)
][1:]


def skew(a: Array) -> Array:
    """[a]x with [a]x b = a x b; (..., 3) to (..., 3, 3)."""
    s = np.zeros((*a.shape, 3), dtype=a.dtype)
    s[..., 0, 1], s[..., 0, 2], s[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    s[..., 1, 0], s[..., 2, 0], s[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return s


def cross(a: Array, b: Array) -> Array:
    """a x b of vectors (..., 3)."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def vee(s: Array) -> Array:
    """The vector of the skew part of s."""
    return 0.5 * np.stack([s[..., 2, 1] - s[..., 1, 2], s[..., 0, 2] - s[..., 2, 0], s[..., 1, 0] - s[..., 0, 1]], -1)


def norm(a: Array) -> Array:
    """sqrt(a . a), analytic."""
    return np.sqrt(np.sum(a * a))


def atan2(y: Array, x: Array) -> Array:
    """Analytic continuation of the arc tangent with two arguments."""
    if not (np.iscomplexobj(y) or np.iscomplexobj(x)):
        return np.arctan2(y, x)
    if abs(x.real) >= abs(y.real):
        half_turn = 0.0 if x.real > 0 else np.copysign(np.pi, y.real)
        return np.arctan(y / x) + half_turn
    return np.copysign(np.pi / 2, y.real) - np.arctan(x / y)


def exp(phi: Array) -> Array:
    """Rotation matrix of a rotation vector."""
    square = np.sum(phi * phi)
    if abs(square) < 1e-2:
        a = sum((-square) ** k / factorial(2 * k + 1) for k in range(9))
        b = sum((-square) ** k / factorial(2 * k + 2) for k in range(9))
    else:
        angle = np.sqrt(square)
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / square
    s = skew(phi)
    return np.eye(3) + a * s + b * (s @ s)


def from_quaternion(q: Array) -> Array:
    """Rotation matrix of a quaternion, scalar first, normalised here."""
    w, x, y, z = q / norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def to_quaternion(R: Array) -> Array:
    """Quaternion with non-negative scalar part, from the largest of its four squares (Shepperd)."""
    trace = np.trace(R)
    squares = np.array([1 + trace, *(1 + 2 * R[i, i] - trace for i in range(3))])
    largest = int(np.argmax(squares.real))
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    if largest == 0:
        q = np.array([squares[0], *v])
    else:
        i = largest - 1
        q = np.array([v[i], *(R[i, j] + R[j, i] if j != i else squares[largest] for j in range(3))])
    q = q / norm(q)
    return -q if q[0].real < 0 else q


def log(R: Array) -> Array:
    """Rotation vector of a rotation matrix, angle in [0, pi]."""
    q = to_quaternion(R)
    w, v = q[0], q[1:]
    square = np.sum(v * v)
    if abs(square) < 1e-3 * abs(w * w):
        t = square / (w * w)
        return 2.0 / w * sum((-t) ** k / (2 * k + 1) for k in range(9)) * v
    sine = np.sqrt(square)
    return 2.0 * atan2(sine, w) / sine * v


def cotangent_coefficient(square: Array) -> tuple[Array, Array]:
    """g(t^2) = 1/t^2 - (1 + cos t) / (2 t sin t) of J_l^-1 = 1 - S/2 + g S^2, and dg/d(t^2)."""
    if abs(square) < 1.0:
        g = sum(c * square**k for k, c in enumerate(_COTANGENT_SERIES))
        dg = sum(k * c * square ** (k - 1) for k, c in enumerate(_COTANGENT_SERIES) if k > 0)
        return np.asarray(g), np.asarray(dg)
    t = np.sqrt(square)
    half_cotangent = (1 + np.cos(t)) / (2 * np.sin(t))
    g = 1 / square - half_cotangent / t
    # d/dt of (1 + cos t) / (2 sin t) is -(1 + cos t) / (2 sin^2 t)
    slope = -2 / (square * t) + half_cotangent / square + half_cotangent / (t * np.sin(t))
    return g, slope / (2 * t)


def left_jacobian_inverse(phi: Array) -> Array:
    """J_l^-1: rate of the rotation vector for an angular velocity in the frame in which the rotation is written."""
    s = skew(phi)
    g, _ = cotangent_coefficient(np.sum(phi * phi))
    return np.eye(3) - 0.5 * s + g * (s @ s)
