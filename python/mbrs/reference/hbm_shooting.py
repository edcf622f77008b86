"""Shooting with the monodromy matrix by SciPy's integrator: an oracle that shares no discretisation with harmonic balance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from . import hbm_balance
from .so3 import Array


def rates(system: Any, force: Any, omega: float, t: float, state: Array, phi: Array) -> tuple[Array, Array]:
    """Rates of the state [x, x'] (2n,) and of its derivative phi (2n, 2n) by the initial state."""
    M, C, K = hbm_balance.dense(system)
    (x, v), (dx, dv) = np.split(state, 2), np.split(phi, 2)
    terms = (force if isinstance(force, Mapping) else {1: force}).items()
    f = sum(((np.asarray(a, complex) * np.exp(1j * h * omega * t)).real for h, a in terms), np.zeros(system.n))
    f, df = f - K @ x - C @ v, -K @ dx - C @ dv
    for law in system.elements:
        u, rate, phase = (np.array([a]) for a in (law.w @ x, law.w @ v, omega * t))
        value, f_u, f_v = (a[0] for a in hbm_balance.sampled(law, u, rate, phase))
        f, df = f - law.w * value, df - np.outer(law.w, f_u * (law.w @ dx) + f_v * (law.w @ dv))
    return np.concatenate([v, np.linalg.solve(M, f)]), np.concatenate([dv, np.linalg.solve(M, df)])


def flow(
    system: Any, force: Any, omega: float, state: Array, period: float, rtol: float = 1e-12
) -> tuple[Array, Array]:
    """State [x, x'] after one period and its derivative by the initial state."""
    n = len(state)

    def slope(t: float, z: Array) -> Array:
        return np.concatenate([a.ravel() for a in rates(system, force, omega, t, z[:n], z[n:].reshape(n, n))])

    start = np.concatenate([state, np.eye(n).ravel()])
    end = solve_ivp(slope, (0, period), start, method="DOP853", rtol=rtol, atol=1e-14).y[:, -1]
    return end[:n], end[n:].reshape(n, n)


def shoot(
    system: Any, force: Any, omega: float, state: Array, periods: int = 1, tolerance: float = 1e-11
) -> tuple[Array, Array]:
    """Initial state of a periodic motion and its monodromy matrix, by Newton's method from ``state``."""
    eye = np.eye(len(state))

    def equations(s: Array) -> tuple[Array, Array]:
        end, phi = flow(system, force, omega, s, 2 * np.pi * periods / omega)
        return end - s, phi - eye

    state, J = hbm_balance.newton(equations, state, tolerance, size=1.0)
    return state, J + eye


def cycle(system: Any, force: Any, state: Array, period: float, tolerance: float = 1e-12) -> tuple[Array, float, Array]:
    """Initial state, period and monodromy matrix of a limit cycle; the initial state moves orthogonally to the flow."""
    eye = np.eye(len(state))

    def equations(z: Array) -> tuple[Array, Array]:
        end, phi = flow(system, force, 1.0, z[:-1], z[-1])
        speed = rates(system, force, 1.0, z[-1], end, eye)[0]
        return np.append(end - z[:-1], 0.0), np.block([[phi - eye, speed[:, None]], [speed, 0.0]])

    z, J = hbm_balance.newton(equations, np.append(state, period), tolerance, size=1.0)
    return z[:-1], float(z[-1]), J[:-1, :-1] + eye
