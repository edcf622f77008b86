"""Static equilibrium by Newton's method in minimal coordinates; loops are closed after every step."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..errors import ConvergenceError
from . import dynamics as dyn
from .assembly import Partition, assemble, close_loops, cut_jacobian, null_space, twist_map
from .kinematics import State, System, advance, first_guess, motion, moving, tree_twists
from .linearize import Linearization, linearize
from .so3 import Array


def equilibrium(
    sys: System, state0: State | None = None, tolerance: float = 1e-13, without: Collection[str] = ()
) -> tuple[State, Array, float]:
    """T^T (Q - elements) = 0 at rest, from ``state0`` (the assembled first guess by default).

    Returns the state, the multipliers of all joint rows (least norm for redundant sets) and the largest scaled
    generalised force that is left. Steps use the real part of S, its least-norm inverse where directions are
    unrestrained; an imaginary part (a complex step) converges by the same steps and is waited for.
    """
    sys = sys.leaving_out(without)
    state = assemble(sys, first_guess(sys) if state0 is None else state0).at_rest
    lin = linearize(sys, state, without=without)
    size, imaginary = _size(sys, lin), np.inf
    for _ in range(100):
        change = float(np.max(np.abs(lin.residual.imag), initial=0.0))
        scale = _force_scale(sys, lin)
        done = size <= tolerance * scale
        if done and (change == 0 or change >= 0.5 * imaginary):
            return lin.state, lin.lam, size / scale
        imaginary = change if done else np.inf
        previous = size
        state = _step(sys, state, lin, size, without)
        lin = linearize(sys, state, without=without)
        size = _size(sys, lin)
        if not done and size >= previous and size <= 1e-9 * scale:  # rounding, not distance, is left
            tolerance = 2 * size / scale
    raise ConvergenceError(f"no equilibrium within 100 steps: generalised force {size:.3g} is left", state)


def _columns(sys: System, lin: Linearization) -> Array:
    return np.where(sys.is_length[lin.partition.independent], sys.length, 1.0)


def _size(sys: System, lin: Linearization) -> float:
    return float(np.max(np.abs((_columns(sys, lin) * lin.residual).real), initial=0.0))


def _force_scale(sys: System, lin: Linearization) -> float:
    """The size of the terms whose sum vanishes: loads and the forces of single elements."""
    now = moving(lin.state, np.zeros(6 * sys.nb))
    parts = (dyn.loads(sys, now).value, dyn.elements(sys, now).value, 1e-3 * lin.K)
    return max(*(float(np.max(np.abs(part.real), initial=0.0)) for part in parts), 1e-300) * max(sys.length, 1.0)


def _step(sys: System, state: State, lin: Linearization, size: float, without: Collection[str]) -> State:
    """One Newton step, halved until the unbalanced force falls; never more than half a radian or half of L_c."""
    columns, part = _columns(sys, lin), lin.partition
    S = (columns[:, None] * lin.S * columns).real
    dy = columns * (-np.linalg.pinv(S, rcond=1e-12) @ (columns * lin.residual))
    longest = np.max(np.abs(dy.real / columns), initial=0.0)
    dy = dy * min(1.0, 0.5 / longest) if longest > 0 else dy
    for _ in range(12):
        y = np.zeros(sys.ny, dtype=dy.dtype)
        y[part.independent] = dy
        y[part.dependent] = _dependent(sys, state, lin, dy)
        new = close_loops(sys, advance(sys, state, y), fixed=part.independent)
        if longest < 1e-10 or _unbalanced(sys, new, part, columns, without) < size:
            break
        dy = 0.5 * dy
    return new


def _unbalanced(sys: System, state: State, part: Partition, columns: Array, without: Collection[str]) -> float:
    T = twist_map(sys, motion(state), part).value
    f = dyn.applied_residual(sys, state, np.zeros(6 * sys.nb), without)
    return float(np.max(np.abs((columns * (T.T @ f)).real), initial=0.0))


def _dependent(sys: System, state: State, lin: Linearization, dy: Array) -> Array:
    if len(lin.partition.dependent) == 0:
        return np.zeros(0, dtype=dy.dtype)
    bodies = motion(state)
    B = null_space(cut_jacobian(sys, bodies, tree_twists(sys, bodies)), lin.partition).value
    return (B @ dy)[lin.partition.dependent]
