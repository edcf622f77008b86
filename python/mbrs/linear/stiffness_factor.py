"""The factor F of a model's stiffness, K = F^T F: rows sqrt(k) w of its elements, which an assembled K loses in rounding."""

from __future__ import annotations

import numpy as np

from .._lib.border import core_errors
from .linearization import Linearization, modal_strains

# Multiple of eps times the size of its terms below which an entry of a strain row is rounding of poses and axes. Too small: a
# coordinate that no element strains counts as held. Too large: weak levers are lost. Poses of closed loops carry the tolerance of their
# closure. Pinned by tests/truth/test_graded_modes.py (rows on arbitrary axes).
_POSE_ROUNDING = 32.0
_LOOP_ROUNDING = 1e5
# Relative strain of a rigid mode that cannot be rounding of its shape. Too small: the factor is made once more than needed. Too large: a
# strained mode stays rigid. Pinned by tests/truth/test_graded_modes.py (soft modes of models).
_STRAINED = 1e-9
# Effects that add to the stiffness what elements do not hold.
_GEOMETRIC = {"preload-stiffness", "constraint-force-stiffness", "gravity"}


def stiffness_factor(lin: Linearization) -> np.ndarray | None:
    """(rows, dof) F with K = F^T F; None where K holds more than elastic elements, or an element has negative stiffness.

    What a linearisation holds is decided by the effects of the model, not by comparing matrices.
    """
    if lin.state.moving or lin.state.kind not in ("drawn", "equilibrium") or lin.N is not None:
        return None
    if _GEOMETRIC & set(lin.effects):
        return None
    rows = []
    for w, _, k in strain_rows(lin):
        root = _root(k)
        if root is None:
            return None
        rows.append(root @ w)
    return np.vstack(rows) if rows else np.zeros((0, lin.n))


def is_strained(factor: np.ndarray, shape: np.ndarray, mass: np.ndarray) -> bool:
    """True where a column of ``shape`` (phi^T M phi = 1) strains a row of the factor by more than rounding.

    The measure of a row is its strain when every coordinate moves by 1/sqrt(M_ii).
    """
    size = np.abs(factor) @ (1.0 / np.sqrt(np.diag(mass)))
    return bool(np.any(np.abs(factor @ shape) > _STRAINED * size[:, None]))


def strain_rows(lin: Linearization) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Rows (e, dof) of each element without entries of rounding, bounds of the entries that were dropped, its stiffness (e, e)."""
    rounding = _LOOP_ROUNDING if len(lin.multipliers) else _POSE_ROUNDING + len(lin.bodies)
    with_poses = []
    for (_, rows, k), (a, b, point, gradients) in zip(lin._strains, _places(lin), strict=True):
        size = _motion_size(lin, a, point) + _motion_size(lin, b, point)
        force, moment = np.linalg.norm(gradients[:, :3], axis=1), np.linalg.norm(gradients[:, 3:], axis=1)
        bound = rounding * np.finfo(float).eps * (np.outer(force, size[0]) + np.outer(moment, size[1]))
        dropped = np.abs(rows) <= bound
        with_poses.append((np.where(dropped, 0.0, rows), np.where(dropped, bound, 0.0), np.asarray(k)))
    modal = [(np.asarray(rows), np.zeros(rows.shape), np.asarray(k)) for _, rows, k in modal_strains(lin)]
    return with_poses + modal


def _places(lin: Linearization) -> list[tuple[int, int, np.ndarray, np.ndarray]]:
    with core_errors():
        rows = lin.snapshot.system.strains(lin.state.q, list(lin.without))
    return [(a, b, point, gradients) for _, a, b, point, gradients, _ in rows]


def _motion_size(lin: Linearization, body: int, point: np.ndarray) -> np.ndarray:
    """(2, dof): sizes of what was added up in the displacement of a body's point and in its rotation."""
    if body < 0:
        return np.zeros((2, lin.n))
    twist = lin.T[6 * body : 6 * body + 6]
    turning = np.linalg.norm(twist[3:], axis=0)
    reach = np.linalg.norm(point) + np.linalg.norm(lin.poses["position"][body])
    return np.stack([np.linalg.norm(twist[:3], axis=0) + reach * turning, turning])


def _root(k: np.ndarray) -> np.ndarray | None:
    """R with k = R^T R, rows of sqrt(k) where the stiffness is diagonal; None where it is not semidefinite."""
    k = np.atleast_2d(k)
    diagonal = np.diag(k)
    if not np.any(k - np.diag(diagonal)):
        return np.diag(np.sqrt(diagonal)) if np.all(diagonal >= 0.0) else None
    if not np.array_equal(k, k.T):
        return None
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(k / np.outer(scale, scale))
    if values[0] < -16.0 * len(k) * np.finfo(float).eps:
        return None
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * scale
