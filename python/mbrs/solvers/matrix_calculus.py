"""``mb.matrix_calculus``: derivatives of matrices by matrices, and the sensitivities of systems given by a user's own matrices.

The rules are those of `mbrs._lib.vetter`; `rigid` and `flexible` differentiate motions by a design variable matrix V (s, t).

Rigid form, A(V, q, t) q" = B(V, q, q', t), and flexible form, M q" + K q + C_q^T lam - Q - F = 0, C = 0: docs/theory.md
(10.7) and (10.8), equations 12 to 23 of Zhang, Chen and Liu (1994). Unlike there, the start may depend on V.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.vetter import (
    Derivative,
    chain_rule,
    chain_rule_columns,
    cs,
    derivative,
    entries,
    inverse_rule,
    kron,
    kron_rule,
    permutation,
    product_rule,
    rs,
    unit,
    vetter,
)

__all__ = [
    "Derivative",
    "FlexibleForm",
    "RigidForm",
    "chain_rule",
    "chain_rule_columns",
    "cs",
    "derivative",
    "entries",
    "flexible",
    "inverse_rule",
    "kron",
    "kron_rule",
    "permutation",
    "product_rule",
    "rigid",
    "rs",
    "unit",
    "vetter",
]

Array = NDArray[Any]
Function = Callable[..., Array]


def _row(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx^T: the columns side by side."""
    return derivative(lambda r: f(r[0]), x[None, :])


def _over(s: int, matrix: Array) -> Array:
    """I_s kron matrix."""
    return np.kron(np.eye(s), matrix)


@dataclass
class RigidForm:
    """A q" = B with A (n, n) of (V, q, t) and B (n,) of (V, q, v, t), both complex-safe: see `rigid`."""

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


def rigid(A: Function, B: Function) -> RigidForm:
    """The equations A(V, q, t) q" = B(V, q, q', t) of a user, to be differentiated by the design variable matrix V.

    Parameters
    ----------
    A, B
        ``A(V, q, t)`` (n, n) and ``B(V, q, v, t)`` (n,), of V (s, t), q (n,), v (n,) and the time; they must take complex numbers (no
        ``abs``, no ``float``).

    Returns
    -------
    RigidForm
        ``acceleration``, its derivatives ``by_design``, ``by_rate`` and ``by_configuration``, and ``integrate(V, start, h, n)``: q and
        Dq/DV (n s, t) after each of n steps of the classical Runge-Kutta method; ``start(V)`` gives q and v.

    Notes
    -----
    Equations (12) to (16) of Zhang, Chen and Liu (1994): docs/theory.md (10.7). Each step costs O(n^3 + s t n^2) beside the functions.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> spring = mb.matrix_calculus.rigid(lambda V, q, t: V[:1], lambda V, q, v, t: -V[1] * q)     # V = [[m], [k]]
    >>> q, Dq = spring.integrate(np.array([[1.0], [4.0]]), lambda V: (np.ones(1), np.zeros(1)), 1e-2, 100)
    >>> bool(abs(q[-1][0] - np.cos(2.0)) < 1e-8), bool(abs(Dq[-1][1, 0] + np.sin(2.0) / 4) < 1e-8)
    (True, True)
    """
    return RigidForm(A, B)


def flexible(M: Function, K: Function, C: Function, C_q: Function, Q: Function, F: Function) -> FlexibleForm:
    """The equations M q" + K q + C_q^T lam = Q + F, C = 0 of a user, to be differentiated by the design variable matrix V.

    Parameters
    ----------
    M, K, C, C_q
        ``f(V, q, t)`` with (n, n), (n, n), (m,) and (m, n): mass, stiffness, constraints and their Jacobian; complex-safe.
    Q, F
        ``Q(V, q, v, t)`` and ``F(V, q, t)``, (n,): velocity-dependent and other forces.

    Returns
    -------
    FlexibleForm
        ``balance``, its derivatives ``by_design``, ``by_configuration`` and ``by_rate``, and ``defect``, by which given Dq/DV,
        Dq'/DV, Dq"/DV and Dlam/DV miss the sensitivity equation.

    Notes
    -----
    Equations (17) to (23) of Zhang, Chen and Liu (1994): docs/theory.md (10.8).
    """
    return FlexibleForm(M, K, C, C_q, Q, F)
