"""Units of a user's own parameters, derived from the numbers of the model that they feed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .model.expressions import Program

if TYPE_CHECKING:
    from .model.model import Model

# operations that keep the unit of every argument
_KEEPS = frozenset({"add", "subtract", "negative", "abs", "maximum", "minimum", "hypot"})
# any other number in a product may carry a unit of its own, such as the volume in mass=rho * 0.02
_PURE = frozenset({1.0, 2.0, 0.5})


def parameter_units(model: Model, program: Program) -> dict[int, str]:
    """Units of places in V, those that are known.

    Only numbers that a parameter feeds as it is, or through sums, signs, lengths, doubles and halves, tell its unit, and only
    where all of them say the same. Cost O(objects + size of the expressions).
    """
    units = slot_units(model)
    said: dict[int, set[str]] = {}
    for kind, store in model.stores.items():
        for slot, expression in store.driven.items():
            unit = units.get((kind, slot), "")
            if unit:
                for place in _plain(program, program.place_of(expression)):
                    said.setdefault(place, set()).add(unit)
    return {place: next(iter(found)) for place, found in said.items() if len(found) == 1}


def slot_units(model: Model) -> dict[tuple[str, int], str]:
    """The unit of every number of a model by store and slot. Directions of axes have none."""
    out = {}
    items = [*model.items.values(), *([model.gravity_item] if model.gravity_item is not None else [])]
    for item in items:
        for field in item.fields().values():
            if field.kind in ("axis", "orientation"):
                continue
            for slots, unit in zip(field.slots, field.units, strict=True):
                out.update({(field.store or item.store, slot): unit for slot in slots})
    return out


def _plain(program: Program, root: int) -> set[int]:
    """Places in V whose numbers reach a node with their unit kept."""
    out, stack, seen = set(), [root], set()
    while stack:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        name, args = program.nodes[node]
        if isinstance(name, int):
            out.add(name)
        elif name in _KEEPS:
            stack.extend(args)
        elif name == "multiply":
            stack.extend(a for a, b in (args, args[::-1]) if _pure(program, b))
        elif name == "divide" and _pure(program, args[1]):
            stack.append(args[0])
    return out


def _pure(program: Program, node: int) -> bool:
    name, number = program.nodes[node]
    return name is None and abs(number) in _PURE


def unit_note(labels: Sequence[str], units: Sequence[str]) -> str | None:
    """A line for below a table: which parameters have no unit and why; None where all have one."""
    blank = [label for label, unit in zip(labels, units, strict=True) if not unit]
    if not blank:
        return None
    named = ", ".join(blank[:4]) + (f" and {len(blank) - 4} more" if len(blank) > 4 else "")
    return (
        f"no unit is known of {named}: a number without one, or a parameter that feeds numbers of different units or only "
        "products and functions"
    )
