"""Where a model keeps its numbers: one growing vector per kind of object, with the expressions that drive some of
them.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from ..errors import ModelError
from .expressions import Expression
from .numbers import Number, numbers

if TYPE_CHECKING:
    from .model import Model

Kind = Literal["plain", "axis", "orientation", "both"]


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
class Field:
    """A named group of numbers of one object.

    ``slots[c]`` are the places of component c in the object's store: several where one number stands for more (``at``
    of a joint drawn with one point). ``kind``: "axis" and "orientation" are varied by a world rotation vector.
    """

    slots: tuple[tuple[int, ...], ...]
    shape: tuple[int, ...]
    units: tuple[str, ...]
    kind: Kind = "plain"
    store: str = ""  # where it is not the object's own


def plain(start: int, n: int, unit: str | Sequence[str], shape: tuple[int, ...] | None = None) -> Field:
    """A field of consecutive places."""
    units = (unit,) * n if isinstance(unit, str) else tuple(unit)
    return Field(tuple((start + i,) for i in range(n)), (n,) if shape is None else shape, units)


def single(place: int, unit: str) -> Field:
    """A field of one number."""
    return Field(((place,),), (), (unit,))


class Item:
    """Base of all handles: an object of a model, its name, its place."""

    __slots__ = ("index", "model", "name", "start")
    model: Model
    name: str
    index: int
    start: int
    store: ClassVar[str]
    kind: ClassVar[str]

    def __init__(self, model: Model, name: str) -> None:
        self.model, self.name = model, name
        self.index = self.start = -1

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
                        f"{self.name} uses the expression {entry} of another model; define its parameters in this model"
                    )
        return numbers(entries) if mixed else entries  # type: ignore[return-value]

    def values(self, start: int, n: int) -> list[float]:
        """Numbers now, from ``start`` relative to the object."""
        at = self.start + start
        return self.model.stores[self.store].x[at : at + n].tolist()

    def entries(self, start: int, n: int) -> list[Number]:
        """Numbers or expressions, from ``start`` relative to the object."""
        return self.model.stores[self.store].entries(self.start + start, n)

    def check(self, values: Sequence[float]) -> None:
        """Raise where the numbers describe no possible object."""

    def recheck(self) -> None:
        """`check` again, after values have changed."""
        self.check(self.values(0, self.size))

    @property
    def size(self) -> int:
        """How many numbers the object has."""
        raise AssertionError(f"{type(self).__name__} must say its size")

    def fields(self) -> dict[str, Field]:
        """Everything that has an address, by name."""
        return {}

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
