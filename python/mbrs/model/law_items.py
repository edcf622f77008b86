"""Laws of elements and joints of a model: how ``law=`` is read and where its numbers live."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .book import Group, Item
from .names import problem, shown
from .numbers import Number, scalar


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

    def check(self, values: Sequence[float]) -> None:
        """The constructor of the law has checked its numbers."""

    def _range(self, name: str) -> tuple[int, int]:
        return self.start, self.n


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


def law_fields(owner: Any) -> dict[str, Group]:
    """``law[i]``: the numbers of all laws of an owner, one after the other. They live in the store of laws."""
    items = owner.model.laws_of.get((owner.kind, owner.index), ())
    slots = tuple((law.start + i,) for law in items for i in range(law.n))
    return (
        {"law": Group(slots, (len(slots),), ("",) * len(slots), store=items[0].store, checked=False)} if slots else {}
    )
