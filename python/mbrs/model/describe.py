"""A model as plain tables of the arguments that would build it again: what a file holds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from .bodies import Body
from .book import Book, Item
from .drives import Coupler, Drive
from .expressions import Expression
from .flexible import FlexibleBody
from .forces import Load
from .numbers import Number
from .schema import FLEXIBLE_BODY, SHAPES, Field
from .section_loads import ModalLoad

Table = dict[str, Any]


def describe(book: Book, head: Table) -> Iterator[tuple[str, Table]]:
    """Pairs (heading, table) in the order of a file; ``head`` is that of the model."""
    yield "[model]", head
    if book.space.names:
        yield "[parameters]", {name: _parameter(book, name) for name in book.space.names}
    poses = {pose.body: pose for pose in book.poses}
    for body in book.bodies:
        yield "[[body]]", _body(body, poses.get(body.index))
    for joint in book.joints:
        yield "[[joint]]", _add_laws({**_ends(joint), **_numbers(joint)}, joint)
    for drive in book.drives:
        yield "[[drive]]", _drive(drive)
    for coupler in book.couplers:
        yield "[[coupler]]", _coupler(coupler)
    for constraint in book.constraints:
        yield f"[[{constraint.table.heading}]]", constraint.described()
    for element in book.elements:
        yield "[[element]]", _add_laws({**_ends(element), **_numbers(element)}, element)
    for load in book.loads:
        yield "[[load]]", _load(load)
    for marker in book.markers:
        head = {"name": marker.name, "body": _place(book, marker.body, marker.node)}
        yield "[[marker]]", {**head, **_numbers(marker)}
    for air in book.airs:
        yield "[[aerodynamics]]", air.described()


def _parameter(book: Book, name: str) -> Any:
    start, shape = book.space.names[name]
    numbers = np.array(book.space.values[start : start + math.prod(shape)])
    value = numbers.reshape(shape).tolist()
    unit = book.space.units[name]
    return {"value": value, "unit": unit} if unit else value


def _numbers(item: Item) -> Table:
    """The fields of an object that a file needs, in the order of the constructor's arguments."""
    table: Table = {}
    by_name = {field.name: field for field in item.table.fields}
    for argument in item.table.arguments:
        if argument.name == "at" and "at_a" in by_name:
            table["at"] = _points(item)
        elif argument.name in by_name and _is_written(item, by_name[argument.name]):
            table[argument.name] = _shaped(item, by_name[argument.name])
    return table


def _is_written(item: Item, field: Field) -> bool:
    if field.flag or not item.uses(field):
        return item.has(field.name)
    if field.role == "point" or field.name in item.table.required or field.name in item.table.axes:
        return True
    # By text, since -0.0 == 0.0 but the file must give back the same bits.
    entries = item.entries(field.name)
    return _driven(entries) or [repr(e) for e in entries] != [repr(d) for d in field.neutral]


def _driven(entries: Sequence[Number]) -> bool:
    return any(isinstance(e, Expression) for e in entries)


def _shaped(item: Item, field: Field) -> Any:
    """Numbers in the shape in which they were given."""
    entries = item.entries(field.name)
    if field.role == "inertia":
        xx, yy, zz, *products = entries
        if not _driven(products) and all(repr(v) == "0.0" for v in products):
            return [xx, yy, zz]
        xy, xz, yz = products
        return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    shape = item.shapes.get(field.name, () if field.shape == () else (len(entries),))
    if shape == ():
        return entries[0]
    if len(shape) == 2:
        return [entries[shape[1] * i : shape[1] * (i + 1)] for i in range(shape[0])]
    step = shape[0] + 1 if len(field.shape) == 2 else 1
    return entries[::step][: shape[0]]


def _body(body: Body, pose: Item | None) -> Table:
    table: Table = {"name": body.name}
    made = _numbers(body)
    if isinstance(body, FlexibleBody):
        table["modal_body"] = _modal_body(body)
        if body.used:
            table["nodes"] = [body.nodes[i] for i in sorted(body.used)]
        made = {key: value for key, value in made.items() if key in FLEXIBLE_BODY.known}
    if pose is not None:
        made["pose"] = [pose.entries("at"), pose.entries("orientation")]
    if body.shape:
        made["shape"] = body.shape[0] if len(body.shape) == 1 else body.shape
    return {**table, **made}


def _ends(item: Any) -> Table:
    places = {"a": _place(item.model, item.a, item.a_node), "b": _place(item.model, item.b, item.b_node)}
    return {"type": item.type, "name": item.name, **places}


def _place(book: Book, body: int, node: int) -> str:
    """A body, or ``body.node``."""
    name = book.body_name(body)
    return name if node < 0 else f"{name}.{book.bodies[body].nodes[node]}"


def _modal_body(body: FlexibleBody) -> Table:
    """The integrals as they are now: stiffness and damping may have been varied."""
    modal, m = body.modal, body.n_modes
    table: Table = {f.name: getattr(modal, f.name) for f in fields(modal) if f.name != "recipe"}
    for field in SHAPES.block:
        if field.listed == "always":
            table[field.name] = np.array(body.integrals.values(field.name)).reshape(m, m)
    expressions = {k: np.asarray(v, dtype=object).tolist() for k, v in table.pop("driven").items()}
    plain = {
        k: v.tolist() if isinstance(v, np.ndarray) else list(v) if isinstance(v, tuple) else v for k, v in table.items()
    }
    return {**plain, "driven": expressions} if expressions else plain


def _points(item: Item) -> list[Any]:
    a, b = item.entries("at_a"), item.entries("at_b")
    same = all(p is q or (isinstance(p, float) and repr(p) == repr(q)) for p, q in zip(a, b, strict=True))
    return list(a) if item.one_point and same else [a, b]


def _add_laws(table: Table, owner: Any) -> Table:
    by_name: dict[str, list[Table]] = {}
    for law in owner.model.laws_of.get((owner.kind, owner.index), ()):
        key = " ".join(owner.table.coordinates[i] for i in law.components)
        by_name.setdefault(key, []).append(law.described())
    return {**table, "law": by_name} if by_name else table


def _drive(drive: Drive) -> Table:
    joint = drive.model.joints[drive.joint]
    table: Table = {"name": drive.name, "joint": joint.name, "motion": drive.described()}
    return {**table, **_coordinate("coordinate", joint, drive.coordinate)}


def _coupler(coupler: Coupler) -> Table:
    table: Table = {"name": coupler.name}
    for key in ("first", "second"):
        joint = coupler.model.joints[getattr(coupler, key)]
        table[key] = joint.name
        table |= _coordinate(f"{key}_coordinate", joint, getattr(coupler, f"{key}_coordinate"))
    return {**table, **_numbers(coupler)}


def _coordinate(key: str, joint: Item, coordinate: int) -> Table:
    """Named where the joint has several."""
    known = joint.table.coordinates
    return {key: known[coordinate]} if len(known) > 1 else {}


def _load_value(load: Load) -> Any:
    value: list[Any] = list(load.entries("value"))
    for motion in load.motions:
        if motion.function is not None and motion.function.outputs == 3:
            return motion.described()
        value[motion.component] = motion.described()
    return value


def _load(load: Load) -> Table:
    table: Table = {"type": load.type, "name": load.name, "body": _place(load.model, load.body, load.node)}
    if isinstance(load, ModalLoad):
        return {**table, "mode": load.mode + 1, "value": _load_value(load)[0]}
    if load.type == "force":
        table["at"] = load.entries("at")
    if load.node < 0 and load.model.bodies[load.body].modes_and_nodes:
        table["on"] = "frame"
    table["value"] = _load_value(load)
    if load.frame != "world":
        table["frame"] = load.frame
    return table
