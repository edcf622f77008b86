"""Explicit Runge-Kutta of order eight on tree increments, as in ``rust/src/integrate/explicit8.rs``: of all tree
coordinates, or of independent ones:

    y" from [M J^T; J 0] [v'; lam] = [-h; -J' v - Phi_tt]

There y are increments of the independent tree coordinates; the dependent ones close the loops by Newton's method, so no
constraint drifts (Wehage and Haug, J. Mech. Des. 104 (1982) 247-255).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mbrs.errors import ConvergenceError
from mbrs.reference.assembly import jacobian, scales
from mbrs.reference.kinematics import State, System, advance
from mbrs.reference.motion import Motion, explicit_rates, increment_rates, velocity_rows
from mbrs.reference.simulate import Instant, acceleration, advance_memory, consistent, rows
from mbrs.reference.so3 import Array
from oracles.steps import Steps, moved, turning

TIE = 1e-6  # entries that differ by less are equally good pivots: the first is taken
REDUNDANT = 1e-9  # remainders below this part of the largest entry carry nothing
WORN = 4.0  # a choice is left where another pivot of a row is larger by this factor


def scaled(sys: System, state: State) -> Array:
    """J of all rows, free of units."""
    row, column = scales(sys)
    return row[:, None] * jacobian(sys, state).real * column


def choose(sys: System, state: State) -> tuple[list[tuple[int, int]], int]:
    """Row and column of each pivot of the scaled rows, by complete pivoting, position rows before those that restrict
    velocities alone; and how many are of positions.
    """
    pivots: list[tuple[int, int]] = []
    left, n = scaled(sys, state), 0
    largest, velocity = np.max(np.abs(left), initial=0.0), velocity_rows(sys)
    for level in (False, True):
        open_rows = [int(i) for i in np.flatnonzero(velocity == level)]
        while open_rows:
            size = np.abs(left[open_rows])
            if size.max() <= REDUNDANT * largest:
                break
            at, column = np.argwhere(size >= (1 - TIE) * size.max())[0]
            row = open_rows.pop(int(at))
            for i in range(len(left)):
                if i not in [p[0] for p in pivots] and i != row:
                    left[i] -= left[i, column] / left[row, column] * left[row]
                    left[i, column] = 0.0
            pivots.append((row, int(column)))
        n = n if level else len(pivots)
    return pivots, n


def worn(sys: System, state: State, pivots: list[tuple[int, int]]) -> float:
    """The largest entry of a row over its pivot, after elimination in the order of the pivots."""
    left, most = scaled(sys, state), 0.0
    for k, (row, column) in enumerate(pivots):
        most = max(most, float(np.max(np.abs(left[row] / left[row, column]))))
        for i, _ in pivots[k + 1 :]:
            left[i] -= left[i, column] / left[row, column] * left[row]
            left[i, column] = 0.0
    return most


class Chart:
    """Independent coordinates around a state: ``places`` determine poses, the fewer ``speeds`` velocities, since rows that
    restrict velocities alone leave places free. Increments are counted from the state, also of three rotations together.
    """

    def __init__(
        self, sys: System, state: State, t: float = 0.0, chosen: tuple[list[tuple[int, int]], int] | None = None
    ) -> None:
        sys.t = t
        self.sys, self.base = sys, state
        pivots, self.n = choose(sys, state) if chosen is None else chosen
        places = np.array(pivots, dtype=int).reshape(-1, 2)
        self.rows, self.depend = places[:, 0], places[:, 1]
        self.places = np.setdiff1d(np.arange(sys.ny), self.depend[: self.n])
        self.speeds = np.setdiff1d(np.arange(sys.ny), self.depend)

    def closed(self, increment: Array) -> Array:
        """The increments with dependent ones from Phi = 0, those given being the first guess."""
        y, previous, which, on = np.array(increment), np.inf, self.rows[: self.n], self.depend[: self.n]
        for _ in range(60 if self.n else 0):
            phi, J = rows(self.sys, self._moved(y, np.zeros(self.sys.ny), np.zeros(0)))
            d = np.linalg.solve((J @ turning(self.sys, y))[np.ix_(which, on)], -phi[which])
            y[on] += d
            size = float(np.max(np.abs(d)))
            if size < 1e-14 or (size < 1e-10 and size > 0.5 * previous):
                return y
            previous = size
        if self.n:
            raise ConvergenceError("the loops do not close at these independent coordinates; take a smaller step")
        return y

    def _moved(self, y: Array, rate: Array, memory: Array) -> Motion:
        return Motion(advance(self.sys, self.base, y), rate, memory)

    def motion(self, t: float, y: Array, rate: Array, memory: Array) -> tuple[Array, Motion]:
        """Increments and motion at the time t: of both, dependent ones follow from the independent ones given."""
        self.sys.t = t
        y, rate = self.closed(y), np.array(rate)
        if len(self.depend):
            rate[self.depend] = 0.0
            J = rows(self.sys, self._moved(y, rate, memory))[1][self.rows]
            miss = -explicit_rates(self.sys)[0][self.rows] - J @ rate
            rate[self.depend] = np.linalg.solve(J[:, self.depend], miss)
        return y, self._moved(y, rate, memory)

    def spread(self, y: Array, speed: Array) -> tuple[Array, Array]:
        """Increments and rates of all coordinates, zero where they depend."""
        increment, rate = np.zeros(self.sys.ny), np.zeros(self.sys.ny)
        increment[self.places], rate[self.speeds] = y, speed
        return increment, rate

    def slopes(self, t: float, y: Array, rate: Array, memory: Array) -> tuple[Array, Array]:
        """Rates of the increments, which for three rotations that act together are J_l^-1 of the rates, and of the rates."""
        y, m = self.motion(t, y, rate, memory)
        return increment_rates(self.sys, y, m.rate), acceleration(self.sys, m)[0]


def tableau() -> tuple[Array, Array]:
    """A (12, 12) and weights of Dormand and Prince's method of order 8 (Hairer, Norsett, Wanner, Solving ODEs I, 2nd
    ed., II.5), as SciPy holds them.
    """
    from scipy.integrate import DOP853

    return DOP853.A, DOP853.B


def explicit(
    sys: System, start: Instant, h: float, n: int, coefficients: Any = None, coordinates: str = "tree"
) -> Steps:
    """n steps of length h (s) by the Runge-Kutta method (A, weights), of order 8 by default: theta' = J_l^-1(theta) v
    and v' of the equations with the rows at acceleration level; rows are closed and rates aligned after every step. Or,
    with "independent" ``coordinates``, dependent positions and rates from the rows in every stage and at the end.
    """
    A, weights = tableau() if coefficients is None else coefficients
    if coordinates == "independent":
        return _independent(sys, start, h, n, (A, weights))
    history = Steps([start])
    for step in range(n):
        now = history.instants[-1].motion
        dy, dv = np.zeros((len(weights), sys.ny)), np.zeros((len(weights), sys.ny))
        for i, (row, node) in enumerate(zip(A, A.sum(axis=1), strict=True)):
            sys.t = start.t + (step + node) * h
            y = h * row[:i] @ dy[:i]
            sys.t = start.t + (step + np.sum(row[:i])) * h
            trial = moved(sys, now, y, now.rate + h * row[:i] @ dv[:i])
            dy[i], dv[i] = increment_rates(sys, y, trial.rate), acceleration(sys, trial)[0]
        end = moved(sys, now, h * weights @ dy, now.rate + h * weights @ dv)
        history.instants.append(advance_memory(sys, consistent(sys, start.t + (step + 1) * h, end)))
    return history


def _independent(sys: System, start: Instant, h: float, n: int, coefficients: tuple[Array, Array]) -> Steps:
    """The choice of coordinates is kept while it serves."""
    A, weights = coefficients
    history, chosen = Steps([start]), choose(sys, start.motion.state)
    for step in range(n):
        now, t = history.instants[-1].motion, start.t + step * h
        if worn(sys, now.state, chosen[0]) > WORN:
            chosen = choose(sys, now.state)
        chart = Chart(sys, now.state, t, chosen)
        dy, dv = np.zeros((len(weights), sys.ny)), np.zeros((len(weights), sys.ny))
        for i, row in enumerate(A):
            stage = chart.slopes(
                t + np.sum(row[:i]) * h, h * row[:i] @ dy[:i], now.rate + h * row[:i] @ dv[:i], now.memory
            )
            dy[i], dv[i] = stage
        end = chart.motion(t + h, h * weights @ dy, now.rate + h * weights @ dv, now.memory)[1]
        sys.t = t + h
        history.instants.append(advance_memory(sys, Instant(t + h, end, *acceleration(sys, end))))
    return history
