"""Rotors whose linearisation changes over a turn: the motion that repeats itself, and matrices averaged over it in multiblade axes.

In the axes z of a steady motion, y = T(t) z with T = exp(W t), M, D and S of a rotor in sheared or slanting wind, or under weight across
its axis, have the period of the turn. Their means make an ordinary linear system (`floquet` knows what they leave out).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._lib.border import core_errors
from .._lib.rotations import skew
from ..errors import ConvergenceError, ModelError
from ..model.schema import LAW_OF_CODE
from ..system.air_flow import require_covered_at
from ..system.snapshot import Snapshot
from ..system.state import Orbit, State
from .blades import blade_transformations
from .floquet import Periodic, interpolation
from .spin import Spin
from .turning_frames import STILL_AIR, expm, sampled

_MAX_ITERATIONS = 40
# Natural size (rad, characteristic lengths) of the largest change of a pose by one iteration.
_LONGEST = 0.3
# Force that is not in balance, over the forces at work, at the azimuths, and between them, up to which a periodic motion is called
# "converged". Larger: motions that too few azimuths cut count as found. Smaller: rounding of stiff parts, and corners of polars,
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
        _check(snapshot, without)
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

    def linearized(self, state: State) -> dict[str, Any]:
        with core_errors():
            found: dict[str, Any] = self.snapshot.system.linearize(
                state.q, state.rate, list(self.without), [], state.acceleration.tolist(), raw=True
            )
        return found

    def solve(self) -> tuple[Orbit, np.ndarray, float, float, int, dict[str, int]]:
        """The orbit, the mean residual (dof,), the largest residuals at the azimuths and between them over the forces at work, the number
        of iterations and the counts of work.
        """
        n, dof, still = self.n, len(self.names), self.still
        t, d = self.period * np.arange(n) / n, slopes(n, self.period)
        z = np.zeros((n, dof))
        best: tuple[float, Any] = (np.inf, None)
        for iteration in range(_MAX_ITERATIONS):
            states = self.states(z, d @ z, d @ (d @ z), t)
            found = [self.linearized(state) for state in states]
            unit = 1.0 / np.max([r["reach"] for r in found], axis=0)[still]
            unit[~np.isfinite(unit)] = 1.0
            forces = np.max([r["force_sizes"] for r in found], axis=0)[still]
            T = [expm(self.W * now) for now in t]
            residual = np.stack([Tk.T @ r["residual"] for Tk, r in zip(T, found, strict=True)])
            size = float(
                np.max(np.abs(residual[:, still] * unit) / np.maximum(forces, np.finfo(float).tiny), initial=0.0)
            )
            if size < best[0]:
                best = (size, (z, states, residual, found[0]["counts"], iteration))
            elif best[0] <= BALANCED:
                break
            step = self._step(found, T, d, residual, unit)
            natural = float(np.max(np.abs(step), initial=0.0))
            z = z.copy()
            z[:, still] += unit * step * min(1.0, _LONGEST / max(natural, 1e-300))
            if size <= 1e-13:
                break
        size, kept = best
        if kept is None or not size <= np.sqrt(BALANCED):
            raise ConvergenceError(
                f"no motion of {self.snapshot.model.name!r} that repeats itself with the turn was found within {_MAX_ITERATIONS} "
                "iterations; follow its motion in time (mb.simulate)"
            )
        z, states, residual, counts, iterations = kept
        for state in states:
            require_covered_at(self.snapshot, state, self.without)
        later, missed = self._between(z, d, unit / np.maximum(forces, np.finfo(float).tiny))
        all_states = [state for pair in zip(states, later, strict=True) for state in pair]
        q, rate, acceleration = (np.stack([getattr(s, a) for s in all_states]) for a in ("q", "rate", "acceleration"))
        orbit = Orbit(self.period, q, rate, acceleration, self.W)
        return orbit, residual.mean(axis=0), size, missed, iterations, counts

    def _step(
        self,
        found: Sequence[dict[str, Any]],
        T: Sequence[np.ndarray],
        d: np.ndarray,
        residual: np.ndarray,
        unit: np.ndarray,
    ) -> np.ndarray:
        """Newton's step for all azimuths at once, in natural units (n, still)."""
        n, at = self.n, np.flatnonzero(self.still)
        made = periodic(found, T, self.W, self.period).kept(at)
        dd, scale = d @ d, unit[None, :] * unit[:, None]
        J = np.einsum("kij,kl->kilj", made.M * scale, dd) + np.einsum("kij,kl->kilj", made.D * scale, d)
        J[np.arange(n), :, np.arange(n), :] += made.S * scale
        J = J.reshape(n * len(at), -1)
        right = -(residual[:, self.still] * unit).ravel()
        try:
            step = np.linalg.solve(J, right)
        except np.linalg.LinAlgError:
            step = np.linalg.lstsq(J, right, rcond=1e-12)[0]
        return np.asarray(step.reshape(n, -1))

    def _between(self, z: np.ndarray, d: np.ndarray, unit: np.ndarray) -> tuple[list[State], float]:
        """The states half-way behind the azimuths, and the largest force there that is not in balance, over the forces at work."""
        t = self.period * (np.arange(self.n) + 0.5) / self.n
        weight = interpolation(self.n, t / self.period)
        states = self.states(weight @ z, weight @ (d @ z), weight @ (d @ (d @ z)), t)
        rows = [expm(self.W * now).T @ self.linearized(state)["residual"] for state, now in zip(states, t, strict=True)]
        return states, float(np.max(np.abs(np.stack(rows)[:, self.still] * unit), initial=0.0))


def orbit_matrices(snapshot: Snapshot, orbit: Orbit, without: Sequence[str], names: Sequence[str]) -> Periodic:
    """M, D, S over a turn of a periodic motion, of the coordinates ``names``."""
    held = [*without, "drives"] if snapshot.model.drives and "drives" not in without else list(without)
    found = []
    for q, rate, acceleration in zip(orbit.q, orbit.rate, orbit.acceleration, strict=True):
        with core_errors():
            found.append(snapshot.system.linearize(q, rate, held, [], acceleration.tolist(), raw=True))
    every = list(found[0]["coordinates"])
    times = orbit.period * np.arange(len(found)) / len(found)
    made = periodic(found, [expm(orbit.W * t) for t in times], orbit.W, orbit.period)
    return made.kept([every.index(name) for name in names])


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


def _check(snapshot: Snapshot, without: tuple[str, ...]) -> None:
    model = snapshot.model
    airs = () if "aerodynamics" in without else model.airs
    rates = any(LAW_OF_CODE[int(code)].state == "rate" for code in snapshot.tables["law_type"])
    if rates or any(air.unsteady() for air in airs):
        raise ModelError(
            f"average= holds no states of laws or of the air, and {model.name!r} has some; give the air inflow='bem' without attached= and "
            "stall=, or follow the motion in time (mb.simulate)"
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
