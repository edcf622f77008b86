"""Two mechanisms for ALI3-P: a five-bar in natural coordinates and a point with a nonholonomic row.

Five-bar: docs/theory.md (23.12), a layout found by a search, since no source gives the data. Point: docs/theory.md (23.13), an own example.
"""

from __future__ import annotations

import numpy as np
from mbrs.reference.so3 import Array
from oracles.ali3p import Mechanism

GROUND = np.array([[0.0, 0.0], [1.0, 0.0]])
POINTS = np.array([[-1.0, -1.0], [0.5, -2.0], [2.0, -1.0]])
NATURAL_LENGTHS = np.sqrt([2.0**2 + 1.0**2, 2.0**2 + 0.5**2])
GRAVITY = 9.81
# bars: A-1, 1-2, 2-3, 3-B; points counted from 0, ground A = -2, B = -1
BARS = [(-2, 0), (0, 1), (1, 2), (2, -1)]
SPRINGS = [(-2, 2), (-2, 1)]


class FiveBar(Mechanism):
    """q = (x1 y1 x2 y2 x3 y3), four length rows; p = (L01, L02, k1, k2, m1, m2, m3, m4)."""

    n, n_position = 6, 4
    p = np.array([*NATURAL_LENGTHS, 100.0, 100.0, 1.0, 1.5, 1.5, 1.0])

    @staticmethod
    def _point(q: Array, i: int) -> Array:
        return GROUND[i] if i < 0 else q[2 * i : 2 * i + 2]

    @staticmethod
    def _place(i: int, value: Array) -> Array:
        out = np.zeros((6, *value.shape[1:]), dtype=value.dtype)
        if i >= 0:
            out[2 * i : 2 * i + 2] = value
        return out

    def start(self, p: Array) -> tuple[Array, Array]:
        """At the drawn points, at rest."""
        return POINTS.ravel() + 0 * p[0], np.zeros(6) + 0 * p[0]

    def mass(self, q: Array, p: Array) -> Array:
        """Uniform bars: a third of each mass at its ends, a sixth between them."""
        m = p[4:]
        per_axis = np.array(
            [
                [(m[0] + m[1]) / 3, m[1] / 6, 0 * m[0]],
                [m[1] / 6, (m[1] + m[2]) / 3, m[2] / 6],
                [0 * m[0], m[2] / 6, (m[2] + m[3]) / 3],
            ]
        )
        return np.kron(per_axis, np.eye(2))

    def force(self, q: Array, p: Array) -> Array:
        """Weights, half of each bar at its ends, and two springs."""
        m = p[4:]
        Q = np.zeros(6, dtype=np.result_type(q, p))
        Q[1::2] = -GRAVITY * np.array([m[0] + m[1], m[1] + m[2], m[2] + m[3]]) / 2
        for (i, j), length, k in zip(SPRINGS, p[:2], p[2:4], strict=True):
            d = self._point(q, j) - self._point(q, i)
            pull = -k * (1 - length / np.sqrt(d @ d)) * d
            Q = Q + self._place(j, pull) - self._place(i, pull)
        return Q

    def residual(self, t: float, q: Array, v: Array, a: Array, p: Array) -> Array:
        """M a - Q."""
        return self.mass(q, p) @ a - self.force(q, p)

    def tangents(self, t: float, q: Array, v: Array, a: Array, p: Array) -> tuple[Array, Array]:
        """K of the springs; nothing damps."""
        K = np.zeros((6, 6), dtype=np.result_type(q, p))
        for (i, j), length, k in zip(SPRINGS, p[:2], p[2:4], strict=True):
            d = self._point(q, j) - self._point(q, i)
            r = np.sqrt(d @ d)
            block = k * (1 - length / r) * np.eye(2) + k * length / r**3 * np.outer(d, d)
            at = self._place(j, np.eye(2)) - self._place(i, np.eye(2))
            K = K + at @ block @ at.T
        return K, 0 * K

    def phi(self, t: float, q: Array, p: Array) -> Array:
        """(|d|^2 - L^2) / 2 of the bars."""
        drawn = POINTS.ravel()
        ends = [(self._point(q, j) - self._point(q, i), self._point(drawn, j) - self._point(drawn, i)) for i, j in BARS]
        return np.array([(d @ d - e @ e) / 2 for d, e in ends])

    def rows(self, t: float, q: Array, p: Array) -> Array:
        """d (e_j - e_i)."""
        out = []
        for i, j in BARS:
            d = self._point(q, j) - self._point(q, i)
            out.append(self._place(j, d) - self._place(i, d))
        return np.array(out)

    def bias(self, t: float, q: Array, v: Array, p: Array) -> Array:
        """|d'|^2."""
        at = [(0 if i < 0 else v[2 * i : 2 * i + 2], 0 if j < 0 else v[2 * j : 2 * j + 2]) for i, j in BARS]
        return np.array([np.sum((b - a) ** 2) for a, b in at])


class NonholonomicPoint(Mechanism):
    """m q" = -k q with y' - b z x' = 0; p = (m, k, b)."""

    n, n_velocity = 3, 1
    p = np.array([1.0, 10.0, 1.0])

    def start(self, p: Array) -> tuple[Array, Array]:
        """(1, 0, .5), x' = 1, z' = 0, y' as the row wants it."""
        return np.array([1.0, 0.0, 0.5]) + 0 * p[0], np.array([1.0, p[2] * 0.5, 0.0])

    def mass(self, q: Array, p: Array) -> Array:
        """m 1."""
        return p[0] * np.eye(3)

    def residual(self, t: float, q: Array, v: Array, a: Array, p: Array) -> Array:
        """m a + k q."""
        return p[0] * a + p[1] * q

    def tangents(self, t: float, q: Array, v: Array, a: Array, p: Array) -> tuple[Array, Array]:
        """k 1 and nothing."""
        return p[1] * np.eye(3), 0 * p[1] * np.eye(3)

    def rows(self, t: float, q: Array, p: Array) -> Array:
        """(-b z, 1, 0)."""
        return np.array([[-p[2] * q[2], 1.0 + 0 * q[2], 0 * q[2]]])

    def bias(self, t: float, q: Array, v: Array, p: Array) -> Array:
        """-b z' x'."""
        return np.array([-p[2] * v[2] * v[0]])
