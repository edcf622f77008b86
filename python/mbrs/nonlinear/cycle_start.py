"""First guesses of limit cycles, and their solution by collocation in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from . import balance, condensation, growing_mode, verify
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
# Part by which laws change the forces of a mode, or the power that feeds it, from the amplitude on at which they are felt. Larger: cycles
# of laws that bend early are passed over. Smaller: rounding of the forces is felt.
FELT = 0.01
# Rounding of that power, over that of the springs. Larger: weak laws are not felt. Smaller: rounding is.
NOISE = 1e-12
# Range of amplitudes in which laws are felt, from here to one over it; and the smallest over the displacement of rest. Larger: laws that
# bend early are not seen to. Smaller: squares of amplitudes are lost, or what moves is rounding of what rests.
SMALLEST, SMALL_BESIDE_REST = 1e-100, 1e-6
# Amplitudes at which power is balanced, over the one at which laws are felt. Further up: searches for nothing. Less: cycles of
# friction that is regularised far below the speed of the motion are not found.
AMPLITUDES = np.geomspace(1e-1, 1e11, 121)
# Relative and absolute accuracy of the motion that is to settle, and of the one that is to repeat itself, over the size of each coordinate.
# Larger: neighbours of the cycle are taken for it. Smaller: evaluations for nothing, as collocation or balance follows.
SETTLING, REPEATING = (1e-7, 1e-9), (1e-9, 1e-11)
# Distance over the size of the motion at which it has come back. Larger: a loop of a motion of several is taken for all. Smaller: motions
# that still settle are not seen to repeat themselves.
BACK = 1e-3
# Coordinates that move less than this part of what the energy of the motion could give them count as if they moved so much: rounding.
# Larger: small coordinates are not compared. Smaller: rounding never repeats itself.
AT_LEAST = 1e-6
# Tolerance of the first mesh of collocation, and of those that refine it until the error is small enough. Larger: the error is taken of a
# mesh that is too coarse. Smaller: nodes for nothing.
FIRST_MESH, FINER_MESHES = 1e-4, (1e-6, 1e-7, 1e-8)


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


def equilibrium(setup: Any, n: int) -> np.ndarray:
    """x (n,) of rest under the static forces, from the constant terms of harmonic balance."""
    answer = balance.call_core(setup.core.solve, setup.start(None), [1.0], tolerance=AT_REST, max_iterations=50)
    return setup.expand(answer["y"], 1.0)[:, 0] if answer["converged"] else np.zeros(n)


def tangent(system: Any, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C, K with the slopes of the laws at rest in x; those of laws with memory by the rate are left out."""
    M, C, K = (A.copy() for A in condensation.dense(system))
    core = balance.core_elements(system.elements, [w for law in system.elements for w in law.directions])
    for i, law in enumerate(system.elements):
        W = law.directions
        _, k, c = (np.array(a) for a in core.slopes(i, 0.0, W @ x, np.zeros(len(W))))
        K += W.T @ k.reshape(len(W), -1) @ W
        C += 0.0 if law.has_memory else W.T @ c.reshape(len(W), -1) @ W
    return M, C, K


class Modes:
    """The modes about rest, and what amplitudes of one of them do; an amplitude is the root of c^H M c."""

    def __init__(self, system: Any, force: Any) -> None:
        n = system.n
        setup = balance.prepare(system, force, FIRST)
        self.core, self.rest = setup.core, equilibrium(setup, n)
        self.M, C, K = tangent(system, self.rest)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(self.M, K), -np.linalg.solve(self.M, C)]])
        self.s, shapes = np.linalg.eig(A)
        self.shapes = shapes[:n] / np.sqrt([np.vdot(c, self.M @ c).real for c in shapes[:n].T])

    def unstable(self) -> list[int]:
        """Indices of the modes that grow, the fastest first."""
        return [i for i in np.argsort(-self.s.real) if self.s[i].real > 0 and self.s[i].imag >= 0]

    def forces(self, c: np.ndarray, w: float) -> np.ndarray:
        """First coefficient of all forces in the motion rest + Re c exp(i w t)."""
        X = _first_harmonic(self.rest, c)
        with np.errstate(all="ignore"):  # amplitudes may be anywhere
            R = self.core.residual(self.core.restrict(X), [w])["residual"].reshape(3, -1)
        return np.asarray(R[1] - 1j * R[2])

    def power(self, c: np.ndarray, w: float) -> float:
        """Mean power that all forces take out of the motion rest + Re c exp(i w t), divided by c^H M c."""
        return float((np.conj(1j * w * c) @ self.forces(c, w)).real / 2 / np.vdot(c, self.M @ c).real)

    def felt(self, c: np.ndarray, w: float) -> float | None:
        """The amplitude along c from which on laws are felt, or None."""
        low, high = max(SMALLEST, SMALL_BESIDE_REST * np.sqrt(self.rest @ self.M @ self.rest)), 1.0 / SMALLEST
        linear = self.forces(low * c, w) / low
        fed = abs((np.conj(1j * w * c) @ linear).real) / 2

        def bends(a: float) -> bool:
            change = self.forces(a * c, w) / a - linear
            size = np.sqrt(abs(np.vdot(change, np.linalg.solve(self.M, change))))
            power = abs((np.conj(1j * w * c) @ change).real) / 2
            return not (size <= FELT * w**2 and power <= FELT * fed + NOISE * w**3)

        if not bends(high):
            return None
        while high > (1.0 + FELT) * low:
            middle = np.sqrt(low) * np.sqrt(high)
            low, high = (low, middle) if bends(middle) else (middle, high)
        return float(high)


def candidates(system: Any, force: Any, omega: float | None) -> Iterator[tuple[np.ndarray, float]]:
    """(X, omega) for every unstable mode of the equilibrium and every amplitude at which one harmonic balances its
    energy."""
    from scipy.optimize import brentq

    if system.n > 200:
        return
    modes = Modes(system, force)

    def power(x: float, shape: np.ndarray, w: float) -> float:
        return modes.power(np.exp(x) * shape, w)

    for i in modes.unstable():
        w = abs(modes.s[i]) if omega is None else omega
        shape = modes.shapes[:, i]
        start = modes.felt(shape, w)
        if start is None:
            continue
        logarithms = np.log(start * AMPLITUDES)
        powers = [power(x, shape, w) for x in logarithms]
        for a, p, b, q in zip(logarithms, powers, logarithms[1:], powers[1:], strict=False):
            if p < 0 <= q:
                yield _first_harmonic(modes.rest, np.exp(brentq(power, a, b, args=(shape, w))) * shape), w
        # laws that take no power from the mode as it is bend its shape until it gets none
        for c, own in growing_mode.balanced(modes, i, start):
            yield _first_harmonic(modes.rest, c), own if omega is None else omega


def _first_harmonic(rest: np.ndarray, c: np.ndarray) -> np.ndarray:
    return np.column_stack([rest, c.real, -c.imag])


def by_integration(system: Any, force: Any, cycles: int = 12) -> Start | None:
    """The periodic attractor reached from a perturbed equilibrium, or None."""
    from scipy.integrate import solve_ivp

    if any(law.has_memory for law in system.elements) or system.n > 200:
        return None
    modes = Modes(system, force)
    fastest = int(np.argmax(modes.s.real))
    s, c = modes.s[fastest], modes.shapes[:, fastest]
    amplitude = modes.felt(c, abs(s)) if s.real > 0 else None
    if amplitude is None:
        return None
    rate = Bounded(verify.first_order(system, force, 1.0))
    state = np.concatenate([modes.rest, np.zeros(system.n)]) + amplitude * np.concatenate([c, s * c]).real
    natural = per_energy(modes.M, abs(s))
    length, size = cycles * 2 * np.pi / abs(s), amplitude * natural
    try:
        while True:  # a relaxation oscillation is much slower than the growth of its disturbance
            rtol, atol = SETTLING
            run = solve_ivp(rate, (0, length), state, method="LSODA", rtol=rtol, atol=atol * size)
            if not run.success or not np.all(np.isfinite(run.y[:, -1])):
                return None
            state, before, size = run.y[:, -1], size, sizes(run.y, natural)
            if np.all(np.abs(size - before) <= SETTLED * size):
                found = _repeating(rate, state, length, size)
                if found is not None:
                    return found
            length *= 1.5
    except TooLong:
        return None


def per_energy(M: np.ndarray, w: float) -> np.ndarray:
    """Displacements and rates (2 n,) of coordinates that hold alone, and at the rate ``w``, what an amplitude of one holds."""
    displacement = 1.0 / np.sqrt(np.diag(M))
    return np.concatenate([displacement, w * displacement])


def sizes(path: np.ndarray, natural: np.ndarray) -> np.ndarray:
    """Amplitudes of the rows of a path (2 n, m), at least a small part of the largest, compared by ``natural`` (2 n,)."""
    moved = 0.5 * np.ptp(path, axis=1)
    return np.maximum(moved, AT_LEAST * np.max(moved / natural) * natural)


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


def _repeating(rate: Any, state: np.ndarray, length: float, size: np.ndarray) -> Start | None:
    """A period of the motion from ``state`` within ``length``, whose coordinates and rates move by ``size`` (2 n,)."""
    from scipy.integrate import solve_ivp

    n = len(state) // 2
    speed = rate(0.0, state) / size
    origin = state.copy()

    def section(t: float, y: np.ndarray) -> float:
        return float(speed @ ((y - origin) / size)) if t > 0 else float(speed @ speed)

    section.direction = 1.0  # type: ignore[attr-defined]
    given = dict(method="LSODA", rtol=REPEATING[0], atol=REPEATING[1] * size)
    for piece in range(PIECES):
        span = (piece * length / PIECES, (piece + 1) * length / PIECES)
        part = solve_ivp(rate, span, state, events=section, **given)
        state = part.y[:, -1]
        for t, y in zip(part.t_events[0], part.y_events[0], strict=True):
            if t > 0 and np.linalg.norm((y - origin) / size) < BACK:
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

    n, w = system.n, start.omega
    rate = verify.first_order(system, force, 1.0)
    # all is solved in these sizes, as SciPy measures errors over one and more
    size = sizes(start.path, per_energy(condensation.dense(system)[0], w))[:, None]
    y = start.path / size
    anchor, direction = y[:, 0].copy(), rate(0.0, start.path[:, 0]) / size[:, 0]
    direction = direction / np.linalg.norm(direction)

    def fun(_: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.asarray(p[0] * rate(0.0, size * y) / size)

    def ends(a: np.ndarray, b: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.append(b - a, direction @ (a - anchor))

    phases = np.linspace(0, 1, COLLOCATION_SAMPLES, endpoint=False)
    with np.errstate(all="ignore"):  # trials may be anywhere
        solution = solve_bvp(fun, ends, start.mesh, y, p=[2 * np.pi / w], tol=FIRST_MESH, max_nodes=MOST_NODES)
    if not (solution.success and np.isfinite(solution.p[0]) and solution.p[0] > 0):
        raise ConvergenceError(
            f"collocation found no cycle near the guess: {solution.message}; give a nearer one with omega= and x0=",
            None,
        )
    error, samples, period = np.inf, solution.sol(phases)[:n], float(solution.p[0])
    for tolerance in FINER_MESHES:
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
        return size[:n] * coefficients(samples, max(top, 255)), period, error, len(solution.x)
    every = coefficients(samples, COLLOCATION_SAMPLES // 4)
    amplitudes = np.hypot(every[:, 1::2], every[:, 2::2]) / np.max(np.abs(every))
    left_out = np.max(np.cumsum(amplitudes[:, ::-1], axis=1), axis=0)[::-1]  # [h]: what the harmonics beyond h hold
    enough = left_out <= limit / 3
    top = max(top, 1, int(np.argmax(enough)) if np.any(enough) else len(left_out) - 1)
    X = size[:n] * every[:, : 2 * top + 1]
    return X, period, error + float(left_out[min(top, len(left_out) - 1)]), len(solution.x)
