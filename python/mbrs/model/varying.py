"""Changing the numbers of a model: expressions re-evaluated, checks repeated, all or nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from ..parameter_units import parameter_units
from .addresses import Target
from .bodies import INERTIA_PLACE, inertia_numbers
from .book import Item
from .expressions import Expression, Program
from .forces import LENGTH_GIVEN
from .names import problem
from .numbers import numbers, shape_of
from .parameters import checked

if TYPE_CHECKING:
    from .model import Model

# Fields whose numbers an object checks together; the others only have to be finite.
_CHECKED = frozenset(
    {"mass", "inertia", "orientation", "axis", "axis2", "at", "at_a", "at_b", "length", "radius", "angle"}
    | {"t", "x_t", "y_t", "z_t"}
)


class Driver:
    """All expressions of a model as one program, and where their numbers go."""

    def __init__(self, model: Model) -> None:
        self.version = model.structure_version
        places = [(kind, i, e) for kind, store in model.stores.items() for i, e in store.driven.items()]
        self.program = Program([e for _, _, e in places])
        self._writes = []
        for kind in dict.fromkeys(kind for kind, _, _ in places):
            at = [n for n, place in enumerate(places) if place[0] == kind]
            slots = np.array([places[n][1] for n in at])
            self._writes.append((kind, slots, np.array([self.program.roots[n] for n in at])))
        self.recheck = _driven_items(model)
        self._units: dict[int, str] | None = None

    def run(self, model: Model) -> None:
        """Evaluate at the present V and write the numbers; nothing is written when an expression fails."""
        w = np.array(self.program.evaluate(model.space.values))
        for kind, slots, nodes in self._writes:
            np.frombuffer(model.stores[kind].x)[slots] = w[nodes]

    def units(self, model: Model) -> dict[int, str]:
        """Units of places in V, those that follow from the numbers which they feed."""
        if self._units is None:
            self._units = parameter_units(model, self.program)
        return self._units

    def jacobian(self, model: Model) -> dict[int, tuple[list[int], list[float], list[str]]]:
        """d(numbers)/dV: for every place in V its (slots, derivatives, stores)."""
        w = self.program.evaluate(model.space.values)
        by_node: dict[int, dict[int, float]] = {}
        out: dict[int, tuple[list[int], list[float], list[str]]] = {}
        for kind, slots, nodes in self._writes:
            for slot, node in zip(slots.tolist(), nodes.tolist(), strict=True):
                if node not in by_node:
                    by_node[node] = self.program.gradient(node, w)
                for index, slope in by_node[node].items():
                    rows, values, stores = out.setdefault(index, ([], [], []))
                    rows.append(slot)
                    values.append(slope)
                    stores.append(kind)
        return out


def _driven_items(model: Model) -> list[Item]:
    """Objects that check themselves and of which an expression drives a number that matters to the check."""
    out = []
    for item in model.items.values():
        driven = model.stores[item.store].driven
        if driven and not driven.keys().isdisjoint(range(item.start, item.start + item.size)):
            relevant = (f for name, f in item.fields().items() if name in _CHECKED)
            if any(slot in driven for field in relevant for slots in field.slots for slot in slots):
                out.append(item)
    return out


def read(model: Model, target: Target) -> Any:
    """The numbers of an address."""
    if target.field is None or target.item is None:
        return _shaped([model.space.values[i] for i in target.components], target.shape)
    item, field = target.item, target.field
    x = model.stores[target.store].x
    if target.name == "length" and not item.flags & LENGTH_GIVEN:  # type: ignore[attr-defined]
        values = item.values(0, 6)
        return math.dist(values[:3], values[3:])
    whole = [x[slots[0]] for slots in field.slots]
    if target.shape == ():
        return whole[target.components[0]]
    if target.is_inertia:
        return np.array([[whole[p] for p in row] for row in INERTIA_PLACE])
    return _shaped(whole, field.shape)


def _shaped(values: Sequence[float], shape: tuple[int, ...]) -> Any:
    return values[0] if shape == () else np.array(values).reshape(shape)


def assign(model: Model, changes: Sequence[tuple[Target, Any]]) -> bool:
    """Make all changes or none. True if the structure of Tables changed (a spring got a length of its own)."""
    space = model.space
    undo: list[tuple[str, int, float]] = []
    before = space.values.copy()
    driver = model.driver()
    try:
        touched = _write_all(model, changes, undo)
        if space.values != before:
            driver.run(model)
            touched.extend(driver.recheck)
        for item in dict.fromkeys(touched):
            item.recheck()
        given: list[Any] = [t.item for t, _ in changes if t.name == "length"]
        for owner in given:
            length = model.stores[owner.store].x[owner.fields()["length"].slots[0][0]]
            if length < 0.0:
                raise problem(f"{owner.name}.length", f"must not be negative, got {length:g}")
    except BaseException:
        for kind, slot, old in reversed(undo):
            model.stores[kind].x[slot] = old
        if space.values != before:
            space.assign(0, before)
            driver.run(model)
        raise
    return _flag_lengths(given)


def _flag_lengths(items: Sequence[Any]) -> bool:
    fresh = [item for item in items if not item.flags & LENGTH_GIVEN]
    for item in fresh:
        item.flags |= LENGTH_GIVEN
    return bool(fresh)


def _write_all(model: Model, changes: Sequence[tuple[Target, Any]], undo: list[tuple[str, int, float]]) -> list[Item]:
    touched: list[Item] = []
    for target, value in changes:
        if target.field is None or target.item is None:
            new = checked(target.address, value, target.shape)
            model.space.assign(target.components[0], new.ravel().tolist())
            continue
        x = model.stores[target.store].x
        for slot, new_value in _writes(model, target, value):
            undo.append((target.store, slot, x[slot]))
            x[slot] = new_value
        if target.name in _CHECKED:
            touched.append(target.item)
    return touched


def _writes(model: Model, target: Target, value: Any) -> list[tuple[int, float]]:
    field = target.field
    assert field is not None
    if field.kind in ("axis", "orientation"):
        if target.shape == ():
            raise ModelError(
                f"{target.address} cannot be set alone: the index of an axis or orientation names a rotation; "
                f"set {target.address.partition('[')[0]} whole"
            )
        new = checked(target.address, value, field.shape).tolist()
        components = tuple(range(len(field.slots)))
    elif target.is_inertia and target.shape != ():
        given = checked(target.address, value, (3,) if shape_of(value) == (3,) else (3, 3))
        new, components = numbers(inertia_numbers(given, target.address)), target.components
    else:
        new, components = checked(target.address, value, target.shape).ravel().tolist(), target.components
    out = []
    driven = model.stores[target.store].driven
    for component, number in zip(components, new, strict=True):
        for slot in field.slots[component]:
            if slot in driven:
                raise _is_driven(target, driven[slot])
            out.append((slot, number))
    return out


def _is_driven(target: Target, expression: Expression) -> ModelError:
    names = sorted({arg for op, arg in Program([expression]).nodes if isinstance(op, int)})
    return ModelError(
        f"{target.address} is driven by the expression {expression} and cannot be set; "
        f"set {', '.join(map(repr, names))} instead"
    )
