"""Addresses of numbers: from "leg0.at_b[2]" or "V[0,1]" to places in a model."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ModelError
from .bodies import INERTIA_PLACE
from .book import Field, Item
from .names import not_found, shown
from .parameters import labels

if TYPE_CHECKING:
    from .model import Model

_ADDRESS = re.compile(r"([^.\[\]]+)(?:\.([^.\[\]]+))?(?:\[([^\[\]]*)\])?")
_INERTIA_INDEX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Target:
    """What an address means.

    For a parameter ``item`` and ``field`` are None and ``components`` are places in V. Otherwise ``components`` count
    within the field (for axes and orientations: the world axis to turn about). ``shape`` is () for one number.
    """

    address: str
    components: tuple[int, ...]
    shape: tuple[int, ...]
    labels: tuple[str, ...]
    item: Item | None = None
    field: Field | None = None
    name: str = ""
    store: str = ""

    @property
    def is_inertia(self) -> bool:
        """True for the inertia of a body, whose six numbers stand for a symmetric matrix."""
        return self.name == "inertia"


def target(model: Model, address: object) -> Target:
    """Resolve an address, or raise with the nearest known one."""
    if not isinstance(address, str):
        raise ModelError(f"an address must be a string such as 'payload.mass' or 'k_leg', got {shown(address)}")
    match = _ADDRESS.fullmatch(address.strip())
    if match is None:
        raise ModelError(
            f"the address {shown(address)} must read like 'k_leg', 'V[0,1]', 'payload.mass' or 'leg0.at_b[2]'"
        )
    name, field, index = match.groups()
    if field is None and name == "gravity":
        return _gravity(model, address, index)
    if field is None:
        return _parameter(model, address, name, index)
    item = model.items.get(name)
    if item is None:
        raise not_found(f"the address {shown(address)} is unknown: no object", name, [*model.items, *model.space.names])
    fields = item.fields()
    if field not in fields:
        raise _no_field(item, field, list(fields))
    return _of_field(item, field, fields[field], index)


def _no_field(item: Item, field: str, known: list[str]) -> ModelError:
    hint = ""
    flags = getattr(item, "flags", 0)
    if field in ("k", "c", "preload") and field not in known:
        hint = f". It was defined without {field}=: give {field}=0.0 there to vary it"
    elif field == "orientation" and "axis" in known:
        hint = ". It was defined by axis=: vary .axis"
    elif field in ("axis", "axis2") and flags & 8:
        hint = ". It was defined by orientation=: vary .orientation"
    elif field == "at" and "at_a" in known:
        hint = ". It has two points: .at_a and .at_b"
    error = not_found(f"no number of {item.kind} {item.name!r}", field, known)
    return type(error)(f"{error}{hint}; known: {', '.join(known)}")


def _parameter(model: Model, address: str, name: str, index: str | None) -> Target:
    space = model.space
    if name not in space.names:
        if name in model.items:
            known = ", ".join(f"{name}.{field}" for field in model.items[name].fields())
            raise not_found(
                f"{name!r} is a {model.items[name].kind}, not a number ({known}); no parameter", name, space.names
            )
        raise not_found("no parameter", name, [*space.names, *model.items])
    start, shape = space.names[name]
    if index is None:
        n = int(np.prod(shape))
        return Target(address, tuple(range(start, start + n)), shape, tuple(labels(name, shape)))
    place = _index(address, index, shape)
    flat = int(np.ravel_multi_index(place, shape))
    return Target(address, (start + flat,), (), (labels(name, shape)[flat],))


def _gravity(model: Model, address: str, index: str | None) -> Target:
    item = model.gravity_item
    if item is None:
        raise not_found("the model has no gravity (give gravity= to mb.Model): no number", address, model.space.names)
    return _of_field(item, "", item.fields()["gravity"], index)


def _of_field(item: Item, name: str, field: Field, index: str | None) -> Target:
    base = f"{item.name}.{name}" if name else "gravity"
    turned = field.kind in ("axis", "orientation")
    shape = (3,) if turned else field.shape
    store = field.store or item.store
    if index is None:
        n = len(field.slots) if not turned else 3
        names = [f"{base}[{i},{j}]" for i, j in _INERTIA_INDEX] if name == "inertia" else labels(base, shape)
        return Target(base, tuple(range(n)), shape, tuple(names), item, field, name, store)
    address = f"{base}[{index}]"
    if name == "inertia":
        i, j = _index(address, index, (3, 3))
        component = INERTIA_PLACE[i][j]
    else:
        component = int(np.ravel_multi_index(_index(address, index, shape), shape)) if shape else 0
        if not shape:
            raise ModelError(f"the address {shown(address)} has an index, but {base} is one number")
    return Target(address, (component,), (), (address,), item, field, name, store)


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
