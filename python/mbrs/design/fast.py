"""The fast path of sweeps: whole blocks of designs in the core, where a model and its outputs allow it.

The core computes the numbers of a design, the expressions of its parameters included, without Python. A design that it does not decide
by itself (a value out of its range, a loop that does not close, modes that need the factors of the model) comes back uncomputed; then
the model is set and computed as any other, so that results, errors and messages do not depend on the path.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from ..errors import MbrsError
from ..linear.sparse_modes import is_large
from ..linear.stiffness_factor import GEOMETRIC
from ..model.addresses import Target, driver, target
from ..model.bodies import Body
from ..model.book import Item
from ..model.forces import Element
from ..model.function_calls import FunctionCall
from ..model.joint import Joint
from ..model.model import Model
from ..model.schema import LAW_OF_CODE
from ..model.tables import offsets
from ..system.compiled import compiled
from ..system.effects import deciding_places, effects
from .outputs import Modes

# Seconds of a block of designs, after which the client looks for Ctrl-C.
_BLOCK = 0.05
_DERIVED = ("frequency_derivative", "damping_derivative")

Place = tuple[int | None, list[int]]


class _PythonDecides(Exception):
    """Something that the core does not do by itself."""


@dataclass(frozen=True)
class Block:
    """Results of some designs: which are ``computed`` (m,), on which Python has a ``remark``, the ``count`` of their modes, and their
    numbers one behind the other.
    """

    computed: np.ndarray
    seconds: np.ndarray
    remark: np.ndarray
    count: np.ndarray
    numbers: dict[str, np.ndarray]


class FastModes:
    """Modes of the designs of one model, by one plan in the core."""

    def __init__(self, plan: Any, shape: tuple[int, ...] | None) -> None:
        self._plan, self._shape = plan, shape
        self._size = 1

    def rows(self, block: Block) -> list[dict[str, np.ndarray]]:
        """The outputs of each design that was computed."""
        out, at = [], 0
        for count in block.count[block.computed].tolist():
            found = {name: block.numbers[name][at : at + count] for name in ("frequency", "damping")}
            if self._shape is not None:
                p = int(np.prod(self._shape))
                part = slice(at * p, (at + count) * p)
                found |= {name: block.numbers[name][part].reshape(count, *self._shape) for name in _DERIVED}
            at += count
            out.append(found)
        return out

    def compute(self, values: np.ndarray) -> Block:
        """The next designs of ``values``: as many as take a moment."""
        start = time.perf_counter()
        with core_errors():
            r = self._plan.compute(np.ascontiguousarray(values[: self._size]))
        one = (time.perf_counter() - start) / len(r["count"])
        self._size = max(1, min(4 * self._size, int(_BLOCK / max(one, 1e-9))))
        numbers = {name: r[name] for name in ("frequency", "damping", *_DERIVED)}
        return Block(r["count"] >= 0, r["seconds"], r["remark"], r["count"], numbers)


def fast_modes(make: Callable[[], Any], names: Sequence[str], outputs: Any) -> FastModes | None:
    """The fast path of outputs by the designs of ``names``, or None where Python computes every design."""
    if not isinstance(outputs, Modes):
        return None
    try:
        return _planned(make(), names, outputs)
    except (_PythonDecides, MbrsError):
        return None


def _planned(model: Any, names: Sequence[str], outputs: Modes) -> FastModes:
    if not isinstance(model, Model) or _calls_python(model) or is_large(model, outputs.n):
        raise _PythonDecides
    columns = [_column(model, target(model, name)) for name in names]
    if len({entry for one in columns for entry in _entries(one)}) < sum(len(_entries(one)) for one in columns):
        raise _PythonDecides  # two columns set the same number
    addresses = [target(model, name) for name in outputs.parameters]
    by = [place for one in addresses for place in _directions(model, one)]
    base, program = offsets(model), driver(model)
    driven = [
        (base[kind] + slot, node)
        for kind, slots, nodes in program.writes
        for slot, node in zip(slots.tolist(), nodes.tolist(), strict=True)
    ]
    touched = [one.item for name in names if (one := target(model, name)).group is not None and one.group.checked]
    rules = [
        rule for item in dict.fromkeys([*touched, *program.recheck]) if item is not None for rule in _rules(item, base)
    ]
    lengths = [place for name, (_, place) in zip(names, columns, strict=True) if target(model, name).name == "length"]
    rules += [("not negative", place[0], 0) for place in lengths]
    with core_errors():
        system = compiled(model)
        plan = _core.DesignPlan(
            system,
            model.space.values,
            columns,
            program.program.nodes,
            driven,
            rules,
            by,
            outputs.n,
            outputs.at == "equilibrium",
            _elastic(model, [*columns, (None, [slot for slot, _ in driven])]),
        )
    shape = None
    if addresses:
        shape = addresses[0].shape if len(addresses) == 1 and addresses[0].shape else (len(by),)
    return FastModes(plan, shape)


def _elastic(model: Model, changed: Sequence[Place]) -> bool | None:
    """True where the stiffness holds elastic elements alone, whatever the design; None where that depends on the design."""
    base = offsets(model)
    deciding = {base[kind] + int(i) for kind, places in deciding_places(model) for i in places}
    if any(not deciding.isdisjoint(numbers) for _, numbers in changed):
        return None
    return not GEOMETRIC & set(effects(model).on)


def _entries(place: Place) -> list[tuple[bool, int]]:
    return [(True, place[0])] if place[0] is not None else [(False, i) for i in place[1]]


def _calls_python(model: Any) -> bool:
    """True where laws or motions are Python functions, or laws have states with rates, of which modes know by another way."""
    laws = [law for all_ in model.laws.values() for law in all_]
    called = any(isinstance(law.body, FunctionCall) for law in laws) or any(
        m.function is not None for m in model.motions
    )
    return called or any(law.body is None and LAW_OF_CODE[law.code].state == "rate" for law in laws)


def _column(model: Any, one: Target) -> Place:
    """The number that a design sets by an address."""
    if one.group is None or one.item is None:
        if one.shape != ():
            raise _PythonDecides
        return one.components[0], []
    plain = one.group.kind in ("plain", "both") and one.shape == ()
    if not plain or (one.name == "length" and not one.item.has("length")):
        raise _PythonDecides
    slots = one.group.slots[one.components[0]]
    if any(slot in model.stores[one.store].driven for slot in slots):
        raise _PythonDecides
    start = offsets(model)[one.store]
    return None, [start + slot for slot in slots]


def _directions(model: Any, one: Target) -> list[Place]:
    if one.group is None:
        return [(place, []) for place in one.components]
    if one.group.kind not in ("plain", "both"):
        raise _PythonDecides  # turning an axis or an orientation depends on its values
    start = offsets(model)[one.store]
    return [(None, [start + slot for slot in one.group.slots[component]]) for component in one.components]


def _rules(item: Item, base: dict[str, int]) -> list[tuple[str, int, int]]:
    """Rules for the numbers of an object, at least as strict as its own check."""
    if type(item).check is not Item.check or type(item).recheck is not Item.recheck:
        raise _PythonDecides
    start, block, rules = base[item.store] + item.start, item.table.block, []
    for field, place in item.table.checked:
        first, n = start + place.start, place.stop - place.start
        if field.check == "positive":
            rules.append(("positive", first, 0))
        elif field.check == "not negative":
            rules += [("not negative", first, 0)] if item.has(field.name) else []
        elif item.uses(field):
            rules.append(("not zero", first, n))
    together = type(item).check_together
    if together is Body.check_together:
        rules += [("positive", start + block.place("mass"), 0), ("inertia", start + block.place("inertia"), 0)]
    elif together is Element.check_together:
        if item.table.type == "spring_damper":
            rules.append(("apart", start + block.place("at_a"), start + block.place("at_b")))
    elif together is Joint.check_together:
        if "axis2" in item.table.axes and not item.has("orientation"):
            raise _PythonDecides
        if item.table.type == "distance":
            rules.append(("apart", start + block.place("at_a"), start + block.place("at_b")))
    elif together is not Item.check_together:
        raise _PythonDecides
    return rules
