"""States of the air at the sections of blades: what the core knows of them, and how those of equal blades turn in axes that stand.

What one blade feels turns with it. In axes that do not, states d of equal blades are taken together like coordinates of theirs,
d = U(t) u with U = exp(V t), so that u' = U^T (P y + R y' + A U u) - V u.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from .._lib.border import core_errors
from ..system.air_flow import FLOW, flows
from ..system.snapshot import Snapshot
from ..system.state import State

# How far the azimuth of a blade may be from even spacing, over the spacing: blades that lag for themselves stay in their places.
# Larger: uneven blades are taken together. Smaller: blades in slanting wind are not. Pinned by tests/linear/test_states_in_turning_axes.py.
_EVEN = 0.2
# Axes that stand; others turn with what turns, and the states with them.
STANDING = ("fixed", "multiblade")


def has_air_states(model: Any, without: Sequence[str]) -> bool:
    """Does a law of the air have states?"""
    return "aerodynamics" not in without and any(air.unsteady() for air in model.airs)


def air_matrices(
    snapshot: Snapshot, state: State, without: Sequence[str], held: np.ndarray | None = None, turn: Any = None
) -> dict[str, Any]:
    """E ``effect``, P ``by_place``, R ``by_rate``, A ``own``, ``value`` and ``rate`` of the states, at rest or ``held``."""
    with core_errors():
        found = snapshot.system.air_states(
            state.q,
            state.rate,
            list(without),
            state.acceleration.tolist(),
            turn,
            None if held is None else held.tolist(),
        )
    return {} if found is None else dict(found)


def blade_generator(snapshot: Snapshot, state: State, section: Sequence[int]) -> np.ndarray:
    """V (m, m) in rad/s of states that belong to these sections, in axes that stand: zero but for three or more equal blades."""
    owner = np.asarray(section, dtype=int)
    V = np.zeros((len(owner),) * 2)
    if not state.moving or not len(owner):
        return V
    time = np.array([state.t])
    place = flows(snapshot.system, time, state.q[None], state.rate[None], state.memory[None])[0][:, FLOW["centre"]]
    with core_errors():
        omega = np.asarray(snapshot.system.bodies(state.q, state.rate)["angular_velocity"])
    spin = omega[np.asarray(snapshot.tables["section_body"], dtype=int)]
    for ring in _rings(snapshot.model):
        made = _ring_generator(place[ring], spin[ring])
        if made is None:
            continue
        members = np.stack([np.flatnonzero(owner == one) for one in ring])  # (blades, states of one section)
        for own in members.T:
            V[np.ix_(own, own)] = made
    return V


def _rings(model: Any) -> Iterator[np.ndarray]:
    """Sections that equal blades have in the same place, by their numbers."""
    start = 0
    for air in model.airs:
        sizes = [len(blade["place"]) for blade in air.blades]
        first = start + np.concatenate([[0], np.cumsum(sizes)])[:-1]
        start += sum(sizes)
        if len(sizes) > 2 and len(set(sizes)) == 1:
            yield from (first.astype(int) + k for k in range(sizes[0]))


def _ring_generator(place: np.ndarray, spin: np.ndarray) -> np.ndarray | None:
    """V of one number for each of N places (N, 3) that turn with ``spin`` (N, 3); None where they are not evenly around an axis."""
    speed = float(np.linalg.norm(spin.mean(axis=0)))
    if speed == 0.0:
        return None
    a = spin.mean(axis=0) / speed
    arm = np.cross(place - place.mean(axis=0), a)
    e1 = arm[0] / max(float(np.linalg.norm(arm[0])), np.finfo(float).tiny)
    angle = np.arctan2(arm @ np.cross(a, e1), arm @ e1) % (2 * np.pi)
    n = len(place)
    angle[angle > 2 * np.pi * (1.0 - _EVEN / n)] -= 2 * np.pi
    order = np.argsort(angle)
    if np.max(np.abs(angle[order] * n / (2 * np.pi) - np.arange(n))) > _EVEN:
        return None
    # patterns cos k psi and sin k psi of (8.4), turning k times as fast as the blades
    k = np.arange(1, (n - 1) // 2 + 1)
    apart = 2 * np.pi * (np.arange(n)[:, None] - np.arange(n)) / n
    V = np.zeros((n, n))
    V[np.ix_(order, order)] = -2.0 * speed / n * (np.sin(apart[:, :, None] * k) @ k)
    return V
