"""Rigid bodies, ground and markers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._lib.warning import warn_user
from ..errors import InertiaError, ModelError
from .aliases import Axis, BodyLike, Matrix, PoseLike, Rotation, Scalar, Vector, Vector3
from .argument_checks import INERTIA_TOLERANCE, pack
from .attach import places
from .book import Attachable, Book, Item
from .names import GROUND, problem, shown
from .numbers import Number
from .ports import Port, make_port
from .schema import BODY, MARKER, POSE, Kind
from .shapes import ShapeLike, shapes

# Order of the six numbers in Tables: xx yy zz xy xz yz.
INERTIA_PLACE = ((0, 3, 4), (3, 1, 5), (4, 5, 2))


class Ported(Item):
    """Base of objects with ports: loads enter here and motions are read here."""

    __slots__ = ()

    def _home(self) -> tuple[str, str | None]:
        raise AssertionError("a ported item names its body")

    def _port(self, kind: Any, direction: Axis, at: Vector3 | None) -> Port:
        body, marker = self._home()
        if body == GROUND:
            raise ModelError(f"{self.name}.{kind} has no effect: ground does not move. Use a body, or mb.base_motion")
        return make_port(kind, self.name, body, marker, direction, at)


class Body(Ported, Attachable):
    """Handle of a rigid body; see `Model.body`."""

    __slots__ = ("shape",)
    shape: list[dict[str, Any]]  # tables of what pictures show of it, as `mbrs.model.shapes` makes them
    store = "body"
    kind = "body"
    nodes: tuple[str, ...] = ()
    # Is it a flexible body, held at its nodes?
    modes_and_nodes = False

    @property
    def table(self) -> Kind:
        return BODY

    def place_now(self) -> tuple[Book, int, int]:
        return self.model, self.index, -1

    def moving(self) -> list[int]:
        """Nodes with a frame of their own: none of a rigid body."""
        return []

    def _home(self) -> tuple[str, str | None]:
        return self.name, None

    def force(self, direction: Axis, at: Vector3 | None = None) -> Port:
        """A unit force along "x", "-y", ... or a vector (3,), world axes, at the body's origin or the world point ``at``."""
        return self._port("force", direction, at)

    def torque(self, direction: Axis) -> Port:
        """A unit torque about "x", "-y", ... or a vector (3,), world axes."""
        return self._port("torque", direction, None)

    def motion(self, direction: Axis, at: Vector3 | None = None) -> Port:
        """Displacement along "x", ... or rotation about "rx", ..., world axes, of the origin or of the material point
        ``at``.
        """
        return self._port("motion", direction, at)

    def check_together(self, values: Sequence[float]) -> None:
        block = self.table.block
        mass = values[block.place("mass")]
        inertia = values[block.slice("inertia")]
        # without mass a body may have rotational inertia: its joints then have to let it turn alone
        if not (mass > 0.0 or (mass == 0.0 and any(inertia))):
            raise problem(
                self.name + ".mass",
                f"must be positive, got {mass:g}; a body without mass and inertia has no motion of its own: "
                "attach its springs to the neighbour, or give it its small mass",
                InertiaError,
            )
        _check_inertia(self.name + ".inertia", inertia)


class Ground(Ported, Attachable):
    """The fixed world, as a body to attach things to. Its index is -1."""

    __slots__ = ()
    store = "body"
    kind = "ground"

    def place_now(self) -> tuple[Book, int, int]:
        return self.model, -1, -1

    def _home(self) -> tuple[str, str | None]:
        return GROUND, None

    def force(self, direction: Axis, at: Vector3 | None = None) -> Port:
        """An error: ground does not move."""
        return self._port("force", direction, at)

    def torque(self, direction: Axis) -> Port:
        """An error: ground does not move."""
        return self._port("torque", direction, None)

    def motion(self, direction: Axis, at: Vector3 | None = None) -> Port:
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
    def table(self) -> Kind:
        return MARKER

    def _home(self) -> tuple[str, str | None]:
        return self.model.frame_name(self.body, self.node), self.name

    def force(self, direction: Axis) -> Port:
        """A unit force at the marker along "x", "-y", ... or a vector (3,), world axes."""
        return self._port("force", direction, None)

    def torque(self, direction: Axis) -> Port:
        """A unit torque on the marker's body, world axes."""
        return self._port("torque", direction, None)

    def motion(self, direction: Axis) -> Port:
        """Displacement of the marker along "x", ... or rotation about "rx", ..., world axes."""
        return self._port("motion", direction, None)


class Pose(Item):
    """A first guess of where assembly puts a body."""

    __slots__ = ("body",)
    body: int
    store = "pose"
    kind = "pose"

    @property
    def table(self) -> Kind:
        return POSE


def _check_inertia(where: str, j: Sequence[float]) -> None:
    if j[3] == 0.0 == j[4] and j[5] == 0.0:
        low, middle, high = sorted(j[:3])
    else:
        tensor = np.array([[j[p] for p in row] for row in INERTIA_PLACE])
        low, middle, high = (float(v) for v in np.linalg.eigvalsh(tensor))
    slack = INERTIA_TOLERANCE * max(abs(low), abs(high))
    if low < -slack:
        raise problem(
            where, f"has a negative principal moment, {low:g} kg m2; moments are never negative", InertiaError
        )
    if high <= low + middle + slack:
        return
    if j[0] == 0.0 == j[1] and not any(j[3:]):
        warn_user(
            f"{where} (0, 0, {j[2]:g}) is planar data: no rigid body has it, and it serves only if the joints "
            "allow no rotation about x and y"
        )
        return
    raise problem(
        where,
        f"has principal moments {low:g}, {middle:g}, {high:g}: the largest exceeds the sum of the others, which no "
        "body can have. Check units, the sign of products of inertia, and that it is about the centre of mass",
        InertiaError,
    )


def first_guess(body: Body, pose: Any) -> tuple[Pose, list[Number]] | None:
    """A checked guess for a body that is not in the model yet, and its numbers."""
    if pose is None:
        return None
    where = body.name + ".pose"
    if not isinstance(pose, (list, tuple)) or len(pose) != 2:
        raise problem(where, "must be (origin, orientation): a point (3,) and a quaternion (4,) or matrix (3, 3)")
    guess = Pose(body.model, where)
    entries = pack(where, POSE, {"at": pose[0], "orientation": pose[1]}).entries
    guess.check(guess.evaluated(entries))
    return guess, entries


def enter(body: Body, entries: list[Number], guess: tuple[Pose, list[Number]] | None, shape: Any) -> None:
    """Put a body, its first guess and its shape into the model."""
    book = body.model
    body.shape = shapes(shape, f"{body.name}.shape")
    body.put(entries)
    if guess is not None:
        pose, numbers = guess
        pose.body = len(book.bodies)
        pose.put(numbers)
        book.poses.append(pose)
    book.register(body, book.bodies, book.body_index)


# --- methods of `Model` -----


def body(
    self: Book,
    name: str,
    *,
    mass: Scalar,
    inertia: Vector | Matrix,
    at: Vector3 = (0.0, 0.0, 0.0),
    com: Vector3 | None = None,
    orientation: Rotation | None = None,
    pose: PoseLike | None = None,
    velocity: Vector3 | None = None,
    angular_velocity: Vector3 | None = None,
    shape: ShapeLike | None = None,
) -> Body:
    """A rigid body; free until joints hold it.

    Parameters
    ----------
    name
        Unique in the model, without ``.``, ``[`` and ``]``.
    mass
        kg, positive; zero where the body has rotational inertia and its joints let it turn alone.
    inertia
        (3,) or (3, 3), kg m2, about the centre of mass, body axes, products with the sign of the tensor
        (Ixy = - integral of x y dm). Planar data (0, 0, Izz) pass with a warning.
    at
        (3,), m, world: the body's origin as drawn, its centre of mass unless ``com`` is given.
    com
        (3,), m: centre of mass from the origin, body axes.
    orientation
        Quaternion (4,), scalar first, or matrix (3, 3), body to world, as drawn.
    pose
        (origin, orientation): first guess of where assembly brings the body when joints were given two points.
    velocity, angular_velocity
        (3,) of the origin, m/s, and (3,), rad/s, world axes.
    shape
        What pictures show of it, fixed to its origin and axes: `mbrs.Box`, `mbrs.Cylinder`, `mbrs.Sphere`, `mbrs.Mesh`, or a list of
        them. It has no mass and changes no result. Without one a body is drawn as the hull of what is attached to it.

    Returns
    -------
    Body

    Raises
    ------
    InertiaError
        A mass or an inertia that no body can have.
    ModelError
        Wrong shapes, types, numbers that are not finite, a name that is taken.

    Notes
    -----
    Every number may be an expression of parameters. Cost O(1).

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("one"); p = m.body("payload", mass=20.0, inertia=(0.15, 0.15, 0.15), at=(0, 0, 0.1))
    >>> p.force("z").name
    'payload.force.z'
    """
    made = Body(self, self.new_name("body", name))
    given = {
        "mass": mass,
        "inertia": inertia,
        "at": at,
        "com": com,
        "orientation": orientation,
        "velocity": velocity,
        "angular_velocity": angular_velocity,
    }
    entries = pack(name, BODY, given).entries
    enter(made, entries, first_guess(made, pose), shape)
    return made


def marker(
    self: Book, name: str, body: BodyLike, *, at: Vector3 | None = None, orientation: Rotation | None = None
) -> Marker:
    """A named point of a body, of ground or of a node: for inputs, outputs and trajectories.

    Parameters
    ----------
    name
        Unique in the model.
    body
        Its handle or name; "ground" and nodes of flexible bodies as well.
    at
        (3,), m, world, as drawn; of a node its own point by default.
    orientation
        Of its axes as drawn, quaternion (4,), scalar first, or matrix (3, 3); world axes by default.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("one"); p = m.body("p", mass=1.0, inertia=(1, 1, 1))
    >>> m.marker("tip", p, at=(0, 0, 1)).motion("z").name
    'tip.motion.z'
    """
    made = Marker(self, self.new_name("marker", name))
    (place,), point = places(self, f"marker {shown(name)}", (("body", body),), at, name + ".at")
    made.body, made.node = place.body, place.node
    made.put(pack(name, MARKER, {"at": point, "orientation": orientation}).entries)
    self.register(made, self.markers, self.marker_index)
    return made
