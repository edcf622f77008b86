"""Addresses of numbers, from "leg0.at_b[2]" or "V[0,1]" to places in a model; reading and changing what they name."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import ModelError, NameNotFoundError
from .argument_checks import inertia_numbers
from .bodies import INERTIA_PLACE
from .book import Book, Group, Item
from .expressions import Expression, Program
from .names import nearest, not_found, problem, shown
from .numbers import numbers, shape_of
from .parameters import checked, labels

_ADDRESS = re.compile(r"([^.\[\]]+)(?:\.([^.\[\]]+))?(?:\[([^\[\]]*)\])?")
_INERTIA_INDEX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Target:
    """Object, field and index of an address.

    For a parameter ``item`` and ``group`` are None and ``components`` are places in V. Otherwise ``components`` count
    within the group (for axes and orientations: the world axis to turn about). ``shape`` is () for one number.
    """

    address: str
    components: tuple[int, ...]
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    item: Item | None = None
    group: Group | None = None
    name: str = ""
    store: str = ""

    @property
    def is_inertia(self) -> bool:
        """True for the inertia of a body, whose six numbers stand for a symmetric matrix."""
        return self.name == "inertia"


def target(book: Book, address: str) -> Target:
    """Target of an address, or an error with the nearest known one; kept while the structure stays."""
    kept: dict[str, Target] = book.cache.setdefault("targets", {})
    found = kept.get(address) if isinstance(address, str) else None
    if found is None:
        found = kept[address] = _resolved(book, address)
    return found


def _resolved(book: Book, address: object) -> Target:
    if not isinstance(address, str):
        raise ModelError(f"an address must be a string such as 'payload.mass' or 'k_leg', got {shown(address)}")
    match = _ADDRESS.fullmatch(address.strip())
    if match is None:
        raise ModelError(
            f"the address {shown(address)} must read like 'k_leg', 'V[0,1]', 'payload.mass' or 'leg0.at_b[2]'"
        )
    name, field, index = match.groups()
    if field is None and name == "gravity":
        return _gravity(book, address, index)
    if field is None:
        return _parameter(book, address, name, index)
    item = book.items.get(name)
    if item is None:
        raise not_found(f"the address {shown(address)} is unknown: no object", name, [*book.items, *book.space.names])
    fields = item.fields()
    if field not in fields:
        raise _no_field(item, field, list(fields))
    return _in_group(item, field, fields[field], index)


def _no_field(item: Item, field: str, known: list[str]) -> ModelError:
    hint = ""
    if field in ("k", "c", "preload") and field not in known:
        hint = f". It was defined without {field}=: give {field}=0.0 there to vary it"
    elif field == "orientation" and "axis" in known:
        hint = ". It was defined by axis=: vary .axis"
    elif field in ("axis", "axis2") and "orientation" in known:
        hint = ". It was defined by orientation=: vary .orientation"
    elif field == "at" and "at_a" in known:
        hint = ". It has two points: .at_a and .at_b"
    guess = nearest(field, known)
    near = "" if guess is None else f"; did you mean {guess!r}?"
    there = f"known: {', '.join(known)}" if known else "there are none"
    return NameNotFoundError(
        f"no number of {item.kind} {shown(item.name)} is called {shown(field)}{near}{hint}; {there}"
    )


def _parameter(book: Book, address: str, name: str, index: str | None) -> Target:
    space = book.space
    if name not in space.names:
        if name in book.items:
            known = ", ".join(f"{name}.{field}" for field in book.items[name].fields())
            raise not_found(
                f"{shown(name)} is a {book.items[name].kind}, not a number ({known}); no parameter", name, space.names
            )
        raise not_found("no parameter", name, [*space.names, *book.items])
    start, shape = space.names[name]
    if index is None:
        n = int(np.prod(shape))
        return Target(address, tuple(range(start, start + n)), shape, tuple(labels(name, shape)))
    place = _index(address, index, shape)
    flat = int(np.ravel_multi_index(place, shape))
    return Target(address, (start + flat,), (), (labels(name, shape)[flat],))


def _gravity(book: Book, address: str, index: str | None) -> Target:
    item = book.gravity_item
    if item is None:
        raise not_found("the model has no gravity (give gravity= to mb.Model): no number", address, book.space.names)
    return _in_group(item, "", item.fields()["gravity"], index)


def _in_group(item: Item, name: str, group: Group, index: str | None) -> Target:
    base = f"{item.name}.{name}" if name else "gravity"
    turned = group.kind in ("axis", "orientation")
    shape = (3,) if turned else group.shape
    store = group.store or item.store
    if index is None:
        n = len(group.slots) if not turned else 3
        names = [f"{base}[{i},{j}]" for i, j in _INERTIA_INDEX] if name == "inertia" else labels(base, shape)
        return Target(base, tuple(range(n)), shape, tuple(names), item, group, name, store)
    address = f"{base}[{index}]"
    if name == "inertia":
        i, j = _index(address, index, (3, 3))
        component = INERTIA_PLACE[i][j]
    else:
        component = int(np.ravel_multi_index(_index(address, index, shape), shape)) if shape else 0
        if not shape:
            raise ModelError(f"the address {shown(address)} has an index, but {base} is one number")
    return Target(address, (component,), (), (address,), item, group, name, store)


def _index(address: str, text: str, shape: tuple[int, ...]) -> tuple[int, ...]:
    parts = text.split(",")
    try:
        place = tuple(int(part) for part in parts)
    except ValueError:
        raise ModelError(
            f"the index of the address {shown(address)} must be whole numbers such as [2] or [0,1]"
        ) from None
    if len(place) != len(shape):
        need = "no index: it is one number" if not shape else f"{len(shape)} numbers in its index, its shape is {shape}"
        raise ModelError(f"the address {shown(address)} needs {need}")
    if any(not 0 <= i < n for i, n in zip(place, shape, strict=True)):
        raise ModelError(
            f"the index of the address {shown(address)} is out of range: the shape is {shape}, counted from 0"
        )
    return place


# --- reading and changing: expressions evaluated, checks repeated, all or nothing -----


class Driver:
    """All expressions of a model as one program, and where their numbers go."""

    def __init__(self, book: Book) -> None:
        self.version: int = book.structure_version
        places = [(kind, i, e) for kind, store in book.stores.items() for i, e in store.driven.items()]
        self.program = Program([e for _, _, e in places])
        self.writes = []
        for kind in dict.fromkeys(kind for kind, _, _ in places):
            at = [n for n, place in enumerate(places) if place[0] == kind]
            slots = np.array([places[n][1] for n in at])
            self.writes.append((kind, slots, np.array([self.program.roots[n] for n in at])))
        self.recheck = _driven_items(book)

    def run(self, book: Book) -> None:
        """Evaluate at the present V and write the numbers; nothing is written when an expression fails."""
        w = np.array(self.program.evaluate(book.space.values))
        for kind, slots, nodes in self.writes:
            np.frombuffer(book.stores[kind].x)[slots] = w[nodes]

    def jacobian(self, book: Book) -> dict[int, tuple[list[int], list[float], list[str]]]:
        """d(numbers)/dV: for every place in V its (slots, derivatives, stores)."""
        w = self.program.evaluate(book.space.values)
        by_node: dict[int, dict[int, float]] = {}
        out: dict[int, tuple[list[int], list[float], list[str]]] = {}
        for kind, slots, nodes in self.writes:
            for slot, node in zip(slots.tolist(), nodes.tolist(), strict=True):
                if node not in by_node:
                    by_node[node] = self.program.gradient(node, w)
                for index, slope in by_node[node].items():
                    rows, values, stores = out.setdefault(index, ([], [], []))
                    rows.append(slot)
                    values.append(slope)
                    stores.append(kind)
        return out


def _driven_items(book: Book) -> list[Item]:
    """Objects that check themselves and of which an expression drives a number that matters to the check."""
    out = []
    for item in book.items.values():
        driven = book.stores[item.store].driven
        if driven and not driven.keys().isdisjoint(range(item.start, item.start + item.size)):
            relevant = (g for g in item.fields().values() if g.checked)
            if any(slot in driven for group in relevant for slots in group.slots for slot in slots):
                out.append(item)
    return out


def driver(book: Book) -> Driver:
    """The compiled expressions, renewed when objects were added."""
    cached: Driver | None = book.cache.get("driver")
    if cached is None or cached.version != book.structure_version:
        cached = book.cache["driver"] = Driver(book)
    return cached


def adopt(book: Book, like: Book) -> None:
    """Take over the compiled expressions and the known addresses of an equal book, so that a copy does not find them anew."""
    if book.structure_version != like.structure_version:
        return
    known = driver(like)
    own = copy(known)
    own.recheck = [book.items[item.name] for item in known.recheck]
    book.cache["driver"] = own
    book.cache["targets"] = {
        address: one if one.item is None else replace(one, item=_same_item(book, like, one.item))
        for address, one in like.cache.get("targets", {}).items()
    }


def _same_item(book: Book, like: Book, item: Item) -> Item | None:
    return book.gravity_item if item is like.gravity_item else book.items[item.name]


def read(book: Book, target: Target) -> Any:
    """The numbers of an address."""
    if target.group is None or target.item is None:
        return _shaped([book.space.values[i] for i in target.components], target.shape)
    item, group = target.item, target.group
    x = book.stores[target.store].x
    if target.name == "length" and not item.has("length"):
        return math.dist(item.values("at_a"), item.values("at_b"))
    whole = [x[slots[0]] for slots in group.slots]
    if target.shape == ():
        return whole[target.components[0]]
    if target.is_inertia:
        return np.array([[whole[p] for p in row] for row in INERTIA_PLACE])
    return _shaped(whole, group.shape)


def _shaped(values: Sequence[float], shape: tuple[int, ...]) -> Any:
    return values[0] if shape == () else np.array(values).reshape(shape)


def assign(book: Book, changes: Sequence[tuple[Target, Any]]) -> bool:
    """Make all changes or none. True if the structure of Tables changed (a spring got a length of its own)."""
    space = book.space
    undo: list[tuple[str, int, float]] = []
    before = space.values.copy()
    compiled = driver(book)
    try:
        touched = _write_all(book, changes, undo)
        if space.values != before:
            compiled.run(book)
            touched.extend(compiled.recheck)
        for item in dict.fromkeys(touched):
            item.recheck()
        given: list[Any] = [t.item for t, _ in changes if t.name == "length"]
        for owner in given:
            length = book.stores[owner.store].x[owner.fields()["length"].slots[0][0]]
            if length < 0.0:
                raise problem(f"{owner.name}.length", f"must not be negative, got {length:g}")
    except BaseException:
        for kind, slot, old in reversed(undo):
            book.stores[kind].x[slot] = old
        if space.values != before:
            space.assign(0, before)
            compiled.run(book)
        raise
    return _flag_lengths(given)


def _flag_lengths(items: Sequence[Any]) -> bool:
    fresh = [item for item in items if not item.has("length")]
    for item in fresh:
        item.flags |= item.table.block.fields["length"].bit
    return bool(fresh)


def _write_all(book: Book, changes: Sequence[tuple[Target, Any]], undo: list[tuple[str, int, float]]) -> list[Item]:
    touched: list[Item] = []
    for target, value in changes:
        if target.group is None or target.item is None:
            new = checked(target.address, value, target.shape)
            book.space.assign(target.components[0], new.ravel().tolist())
            continue
        x = book.stores[target.store].x
        for slot, new_value in _writes(book, target, value):
            undo.append((target.store, slot, x[slot]))
            x[slot] = new_value
        if target.group.checked:
            touched.append(target.item)
    return touched


def _writes(book: Book, target: Target, value: Any) -> list[tuple[int, float]]:
    group = target.group
    if group is None:
        return []
    if group.kind in ("axis", "orientation"):
        if target.shape == ():
            raise ModelError(
                f"{target.address} cannot be set alone: the index of an axis or orientation names a rotation; "
                f"set {target.address.partition('[')[0]} whole"
            )
        new = checked(target.address, value, group.shape).tolist()
        components = tuple(range(len(group.slots)))
    elif target.is_inertia and target.shape != ():
        given = checked(target.address, value, (3,) if shape_of(value) == (3,) else (3, 3))
        new, components = numbers(inertia_numbers(given, target.address)), target.components
    else:
        new, components = checked(target.address, value, target.shape).ravel().tolist(), target.components
    out = []
    driven = book.stores[target.store].driven
    for component, number in zip(components, new, strict=True):
        for slot in group.slots[component]:
            if slot in driven:
                raise _is_driven(target, driven[slot])
            out.append((slot, number))
    return out


def _is_driven(target: Target, expression: Expression) -> ModelError:
    names = sorted({arg for op, arg in Program([expression]).nodes if isinstance(op, int)})
    return ModelError(
        f"{target.address} is driven by the expression {shown(str(expression))[1:-1]} and cannot be set; "
        f"set {', '.join(map(repr, names))} instead"
    )
