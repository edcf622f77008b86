"""Shooting with the monodromy matrix by SciPy's integrator: an oracle that shares nothing with harmonic balance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from . import hbm_balance


def flow(
    system: Any, force: Any, omega: float, state: np.ndarray, period: float, rtol: float = 1e-12
) -> tuple[np.ndarray, np.ndarray]:
    """State [x, x'] after one period and its derivative by the initial state."""
    M, C, K = hbm_balance.dense(system)
    n, inverse = system.n, np.linalg.inv(M)
    terms = [(h, np.asarray(f, complex)) for h, f in (force if isinstance(force, Mapping) else {1: force}).items()]

    def rate(t: float, s: np.ndarray) -> np.ndarray:
        x, v, phi = s[:n], s[n : 2 * n], s[2 * n :].reshape(2 * n, 2 * n)
        f = sum(((a * np.exp(1j * h * omega * t)).real for h, a in terms), np.zeros(n))
        stiffness, damping = K.copy(), C.copy()
        f = f - K @ x - C @ v
        for law in system.elements:
            w = law.w
            value, f_u, f_v = (
                a[0] for a in hbm_balance.sampled(law, np.array([w @ x]), np.array([w @ v]), np.array([omega * t]))
            )
            f = f - w * value
            stiffness += f_u * np.outer(w, w)
            damping += f_v * np.outer(w, w)
        d_phi = np.vstack([phi[n:], -inverse @ (stiffness @ phi[:n] + damping @ phi[n:])])
        return np.concatenate([v, inverse @ f, d_phi.ravel()])

    start = np.concatenate([state, np.eye(2 * n).ravel()])
    motion = solve_ivp(rate, (0, period), start, method="DOP853", rtol=rtol, atol=1e-14)
    end = motion.y[:, -1]
    return end[: 2 * n], end[2 * n :].reshape(2 * n, 2 * n)


def shoot(
    system: Any, force: Any, omega: float, state: np.ndarray, periods: int = 1, tolerance: float = 1e-11
) -> tuple[np.ndarray, np.ndarray]:
    """Initial state of a periodic motion and its monodromy matrix, by Newton's method from ``state``."""
    period = 2 * np.pi * periods / omega
    for _ in range(30):
        end, phi = flow(system, force, omega, state, period)
        step = np.linalg.solve(phi - np.eye(len(state)), state - end)
        state = state + step
        if np.max(np.abs(step)) < tolerance * max(1.0, np.max(np.abs(state))):
            return state, phi
    raise RuntimeError("shooting did not converge")


def cycle(
    system: Any, force: Any, state: np.ndarray, period: float, tolerance: float = 1e-12
) -> tuple[np.ndarray, float, np.ndarray]:
    """Initial state, period and monodromy matrix of a limit cycle; the initial state moves orthogonally to the flow."""
    h = 1e-6
    for _ in range(40):
        end, phi = flow(system, force, 1.0, state, period)
        later, _ = flow(system, force, 1.0, end, h * period)
        earlier, _ = flow(system, force, 1.0, end, -h * period)
        speed = (later - earlier) / (2 * h * period)
        A = np.block([[phi - np.eye(len(state)), speed[:, None]], [speed[None, :], np.zeros((1, 1))]])
        step = np.linalg.solve(A, np.append(state - end, 0.0))
        state, period = state + step[:-1], period + step[-1]
        if np.max(np.abs(step)) < tolerance * max(1.0, np.max(np.abs(state))):
            return state, period, phi
    raise RuntimeError("shooting did not converge")
