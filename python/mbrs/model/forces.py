"""Springs, bushings, torsion springs and loads: handles and constructors. Forces are preload + k e + c e' (docs/tables.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeVar

from .aliases import Axis, BodyLike, Coefficients, Laws, Points, Rotation, Scalar, Vector3
from .argument_checks import pack
from .attach import connect, load_place
from .book import Book, Group, Item
from .joint import check_apart
from .law_items import add_laws, law_fields
from .motions import FunctionName, Motion, MotionItem, MotionLike, TimeFunction
from .names import problem, shown
from .numbers import Number, vector
from .schema import ELEMENTS, FUNCTION, LOAD_FRAMES, LOADS, Kind

Frame = Literal["world", "body"]
LoadValue = Sequence[MotionLike] | Vector3 | MotionLike


class Element(Item):
    """Handle of a spring-damper, bushing or torsion spring; see `Model.spring_damper` and its siblings."""

    __slots__ = ("a", "a_node", "b", "b_node", "flags", "one_point", "shapes", "type")
    a: int
    b: int
    a_node: int  # of a flexible body, else -1
    b_node: int
    type: str
    store = "element"
    kind = "element"

    @property
    def table(self) -> Kind:
        return ELEMENTS[self.type]

    def check_together(self, values: Sequence[float]) -> None:
        if self.type == "spring_damper":
            block = self.table.block
            check_apart(self.name, "spring", values[block.slice("at_a")], values[block.slice("at_b")])

    def fields(self) -> dict[str, Group]:
        return {**super().fields(), **law_fields(self)}


def _add_element(
    book: Book, type_: str, name: Any, a: Any, b: Any, law: Any, k: Any, c: Any, preload: Any, **given: Any
) -> Element:
    """Check and add an element of any type."""
    kind = ELEMENTS[type_]
    e = Element(book, book.new_name("element", name))
    e.type = type_
    i, j, given["at"] = connect(e, f"{type_} {shown(name)}", a, b, given["at"])
    e.a, e.b, e.a_node, e.b_node = i.body, j.body, i.node, j.node
    if k is None and c is None and preload is None and law is None:
        raise problem(name, f"does nothing: give the {type_} at least one of k=, c=, preload=, law=")
    packed = pack(name, kind, {**given, "k": k, "c": c, "preload": preload})
    e.flags, e.shapes, e.one_point = packed.flags, packed.shapes, packed.one_point and kind.points == "either"
    laws = add_laws(e, law, len(kind.free), kind.coordinates)
    e.put(packed.entries)
    laws.commit(len(book.elements))
    book.register(e, book.elements)
    return e


class Load(Item):
    """Handle of a force or torque; see `Model.force` and `Model.torque`."""

    __slots__ = ("body", "frame", "motions", "node", "type")
    body: int
    node: int  # of a flexible body, else -1
    frame: str
    motions: list[MotionItem]  # of those components that vary in time
    type: str
    store = "load"
    kind = "load"

    @property
    def table(self) -> Kind:
        return LOADS[self.type]

    def fields(self) -> dict[str, Group]:
        out = super().fields()
        for motion in self.motions:
            out.update(motion.motion_fields("xyz"[motion.component] + "_", out["value"].units[0]))
        return out

    def recheck(self) -> None:
        super().recheck()
        for motion in self.motions:
            motion.recheck()


_L = TypeVar("_L", bound=Load)


def split_value(load: Load, value: Any) -> tuple[list[Number], dict[int, list[Number]]]:
    """The constant part of a load's value, and the numbers of the motions of its components."""
    where = load.name + ".value"
    load.motions = []
    if isinstance(value, Motion):
        raise problem(where, "must be three components: put the motion into one, such as (motion, 0, 0)")
    whole = None
    if callable(value) or isinstance(value, FunctionName):
        whole = TimeFunction(value, where, 3)
        whole.try_now()
        value = (whole,) * 3
    varying: dict[int, list[Number]] = {}
    constant = list(value) if isinstance(value, (list, tuple)) else value
    if isinstance(constant, list) and len(constant) == 3:
        for i, one in enumerate(constant):
            if not (isinstance(one, (Motion, FunctionName)) or callable(one)):
                continue
            item = MotionItem(load.model, load.name)
            item.owner, item.component = load, i
            if whole is None:
                varying[i] = item.take(one, f"{load.name}.{'xyz'[i]}", 1)
            else:
                item.code, item.groups, item.function, varying[i] = FUNCTION.code, (), whole, []
            item.check(item.evaluated(varying[i]))
            load.motions.append(item)
            constant[i] = 0.0
    return vector(constant, where), varying


def enter_load(load: _L, numbers: list[Number], varying: dict[int, list[Number]]) -> _L:
    """Put a checked load, its numbers and those of its motions into the model."""
    book = load.model
    load.put(numbers)
    for item in load.motions:
        item.place = len(book.motions)
        item.put(varying[item.component])
        book.motions.append(item)
    book.register(load, book.loads)
    return load


def _add_load(book: Book, type_: str, name: Any, body: Any, at: Any, value: Any, frame: Any, on: Any) -> Load:
    load = Load(book, book.new_name("load", name))
    load.type = type_
    where, what = name + ".at", f"{type_} {shown(name)}"
    if on is None:
        place, at = load_place(book, what, body, at if type_ == "force" else None, where)
        load.body, load.node = place.body, place.node
    elif isinstance(on, str) and on == "frame":
        load.body, load.node = book.find_body(body, what), -1
        at = book.bodies[load.body].entries("at") if at is None else at
    else:
        raise problem(name + ".on", f"must be 'frame' (of a flexible body) or left out, got {shown(on)}")
    if load.body < 0:
        raise problem(name, f"is a {type_} on ground, which does not move; name the body it acts on")
    if not isinstance(frame, str) or frame not in LOAD_FRAMES:
        raise problem(name + ".frame", f"must be 'world' or 'body' (a follower), got {shown(frame)}")
    load.frame = frame
    constant, varying = split_value(load, value)
    return enter_load(load, pack(name, LOADS[type_], {"at": at, "value": constant}).entries, varying)


# --- methods of `Model` -----


def spring_damper(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    k: Scalar | None = None,
    c: Scalar | None = None,
    length: Scalar | None = None,
    preload: Scalar | None = None,
    law: Laws | None = None,
) -> Element:
    """A spring and damper between two points: tension f = preload + k (d - L0) + c d', d the distance of the
    points.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies, or ground.
    at
        ``(P_a, P_b)``, world coordinates as drawn (m), the first fixed in a, the second in b; they must differ.
    k, c, preload
        N/m, N s/m, N (tension); numbers or expressions. At least one of these or ``law``.
    length
        Natural length L0 (m). Without it L0 is the drawn distance, also when the points are moved.
    law
        A nonlinear law of (d - L0, d'), or a list of them, added to the above.

    Returns
    -------
    Element

    Raises
    ------
    ModelError
        Coincident points, wrong shapes, numbers that are not finite, an element that does nothing.

    Notes
    -----
    Cost O(1).

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("drop"); p = m.body("ball", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 1))
    >>> m.spring_damper("string", m.ground, p, at=((0, 0, 2), (0, 0, 1)), k=100.0)
    <element 'string' of 'drop'>
    """
    return _add_element(self, "spring_damper", name, a, b, law, k=k, c=c, preload=preload, at=at, length=length)


def bushing(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    k: Coefficients | None = None,
    c: Coefficients | None = None,
    orientation: Rotation | None = None,
    preload: Coefficients | None = None,
    law: Laws | None = None,
) -> Element:
    """A six-component spring and damper: f = preload + k e + c e', e = (displacement, rotation vector) of b, frame of a.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)``; of a node its own point.
    k, c
        (6,) or (6, 6), translation first: N/m, N m/rad; N s/m, N m s/rad. A matrix need not be symmetric.
    orientation
        Of its frame as drawn, carried along by a: quaternion (4,), scalar first, or matrix (3, 3); world axes by default.
    preload
        (6,), N and N m.
    law
        Six laws or None, or {"x": law, "rz": law}, added to the above; `mb.FunctionLaw` alone acts on all six coordinates, as
        {("y", "z"): law} on those named.

    Returns
    -------
    Element

    Raises
    ------
    ModelError
        Wrong shapes, numbers that are not finite, an element that does nothing.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("mount"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    >>> m.bushing("rubber", m.ground, p, at=(0, 0, 0), k=(1e4, 1e4, 1e4, 10, 10, 10)).name
    'rubber'
    """
    return _add_element(self, "bushing", name, a, b, law, k=k, c=c, preload=preload, at=at, orientation=orientation)


def torsion(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Vector3 | None = None,
    axis: Axis,
    k: Scalar | None = None,
    c: Scalar | None = None,
    angle: Scalar | None = None,
    preload: Scalar | None = None,
    law: Laws | None = None,
) -> Element:
    """A torsion spring about ``axis``: moment preload + k (phi - angle) + c phi', phi = 0 as drawn.

    phi is the angle of a hinge about ``axis``. It is defined where the bodies turn about that axis alone; where they turn about
    others as well, phi depends on the order of these turns, and with it on the orientation of the world axes: use a `bushing` there.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world: where it is drawn; the moment does not depend on it.
    axis
        "x", "-y", ... or a vector (3,), world as drawn, fixed in a.
    k, c, preload
        N m/rad, N m s/rad, N m.
    angle
        Unstretched angle, rad.
    law
        A nonlinear law of (phi, phi'), or a list of them, added to the above.

    Returns
    -------
    Element

    Raises
    ------
    ModelError
        Wrong shapes, numbers that are not finite, an element that does nothing.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("wheel"); w = m.body("wheel", mass=1.0, inertia=(1, 1, 1))
    >>> m.torsion("spring", m.ground, w, at=(0, 0, 0), axis="z", k=2.0)
    <element 'spring' of 'wheel'>
    """
    return _add_element(self, "torsion", name, a, b, law, k=k, c=c, preload=preload, at=at, axis=axis, angle=angle)


def force(
    self: Book,
    name: str,
    body: BodyLike,
    *,
    at: Vector3 | None = None,
    value: LoadValue,
    frame: Frame = "world",
    on: Literal["frame"] | None = None,
) -> Load:
    """A force on a body at a point fixed in it.

    Parameters
    ----------
    name
        Unique in the model.
    body
        A body (handle or name) or a node of a flexible body.
    at
        (3,), m, world, as drawn; the body's origin by default.
    value
        (3,), N. A component may be a motion (`Ramp`, `Sine`, `Polynomial`, `Table`) or a function of t (s); ``value`` may be one
        function that returns (3,). Their numbers have addresses such as "pull.x_amplitude". Linear analyses take t = 0.
    frame
        "world": it keeps its direction; "body": it turns with the body (a follower), value in world axes as drawn.
    on
        "frame": on the floating frame of a flexible body, moving no shape, rather than at a node.

    Returns
    -------
    Load

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("shaken"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    >>> m.force("shaker", p, value=(mb.Sine(5.0, frequency=10.0), 0, 0))
    <load 'shaker' of 'shaken'>
    """
    return _add_load(self, "force", name, body, at, value, frame, on)


def torque(
    self: Book,
    name: str,
    body: BodyLike,
    *,
    value: LoadValue,
    frame: Frame = "world",
    on: Literal["frame"] | None = None,
) -> Load:
    """A torque on a body.

    Parameters
    ----------
    name, body, frame, on
        As in `force`.
    value
        (3,), N m, constant or varying as in `force`.

    Returns
    -------
    Load

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("fan"); r = m.body("rotor", mass=1.0, inertia=(1, 1, 1))
    >>> m.torque("drag", r, value=(0, 0, -0.1))
    <load 'drag' of 'fan'>
    """
    return _add_load(self, "torque", name, body, None, value, frame, on)
