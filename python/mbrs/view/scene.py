"""Geometry of a model for drawing: bodies, springs, joints, loads. World coordinates of the drawn state, metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .._lib.checks import real_array
from ..errors import ModelError

__all__ = ["BodyGeometry", "JointGeometry", "LinkGeometry", "LoadGeometry", "SceneGeometry", "Solid"]

# What an element is made of: each has a symbol of its own (`mbrs.view.symbols.GLYPHS`).
PARTS = ("spring", "damper", "gap", "law")


# Points nearer to each other than this share of the size of a picture were drawn as one: rounding parts them.
COINCIDE = 1e-9


@dataclass(frozen=True, eq=False)
class Solid:
    """A surface: ``vertices`` (n, 3), world, ``faces`` as loops of indices seen from outside, a colour "#rrggbb" or ""."""

    vertices: np.ndarray
    faces: Sequence[Sequence[int]]
    colour: str = ""


@dataclass(frozen=True, eq=False)
class BodyGeometry:
    """A body: ``origin`` (3,), ``rotation`` (3, 3) body to world, ``points`` (k, 3) where things are attached.

    ``solids``: its shape, where one was given; else it is drawn as the hull of its points. ``line`` (k, 3): the undeformed line of
    a flexible body.
    """

    name: str
    origin: Any
    rotation: Any = field(default_factory=lambda: np.eye(3))
    points: Any = field(default_factory=lambda: np.zeros((0, 3)))
    solids: tuple[Solid, ...] = ()
    line: Any = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", _finite(self.origin, (3,), f"origin of body {self.name!r}"))
        object.__setattr__(self, "rotation", _finite(self.rotation, (3, 3), f"rotation of body {self.name!r}"))
        for name in ("points", "line"):
            points = np.reshape(np.asarray(getattr(self, name), dtype=float), (-1, 3))
            object.__setattr__(self, name, _finite(points, points.shape, f"{name} of body {self.name!r}"))

    @property
    def rigid(self) -> np.ndarray:
        """(n, 3) points that move with the body as drawn: its origin, what is attached to it, its shape."""
        return np.vstack([self.origin, self.points, *(s.vertices for s in self.solids)])

    @property
    def extent(self) -> np.ndarray:
        """(n, 3) all points that the picture of the body reaches."""
        return np.vstack([self.rigid, self.line])


@dataclass(frozen=True, eq=False)
class LinkGeometry:
    """A spring from ``at_a`` (3,) on body ``a`` to ``at_b`` (3,) on body ``b``; a body of None is ground.

    ``parts``: what acts in it, of `PARTS`. ``axis`` (3,) of a torsion spring.
    """

    name: str
    a: str | None
    b: str | None
    at_a: Any
    at_b: Any
    kind: str = "spring_damper"
    parts: tuple[str, ...] = ("spring",)
    axis: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "at_a", _finite(self.at_a, (3,), f"first point of {self.name!r}"))
        object.__setattr__(self, "at_b", _finite(self.at_b, (3,), f"second point of {self.name!r}"))
        object.__setattr__(self, "axis", _direction(self.axis, f"axis of {self.name!r}"))


@dataclass(frozen=True, eq=False)
class JointGeometry:
    """A joint of type ``kind`` between ``a`` and ``b`` (None: ground), at ``at`` (3,) on ``a`` and ``at_b`` (3,) on ``b``.

    ``axis`` (3,), fixed in ``b`` as drawn; ``axis2`` (3,): of a universal joint and of a rolling disc; or None. ``parts``: what acts on
    its free coordinates.
    """

    name: str
    kind: str
    a: str | None
    b: str | None
    at: Any
    axis: Any = None
    at_b: Any = None
    axis2: Any = None
    radius: float = 0.0
    parts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _finite(self.at, (3,), f"point of joint {self.name!r}"))
        at_b = self.at if self.at_b is None else self.at_b
        object.__setattr__(self, "at_b", _finite(at_b, (3,), f"second point of joint {self.name!r}"))
        for name in ("axis", "axis2"):
            object.__setattr__(self, name, _direction(getattr(self, name), f"{name} of joint {self.name!r}"))

    @property
    def leader(self) -> str | None:
        """The body with which the symbol of the joint moves."""
        return self.b if self.b is not None else self.a

    @property
    def place(self) -> np.ndarray:
        """(3,) where the symbol is drawn: the point of the leader."""
        place: np.ndarray = self.at_b if self.b is not None else self.at
        return place


@dataclass(frozen=True, eq=False)
class LoadGeometry:
    """A load: "force" at ``at`` (3,) or "torque", on ``body``, along ``value`` (3,), N or N m.

    ``follows``: its direction turns with the body. ``varies``: in time; then ``value`` tells the direction alone, and is zero where that
    is not known before a Python function is called.
    """

    name: str
    kind: str
    body: str
    at: Any
    value: Any
    follows: bool = False
    varies: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _finite(self.at, (3,), f"point of load {self.name!r}"))
        object.__setattr__(self, "value", _finite(self.value, (3,), f"value of load {self.name!r}"))


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """Geometry that a viewer draws. Names of bodies are unique; all else names bodies of the scene, or None for ground.

    ``markers``: by name the body (None: ground) and the point (3,) of each, of which a viewer may draw the way. ``gravity`` (3,), m/s2,
    or None.
    """

    bodies: tuple[BodyGeometry, ...]
    links: tuple[LinkGeometry, ...] = ()
    joints: tuple[JointGeometry, ...] = ()
    markers: Mapping[str, tuple[str | None, np.ndarray]] = field(default_factory=dict)
    loads: tuple[LoadGeometry, ...] = ()
    gravity: Any = None

    def __post_init__(self) -> None:
        for name in ("bodies", "links", "joints", "loads"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        index = self.index
        if len(index) != len(self.bodies):
            raise ModelError("two bodies of the scene have the same name; give each body its own")
        attached: tuple[LinkGeometry | JointGeometry, ...] = (*self.links, *self.joints)
        ends = [(one.name, body) for one in attached for body in (one.a, one.b)]
        for name, body in [*ends, *((load.name, load.body) for load in self.loads)]:
            if body is not None and body not in index:
                raise ModelError(f"{name!r} refers to body {body!r}, which the scene does not contain")

    @property
    def index(self) -> dict[str | None, int]:
        """Place of each body by name."""
        return {body.name: i for i, body in enumerate(self.bodies)}

    @property
    def points(self) -> np.ndarray:
        """All located points, (n, 3). Loads do not count: a load has a point on its body and no size."""
        groups = [b.extent for b in self.bodies]
        groups += [np.vstack([link.at_a, link.at_b]) for link in self.links]
        groups += [np.vstack([joint.at, joint.at_b]) for joint in self.joints]
        return np.vstack(groups) if groups else np.zeros((1, 3))

    @property
    def size(self) -> float:
        """Diagonal of the box around all points, or 1 m where they coincide."""
        extent = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        return extent if extent > COINCIDE * float(np.max(np.abs(self.points))) else 1.0

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

        def carry(body: str | None, points: Any) -> Any:
            if body is None:
                return points
            i = index[body]
            return position[i] + (points - self.bodies[i].origin) @ turns[i].T

        def turn(body: str | None, direction: Any) -> Any:
            return direction if direction is None or body is None else turns[index[body]] @ direction

        bodies = tuple(
            replace(
                b,
                origin=position[i],
                rotation=rotation[i],
                points=carry(b.name, b.points),
                line=carry(b.name, b.line),
                solids=tuple(replace(s, vertices=carry(b.name, s.vertices)) for s in b.solids),
            )
            for i, b in enumerate(self.bodies)
        )
        links = tuple(
            replace(k, at_a=carry(k.a, k.at_a), at_b=carry(k.b, k.at_b), axis=turn(k.a, k.axis)) for k in self.links
        )
        joints = tuple(
            replace(
                j, at=carry(j.a, j.at), at_b=carry(j.b, j.at_b), axis=turn(j.leader, j.axis), axis2=turn(j.b, j.axis2)
            )
            for j in self.joints
        )
        loads = tuple(
            replace(f, at=carry(f.body, f.at), value=turn(f.body if f.follows else None, f.value)) for f in self.loads
        )
        markers = {name: (body, carry(body, point)) for name, (body, point) in self.markers.items()}
        return replace(self, bodies=bodies, links=links, joints=joints, markers=markers, loads=loads)


def _finite(value: Any, shape: tuple[int, ...], what: str) -> np.ndarray:
    return real_array(f"the {what}", value, shape)


def _direction(value: Any, what: str) -> np.ndarray | None:
    return None if value is None else _finite(value, (3,), what)
