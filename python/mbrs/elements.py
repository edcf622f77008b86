"""Springs, bushings, torsion springs, loads, and the laws that springs and joints may carry."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .geometry import quaternion
from .names import problem, shown
from .store import Field, Item, plain, single
from .values import Number, array, axis, is_pair, point_pair, scalar, shape_of, vector

if TYPE_CHECKING:
    from .model import Model

HAS_K, HAS_C, HAS_PRELOAD, LENGTH_GIVEN = 1, 2, 4, 16
TYPES = {"spring_damper": 0, "bushing": 1, "torsion": 2}
SIZES = {"spring_damper": 10, "bushing": 88, "torsion": 10}
SIX = ("x", "y", "z", "rx", "ry", "rz")
LOAD_TYPES = {"force": 0, "torque": 1}
LOAD_FRAMES = {"world": 0, "body": 1}
# Two points this close, relative to their distance from the world origin, have no direction between them.
_COINCIDENT = 1e-12


class Element(Item):
    """Handle of a spring-damper, bushing or torsion spring; see `Model.spring_damper` and its siblings."""

    __slots__ = ("a", "b", "flags", "one_point", "shapes", "type")
    a: int
    b: int
    flags: int
    one_point: bool
    shapes: dict[str, tuple[int, ...]]  # of k, c and preload as they were given
    type: str
    store = "element"
    kind = "element"

    @property
    def size(self) -> int:
        return SIZES[self.type]

    def check(self, values: Sequence[float]) -> None:
        if self.type == "spring_damper":
            check_drawn_length(self.name, "spring", values, self.flags, values[8])
        elif self.type == "torsion" and not math.hypot(*values[3:6]) > 0.0:
            raise problem(self.name + ".axis", "must not be a zero vector: give a direction")
        elif self.type == "bushing" and not math.hypot(*values[6:10]) > 0.0:
            raise problem(self.name + ".orientation", "must not be a zero quaternion; (1, 0, 0, 0) is no rotation")

    def fields(self) -> dict[str, Field]:
        made = {"spring_damper": _spring_fields, "bushing": _bushing_fields, "torsion": _torsion_fields}[self.type](
            self
        )
        return {**made, **law_fields(self)}


def _spring_fields(e: Element) -> dict[str, Field]:
    s = e.start
    out = {"at_a": plain(s, 3, "m"), "at_b": plain(s + 3, 3, "m"), "length": single(s + 8, "m")}
    for name, place, unit in (("k", 6, "N/m"), ("c", 7, "N s/m"), ("preload", 9, "N")):
        if name in e.shapes:
            out[name] = single(s + place, unit)
    return out


def _torsion_fields(e: Element) -> dict[str, Field]:
    s = e.start
    turned = Field(tuple((s + 3 + i,) for i in range(3)), (3,), ("rad",) * 3, "axis")
    out = {"at": plain(s, 3, "m"), "axis": turned, "angle": single(s + 8, "rad")}
    for name, place, unit in (("k", 6, "N m/rad"), ("c", 7, "N m s/rad"), ("preload", 9, "N m")):
        if name in e.shapes:
            out[name] = single(s + place, unit)
    return out


def _bushing_fields(e: Element) -> dict[str, Field]:
    s = e.start
    out = {"at_a": plain(s, 3, "m"), "at_b": plain(s + 3, 3, "m")}
    if e.one_point:
        out["at"] = Field(tuple((s + i, s + 3 + i) for i in range(3)), (3,), ("m",) * 3, "both")
    out["orientation"] = Field(tuple((s + 6 + i,) for i in range(4)), (4,), ("rad",) * 3, "orientation")
    for name, place, per_second in (("k", 10, ""), ("c", 46, " s")):
        if name in e.shapes:
            out[name] = _matrix_field(s + place, e.shapes[name], per_second)
    if "preload" in e.shapes:
        out["preload"] = plain(s + 82, 6, ["N"] * 3 + ["N m"] * 3)
    return out


def _matrix_field(start: int, shape: tuple[int, ...], second: str) -> Field:
    def unit(i: int, j: int) -> str:
        force = "N" if i < 3 else "N m"
        return f"{force}{second}/{'m' if j < 3 else 'rad'}"

    if shape == (6,):
        return Field(tuple((start + 7 * i,) for i in range(6)), shape, tuple(unit(i, i) for i in range(6)))
    pairs = [(i, j) for i in range(6) for j in range(6)]
    return Field(tuple((start + 6 * i + j,) for i, j in pairs), shape, tuple(unit(i, j) for i, j in pairs))


def check_drawn_length(name: str, what: str, values: Sequence[float], flags: int, length: float) -> None:
    """A line between two points needs a direction, and a natural length that is not negative."""
    a, b = values[0:3], values[3:6]
    if math.dist(a, b) <= _COINCIDENT * max(math.hypot(*a), math.hypot(*b)):
        raise problem(
            name + ".at",
            f"gives the {what} two coincident points, so that its direction is undefined; move one, or use a bushing",
        )
    if flags & LENGTH_GIVEN and length < 0.0:
        raise problem(name + ".length", f"must not be negative, got {length:g}")


class Load(Item):
    """Handle of a constant force or torque; see `Model.force` and `Model.torque`."""

    __slots__ = ("body", "frame", "type")
    body: int
    frame: str
    type: str
    store = "load"
    kind = "load"

    @property
    def size(self) -> int:
        return 6

    def fields(self) -> dict[str, Field]:
        value = plain(self.start + 3, 3, "N" if self.type == "force" else "N m")
        return {"at": plain(self.start, 3, "m"), "value": value} if self.type == "force" else {"value": value}


class LawItem(Item):
    """One law on one relative coordinate of an element or a joint."""

    __slots__ = ("code", "component", "n", "owner")
    code: int
    component: int
    n: int
    owner: Any
    kind = "law"

    @property
    def size(self) -> int:
        return self.n

    @property
    def store(self) -> str:  # type: ignore[override]
        return "joint_law" if self.owner.kind == "joint" else "element_law"


class SavedLaw:
    """A law read from a file: its type by name, its code and its numbers."""

    def __init__(self, name: str, code: int, values: Sequence[Any]) -> None:
        self.name, self.code, self.values = name, code, tuple(values)


class NewLaws:
    """Laws that were checked with their owner and enter the model when it does."""

    def __init__(self, owner: Any, made: list[tuple[LawItem, list[Number]]]) -> None:
        self.owner, self.made = owner, made

    def commit(self, index: int) -> None:
        """Take them into the model."""
        items = self.owner.model.laws[self.owner.kind]
        for law, entries in self.made:
            law.index = len(items)
            law.put(entries)
            items.append(law)
        if self.made:
            self.owner.model.laws_of[self.owner.kind, index] = [law for law, _ in self.made]


def add_laws(owner: Any, law: Any, n: int, names: Sequence[str]) -> NewLaws:
    """Check ``law=``: one law (or a list of them) where there is one coordinate, else one for each, or {name: law}."""
    made: list[tuple[LawItem, list[Number]]] = []
    for component, one in _by_component(owner.name + ".law", law, n, names):
        made.append(_new_law(owner, component, one))
    return NewLaws(owner, made)


def _by_component(where: str, law: Any, n: int, names: Sequence[str]) -> list[tuple[int, Any]]:
    if law is None:
        return []
    if n == 0:
        raise problem(where, "is given, but there is no free coordinate for it to act on")
    if isinstance(law, Mapping):
        out = []
        for key, value in law.items():
            if key not in names:
                raise problem(where, f"has no coordinate {shown(key)}; known: {', '.join(names)}")
            out += [(names.index(key), one) for one in _many(value)]
        return out
    if n == 1:
        return [(0, one) for one in _many(law)]
    if not isinstance(law, (list, tuple)) or len(law) != n:
        raise problem(
            where, f"must be {n} laws or None, one for each of {', '.join(names)}, or {{name: law}}; got {shown(law)}"
        )
    return [(i, one) for i, entry in enumerate(law) for one in _many(entry)]


def _many(law: Any) -> list[Any]:
    if law is None:
        return []
    return list(law) if isinstance(law, (list, tuple)) else [law]


def _new_law(owner: Any, component: int, law: Any) -> tuple[LawItem, list[Number]]:
    where = owner.name + ".law"
    code, values = getattr(law, "code", None), getattr(law, "values", None)
    if isinstance(code, bool) or not isinstance(code, int) or values is None or callable(values):
        raise problem(where, f"must be a law such as mb.Cubic(1e9), got {shown(law)}")
    if getattr(law, "w", None) is not None:
        raise problem(where, "has w=, a direction for mb.MechanicalSystem; here the joint or element is the direction")
    name = law.name if isinstance(law, SavedLaw) else type(law).__name__
    item = LawItem(owner.model, name)
    entries = [scalar(v, where) for v in values]
    item.owner, item.component, item.code, item.n = owner, component, code, len(entries)
    item.evaluated(entries)
    return item, entries


def law_fields(owner: Any) -> dict[str, Field]:
    """``law[i]``: the numbers of all laws of an owner, one after the other. They live in the store of laws."""
    items = owner.model.laws_of.get((owner.kind, owner.index), ())
    slots = tuple((law.start + i,) for law in items for i in range(law.n))
    return {"law": Field(slots, (len(slots),), ("",) * len(slots), store=items[0].store)} if slots else {}


def _coefficient(e: Element, field: str, value: Any) -> Number:
    if value is None:
        return 0.0
    e.shapes[field] = ()
    return scalar(value, f"{e.name}.{field}")


def _six_by_six(e: Element, field: str, value: Any) -> list[Number]:
    flat: list[Number] = [0.0] * 36
    if value is None:
        return flat
    where, shape = f"{e.name}.{field}", shape_of(value)
    if shape == (6,):
        flat[::7] = array(value, (6,), where)
    elif shape == (6, 6):
        flat = array(value, (6, 6), where)
    else:
        raise problem(where, f"must be 6 numbers (x y z rx ry rz) or a 6 x 6 matrix, got {shown(value)}")
    e.shapes[field] = shape
    return flat


def _new_element(
    model: Model, type_: str, name: Any, a: Any, b: Any, k: Any, c: Any, preload: Any, law: Any
) -> Element:
    e = Element(model, model.new_name("element", name))
    e.type, e.shapes, e.one_point = type_, {}, False
    e.a, e.b = model.two_bodies(f"{type_} {name!r}", a, b)
    if k is None and c is None and preload is None and law is None:
        raise problem(name, f"does nothing: give the {type_} at least one of k=, c=, preload=, law=")
    e.flags = HAS_K * (k is not None) + HAS_C * (c is not None) + HAS_PRELOAD * (preload is not None)
    return e


def _finish(e: Element, entries: list[Number], laws: NewLaws) -> Element:
    e.put(entries)
    e.index = len(e.model.elements)
    laws.commit(e.index)
    e.model.register(e, e.model.elements)
    return e


class ElementMethods:
    """The springs and loads of a model. Forces are preload + k e + c e', against the elongation e (docs/tables.md)."""

    def spring_damper(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any,
        k: Any = None,
        c: Any = None,
        length: Any = None,
        preload: Any = None,
        law: Any = None,
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
        e = _new_element(self, "spring_damper", name, a, b, k, c, preload, law)
        at_a, at_b = point_pair(at, name + ".at")
        entries = [
            *at_a,
            *at_b,
            _coefficient(e, "k", k),
            _coefficient(e, "c", c),
            0.0 if length is None else scalar(length, name + ".length"),
            _coefficient(e, "preload", preload),
        ]
        e.flags |= LENGTH_GIVEN * (length is not None)
        return _finish(e, entries, add_laws(e, law, 1, ("u",)))

    def bushing(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any,
        k: Any = None,
        c: Any = None,
        orientation: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Element:
        """A six-component spring and damper: f = preload + k e + c e', e = (displacement, rotation vector) of b, frame
        of a.

        ``at``: a point (3,) or two (P_a, P_b), world, m. ``k``, ``c``: (6,) or (6, 6), translation first (N/m, N m/rad;
        N s/m, N m s/rad). ``orientation``: of its frame as drawn (world axes by default), carried along by a.
        ``preload``: (6,) N, N m. ``law``: six laws or None, or {"x": law, "rz": law}.

        >>> import mbrs as mb
        >>> m = mb.Model("mount"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
        >>> m.bushing("rubber", m.ground, p, at=(0, 0, 0), k=(1e4, 1e4, 1e4, 10, 10, 10)).name
        'rubber'
        """
        e = _new_element(self, "bushing", name, a, b, k, c, preload, law)
        e.one_point = not is_pair(at)
        at_a, at_b = (vector(at, name + ".at"),) * 2 if e.one_point else point_pair(at, name + ".at")
        if preload is not None:
            e.shapes["preload"] = (6,)
        entries = [
            *(*at_a, *at_b, *quaternion(orientation, name + ".orientation")),
            *_six_by_six(e, "k", k),
            *_six_by_six(e, "c", c),
            *((0.0,) * 6 if preload is None else array(preload, (6,), name + ".preload")),
        ]
        return _finish(e, entries, add_laws(e, law, 6, SIX))

    def torsion(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any,
        axis: Any,
        k: Any = None,
        c: Any = None,
        angle: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Element:
        """A torsion spring about ``axis`` (fixed in a): moment preload + k (phi - angle) + c phi', phi = 0 as drawn.

        ``at``: one point (3,), world, where it is drawn; the moment does not depend on it. ``angle``: unstretched
        angle, rad. ``k``, ``c``, ``preload``: N m/rad, N m s/rad, N m.
        """
        e = _new_element(self, "torsion", name, a, b, k, c, preload, law)
        if is_pair(at):
            raise problem(name + ".at", "must be one point (3,): a torsion spring has no second one")
        entries = [
            *vector(at, name + ".at"),
            *_axis(axis, name),
            _coefficient(e, "k", k),
            _coefficient(e, "c", c),
            0.0 if angle is None else scalar(angle, name + ".angle"),
            _coefficient(e, "preload", preload),
        ]
        return _finish(e, entries, add_laws(e, law, 1, ("angle",)))

    def force(  # type: ignore[misc]
        self: Model, name: str, body: Any, *, at: Any = None, value: Any, frame: str = "world"
    ) -> Load:
        """A constant force ``value`` (3,), N, at the world point ``at`` of the body (its origin by default).

        ``frame="world"``: keeps its direction; ``"body"``: turns with the body (a follower), value in world axes as
        drawn.
        """
        return _add_load(self, "force", name, body, at, value, frame)

    def torque(self: Model, name: str, body: Any, *, value: Any, frame: str = "world") -> Load:  # type: ignore[misc]
        """A constant torque ``value`` (3,), N m; ``frame`` as for `force`."""
        return _add_load(self, "torque", name, body, (0.0, 0.0, 0.0), value, frame)


def _axis(value: Any, name: str) -> list[Number]:
    return axis(value, name + ".axis")


def _add_load(model: Model, type_: str, name: Any, body: Any, at: Any, value: Any, frame: Any) -> Load:
    load = Load(model, model.new_name("load", name))
    load.type = type_
    load.body = model.find_body(body, f"{type_} {name!r}")
    if load.body < 0:
        raise problem(name, f"is a {type_} on ground, which does not move; name the body it acts on")
    if not isinstance(frame, str) or frame not in LOAD_FRAMES:
        raise problem(name + ".frame", f"must be 'world' or 'body' (a follower), got {shown(frame)}")
    load.frame = frame
    where = name + ".at"
    if at is not None and is_pair(at):
        raise problem(where, "must be one point (3,): a force acts at one")
    point = model.bodies[load.body].entries(0, 3) if at is None else vector(at, where)
    load.put([*point, *vector(value, name + ".value")])
    load.index = len(model.loads)
    model.register(load, model.loads)
    return load
