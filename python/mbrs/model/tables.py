"""Tables: the flat arrays that the core and the reference read (docs/tables.md)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix
from ..errors import ModelError
from .aerodynamics import polar_tables
from .air_schema import INFLOWS as AIR_INFLOWS
from .air_schema import SECTION
from .book import STORES, Book
from .flexible import FlexibleBody
from .function_calls import FunctionCall
from .names import shown
from .schema import BODY, ELEMENTS, JOINTS, LOAD_FRAMES, LOADS, NODE
from .section_loads import ModalLoad
from .shapes import plain


def tables(model: Book, flexible: bool = True, absolute: bool = False) -> dict[str, Any]:
    """The Tables of a model, a new dict; its integer arrays are shared between calls while the structure stays.

    ``flexible=False``: flexible bodies are taken for rigid ones. ``absolute``: no joint carries a body, all of them are rows.

    Returns
    -------
    dict
        Keys and layout as docs/tables.md says: ``x`` float64, indices int64, names lists of str.

    Notes
    -----
    Cost O(size); O(len(x)) where only values changed.

    Examples
    --------
    >>> import mbrs as mb
    >>> from mbrs.model.tables import tables
    >>> m = mb.Model("one"); p = m.body("payload", mass=20.0, inertia=(1, 1, 1), at=(0, 0, 0))
    >>> tables(m)["x"][10]
    np.float64(20.0)
    """
    _require_bodies(model)
    for motion in model.motions:
        if motion.function is not None:
            motion.function.check_callable()
    _check_constraints(model)
    made = {"x": x(model), **_structure(model), **_shapes(model)}
    if not flexible:
        for key in node_tables(model, offsets(model)):
            del made[key]
        made |= _without_modal_loads(made)
    return {**made, "absolute": True} if absolute else made


def _shapes(model: Book) -> dict[str, Any]:
    """Shapes of bodies for pictures, by name; nothing of a model without shapes."""
    found = {body.name: [plain(shape) for shape in body.shape] for body in model.bodies if body.shape}
    return {"body_shape": found} if found else {}


def _without_modal_loads(made: dict[str, Any]) -> dict[str, Any]:
    """Tables without modal loads, for models without modal coordinates."""
    kept = made["load_type"] != LOADS["modal_force"].code
    moved = kept[made["load_motion_load"]]
    loads = {key: made[key][kept] for key in ("load_type", "load_body", "load_frame", "load_x")}
    motions = {key: made[key][moved] for key in ("load_motion_component", "load_motion_motion")}
    return {
        "load_name": [name for name, keep in zip(made["load_name"], kept, strict=True) if keep],
        "load_motion_load": (np.cumsum(kept) - 1)[made["load_motion_load"][moved]],
        **loads,
        **motions,
    }


def tables_with_nodes(made: dict[str, Any]) -> dict[str, Any]:
    """Tables in which every moving node of a flexible body appears as an additional body, behind the others. ``owner``: the
    body of each. The same dict for a model without moving nodes.
    """
    moving = made.get("moving_node", ())
    if not len(moving):
        return made
    values, n = np.asarray(made["x"]), len(made["body_name"])
    frame = np.full(len(made["flexible_node_name"]), -1)
    names, starts, owners, numbers = list(made["body_name"]), list(made["body_x"]), list(range(n)), [values]
    for i, node in enumerate(moving):
        frame[node] = n + i
        owner, place = int(made["flexible_node_body"][node]), int(made["flexible_node_x"][node])
        start = int(made["body_x"][owner])
        origin, turn = BODY.block.slice("at"), BODY.block.slice("orientation")
        drawn, frame_values = np.zeros(BODY.block.size()), values[start:]
        drawn[turn] = frame_values[turn]
        drawn[origin] = frame_values[origin] + quaternion_matrix(drawn[turn]) @ values[place:][NODE.slice("position")]
        names.append(f"{names[owner]}.{made['flexible_node_name'][node]}")
        starts.append(len(values) + BODY.block.size() * i)
        owners.append(owner)
        numbers.append(drawn)
    out = {
        **made,
        "x": np.concatenate(numbers),
        "body_name": names,
        "body_x": np.array(starts),
        "owner": np.array(owners),
    }
    for bodies, nodes in (
        ("joint_a", "joint_a_node"),
        ("joint_b", "joint_b_node"),
        ("element_a", "element_a_node"),
        ("element_b", "element_b_node"),
        ("load_body", "load_node"),
        ("marker_body", "marker_node"),
    ):
        at = np.asarray(made[nodes])
        moved = frame[at] if len(frame) else at
        out[bodies] = np.where((at >= 0) & (moved >= 0), moved, made[bodies])
    out["raw"] = made
    return out


def x(model: Book) -> np.ndarray:
    """All numbers (n_x,), a copy."""
    return np.concatenate([np.frombuffer(store.x) for store in model.stores.values() if store.x])


def offsets(model: Book) -> dict[str, int]:
    """Index in x of the first number of each store."""
    out, start = {}, 0
    for kind in STORES:
        out[kind] = start
        start += len(model.stores[kind].x)
    return out


def _require_bodies(model: Book) -> None:
    if not model.bodies:
        raise ModelError(f"model {shown(model.name)} has no body; add one with m.body(...)")


def _check_constraints(model: Book) -> None:
    """Functions of a file are data until they are imported."""
    for constraint in model.constraints:
        if isinstance(constraint.body, FunctionCall):
            constraint.body.check_callable()


def _structure(model: Book) -> dict[str, Any]:
    cached: tuple[int, dict[str, Any]] | None = model.cache.get("tables")
    if cached is not None and cached[0] == model.structure_version:
        return cached[1]
    base = offsets(model)
    made = {
        **_items("body", model.bodies, base, ()),
        **_items("joint", model.joints, base, ("type", "a", "b", "flags")),
        **_items("element", model.elements, base, ("type", "a", "b", "flags")),
        **_items("load", model.loads, base, ("type", "body")),
        "load_frame": _integers(_load_frame(load) for load in model.loads),
        **_items("marker", model.markers, base, ("body",)),
        **_laws(model, base),
        **_motions(model, base),
        **_constraints(model, base),
        **node_tables(model, base),
        **_air(model, base),
        "pose_body": _integers(p.body for p in model.poses),
        "pose_x": _integers(base["pose"] + p.start for p in model.poses),
        "tolerance": np.float64(model.tolerance),
        "gravity_x": _integers([base["gravity"] if model.gravity_item is not None else -1]),
    }
    model.cache["tables"] = (model.structure_version, made)
    return made


_CODES: dict[tuple[str, str], dict[str, int]] = {
    **{
        (kind.heading, "type"): {k.type: k.code for k in kinds.values()}
        for kinds in (JOINTS, ELEMENTS, LOADS)
        for kind in kinds.values()
    },
    ("load", "frame"): LOAD_FRAMES,
}


def _items(kind: str, items: Sequence[Any], base: dict[str, int], columns: Iterable[str]) -> dict[str, Any]:
    out: dict[str, Any] = {f"{kind}_name": [item.name for item in items]}
    for column in columns:
        values = [getattr(item, column) for item in items]
        codes = _CODES.get((kind, column))
        out[f"{kind}_{column}"] = _integers(
            values if codes is None else [codes[v] if isinstance(v, str) else v for v in values]
        )
    start = base[kind]
    out[f"{kind}_x"] = _integers(start + item.start for item in items)
    return out


def _load_frame(load: Any) -> int:
    """Index of the modal coordinate, of a force on one."""
    return load.mode if isinstance(load, ModalLoad) else LOAD_FRAMES[load.frame]


def _laws(model: Book, base: dict[str, int]) -> dict[str, Any]:
    both = [*model.laws["element"], *model.laws["joint"]]
    laws = [law for law in both if law.body is None]
    functions = [law for law in both if law.body is not None]
    return {
        "function_owner_kind": _integers(law.owner.kind == "joint" for law in functions),
        "function_owner": _integers(law.owner.index for law in functions),
        "function_coordinates": [list(law.components) for law in functions],
        "function_n": _integers(law.n for law in functions),
        "function_x": _integers(base[law.store] + law.start for law in functions),
        "function_body": [law.body for law in functions],
        "law_owner_kind": _integers(law.owner.kind == "joint" for law in laws),
        "law_owner": _integers(law.owner.index for law in laws),
        "law_component": _integers(law.component for law in laws),
        "law_type": _integers(law.code for law in laws),
        "law_n": _integers(law.n for law in laws),
        "law_x": _integers(base[law.store] + law.start for law in laws),
    }


def _motions(model: Book, base: dict[str, int]) -> dict[str, Any]:
    motions = model.motions
    functions = [m.function for m in motions if m.function is not None]
    # the components of one vector function share it
    functions = list({id(f): f for f in functions}.values())
    index = {id(f): i for i, f in enumerate(functions)}
    loaded = [m for m in motions if m.owner is not None]
    return {
        "functions": functions,
        "motion_type": _integers(m.code for m in motions),
        "motion_n": _integers(m.size for m in motions),
        "motion_x": _integers(base["motion"] + m.start for m in motions),
        "motion_function": _integers(index.get(id(m.function), -1) for m in motions),
        "motion_output": _integers(m.component if m.function and m.function.outputs == 3 else 0 for m in motions),
        "drive_name": [d.name for d in model.drives],
        "drive_joint": _integers(d.joint for d in model.drives),
        "drive_coordinate": _integers(d.coordinate for d in model.drives),
        "drive_motion": _integers(d.place for d in model.drives),
        "load_motion_load": _integers(m.owner.index for m in loaded),
        "load_motion_component": _integers(m.component for m in loaded),
        "load_motion_motion": _integers(m.place for m in loaded),
        "coupler_name": [c.name for c in model.couplers],
        "coupler_first": _integers(c.first for c in model.couplers),
        "coupler_second": _integers(c.second for c in model.couplers),
        "coupler_first_coordinate": _integers(c.first_coordinate for c in model.couplers),
        "coupler_second_coordinate": _integers(c.second_coordinate for c in model.couplers),
        "coupler_x": _integers(base["coupler"] + c.start for c in model.couplers),
    }


def _constraints(model: Book, base: dict[str, int]) -> dict[str, Any]:
    """The part of Tables that functions of motions make; nothing of a model without them."""
    found = model.constraints
    if not found:
        return {}
    return {
        "constraint_name": [c.name for c in found],
        "constraint_level": _integers(c.of_velocities for c in found),
        "constraint_motions": [list(c.motions) for c in found],
        "constraint_rows": _integers(c.n_rows for c in found),
        "constraint_n": _integers(c.n for c in found),
        "constraint_x": _integers(base["constraint"] + c.start for c in found),
        "constraint_body": [c.body for c in found],
    }


def _air(model: Book, base: dict[str, int]) -> dict[str, Any]:
    """The part of Tables that air makes; nothing of a model without it."""
    if not model.airs:
        return {}
    number, angles, pieces = polar_tables(model.airs)
    places = [(air, *place) for air in model.airs for place in air.sections.places]
    polars = {
        key: [(a.index, p) for a in model.airs for b in a.blades for p in b[key]] for key in ("polar", "second_polar")
    }
    step = SECTION.size()
    starts = (base["section"] + a.sections.start + step * i for a in model.airs for i in range(len(a.sections.places)))
    return {
        "air_name": [air.name for air in model.airs],
        "air_inflow": _integers(AIR_INFLOWS["given" if air.inflow == "none" else "momentum"] for air in model.airs),
        "air_unsteady": _integers(air.unsteady() for air in model.airs),
        "air_x": _integers(base["air"] + air.start for air in model.airs),
        "air_history_x": _integers(-1 for _ in model.airs),
        "air_times": [[] for _ in model.airs],
        "section_air": _integers(air.index for air, _, _ in places),
        "section_body": _integers(body for _, body, _ in places),
        **{f"section_{key}": _integers(number[one] for one in of) for key, of in polars.items()},
        "section_x": _integers(starts),
        "polar_angle": angles,
        "polar_pieces": pieces,
    }


def node_tables(model: Book, base: dict[str, int]) -> dict[str, Any]:
    """The part of Tables that flexible bodies make; nothing of a model without them."""
    bodies = [b for b in model.bodies if isinstance(b, FlexibleBody)]
    if not bodies:
        return {}
    start, nodes = base["flexible"], [(b.index, i) for b in bodies for i in range(len(b.nodes))]
    number = {place: i for i, place in enumerate(nodes)}

    def of(items: Sequence[Any], body: str, node: str) -> np.ndarray:
        return _integers(number.get((getattr(i, body), getattr(i, node)), -1) for i in items)

    return {
        "flexible_body": _integers(b.index for b in bodies),
        "flexible_modes": _integers(b.n_modes for b in bodies),
        "flexible_x": _integers(start + b.integrals.start for b in bodies),
        "flexible_node_name": [model.bodies[b].nodes[i] for b, i in nodes],
        "flexible_node_body": _integers(b for b, _ in nodes),
        "flexible_node_x": _integers(start + model.bodies[b].integrals.node_start(i) for b, i in nodes),
        "flexible_node_quadratic": _integers(_quadratic(model.bodies[b].integrals, start, i) for b, i in nodes),
        "moving_node": _integers(number[place] for place in model.moving_nodes()),
        "joint_a_node": of(model.joints, "a", "a_node"),
        "joint_b_node": of(model.joints, "b", "b_node"),
        "element_a_node": of(model.elements, "a", "a_node"),
        "element_b_node": of(model.elements, "b", "b_node"),
        "load_node": of(model.loads, "body", "node"),
        "marker_node": of(model.markers, "body", "node"),
        "section_node": _integers(number.get(place, -1) for air in model.airs for place in air.sections.places),
    }


def modal_places(tables: Mapping[str, Any]) -> list[tuple[int, slice]]:
    """Each flexible body: its number, and the place of its coordinates among all modal ones."""
    out, first = [], 0
    for body, m in zip(tables.get("flexible_body", ()), tables.get("flexible_modes", ()), strict=True):
        out.append((int(body), slice(first, first + int(m))))
        first += int(m)
    return out


def modal_part(tables: Mapping[str, Any], values: np.ndarray) -> np.ndarray:
    """The modal coordinates, which are the last of ``values`` (..., n): of a state's q or of its rates."""
    total = sum(int(m) for m in tables.get("flexible_modes", ()))
    return values[..., values.shape[-1] - total :]


def _quadratic(numbers: Any, start: int, node: int) -> int:
    """The place where the second-order displacements of a node begin, -1 without any."""
    return start + numbers.quadratic_start(node) if numbers.quadratic else -1


def _integers(values: Iterable[Any]) -> np.ndarray:
    out = np.array(list(values), dtype=np.int64)
    out.setflags(write=False)  # shared between the dicts of all calls
    return out
