"""Geometry of a model for drawing: bodies, springs, joints. World coordinates of the drawn state, metres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import ModelError

__all__ = ["BodyGeometry", "JointGeometry", "LinkGeometry", "SceneGeometry"]


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
    """Geometry that a viewer draws. Names of bodies are unique; links and joints name bodies of the scene or None for ground.

    ``markers``: by name the body (None: ground) and the point (3,) of each, of which a viewer may draw the way.
    """

    bodies: tuple[BodyGeometry, ...]
    links: tuple[LinkGeometry, ...] = ()
    joints: tuple[JointGeometry, ...] = ()
    markers: Mapping[str, tuple[str | None, np.ndarray]] = field(default_factory=dict)

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
        markers = {name: (body, carry(body, point)) for name, (body, point) in self.markers.items()}
        return SceneGeometry(bodies, links, joints, markers)


def _finite(value: Any, shape: tuple[int, ...], what: str) -> np.ndarray:
    value = np.asarray(value, dtype=float)
    if value.shape != shape or not np.all(np.isfinite(value)):
        raise ModelError(f"the {what} must be {shape} finite numbers, got shape {value.shape}")
    return value
