"""Finite elements of a beam that tapers and twists, with all degrees of freedom at nodes. Data invented."""

from __future__ import annotations

import numpy as np
from mbrs.flexible._elements import Section, mesh


def fem(section, n=24):
    """The beam's own matrices with all freedoms at nodes."""
    grid = mesh(np.linspace(0, 1.2, n + 1), section, shear=False, straight=True)
    M, K = grid.assembled()
    at = np.zeros((n + 1, 3))
    at[:, 0] = grid.x
    return grid, M, K, at


def full_section(x):
    return Section(2.0 - x, 30.0 - 8 * x, 90.0, 20.0, 5e4, 0.0, 0.0, 0.02, 0.05, 0.2 * x)


def plain_section(x):
    return Section(2.0 - x, 30.0 - 8 * x, 90.0, 0.0, 0.0, 0.0, 0.0, 1e-6, 2e-6, 0.2 * x)
