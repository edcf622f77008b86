"""Integration in time of a periodic solution, to see how far harmonic balance is off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._lib import checks
from ..errors import ModelError
from . import condensation, midpoint
from .verify_full import Distance, distances

LARGEST_EXPLICIT = 60
HALVINGS = 7
INSTANTS = 256
# Change by a halving of the step over the distance, up to which the distance is known; and what rounding leaves of a distance, over the
# size of the motion. Larger: the error of the integration is called a distance. Smaller: halvings for nothing.
KNOWN, ROUNDING = 0.02, 1e-11


def verify(solution: Any, rtol: float, full: bool | None) -> Distance:
    """Distances of a periodic solution over one period."""
    rtol, full = _checked(rtol, full)
    terms = [(h * solution.omega, f) for h, f in _terms(solution.force)]
    return distances(distance(solution, rtol), solution, terms, solution.period, rtol, full)


def verify_torus(solution: Any, cycles: float, rtol: float, full: bool | None) -> Distance:
    """The same of a quasi-periodic solution, over a number of its longest base periods."""
    rtol, full = _checked(rtol, full)
    terms = [(float(w), f["force"]) for f, w in zip(solution.forces, solution.omega, strict=True)]
    if solution.static is not None:
        terms.append((0.0, solution.static))
    length = checks.positive("cycles", cycles) * 2 * np.pi / float(np.min(solution.omega))
    return distances(distance_on_torus(solution, cycles, rtol), solution, terms, length, rtol, full)


def _checked(rtol: Any, full: Any) -> tuple[float, bool | None]:
    if checks.positive("rtol", rtol) > 0.1:
        raise ModelError(f"rtol = {rtol} is of the integration in time; it must be below 0.1")
    return float(rtol), None if full is None else checks.flag("full", full)


def distance(solution: Any, rtol: float) -> float:
    """Largest difference over one period between the solution and the motion from its state at t = 0, relative."""
    from scipy.integrate import solve_ivp

    system = solution.system
    if system.n > LARGEST_EXPLICIT or any(law.has_memory for law in system.elements):
        load = load_of(system, [(h, h * solution.omega, f) for h, f in _terms(solution.force)])
        histories = _histories(solution, solution.period)
        return _by_midpoint(solution, load, float(solution.omega), solution.period, 1, histories)
    rate = first_order(system, solution.force, solution.omega)
    t = np.linspace(0, solution.period, INSTANTS + 1)
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
    length = cycles * 2 * np.pi / np.min(solution.omega)
    if system.n > LARGEST_EXPLICIT:
        terms = [(1, w, np.asarray(f["force"], complex)) for f, w in zip(solution.forces, solution.omega, strict=True)]
        load = load_of(system, terms, solution.static)
        turns = int(np.ceil(cycles * np.max(solution.omega) / np.min(solution.omega)))
        return _by_midpoint(
            solution, load, float(solution.omega[0]), length, turns, [np.zeros(0)] * len(system.elements)
        )
    free = first_order(system, {0: np.zeros(system.n)}, float(solution.omega[0]))
    inverse = np.linalg.inv(condensation.dense(system)[0])
    static = np.zeros(system.n) if solution.static is None else np.asarray(solution.static, float)
    sources = [(np.asarray(f["force"], complex), w) for f, w in zip(solution.forces, solution.omega, strict=True)]

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        f = sum(((a * np.exp(1j * w * t)).real for a, w in sources), static)
        return free(t, y) + np.concatenate([np.zeros(system.n), inverse @ f])

    t = np.linspace(0, length, 1000)
    x, v = solution.displacement(t), solution.velocity(t)
    tiny = np.finfo(float).tiny
    size, speed = max(float(np.max(np.abs(x))), tiny), max(float(np.max(np.abs(v))), tiny)
    scale = np.repeat([size, speed], system.n)
    start = np.concatenate([x[:, 0], v[:, 0]])
    motion = solve_ivp(rate, (0, t[-1]), start, method="DOP853", t_eval=t, rtol=rtol, atol=rtol * scale)
    return float(np.max(np.abs(motion.y[: system.n] - x)) / size) if motion.success else float("inf")


def _terms(force: Any) -> list[tuple[int, np.ndarray]]:
    given = dict(force) if isinstance(force, Mapping) else {1: force}
    return [(h, np.asarray(f, complex)) for h, f in given.items()]


def load_of(system: Any, terms: list[tuple[int, float, np.ndarray]], static: Any = None) -> Any:
    """f(t) = static + sum of Re a exp(i w t) for terms (h, w, a); h = 0 is static too."""
    constant = np.zeros(system.n) if static is None else np.asarray(static, float)
    constant = constant + sum((a.real for h, _, a in terms if h == 0), np.zeros(system.n))
    moving = [(w, a) for h, w, a in terms if h != 0 and np.any(a != 0)]
    return lambda t: sum(((a * np.exp(1j * w * t)).real for w, a in moving), constant)


def _histories(solution: Any, period: float) -> list[np.ndarray]:
    """Displacements of the elements over the period before t = 0, for those that remember them."""
    laws = solution.system.elements
    if not any(law.has_memory for law in laws):
        return [np.zeros(0)] * len(laws)
    for i, law in enumerate(laws):
        if law.kind.state == "rate":
            raise ModelError(
                f"elements[{i}], {law!r}: verify() has no state of this law at the start; compare with mb.simulate of the model over "
                "so many periods that its start is forgotten"
            )
    x = solution.displacement(np.linspace(-period, 0, 4097))
    return [law.w @ x if law.has_memory else np.zeros(0) for law in laws]


def _by_midpoint(
    solution: Any, load: Any, omega: float, length: float, turns: int, histories: list[np.ndarray]
) -> float:
    """The distance by the midpoint rule, its step halved (and extrapolated where the laws are smooth) until a distance is
    known to two digits."""
    system = solution.system
    t = np.linspace(0, length, INSTANTS + 1)
    x = solution.displacement(t)
    v = solution.velocity(np.zeros(1))[:, 0]
    size = max(float(np.max(np.abs(x))), np.finfo(float).tiny)
    smooth = midpoint.is_smooth(system.elements)
    row: list[np.ndarray] = []
    for level in range(HALVINGS):
        steps = INSTANTS * turns << level
        y = midpoint.integrate(system, load, omega, (x[:, 0], v), (length, steps), histories, steps // INSTANTS)
        if not np.all(np.isfinite(y)):
            return float("inf")
        before, row = row, [y]
        for order, coarse in enumerate(before if smooth else before[:0]):
            row.append(row[-1] + (row[-1] - coarse) / (4.0 ** (order + 1) - 1))
        off = float(np.max(np.abs(row[-1] - x)))
        change = float(np.max(np.abs(row[-1] - before[-1]))) if before else np.inf
        if change <= KNOWN * off + ROUNDING * size:
            break
    return max(off, change if np.isfinite(change) else 0.0) / size


def first_order(system: Any, force: Any, omega: float) -> Any:
    """The right-hand side y' = f(t, y) with y = [x, x'], (2n,) or for constant forces (2n, m)."""
    M, C, K = condensation.dense(system)
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
            f = f - _pushed(law.w, _law_force(law, u, du, omega * t))
        return np.concatenate([v, inverse @ f])

    return rate


def _pushed(w: np.ndarray, f: Any) -> np.ndarray:
    """Forces on the coordinates of x, (n,) or (n, m), of those along w."""
    return np.asarray(np.multiply.outer(w, f) if w.ndim == 1 else np.tensordot(w, f, axes=(0, 0)))


def _law_force(law: Any, u: Any, v: Any, phase: float) -> Any:
    if law.kind.phase:
        k, order, start = law.numbers()
        return k * np.cos(order * phase + start) * u
    return law.force(u, v)
