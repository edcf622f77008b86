"""Integration in time of a periodic solution, to see how far harmonic balance is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import _condensation


def distance(solution: Any, rtol: float) -> float:
    """Largest difference over one period between the solution and the motion from its state at t = 0, relative."""
    from scipy.integrate import solve_ivp

    system = solution.system
    t = np.linspace(0, solution.period, 257)
    x, v = solution.displacement(t), solution.velocity(t)
    if any(law.has_memory for law in system.elements):
        return _distance_with_sliders(solution, t, x, v, rtol)
    rate = first_order(system, solution.force, solution.omega)
    size = max(np.max(np.abs(x)), np.finfo(float).tiny)
    scale = np.concatenate([np.full(system.n, size), np.full(system.n, max(np.max(np.abs(v)), np.finfo(float).tiny))])
    start = np.concatenate([x[:, 0], v[:, 0]])
    motion = solve_ivp(rate, (0, t[-1]), start, method="DOP853", t_eval=t, rtol=rtol, atol=rtol * scale)
    if not motion.success:
        return float("inf")
    return float(np.max(np.abs(motion.y[: system.n] - x)) / size)


class Sliders:
    """All sliders of a system: element ``w``, stiffness ``k`` and slip force ``f`` of each."""

    def __init__(self, laws: Any) -> None:
        pairs = [(law.w, law.numbers()) for law in laws if law.has_memory]
        self.w = np.array([w for w, numbers in pairs for _ in range(len(numbers) // 2)])
        self.k = np.array([k for _, numbers in pairs for k in numbers[0::2]])
        self.f = np.array([f for _, numbers in pairs for f in numbers[1::2]])

    def follow(self, x: np.ndarray) -> np.ndarray:
        """Places after the displacements x (dof, n_t), from the middle: they are dragged where the spring would exceed
        the slip force."""
        z = np.zeros(len(self.k))
        for u in (self.w @ x).T:
            reach = self.f / self.k
            z = np.clip(z, u - reach, u + reach)
        return z


def _distance_with_sliders(solution: Any, t: np.ndarray, x: np.ndarray, v: np.ndarray, rtol: float) -> float:
    """The sliders begin where two periods of the solution take them; slip holds at +-f until the motion turns."""
    from scipy.integrate import solve_ivp

    system = solution.system
    sliders = Sliders(system.elements)
    others = _Without(system, [law for law in system.elements if not law.has_memory])
    free = first_order(others, solution.force, solution.omega)
    inverse = np.linalg.inv(_condensation.dense(system)[0])
    n = system.n
    fine = solution.displacement(np.linspace(0, solution.period, 8193))
    z = sliders.follow(np.concatenate([fine, fine], axis=1))
    tiny = np.finfo(float).tiny
    size, speed = max(float(np.max(np.abs(x))), tiny), max(float(np.max(np.abs(v))), tiny)
    slip = _slips(sliders, z, x[:, 0], v[:, 0])
    state, now, worst = np.concatenate([x[:, 0], v[:, 0], z]), 0.0, 0.0
    scale = np.concatenate([np.repeat([size, speed], n), np.full(len(z), size)])

    while now < t[-1]:

        def rate(s: float, y: np.ndarray, slip: np.ndarray = slip) -> np.ndarray:
            u, du = sliders.w @ y[:n], sliders.w @ y[n : 2 * n]
            force = np.where(slip, np.sign(u - y[2 * n :]) * sliders.f, sliders.k * (u - y[2 * n :]))
            out = free(s, y[: 2 * n])
            out[n:] -= inverse @ (sliders.w.T @ force)
            return np.concatenate([out, np.where(slip, du, 0.0)])

        def margin(y: np.ndarray, slip: np.ndarray = slip) -> np.ndarray:
            u, du = sliders.w @ y[:n], sliders.w @ y[n : 2 * n]
            spring = sliders.k * (u - y[2 * n :])
            return np.where(slip, du * np.sign(spring) / speed, 1.0 - np.abs(spring) / sliders.f)

        switches = [_Switch(margin, i) for i in range(len(z))]
        after = t[t > now]
        run = solve_ivp(rate, (now, t[-1]), state, method="DOP853", t_eval=after, rtol=rtol, atol=rtol * scale,
                        events=switches)  # fmt: skip
        if run.status < 0:
            return float("inf")
        if len(run.t):
            there = np.searchsorted(t, run.t)
            worst = max(worst, float(np.max(np.abs(run.y[:n] - x[:, there]))))
        if run.status == 0:
            break
        met = np.array([len(times) > 0 for times in run.t_events])
        state, arrived = run.y_events[int(np.argmax(met))][0], float(run.t_events[int(np.argmax(met))][0])
        now = arrived if arrived > now else np.nextafter(now, np.inf)
        # sliders that move alike switch together, up to the last digits
        left, driven = margin(state), _slips(sliders, state[2 * n :], state[:n], state[n : 2 * n])
        slip = slip ^ (met | (slip & (left <= 1e-13)) | (~slip & (left <= 0.0) & driven))
    return worst / size


def _slips(sliders: Sliders, z: np.ndarray, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Which sliders are at their limit and driven further."""
    spring = sliders.k * (sliders.w @ x - z)
    return (np.abs(spring) >= sliders.f * (1 - 1e-9)) & (spring * (sliders.w @ v) > 0)


class _Switch:
    """An event for SciPy's integrator: the margin of one slider passes zero."""

    terminal, direction = True, -1.0

    def __init__(self, margin: Any, i: int) -> None:
        self.margin, self.i = margin, i

    def __call__(self, t: float, y: np.ndarray) -> float:
        return float(self.margin(y)[self.i])


class _Without:
    """A system with fewer elements."""

    def __init__(self, system: Any, elements: list[Any]) -> None:
        self.M, self.C, self.K, self.n = system.M, system.C, system.K, system.n
        self.G, self.N = getattr(system, "G", None), getattr(system, "N", None)
        self.elements = elements


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
