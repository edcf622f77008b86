"""What the transcripts of implicit schemes share: steps as increments of the tree coordinates, scales, Newton's method.

Their equations are those of `mbrs.reference.simulate`; slopes are complex steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mbrs.errors import ConvergenceError
from mbrs.reference import dynamics as dyn
from mbrs.reference import so3
from mbrs.reference.assembly import scales
from mbrs.reference.kinematics import State, System, advance, relative_pose
from mbrs.reference.linear import minimum_norm
from mbrs.reference.motion import Motion, increment_rates, tree_map, with_rates
from mbrs.reference.simulate import History, mass_matrix
from mbrs.reference.so3 import Array

TINY = 1e-30  # a complex step: derivatives to rounding


@dataclass
class Steps(History):
    """Record of a scheme, step by step, with its number of Newton iterations."""

    iterations: int = 0


def residual(sys: System, m: Motion, a: Array, lam: Array) -> Array:
    """M a + h + J^T lam (ny,)."""
    state = with_rates(sys, m)
    T, Jt = tree_map(sys, state, moving=True)
    twist_rates = T.derivative(1) @ m.rate + T.value @ a
    return T.value.T @ dyn.applied_residual(sys, state, twist_rates, memory=m.memory) + Jt.value @ lam


def row_scales(sys: System) -> Array:
    """1/L_c for rows in metres."""
    return scales(sys)[0]


def column_scales(sys: System) -> Array:
    """L_c for coordinates in metres: an increment over it has no unit."""
    return scales(sys)[1]


def moved(sys: System, m: Motion, dy: Array, rate: Array) -> Motion:
    """The motion after tree increments dy, with other rates."""
    return Motion(advance(sys, m.state, dy), rate, m.memory)


def turned_increment(sys: System, dy: Array, h: float, v0: Array, v1: Array) -> Array:
    """dy - h^2/12 v0 x v1 of three rotations that act together: the rotation vector of a step whose rate goes evenly from v0
    to v1, to fourth order (Magnus' series, in the axes of the joint's first body). Coordinates of a reversed joint count
    backwards.
    """
    parts, place = [], 0
    for t in sys.tree:
        if t.turns_freely:
            last = slice(t.stop - 3, t.stop)
            parts += [dy[place : t.stop - 3], dy[last] - t.sign * h * h / 12 * np.cross(v0[last], v1[last])]
            place = t.stop
    return np.concatenate([*parts, dy[place:]])


def difference(sys: System, start: State, end: State) -> Array:
    """The tree increments that lead from one pose to another, the way back of `advance`; three rotations together are less than
    half a turn.
    """
    out = []
    for t in sys.tree:
        (u0, R0), (u1, R1) = (relative_pose(t, s.r, s.R) for s in (start, end))
        if t.link.kind == "universal":
            out += _universal(t, R0, R1)
            continue
        turn = so3.log(R1 @ R0.T)
        out += [t.sign * (u1[k] - u0[k] if kind == "u" else turn[k]) for kind, k, _ in t.coordinates]
    for f in sys.flexible:
        out += list(f.held(end.r) - f.held(start.r))
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
        d = minimum_norm(slopes, -np.real(equations(unknown.astype(complex))))
        unknown = unknown + d
        size = float(np.max(np.abs(d)))
        if size < 1e-14 or (size < 1e-9 and size > 0.5 * previous):
            return unknown, count
        slow, previous = size > 0.1 * previous, size
    raise ConvergenceError(f"the step's equations were not solved in {limit} iterations; take a smaller step")


def force_scales(sys: System, m: Motion) -> Array:
    """Typical inertia of each coordinate, as a factor that makes forces over a squared rate free of units."""
    return 1 / (np.diag(mass_matrix(sys, m.state)).real * column_scales(sys))


def multiplier_scales(sys: System, m: Motion, J: Array) -> Array:
    """Multipliers, per squared rate, that change the scaled forces by about one."""
    weighted = J.real * np.sqrt(1 / np.diag(mass_matrix(sys, m.state)).real)
    size = np.linalg.norm(weighted, axis=1)
    return row_scales(sys) ** -1 / np.where(size > 0, size, 1.0) ** 2
