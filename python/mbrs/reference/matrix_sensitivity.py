"""Sensitivities by a design variable matrix V (s, t), in the block layout of `mbrs.matrix_calculus`.

Rigid form, A(V, q, t) q" = B(V, q, q', t), and flexible form, M q" + K q + C_q^T lam - Q - F = 0, C = 0: docs/theory.md
(10.7) and (10.8), equations 12 to 23 of Zhang, Chen and Liu (1994). Unlike there, the start may depend on V.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._lib.vetter import derivative, inverse_rule, product_rule
from .so3 import Array

Function = Callable[..., Array]


def _row(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx^T: the columns side by side."""
    return derivative(lambda r: f(r[0]), x[None, :])


def _over(s: int, matrix: Array) -> Array:
    """I_s kron matrix."""
    return np.kron(np.eye(s), matrix)


@dataclass
class RigidForm:
    """A (n, n) of (V, q, t) and B (n,) of (V, q, v, t), both complex-safe."""

    A: Function
    B: Function

    def acceleration(self, V: Array, q: Array, v: Array, t: float) -> Array:
        """q" = A^-1 B, eq. 12."""
        return np.linalg.solve(self.A(V, q, t), self.B(V, q, v, t))

    def by_design(self, V: Array, q: Array, v: Array, t: float) -> Array:
        """df/dV (n s, t), eq. 14."""
        A, B = self.A(V, q, t), self.B(V, q, v, t)[:, None]
        d_inverse = inverse_rule(A, derivative(lambda w: self.A(w, q, t), V), V.shape)
        dB = derivative(lambda w: self.B(w, q, v, t), V)
        return product_rule(np.linalg.inv(A), d_inverse, B, dB, V.shape)

    def by_rate(self, V: Array, q: Array, v: Array, t: float) -> Array:
        """df/dq'^T (n, n), eq. 15."""
        return np.linalg.solve(self.A(V, q, t), _row(lambda w: self.B(V, q, w, t), v))

    def by_configuration(self, V: Array, q: Array, v: Array, t: float) -> Array:
        """df/dq^T (n, n), eq. 16."""
        A, B, n = self.A(V, q, t), self.B(V, q, v, t)[:, None], (1, len(q))
        d_inverse = inverse_rule(A, _row(lambda w: self.A(V, w, t), q), n)
        return product_rule(np.linalg.inv(A), d_inverse, B, _row(lambda w: self.B(V, w, v, t), q), n)

    def sensitivity_rate(self, V: Array, q: Array, v: Array, t: float, Dq: Array, Dv: Array) -> Array:
        """Dq"/DV (n s, t), eq. 13."""
        s = V.shape[0]
        out = self.by_design(V, q, v, t) + _over(s, self.by_rate(V, q, v, t)) @ Dv
        return out + _over(s, self.by_configuration(V, q, v, t)) @ Dq

    def integrate(
        self, V: Array, start: Callable[[Array], tuple[Array, Array]], h: float, n: int
    ) -> tuple[list[Array], list[Array]]:
        """q and Dq/DV after every step of the classical Runge-Kutta method, eqs 12 and 13 together."""
        q, v = start(V)
        state = [q, v, derivative(lambda w: start(w)[0], V), derivative(lambda w: start(w)[1], V)]
        motion, tangent = [q], [state[2]]
        for i in range(n):
            state = self._step(V, state, i * h, h)
            motion.append(state[0])
            tangent.append(state[2])
        return motion, tangent

    def _step(self, V: Array, state: list[Array], t: float, h: float) -> list[Array]:
        def slope(y: list[Array], t: float) -> list[Array]:
            q, v, Dq, Dv = y
            return [v, self.acceleration(V, q, v, t), Dv, self.sensitivity_rate(V, q, v, t, Dq, Dv)]

        slopes: list[list[Array]] = []
        for f in (0.0, 0.5, 0.5, 1.0):
            at = [y + f * h * k for y, k in zip(state, slopes[-1], strict=True)] if slopes else state
            slopes.append(slope(at, t + f * h))
        a, b, c, d = slopes
        return [y + h / 6 * (i + 2 * j + 2 * k + m) for y, i, j, k, m in zip(state, a, b, c, d, strict=True)]


@dataclass
class FlexibleForm:
    """M, K (n, n) of (V, q, t), C (m,) of (V, q, t), Q and F (n,) of (V, q, v, t) and (V, q, t), C_q (m, n) of (V, q, t);
    all complex-safe.
    """

    M: Function
    K: Function
    C: Function
    C_q: Function
    Q: Function
    F: Function

    def balance(self, V: Array, q: Array, v: Array, a: Array, lam: Array, t: float) -> Array:
        """f of eq. 17."""
        f = self.M(V, q, t) @ a + self.K(V, q, t) @ q + self.C_q(V, q, t).T @ lam
        return f - self.Q(V, q, v, t) - self.F(V, q, t)

    def by_design(self, V: Array, q: Array, v: Array, a: Array, lam: Array, t: float) -> Array:
        """df/dV at fixed motion, eq. 19."""
        one = np.eye(V.shape[1])
        out = derivative(lambda w: self.M(w, q, t), V) @ np.kron(one, a[:, None])
        out = out + derivative(lambda w: self.K(w, q, t), V) @ np.kron(one, q[:, None])
        out = out + derivative(lambda w: self.C_q(w, q, t).T, V) @ np.kron(one, lam[:, None])
        return out - derivative(lambda w: self.Q(w, q, v, t), V) - derivative(lambda w: self.F(w, q, t), V)

    def by_configuration(self, V: Array, q: Array, v: Array, a: Array, lam: Array, t: float) -> Array:
        """f by q^T, eq. 22; K may depend on q too."""
        one = np.eye(len(q))
        out = _row(lambda w: self.M(V, w, t), q) @ np.kron(one, a[:, None]) + self.K(V, q, t)
        out = out + _row(lambda w: self.K(V, w, t), q) @ np.kron(one, q[:, None])
        out = out + _row(lambda w: self.C_q(V, w, t).T, q) @ np.kron(one, lam[:, None])
        return out - _row(lambda w: self.Q(V, w, v, t), q) - _row(lambda w: self.F(V, w, t), q)

    def by_rate(self, V: Array, q: Array, v: Array, t: float) -> Array:
        """f by q'^T, eq. 21."""
        return -_row(lambda w: self.Q(V, q, w, t), v)

    def defect(
        self,
        V: Array,
        motion: tuple[Array, Array, Array, Array],
        tangent: tuple[Array, Array, Array, Array],
        t: float,
    ) -> tuple[Array, Array]:
        """Left sides of eq. 18: zero where the tangents (blocks Dq, Dq', Dq", Dlam by V) belong to the motion."""
        q, v, a, lam = motion
        s = V.shape[0]
        first = self.by_design(V, q, v, a, lam, t)
        parts = (
            self.by_configuration(V, q, v, a, lam, t),
            self.by_rate(V, q, v, t),
            self.M(V, q, t),
            self.C_q(V, q, t).T,
        )
        for partial, d in zip(parts, tangent, strict=True):
            first = first + _over(s, partial) @ d
        second = derivative(lambda w: self.C(w, q, t), V) + _over(s, self.C_q(V, q, t)) @ tangent[0]
        return first, second
