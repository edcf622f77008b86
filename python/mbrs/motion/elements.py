"""Displacements, rates and forces of elements and joints along a motion, as the core has them at its states."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .. import _core
from .._lib.border import core_errors
from ..errors import ModelError
from ..model.names import index
from ..model.schema import ELEMENTS, JOINTS

__all__ = ["ElementMotion", "element_motion", "joint_rates"]

_ELEMENTS = {kind.code: kind for kind in ELEMENTS.values()}
_JOINTS = {kind.code: kind for kind in JOINTS.values()}


class ElementMotion(NamedTuple):
    """Per output and coordinate, (n_t, n): the coordinate, its displacement e, the rate e' and the force; and the type of the element."""

    coordinate: np.ndarray
    displacement: np.ndarray
    rate: np.ndarray
    force: np.ndarray
    type: str


def element_motion(traj: Any, name: Any) -> ElementMotion:
    """Displacements, rates and forces of a spring, bushing or torsion spring along a motion; angles follow the hinges over turns."""
    t = traj.snapshot.tables
    i = index("no spring, bushing or torsion spring", name, t["element_name"])
    with core_errors():
        found = _core.motion_of_element(
            traj.snapshot.system, i, traj.t, traj.q, traj.rate, traj.memory, list(traj.without)
        )
    coordinate, displacement, rate, force = np.moveaxis(found, 2, 0)
    return ElementMotion(coordinate, displacement, rate, force, _ELEMENTS[int(t["element_type"][i])].type)


def joint_rates(traj: Any, name: Any) -> np.ndarray:
    """(n_t, n) rates of the free coordinates of a joint."""
    t = traj.snapshot.tables
    i = index("no joint", name, t["joint_name"])
    if not _JOINTS[int(t["joint_type"][i])].free:
        raise ModelError(f"joint {t['joint_name'][i]!r} has no free coordinates")
    with core_errors():
        return _core.motion_of_joint(traj.snapshot.system, i, traj.t, traj.q, traj.rate, traj.memory)
