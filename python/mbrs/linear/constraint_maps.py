"""The two constraint matrices of a linearisation: B' of the open tree and B'' of the cut joints, T = B' B''.

The core never forms B': it is a recursion along the tree. Here it is read column by column, for those who compare.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._lib.border import core_errors
from ..system.state import State


def open_map(system: Any, state: State) -> np.ndarray:
    """B' (6 n_bodies, n_tree): the bodies' twists at each unit rate of the tree coordinates."""
    out = np.zeros((6 * system.n_bodies, system.n_tree))
    for k, rate in enumerate(np.eye(system.n_tree)):
        with core_errors():
            moved = system.bodies(state.q, rate)
        out[:, k] = np.hstack([moved["velocity"], moved["angular_velocity"]]).ravel()
    return out


def cut_map(system: Any, state: State, coordinates: Sequence[str], without: Sequence[str]) -> np.ndarray:
    """B'' (n_tree, dof): the identity on independent ``coordinates``, -J_d^-1 J_i on those that the cut joints determine."""
    names = list(system.topology()["coordinates"])
    independent = [names.index(name) for name in coordinates]
    dependent = sorted(set(range(len(names))) - set(independent))
    out = np.zeros((len(names), len(coordinates)))
    out[independent, range(len(coordinates))] = 1.0
    if dependent:
        with core_errors():
            J = system.rows(state.q, state.rate, 0.0, list(without))["jacobian"]
        size = np.linalg.norm(J, axis=1)
        J = J[size > 0.0] / size[size > 0.0, None]
        # redundant rows contradict nothing, so that the least squares are the solution
        scale = np.linalg.norm(J[:, dependent], axis=0)
        solved = np.linalg.lstsq(J[:, dependent] / scale, -J[:, independent], rcond=None)[0]
        out[dependent] = solved / scale[:, None]
    return out
