"""Data of a model: stores of numbers, names, lists of objects. The handles of objects know this, and not `Model`."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Literal

from ..errors import ModelError
from .expressions import Expression
from .names import GROUND, check_name, located, not_found, problem, shown
from .numbers import Number, numbers
from .parameters import ParameterSpace
from .schema import CHECKED_ROLES, FLAGS, Field, Kind

# The order of their numbers in x.
STORES = (
    "body",
    "joint",
    "element",
    "load",
    "marker",
    "element_law",
    "joint_law",
    "pose",
    "gravity",
    "motion",
    "coupler",
    "constraint",
    "flexible",
    "air",
    "section",
)


class Store:
    """The numbers of all objects of one kind, in order of definition. ``driven`` maps a place to its expression."""

    __slots__ = ("driven", "x")

    def __init__(self) -> None:
        self.x = array("d")
        self.driven: dict[int, Expression] = {}

    def append(self, entries: Sequence[Number], values: Sequence[float]) -> int:
        """Add numbers; returns where they start."""
        start = len(self.x)
        self.x.extend(values)
        if values is not entries:
            for i, entry in enumerate(entries, start):
                if isinstance(entry, Expression):
                    self.driven[i] = entry
        return start

    def entries(self, start: int, n: int) -> list[Number]:
        """Numbers or the expressions that drive them."""
        driven = self.driven
        return [driven.get(i, self.x[i]) for i in range(start, start + n)]


@dataclass(frozen=True)
class Group:
    """The numbers behind one address of an object.

    ``slots[c]`` are the places of component c in the object's store: several where one number means more (``at`` of a joint
    drawn with one point). ``kind``: "axis" and "orientation" are varied by a world rotation vector.
    """

    slots: tuple[tuple[int, ...], ...]
    shape: tuple[int, ...]
    units: tuple[str, ...]
    kind: Literal["plain", "axis", "orientation", "both"] = "plain"
    store: str = ""  # where it is not the object's own
    checked: bool = True  # the object checks it together with others


_TURNED: dict[str, Literal["axis", "orientation"]] = {"direction": "axis", "orientation": "orientation"}
# Attributes of handles that the package uses and a user does not.
_INTERNAL = frozenset(
    {"a", "a_node", "b", "b_node", "check", "check_together", "check_values", "code", "component", "described", "entries", "evaluated"}
    | {"fields", "first", "first_coordinate", "flags", "function", "groups", "has", "index", "in_use", "joint", "lists", "model"}
    | {"modal_fields", "motion_fields", "motions", "n", "node_at", "node_point", "one_point", "owner", "place", "put", "recheck"}
    | {"second", "second_coordinate", "shapes", "size", "start", "store", "table", "take", "used", "uses", "values", "moves"}
    | {"body", "n_rows", "of_velocities"}
    | {"moving", "add_nodes", "sections", "polars", "node_index", "coordinate", "frame", "place_now", "point_group"}
)  # fmt: skip


class Item:
    """Base of all handles: an object of a model, its name, its place, its kind in the schema."""

    __slots__ = ("index", "model", "name", "start")
    model: Book
    name: str
    index: int
    start: int
    store: ClassVar[str]
    kind: ClassVar[str]
    # given to the constructor, by name of the field, in the shape in which they were given
    shapes: Mapping[str, tuple[int, ...]] = MappingProxyType({})
    flags: int = 0
    one_point: bool = False

    def __init__(self, model: Book, name: str) -> None:
        self.model, self.name = model, name
        self.index = self.start = -1

    @property
    def table(self) -> Kind:
        """Its table in the schema."""
        raise AssertionError(f"{type(self).__name__} has no entry in the schema")

    @property
    def size(self) -> int:
        """Number of numbers of the object."""
        return self.table.block.size()

    def put(self, entries: Sequence[Number]) -> None:
        """Check the numbers and take them into the model; nothing is left behind when the check fails."""
        values = self.evaluated(entries)
        self.check(values)
        self.start = self.model.stores[self.store].append(entries, values)

    def evaluated(self, entries: Sequence[Number]) -> Sequence[float]:
        """The numbers now; the entries themselves if none is an expression."""
        space = self.model.space
        mixed = False
        for entry in entries:
            if type(entry) is not float:
                mixed = True
                if isinstance(entry, Expression) and entry.space is not space:
                    raise ModelError(
                        f"{self.name} uses the expression {shown(entry)} of another model; define its parameters in this model"
                    )
        return numbers(entries) if mixed else entries  # type: ignore[return-value]

    def values(self, name: str = "") -> list[float]:
        """Numbers of a field now; all of them without a name."""
        start, n = self._range(name)
        return self.model.stores[self.store].x[start : start + n].tolist()

    def entries(self, name: str = "") -> list[Number]:
        """Numbers of a field, or the expressions that drive them."""
        return self.model.stores[self.store].entries(*self._range(name))

    def _range(self, name: str) -> tuple[int, int]:
        if not name:
            return self.start, self.size
        part = self.table.block.slice(name)
        return self.start + part.start, part.stop - part.start

    def has(self, name: str) -> bool:
        """Was this field given?"""
        return bool(self.flags & self.table.block.fields[name].bit)

    def uses(self, field: Field) -> bool:
        """Does the field matter for this object, as it was made?"""
        if field.replaced_by:
            return not self.flags & FLAGS[field.replaced_by]
        return field.listed != "given" or self.has(field.name)

    def check(self, values: Sequence[float]) -> None:
        """Raise where the numbers describe no possible object."""
        for field, place in self.table.checked:
            self._check_field(field, values[place])
        self.check_together(values)

    def _check_field(self, field: Field, values: Sequence[float]) -> None:
        if field.check == "positive":
            text = "" if values[0] > 0.0 else f"must be positive, got {values[0]:g}"
        elif field.check == "not negative":
            counts = not field.flag or self.has(field.name)
            text = f"must not be negative, got {values[0]:g}" if counts and values[0] < 0.0 else ""
        elif any(values) or not self.uses(field):
            return
        elif field.role == "orientation":
            text = "must not be a zero quaternion; use (1, 0, 0, 0) for the identity"
        else:
            text = "must not be a zero vector: give a direction"
        if text:
            raise problem(f"{self.name}.{field.name}", text)

    def check_together(self, values: Sequence[float]) -> None:
        """Rules about several fields at once."""

    def recheck(self) -> None:
        """`check` again, after values have changed."""
        self.check(self.values())

    def fields(self) -> dict[str, Group]:
        """Everything that has an address, by name."""
        out: dict[str, Group] = {}
        for field in self.table.fields:
            if field.listed != "never" and self.uses(field):
                out[field.name] = self._group(field)
            if field.name == "at_b" and self.one_point:
                out["at"] = _both(out["at_a"], out["at_b"])
        return out

    def _group(self, field: Field) -> Group:
        block, table = self.table.block, self.table
        start = self.start + block.place(field.name)
        n = block.slice(field.name).stop - block.place(field.name)
        shape = self.shapes.get(field.name) if field.listed == "given" and field.name in self.shapes else None
        turned = _TURNED.get(field.role)
        if turned is not None:
            return Group(_run(start, n), (n,), ("rad",) * 3, turned)
        if shape is None:
            units = table.units(field, ())
            return Group(
                _run(start, n),
                () if field.shape == () else (n,),
                units,
                checked=bool(field.check) or field.role in CHECKED_ROLES,
            )
        step = n // shape[0] + 1 if len(field.shape) == 2 and len(shape) == 1 else 1
        count = math.prod(shape)
        slots = tuple((start + step * i,) for i in range(count))
        return Group(slots, shape, table.units(field, shape), checked=False)

    def __dir__(self) -> list[str]:
        return [name for name in object.__dir__(self) if name not in _INTERNAL]

    def __repr__(self) -> str:
        return f"<{self.kind} {self.name!r} of {self.model.name!r}>"

    def __reduce__(self) -> tuple[Any, ...]:
        slots = [s for c in type(self).__mro__ for s in getattr(c, "__slots__", ())]
        return _empty, (type(self),), {s: getattr(self, s) for s in slots}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for slot, value in state.items():
            setattr(self, slot, value)


def _empty(cls: type[Item]) -> Item:
    return cls.__new__(cls)


def _run(start: int, n: int) -> tuple[tuple[int, ...], ...]:
    return tuple((start + i,) for i in range(n))


def _both(a: Group, b: Group) -> Group:
    slots = tuple((*p, *q) for p, q in zip(a.slots, b.slots, strict=True))
    return Group(slots, a.shape, a.units, "both")


class Attachable:
    """A place of attachment of joints, springs, loads and markers: a body, ground, or a node of a flexible body."""

    __slots__ = ()

    def place_now(self) -> tuple[Book, int, int]:
        """Its model, the index of its body (-1 ground), the index of its node (-1 none)."""
        raise AssertionError("what can be attached to must say where it is")


class Book:
    """The stores, names and lists of a model."""

    def __init__(self, name: str) -> None:
        if not isinstance(name, str) or not name:
            raise ModelError(f"the name of a model must be a non-empty string, got {shown(name)}")
        self.name = name
        self.space = ParameterSpace()
        self.stores = {kind: Store() for kind in STORES}
        self.items: dict[str, Item] = {}
        self.bodies: list[Any] = []
        self.joints: list[Any] = []
        self.elements: list[Any] = []
        self.loads: list[Any] = []
        self.drives: list[Any] = []
        self.couplers: list[Any] = []
        self.constraints: list[Any] = []
        self.markers: list[Any] = []
        self.airs: list[Any] = []
        self.motions: list[Any] = []
        self.poses: list[Any] = []
        self.laws: dict[str, list[Any]] = {"element": [], "joint": []}
        self.laws_of: dict[tuple[str, int], list[Any]] = {}
        self.gravity_item: Item | None = None
        self.body_index: dict[str, int] = {}
        self.marker_index: dict[str, int] = {}
        # Structure: what Tables' integers say. Values: what x says.
        self.structure_version = 0
        self.values_version = 0
        self.cache: dict[str, Any] = {}

    units: Literal["SI"] | None = None

    @property
    def tolerance(self) -> float:
        """Accuracy of what was drawn, see `Model`."""
        raise AssertionError("a model has a tolerance")

    def new_name(self, kind: str, name: Any) -> str:
        """The name, if a new object may have it."""
        check_name(kind, name, self.items)
        return check_name(kind, name, self.space.names)

    def register(self, item: Item, members: list[Any], index: dict[str, int] | None = None) -> None:
        """Take a finished object into the model; ``index`` keeps its number by name."""
        item.index = len(members)
        members.append(item)
        self.items[item.name] = item
        if index is not None:
            index[item.name] = item.index
        self.structure_version += 1

    def changed_structure(self) -> None:
        """Forget what was resolved and compiled."""
        self.structure_version += 1
        self.cache.pop("targets", None)

    def body_name(self, index: int) -> str:
        """Name of a body by index."""
        return GROUND if index < 0 else self.bodies[index].name

    def find_body(self, body: Any, where: str, key: str = "body") -> int:
        """Index of a body given by handle or name; -1 is ground. ``key`` is the argument that named it."""
        if isinstance(body, Attachable):
            book, index, node = body.place_now()
            if book is self and node < 0:
                return index
        if isinstance(body, str) and body in self.body_index:
            return self.body_index[body]
        if isinstance(body, str) and body == GROUND:
            return -1
        raise located(self._no_body(body, where), f"{where}.{key}")

    def _no_body(self, body: Any, where: str) -> ModelError:
        if isinstance(body, Attachable):
            return ModelError(f"{where} names {shown(body)}, which belongs to another model; use this model's own")
        if not isinstance(body, str):
            return ModelError(f"{where} needs a body (its handle or name, or m.ground), got {shown(body)}")
        if body in self.items:
            return ModelError(f"{where} needs a body, but {shown(body)} is a {self.items[body].kind}")
        return not_found(f"{where}: no body", body, [*self.body_index, GROUND])

    # Frames of results: the bodies, then each moving node of a flexible body that something refers to.

    def moving_nodes(self) -> list[tuple[int, int]]:
        """(body, node) of each node with a frame of its own."""
        return [(body.index, node) for body in self.bodies for node in body.moving()]

    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames of results."""
        nodes = (f"{self.bodies[b].name}.{self.bodies[b].nodes[i]}" for b, i in self.moving_nodes())
        return (*(body.name for body in self.bodies), *nodes)

    def frame_name(self, body: int, node: int) -> str:
        """Name of the frame that moves with a body or with its node."""
        moving = node >= 0 and node in self.bodies[body].moving()
        return f"{self.body_name(body)}.{self.bodies[body].nodes[node]}" if moving else self.body_name(body)

    def has_frame(self, name: str) -> bool:
        """Is there a body of this name, or a node ``body.node``?"""
        owner, _, node = name.partition(".")
        return owner in self.body_index and (not node or node in self.bodies[self.body_index[owner]].nodes)

    @property
    def is_flexible(self) -> bool:
        """Is there a flexible body?"""
        return len(self.stores["flexible"].x) > 0
