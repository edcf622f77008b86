"""Equations of motion in tree coordinates, once more: what every scheme in time of this package steps through.

    M(q) v' + h(q, v, t) + J^T lam = 0,    Phi(q, t) = 0,    J v + Phi_t = 0

q are poses that move by increments of the tree coordinates, v their rates, J the rows of all cut joints, redundant ones
included: multipliers are those of least norm; the time is what ``sys.t`` holds. The same equations as
``rust/src/analysis/transient``, with slopes by complex steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from . import dynamics as dyn
from . import so3
from .assembly import constraint_values, scales
from .kinematics import State, System, advance, relative_pose
from .linear import RANK_TOLERANCE
from .motion import (
    Motion,
    energy,
    explicit_rates,
    increment_rates,
    mass,
    positions,
    remember,
    tree_map,
    velocity_rows,
    with_rates,
)
from .so3 import Array

TINY = 1e-30  # a complex step: derivatives to rounding


@dataclass
class Instant:
    """A motion at a time, with its accelerations (ny,) and the multipliers of all rows."""

    t: float
    motion: Motion
    a: Array
    lam: Array


@dataclass
class History:
    """Record of a scheme, step by step, with its number of Newton iterations."""

    instants: list[Instant] = field(default_factory=list)
    iterations: int = 0

    @property
    def t(self) -> Array:
        return np.array([i.t for i in self.instants])

    @property
    def rates(self) -> Array:
        """(n_t, ny) rates of the tree coordinates."""
        return np.array([i.motion.rate for i in self.instants])

    def positions(self, sys: System) -> Array:
        """Origins of all bodies (n_t, nb, 3), world."""
        return np.array([positions(sys, i.motion) for i in self.instants])

    def energies(self, sys: System) -> Array:
        """(n_t,) energy of inertia, weight and linear springs; laws are not counted."""
        return np.array([energy(sys, i.motion) for i in self.instants])


def rows(sys: System, m: Motion) -> tuple[Array, Array]:
    """Phi, zero for rows that restrict velocities only, and J (rows, ny)."""
    velocity = velocity_rows(sys)
    J = tree_map(sys, m.state)[1].value.T
    phi = np.zeros(len(velocity), dtype=J.dtype)
    phi[~velocity] = constraint_values(sys, m.state, sys.cut)
    return phi, J


def row_bias(sys: System, m: Motion) -> Array:
    """J' v + Phi_tt: what J v' must cancel."""
    turning = tree_map(sys, with_rates(sys, m), moving=True)[1].derivative(1).T @ m.rate
    return turning + explicit_rates(sys)[1]


def row_rates(sys: System, rate: Array, J: Array) -> Array:
    """J v + Phi_t."""
    return J @ rate + explicit_rates(sys)[0]


def residual(sys: System, m: Motion, a: Array, lam: Array) -> Array:
    """M a + h + J^T lam (ny,)."""
    state = with_rates(sys, m)
    T, Jt = tree_map(sys, state, moving=True)
    twist_rates = T.derivative(1) @ m.rate + T.value @ a
    return T.value.T @ dyn.applied_residual(sys, state, twist_rates, memory=m.memory) + Jt.value @ lam


def mass_matrix(sys: System, m: Motion) -> Array:
    """M (ny, ny)."""
    return mass(sys, m.state, tree_map(sys, m.state)[0].value)


def least_norm(A: Array, b: Array) -> Array:
    """x of least norm with A x = b for a matrix of any rank, by singular values above 1e-9 of the largest."""
    return np.linalg.lstsq(A, b, rcond=RANK_TOLERANCE)[0]


def row_scales(sys: System) -> Array:
    """1/L_c for rows in metres."""
    return scales(sys)[0]


def column_scales(sys: System) -> Array:
    """L_c for coordinates in metres: an increment over it has no unit."""
    return scales(sys)[1]


def smallest(sys: System, m: Motion, J: Array, miss: Array) -> Array:
    """dy of least dy^T M dy with J dy = miss, rows scaled."""
    root = np.linalg.cholesky(mass_matrix(sys, m))
    return np.linalg.solve(root.T, least_norm(np.linalg.solve(root, J.T).T, miss))


def close(sys: System, m: Motion) -> Motion:
    """The position rows brought to zero by Newton steps of least kinetic energy."""
    kept = ~velocity_rows(sys)
    previous = np.inf
    for _ in range(30 if np.any(kept) else 0):
        phi, J = (row_scales(sys) * part.T for part in rows(sys, m))
        size = float(np.max(np.abs(phi)))
        if size < 1e-14 or (size < 1e-11 and size > 0.5 * previous):
            break
        previous = size
        m = replace(m, state=advance(sys, m.state, smallest(sys, m, J.T[kept], -phi[kept])))
    return m


def align(sys: System, m: Motion) -> Motion:
    """Rates brought to J v + Phi_t = 0 by the change of least kinetic energy."""
    J, s = rows(sys, m)[1], row_scales(sys)
    if len(J) == 0:
        return m
    return replace(m, rate=m.rate + smallest(sys, m, s[:, None] * J, -s * row_rates(sys, m.rate, J)))


def acceleration(sys: System, m: Motion) -> tuple[Array, Array]:
    """v' and lam of [M J^T; J 0] [v'; lam] = [-h; -J' v - Phi_tt] (docs/theory.md (3.9))."""
    M, J = mass_matrix(sys, m), rows(sys, m)[1]
    free = np.linalg.solve(M, -residual(sys, m, np.zeros(sys.ny), np.zeros(len(J))))
    if len(J) == 0:
        return free, np.zeros(0)
    s = row_scales(sys)
    A = np.linalg.solve(np.linalg.cholesky(M), (s[:, None] * J).T).T
    lam = s * least_norm(A @ A.T, s * (J @ free + row_bias(sys, m)))
    return free - np.linalg.solve(M, J.T @ lam), lam


def consistent(sys: System, t: float, m: Motion) -> Instant:
    """Closed, aligned, with accelerations: what an accepted step ends with."""
    sys.t = t
    m = align(sys, close(sys, m))
    return Instant(t, m, *acceleration(sys, m))


def begin(sys: System, state: State, rate: Array | None = None) -> Instant:
    """A consistent start at t = 0 with sliders centred; rates from the state's velocities unless they are given."""
    sys.t = 0.0
    if rate is None:
        rate = np.linalg.lstsq(tree_map(sys, state)[0].value, dyn.twists_of(state), rcond=None)[0]
    return consistent(sys, 0.0, Motion(state, np.asarray(rate, dtype=float), np.zeros(sys.n_memory)))


def moved(sys: System, m: Motion, dy: Array, rate: Array) -> Motion:
    """The motion after tree increments dy, with other rates."""
    return Motion(advance(sys, m.state, dy), rate, m.memory)


def advance_memory(sys: System, end: Instant) -> Instant:
    """An accepted end, its memories brought there."""
    return replace(end, motion=replace(end.motion, memory=remember(sys, end.motion)))


def difference(sys: System, start: Motion, end: Motion) -> Array:
    """The tree increments that lead from one motion to another; three rotations together are less than half a turn."""
    out = []
    for t in sys.tree:
        (u0, R0), (u1, R1) = (relative_pose(t, m.state.r, m.state.R) for m in (start, end))
        if t.link.kind == "universal":
            out += _universal(t, R0, R1)
            continue
        turn = so3.log(R1 @ R0.T)
        out += [t.sign * (u1[k] - u0[k] if kind == "t" else turn[k]) for _, kind, _, k in t.coordinates]
    for f in sys.flexible:
        out += list(f.coordinates(end.state.r) - f.coordinates(start.state.r))
    return np.array(out)


def _universal(t: Any, R0: Array, R1: Array) -> list[Any]:
    """Changes of alpha and beta, less than half a turn each."""

    def angles(R: Array) -> Array:
        R = R if t.sign > 0 else R.T
        return np.array([so3.atan2(R[1, 0], R[0, 0]), so3.atan2(R[2, 1], R[2, 2])])

    change = angles(R1) - angles(R0)
    return list(change - 2 * np.pi * np.round(change.real / (2 * np.pi)))


def turning(sys: System, increment: Array) -> Array:
    """J_l (ny, ny): rates of the coordinates from rates of the increments, the identity but where three rotations act
    together.
    """
    columns = [increment_rates(sys, increment, unit) for unit in np.eye(sys.ny)]
    return np.linalg.inv(np.array(columns).T)


def newton(equations: Callable[[Array], Array], unknown: Array, limit: int = 30) -> tuple[Array, int]:
    """The root of equations free of units, by Newton's method with slopes by complex steps, kept while corrections shrink
    by ten, and least-norm corrections; ends at rounding: corrections below 1e-14, or below 1e-9 and no longer halved.
    Counts its steps.
    """
    previous, n, slow = np.inf, len(unknown), True
    for count in range(1, limit + 1):
        if slow:
            slopes = np.array([equations(unknown + 1j * TINY * e).imag / TINY for e in np.eye(n)]).T
        d = least_norm(slopes, -np.real(equations(unknown.astype(complex))))
        unknown = unknown + d
        size = float(np.max(np.abs(d)))
        if size < 1e-14 or (size < 1e-9 and size > 0.5 * previous):
            return unknown, count
        slow, previous = size > 0.1 * previous, size
    raise ConvergenceError(f"the step's equations were not solved in {limit} iterations; take a smaller step")


def force_scales(sys: System, m: Motion) -> Array:
    """Typical inertia of each coordinate, as a factor that makes forces over a squared rate free of units."""
    return 1 / (np.diag(mass_matrix(sys, m)).real * column_scales(sys))


def multiplier_scales(sys: System, m: Motion, J: Array) -> Array:
    """Multipliers, per squared rate, that change the scaled forces by about one."""
    weighted = J.real * np.sqrt(1 / np.diag(mass_matrix(sys, m)).real)
    size = np.linalg.norm(weighted, axis=1)
    return row_scales(sys) ** -1 / np.where(size > 0, size, 1.0) ** 2
