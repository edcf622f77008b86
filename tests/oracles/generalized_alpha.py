"""Generalised-alpha on the Lie group, index 3: Bruls, Cardona and Arnold, Mech. Mach. Theory 48 (2012) 121-137.

    dq = h v0 + h^2 ((1/2 - beta) a0 + beta a1) - h^2/12 v0 x v1,   q1 = q0 exp(dq)
    v1 = v0 + h ((1 - gamma) a0 + gamma a1)
    (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) v1' + alpha_f v0',   M v1' + h(q1, v1) + J^T lam = 0,   Phi(q1) = 0

in tree coordinates; the product is that of three rotations that act together. After a step rates are aligned with the
rows and accelerations made anew, while a and v' of the equations above go on from step to step, as in
``rust/src/integrate/generalized_alpha.rs``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mbrs.reference.kinematics import System
from mbrs.reference.motion import Motion, velocity_rows
from mbrs.reference.simulate import Instant, advance_memory, consistent, row_rates, rows
from mbrs.reference.so3 import Array
from oracles.steps import (
    Steps,
    column_scales,
    force_scales,
    moved,
    multiplier_scales,
    newton,
    residual,
    row_scales,
    turned_increment,
)


@dataclass(frozen=True)
class Numbers:
    """The scheme's numbers from its spectral radius at infinity (Chung and Hulbert, J. Appl. Mech. 60 (1993) 371)."""

    alpha_m: float
    alpha_f: float
    gamma: float
    beta: float

    @classmethod
    def of(cls, rho: float) -> Numbers:
        alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, gamma, 0.25 * (gamma + 0.5) ** 2)


@dataclass
class Carried:
    """Data carried from step to step: the algorithmic acceleration, v' of the equations, their multipliers."""

    a: Array
    slope: Array
    lam: Array


def advanced(sys: System, p: Numbers, now: Motion, c: Carried, slope: Array, h: float) -> tuple[Motion, Array]:
    """The end of a step for a guess of v', and its algorithmic acceleration."""
    a = ((1 - p.alpha_f) * slope + p.alpha_f * c.slope - p.alpha_m * c.a) / (1 - p.alpha_m)
    dq = h * now.rate + h * h * ((0.5 - p.beta) * c.a + p.beta * a)
    rate = now.rate + h * ((1 - p.gamma) * c.a + p.gamma * a)
    return moved(sys, now, turned_increment(sys, dq, h, now.rate, rate), rate), a


def one_step(sys: System, p: Numbers, now: Motion, c: Carried, h: float) -> tuple[Motion, Carried, int]:
    """Unknowns h^2 v' and h^2 lam, scaled: nothing grows as h falls."""
    n, velocity = sys.ny, velocity_rows(sys)
    _, J = rows(sys, now)
    rate_scale = column_scales(sys) / h**2
    lam_scale, force = multiplier_scales(sys, now, J) / h**2, force_scales(sys, now) * h**2

    def equations(z: Array) -> Array:
        slope, lam = c.slope + rate_scale * z[:n], c.lam + lam_scale * z[n:]
        end, _ = advanced(sys, p, now, c, slope, h)
        phi, J = rows(sys, end)
        level = np.where(velocity, h * row_rates(sys, end.rate, J), phi)
        return np.concatenate([force * residual(sys, end, slope, lam), row_scales(sys) * level])

    z, count = newton(equations, np.zeros(n + len(velocity)))
    slope, lam = c.slope + rate_scale * z[:n], c.lam + lam_scale * z[n:]
    end, a = advanced(sys, p, now, c, slope, h)
    return end, Carried(a, slope, lam), count


def generalized_alpha(sys: System, start: Instant, h: float, n: int, rho: float = 0.8) -> Steps:
    """n steps of length h (s); ``rho`` the spectral radius at infinity."""
    p, history = Numbers.of(rho), Steps([start])
    carried = Carried(start.a, start.a, start.lam)
    for i in range(n):
        sys.t = start.t + (i + 1) * h
        end, carried, count = one_step(sys, p, history.instants[-1].motion, carried, h)
        history.iterations += count
        history.instants.append(advance_memory(sys, consistent(sys, sys.t, end)))
    return history
