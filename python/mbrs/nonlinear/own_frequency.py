"""Tori with a frequency of their own, which no force gives: what begins at a Neimark-Sacker point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ConvergenceError, ModelError
from . import balance, condensation
from .branch_points import Event
from .options import Newton
from .quasi_periodic_solution import QuasiPeriodicSolution

if TYPE_CHECKING:
    from .torus import Torus

# Part of the motion that the terms of its own frequency make where a torus begins, the factor from one to the next, and so many of them.
# Larger, longer: Newton's method loses the tori. Smaller: they are lost in rounding, or evaluations for nothing. Fewer: tori far from the
# point are not found (tests/nonlinear/test_tori_beside_events.py).
BEGIN, FACTOR, MOST = 0.01, 1.3, 25
NEXT = 1.05  # the factor from a torus to its neighbours
# Newton steps at most, and the size of the last one over the motion. More, smaller: digits that a guess does not need.
STEPS, SOLVED = 12, 1e-8
# Levels that differ by less are one: the terms of the torus are not those of the event. Larger: forces near that of the event are taken
# for it. Smaller: slopes for nothing.
SAME_LEVEL = 1e-6
SECANTS = 4  # steps to the excitation that was asked for
# That part of a solution, over that of the guess it came from, below which it is the periodic motion. Larger: tori beside the point are
# thrown away. Smaller: rounding is called a torus.
NONE = 1e-4


def solved(problem: Torus, newton: Newton, x0: Any, started: float) -> QuasiPeriodicSolution:
    """The torus near a solution, or near the event at which it begins."""
    if x0 is None:
        raise ModelError(
            "a torus with a frequency of its own needs a start: x0= a Neimark-Sacker event of a curve, or a solution nearby"
        )
    if isinstance(x0, Event):
        found = _newton(problem, newton, *_from_event(problem, x0))
    else:
        y, w = problem.start(x0), _own_of(problem, x0)
        found = _newton(problem, newton, y, w)
        if not found["found"] and len(x0.omega) == 2:
            found = _newton(problem, newton, *_from_solution(problem, x0, y))
    if not found["found"]:
        raise ConvergenceError(f"no torus was found: {found['reason']}; start from one nearby (x0=)", None)
    return problem.solution(found, started, float(found["z"][-1]))


def _newton(problem: Torus, newton: Newton, y: np.ndarray, w: float) -> dict[str, Any]:
    """The core's answer at the excitation that was asked for, and whether it is a torus."""
    at = (problem.omega.tolist(), problem.free)
    answer = balance.call_core(problem.core.cycle, np.append(y, w), at, **newton.core)
    found = answer["z"][:-1]
    fell = _own_part(problem, found) <= NONE * _own_part(problem, y)
    if answer["converged"] and fell:
        answer["reason"] = "Newton's method fell back to the periodic motion"
    good = answer["converged"] and not fell and float(answer["z"][-1]) > 0.0
    return {**answer, "y": found, "factorisations": answer["iterations"], "found": good}


def _own_of(problem: Torus, x0: QuasiPeriodicSolution) -> float:
    own = x0.omega if len(x0.omega) == len(problem.omega) else problem.omega
    return float(own[problem.free])


def _from_solution(problem: Torus, x0: QuasiPeriodicSolution, y: np.ndarray) -> tuple[np.ndarray, float]:
    """The same torus, followed as it grows or shrinks."""
    way = _Way(problem, y, _own_of(problem, x0), float(x0.omega[1 - _free(problem)]))
    amplitude, reached = _own_part(problem, y), [0.0]
    for factor in (NEXT, 1.0 / NEXT):
        first = way.solved(way.grown(way.begin, factor), factor * amplitude)
        if first is not None and first[-1] > 0.0:
            return way.followed((amplitude, way.begin), (factor * amplitude, first), factor)
        reached += [] if first is None else [float(first[-1])]
    raise ConvergenceError(f"no torus was found: {way.words(reached)}; start from one nearby (x0=)", None)


def _from_event(problem: Torus, event: Event) -> tuple[np.ndarray, float]:
    """The torus that begins at an event, followed as it grows."""
    if event.second_frequency is None or len(problem.omega) != 2:
        raise ModelError(
            f"a torus begins at a Neimark-Sacker point, with one force and one own frequency; x0 is {event}"
        )
    way = _Way(problem, _embedded(problem, event), float(problem.omega[_free(problem)]), event.omega)
    amplitude = BEGIN * (_size(problem, way.begin[:-2]) or 1.0)
    z = way.begin.copy()
    z[:-2] += way.direction(amplitude)
    first = way.solved(z, amplitude)
    if first is None:
        raise ConvergenceError("no torus was found: none begins at this event with this frequency", None)
    return way.followed((0.0, way.begin), (amplitude, first), FACTOR)


def _free(problem: Torus) -> int:
    assert problem.free is not None
    return problem.free


def _embedded(problem: Torus, event: Event) -> np.ndarray:
    """The motion at an event, in the terms of a torus."""
    free = _free(problem)
    X = np.zeros((problem.system.n, 2 * len(problem.indices) + 1))
    X[:, 0] = event.X[:, 0]
    for j, k in enumerate(problem.indices.tolist()):
        h = k[1 - free]
        if k[free] == 0 and 2 * h < event.X.shape[1]:
            X[:, 2 * j + 1 : 2 * j + 3] = event.X[:, 2 * h - 1 : 2 * h + 1]
    T = problem.linear.transform
    return np.asarray(problem.core.restrict(X if T is None else T.T @ X))


class _Way:
    """Tori [y, own frequency, p] on the way from an excitation, p = 0, to the one that was asked for, p = 1."""

    def __init__(self, problem: Torus, y: np.ndarray, own: float, omega: float) -> None:
        self.problem, self.free, self.forced = problem, _free(problem), 1 - _free(problem)
        self.own = _own_terms(problem)
        self.omega = (omega, float(problem.omega[self.forced]))
        # the level at which the given forces make the motion at the beginning
        here = balance.call_core(problem.core.residual, y, self._frequencies(own, 0.0), 1.0, "level")
        force = here["slope"]
        strength = float(force @ force)
        level = 1.0 - float(here["residual"] @ force) / strength if strength > 0.0 else 1.0
        self.level = (1.0 if abs(level - 1.0) <= SAME_LEVEL else level, 1.0)
        self.begin = np.concatenate([y, [own, 0.0]])

    def followed(
        self, last: tuple[float, np.ndarray], now: tuple[float, np.ndarray], factor: float
    ) -> tuple[np.ndarray, float]:
        """Tori of amplitudes that grow by a factor, up to the excitation that was asked for."""
        reached = [float(last[1][-1])]
        for _ in range(MOST):
            reached.append(float(now[1][-1]))
            if (last[1][-1] - 1.0) * (now[1][-1] - 1.0) <= 0.0:
                return self.between(last, now)
            amplitude = factor * now[0]
            found = self.solved(self.grown(now[1], factor), amplitude)
            if found is None:
                break
            last, now = now, (amplitude, found)
        raise ConvergenceError(f"no torus was found: {self.words(reached)}; start from one nearby (x0=)", None)

    def direction(self, amplitude: float) -> np.ndarray:
        """The null vector of the terms of the own frequency, in a size; both of them are one direction at two phases."""
        jacobian = self.linear(self.begin)[1][np.ix_(self.own, np.append(self.own, [False, False]))]
        out = np.zeros(len(self.own))
        out[self.own] = np.linalg.svd(jacobian)[2][-1]
        return np.asarray(amplitude / _size(self.problem, out) * out)

    def _frequencies(self, own: float, p: float) -> list[float]:
        out = [own, own]
        out[self.forced] = (1.0 - p) * self.omega[0] + p * self.omega[1]
        return out

    def grown(self, z: np.ndarray, factor: float) -> np.ndarray:
        """The same with terms of the own frequency that are larger."""
        return np.concatenate([np.where(self.own, factor * z[:-2], z[:-2]), z[-2:]])

    def linear(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual, and derivatives by [y, own frequency, p]."""
        residual, y = self.problem.core.residual, z[:-2]
        at = self._frequencies(float(z[-2]), float(z[-1]))
        level = (1.0 - z[-1]) * self.level[0] + z[-1] * self.level[1]
        out = balance.call_core(residual, y, at, level, f"omega{self.free}")
        by_way = np.zeros(len(y))
        for (begin, end), name in ((self.omega, f"omega{self.forced}"), (self.level, "level")):
            if end != begin:
                by_way += (end - begin) * balance.call_core(residual, y, at, level, name)["slope"]
        return out["residual"], np.column_stack([out["jacobian"], out["slope"], by_way])

    def solved(self, z: np.ndarray, amplitude: float) -> np.ndarray | None:
        """The torus whose own terms have a size, at the phase of the guess; None without one."""
        weights = np.where(self.own, _weights(self.problem), 0.0)
        phase = _phase_rate(self.problem, z[:-2])
        z = z.copy()
        for _ in range(STEPS):
            if not (np.all(np.isfinite(z)) and z[-2] > 0.0):
                return None
            residual, by = self.linear(z)
            y = z[:-2]
            rows = np.zeros((2, len(z)))
            rows[0, :-2], rows[1, :-2] = phase, 2.0 * weights * y
            matrix = np.vstack([by, rows])
            rest = np.concatenate([residual, [phase @ y, weights @ y**2 - amplitude**2]])
            scale = np.abs(matrix).max(axis=1)
            if not (np.all(np.isfinite(matrix)) and np.all(scale > 0.0)):
                return None
            try:
                step = np.linalg.solve(matrix / scale[:, None], -rest / scale)
            except np.linalg.LinAlgError:
                return None
            z += step
            if _size(self.problem, step[:-2]) <= SOLVED * _size(self.problem, z[:-2]):
                return z
        return None

    def between(self, low: tuple[float, np.ndarray], high: tuple[float, np.ndarray]) -> tuple[np.ndarray, float]:
        """The torus at p = 1, by secants over the square of the amplitude."""
        best = high
        for _ in range(SECANTS):
            a, b = low[1][-1] - 1.0, high[1][-1] - 1.0
            if a == b:
                break
            amplitude = float(np.sqrt(max((low[0] ** 2 * b - high[0] ** 2 * a) / (b - a), 0.0)))
            found = self.solved(self.grown(best[1], amplitude / best[0]), amplitude) if amplitude > 0.0 else None
            if found is None:
                break
            best = (amplitude, found)
            if (found[-1] - 1.0) * a > 0.0:
                low = best
            else:
                high = best
        return best[1][:-2], float(best[1][-2])

    def words(self, reached: list[float]) -> str:
        """The extent of the tori that were found, for a message."""
        extent = f"from {min(reached):.3g} to {max(reached):.3g} of the way to the excitation that was asked for"
        return f"those that were followed lie {extent} (negative: on the other side)"


def _phase_rate(problem: Torus, y: np.ndarray) -> np.ndarray:
    """Derivative of y by the phase of the own frequency, of length one."""
    rows = y.reshape(-1, problem.linear.core.size)
    k = problem.indices[:, problem.free][:, None]
    out = np.zeros_like(rows)
    out[1::2], out[2::2] = k * rows[2::2], -k * rows[1::2]
    return np.asarray(out.ravel() / np.linalg.norm(out))


def _own_terms(problem: Torus) -> np.ndarray:
    """A flag of each unknown of the core: whether it belongs to a term that holds the own frequency."""
    holds = np.repeat(problem.indices[:, problem.free] != 0, 2)
    return np.repeat(np.append(False, holds), problem.linear.core.size)


def _own_part(problem: Torus, y: np.ndarray) -> float:
    return _size(problem, np.where(_own_terms(problem), y, 0.0))


def _size(problem: Torus, y: np.ndarray) -> float:
    """Size of what moves, coordinates measured by their masses."""
    moving = problem.linear.core.size
    return float(np.sqrt((_weights(problem) * y**2)[moving:].sum()))


def _weights(problem: Torus) -> np.ndarray:
    """Masses of the core's unknowns; one where they are turned coordinates."""
    terms = 2 * len(problem.indices) + 1
    if problem.linear.transform is not None:
        return np.ones(terms * problem.linear.core.size)
    mass = np.diag(condensation.dense(problem.system)[0])[list(problem.linear.core.retained)]
    return np.tile(mass, terms)
