"""First guesses of limit cycles, and their solution by collocation in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from . import balance, condensation, verify
from .options import Fourier

COLLOCATION_SAMPLES = 1 << 15
MOST_NODES = 40000
# Last step of Newton's method, relative, at an equilibrium. Larger: cycles start beside it. Smaller: rounding.
AT_REST = 1e-10
PIECES = 16  # of the time in which a motion is to repeat itself
MESH = 2000  # nodes of a first mesh, about
# how often the equations are evaluated at most in search of a cycle by integration, a count: too large, the search takes minutes;
# too small, slow cycles are not found (tests/nonlinear/test_hbm_cycle.py)
MOST_EVALUATIONS = 150_000
# relative change of the amplitude between two stretches of time below which a motion may repeat itself, free of units: too large,
# searches for a period begin too early; too small, too late (tests/nonlinear/test_hbm_cycle.py)
SETTLED = 0.05
FIRST = Fourier(1, condense=False)  # one harmonic of all coordinates
AMPLITUDES = np.geomspace(1e-6, 1e6, 121)


@dataclass(frozen=True)
class Start:
    """A guess of a cycle: coefficients (n, 2 h + 1), rad/s, and its states ``path`` (2 n, m) at the fractions ``mesh`` (m,) of the
    period."""

    X: np.ndarray
    omega: float
    mesh: np.ndarray
    path: np.ndarray


def from_coefficients(X: np.ndarray, w: float) -> Start:
    """The guess that coefficients make, on an even mesh."""
    mesh = np.linspace(0, 1, MESH + 1)
    h = np.arange((X.shape[1] - 1) // 2 + 1)
    c = X[:, 0::2].astype(complex)
    c[:, 1:] = X[:, 1::2] - 1j * X[:, 2::2]
    turns = np.exp(2j * np.pi * np.outer(h, mesh))
    return Start(X, w, mesh, np.vstack([(c @ turns).real, ((1j * w * h * c) @ turns).real]))


def equilibrium(system: Any, force: Any) -> np.ndarray:
    """x of rest under the static forces, from the constant terms of harmonic balance."""
    setup = balance.prepare(system, force, FIRST)
    answer = balance.call_core(setup.core.solve, setup.start(None), [1.0], tolerance=AT_REST, max_iterations=50)
    return setup.expand(answer["y"], 1.0)[:, 0] if answer["converged"] else np.zeros(system.n)


def tangent(system: Any, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C, K with the slopes of the laws at rest in x, by differences (a start needs no more)."""
    M, C, K = (A.copy() for A in condensation.dense(system))
    for law in system.elements:
        u = float(law.w @ x)
        h = 1e-6 * max(1.0, abs(u))
        k = float(law.force(u + h, 0.0) - law.force(u - h, 0.0)) / (2 * h)
        c = 0.0 if law.has_memory else float(law.force(u, 1e-6) - law.force(u, -1e-6)) / 2e-6
        K += k * np.outer(law.w, law.w)
        C += c * np.outer(law.w, law.w)
    return M, C, K


def candidates(system: Any, force: Any, omega: float | None) -> Iterator[tuple[np.ndarray, float]]:
    """(X, omega) for every unstable mode of the equilibrium and every amplitude at which one harmonic balances its
    energy."""
    if system.n > 200:
        return
    rest = equilibrium(system, force)
    M, C, K = tangent(system, rest)
    n = system.n
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    s, shapes = np.linalg.eig(A)
    unstable = [i for i in np.argsort(-s.real) if s[i].real > 0 and s[i].imag >= 0]
    setup = balance.prepare(system, force, FIRST)
    for i in unstable:
        w = abs(s[i]) if omega is None else omega
        if w == 0:
            continue
        shape = shapes[:n, i] / shapes[np.argmax(np.abs(shapes[:n, i])), i]
        powers = [_power(setup, rest, a * shape, w) for a in AMPLITUDES]
        for a, p, b, q in zip(AMPLITUDES, powers, AMPLITUDES[1:], powers[1:], strict=False):
            if p < 0 <= q:
                amplitude = a + (b - a) * p / (p - q)
                yield _first_harmonic(rest, amplitude * shape), w


def _first_harmonic(rest: np.ndarray, c: np.ndarray) -> np.ndarray:
    return np.column_stack([rest, c.real, -c.imag])


def _power(setup: Any, rest: np.ndarray, c: np.ndarray, w: float) -> float:
    """Mean power that all forces take out of the motion rest + Re c exp(i w t), divided by |c|^2."""
    X = _first_harmonic(rest, c)
    R = setup.core.residual(setup.core.restrict(X), [w])["residual"].reshape(3, -1)
    force = R[1] - 1j * R[2]
    return float((np.conj(1j * w * c) @ force).real / 2 / np.sum(np.abs(c) ** 2))


def by_integration(system: Any, force: Any, cycles: int = 12) -> Start | None:
    """The periodic attractor reached from a perturbed equilibrium, or None."""
    from scipy.integrate import solve_ivp

    if any(law.has_memory for law in system.elements) or system.n > 200:
        return None
    rest = equilibrium(system, force)
    M, C, K = tangent(system, rest)
    n = system.n
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    s, shapes = np.linalg.eig(A)
    fastest = int(np.argmax(s.real))
    if s[fastest].real <= 0:
        return None
    rate = Bounded(verify.first_order(system, force, 1.0))
    scale = max(float(np.max(np.abs(rest))), 1.0)
    state = np.concatenate([rest, np.zeros(n)]) + 1e-2 * scale * shapes[:, fastest].real
    length = cycles * 2 * np.pi / max(abs(s[fastest]), 1e-12)
    size = np.zeros(2 * n)
    try:
        while True:  # a relaxation oscillation is much slower than the growth of its disturbance
            run = solve_ivp(rate, (0, length), state, method="LSODA", rtol=1e-7, atol=1e-9 * scale)
            if not run.success or not np.all(np.isfinite(run.y[:, -1])):
                return None
            state, before, size = run.y[:, -1], size, np.ptp(run.y, axis=1)
            if np.all(np.abs(size - before) <= SETTLED * size):
                found = _repeating(rate, state, length, n)
                if found is not None:
                    return found
            length *= 1.5
    except TooLong:
        return None


class TooLong(Exception):
    """The search has used up its evaluations."""


class Bounded:
    """A right-hand side that counts how often it is evaluated."""

    def __init__(self, rate: Any) -> None:
        self.rate, self.count = rate, 0

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        self.count += 1
        if self.count > MOST_EVALUATIONS:
            raise TooLong
        return np.asarray(self.rate(t, y))


def _repeating(rate: Any, state: np.ndarray, length: float, n: int) -> Start | None:
    from scipy.integrate import solve_ivp

    speed = rate(0.0, state)
    origin = state.copy()

    def section(t: float, y: np.ndarray) -> float:
        return float(speed @ (y - origin)) if t > 0 else 1.0

    section.direction = 1.0  # type: ignore[attr-defined]
    given = dict(method="LSODA", rtol=1e-9, atol=1e-11)
    largest = float(np.max(np.abs(state)))
    for piece in range(PIECES):
        span = (piece * length / PIECES, (piece + 1) * length / PIECES)
        part = solve_ivp(rate, span, state, events=section, **given)
        state, largest = part.y[:, -1], max(largest, float(np.max(np.abs(part.y))))
        for t, y in zip(part.t_events[0], part.y_events[0], strict=True):
            if t > 1e-9 * length and np.linalg.norm(y - origin) < 1e-3 * largest:
                run = solve_ivp(rate, (0, t), origin, dense_output=True, **given)
                samples = run.sol(np.linspace(0, t, 4096, endpoint=False))[:n]
                # the steps of the integration lie where the motion is fast
                steps = run.t[run.t < t]
                mesh = np.append(steps[:: max(1, len(steps) // MESH)], t)
                path = run.sol(mesh)
                path[:, -1] = path[:, 0]
                return Start(coefficients(samples, 255), 2 * np.pi / t, mesh / t, path)
    return None


def coefficients(samples: np.ndarray, top: int) -> np.ndarray:
    """Fourier coefficients (n, 2 top + 1) of equidistant samples (n, n_t) of one period."""
    c = np.fft.rfft(samples, axis=1) / samples.shape[1]
    out = np.zeros((len(samples), 2 * top + 1))
    out[:, 0] = c[:, 0].real
    out[:, 1::2], out[:, 2::2] = 2 * c[:, 1 : top + 1].real, -2 * c[:, 1 : top + 1].imag
    return out


def collocate(system: Any, force: Any, start: Start, top: int, limit: float) -> tuple[np.ndarray, float, float, int]:
    """X, period, estimated relative error and mesh size of the cycle near ``start``, by fourth-order collocation: at least
    ``top`` harmonics, and as many as leave less than a third of the error ``limit``."""
    from scipy.integrate import solve_bvp

    w, mesh, y = start.omega, start.mesh, start.path
    n = system.n
    rate = verify.first_order(system, force, 1.0)
    anchor, direction = y[:, 0].copy(), rate(0.0, y[:, 0])
    direction = direction / np.linalg.norm(direction)

    def fun(_: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        return p[0] * rate(0.0, y)

    def ends(a: np.ndarray, b: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.append(b - a, direction @ (a - anchor))

    phases = np.linspace(0, 1, COLLOCATION_SAMPLES, endpoint=False)
    with np.errstate(all="ignore"):  # trials may be anywhere
        solution = solve_bvp(fun, ends, mesh, y, p=[2 * np.pi / w], tol=1e-4, max_nodes=MOST_NODES)
    if not (solution.success and np.isfinite(solution.p[0]) and solution.p[0] > 0):
        raise ConvergenceError(
            f"collocation found no cycle near the guess: {solution.message}; give a nearer one with omega= and x0=",
            None,
        )
    error, samples, period = np.inf, solution.sol(phases)[:n], float(solution.p[0])
    for tolerance in (1e-6, 1e-7, 1e-8):
        with np.errstate(all="ignore"):
            finer = solve_bvp(fun, ends, solution.x, solution.y, p=solution.p, tol=tolerance, max_nodes=MOST_NODES)
        if not (solution.success and finer.success):
            break
        # the condition at t = 0 fixes the phase, so that the meshes can be compared at the same instants
        before, period_before, solution = samples, period, finer
        samples, period = finer.sol(phases)[:n], float(finer.p[0])
        error = abs(period - period_before) / period
        error += float(np.max(np.abs(samples - before)) / np.max(np.abs(samples)))
        if error <= limit / 2:
            break
    if not np.isfinite(error):
        return coefficients(samples, max(top, 255)), period, error, len(solution.x)
    every = coefficients(samples, COLLOCATION_SAMPLES // 4)
    amplitudes = np.hypot(every[:, 1::2], every[:, 2::2]) / np.max(np.abs(every))
    left_out = np.max(np.cumsum(amplitudes[:, ::-1], axis=1), axis=0)[::-1]  # [h]: what the harmonics beyond h hold
    enough = left_out <= limit / 3
    top = max(top, 1, int(np.argmax(enough)) if np.any(enough) else len(left_out) - 1)
    return every[:, : 2 * top + 1], period, error + float(left_out[min(top, len(left_out) - 1)]), len(solution.x)
