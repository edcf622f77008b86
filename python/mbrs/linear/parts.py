"""Symmetric and skew parts of the matrices of a linearisation."""

from __future__ import annotations

import numpy as np

from .rounding import entry_sizes, is_rounding


def symmetric(x: np.ndarray) -> np.ndarray:
    """Symmetric part."""
    out = x + x.T
    out *= 0.5
    return out


def split(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Symmetric and skew part over the first two axes."""
    t = np.swapaxes(x, 0, 1)
    return 0.5 * (x + t), 0.5 * (x - t)


def split_damping(D: np.ndarray | None, skew: bool) -> tuple[np.ndarray | None, np.ndarray | None]:
    """C and G of D; None where nothing acts. ``skew``: there may be a G."""
    if D is None or not np.any(D):
        return None, None
    if not skew:  # at rest dampers alone act, and theirs is symmetric unless they couple across
        return symmetric(D), None
    (C, G), size = split(D), entry_sizes(D)
    return None if is_rounding(C, size) else C, None if is_rounding(G, size) else G


def split_stiffness(S: np.ndarray, forces: np.ndarray, conservative: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """K and N of S; ``forces`` are sizes of the terms that forces at work add."""
    if conservative:  # a skew part is then what unbalanced moments leave in the increments of rotations
        return symmetric(S), None
    K, N = split(S)
    return K, None if is_rounding(N, entry_sizes(S) + forces) else N
