"""The factor F of a model's stiffness, K = F^T F: rows sqrt(k) w of its elements, which an assembled K loses in rounding."""

from __future__ import annotations

import numpy as np

from .._lib.border import core_errors
from .linearization import Linearization

# Effects that add to the stiffness what elements do not hold.
GEOMETRIC = {"preload-stiffness", "constraint-force-stiffness", "gravity"}


def stiffness_factor(lin: Linearization) -> np.ndarray | None:
    """(rows, dof) F with K = F^T F; None where K holds more than elastic elements, or an element has negative stiffness.

    What a linearisation holds is decided by the effects of the model, not by comparing matrices.
    """
    if not is_elastic(lin):
        return None
    with core_errors():
        factor: np.ndarray | None = lin.snapshot.system.stiffness_factor(lin.state.q, list(lin.without))
    return factor


def is_elastic(lin: Linearization) -> bool:
    """True where K holds elastic elements alone."""
    at_rest = not lin.state.moving and lin.state.kind in ("drawn", "equilibrium")
    if not at_rest or lin.N is not None:
        return False
    if not GEOMETRIC & set(lin.effects):
        return True
    # an effect may be there and have no forces: a preload of zero
    with core_errors():
        return not lin.snapshot.system.is_loaded(lin.state.q, list(lin.without))
