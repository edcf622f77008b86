"""Four-step BDF with constraints at position and velocity level (Gear, Gupta, Leimkuhler), Newton's method.

    q' - v + G^T mu = 0,   M v' + h - Q + G^T lam = 0,   Phi = 0,   G v = 0                      (METHODS.md c.3)
    y'_n = (25 y_n - 48 y_n-1 + 36 y_n-2 - 16 y_n-3 + 3 y_n-4) / (12 h)

Rotations by their vectors seen from the new pose, theta_n-k = log(R_n^T R_n-k), whose rate at t_n is the angular
velocity in body axes; no body may turn by pi within four steps. Velocities in body axes are what is differentiated.
The start is of eighth order.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import dynamics as dyn
from . import so3
from .explicit import explicit
from .generalized_alpha import carried, to_body, to_world, turned
from .kinematics import State, System
from .so3 import Array
from .transient import History, Instant, Scaling, gaps, memory_after, moved, newton, tangents, with_velocity

WEIGHTS = np.array([25.0, -48.0, 36.0, -16.0, 3.0]) / 12


class _Step:
    """The equations of one step behind four past instants (latest first); the state moves while they are solved."""

    def __init__(self, sys: System, past: list[Instant], h: float) -> None:
        self.sys, self.past, self.h, self.scale = sys, past, h, Scaling.of(sys)
        now = past[0]
        self.past_v = [to_body(p.state, dyn.twists_of(p.state)) for p in past]
        v, a = dyn.twists_of(now.state), now.a
        self.state = moved(now.state, h * v + 0.5 * h * h * a)
        self.v = self.past_v[0] + h * to_body(now.state, a)
        self.lam = now.lam.copy()
        self.n_position = len(gaps(sys, now.state))
        self.mu = np.zeros(self.n_position)
        self.follow()

    def follow(self) -> None:
        rate = WEIGHTS[0] * self.v + sum(w * v for w, v in zip(WEIGHTS[1:], self.past_v, strict=True))
        self.a = to_world(self.state, rate / self.h)
        self.state = with_velocity(self.state, to_world(self.state, self.v))

    def chart(self, past: State) -> Array:
        """A past pose seen from the new one: translation in the world, rotation vector in new body axes."""
        turns = [so3.log(R.T @ S) for R, S in zip(self.state.R, past.R, strict=True)]
        return np.concatenate([past.r - self.state.r, np.array(turns).reshape(-1, 3)], axis=1).reshape(-1)

    def chart_rate(self) -> tuple[Array, Array]:
        """h q' and its slope over world increments of the new pose."""
        rate, slope = np.zeros(6 * self.sys.nb), np.zeros((6 * self.sys.nb,) * 2)
        for w, p in zip(WEIGHTS[1:], self.past, strict=True):
            seen = self.chart(p.state)
            rate += w * seen
            for i, R in enumerate(self.state.R):
                t, k = slice(6 * i, 6 * i + 3), slice(6 * i + 3, 6 * i + 6)
                slope[t, t] -= w * np.eye(3)
                slope[k, k] -= w * so3.left_jacobian_inverse(seen[k]) @ R.T
        return rate, slope

    def blocks(self) -> tuple[Array, Array]:
        """G of all rows over world twists, and of the position rows over those of `v`."""
        G = dyn.constraint_jacobian(self.sys, self.state)[0]
        return G, G[: self.n_position] @ turned(self.state)

    def residual(self) -> Array:
        s, h = self.scale, self.h
        G, Gb = self.blocks()
        kinematic = self.chart_rate()[0] - h * self.v + Gb.T @ (s.row[: self.n_position] * self.mu)
        f = dyn.applied_residual(self.sys, self.state, self.a, memory=self.past[0].memory) + G.T @ self.lam
        rows = [gaps(self.sys, self.state) * s.row[: self.n_position], h * s.row * (G @ dyn.twists_of(self.state))]
        return np.concatenate([kinematic / s.q, s.force * f * self.force_unit(), *rows])

    def force_unit(self) -> float:
        return self.h**2 / (max(float(b.mass) for b in self.sys.bodies) * self.sys.length)

    def matrix(self) -> Array:
        """Unknowns (dr / L_c, dtheta), h v likewise, lam h^2 / (m L_c), and mu in units of the position."""
        s, h, m = self.scale, self.h, 6 * self.sys.nb
        G, Gb = self.blocks()
        K, C, M = tangents(self.sys, self.state, self.a, self.lam)
        turn, v, unit = turned(self.state), dyn.twists_of(self.state), self.force_unit()
        by_q = K + C @ carried(self.state, v) + M @ carried(self.state, self.a)
        by_v = C @ turn + M @ turn * (WEIGHTS[0] / h)
        p = self.n_position
        A = np.zeros((2 * m + p + len(G),) * 2)
        A[:m, :m] = self.chart_rate()[1] * s.q / s.q[:, None]
        A[:m, m : 2 * m] = -np.eye(m)
        A[:m, 2 * m + len(G) :] = (Gb.T * s.row[:p]) / s.q[:, None]
        A[m : 2 * m, :m] = s.force[:, None] * by_q * s.q * unit
        A[m : 2 * m, m : 2 * m] = s.force[:, None] * by_v * s.q * unit / h
        A[m : 2 * m, 2 * m : 2 * m + len(G)] = s.force[:, None] * G.T * s.row
        A[2 * m : 2 * m + p, :m] = s.row[:p, None] * G[:p] * s.q
        # (dG v)/dq is left out of the velocity rows: a lower order of h
        A[2 * m + p :, m : 2 * m] = s.row[:, None] * (G @ turn) * s.q
        return A

    def update(self, d: Array) -> None:
        s, m, rows = self.scale, 6 * self.sys.nb, len(self.lam)
        self.state = moved(self.state, s.q * d[:m])
        self.v = self.v + s.q * d[m : 2 * m] / self.h
        self.lam = self.lam + s.row * d[2 * m : 2 * m + rows] / self.force_unit()
        self.mu = self.mu + d[2 * m + rows :]
        self.follow()


def bdf4(sys: System, start: Instant, h: float, n: int, past: list[Instant] | None = None) -> History:
    """n steps of length h (s) from three explicit ones, or from ``past``: four instants, earliest first."""
    history = explicit(sys, start, h, min(3, n)) if past is None else History(list(past))
    while len(history.instants) <= n:
        recent = history.instants[:-5:-1]
        step = _Step(sys, recent, h)
        history.iterations += newton(step.residual, step.matrix, step.update)
        memory = recent[0].memory
        end = Instant(recent[0].t + h, step.state, step.a, step.lam, memory)
        history.instants.append(replace(end, memory=memory_after(sys, step.state, memory)))
    return history
