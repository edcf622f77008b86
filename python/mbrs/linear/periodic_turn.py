"""Rotors whose linearisation changes over a turn: the motion that repeats itself, and matrices averaged over it in multiblade axes.

In the axes z of a steady motion, y = T(t) z with T = exp(W t), M, D and S of a rotor in sheared or slanting wind, or under weight across
its axis, have the period of the turn. Their means make an ordinary linear system (`floquet` knows what they leave out).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._lib.border import core_errors
from .._lib.rotations import skew
from ..errors import ConvergenceError, ModelError
from ..model.schema import LAW_OF_CODE
from ..system.air_flow import require_covered_at
from ..system.snapshot import Snapshot
from ..system.state import Orbit, State
from .air_states import air_matrices, blade_generator, has_air_states
from .blades import blade_transformations
from .floquet import Lags, Periodic, interpolation
from .spin import Spin
from .turning_frames import STILL_AIR, connected, expm, sampled

_MAX_ITERATIONS = 40
# Natural size (rad, characteristic lengths) of the largest change of a pose by one iteration.
_LONGEST = 0.3
# Change of a pose (rad, characteristic lengths) that is rounding, and singular values over the largest below which a Jacobian that
# cannot be factored has no rank. Larger: motions keep the error of the last step, soft poses stay; smaller: rounding goes on moving.
_ROUNDED, _NO_RANK = 1e-13, 1e-12
# Force that is not in balance, over the forces at work, at the azimuths, and between them, up to which a periodic motion, or a steady one,
# is called "converged". Larger: motions that too few azimuths cut count as found. Smaller: rounding of stiff parts, and corners of polars,
# refuse them. Pinned by tests/linear/test_modes_over_a_turn.py.
BALANCED, RESOLVED = 1e-9, 1e-3


def slopes(n: int, period: float) -> np.ndarray:
    """(n, n) derivatives of what is sampled n times in a period, n odd."""
    i = np.arange(n)
    k = i[:, None] - i
    with np.errstate(divide="ignore"):
        made = 0.5 * (-1.0) ** k / np.sin(np.pi * k / n)
    made[i, i] = 0.0
    return np.asarray(made * 2 * np.pi / period)


class PeriodicTurn:
    """A model that is driven at constant speed, its axes, and the periodic motion about the drawn places that turn."""

    def __init__(
        self, snapshot: Snapshot, spin: Spin, begin: State, driven: Sequence[str], without: tuple[str, ...], n: int
    ) -> None:
        self.snapshot, self.spin, self.begin, self.without, self.n = snapshot, spin, begin, without, n
        _check(snapshot)
        base = replace(begin, rate=spin.rate, kind="steady")
        turn = sampled(snapshot, spin, base, (*without, *STILL_AIR))
        T = blade_transformations(turn)
        W = None if T is None else turn.generator(T)
        if W is None or turn.axis is None:
            raise ModelError(
                f"average= belongs to rotors of three or more equal, evenly spaced blades, and {snapshot.model.name!r} has none; follow "
                "its motion in time (mb.simulate)"
            )
        self.W, self.names = np.asarray(W), turn.names
        self.period = 2.0 * np.pi / float(np.linalg.norm(turn.axis))
        self.still = np.array([name not in driven for name in self.names], dtype=bool)
        self.triples = _rotations(snapshot, self.names)
        self.lagging = has_air_states(snapshot.model, without)

    def states(self, z: np.ndarray, dz: np.ndarray, ddz: np.ndarray, t: np.ndarray) -> list[State]:
        """States of the motion z(t) with its rates."""
        return [self._state(a, b, c, float(now)) for a, b, c, now in zip(z, dz, ddz, t, strict=True)]

    def _state(self, z: np.ndarray, dz: np.ndarray, ddz: np.ndarray, t: float) -> State:
        T, W = expm(self.W * t), self.W
        y, v, a = T @ z, T @ (dz + W @ z), T @ (ddz + 2.0 * W @ dz + W @ W @ z)
        for own in self.triples:
            v[own], a[own] = _turning(y[own], v[own], a[own])
        step, rate = self.spin.later(self.spin.rate, t)
        with core_errors():
            q = self.snapshot.system.advance(self.begin.q, step + y, [*self.without, *STILL_AIR])
        return State(q, rate + v, "steady", acceleration=a, t=0.0)

    def linearized(self, state: State, air: dict[str, Any]) -> dict[str, Any]:
        """M, D, S and the residual, with the air's states held where it has some."""
        return _linearized(self.snapshot, state, self.without, air.get("value", np.zeros(0)))

    def air(self, states: Sequence[State], held: np.ndarray | None) -> list[dict[str, Any]]:
        """Matrices of the air's states along a motion; empty without any."""
        if not self.lagging:
            return [{} for _ in states]
        rows: Sequence[np.ndarray | None] = [None] * len(states) if held is None else list(held)
        return [air_matrices(self.snapshot, state, self.without, row) for state, row in zip(states, rows, strict=True)]

    def memory(self, orbit: Orbit) -> np.ndarray:
        """Memory of a motion from the beginning of the orbit: the states of the air; empty without any."""
        if not orbit.states.size:
            return np.zeros(0)
        begin = State(orbit.q[0], orbit.rate[0], "steady", acceleration=orbit.acceleration[0])
        return np.asarray(air_matrices(self.snapshot, begin, self.without, orbit.states[0])["memory"])

    def solve(self) -> tuple[Orbit, np.ndarray, float, float, int, dict[str, int]]:
        """The orbit, the mean residual (dof,), the largest residuals at the azimuths and between them over the forces at work, the number
        of iterations and the counts of work.
        """
        n, dof, still = self.n, len(self.names), self.still
        t, d = self.period * np.arange(n) / n, slopes(n, self.period)
        z = np.zeros((n, dof))
        held: np.ndarray | None = None
        best: tuple[float, Any] = (np.inf, None)
        for iteration in range(_MAX_ITERATIONS):
            states = self.states(z, d @ z, d @ (d @ z), t)
            air = self.air(states, held)
            found = [self.linearized(state, own) for state, own in zip(states, air, strict=True)]
            lag = _Lag.of(air, found, d)
            unit = 1.0 / np.max([r["reach"] for r in found], axis=0)[still]
            unit[~np.isfinite(unit)] = 1.0
            forces = np.max([r["force_sizes"] for r in found], axis=0)[still]
            T = [expm(self.W * now) for now in t]
            residual = np.stack([Tk.T @ r["residual"] for Tk, r in zip(T, found, strict=True)])
            size = float(
                np.max(np.abs(residual[:, still] * unit) / np.maximum(forces, np.finfo(float).tiny), initial=0.0)
            )
            size = max(size, lag.size)
            if size < best[0]:
                best = (size, (z, states, lag.value, residual, found[0]["counts"], iteration))
            elif best[0] <= BALANCED:
                break
            step, change = self._step(found, T, d, residual, unit, lag)
            natural = float(np.max(np.abs(step), initial=0.0))
            part = min(1.0, _LONGEST / max(natural, 1e-300))
            z = z.copy()
            z[:, still] += unit * step * part
            held = lag.value + change * part if self.lagging else None
            if size <= _ROUNDED:
                break
        size, kept = best
        if kept is None or not size <= np.sqrt(BALANCED):
            raise ConvergenceError(
                f"no motion of {self.snapshot.model.name!r} that repeats itself with the turn was found within {_MAX_ITERATIONS} "
                "iterations; follow its motion in time (mb.simulate)"
            )
        z, states, held, residual, counts, iterations = kept
        for state in states:
            require_covered_at(self.snapshot, state, self.without)
        later, held_later, missed = self._between(z, held, d, unit / np.maximum(forces, np.finfo(float).tiny))
        all_states = [state for pair in zip(states, later, strict=True) for state in pair]
        q, rate, acceleration = (np.stack([getattr(s, a) for s in all_states]) for a in ("q", "rate", "acceleration"))
        both = np.stack([held, held_later], axis=1).reshape(2 * n, -1)
        orbit = Orbit(self.period, q, rate, acceleration, self.W, both)
        return orbit, residual.mean(axis=0), size, missed, iterations, counts

    def _step(
        self,
        found: Sequence[dict[str, Any]],
        T: Sequence[np.ndarray],
        d: np.ndarray,
        residual: np.ndarray,
        unit: np.ndarray,
        lag: _Lag,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Newton's step for all azimuths at once, in natural units (n, still), and that of the states (n, m), which are eliminated."""
        n, at = self.n, np.flatnonzero(self.still)
        made = periodic(found, T, self.W, self.period).kept(at)
        dd, scale = d @ d, unit[None, :] * unit[:, None]
        J = np.einsum("kij,kl->kilj", made.M * scale, dd) + np.einsum("kij,kl->kilj", made.D * scale, d)
        J[np.arange(n), :, np.arange(n), :] += made.S * scale
        J = J.reshape(n * len(at), -1)
        right = -(residual[:, self.still] * unit).ravel()
        alone, along, effect = lag.eliminated(T, self.W, d, at, unit)
        J -= np.einsum("kim,kmj->kij", effect, along).reshape(J.shape)
        right += np.einsum("kim,km->ki", effect, alone).ravel()
        try:
            step = np.linalg.solve(J, right)
        except np.linalg.LinAlgError:
            step = np.linalg.lstsq(J, right, rcond=_NO_RANK)[0]
        return np.asarray(step.reshape(n, -1)), alone + along @ step

    def _between(
        self, z: np.ndarray, held: np.ndarray, d: np.ndarray, unit: np.ndarray
    ) -> tuple[list[State], np.ndarray, float]:
        """The motion half-way behind the azimuths, the states of the air there, and the largest force that is not in balance, over the
        forces at work.
        """
        t = self.period * (np.arange(self.n) + 0.5) / self.n
        weight = interpolation(self.n, t / self.period)
        states, later = self.states(weight @ z, weight @ (d @ z), weight @ (d @ (d @ z)), t), weight @ held
        air = self.air(states, later)
        found = [self.linearized(state, own) for state, own in zip(states, air, strict=True)]
        rows = [expm(self.W * now).T @ r["residual"] for r, now in zip(found, t, strict=True)]
        missed = float(np.max(np.abs(np.stack(rows)[:, self.still] * unit), initial=0.0))
        return states, later, max(missed, _Lag.of(air, found, d, weight @ (d @ held)).size)


@dataclass(frozen=True, eq=False)
class _Lag:
    """The air's states (n, m) along a motion, their equations a' - rate = 0, and the largest force of what these leave, over the forces at
    work.
    """

    air: Sequence[dict[str, Any]]
    value: np.ndarray
    miss: np.ndarray
    size: float

    @staticmethod
    def of(
        air: Sequence[dict[str, Any]],
        found: Sequence[dict[str, Any]],
        d: np.ndarray,
        slope: np.ndarray | None = None,
    ) -> _Lag:
        if "value" not in air[0]:
            none = np.zeros((len(air), 0))
            return _Lag(air, none, none, 0.0)
        value, rate = (np.stack([own[key] for own in air]) for key in ("value", "rate"))
        miss = (d @ value if slope is None else slope) - rate
        size = 0.0
        for one, r, left in zip(air, found, miss, strict=True):
            own = np.abs(np.diag(one["own"]))
            force = np.abs(one["effect"]) @ (np.abs(left) / np.maximum(own, np.finfo(float).tiny))
            work = np.asarray(r["reach"]) * np.asarray(r["force_sizes"])
            size = max(size, float(np.max(force[work > 0.0] / work[work > 0.0], initial=0.0)))
        return _Lag(air, value, miss, size)

    def eliminated(
        self, T: Sequence[np.ndarray], W: np.ndarray, d: np.ndarray, at: np.ndarray, unit: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Change (n, m) of the states at no step of the coordinates, by such a step (n, m, n still), and their forces (n, still, m)."""
        n, m = self.value.shape
        alone, along = np.zeros((n, m)), np.zeros((n, m, n * len(at)))
        effect = np.zeros((n, len(at), m))
        if not m:
            return alone, along, effect
        own = np.stack([one["own"] for one in self.air])
        drive = np.zeros((n, m, n, len(at)))
        for k, (one, Tk) in enumerate(zip(self.air, T, strict=True)):
            R = one["by_rate"] @ Tk
            drive[k] = (R[:, at] * unit)[:, None, :] * d[k][None, :, None]
            drive[k, :, k] += (one["by_place"] @ Tk + R @ W)[:, at] * unit
            effect[k] = (Tk.T @ one["effect"])[at] * unit[:, None]
        drives = drive.reshape(n, m, -1)
        part = connected(np.abs(own).max(axis=0) > 0.0)
        for c in range(int(part.max()) + 1):
            mine = np.flatnonzero(part == c)
            size = n * len(mine)
            K = np.einsum("kl,ij->kilj", d, np.eye(len(mine)))
            K[np.arange(n), :, np.arange(n), :] -= own[:, mine[:, None], mine]
            right = np.concatenate([-self.miss[:, mine].reshape(size, 1), drives[:, mine].reshape(size, -1)], axis=1)
            found = np.linalg.solve(K.reshape(size, size), right).reshape(n, len(mine), -1)
            alone[:, mine], along[:, mine] = found[:, :, 0], found[:, :, 1:]
        return alone, along, effect


def _linearized(snapshot: Snapshot, state: State, without: Sequence[str], held: np.ndarray) -> dict[str, Any]:
    with core_errors():
        found: dict[str, Any] = snapshot.system.linearize(
            state.q, state.rate, list(without), [], state.acceleration.tolist(), raw=True, held=held.tolist()
        )
    return found


def orbit_matrices(snapshot: Snapshot, orbit: Orbit, without: Sequence[str], names: Sequence[str]) -> Periodic:
    """M, D, S over a turn of a periodic motion, of the coordinates ``names``; with the states of the air."""
    without = [*without, "drives"] if snapshot.model.drives and "drives" not in without else list(without)
    along = [
        State(q, rate, "steady", acceleration=acceleration)
        for q, rate, acceleration in zip(orbit.q, orbit.rate, orbit.acceleration, strict=True)
    ]
    lagging = orbit.states.size > 0
    held = orbit.states if lagging else np.zeros((len(along), 0))
    found = [_linearized(snapshot, state, without, own) for state, own in zip(along, held, strict=True)]
    every = list(found[0]["coordinates"])
    times = orbit.period * np.arange(len(found)) / len(found)
    T = [expm(orbit.W * t) for t in times]
    made = periodic(found, T, orbit.W, orbit.period)
    if lagging:
        air = [air_matrices(snapshot, state, without, own) for state, own in zip(along, held, strict=True)]
        V = blade_generator(snapshot, along[0], air[0]["section"])
        names_of_air = tuple(f"the air {snapshot.model.airs[int(i)].name!r}" for i in air[0]["air"])
        made = replace(made, lags=_lags(air, T, orbit.W, [expm(V * t) for t in times], V, names_of_air))
    return made.kept([every.index(name) for name in names])


def _lags(
    air: Sequence[dict[str, Any]],
    T: Sequence[np.ndarray],
    W: np.ndarray,
    U: Sequence[np.ndarray],
    V: np.ndarray,
    names: tuple[str, ...],
) -> Lags:
    """The states in multiblade axes, d = U u: the counterpart of (8.2)."""
    rows = []
    for own, Tk, Uk in zip(air, T, U, strict=True):
        R = Uk.T @ own["by_rate"] @ Tk
        P = Uk.T @ own["by_place"] @ Tk + R @ W
        rows.append((Tk.T @ own["effect"] @ Uk, P, R, Uk.T @ own["own"] @ Uk - V))
    E, P, R, A = (np.stack(part) for part in zip(*rows, strict=True))
    return Lags(E, P, R, A, V, names)


def periodic(found: Sequence[dict[str, Any]], T: Sequence[np.ndarray], W: np.ndarray, period: float) -> Periodic:
    """(8.2) at all azimuths."""
    M, D, S = [], [], []
    for r, Tk in zip(found, T, strict=True):
        d = np.zeros_like(r["M"]) if r["D"] is None else r["D"]
        TW = Tk @ W
        M.append(Tk.T @ r["M"] @ Tk)
        D.append(Tk.T @ (d @ Tk + 2.0 * r["M"] @ TW))
        S.append(Tk.T @ (r["S"] @ Tk + d @ TW + r["M"] @ TW @ W))
    return Periodic(np.stack(M), np.stack(D), np.stack(S), period)


def _check(snapshot: Snapshot) -> None:
    model = snapshot.model
    if any(LAW_OF_CODE[int(code)].state == "rate" for code in snapshot.tables["law_type"]):
        raise ModelError(
            f"average= holds no states of laws, and {model.name!r} has some (mb.Maxwell); leave them out, or follow the motion in time "
            "(mb.simulate)"
        )


def _rotations(snapshot: Snapshot, names: Sequence[str]) -> list[np.ndarray]:
    """Places of the three turns of each joint whose orientation is a quaternion."""
    found = [
        np.arange(i, i + 3)
        for i, name in enumerate(names[: len(names) - 2])
        if name.endswith(".rx") and [name[:-1] + x for x in "xyz"] == list(names[i : i + 3])
    ]
    if snapshot.system.n_q - snapshot.system.n_tree != len(found) or snapshot.system.n_tree != len(names):
        raise ModelError(
            f"average= belongs to rotors without closed loops, couplers and bodies in quaternions other than those of free and spherical "
            f"joints, and {snapshot.model.name!r} is not one; follow its motion in time (mb.simulate)"
        )
    return found


def _turning(y: np.ndarray, dy: np.ndarray, ddy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angular velocity and acceleration of exp(y~), by the series of the small angle |y|."""
    x, dx = float(y @ y), 2.0 * float(y @ dy)
    powers = x ** np.arange(8)
    first = np.array([1.0 / _FACTORIAL[2 * k + 2] * (-1) ** k for k in range(8)])
    second = np.array([1.0 / _FACTORIAL[2 * k + 3] * (-1) ** k for k in range(8)])
    a, b = first @ powers, second @ powers
    da, db = (dx * float(np.arange(1, 8) * c[1:] @ powers[:-1]) for c in (first, second))
    Y, dY = skew(y), skew(dy)
    J = np.eye(3) + a * Y + b * Y @ Y
    dJ = da * Y + a * dY + db * Y @ Y + b * (dY @ Y + Y @ dY)
    return J @ dy, J @ ddy + dJ @ dy


_FACTORIAL = np.cumprod(np.concatenate([[1.0], np.arange(1.0, 20.0)]))
