"""Bodies that turn in a steady motion: those that are driven, and those that elastic elements carry around with them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._lib.border import core_errors
from ..errors import ModelError
from ..model.schema import BODY
from ..system.snapshot import Snapshot
from .strains import strains_at

# Rates of strain that count as rounding, over the terms that they are made of: free of units. Larger: a spring that is wound up
# slowly passes for a steady motion; smaller: rounding of drawn points refuses one. Pinned by tests/truth/test_steady_rotation.py.
GROWS = 1e-10
# Singular values over the largest below which rates of strain have no rank. Larger: stiff chains keep rates that wind them up; smaller:
# rounding of drawn points turns loose parts.
_NO_RANK = 1e-11


def free_bodies(topology: dict[str, Any]) -> dict[str, int]:
    """First coordinate of each body that no joint attaches: x, y, z, rx, ry, rz of its centre of mass in world axes."""
    names, out = list(topology["coordinates"]), {}
    for body, inner, joint, kind in topology["tree"]:
        if joint is None and inner is None and kind == "free" and f"{body}.x" in names:
            out[body] = names.index(f"{body}.x")
    return out


@dataclass(frozen=True)
class Spin:
    """Rates of a steady motion as a function of where its bodies are.

    ``rate`` (n_tree,) of the coordinates, constant but for those of bodies that are carried around off the axis: ``carried`` names
    each with its first coordinate and the index of the body it follows. ``free`` holds the first coordinates of those whose velocity
    turns with them (that of a wheel that rolls does not).
    """

    snapshot: Snapshot
    rate: np.ndarray
    free: tuple[int, ...]
    carried: tuple[tuple[str, int, int], ...] = ()
    com: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates and accelerations (n_tree,) of the tree coordinates in a configuration."""
        rate = self.rate.copy()
        if self.carried:
            with core_errors():
                now = self.snapshot.system.bodies(q, self.rate)
            names = list(self.snapshot.tables["body_name"])
            for name, first, carrier in self.carried:
                own = names.index(name)
                centre = now["position"][own] + now["rotation"][own] @ self.com[own]
                w = now["angular_velocity"][carrier]
                rate[first : first + 3] = now["velocity"][carrier] + np.cross(w, centre - now["position"][carrier])
                rate[first + 3 : first + 6] = w
        return rate, self.acceleration(rate)

    def acceleration(self, rate: np.ndarray) -> np.ndarray:
        """w x v of bodies without a joint; zero for all other coordinates."""
        out = np.zeros_like(rate)
        for first in self.free:
            out[first : first + 3] = np.cross(rate[first + 3 : first + 6], rate[first : first + 3])
        return out

    def later(self, rate: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Increments of the tree coordinates after the time t, and the rates then."""
        step, now = rate * t, rate.copy()
        for first in self.free:
            v, w = rate[first : first + 3], rate[first + 3 : first + 6]
            size = float(np.linalg.norm(w))
            if size > 0.0:
                axis, angle = w / size, size * t
                along = axis * (axis @ v)
                across, turned = v - along, np.cross(axis, v)
                step[first : first + 3] = along * t + (np.sin(angle) * across + (1.0 - np.cos(angle)) * turned) / size
                now[first : first + 3] = along + np.cos(angle) * across + np.sin(angle) * turned
        return step, now


def tree_twists(snapshot: Snapshot, q: np.ndarray) -> np.ndarray:
    """(n_bodies, 6, n_tree): twist of each body's origin per rate of a tree coordinate, world axes."""
    n = snapshot.system.n_tree
    columns = []
    for i in range(n):
        with core_errors():
            moved = snapshot.system.bodies(q, np.eye(n)[i])
        columns.append(np.concatenate([moved["velocity"], moved["angular_velocity"]], axis=1))
    return np.stack(columns, axis=2) if columns else np.zeros((0, 6, 0))


@dataclass(frozen=True)
class ElementRows:
    """Rates of the forces of one elastic element over the rates of the tree coordinates, rows of natural length one."""

    name: str
    bodies: tuple[int, int]
    rows: np.ndarray


def element_rows(snapshot: Snapshot, q: np.ndarray, twists: np.ndarray, without: Sequence[str]) -> list[ElementRows]:
    """One entry per element (or joint with springs) that resists some motion in this configuration."""
    with core_errors():
        position = snapshot.system.bodies(q, np.zeros(0))["position"]
    made = strains_at(snapshot, q, without, twists.reshape(-1, twists.shape[2]), position)
    natural, out = np.array([snapshot.system.characteristic_length] * 3 + [1.0] * 3), []
    for name, bodies, own, k in zip(made.names, made.bodies, made.own, made.stiffness, strict=True):
        terms = np.abs(k) @ np.abs(made.gradients[own]) @ natural
        kept = terms > 0.0
        if np.any(kept):
            rows = k @ made.rows[own]
            out.append(ElementRows(name, (int(bodies[0]), int(bodies[1])), rows[kept] / terms[kept, None]))
    return out


def spin_of(
    snapshot: Snapshot, q: np.ndarray, rate: np.ndarray, driven: Collection[int], without: Sequence[str]
) -> Spin:
    """The rates with which no elastic force grows: bodies without a joint follow first, then all coordinates that are not driven.

    Raises a ModelError that names the element where something that turns is tied to something at rest.
    """
    topology = snapshot.system.topology()
    free = free_bodies(topology)
    t = snapshot.tables
    com = np.array([t["x"][start:][BODY.block.slice("com")] for start in t["body_x"]]).reshape(-1, 3)
    base = Spin(snapshot, rate, (), com=com)
    if not np.any(rate):
        return base
    twists = tree_twists(snapshot, q)
    elements = element_rows(snapshot, q, twists, without)
    length = snapshot.system.characteristic_length
    scale = np.array([length] * 3 + [1.0] * 3)
    size = float(np.max(np.abs(np.einsum("bij,j->bi", twists, rate)) / scale, initial=0.0))
    growth = [float(np.max(np.abs(e.rows @ rate), initial=0.0)) for e in elements]
    if max(growth, default=0.0) <= GROWS * size:
        return base
    with core_errors():
        hard = snapshot.system.rows(q, rate, 0.0, list(without))
    stacked = np.vstack([e.rows for e in elements] + [hard["jacobian"]])
    right = np.concatenate([e.rows @ rate for e in elements] + [hard["rates"]])
    modal = _modal_coordinates(snapshot)
    loose = [first + k for first in free.values() for k in range(6)]
    columns = np.max(np.abs(twists) / scale[None, :, None], axis=(0, 1))
    for allowed in (loose, range(len(rate))):
        places = [i for i in allowed if i not in driven and i not in modal and columns[i] > 0.0]
        found = np.linalg.lstsq(stacked[:, places] / columns[places], -right, rcond=_NO_RANK)[0]
        made = rate.copy()
        made[places] += found / columns[places]
        made[np.abs(made) * columns < GROWS * size] = 0.0
        worst = max(elements, key=lambda e: float(np.max(np.abs(e.rows @ made), initial=0.0)))
        if float(np.max(np.abs(worst.rows @ made))) <= GROWS * size:
            return _with_carriers(base, twists, made, free, driven, q)
    raise _tied(snapshot, elements, twists, made, GROWS * size)


def _tied(
    snapshot: Snapshot, elements: Sequence[ElementRows], twists: np.ndarray, rate: np.ndarray, rounding: float
) -> ModelError:
    """Name an element to ground rather than one between bodies that both could follow."""
    names = [*snapshot.tables["body_name"], "ground"]
    moves = np.einsum("bij,j->bi", twists, rate)
    growth = [float(np.max(np.abs(e.rows @ rate), initial=0.0)) for e in elements]

    def order(i: int) -> tuple[bool, float]:
        return (min(elements[i].bodies) < 0, growth[i])

    worst = elements[max((i for i, g in enumerate(growth) if g > rounding), key=order)]
    a, b = worst.bodies
    slow = a < 0 or (b >= 0 and np.linalg.norm(moves[a, 3:]) < np.linalg.norm(moves[b, 3:]))
    turning, standing = (names[b], names[a]) if slow else (names[a], names[b])
    return ModelError(
        f"no steady motion: {worst.name!r} ties {turning!r}, which turns, to {standing!r}, which does not turn with it, and its "
        f"force would grow with every turn; set its stiffness about the axis to zero, attach it to a body in which {turning!r} turns "
        "(a revolute joint), or drive both"
    )


def _modal_coordinates(snapshot: Snapshot) -> set[int]:
    n_modal = int(np.sum(snapshot.tables.get("flexible_modes", ())))
    n = snapshot.system.n_tree
    return set(range(n - n_modal, n))


def _with_carriers(
    base: Spin,
    twists: np.ndarray,
    rate: np.ndarray,
    free: dict[str, int],
    driven: Collection[int],
    q: np.ndarray,
) -> Spin:
    """Spin in which each carried body follows the first of the others that moves as one rigid body with it."""
    names = list(base.snapshot.tables["body_name"])
    with core_errors():
        place = base.snapshot.system.bodies(q, np.zeros(0))["position"]
    moves = np.einsum("bij,j->bi", twists, rate)
    changed = [
        n for n, f in free.items() if np.any(rate[f : f + 6] != base.rate[f : f + 6]) and np.any(rate[f + 3 : f + 6])
    ]
    length = base.snapshot.system.characteristic_length
    carried = []
    for name in changed:
        own = names.index(name)
        size = float(np.linalg.norm(moves[own, 3:]))
        for other in range(len(names)):
            if names[other] in changed or names[other].partition(".")[0] in changed:
                continue
            miss = moves[own] - moves[other]
            miss[:3] -= np.cross(moves[other, 3:], place[own] - place[other])
            if np.all(np.abs(miss[:3]) <= 1e3 * GROWS * size * length) and np.all(
                np.abs(miss[3:]) <= 1e3 * GROWS * size
            ):
                carried.append((name, free[name], other))
                break
    return Spin(base.snapshot, rate, tuple(free[name] for name in changed), tuple(carried), base.com)
