"""What there is to draw of a model: bodies, springs, joints. World coordinates of the drawn state, metres."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import ModelError
from ..model.schema import BODY, COUPLER, ELEMENTS, JOINTS, LOADS, MARKER

__all__ = ["BodyGeometry", "JointGeometry", "LinkGeometry", "SceneGeometry", "scene_from_tables"]

_JOINTS = {kind.code: kind.type for kind in JOINTS.values()}
_ELEMENTS = {kind.code: kind for kind in ELEMENTS.values()}
_JOINT = JOINTS["revolute"].block


@dataclass(frozen=True, eq=False)
class BodyGeometry:
    """A rigid body: ``origin`` (3,), ``rotation`` (3, 3) body to world, ``points`` (k, 3) where things are attached."""

    name: str
    origin: Any
    rotation: Any = field(default_factory=lambda: np.eye(3))
    points: Any = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", _finite(self.origin, (3,), f"origin of body {self.name!r}"))
        object.__setattr__(self, "rotation", _finite(self.rotation, (3, 3), f"rotation of body {self.name!r}"))
        points = np.reshape(np.asarray(self.points, dtype=float), (-1, 3))
        object.__setattr__(self, "points", _finite(points, points.shape, f"points of body {self.name!r}"))


@dataclass(frozen=True, eq=False)
class LinkGeometry:
    """A spring from ``at_a`` (3,) on body ``a`` to ``at_b`` (3,) on body ``b``; a body of None is ground."""

    name: str
    a: str | None
    b: str | None
    at_a: Any
    at_b: Any
    kind: str = "spring_damper"

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_a", _finite(self.at_a, (3,), f"first point of {self.name!r}"))
        object.__setattr__(self, "at_b", _finite(self.at_b, (3,), f"second point of {self.name!r}"))


@dataclass(frozen=True, eq=False)
class JointGeometry:
    """A joint of type ``kind`` between ``a`` and ``b`` (None: ground) at ``at`` (3,), with ``axis`` (3,) or None."""

    name: str
    kind: str
    a: str | None
    b: str | None
    at: Any
    axis: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _finite(self.at, (3,), f"point of joint {self.name!r}"))
        if self.axis is not None:
            object.__setattr__(self, "axis", _finite(self.axis, (3,), f"axis of joint {self.name!r}"))


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """What a viewer draws. Names of bodies are unique; links and joints name bodies of the scene or None for ground."""

    bodies: tuple[BodyGeometry, ...]
    links: tuple[LinkGeometry, ...] = ()
    joints: tuple[JointGeometry, ...] = ()

    def __post_init__(self) -> None:
        for name in ("bodies", "links", "joints"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        index = self.index
        if len(index) != len(self.bodies):
            raise ModelError("two bodies of the scene have the same name; give each body its own")
        attached: tuple[LinkGeometry | JointGeometry, ...] = (*self.links, *self.joints)
        for one in attached:
            for body in (one.a, one.b):
                if body is not None and body not in index:
                    raise ModelError(f"{one.name!r} refers to body {body!r}, which the scene does not contain")

    @property
    def index(self) -> dict[str | None, int]:
        """Place of each body by name."""
        return {body.name: i for i, body in enumerate(self.bodies)}

    @property
    def points(self) -> np.ndarray:
        """All located points, (n, 3)."""
        groups = [np.vstack([b.origin, b.points]) for b in self.bodies]
        groups += [np.vstack([link.at_a, link.at_b]) for link in self.links]
        groups += [joint.at[None, :] for joint in self.joints]
        return np.vstack(groups) if groups else np.zeros((1, 3))

    @property
    def size(self) -> float:
        """Diagonal of the box around all points, or 1 m where they coincide."""
        extent = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        return extent if extent > 0.0 else 1.0

    def moved(self, position: Any, rotation: Any) -> SceneGeometry:
        """The scene in another state, with everything that is attached to a body carried along.

        Parameters
        ----------
        position, rotation
            (n_bodies, 3) origins and (n_bodies, 3, 3) body to world, bodies in the order of ``bodies``.
        """
        position, rotation = np.asarray(position, dtype=float), np.asarray(rotation, dtype=float)
        n = len(self.bodies)
        if position.shape != (n, 3) or rotation.shape != (n, 3, 3):
            raise ModelError(f"moved needs positions ({n}, 3) and rotations ({n}, 3, 3) of the {n} bodies of the scene")
        index = self.index
        turns = [r @ body.rotation.T for r, body in zip(rotation, self.bodies, strict=True)]

        def carry(body: str | None, points: np.ndarray) -> np.ndarray:
            if body is None:
                return points
            i = index[body]
            return position[i] + (points - self.bodies[i].origin) @ turns[i].T

        def turn(joint: JointGeometry) -> Any:
            leader = joint.b if joint.b is not None else joint.a
            return joint.axis if joint.axis is None or leader is None else turns[index[leader]] @ joint.axis

        bodies = tuple(
            BodyGeometry(b.name, position[i], rotation[i], carry(b.name, b.points)) for i, b in enumerate(self.bodies)
        )
        links = tuple(replace(k, at_a=carry(k.a, k.at_a), at_b=carry(k.b, k.at_b)) for k in self.links)
        joints = tuple(replace(j, at=carry(j.b if j.b is not None else j.a, j.at), axis=turn(j)) for j in self.joints)
        return SceneGeometry(bodies, links, joints)


def scene_from_tables(tables: Mapping[str, Any]) -> SceneGeometry:
    """What there is to draw of the Tables of a model (docs/tables.md), in its drawn state.

    Every joint, element, marker and load counts as an attachment point of the bodies it acts on. O(number of objects).

    Parameters
    ----------
    tables
        The dict of flat arrays that a `Model` compiles to.
    """
    x = np.asarray(tables["x"], dtype=float)
    names = [str(name) for name in tables["body_name"]]
    attached: list[list[np.ndarray]] = [[] for _ in names]

    def attach(body: int, point: np.ndarray) -> str | None:
        if body < 0:
            return None
        attached[body].append(point)
        return names[body]

    links = tuple(_links(tables, x, attach))
    joints = tuple(_joints(tables, x, attach))
    for body, rim in _rims(tables, x):
        attached[body].extend(rim)
    for kind in ("marker", "load"):
        place = (MARKER if kind == "marker" else LOADS["force"]).block.slice("at")
        for body, start in zip(tables.get(f"{kind}_body", ()), tables.get(f"{kind}_x", ()), strict=True):
            attach(int(body), x[start:][place])
    at, orientation = BODY.block.slice("at"), BODY.block.slice("orientation")
    bodies = tuple(
        BodyGeometry(
            name, x[start:][at], _matrix(x[start:][orientation]), np.reshape(points, (-1, 3)) if points else ()
        )
        for name, start, points in zip(names, tables["body_x"], attached, strict=True)
    )
    return SceneGeometry(bodies, links, joints)


def _rims(tables: Mapping[str, Any], x: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Bodies that are round, with points of their rims: rolling discs, and what turns in a hinge that drives a rack."""
    kinds, starts, second = tables["joint_type"], tables["joint_x"], tables["joint_b"]
    for j, start in enumerate(starts):
        if _JOINTS[int(kinds[j])] == "rolling_disc" and second[j] >= 0:
            n, block = x[start:], JOINTS["rolling_disc"].block
            yield int(second[j]), _circle(n[block.slice("at_b")], n[block.slice("axis2")], n[block.place("radius")])
    keys = ("first", "second", "x")
    for a, b, place in zip(*(tables.get(f"coupler_{k}", ()) for k in keys), strict=True):
        if (_JOINTS[int(kinds[a])], _JOINTS[int(kinds[b])]) == ("revolute", "prismatic") and second[a] >= 0:
            start = starts[a]
            axis = _joint_axis(x, start, tables["joint_flags"][a])
            centre, ratio = x[start:][_JOINT.slice("at_a")], x[place + COUPLER.block.place("ratio")]
            yield int(second[a]), _circle(centre, axis, abs(ratio))


def _circle(centre: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """(24, 3) points of a circle; none where there is no axis or radius."""
    length = float(np.linalg.norm(axis))
    if not (np.isfinite(length * radius) and length * radius > 0.0):
        return np.zeros((0, 3))
    across = np.linalg.svd((axis / length)[None, :])[2][1:]
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    return centre + radius * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1])


def _joint_axis(x: np.ndarray, start: int, flags: int) -> np.ndarray:
    n = x[start:]
    if int(flags) & _JOINT.fields["orientation"].bit:
        return _matrix(n[_JOINT.slice("orientation")])[:, 2]
    return n[_JOINT.slice("axis")]


def _links(tables: Mapping[str, Any], x: np.ndarray, attach: Any) -> Any:
    keys = ("name", "type", "a", "b", "x")
    for name, kind, a, b, start in zip(*(tables.get(f"element_{k}", ()) for k in keys), strict=True):
        block = _ELEMENTS[int(kind)].block
        at_a = x[start:][block.slice("at_a" if "at_a" in block.fields else "at")]
        at_b = x[start:][block.slice("at_b")] if "at_b" in block.fields else at_a  # a torsion spring acts at one point
        yield LinkGeometry(str(name), attach(int(a), at_a), attach(int(b), at_b), at_a, at_b, _ELEMENTS[int(kind)].type)


def _joints(tables: Mapping[str, Any], x: np.ndarray, attach: Any) -> Any:
    keys = ("name", "type", "a", "b", "flags", "x")
    for name, kind, a, b, flags, start in zip(*(tables.get(f"joint_{k}", ()) for k in keys), strict=True):
        at_a, at_b = x[start:][_JOINT.slice("at_a")], x[start:][_JOINT.slice("at_b")]
        axis = _joint_axis(x, start, flags)
        usable = np.all(np.isfinite(axis)) and np.any(axis != 0.0)
        yield JointGeometry(
            str(name), _JOINTS[int(kind)], attach(int(a), at_a), attach(int(b), at_b), at_a, axis if usable else None
        )


def _matrix(quaternion: Any) -> np.ndarray:
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    v = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * (w * v + v @ v)


def _finite(value: Any, shape: tuple[int, ...], what: str) -> np.ndarray:
    value = np.asarray(value, dtype=float)
    if value.shape != shape or not np.all(np.isfinite(value)):
        raise ModelError(f"the {what} must be {shape} finite numbers, got shape {value.shape}")
    return value
