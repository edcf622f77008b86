"""Two warnings about loops: a parameter that breaks the closure of a redundant loop, and a pose where mobility is
only apparent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from mbrs.reference.assembly import constraint_values, cut_jacobian, drawn_and_assembled, null_space, partition, scales
from mbrs.reference.kinematics import State, System, motion, split, tree_twists
from mbrs.reference.linear import RANK_TOLERANCE
from mbrs.reference.so3 import STEP, Array


def left_null_space(J: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Orthonormal Z with Z^T J = 0."""
    U, sigma, _ = np.linalg.svd(J)
    return U[:, int(np.sum(sigma > tolerance * max(np.max(sigma, initial=0.0), 1e-300))) :]


def closure_defect(
    tables: Mapping[str, Any], direction: Array, state_of: Callable[[System], State] = drawn_and_assembled
) -> float:
    """|(1 - J J^+) dJ B''| along a direction in x, J scaled by L_c; zero where the loops stay as mobile as they are.

    Includes the gap (1 - J J^+) dPhi that opens at the state itself. Above about 1e-8 of |dJ| the derivative of the
    modes does not exist (docs/theory.md (9.2)).
    """
    real = System(tables)
    state = state_of(real)
    row, column = scales(real, velocity=False)
    part = partition(real, state)
    J = row[:, None] * _jacobian(real, state).T * column
    Z = left_null_space(J)
    moved = System(tables, np.asarray(tables["x"]) + 1j * STEP * np.asarray(direction, dtype=float))
    there = state_of(moved)
    dJ = row[:, None] * (_jacobian(moved, there).imag / STEP).T * column
    gap = row * constraint_values(moved, there, moved.cut).imag / STEP
    B = _null_space(real, state, part) / column[:, None]
    B = B / np.linalg.norm(B, axis=0)
    return float(max(np.max(np.abs(Z.T @ dJ @ B), initial=0.0), np.max(np.abs(Z.T @ gap), initial=0.0)))


def closure_curvature(sys: System, state: State) -> Array:
    """z_m^T (dJ/dy_i) B''_j, symmetrised, (redundant rows, dof, dof), scaled by L_c.

    Second order of the loop equations along the motions that the first order allows: not zero where a pose is
    singular, so that the degrees of freedom counted there are not those of the mechanism (a flat parallelogram, for
    instance).
    """
    row, column = scales(sys, velocity=False)
    part = partition(sys, state)
    B = _null_space(sys, state, part)
    Z = left_null_space(row[:, None] * _jacobian(sys, state).T * column)
    bodies = motion(state)
    twists = tree_twists(sys, bodies)
    T = np.concatenate([half.value.T for body in twists[:-1] for half in body]) @ B
    moving = motion(state, split(T.T))
    dJ = cut_jacobian(sys, moving, tree_twists(sys, moving), velocity=False).derivative_along(T.shape[1])
    scaled = B / column[:, None]
    unit = np.linalg.norm(scaled, axis=0)
    H = np.einsum("cm,c,iyc,yj->mij", Z, row, dJ, B) / unit[:, None] / unit
    return 0.5 * (H + np.swapaxes(H, 1, 2))


def _jacobian(sys: System, state: State) -> Array:
    bodies = motion(state)
    return cut_jacobian(sys, bodies, tree_twists(sys, bodies), velocity=False).value


def _null_space(sys: System, state: State, part: Any) -> Array:
    bodies = motion(state)
    return null_space(cut_jacobian(sys, bodies, tree_twists(sys, bodies)), part).value
