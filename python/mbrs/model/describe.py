"""A model as plain tables of the arguments that would build it again: what a file holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from .book import Item
from .drives import Coupler, Drive
from .expressions import Expression
from .flexible import FlexibleBody
from .forces import LENGTH_GIVEN, SIX, Element, Load
from .joints import FRAME_GIVEN, KINDS, Joint
from .model import Model
from .numbers import Number
from .section_loads import ModalLoad

Table = dict[str, Any]


def describe(model: Model) -> Iterator[tuple[str, Table]]:
    """Pairs (heading, table) in the order of a file."""
    head: Table = {"name": model.name}
    if model.gravity_item is not None:
        head["gravity"] = model.gravity_item.entries(0, 3)
    yield "[model]", head
    if model.space.names:
        yield "[parameters]", {name: _value(model, name) for name in model.space.names}
    poses = {pose.body: pose for pose in model.poses}
    for body in model.bodies:
        yield "[[body]]", _body(body, poses.get(body.index))
    for joint in model.joints:
        yield "[[joint]]", _joint(joint)
    for drive in model.drives:
        yield "[[drive]]", _drive(drive)
    for coupler in model.couplers:
        yield "[[coupler]]", _coupler(coupler)
    for element in model.elements:
        yield "[[element]]", _element(element)
    for load in model.loads:
        yield "[[load]]", _load(load)
    for marker in model.markers:
        table = {"name": marker.name, "body": _place(model, marker.body, marker.node), "at": marker.entries(0, 3)}
        yield "[[marker]]", _with_default(table, "orientation", marker.entries(3, 4), (1.0, 0.0, 0.0, 0.0))


def _value(model: Model, name: str) -> Any:
    value = model.value(name)
    return value if isinstance(value, float) else value.tolist()


def _with_default(table: Table, key: str, entries: Sequence[Number], default: Sequence[float]) -> Table:
    # By text, since -0.0 == 0.0 but the file must give back the same bits.
    if any(isinstance(e, Expression) for e in entries) or [repr(e) for e in entries] != [repr(d) for d in default]:
        table[key] = list(entries)
    return table


def _body(body: Item, pose: Item | None) -> Table:
    e = body.entries(0, 23)
    xx, yy, zz, xy, xz, yz = e[11:17]
    table: Table = {"name": body.name}
    flexible = isinstance(body, FlexibleBody)
    if isinstance(body, FlexibleBody):
        table["modal_body"] = _modal_body(body)
        if body.used:
            table["nodes"] = [body.nodes[i] for i in sorted(body.used)]
    else:
        table["mass"], table["inertia"] = e[10], [xx, yy, zz]
        if any(isinstance(v, Expression) or repr(v) != "0.0" for v in (xy, xz, yz)):
            table["inertia"] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    table["at"] = e[0:3]
    zeros = (0.0, 0.0, 0.0)
    _with_default(table, "orientation", e[3:7], (1.0, *zeros))
    for key, start in (("com", 7), ("velocity", 17), ("angular_velocity", 20))[flexible:]:
        _with_default(table, key, e[start : start + 3], zeros)
    if pose is not None:
        table["pose"] = [pose.entries(0, 3), pose.entries(3, 4)]
    return table


def _ends(item: Any) -> Table:
    return {
        "type": item.type,
        "name": item.name,
        "a": _place(item.model, item.a, item.a_node),
        "b": _place(item.model, item.b, item.b_node),
    }


def _place(model: Model, body: int, node: int) -> str:
    """A body, or ``body.node``."""
    name = model.body_name(body)
    return name if node < 0 else f"{name}.{model.bodies[body].nodes[node]}"  # type: ignore[attr-defined]


def _modal_body(body: FlexibleBody) -> Table:
    """The integrals as they are now: stiffness and damping may have been varied."""
    modal, m = body.modal, body.n_modes
    table: Table = {f.name: getattr(modal, f.name) for f in fields(modal)}
    table["K"] = np.array(body.shapes.values(12 * m + 9 * m * m, m * m)).reshape(m, m)
    table["C"] = np.array(body.shapes.values(12 * m + 10 * m * m, m * m)).reshape(m, m)
    return {
        k: v.tolist() if isinstance(v, np.ndarray) else list(v) if isinstance(v, tuple) else v for k, v in table.items()
    }


def _points(item: Any) -> list[Any]:
    a, b = item.entries(0, 3), item.entries(3, 3)
    same = all(p is q or (isinstance(p, float) and repr(p) == repr(q)) for p, q in zip(a, b, strict=True))
    return a if item.one_point and same else [a, b]


def _joint(joint: Joint) -> Table:
    kind = KINDS[joint.type]
    table = {**_ends(joint), "at": _points(joint)}
    if joint.flags & FRAME_GIVEN:
        table["orientation"] = joint.entries(12, 4)
    elif joint.type not in ("fixed", "distance") and (kind.needs_axis or _turned(joint)):
        table["axis"] = joint.entries(6, 3)
        if kind.two_axes:
            table["axis2"] = joint.entries(9, 3)
    for key, start in (("k", 16), ("c", 22), ("preload", 28)):
        if key in joint.shapes:
            entries = joint.entries(start, len(kind.free))
            table[key] = entries[0] if joint.shapes[key] == () else entries
    if joint.flags & LENGTH_GIVEN:
        table["length"] = joint.entries(34, 1)[0]
    if joint.type == "rolling_disc":
        table["radius"] = joint.entries(35, 1)[0]
    return _add_laws(table, joint, kind.coordinates)


def _turned(joint: Joint) -> bool:
    entries = joint.entries(6, 3)
    return any(isinstance(e, Expression) for e in entries) or [repr(e) for e in entries] != ["0.0", "0.0", "1.0"]


def _element(e: Element) -> Table:
    if e.type == "torsion":
        table = {**_ends(e), "at": e.entries(0, 3), "axis": e.entries(3, 3)}
        _numbers(table, e, {"k": 6, "c": 7, "preload": 9})
        return _add_laws(_with_one(table, "angle", e.entries(8, 1)[0]), e, ("angle",))
    table = {**_ends(e), "at": _points(e)}
    if e.type == "spring_damper":
        _numbers(table, e, {"k": 6, "c": 7, "preload": 9})
        if e.flags & LENGTH_GIVEN:
            table["length"] = e.entries(8, 1)[0]
        return _add_laws(table, e, ("u",))
    _with_default(table, "orientation", e.entries(6, 4), (1.0, 0.0, 0.0, 0.0))
    for key, start in (("k", 10), ("c", 46)):
        if key in e.shapes:
            entries = e.entries(start, 36)
            full = e.shapes[key] != (6,)
            table[key] = [entries[6 * i : 6 * i + 6] for i in range(6)] if full else entries[::7]
    if "preload" in e.shapes:
        table["preload"] = e.entries(82, 6)
    return _add_laws(table, e, SIX)


def _numbers(table: Table, item: Item, places: dict[str, int]) -> None:
    for key, place in places.items():
        if key in item.shapes:  # type: ignore[attr-defined]
            table[key] = item.entries(place, 1)[0]


def _with_one(table: Table, key: str, entry: Number) -> Table:
    if isinstance(entry, Expression) or repr(entry) != "0.0":
        table[key] = entry
    return table


def _add_laws(table: Table, owner: Any, names: Sequence[str]) -> Table:
    laws = owner.model.laws_of.get((owner.kind, owner.index), ())
    by_name: dict[str, list[Table]] = {}
    for law in laws:
        made = {"type": law.name, "code": law.code, "values": law.entries(0, law.n)}
        by_name.setdefault(names[law.component], []).append(made)
    if by_name:
        table["law"] = by_name
    return table


def _drive(drive: Drive) -> Table:
    joint = drive.model.joints[drive.joint]
    table: Table = {"name": drive.name, "joint": joint.name, "motion": drive.described()}
    known = KINDS[joint.type].coordinates
    return {**table, "coordinate": known[drive.coordinate]} if len(known) > 1 else table


def _coupler(coupler: Coupler) -> Table:
    table: Table = {"name": coupler.name}
    for key in ("first", "second"):
        joint = coupler.model.joints[getattr(coupler, key)]
        table[key] = joint.name
        known = KINDS[joint.type].coordinates
        if len(known) > 1:
            table[f"{key}_coordinate"] = known[getattr(coupler, f"{key}_coordinate")]
    ratio, offset = coupler.entries(0, 2)
    table["ratio"] = ratio
    return _with_one(table, "offset", offset)


def _load_value(load: Load) -> Any:
    value: list[Any] = load.entries(3, 3)  # type: ignore[assignment]
    for motion in load.motions:
        if motion.function is not None and motion.function.outputs == 3:
            return motion.described()
        value[motion.component] = motion.described()
    return value


def _load(load: Load) -> Table:
    if isinstance(load, ModalLoad):
        table: Table = {"type": "modal_force", "name": load.name, "body": load.model.body_name(load.body)}
        return {**table, "mode": int(load.frame) + 1, "value": _load_value(load)[0]}
    table = {"type": load.type, "name": load.name, "body": _place(load.model, load.body, load.node)}
    if load.type == "force":
        table["at"] = load.entries(0, 3)
    if load.node < 0 and isinstance(load.model.bodies[load.body], FlexibleBody):
        table["on"] = "frame"
    table["value"] = _load_value(load)
    if load.frame != "world":
        table["frame"] = load.frame
    return table
