"""Generalised-alpha on the Lie group, index 3: Bruls and Cardona, J. Comput. Nonlinear Dyn. 5 (2010) 031002.

    q_n+1 = q_n o exp(h D),  D = v_n + h (1/2 - beta) A_n + h beta A_n+1,  v_n+1 = v_n + h (1 - gamma) A_n + h gamma A_n+1
    (1 - alpha_m) A_n+1 + alpha_m A_n = (1 - alpha_f) v'_n+1 + alpha_f v'_n

with angular velocities in body axes and R_n+1 = R_n exp(h D). Unknown is the pose: D, v and v' follow from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import dynamics as dyn
from . import so3
from .kinematics import State, System
from .so3 import Array
from .transient import History, Instant, Scaling, gaps, memory_after, moved, newton, tangents, with_velocity


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


def to_body(state: State, a: Array) -> Array:
    """(6 nb,) with the rotational halves turned into body axes; an acceleration w' = R Omega' as well."""
    out = a.reshape(-1, 6).copy()
    for i, R in enumerate(state.R):
        out[i, 3:] = R.T @ out[i, 3:]
    return out.reshape(-1)


def to_world(state: State, a: Array) -> Array:
    out = a.reshape(-1, 6).copy()
    for i, R in enumerate(state.R):
        out[i, 3:] = R @ out[i, 3:]
    return out.reshape(-1)


def difference(end: State, start: State) -> Array:
    """log(q_start^-1 q_end): translation in the world, rotation vector in body axes."""
    turns = [so3.log(start.R[i].T @ end.R[i]) for i in range(len(end.r))]
    return np.concatenate([end.r - start.r, np.array(turns).reshape(-1, 3)], axis=1).reshape(-1)


def difference_slope(end: State, start: State) -> Array:
    """d difference / d(dr, dtheta) at the end, world increments: J_r^-1(phi) R^T = J_l^-1(-phi) R^T for rotations."""
    out = np.eye(6 * len(end.r))
    for i, R in enumerate(end.R):
        k = slice(6 * i + 3, 6 * i + 6)
        out[k, k] = so3.left_jacobian_inverse(-so3.log(start.R[i].T @ R)) @ R.T
    return out


def carried(state: State, x: Array) -> Array:
    """d(R x)/dtheta at fixed body components, for the rotational halves of world x (6 nb,): -[R x]."""
    out = np.zeros((len(x), len(x)))
    for i in range(len(state.r)):
        k = slice(6 * i + 3, 6 * i + 6)
        out[k, k] = -so3.skew(x[k])
    return out


def turned(state: State) -> Array:
    """diag(1, R): body components to world."""
    out = np.eye(6 * len(state.r))
    for i, R in enumerate(state.R):
        k = slice(6 * i + 3, 6 * i + 6)
        out[k, k] = R
    return out


class _Step:
    """The equations of one step; ``state`` moves while they are solved."""

    def __init__(self, sys: System, n: Numbers, now: Instant, A: Array, h: float) -> None:
        self.sys, self.n, self.now, self.A, self.h = sys, n, now, A, h
        self.v = to_body(now.state, dyn.twists_of(now.state))
        self.dv = to_body(now.state, now.a)
        self.scale = Scaling.of(sys)
        guess = self.v + h * (0.5 - n.beta) * A + h * n.beta * A
        self.lam = now.lam.copy()
        self.state = moved(now.state, to_world(now.state, h * guess))
        self.follow()

    def follow(self) -> None:
        """A, v and v' at the end, from the pose."""
        n, h = self.n, self.h
        D = difference(self.state, self.now.state) / h
        self.A_end = (D - self.v - h * (0.5 - n.beta) * self.A) / (h * n.beta)
        v = self.v + h * (1 - n.gamma) * self.A + h * n.gamma * self.A_end
        dv = ((1 - n.alpha_m) * self.A_end + n.alpha_m * self.A - n.alpha_f * self.dv) / (1 - n.alpha_f)
        self.a = to_world(self.state, dv)
        self.state = with_velocity(self.state, to_world(self.state, v))

    def rows(self) -> tuple[Array, Array, Array]:
        """G, its product with v for velocity rows, Phi for position rows; all in units of the position."""
        G = dyn.constraint_jacobian(self.sys, self.state)[0]
        phi = gaps(self.sys, self.state)
        rate = G[len(phi) :] @ dyn.twists_of(self.state)
        return G, phi, rate

    def residual(self) -> Array:
        """Forces scaled by h^2 / m, rows by 1 / L_c: no loss as h becomes small (METHODS.md e.2b)."""
        G, phi, rate = self.rows()
        f = dyn.applied_residual(self.sys, self.state, self.a, memory=self.now.memory) + G.T @ self.lam
        top = self.scale.force * f * self.force_unit()
        return np.concatenate([top, self.scale.row * np.concatenate([phi, self.h * rate])])

    def force_unit(self) -> float:
        mass = max(float(b.mass) for b in self.sys.bodies)
        return self.h**2 / (mass * self.sys.length)

    def matrix(self) -> Array:
        """Unknowns (dr / L_c, dtheta) and lam h^2 / (m L_c)."""
        n, h, slope = self.n, self.h, difference_slope(self.state, self.now.state)
        K, C, M = tangents(self.sys, self.state, self.a, self.lam)
        turn, v = turned(self.state), dyn.twists_of(self.state)
        by_v = turn @ slope * (n.gamma / (n.beta * h)) + carried(self.state, v)
        by_a = turn @ slope * ((1 - n.alpha_m) / ((1 - n.alpha_f) * n.beta * h * h)) + carried(self.state, self.a)
        S = K + C @ by_v + M @ by_a
        G, phi, _ = self.rows()
        # velocity rows over the pose: (dG v)/dq is left out, a lower order of h than G times d v/d q
        down = np.concatenate([G[: len(phi)], h * G[len(phi) :] @ by_v])
        s, unit = self.scale, self.force_unit()
        top = np.hstack([s.force[:, None] * S * s.q * unit, s.force[:, None] * G.T * s.row])
        low = np.hstack([s.row[:, None] * down * s.q, np.zeros((len(G), len(G)))])
        return np.concatenate([top, low])

    def update(self, d: Array) -> None:
        n = 6 * self.sys.nb
        self.state = moved(self.state, self.scale.q * d[:n])
        self.lam = self.lam + self.scale.row * d[n:] / self.force_unit()
        self.follow()


def generalized_alpha(
    sys: System, start: Instant, h: float, n: int, rho: float = 0.9, A: Array | None = None
) -> History:
    """n steps of length h (s); ``rho`` the spectral radius at infinity, ``A`` the first auxiliary acceleration (body
    axes), by default the acceleration itself.
    """
    numbers, history = Numbers.of(rho), History([start])
    A = to_body(start.state, start.a) if A is None else A
    for _ in range(n):
        now = history.instants[-1]
        step = _Step(sys, numbers, now, A, h)
        history.iterations += newton(step.residual, step.matrix, step.update)
        A = step.A_end
        end = Instant(now.t + h, step.state, step.a, step.lam, now.memory)
        history.instants.append(replace(end, memory=memory_after(sys, step.state, now.memory)))
    return history
