"""Transfer functions by a direct solve at every frequency, and the maps of inputs and outputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .kinematics import System
from .linearize import Linearization
from .so3 import Array, skew

POWER = {"receptance": 0, "mobility": 1, "accelerance": 2}


def motion_rows(sys: System, lin: Linearization, body: str, point: Array | None = None) -> Array:
    """L_r (6, dof): twist, world axes, of the point of a body that is at ``point`` (3,) now; its origin by default.

    Its transpose maps a wrench at that point to generalised forces, F_r = L_r^T.
    """
    i = [b.name for b in sys.bodies].index(body)
    rows = lin.T[6 * i : 6 * i + 6]
    if point is None:
        return rows
    origin = lin.state.r[i] - lin.state.R[i] @ sys.bodies[i].com
    return np.concatenate([rows[:3] - skew(np.asarray(point) - origin) @ rows[3:], rows[3:]])


def frf(M: Any, D: Any, S: Any, F: Any, L: Any, omega: Any, kind: str = "receptance") -> Array:
    """H(i omega) = (i omega)^p L (S - omega^2 M + i omega D)^-1 F, (n_out, n_in, n_omega); p = 0, 1, 2 by ``kind``."""
    w = np.atleast_1d(np.asarray(omega))
    p = POWER[kind]
    out = [(1j * o) ** p * (L @ np.linalg.solve(S - o * o * M + 1j * o * D, F)) for o in w]
    return np.moveaxis(np.array(out), 0, -1)


def frf_derivative(matrices: Sequence[Array], changes: Sequence[Array], omega: Any, kind: str = "receptance") -> Array:
    """dH = dL X + L Z^-1 (dF - dZ X), X = Z^-1 F (docs/theory.md (9.8)), of M, D, S, F, L and their derivatives; the maps depend on
    geometry too.
    """
    (M, D, S, F, L), (dM, dD, dS, dF, dL) = matrices, changes
    p, out = POWER[kind], []
    for o in np.atleast_1d(np.asarray(omega)):
        Z, dZ = S - o * o * M + 1j * o * D, dS - o * o * dM + 1j * o * dD
        X = np.linalg.solve(Z, F)
        out.append((1j * o) ** p * (dL @ X + L @ np.linalg.solve(Z, dF - dZ @ X)))
    return np.moveaxis(np.array(out), 0, -1)
