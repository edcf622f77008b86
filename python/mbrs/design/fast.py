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
from ..linear.frf import ORDER_OUT
from ..linear.sparse_modes import is_large
from ..linear.stiffness_factor import GEOMETRIC
from ..model.addresses import Target, driver, target
from ..model.bodies import Body
from ..model.book import Item
from ..model.forces import Element
from ..model.function_calls import FunctionCall
from ..model.joint import Joint
from ..model.model import Model
from ..model.names import GROUND
from ..model.ports import Port, as_port
from ..model.schema import LAW_OF_CODE, MARKER
from ..model.tables import offsets
from ..system.compiled import compiled
from ..system.effects import deciding_places, effects
from ..system.state import state_of
from .outputs import Analysis, Equilibrium, Frf, Modes

# Seconds of a block of designs, after which the client looks for Ctrl-C.
_BLOCK = 0.05
# Seconds that a design takes at least, by a clock that may not have moved. Only the length of a block depends on it.
_TICK = 1e-9

Place = tuple[int | None, list[int]]


class _PythonDecides(Exception):
    """Something that the core does not do by itself."""


@dataclass(frozen=True)
class Output:
    """An array of a design: its name, its shape (-1 for the number of modes), and whether it is complex."""

    name: str
    shape: tuple[int, ...]
    is_complex: bool = False


@dataclass(frozen=True)
class Block:
    """Results of some designs (m,): which are ``computed``, on which Python has a ``remark``, the ``count`` of their modes, and the
    numbers of those that were computed one behind the other, an array for each output.
    """

    computed: np.ndarray
    seconds: np.ndarray
    remark: np.ndarray
    count: np.ndarray
    arrays: list[np.ndarray]
    outputs: tuple[Output, ...]

    def part(self, first: int, end: int) -> list[tuple[Output, np.ndarray, np.ndarray]]:
        """Each output of the designs from ``first`` to before ``end``, all of which were computed: shapes, and entries as they lie."""
        counts = self.count[first:end]
        before = int(np.maximum(self.count[:first], 0).sum())
        found = []
        for output, array in zip(self.outputs, self.arrays, strict=True):
            each = int(np.prod([m for m in output.shape if m >= 0], dtype=np.int64))
            shapes = np.tile(np.array(output.shape, dtype=np.int64), (len(counts), 1))
            shapes[shapes < 0] = counts if -1 in output.shape else 0
            flat = array.view(np.complex128) if output.is_complex else array
            at = before * each
            found.append((output, shapes, flat[at : at + int(counts.sum()) * each]))
        return found


class FastPlan:
    """One analysis of the designs of a model, by one plan in the core."""

    def __init__(self, plan: Any, outputs: tuple[Output, ...], own: np.ndarray) -> None:
        self._plan, self._outputs, self._own = plan, outputs, own
        self._size = 1

    @property
    def decides(self) -> bool:
        """True where the core computes the model with its own values (1, columns)."""
        with core_errors():
            return bool(self._plan.compute(self._own, 1)["count"][0] >= 0)

    def compute(self, values: np.ndarray, threads: int = 1) -> Block:
        """The next designs of ``values``: as many as take a moment."""
        start = time.perf_counter()
        with core_errors():
            # rows that a cluster has sent may begin at any byte
            r = self._plan.compute(np.require(values[: self._size], requirements=["C", "A"]), threads)
        one = (time.perf_counter() - start) / len(r["count"])
        self._size = max(threads, min(4 * self._size, int(_BLOCK / max(one, _TICK))))
        return Block(r["count"] >= 0, r["seconds"], r["remark"], r["count"], r["arrays"], self._outputs)


def fast_plan(make: Callable[[], Any], names: Sequence[str], outputs: Any) -> FastPlan | None:
    """The fast path of outputs by the designs of ``names``, or None where Python computes every design."""
    if not isinstance(outputs, Analysis):
        return None
    try:
        return _planned(make(), names, outputs)
    except (_PythonDecides, MbrsError):
        return None


def _planned(model: Any, names: Sequence[str], outputs: Analysis) -> FastPlan:
    if not isinstance(model, Model) or _calls_python(model):
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
        plan = _core.DesignPlan(
            compiled(model),
            model.space.values,
            columns,
            program.program.nodes,
            driven,
            rules,
            by,
            outputs.at == "equilibrium",
        )
        made, values = _analysis(model, outputs, plan, [*columns, (None, [slot for slot, _ in driven])])
    shape: tuple[int, ...] = (len(by),)
    if len(addresses) == 1 and addresses[0].shape:
        shape = addresses[0].shape
    derived = (Output(f"{one.name}_derivative", (*_moved(one), *shape), one.is_complex) for one in values)
    own = np.array([[float(model.value(name)) for name in names]])
    return FastPlan(made, (*values, *derived) if addresses else values, own)


def _moved(one: Output) -> tuple[int, ...]:
    """Shape of the change of an output: of a rotation a rotation vector."""
    return one.shape[:-1] if one.name == "rotation" else one.shape


def _analysis(model: Model, outputs: Analysis, plan: Any, changed: Sequence[Place]) -> tuple[Any, tuple[Output, ...]]:
    """The plan of an analysis, and its arrays."""
    if isinstance(outputs, Modes) and not is_large(model, outputs.n):
        values = (Output("frequency", (-1,)), Output("damping", (-1,)))
        return plan.modes(outputs.n, _elastic(model, changed)), values
    if model.airs or any(hasattr(body, "modal") for body in model.bodies):
        raise _PythonDecides  # nodes of flexible bodies, and air beyond its tables
    if isinstance(outputs, Equilibrium):
        n = len(model.bodies)
        return plan.rest(), (Output("position", (n, 3)), Output("rotation", (n, 3, 3)))
    if not isinstance(outputs, Frf) or outputs.kind not in ORDER_OUT:
        raise _PythonDecides
    ports = [[as_port(model, port) for port in ports] for ports in (outputs.inputs, outputs.outputs)]
    if any(port.kind == "motion" or (port.kind == "base" and port.is_rotation) for port in ports[0]):
        raise _PythonDecides
    if any(port.kind != "motion" for port in ports[1]):
        raise _PythonDecides
    if outputs.kind == "transmissibility" and any(port.kind != "base" for port in ports[0]):
        raise _PythonDecides
    omega = [2 * np.pi * f for f in outputs.frequency]
    made = plan.transfer(*([_port(model, port) for port in own] for own in ports), omega, ORDER_OUT[outputs.kind])
    return made, (Output("H", (len(ports[1]), len(ports[0]), len(omega)), True),)


def _port(model: Model, port: Port) -> tuple[int | None, tuple[str, list[float], int], list[float], bool, bool]:
    body = None if port.body == GROUND else model.body_index[port.body]
    at: tuple[str, list[float], int] = ("origin", [], 0)
    if port.point is not None:
        at = ("world", list(port.point), 0)
    elif port.marker is not None:
        marker = model.markers[model.marker_index[port.marker]]
        at = ("marker", [], offsets(model)[marker.store] + marker.start + MARKER.block.place("at"))
    return body, at, list(port.direction), port.is_rotation, port.kind == "base"


def _elastic(model: Model, changed: Sequence[Place]) -> bool | None:
    """True where the stiffness holds elastic elements alone, whatever the design; None where that depends on the design."""
    base = offsets(model)
    deciding = {base[kind] + int(i) for kind, places in deciding_places(model) for i in places}
    if any(not deciding.isdisjoint(numbers) for _, numbers in changed):
        return None
    if not GEOMETRIC & set(effects(model).on):
        return True
    # an effect may be there and have no forces: a preload of zero
    with core_errors():
        system = compiled(model)
        return False if system.is_loaded(state_of(model, system, None).q, []) else None


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
