"""Geometry of a model for drawing, from its Tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix
from .._lib.warning import warn_user
from ..errors import ModelError
from ..view.modes import line_points
from ..view.scene import BodyGeometry, JointGeometry, LinkGeometry, LoadGeometry, SceneGeometry, Solid
from ..view.shapes import surface
from .book import Book
from .names import shown
from .schema import BODY, COUPLER, ELEMENTS, FUNCTION, JOINTS, LAW_OF_CODE, LOAD_FRAMES, LOADS, MARKER, MOTIONS

_JOINTS = {kind.code: kind.type for kind in JOINTS.values()}
_ELEMENTS = {kind.code: kind for kind in ELEMENTS.values()}
_LOADS = {kind.code: kind.type for kind in LOADS.values()}
_JOINT = JOINTS["revolute"].block
_LOAD = LOADS["force"].block
# Numbers of a motion that tell its size, by type; the first that is not zero counts.
_SIZES = {"Ramp": (0, 1), "Sine": (0, 3)}

Attach = Callable[[int, np.ndarray], str | None]


def scene_from_tables(tables: Mapping[str, Any], book: Book | None = None) -> SceneGeometry:
    """Geometry for drawing, from the Tables of a model (docs/tables.md), in its drawn state.

    Every joint, element and marker counts as an attachment point of the bodies it acts on. O(number of objects).

    Parameters
    ----------
    tables
        The dict of flat arrays that a `Model` compiles to.
    book
        Their model, of which the lines of flexible bodies are drawn.
    """
    x = np.asarray(tables["x"], dtype=float)
    names = [str(name) for name in tables["body_name"]]
    attached: list[list[np.ndarray]] = [[] for _ in names]

    def attach(body: int, point: np.ndarray) -> str | None:
        if body < 0:
            return None
        attached[body].append(point)
        return names[body]

    links = tuple(_links(tables, x, attach))
    joints = tuple(_joints(tables, x, attach))
    for body, rim in _rims(tables, x):
        attached[body].extend(rim)
    markers = {}
    keys = ("name", "body", "x")
    for name, body, start in zip(*(tables.get(f"marker_{k}", ()) for k in keys), strict=True):
        point = x[start:][MARKER.block.slice("at")]
        markers[str(name)] = (attach(int(body), point), point)
    lines = {} if book is None or "flexible_body" not in tables else _lines(book)
    bodies = tuple(_bodies(tables, x, names, attached, lines))
    gravity = int(tables["gravity_x"][0]) if "gravity_x" in tables else -1
    return SceneGeometry(
        bodies,
        links,
        joints,
        markers,
        tuple(_loads(tables, x, bodies)),
        x[gravity : gravity + 3] if gravity >= 0 else None,
    )


def _lines(book: Book) -> dict[str, np.ndarray]:
    """(k, 3) points of the lines of flexible bodies by name, body axes."""
    bodies = [b for b in book.bodies if b.modes_and_nodes]
    return {b.name: b.modal.line_position[line_points(b.modal)] for b in bodies}


def _bodies(
    tables: Mapping[str, Any],
    x: np.ndarray,
    names: list[str],
    attached: list[list[np.ndarray]],
    lines: Mapping[str, np.ndarray],
) -> Iterator[BodyGeometry]:
    at, orientation = BODY.block.slice("at"), BODY.block.slice("orientation")
    shapes = tables.get("body_shape", {})
    for name, start, points in zip(names, tables["body_x"], attached, strict=True):
        origin, rotation = x[start:][at], quaternion_matrix(x[start:][orientation])
        line = origin + np.reshape(lines[name], (-1, 3)) @ rotation.T if name in lines else ()
        solids = tuple(_solids(name, shapes.get(name, ()), origin, rotation))
        yield BodyGeometry(name, origin, rotation, np.reshape(points, (-1, 3)) if points else (), solids, line)


def _solids(name: str, shapes: Any, origin: np.ndarray, rotation: np.ndarray) -> Iterator[Solid]:
    """A mesh that cannot be read is named, and left out of the picture."""
    for shape in shapes:
        try:
            yield surface(shape, origin, rotation)
        except ModelError as reason:
            warn_user(f"the shape of body {shown(name)} is not drawn: {reason}")


def _rims(tables: Mapping[str, Any], x: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Bodies that are round, with points of their rims: rolling discs, and what turns in a hinge that drives a rack."""
    kinds, starts, second = tables["joint_type"], tables["joint_x"], tables["joint_b"]
    for j, start in enumerate(starts):
        if _JOINTS[int(kinds[j])] == "rolling_disc" and second[j] >= 0:
            n, block = x[start:], JOINTS["rolling_disc"].block
            yield int(second[j]), _circle(n[block.slice("at_b")], n[block.slice("axis2")], n[block.place("radius")])
    keys = ("first", "second", "x")
    for a, b, place in zip(*(tables.get(f"coupler_{k}", ()) for k in keys), strict=True):
        if (_JOINTS[int(kinds[a])], _JOINTS[int(kinds[b])]) == ("revolute", "prismatic") and second[a] >= 0:
            start = starts[a]
            axis = _joint_axes(x, start, tables["joint_flags"][a])[0]
            centre, ratio = x[start:][_JOINT.slice("at_a")], x[place + COUPLER.block.place("ratio")]
            yield int(second[a]), _circle(centre, axis, abs(ratio))


def _circle(centre: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """(24, 3) points of a circle; none where there is no axis or radius."""
    length = float(np.linalg.norm(axis))
    if not (np.isfinite(length * radius) and length * radius > 0.0):
        return np.zeros((0, 3))
    across = np.linalg.svd((axis / length)[None, :])[2][1:]
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    return np.asarray(centre + radius * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]))


def _joint_axes(x: np.ndarray, start: int, flags: int) -> tuple[np.ndarray, np.ndarray]:
    """The directions of ``axis`` and ``axis2``."""
    n = x[start:]
    if int(flags) & _JOINT.fields["orientation"].bit:
        turn = quaternion_matrix(n[_JOINT.slice("orientation")])
        return turn[:, 2], turn[:, 0]
    return n[_JOINT.slice("axis")], n[_JOINT.slice("axis2")]


def _usable(direction: np.ndarray) -> np.ndarray | None:
    return direction if np.all(np.isfinite(direction)) and np.any(direction != 0.0) else None


def _two_ended(tables: Mapping[str, Any], what: str) -> Iterator[tuple[str, int, int, int, int, int, set[str]]]:
    """Every "element" or "joint": name, code of its type, both bodies, flags, place of its numbers, parts that laws make."""
    laws: dict[int, set[str]] = {}
    keys = ("owner_kind", "owner", "type")
    for of_joint, owner, code in zip(*(tables.get(f"law_{k}", ()) for k in keys), strict=True):
        if bool(of_joint) == (what == "joint"):
            laws.setdefault(int(owner), set()).add("gap" if LAW_OF_CODE[int(code)].effect == "contact" else "law")
    columns = ("name", "type", "a", "b", "flags", "x")
    for i, (name, *numbers) in enumerate(zip(*(tables.get(f"{what}_{k}", ()) for k in columns), strict=True)):
        code, a, b, flags, start = (int(n) for n in numbers)
        yield str(name), code, a, b, flags, start, laws.get(i, set())


def _parts(n: np.ndarray, block: Any, flags: int, laws: set[str]) -> tuple[str, ...]:
    """The parts that act: a coefficient that is given and not zero, a law, a preload (as a spring)."""
    found = {part for field, part in (("k", "spring"), ("c", "damper")) if _acts(n, block, flags, field)} | laws
    if not found and _acts(n, block, flags, "preload"):
        found = {"law"}
    return tuple(part for part in ("spring", "damper", "gap", "law") if part in found)


def _acts(n: np.ndarray, block: Any, flags: int, field: str) -> bool:
    return bool(int(flags) & block.fields[field].bit and np.any(n[block.slice(field)]))


def _links(tables: Mapping[str, Any], x: np.ndarray, attach: Attach) -> Iterator[LinkGeometry]:
    for name, code, a, b, flags, start, laws in _two_ended(tables, "element"):
        kind, n = _ELEMENTS[code], x[start:]
        block = kind.block
        at_a = n[block.slice("at_a" if "at_a" in block.fields else "at")]
        at_b = n[block.slice("at_b")] if "at_b" in block.fields else at_a  # a torsion spring acts at one point
        axis = _usable(n[block.slice("axis")]) if "axis" in block.fields else None
        parts = _parts(n, block, flags, laws)
        yield LinkGeometry(name, attach(a, at_a), attach(b, at_b), at_a, at_b, kind.type, parts, axis)


def _joints(tables: Mapping[str, Any], x: np.ndarray, attach: Attach) -> Iterator[JointGeometry]:
    for name, code, a, b, flags, start, laws in _two_ended(tables, "joint"):
        kind, n = _JOINTS[code], x[start:]
        at_a, at_b = n[_JOINT.slice("at_a")], n[_JOINT.slice("at_b")]
        axis, axis2 = _joint_axes(x, start, flags)
        yield JointGeometry(
            name,
            kind,
            attach(a, at_a),
            attach(b, at_b),
            at_a,
            None if kind in ("fixed", "spherical", "free", "distance") else _usable(axis),
            at_b,
            _usable(axis2) if kind in ("universal", "rolling_disc") else None,
            float(n[_JOINT.place("radius")]) if kind == "rolling_disc" else 0.0,
            _parts(n, _JOINT, flags, laws),
        )


def _loads(tables: Mapping[str, Any], x: np.ndarray, bodies: tuple[BodyGeometry, ...]) -> Iterator[LoadGeometry]:
    varying = _varying(tables, x)
    keys = ("name", "type", "body", "frame", "x")
    for i, (name, code, body, frame, start) in enumerate(
        zip(*(tables.get(f"load_{k}", ()) for k in keys), strict=True)
    ):
        kind, n = _LOADS[int(code)], x[start:]
        if kind == "modal_force" or body < 0:
            continue
        owner = bodies[int(body)]
        at = n[_LOAD.slice("at")] if kind == "force" else owner.origin
        value = n[_LOAD.slice("value")] + varying.get(i, 0.0)
        follows = int(frame) == LOAD_FRAMES["body"]
        yield LoadGeometry(str(name), kind, owner.name, at, value, follows, i in varying)


def _varying(tables: Mapping[str, Any], x: np.ndarray) -> dict[int, np.ndarray]:
    """Loads that vary in time, with the direction in which they do; zero for a function of all three components."""
    out: dict[int, np.ndarray] = {}
    keys = ("load", "component", "motion")
    for load, component, motion in zip(*(tables.get(f"load_motion_{k}", ()) for k in keys), strict=True):
        direction = out.setdefault(int(load), np.zeros(3))
        kind, start = MOTIONS[int(tables["motion_type"][motion])], int(tables["motion_x"][motion])
        numbers = x[start : start + int(tables["motion_n"][motion])]
        if kind is FUNCTION:
            direction[int(component)] = 1.0
            continue
        told = [numbers[k] for k in _SIZES.get(kind.name, range(len(numbers)))]
        if kind.name == "Table":
            told = list(numbers[len(numbers) // 2 :])
        largest = max(told, key=abs, default=0.0)
        direction[int(component)] = largest if largest != 0.0 else 1.0
    for load, direction in out.items():
        functions = tables["load_motion_load"] == load
        if np.count_nonzero(functions) == 3 and np.all(direction == 1.0):
            out[load] = np.zeros(3)
    return out
