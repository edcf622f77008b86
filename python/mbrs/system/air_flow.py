"""The flow of air at the sections of blades, at given states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from ..errors import ModelError

if TYPE_CHECKING:
    from .snapshot import Snapshot
    from .state import State

# Rows of `_core.motion_air`: where the numbers of a section are.
FLOW: dict[str, Any] = {
    "angle": 0,
    "speed": 1,
    "circulation": 2,
    **{name: slice(3 + 3 * i, 6 + 3 * i) for i, name in enumerate((
        "force", "moment", "centre", "rear", "forward", "span", "ahead", "suction", "centre_velocity", "rear_velocity", "induced",
    ))},
}  # fmt: skip


def flows(system: Any, t: np.ndarray, q: np.ndarray, rate: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """(n_t, sections, 36) rows of `FLOW` at states (n_t, ...)."""
    with core_errors():
        return _core.motion_air(system, t, q, rate, memory)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles within -pi to pi."""
    return np.where(np.abs(angle) <= np.pi, angle, np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def require_covered(model: Any, t: np.ndarray, flow: np.ndarray) -> None:
    """Raise a `ModelError` that names polar, section and time where an angle of attack lies beyond a polar's table."""
    start = 0
    for air in model.airs:
        tables = {p["name"]: (p["angle"][0], p["angle"][-1]) for p in air.polars}
        for blade in air.blades:
            n = len(blade["place"])
            angle = wrapped(flow[:, start : start + n, FLOW["angle"]])
            for key in ("polar", "second_polar"):
                ends = np.array([tables[name] for name in blade[key]])
                outside = np.argwhere((angle < ends[:, 0]) | (angle > ends[:, 1]))
                if len(outside):
                    i, k = outside[0]
                    low, high = np.degrees(ends[k])
                    raise ModelError(
                        f"polar {blade[key][k]!r} covers {low:.4g} to {high:.4g} degrees, but at t = {t[i]:.6g} s the angle of attack of "
                        f"section {k + 1} of {n} of {blade['body']!r}, at {blade['place'][k]:.4g} m, is {np.degrees(angle[i, k]):.4g} "
                        "degrees; give a longer table, or ask for .extend(aspect_ratio=...)"
                    )
            start += n


def require_covered_at(snapshot: Snapshot, state: State, without: tuple[str, ...]) -> None:
    """`require_covered` of one state of a model whose air acts."""
    if snapshot.model.airs and "aerodynamics" not in without:
        t = np.array([state.t])
        require_covered(
            snapshot.model, t, flows(snapshot.system, t, state.q[None], state.rate[None], state.memory[None])
        )
