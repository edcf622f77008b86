"""ALI3-P: index-3 augmented Lagrangian with projections, and its tangent linear model, in plain NumPy.

Trapezoidal rule v = 2/h x - v_n, a = 2/h (v - v_n) - a_n, q = q_n exp(x - h^2/12 v_n x v). With c = h^2/4, rows B = [Phi_q; D]:

    c [M a + Phi_q^T (lam + alpha Phi) + D^T (mu + beta Psi) - Q] = 0,  lam += alpha Phi, mu += beta Psi
    W (v - v*) + B^T kappa = 0, B v + b = 0;   W (a - a*) + B^T nu = 0, B a + b' = 0

iterated until Phi, Psi and both projections are at rounding level. W = M + h/2 C + h^2/4 K ("tangent") or M ("mass").
Source: docs/theory.md (17.14) to (17.17), (20.3); D. Dopico and others, Nonlinear Dynamics 93 (2018) 2039-2056.
Complex-safe: a complex step in the numbers goes through the whole discrete solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mbrs.errors import ConvergenceError
from mbrs.reference.so3 import Array

PENALTY = 1e7
# a Newton step that is not smaller by this part than the last one wants new slopes
KEPT = 0.1
_STEP = 1e-40
_PASSES = 100


class Mechanism:
    """A mechanism: complex-safe functions of time, configuration, rates and the numbers p.

    ``n`` coordinates, ``n_position`` rows of position level, then ``n_velocity`` rows D v + d = 0.
    """

    n: int
    n_position: int = 0
    n_velocity: int = 0

    def real(self) -> Mechanism:
        """The mechanism at the real parts of whatever numbers it holds itself."""
        return self

    def start(self, p: Array) -> tuple[Any, Array]:
        """Configuration and rates at t = 0, consistent with the rows."""
        raise NotImplementedError

    def advance(self, q: Any, dq: Array) -> Any:
        """The configuration moved by increments."""
        return q + dq

    def turned(self, x: Array, h: float, v0: Array, v1: Array) -> Array:
        """The increment over a step whose rates go evenly from v0 to v1, x = h (v0 + v1)/2: more than x where coordinates turn."""
        return x

    def mass(self, q: Any, p: Array) -> Array:
        """M (n, n)."""
        raise NotImplementedError

    def residual(self, t: float, q: Any, v: Array, a: Array, p: Array) -> Array:
        """M a - Q (n,)."""
        raise NotImplementedError

    def phi(self, t: float, q: Any, p: Array) -> Array:
        """Values of the position rows."""
        return np.zeros(0)

    def rows(self, t: float, q: Any, p: Array) -> Array:
        """B = [Phi_q; D]."""
        return np.zeros((0, self.n))

    def rate(self, t: float, q: Any, v: Array, p: Array) -> Array:
        """B v + b."""
        return self.rows(t, q, p) @ v

    def bias(self, t: float, q: Any, v: Array, p: Array) -> Array:
        """Terms that B a must cancel."""
        return np.zeros(self.n_position + self.n_velocity)

    def tangents(self, t: float, q: Any, v: Array, a: Array, p: Array) -> tuple[Array, Array]:
        """K = d(M a - Q)/dq and C = -dQ/dv."""
        raise NotImplementedError


@dataclass
class Instant:
    """Configuration, rates, accelerations, multipliers of all rows."""

    t: float
    q: Any
    v: Array
    a: Array
    lam: Array


@dataclass
class Tangent:
    """Derivatives (n, n_p) of q, v, a and (rows, n_p) of the multipliers."""

    q: Array
    v: Array
    a: Array
    lam: Array


@dataclass
class Step:
    """One step in detail: x, what the trapezoidal rule made of it, the projections' multipliers."""

    end: Instant
    x: Array
    v_star: Array
    a_star: Array
    kappa: Array
    nu: Array
    iterations: int
    # multiplier updates of all Newton iterations, of the projection of velocities and of that of accelerations
    passes: tuple[int, int, int]
    # largest |B v + b| and |B a + b'| before and after their projections
    residual: tuple[tuple[float, float], tuple[float, float]]


def _largest(x: Array) -> float:
    return float(np.max(np.abs(np.real(x)), initial=0.0))


def _size(x: Array) -> float:
    return float(max(np.max(np.abs(x.real), initial=0.0), np.max(np.abs(x.imag), initial=0.0) / _STEP))


def columns(f: Callable[[Array], Array], n: int) -> Array:
    """df/dx at x = 0 by complex steps; f is taken at real numbers."""
    return np.array([f(1j * _STEP * e).imag / _STEP for e in np.eye(n)]).T


@dataclass
class Factors:
    """[A L; R 0] solved by its penalty matrix A + L alpha R and multiplier updates until rounding."""

    A: Array
    L: Array
    R: Array
    alpha: Array
    # multiplier updates of all solutions so far
    passes: int = 0

    def solve(self, f: Array, g: Array) -> tuple[Array, Array]:
        """x, y with A x + L y = f, R x = g."""
        P = self.A + self.L * self.alpha @ self.R
        x, y = np.zeros_like(f @ np.eye(len(f))), np.zeros_like(g)
        best = np.inf
        for _ in range(_PASSES):
            self.passes += 1
            miss = g - self.R @ x
            dx = np.linalg.solve(P, f - self.A @ x - self.L @ (y - self.alpha * miss))
            x = x + dx
            # R dx - miss, not R x - g: the rounding of x would come back alpha-fold
            y = y + self.alpha * (self.R @ dx - miss)
            change = _size(dx)
            if change == 0 or (change >= 0.1 * best and change <= 1e-10 * _size(x)):
                return x, y
            best = min(best, change)
        raise ConvergenceError("the multipliers of a projection do not converge: the rows contradict each other")


def effective_mass(M: Array, B: Array) -> Array:
    """1 / diag(B M^-1 B^T): the mass that a row feels; none where a row is rounding only."""
    if len(B) == 0:
        return np.zeros(0)
    light = np.einsum("ij,ji->i", B, np.linalg.solve(M, B.T))
    felt = light > 1e-18 * light.max()
    return np.where(felt, 1.0 / np.where(felt, light, 1.0), 0.0)


class Scheme:
    """ALI3-P for one mechanism at numbers p and step h.

    ``penalty``: alpha in effective masses of the rows. It decides how many passes the multipliers need, not where they end.
    """

    def __init__(self, mech: Mechanism, p: Array, h: float, weight: str = "tangent", penalty: float = PENALTY) -> None:
        self.mech, self.p, self.h, self.weight, self.penalty = mech, np.asarray(p), h, weight, penalty
        self.c = h * h / 4

    def _stars(self, last: Instant, x: Array) -> tuple[Any, Array, Array]:
        v = 2 / self.h * x - last.v
        q = self.mech.advance(last.q, self.mech.turned(x, self.h, last.v, v))
        return q, v, 2 / self.h * (v - last.v) - last.a

    def _balance(self, last: Instant, x: Array, lam: Array) -> Array:
        """c (M a + B^T lam - Q) at the end of the step."""
        m, p, t = self.mech, self.p, last.t + self.h
        q, v, a = self._stars(last, x)
        return self.c * (m.residual(t, q, v, a, p) + m.rows(t, q, p).T @ lam)

    def _closure(self, last: Instant, x: Array) -> Array:
        """Phi, then h/2 Psi, so that both have the derivative B by x but for what turns."""
        m, p, t = self.mech, self.p, last.t + self.h
        (q, v, _), n = self._stars(last, x), m.n_position
        psi = m.rate(t, q, v, p)[n:]
        return np.concatenate([m.phi(t, q, p), 0.5 * self.h * psi])

    def factors(self, last: Instant, x: Array, lam: Array) -> Factors:
        """The tangent of the step at real numbers."""
        own = Scheme(self.mech.real(), self.p.real, self.h, self.weight, self.penalty)
        at = real_instant(last)
        x, lam, n = x.real, lam.real, self.mech.n
        q = own._stars(at, x)[0]
        A = columns(lambda d: own._balance(at, x + d, lam), n)
        B = own.mech.rows(at.t + self.h, q, own.p)
        R = columns(lambda d: own._closure(at, x + d), n) if len(B) else B
        # multipliers in units of c lam: the penalty is alpha c in effective masses
        return Factors(A, B.T, R, self.penalty * effective_mass(own.mech.mass(q, own.p), B))

    def step(self, last: Instant) -> Step:
        """To t + h."""
        m, h = self.mech, self.h
        x = h * last.v + 0.5 * h * h * last.a
        lam = last.lam
        best, passes, updates = np.inf, 0, 0
        # slopes are kept while they serve: they decide how fast the equations are solved, not what solves them
        by, stale = self.factors(last, x, lam), False
        while True:
            passes += 1
            if stale:
                by = self.factors(last, x, lam)
            known = by.passes
            d, y = by.solve(-self._balance(last, x, lam), -self._closure(last, x))
            updates += by.passes - known
            x, lam = x + d, lam + y / self.c
            change = _size(d)
            small = change <= 1e-9 * max(_size(x), self.h)
            if change == 0 or (change >= 0.5 * best and small):
                break
            if passes == _PASSES:
                raise ConvergenceError(f"ALI3-P found no solution in {_PASSES} iterations; take a smaller step")
            stale = change > KEPT * best and not small
            best = min(best, change)
        q, v_star, a_star = self._stars(last, x)
        t = last.t + h
        W, B = self.metric(t, q, v_star, a_star), m.rows(t, q, self.p)
        project = Factors(W, B.T, B, self.penalty * effective_mass(m.mass(q, self.p).real, B.real))
        miss = m.rate(t, q, v_star, self.p)
        dv, kappa = project.solve(0 * v_star, -miss)
        v, of_velocity = v_star + dv, project.passes
        bias = m.bias(t, q, v, self.p)
        da, nu = project.solve(0 * a_star, -(bias + B @ a_star))
        a = a_star + da
        of_rates = _largest(miss), _largest(m.rate(t, q, v, self.p))
        residual = of_rates, (_largest(bias + B @ a_star), _largest(bias + B @ a))
        counted = (updates, of_velocity, project.passes - of_velocity)
        return Step(Instant(t, q, v, a, lam), x, v_star, a_star, kappa, nu, passes, counted, residual)

    def metric(self, t: float, q: Any, v: Array, a: Array) -> Array:
        """W."""
        M = self.mech.mass(q, self.p)
        if self.weight == "mass":
            return M
        K, C = self.mech.tangents(t, q, v, a, self.p)
        return M + self.h / 2 * C + self.c * K

    def begin(self) -> Instant:
        """Initial accelerations and multipliers: M a - Q + B^T lam = 0, B a + b' = 0."""
        m, p = self.mech, self.p
        q, v = m.start(p)
        M, B = m.mass(q, p), m.rows(0.0, q, p)
        by = Factors(M, B.T, B, self.penalty * effective_mass(M.real, B.real))
        zero = np.zeros(m.n, dtype=np.result_type(p, M, float))
        a, lam = by.solve(-m.residual(0.0, q, v, zero, p), -m.bias(0.0, q, v, p))
        return Instant(0.0, q, v, a, lam)

    def run(self, n: int) -> list[Instant]:
        """The motion after every step, the start included."""
        out = [self.begin()]
        for _ in range(n):
            out.append(self.step(out[-1]).end)
        return out

    # --- tangent linear model: configurations that form a vector space -----

    def begin_tangent(self) -> Tangent:
        """Derivatives of the start by every number, by complex steps through `begin`."""
        parts = []
        for e in np.eye(len(self.p)):
            one = Scheme(self.mech, self.p + 1j * _STEP * e, self.h, self.weight, self.penalty).begin()
            parts.append([np.asarray(x, dtype=complex).imag / _STEP for x in (one.q, one.v, one.a, one.lam)])
        return Tangent(*(np.array(x).T for x in zip(*parts, strict=True)))

    def step_tangent(self, last: Instant, before: Tangent, done: Step) -> Tangent:
        """S, v', a', lam' of a converged step: three linear systems with the matrices of the step itself."""
        m, h = self.mech, self.h
        n_p, lam, t = len(self.p), done.end.lam, last.t + h
        by = self.factors(last, done.x, lam)
        W, B = self.metric(t, done.end.q, done.v_star, done.a_star), m.rows(t, done.end.q, self.p)
        project = Factors(W, B.T, B, self.penalty * effective_mass(m.mass(done.end.q, self.p), B))
        out = []
        for k in range(n_p):
            p = self.p + 1j * _STEP * np.eye(n_p)[k]
            along = Scheme(m, p, h, self.weight, self.penalty)
            ends = ((last.q, before.q), (last.v, before.v), (last.a, before.a))
            q0, v0, a0 = (x + 1j * _STEP * d[:, k] for x, d in ends)
            start = Instant(last.t, q0, v0, a0, lam)
            f = along._balance(start, done.x, lam).imag / _STEP
            g = along._closure(start, done.x).imag / _STEP
            s, y = by.solve(-f, -g)
            # what is known so far, each with its derivative
            q, v_star, a_star = along._stars(start, done.x + 1j * _STEP * s)
            W_k, B_k = along.metric(t, q, v_star, a_star), m.rows(t, q, p)
            v, a = done.end.v, done.end.a
            f = (W_k @ (v - v_star) + B_k.T @ done.kappa).imag / _STEP
            dv, _ = project.solve(-f, -m.rate(t, q, v + 0j, p).imag / _STEP)
            bias = m.bias(t, q, v + 1j * _STEP * dv, p)
            f = (W_k @ (a - a_star) + B_k.T @ done.nu).imag / _STEP
            da, _ = project.solve(-f, -(bias + B_k @ a).imag / _STEP)
            out.append((q.imag / _STEP, dv, da, y / self.c))
        return Tangent(*(np.array(x).T for x in zip(*out, strict=True)))

    def run_tangent(self, n: int) -> tuple[list[Instant], list[Tangent]]:
        """The motion and its derivatives by all numbers."""
        motion, tangent = [self.begin()], [self.begin_tangent()]
        for _ in range(n):
            done = self.step(motion[-1])
            tangent.append(self.step_tangent(motion[-1], tangent[-1], done))
            motion.append(done.end)
        return motion, tangent


def real_instant(i: Instant) -> Instant:
    """The same at real numbers."""
    real = i.q.real if isinstance(i.q, np.ndarray) else _real_state(i.q)
    return Instant(i.t, real, i.v.real, i.a.real, i.lam.real)


def _real_state(q: Any) -> Any:
    from dataclasses import replace

    return replace(q, **{k: np.real(getattr(q, k)) for k in ("r", "R", "v", "w")})


def trapezoid(values: Array, h: float) -> Array:
    """The integral over the steps by the quadrature of the scheme."""
    return h * (values[1:] + values[:-1]).sum(axis=0) / 2
