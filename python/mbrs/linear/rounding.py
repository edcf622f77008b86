"""Bounds of the rounding errors in the entries of a linearisation, entry by entry, without a choice of units."""

from __future__ import annotations

import numpy as np

from .linearization import Linearization
from .stiffness_factor import strain_rows
from .strains import own_rows

# Multiple of eps times the sum of the sizes of the terms of an entry below which the entry is rounding. Too small: rounding passes for
# stiffness, circulation or damping. Too large: weak effects beside strong ones in the same entry are lost.
# Pinned by tests/truth/test_terms_of_linearisations.py.
_ENTRY = 8.0
# Entries above this share of the natural size of their row and column cannot be rounding: then no sizes are added up. Too small: work
# without need. Too large: rounding stays. No other entry changes. Pinned by the same tests.
_CLEAR = 1e-10


def motion_scale(T: np.ndarray, length: float) -> np.ndarray:
    """(dof,): how far a unit of each coordinate moves the bodies, in characteristic lengths and radians."""
    if T.size == 0:
        return np.ones(T.shape[1])
    squares = np.square(T).reshape(-1, 2, 3, T.shape[1])
    moved, turned = np.moveaxis(np.sqrt(squares[:, :, 0] + squares[:, :, 1] + squares[:, :, 2]), 1, 0)
    return np.asarray((moved / length + turned).max(axis=0))


def is_rounding(part: np.ndarray, size: np.ndarray) -> bool:
    """True where no entry of a part exceeds the rounding of the whole, whose terms have these sizes."""
    return not np.any(np.abs(part) > 0.5 * _ENTRY * np.finfo(float).eps * (size + size.T))


def entry_sizes(x: np.ndarray) -> np.ndarray:
    """Sizes of the terms of each entry as far as the matrix shows them: of sums of squares by Cauchy and Schwarz."""
    root = np.sqrt(np.abs(np.diag(x)))
    return np.asarray(np.maximum(np.maximum(np.abs(x), np.abs(x.T)), np.outer(root, root)))


def stiffness_without_rounding(lin: Linearization, scale: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """K at rest without entries of rounding; ``scale`` is that of `motion_scale`, ``forces`` (dof, dof) are sizes of the terms that
    forces at work add.
    """
    K = lin.K
    if K.size == 0:
        return K
    natural = np.divide(np.abs(np.diag(K)), scale**2, out=np.zeros(lin.n), where=scale > 0.0).max(initial=0.0)
    suspicious = (K != 0.0) & (np.abs(K) <= _CLEAR * (natural * np.outer(scale, scale) + forces))
    if not np.any(suspicious):
        return K
    bound = _ENTRY * np.finfo(float).eps * forces
    kept, dropped, stiffness = strain_rows(lin)
    size = np.abs(kept)
    bound += _ENTRY * np.finfo(float).eps * _sizes_of_products(size, stiffness)
    if np.any(dropped):
        bound += _sizes_of_products(size + dropped, stiffness) - _sizes_of_products(size, stiffness)
    return np.where(suspicious & (np.abs(K) <= bound), 0.0, K)


def _sizes_of_products(size: np.ndarray, stiffness: list[np.ndarray]) -> np.ndarray:
    """Sums over the elements of w^T |k| w."""
    weighed = [np.abs(k) @ size[own] for k, own in zip(stiffness, own_rows(stiffness), strict=True)]
    return np.asarray(size.T @ np.concatenate([*weighed, size[:0]]))
