"""Rotations: unit quaternions, scalar first, body to world; and the few vector operations the model needs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.rotations import matrix_to_quaternion
from ..errors import ModelError
from .expressions import Expression
from .names import problem, shown
from .numbers import Number, array, numbers, scalar, shape_of
from .numbers import axis as direction

if TYPE_CHECKING:
    from .aliases import Axis, Scalar

# How far a matrix may be from orthonormal: hand-typed cosines of six digits pass, a typing error does not.
_ORTHONORMAL = 1e-5


def rotation(axis: Axis, angle: Scalar) -> np.ndarray:
    """The quaternion of a rotation, q = (cos(angle/2), sin(angle/2) a) with the unit axis a.

    Parameters
    ----------
    axis
        "x", "y", "z", "-x", ... or a vector (3,), not zero; its length does not matter. May contain expressions.
    angle
        Radians, right-handed; a number or an expression of parameters.

    Returns
    -------
    (4,) scalar first; an object array of expressions where an argument was one.

    Raises
    ------
    ModelError
        A zero axis, a wrong shape, or a number that is not finite.

    Notes
    -----
    Euler-Rodrigues parameters; cost O(1).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> mb.rotation("z", np.pi).round(6)
    array([0., 0., 0., 1.])
    """
    a = direction(axis, "the axis of a rotation")
    half = scalar(angle, "the angle of a rotation") * 0.5
    plain = not isinstance(half, Expression) and not any(isinstance(v, Expression) for v in a)
    length: Any = math.hypot(*a) if plain else np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    sine = np.sin(half)
    # A plain zero stays one: it depends on no parameter.
    entries = [np.cos(half), *(sine * (v / length) if isinstance(v, Expression) or v else 0.0 for v in a)]
    return np.array(entries, dtype=float if plain else object)


def quaternion(value: Any, where: str) -> list[Number]:
    """A quaternion as given, or that of a rotation matrix (3, 3) body to world; None is the identity."""
    if value is None:
        return [1.0, 0.0, 0.0, 0.0]
    if shape_of(value) == (3, 3):
        return _from_matrix(array(value, (3, 3), where), where)
    if shape_of(value) != (4,):
        raise problem(
            where, f"must be a quaternion (4,), scalar first, or a matrix (3, 3); got {shown(value)}. See mb.rotation"
        )
    return array(value, (4,), where)


def _from_matrix(flat: list[Number], where: str) -> list[Number]:
    r = np.array(numbers(flat)).reshape(3, 3)
    if np.abs(r.T @ r - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(r) < 0.0:
        raise problem(where, "is not a rotation matrix: its columns must be orthonormal and right-handed")
    if any(isinstance(v, Expression) for v in flat):
        return _quaternion_of(flat, int(np.argmax(np.abs(matrix_to_quaternion(r)))))
    return [float(v) for v in matrix_to_quaternion(r)]


def _quaternion_of(flat: list[Number], largest: int) -> list[Number]:
    """4 q_i q of a rotation matrix, i the largest component: Tables take quaternions of any length (S. W. Shepperd, J. Guidance
    1, 1978).
    """
    (a, b, c), (d, e, f), (g, h, k) = flat[:3], flat[3:6], flat[6:]
    rows: tuple[list[Number], ...] = (
        [1.0 + a + e + k, h - f, c - g, d - b],
        [h - f, 1.0 + a - e - k, b + d, c + g],
        [c - g, b + d, 1.0 - a + e - k, f + h],
        [d - b, c + g, f + h, 1.0 - a - e + k],
    )
    return rows[largest]


def unit(given: Any, where: str) -> tuple[float, float, float]:
    """A plain unit vector from "x", "-y", ... or three numbers."""
    a = direction(given, where)
    if any(isinstance(v, Expression) for v in a):
        raise ModelError(f"{where} must be plain numbers, not expressions of parameters")
    length = math.hypot(*a)
    x, y, z = (float(v) / length for v in a)
    return (x, y, z)
