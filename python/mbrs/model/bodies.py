"""Rigid bodies, ground and markers."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InertiaError, MbrsWarning, ModelError
from .book import Field, Item, plain, single
from .expressions import Expression
from .names import GROUND, problem, shown
from .numbers import Number, array, numbers, scalar, shape_of, vector
from .ports import Port, make_port
from .rotations import quaternion

if TYPE_CHECKING:
    from .model import Model

# Triangle inequality and definiteness of the inertia, relative to its largest principal moment.
_INERTIA_TOLERANCE = 1e-9
_NO = (0.0, 0.0, 0.0)
# Order of the six numbers in Tables: xx yy zz xy xz yz.
INERTIA_PLACE = ((0, 3, 4), (3, 1, 5), (4, 5, 2))


class Ported(Item):
    """What has ports: loads enter here and motions are read here."""

    __slots__ = ()

    def _home(self) -> tuple[str, str | None]:
        raise AssertionError("a ported item names its body")

    def _port(self, kind: Any, direction: Any, at: Any) -> Port:
        body, marker = self._home()
        if body == GROUND:
            raise ModelError(f"{self.name}.{kind} has no effect: ground does not move. Use a body, or mb.base_motion")
        return make_port(kind, self.name, body, marker, direction, at)


class NodePlace:
    """Base of the nodes of flexible bodies, which stand where bodies may."""

    __slots__ = ()


class Body(Ported):
    """Handle of a rigid body; see `Model.body`."""

    __slots__ = ()
    store = "body"
    kind = "body"

    @property
    def size(self) -> int:
        return 23

    def _home(self) -> tuple[str, str | None]:
        return self.name, None

    def force(self, direction: Any, at: Any = None) -> Port:
        """A unit force along "x", "-y", ... or a vector (3,), world axes, at the body's origin or the world point
        ``at``.
        """
        return self._port("force", direction, at)

    def torque(self, direction: Any) -> Port:
        """A unit torque about "x", "-y", ... or a vector (3,), world axes."""
        return self._port("torque", direction, None)

    def motion(self, direction: Any, at: Any = None) -> Port:
        """Displacement along "x", ... or rotation about "rx", ..., world axes, of the origin or of the material point
        ``at``.
        """
        return self._port("motion", direction, at)

    def check(self, values: Sequence[float]) -> None:
        _check_norm(self.name + ".orientation", values[3:7])
        mass = values[10]
        if not mass > 0.0:
            raise problem(
                self.name + ".mass",
                f"must be positive, got {mass:g}; a massless body has no motion of its own: "
                "attach its springs to the neighbour, or give it its small mass",
                InertiaError,
            )
        _check_inertia(self.name + ".inertia", values[11:17])

    def fields(self) -> dict[str, Field]:
        s = self.start
        order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        return {
            "at": plain(s, 3, "m"),
            "orientation": Field(tuple((s + 3 + i,) for i in range(4)), (4,), ("rad",) * 3, "orientation"),
            "com": plain(s + 7, 3, "m"),
            "mass": single(s + 10, "kg"),
            "inertia": plain(s + 11, len(order), "kg m2"),
            "velocity": plain(s + 17, 3, "m/s"),
            "angular_velocity": plain(s + 20, 3, "rad/s"),
        }


class Ground(Ported):
    """The fixed world, as a body to attach things to. Its index is -1."""

    __slots__ = ()
    store = "body"
    kind = "ground"

    def _home(self) -> tuple[str, str | None]:
        return GROUND, None

    def force(self, direction: Any, at: Any = None) -> Port:
        """An error: ground does not move."""
        return self._port("force", direction, at)

    def torque(self, direction: Any) -> Port:
        """An error: ground does not move."""
        return self._port("torque", direction, None)

    def motion(self, direction: Any, at: Any = None) -> Port:
        """An error that points to `mbrs.base_motion`."""
        return self._port("motion", direction, at)

    def __repr__(self) -> str:
        return f"<ground of {self.model.name!r}>"


class Marker(Ported):
    """Handle of a named point (with axes) of a body; see `Model.marker`."""

    __slots__ = ("body", "node")
    body: int
    node: int  # of a flexible body, else -1
    store = "marker"
    kind = "marker"

    @property
    def size(self) -> int:
        return 7

    def _home(self) -> tuple[str, str | None]:
        return self.model.frame_name(self.body, self.node), self.name

    def force(self, direction: Any) -> Port:
        """A unit force at the marker along "x", "-y", ... or a vector (3,), world axes."""
        return self._port("force", direction, None)

    def torque(self, direction: Any) -> Port:
        """A unit torque on the marker's body, world axes."""
        return self._port("torque", direction, None)

    def motion(self, direction: Any) -> Port:
        """Displacement of the marker along "x", ... or rotation about "rx", ..., world axes."""
        return self._port("motion", direction, None)

    def check(self, values: Sequence[float]) -> None:
        _check_norm(self.name + ".orientation", values[3:7])

    def fields(self) -> dict[str, Field]:
        s = self.start
        return {
            "at": plain(s, 3, "m"),
            "orientation": Field(tuple((s + 3 + i,) for i in range(4)), (4,), ("rad",) * 3, "orientation"),
        }


class Pose(Item):
    """A first guess of where assembly puts a body: origin (3) and orientation (4)."""

    __slots__ = ("body",)
    body: int
    store = "pose"
    kind = "pose"

    @property
    def size(self) -> int:
        return 7

    def check(self, values: Sequence[float]) -> None:
        _check_norm(self.name + ".pose", values[3:7])


def body_numbers(
    name: str, mass: Any, inertia: Any, at: Any, com: Any, orientation: Any, velocity: Any, angular_velocity: Any
) -> list[Number]:
    """The 23 numbers of a body in the order of Tables."""
    return [
        *vector(at, name + ".at"),
        *quaternion(orientation, name + ".orientation"),
        *(_NO if com is None else vector(com, name + ".com")),
        scalar(mass, name + ".mass"),
        *inertia_numbers(inertia, name + ".inertia"),
        *(_NO if velocity is None else vector(velocity, name + ".velocity")),
        *(_NO if angular_velocity is None else vector(angular_velocity, name + ".angular_velocity")),
    ]


def inertia_numbers(value: Any, where: str) -> list[Number]:
    """xx yy zz xy xz yz from three principal moments or a symmetric matrix."""
    if type(value) is tuple and len(value) == 3 and type(value[0]) is float:
        return [*array(value, (3,), where), *_NO]
    shape = shape_of(value)
    if shape == (3,):
        return [*array(value, (3,), where), *_NO]
    if shape != (3, 3):
        raise problem(
            where, f"must be (3,) principal moments or a symmetric (3, 3) tensor, got {shown(value)}", InertiaError
        )
    flat = array(value, (3, 3), where)
    plain_ = np.array(numbers(flat)).reshape(3, 3)
    if np.abs(plain_ - plain_.T).max() > _INERTIA_TOLERANCE * max(np.abs(plain_).max(), 1e-300):
        raise problem(where, "must be a symmetric tensor: entries [i,j] and [j,i] differ", InertiaError)
    out = [flat[0], flat[4], flat[8]]
    for upper, lower in ((1, 3), (2, 6), (5, 7)):
        # Of a symmetric pair the entry that is an expression is meant.
        out.append(flat[lower] if isinstance(flat[lower], Expression) else flat[upper])
    return out


def _check_norm(where: str, q: Sequence[float]) -> None:
    if not math.hypot(*q) > 0.0:
        raise problem(where, "must not be a zero quaternion; (1, 0, 0, 0) is no rotation")


def _check_inertia(where: str, j: Sequence[float]) -> None:
    if j[3] == 0.0 == j[4] and j[5] == 0.0:
        low, middle, high = sorted(j[:3])
    else:
        tensor = np.array([[j[p] for p in row] for row in INERTIA_PLACE])
        low, middle, high = (float(v) for v in np.linalg.eigvalsh(tensor))
    slack = _INERTIA_TOLERANCE * max(abs(low), abs(high))
    if low < -slack:
        raise problem(
            where, f"has a negative principal moment, {low:g} kg m2; moments are never negative", InertiaError
        )
    if high <= low + middle + slack:
        return
    if j[0] == 0.0 == j[1] and not any(j[3:]):
        warnings.warn(
            f"{where} (0, 0, {j[2]:g}) is planar data: no rigid body has it, and it serves only if the joints "
            "allow no rotation about x and y",
            MbrsWarning,
            stacklevel=6,
        )
        return
    raise problem(
        where,
        f"has principal moments {low:g}, {middle:g}, {high:g}: the largest exceeds the sum of the others, which no "
        "body can have. Check units, the sign of products of inertia, and that it is about the centre of mass",
        InertiaError,
    )


def add_body(model: Model, name: Any, pose: Any, **given: Any) -> Body:
    """Check and add a body."""
    body = Body(model, model.new_name("body", name))
    entries = body_numbers(body.name, **given)
    guess = None
    if pose is not None:
        guess = Pose(model, body.name)
        if not isinstance(pose, (list, tuple)) or len(pose) != 2:
            raise problem(
                name + ".pose", "must be (origin, orientation): a point (3,) and a quaternion (4,) or matrix (3, 3)"
            )
        pose_entries = [*vector(pose[0], name + ".pose"), *quaternion(pose[1], name + ".pose")]
        guess.check(guess.evaluated(pose_entries))
    body.put(entries)
    body.index = len(model.bodies)
    if guess is not None:
        guess.body = body.index
        guess.put(pose_entries)
        model.poses.append(guess)
    model.register(body, model.bodies)
    return body


def add_marker(model: Model, name: Any, body: Any, at: Any, orientation: Any) -> Marker:
    """Check and add a marker."""
    marker = Marker(model, model.new_name("marker", name))
    (place,), at = model.places(f"marker {name!r}", (("body", body),), at, name + ".at")
    marker.body, marker.node = place.body, place.node
    marker.put([*vector(at, name + ".at"), *quaternion(orientation, name + ".orientation")])
    model.register(marker, model.markers)
    return marker
