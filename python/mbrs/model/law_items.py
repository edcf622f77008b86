"""Laws of elements and joints of a model: how ``law=`` is read and where its numbers live."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .._lib.checks import is_list
from .book import Group, Item
from .function_calls import FunctionCall
from .function_law import FunctionLaw
from .names import problem, shown
from .numbers import Number, scalar
from .schema import LAW_OF_CODE
from .tracing import program_lines, read_program


class LawItem(Item):
    """One law on one relative coordinate of an element or a joint, or a function on several.

    ``body`` of a function is its program (nodes, roots) or the `FunctionCall` of the slow path; None of the known laws.
    """

    __slots__ = ("body", "code", "components", "n", "owner", "uses_rate")
    body: Any
    code: int
    components: tuple[int, ...]
    n: int
    owner: Any
    uses_rate: bool
    kind = "law"

    @property
    def component(self) -> int:
        """The coordinate of a known law."""
        return self.components[0]

    def described(self) -> dict[str, Any]:
        """The table of a file."""
        if self.body is None:
            return {"type": self.name, "code": self.code, "values": self.entries()}
        if isinstance(self.body, FunctionCall):
            return {"type": self.name, **self.body.described()}
        return {"type": self.name, "program": program_lines(*self.body), "values": self.entries()}

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


class SavedFunction:
    """A function law read from a file: the lines of its program and its numbers."""

    def __init__(self, lines: Sequence[Any], values: Sequence[Any]) -> None:
        self.lines, self.values = lines, tuple(values)


class SavedCall:
    """The two functions of the slow path read from a file, or their names."""

    def __init__(self, function: Any, derivatives: Any) -> None:
        self.function, self.derivatives = function, derivatives


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
    for components, one in _by_component(owner.name + ".law", law, n, names):
        made.append(_new_law(owner, components, one))
    return NewLaws(owner, made)


def _by_component(where: str, law: Any, n: int, names: Sequence[str]) -> list[tuple[tuple[int, ...], Any]]:
    if law is None:
        return []
    if n == 0:
        raise problem(where, "is given, but there is no free coordinate for it to act on")
    if isinstance(law, Mapping):
        out = []
        for key, value in law.items():
            several = key.split() if isinstance(key, str) else list(key) if is_list(key) else [key]
            for one in several:
                if one not in names or several.count(one) > 1:
                    raise problem(where, f"has no coordinates {shown(key)}; known: {', '.join(names)}, each once")
            out += [(tuple(names.index(k) for k in several), one) for one in _many(value)]
        return out
    if n == 1:
        return [((0,), one) for one in _many(law)]
    if callable(law) or isinstance(law, FunctionLaw | SavedFunction | SavedCall):
        return [(tuple(range(n)), law)]
    if not isinstance(law, (list, tuple)) or len(law) != n:
        raise problem(
            where, f"must be {n} laws or None, one for each of {', '.join(names)}, or {{name: law}}; got {shown(law)}"
        )
    return [((i,), one) for i, entry in enumerate(law) for one in _many(entry)]


def _many(law: Any) -> list[Any]:
    if law is None:
        return []
    return list(law) if isinstance(law, (list, tuple)) else [law]


def _new_law(owner: Any, components: tuple[int, ...], law: Any) -> tuple[LawItem, list[Number]]:
    where = owner.name + ".law"
    if callable(law):
        law = FunctionLaw(law)
    if getattr(law, "w", None) is not None:
        raise problem(where, "has w=, a direction for mb.MechanicalSystem; here the joint or element is the direction")
    if isinstance(law, FunctionLaw | SavedFunction | SavedCall):
        return _new_function(owner, components, law, where)
    if len(components) > 1:
        raise problem(where, f"is {shown(law)} on several coordinates; only mb.FunctionLaw acts on more than one")
    code, values = getattr(law, "code", None), getattr(law, "values", None)
    if isinstance(code, bool) or not isinstance(code, int) or values is None or callable(values):
        raise problem(where, f"must be a law such as mb.Cubic(1e9), got {shown(law)}")
    name = law.name if isinstance(law, SavedLaw) else type(law).__name__
    item = LawItem(owner.model, name)
    entries = [scalar(v, where) for v in values]
    item.owner, item.components, item.code, item.n = owner, components, code, len(entries)
    item.body, item.uses_rate = None, code in LAW_OF_CODE[code].rate_codes if code in LAW_OF_CODE else False
    item.evaluated(entries)
    return item, entries


def _new_function(
    owner: Any, components: tuple[int, ...], law: FunctionLaw | SavedFunction | SavedCall, where: str
) -> tuple[LawItem, list[Number]]:
    m = len(components)
    item = LawItem(owner.model, "FunctionLaw")
    item.owner, item.components, item.code = owner, components, -1
    entries: list[Number] = []
    if isinstance(law, SavedCall) or (isinstance(law, FunctionLaw) and law.derivatives is not None):
        item.body, item.uses_rate = FunctionCall(law.function, law.derivatives, m, where), True
        item.body.try_now()
    else:
        inputs = m if m > 1 else 0
        if isinstance(law, FunctionLaw):
            program, numbers = law.traced(inputs, where)
        else:
            program, numbers = read_program(law.lines, inputs, len(law.values), where), list(law.values)
        entries = [scalar(v, where) for v in numbers]
        item.body, item.uses_rate = (program.nodes, program.roots), any(program.core.uses()[1 + m : 1 + 2 * m])
    item.n = len(entries)
    item.evaluated(entries)
    return item, entries


def law_fields(owner: Any) -> dict[str, Group]:
    """``law[i]``: the numbers of all laws of an owner, one after the other. They live in the store of laws."""
    items = owner.model.laws_of.get((owner.kind, owner.index), ())
    slots = tuple((law.start + i,) for law in items for i in range(law.n))
    return (
        {"law": Group(slots, (len(slots),), ("",) * len(slots), store=items[0].store, checked=False)} if slots else {}
    )
