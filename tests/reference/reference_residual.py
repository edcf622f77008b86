"""tau(y, y', y") from positions alone: paths by forward kinematics, velocities by nine-point differences in time,
Newton and Euler.

Nothing of mbrs.reference's Jacobians or tangents is used; a complex step in y, y', y" then gives S, D, M for the tests.
"""

from __future__ import annotations

import numpy as np
from mbrs.reference import dynamics as dyn
from mbrs.reference import so3
from mbrs.reference.assembly import constraint_values, jacobian
from mbrs.reference.kinematics import State, advance

STEP = 0.02
OFFSETS = np.arange(-4, 5)
FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])


def moved(sys, state, part, y):
    """Independent increments y and those dependent ones, in one step from ``state``, that close the loops (chord
    iteration).
    """
    full = np.zeros(sys.ny, dtype=np.result_type(y, state.r))
    full[part.independent] = y
    new, smallest = advance(sys, state, full), np.inf
    if len(part.dependent) == 0:
        return new
    chord = np.linalg.pinv(jacobian(sys, state).real[:, part.dependent], rcond=1e-9)
    for _ in range(200):
        change = chord @ constraint_values(sys, new, sys.cut)
        size = np.max(np.abs(change.real)) + np.max(np.abs(change.imag)) * 1e30
        if size >= smallest and np.max(np.abs(change.real)) < 1e-12:
            return new
        smallest = size
        full[part.dependent] -= change
        new = advance(sys, state, full)
    raise AssertionError("the path does not close")


def twist_columns(sys, state, part, step=STEP):
    """T (6 nb, dof) by differences of positions."""
    dof = len(part.independent)
    columns = []
    for k in range(dof):
        path = [moved(sys, state, part, step * o * np.eye(dof)[k]) for o in OFFSETS]
        columns.append(derivatives(path, step, state)[0])
    return np.array(columns).T


def derivatives(path, step, here):
    """Twists and accelerations (6 nb,) of a sampled path at its middle."""
    r, R = np.array([s.r for s in path]), np.array([s.R for s in path])
    d = [np.tensordot(w, a, 1) / step**p for a in (r, R) for w, p in ((FIRST, 1), (SECOND, 2))]
    omega = so3.vee(d[2] @ np.swapaxes(here.R, -1, -2))
    W = so3.skew(omega)
    alpha = so3.vee(d[3] @ np.swapaxes(here.R, -1, -2) - W @ W)
    return np.concatenate([d[0], omega], 1).ravel(), np.concatenate([d[1], alpha], 1).ravel()


def tau(sys, state, part, rates, y, dy, ddy, step=STEP):
    """T^T (M a + h - Q) of the motion that is y + dy t + ddy t^2/2 away from the one with constant rates."""
    path = []
    for o in OFFSETS:
        t = step * o
        path.append(moved(sys, moved(sys, state, part, rates * t), part, y + dy * t + 0.5 * ddy * t * t))
    here = path[4]
    twist, acceleration = derivatives(path, step, here)
    v, w = np.split(twist.reshape(-1, 6), 2, axis=1)
    now = State(here.r, here.R, v, w)
    return twist_columns(sys, here, part, step).T @ dyn.applied_residual(sys, now, acceleration)


def matrices(sys, state, part, rates, step=STEP):
    """M, D, S of tau by complex steps."""
    n, h = len(part.independent), 1e-30
    zero, unit = np.zeros(n), np.eye(n)
    seeds = [
        [(unit[k] if slot == s else zero) * (1j * h if slot == s else 1) for s in range(3)]
        for slot in (2, 1, 0)
        for k in range(n)
    ]
    columns = np.array([tau(sys, state, part, rates, *seed, step=step).imag / h for seed in seeds]).T
    return columns[:, :n], columns[:, n : 2 * n], columns[:, 2 * n :]
