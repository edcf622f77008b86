"""Four-step BDF with constraints at position and velocity level (Gear, Gupta, Leimkuhler), Newton's method.

    q' - v + J^T mu = 0,   M v' + h + J^T lam = 0,   Phi = 0,   J v + Phi_t = 0             (docs/theory.md (17.12), (17.13))
    y'_n = (25 y_n - 48 y_n-1 + 36 y_n-2 - 16 y_n-3 + 3 y_n-4) / (12 h)

Past poses are seen from the new one, by the tree increments that lead there, whose rate at t_n is v; no ball joint may
turn by pi within four steps. The start is of eighth order.
"""

from __future__ import annotations

import numpy as np
from mbrs.reference.kinematics import System
from mbrs.reference.motion import velocity_rows
from mbrs.reference.simulate import Instant, acceleration, advance_memory, row_rates, rows
from mbrs.reference.so3 import Array
from oracles.explicit import explicit
from oracles.steps import (
    Steps,
    column_scales,
    difference,
    force_scales,
    moved,
    multiplier_scales,
    newton,
    residual,
    row_scales,
)

WEIGHTS = np.array([25.0, -48.0, 36.0, -16.0, 3.0]) / 12


def bdf_step(sys: System, past: list[Instant], h: float) -> tuple[Instant, int]:
    """The step behind four past instants, latest first, and its iterations. Unknowns: increment from a second-order
    Taylor prediction, h v, h^2 lam and mu, scaled.
    """
    sys.t = past[0].t + h
    now, n, velocity = past[0], sys.ny, velocity_rows(sys)
    sys.t = now.t + h
    unit, n_rows = column_scales(sys), len(velocity)
    _, J = rows(sys, now.motion)
    force, lam_scale = force_scales(sys, now.motion) * h**2, multiplier_scales(sys, now.motion, J) / h**2
    guess = moved(sys, now.motion, h * now.motion.rate + 0.5 * h * h * now.a, now.motion.rate + h * now.a)

    def unpacked(z: Array) -> tuple[Array, Array, Array, Array]:
        y, v, lam, mu = np.split(z, [n, 2 * n, 2 * n + n_rows])
        return unit * y, guess.rate + unit * v / h, now.lam + lam_scale * lam, mu

    def equations(z: Array) -> Array:
        y, v, lam, mu = unpacked(z)
        end = moved(sys, guess, y, v)
        slope = (WEIGHTS[0] * v + sum(w * p.motion.rate for w, p in zip(WEIGHTS[1:], past, strict=True))) / h
        seen = sum(w * difference(sys, end.state, p.motion.state) for w, p in zip(WEIGHTS[1:], past, strict=True))
        phi, J = rows(sys, end)
        kinematic = seen - h * v + J[~velocity].T @ (row_scales(sys)[~velocity] * unit.max() * mu)
        level = row_scales(sys) * h * row_rates(sys, v, J)
        dynamic = force * residual(sys, end, slope, lam)
        return np.concatenate([kinematic / unit, dynamic, level, (row_scales(sys) * phi)[~velocity]])

    z, count = newton(equations, np.zeros(2 * n + n_rows + int(np.sum(~velocity))))
    y, v, lam, _ = unpacked(z)
    end = moved(sys, guess, y, v)
    return Instant(now.t + h, end, acceleration(sys, end)[0], lam), count


def bdf4(sys: System, start: Instant, h: float, n: int, past: list[Instant] | None = None) -> Steps:
    """n steps of length h (s) from three explicit ones, or from ``past``: four instants, earliest first."""
    history = explicit(sys, start, h, min(3, n)) if past is None else Steps(list(past))
    while len(history.instants) <= n:
        end, count = bdf_step(sys, history.instants[:-5:-1], h)
        history.iterations += count
        history.instants.append(advance_memory(sys, end))
    return history
