"""The classical Runge-Kutta method on increments of the tree coordinates, a transcript that passes complex steps.

[M J^T; J 0] [v'; lam] = [-h; -J' v] with independent rows. After a step position rows are closed, then v is projected, in the
norm of M; what laws remember is frozen within a step. A complex step in x gives the derivative of the discrete motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mbrs.reference import dynamics as dyn
from mbrs.reference.assembly import constraint_values, scales
from mbrs.reference.kinematics import State, System, advance
from mbrs.reference.linear import pivots
from mbrs.reference.motion import (
    Motion,
    explicit_rates,
    increment_rates,
    remember,
    tree_map,
    velocity_rows,
    with_rates,
)
from mbrs.reference.simulate import mass_matrix
from mbrs.reference.so3 import Array


def start(sys: System, state: State, rate: Array) -> Motion:
    """A motion that begins with sliders centred."""
    dtype = np.result_type(sys.x, float)
    return Motion(state, np.asarray(rate, dtype=dtype), np.zeros(sys.n_memory, dtype=dtype))


def independent_rows(sys: System, state: State) -> tuple[Array, int]:
    """Cut rows that imply the others, position rows first, and how many of these there are."""
    row, column = scales(sys)
    J = row[:, None] * tree_map(sys, state)[1].value.T.real * column
    velocity = velocity_rows(sys)
    position = np.flatnonzero(~velocity)
    kept = list(position[pivots(J[position].T)])
    n = len(kept)
    for i in np.flatnonzero(velocity):
        if len(pivots(J[[*kept, i]].T)) > len(kept):
            kept.append(i)
    return np.array(kept, dtype=int), n


def accelerations(sys: System, m: Motion, rows: Array) -> Array:
    """v' of the tree coordinates."""
    state = with_rates(sys, m)
    T, Jt = tree_map(sys, state, moving=True)
    drift = T.derivative(1) @ m.rate
    h = T.value.T @ dyn.applied_residual(sys, state, drift, memory=m.memory)
    J, turning = Jt.value.T[rows], (Jt.derivative(1).T @ m.rate)[rows]
    M = mass_matrix(sys, state)
    turning = turning + explicit_rates(sys)[1][rows]
    return np.linalg.solve(_saddle(M, J), np.concatenate([-h, -turning]))[: sys.ny]


def _saddle(M: Array, J: Array) -> Array:
    return np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]])


def _correction(M: Array, J: Array, miss: Array) -> Array:
    return np.linalg.solve(_saddle(M, J), np.concatenate([np.zeros(len(M)), miss]))[: len(M)]


def project(sys: System, m: Motion, rows: Array, n_position: int) -> Motion:
    """Position rows closed by three Newton steps, then rates that satisfy all rows."""
    state = m.state
    if len(rows) == 0:
        return m
    if n_position:
        position = np.flatnonzero(~velocity_rows(sys))
        which = np.searchsorted(position, rows[:n_position])
        for _ in range(3):
            Jt = tree_map(sys, state)[1]
            miss = -constraint_values(sys, state, sys.cut)[which]
            step = _correction(mass_matrix(sys, state), Jt.value.T[rows[:n_position]], miss)
            state = advance(sys, state, step)
    J = tree_map(sys, state)[1].value.T[rows]
    miss = -J @ m.rate - explicit_rates(sys)[0][rows]
    rate = m.rate + _correction(mass_matrix(sys, state), J, miss)
    return Motion(state, rate, m.memory)


def step(sys: System, m: Motion, h: float, rows: Array, n_position: int) -> Motion:
    """One step of length h from the time that the system holds, which moves on."""
    slopes: list[tuple[Array, Array]] = []
    before = sys.t
    for fraction in (0.0, 0.5 * h, 0.5 * h, h):
        sys.t = before + fraction
        increment, trial = 0 * m.rate, m
        if fraction:
            dy, dv = slopes[-1]
            increment = fraction * dy
            trial = Motion(advance(sys, m.state, increment), m.rate + fraction * dv, m.memory)
        slopes.append((increment_rates(sys, increment, trial.rate), accelerations(sys, trial, rows)))
    weights = np.array([h / 6, h / 3, h / 3, h / 6])
    total = [weights @ np.array([s[i] for s in slopes]) for i in range(2)]
    moved = Motion(advance(sys, m.state, total[0]), m.rate + total[1], m.memory)
    moved = project(sys, moved, rows, n_position)
    return replace(moved, memory=remember(sys, moved))


def integrate(sys: System, m: Motion, h: float, n: int) -> list[Motion]:
    """The motion after every step, the start included."""
    rows, n_position = independent_rows(sys, m.state)
    history = [m]
    for _ in range(n):
        history.append(step(sys, history[-1], h, rows, n_position))
    return history
