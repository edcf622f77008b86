"""Generalised-alpha once more, complex-safe: a complex step in the numbers goes through the whole discrete solution.

The equations of ``generalized_alpha``; unknowns s1 = v1' and lam of a step are corrected by Newton steps w = h^2 b ds1,
h^2 b dlam with b = beta (1 - alpha_f)/(1 - alpha_m), g = gamma (1 - alpha_f)/(1 - alpha_m):

    h^2 b (M s1 + h + B^T lam) = 0,   Phi(q1) = 0,   h b/g (D v1 + d) = 0

until rounding; then rates are aligned in the norm of M and accelerations made anew. Nothing of it takes a decomposition
that conjugates: saddle points go through the penalty matrices of ``ali3p``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mbrs.errors import ConvergenceError
from mbrs.reference.so3 import Array
from oracles.ali3p import KEPT, PENALTY, Factors, Instant, Mechanism, Scheme, columns, effective_mass, real_instant
from oracles.generalized_alpha import Numbers

_PASSES = 60


@dataclass
class Carried:
    """The algorithmic acceleration, v' of the equations and their multipliers."""

    a: Array
    slope: Array
    lam: Array


class AlphaScheme:
    """Generalised-alpha for one mechanism at numbers p, step h and spectral radius rho."""

    def __init__(self, mech: Mechanism, p: Array, h: float, rho: float = 0.8) -> None:
        self.mech, self.p, self.h, self.n = mech, np.asarray(p), h, Numbers.of(rho)
        factor = (1 - self.n.alpha_f) / (1 - self.n.alpha_m)
        self.b, self.g = self.n.beta * factor, self.n.gamma * factor

    def _reached(self, last: Instant, c: Carried, slope: Array) -> tuple[Any, Array, Array]:
        n, h = self.n, self.h
        a = ((1 - n.alpha_f) * slope + n.alpha_f * c.slope - n.alpha_m * c.a) / (1 - n.alpha_m)
        dq = h * last.v + h * h * ((0.5 - n.beta) * c.a + n.beta * a)
        v = last.v + h * ((1 - n.gamma) * c.a + n.gamma * a)
        return self.mech.advance(last.q, self.mech.turned(dq, h, last.v, v)), v, a

    def _equations(self, last: Instant, c: Carried, slope: Array, lam: Array) -> tuple[Array, Array]:
        m, p, t = self.mech, self.p, last.t + self.h
        q, v, _ = self._reached(last, c, slope)
        balance = m.residual(t, q, v, slope, p) + m.rows(t, q, p).T @ lam
        level = self.h * self.b / self.g * m.rate(t, q, v, p)[m.n_position :]
        return self.h**2 * self.b * balance, np.concatenate([m.phi(t, q, p), level])

    def _factors(self, last: Instant, c: Carried, slope: Array, lam: Array) -> Factors:
        """The slopes of both by w, at real numbers."""
        own = AlphaScheme(self.mech.real(), self.p.real, self.h)
        own.n, own.b, own.g = self.n, self.b, self.g
        at, load = real_instant(last), Carried(c.a.real, c.slope.real, c.lam.real)
        unit = 1 / (self.h**2 * self.b)

        def both(w: Array) -> Array:
            return np.concatenate(own._equations(at, load, slope.real + unit * w, lam.real))

        n = self.mech.n
        found = columns(both, n)
        q = own._reached(at, load, slope.real)[0]
        B = own.mech.rows(last.t + self.h, q, own.p)
        mass = effective_mass(own.mech.mass(q, own.p), B)
        return Factors(found[:n], B.T, found[n:] if len(B) else B, PENALTY * mass)

    def step(self, last: Instant, c: Carried) -> tuple[Instant, Carried]:
        """To t + h. Slopes are kept while they serve: they decide how fast the equations are solved, not what solves them."""
        slope, lam, unit, best = c.slope, c.lam, 1 / (self.h**2 * self.b), np.inf
        by, stale = self._factors(last, c, slope, lam), False
        for _ in range(_PASSES):
            f, g = self._equations(last, c, slope, lam)
            if stale:
                by = self._factors(last, c, slope, lam)
            w, mu = by.solve(-f, -g)
            slope, lam = slope + unit * w, lam + unit * mu
            change = float(max(np.max(np.abs(w.real)), np.max(np.abs(w.imag)) / 1e-40))
            small = change <= 1e-9 * max(float(np.max(np.abs(slope))), 1.0)
            if change == 0 or (change >= 0.5 * best and small):
                break
            stale = change > KEPT * best and not small
            best = min(best, change)
        else:
            raise ConvergenceError("a step of generalised-alpha was not solved; take a smaller step")
        q, v, a = self._reached(last, c, slope)
        return self._instant(last.t + self.h, q, v), Carried(a, slope, lam)

    def _instant(self, t: float, q: Any, v: Array) -> Instant:
        """Rates aligned with the rows, accelerations and multipliers."""
        m, p = self.mech, self.p
        M, B = m.mass(q, p), m.rows(t, q, p)
        by = Factors(M, B.T, B, PENALTY * effective_mass(M.real, B.real))
        v = v + by.solve(0 * v, -m.rate(t, q, v, p))[0]
        a, lam = by.solve(-m.residual(t, q, v, 0 * v, p), -m.bias(t, q, v, p))
        return Instant(t, q, v, a, lam)

    def run(self, n: int) -> list[Instant]:
        """The motion after every step, the start included."""
        first = Scheme(self.mech, self.p, self.h, "mass").begin()
        out, carried = [first], Carried(first.a, first.a, first.lam)
        for _ in range(n):
            end, carried = self.step(out[-1], carried)
            out.append(end)
        return out
