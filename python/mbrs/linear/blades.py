"""Equal blades around a turning hub: multiblade coordinates as axes in which a steady motion is constant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._lib.border import core_errors
from ..system.tables import modal_places
from .multiblade import multiblade
from .turning_frames import VARIES, VARIES_AS_DRAWN, Frame, Tangent, Turn, fitted, rotation_about

# Azimuths and shapes of blades that agree to this part of a radian or of their size are those of equal, evenly spaced blades. Larger:
# unequal blades are tried in vain; smaller: drawn digits refuse equal ones. Pinned by tests/truth/test_steady_rotation.py.
_EQUAL = 1e-7


def constant_frame(turn: Turn) -> Frame:
    """The first of the fixed, the rotating, the joints' own and the multiblade axes in which everything is constant."""
    zero = np.zeros((len(turn.names),) * 2)
    tried: dict[str, Any] = {}
    for name in ("fixed", "rotating", "joint", "multiblade"):
        if name == "joint":
            T: list[np.ndarray] | None = [np.eye(len(turn.names))] * len(turn.tangents)
        elif name == "multiblade":
            T = blade_transformations(turn)
        else:
            T = turn.transformations(name)
        if T is None or any(t.shape != zero.shape for t in T):
            continue
        W = turn.generator(T)
        if W is None:
            continue
        varies, row = turn.variation(T, W)
        if varies <= max(VARIES, VARIES_AS_DRAWN * turn.snapshot.model.tolerance):
            return Frame(name, W, varies)
        tried[name] = (T, W, row)
    raise turn.refused(tried)


def blade_transformations(turn: Turn) -> list[np.ndarray] | None:
    """T at every angle of a turn with three or more equal blades: the hub in fixed axes, the blades in multiblade coordinates.

    Blades are the equal subtrees that one body carries, or equal bodies that it carries around elastically; None without them.
    """
    w = turn.axis
    first = turn.tangents[0]
    if w is None or any(len(t.M) != len(first.M) for t in turn.tangents):
        return None
    for blades in _blade_groups(turn):
        ordered = _evenly_spaced(turn, blades, w)
        if ordered is not None:
            made = [_blade_transformation(turn, tangent, ordered, w) for tangent in turn.tangents]
            if all(T is not None for T in made):
                back = np.linalg.inv(made[0])  # type: ignore[arg-type]
                return [T @ back for T in made]  # type: ignore[operator]
    return None


@dataclass(frozen=True)
class _Blade:
    """Its bodies and modal coordinates as rows of a `Tangent`, and its own coordinates."""

    bodies: tuple[int, ...]
    rows: np.ndarray
    places: np.ndarray


def _blade_groups(turn: Turn) -> Iterator[list[_Blade]]:
    """Sets of subtrees of equal structure around one body."""
    topology = turn.snapshot.system.topology()
    names = list(turn.snapshot.tables["body_name"])
    kinds = {body: kind for body, _, _, kind in topology["tree"]}
    inner = {body: parent for body, parent, _, _ in topology["tree"]}
    for name, _, carrier in turn.spin.carried:
        inner[name] = names[carrier]
    children: dict[str | None, list[str]] = {}
    for body, parent in inner.items():
        children.setdefault(parent, []).append(body)

    def subtree(body: str) -> list[str]:
        return [body] + [b for child in children.get(body, ()) for b in subtree(child)]

    for parent, around in children.items():
        if parent is None:
            continue
        shapes: dict[tuple[str, ...], list[_Blade]] = {}
        for child in around:
            members = subtree(child)
            key = tuple(kinds[b] for b in members)
            shapes.setdefault(key, []).append(_blade(turn, topology, members))
        for blades in shapes.values():
            if len(blades) > 2 and len({len(b.places) for b in blades}) == 1 and len(blades[0].places):
                yield blades


def _blade(turn: Turn, topology: Any, members: list[str]) -> _Blade:
    names = list(turn.snapshot.tables["body_name"])
    stems = {joint or body for body, _, joint, _ in topology["tree"] if body in members}
    bodies = tuple(names.index(b) for b in members)
    rows = [6 * b + k for b in bodies for k in range(6)]
    for body, own in modal_places(turn.snapshot.tables):
        if body in bodies:
            rows += [6 * len(names) + k for k in range(own.start, own.stop)]
            stems.add(names[body])
    places = [i for i, c in enumerate(turn.names) if c in stems or c.rpartition(".")[0] in stems]
    return _Blade(bodies, np.array(rows, dtype=int), np.array(places, dtype=int))


def _evenly_spaced(turn: Turn, blades: list[_Blade], w: np.ndarray) -> list[_Blade] | None:
    """In the sense of the rotation, or None."""
    a = w / np.linalg.norm(w)
    with core_errors():
        moved = turn.snapshot.system.bodies(turn.state.q, turn.state.rate)
    centre = []
    for blade in blades:
        # the velocity of each body tells its arm from the axis, w x arm
        velocity = moved["velocity"][list(blade.bodies)] + np.cross(
            moved["angular_velocity"][list(blade.bodies)], np.einsum("bij,bj->bi", moved["rotation"][list(blade.bodies)],
                                                                     turn.spin.com[list(blade.bodies)])
        )  # fmt: skip
        centre.append(np.cross(velocity.sum(axis=0), a) / np.linalg.norm(w))
    size = float(np.linalg.norm(centre[0]))
    if size == 0.0:
        return None
    e1 = centre[0] / size
    e2 = np.cross(a, e1)
    angle = np.array([np.arctan2(c @ e2, c @ e1) for c in centre]) % (2 * np.pi)
    angle[angle > 2 * np.pi - _EQUAL] = 0.0
    order = np.argsort(angle)
    n = len(blades)
    if np.max(np.abs(angle[order] - 2 * np.pi * np.arange(n) / n)) > _EQUAL:
        return None
    return [blades[i] for i in order]


def _blade_transformation(turn: Turn, tangent: Tangent, blades: list[_Blade], w: np.ndarray) -> np.ndarray | None:
    """y = T z: hub coordinates as they are in fixed axes, blades from a_0, a_1, b_1, ..."""
    first, n, s = turn.tangents[0], len(blades), turn.scale
    size = float(np.linalg.norm(w))
    T = np.zeros_like(tangent.M)
    inside = np.concatenate([b.places for b in blades])
    outside = np.setdiff1d(np.arange(len(T)), inside)
    rows = np.setdiff1d(np.arange(len(tangent.rows)), np.concatenate([b.rows for b in blades]))
    inner = turn.target("fixed", tangent, outside_of=[b.bodies for b in blades])
    if inner is None:
        return None
    B = inner[np.ix_(rows, rows)]
    hub = fitted(tangent.rows[np.ix_(rows, outside)] * s[outside], B @ first.rows[np.ix_(rows, outside)] * s[outside])
    if hub is None:
        return None
    T[np.ix_(outside, outside)] = hub * s[outside][:, None] / s[outside][None, :]
    psi = 2 * np.pi * np.arange(n) / n + size * tangent.t
    patterns = multiblade(np.eye(n), np.broadcast_to(psi, (n, n)), inverse=True).T  # q = patterns a
    pilot = blades[0]
    for i, blade in enumerate(blades):
        # the first blade's shapes, turned to this blade's place
        R = rotation_about(w, tangent.t + 2 * np.pi * i / n / size)
        turned = np.eye(len(pilot.rows))
        for k in range(2 * len(pilot.bodies)):
            turned[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = R
        own = fitted(
            tangent.rows[np.ix_(blade.rows, blade.places)] * s[blade.places],
            turned @ first.rows[np.ix_(pilot.rows, pilot.places)] * s[pilot.places],
        )
        if own is None:
            return None
        own = own * s[blade.places][:, None] / s[pilot.places][None, :]
        for j in range(n):
            T[np.ix_(blade.places, blades[j].places)] = own * patterns[i, j]
    return T
