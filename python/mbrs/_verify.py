"""Integration in time of a periodic solution, to see how far harmonic balance is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import _condensation
from .errors import ModelError


def distance(solution: Any, rtol: float) -> float:
    """Largest difference over one period between the solution and the motion from its state at t = 0, relative."""
    from scipy.integrate import solve_ivp

    system = solution.system
    if any(law.has_memory for law in system.elements):
        raise ModelError(
            "verify() cannot integrate laws with memory: their slider positions are not part of the result"
        )
    rate = first_order(system, solution.force, solution.omega)
    t = np.linspace(0, solution.period, 257)
    x, v = solution.displacement(t), solution.velocity(t)
    size = max(np.max(np.abs(x)), np.finfo(float).tiny)
    scale = np.concatenate([np.full(system.n, size), np.full(system.n, max(np.max(np.abs(v)), np.finfo(float).tiny))])
    start = np.concatenate([x[:, 0], v[:, 0]])
    motion = solve_ivp(rate, (0, t[-1]), start, method="DOP853", t_eval=t, rtol=rtol, atol=rtol * scale)
    if not motion.success:
        return float("inf")
    return float(np.max(np.abs(motion.y[: system.n] - x)) / size)


def distance_on_torus(solution: Any, cycles: float, rtol: float) -> float:
    """The same for a quasi-periodic solution, over a number of its longest base periods."""
    from scipy.integrate import solve_ivp

    system = solution.system
    free = first_order(system, {0: np.zeros(system.n)}, float(solution.omega[0]))
    inverse = np.linalg.inv(_condensation.dense(system)[0])
    static = np.zeros(system.n) if solution.static is None else np.asarray(solution.static, float)
    sources = [(np.asarray(f["force"], complex), w) for f, w in zip(solution.forces, solution.omega, strict=True)]

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        f = sum(((a * np.exp(1j * w * t)).real for a, w in sources), static)
        return free(t, y) + np.concatenate([np.zeros(system.n), inverse @ f])

    t = np.linspace(0, cycles * 2 * np.pi / np.min(solution.omega), 1000)
    x, v = solution.displacement(t), solution.velocity(t)
    tiny = np.finfo(float).tiny
    size, speed = max(float(np.max(np.abs(x))), tiny), max(float(np.max(np.abs(v))), tiny)
    scale = np.repeat([size, speed], system.n)
    start = np.concatenate([x[:, 0], v[:, 0]])
    motion = solve_ivp(rate, (0, t[-1]), start, method="DOP853", t_eval=t, rtol=rtol, atol=rtol * scale)
    return float(np.max(np.abs(motion.y[: system.n] - x)) / size) if motion.success else float("inf")


def first_order(system: Any, force: Any, omega: float) -> Any:
    """The right-hand side y' = f(t, y) with y = [x, x'], (2n,) or for constant forces (2n, m)."""
    M, C, K = _condensation.dense(system)
    n = system.n
    inverse = np.linalg.inv(M)
    given = dict(force) if isinstance(force, Mapping) else {1: force}
    terms = [(h, np.asarray(f, complex)) for h, f in given.items()]
    laws = system.elements

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        x, v = y[:n], y[n:]
        f = -K @ x - C @ v
        for h, amplitude in terms:
            part = (amplitude * np.exp(1j * h * omega * t)).real
            f = f + (part if y.ndim == 1 else part[:, None])
        for law in laws:
            u, du = law.w @ x, law.w @ v
            f = f - np.multiply.outer(law.w, _law_force(law, u, du, omega * t))
        return np.concatenate([v, inverse @ f])

    return rate


def _law_force(law: Any, u: Any, v: Any, phase: float) -> Any:
    if law.code == 11:
        k, order, start = law.numbers()
        return k * np.cos(order * phase + start) * u
    return law.force(u, v)
