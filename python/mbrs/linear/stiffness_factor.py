"""The factor F of a model's stiffness, K = F^T F: rows sqrt(k) w of its elements, which an assembled K loses in rounding."""

from __future__ import annotations

import numpy as np

from .linearization import Linearization, modal_strains
from .strains import own_rows

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
    w, _, stiffness = strain_rows(lin)
    made = [w[:0]]
    for k, own in zip(stiffness, own_rows(stiffness), strict=True):
        root = _root(k)
        if root is None:
            return None
        made.append(root @ w[own])
    return np.concatenate(made)


def is_strained(factor: np.ndarray, shape: np.ndarray, mass: np.ndarray) -> bool:
    """True where a column of ``shape`` (phi^T M phi = 1) strains a row of the factor by more than rounding.

    The measure of a row is its strain when every coordinate moves by 1/sqrt(M_ii).
    """
    size = np.abs(factor) @ (1.0 / np.sqrt(np.diag(mass)))
    return bool(np.any(np.abs(factor @ shape) > _STRAINED * size[:, None]))


def strain_rows(lin: Linearization) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Rows (strains, dof) of all elements without entries of rounding, bounds of the entries that were dropped, and the stiffness
    (k, k) of each element, which has k of the rows.
    """
    rounding = _LOOP_ROUNDING if len(lin.multipliers) else _POSE_ROUNDING + len(lin.bodies)
    made, modal = lin.strains, modal_strains(lin)
    bound = rounding * np.finfo(float).eps * made.sizes
    is_dropped = np.abs(made.rows) <= bound
    kept, dropped = np.where(is_dropped, 0.0, made.rows), np.where(is_dropped, bound, 0.0)
    if modal:
        rows = np.concatenate([rows for _, rows, _ in modal])
        kept, dropped = np.concatenate([kept, rows]), np.concatenate([dropped, np.zeros(rows.shape)])
    return kept, dropped, [*made.stiffness, *(k for _, _, k in modal)]


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
