"""Checks of the arguments of constructors (points, stiffnesses, inertias), and their numbers in the order that the schema declares."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import InertiaError
from .expressions import Expression
from .names import problem, shown
from .numbers import Number, array, axis, is_pair, numbers, scalar, shape_of, vector
from .rotations import quaternion
from .schema import COORDINATE_ROLES, Field, Kind

# How far a tensor may be from symmetric, relative to its largest entry: hand-typed products of six digits pass the check of
# principal moments below; a larger difference is a typing error. Pinned by the tests of wrong inertias.
INERTIA_TOLERANCE = 1e-9
_TWO = {
    "distance": "a distance joint keeps a relation between them",
    "rolling_disc": "a rolling_disc joint keeps a relation between them",
    "spring_damper": "one on each body",
}
_ONE = {"torsion": "a torsion spring has no second one", "force": "a force acts at one"}


@dataclass(frozen=True)
class Packed:
    """Numbers of a block in order, the flags of what was given, the shapes in which coefficients were given."""

    entries: list[Number]
    flags: int
    shapes: dict[str, tuple[int, ...]]
    one_point: bool


def pack(name: str, kind: Kind, given: Mapping[str, Any]) -> Packed:
    """Read the arguments of a new object; every error names the argument."""
    entries: list[Number] = []
    flags, shapes = 0, {}
    ends = _ends(name, kind, given.get("at"))
    for field in kind.block:
        value = given.get(field.name)
        if value is None:
            value = ends.get(field.name)
        if value is None:
            if field.name in kind.required:
                raise problem(f"{name}.{field.name}", "is missing, got None: it must be given")
            entries += field.neutral
            continue
        if field.types and kind.type not in field.types:
            entries += field.neutral
            continue
        flags |= field.bit
        read = (
            _read_coefficients if field.role in COORDINATE_ROLES and field.listed == "given" else _READERS[field.role]
        )
        made, shape = read(value, f"{name}.{field.name}", field, kind)
        entries += made
        if shape is not None:
            shapes[field.name] = shape
    return Packed(entries, flags, shapes, "at_a" in ends and not is_pair(given["at"]))


def _ends(name: str, kind: Kind, at: Any) -> dict[str, Any]:
    """``at`` as the fields that it fills; one point fills both ends."""
    where, pair = name + ".at", is_pair(at)
    if pair and kind.type in _ONE:
        raise problem(where, f"must be one point (3,): {_ONE[kind.type]}")
    if not pair and kind.points == "two":
        raise problem(where, f"must be two points (P_a, P_b): {_TWO[kind.type]}")
    if "at_a" not in kind.block.fields:
        return {}
    return {"at_a": vector(at[0] if pair else at, where), "at_b": vector(at[1] if pair else at, where)}


_Read = tuple[Sequence[Number], tuple[int, ...] | None]


def _read_plain(value: Any, where: str, field: Field, kind: Kind) -> _Read:
    shape: Any = field.shape
    return ([scalar(value, where)] if shape == () else array(value, shape, where)), None


def _read_inertia(value: Any, where: str, field: Field, kind: Kind) -> _Read:
    return inertia_numbers(value, where), None


def _read_direction(value: Any, where: str, field: Field, kind: Kind) -> _Read:
    return axis(value, where), None


def _read_orientation(value: Any, where: str, field: Field, kind: Kind) -> _Read:
    return quaternion(value, where), None


def _read_coefficients(value: Any, where: str, field: Field, kind: Kind) -> _Read:
    """Numbers of free coordinates: one where there is one, one for each, or a matrix where the block holds one."""
    n, shape = len(kind.free), shape_of(value)
    if field.shape == ():
        return [scalar(value, where)], ()
    if n == 0:
        raise problem(
            where, f"is given, but a {kind.type} joint has no free coordinate; use a bushing or a spring_damper"
        )
    if len(field.shape) == 2:
        return _read_matrix(value, where, n), shape
    if shape == () and n == 1:
        return [scalar(value, where), *field.neutral[1:]], ()
    if shape != (n,):
        raise problem(
            where,
            f"must be {n} numbers, one for each free coordinate ({', '.join(kind.coordinates)}), got {shown(value)}",
        )
    return [*array(value, (n,), where), *field.neutral[n:]], (n,)


def _read_matrix(value: Any, where: str, n: int) -> list[Number]:
    shape = shape_of(value)
    if shape == (n, n):
        return array(value, (n, n), where)
    if shape != (n,):
        raise problem(where, f"must be {n} numbers (x y z rx ry rz) or a {n} x {n} matrix, got {shown(value)}")
    flat: list[Number] = [0.0] * (n * n)
    flat[:: n + 1] = array(value, (n,), where)
    return flat


_READERS: dict[str, Callable[[Any, str, Field, Kind], _Read]] = {
    **dict.fromkeys(("point", "position", "length", "angle", "mass", "velocity", "angular velocity"), _read_plain),
    **dict.fromkeys(("acceleration", "ratio", "offset", "force"), _read_plain),
    "direction": _read_direction,
    "orientation": _read_orientation,
    "inertia": _read_inertia,
}


def inertia_numbers(value: Any, where: str) -> list[Number]:
    """xx yy zz xy xz yz from three principal moments or a symmetric matrix."""
    shape = (3,) if type(value) is tuple and len(value) == 3 and type(value[0]) is float else shape_of(value)
    if shape == (3,):
        return [*array(value, (3,), where), 0.0, 0.0, 0.0]
    if shape != (3, 3):
        raise problem(
            where, f"must be (3,) principal moments or a symmetric (3, 3) tensor, got {shown(value)}", InertiaError
        )
    flat = array(value, (3, 3), where)
    now = numbers(flat)
    largest = max(*map(abs, now), 1e-300)
    out = [flat[0], flat[4], flat[8]]
    for upper, lower in ((1, 3), (2, 6), (5, 7)):
        if abs(now[upper] - now[lower]) > INERTIA_TOLERANCE * largest:
            raise problem(where, "must be a symmetric tensor: entries [i,j] and [j,i] differ", InertiaError)
        # The entry of a symmetric pair that is an expression is meant.
        out.append(flat[lower] if isinstance(flat[lower], Expression) else flat[upper])
    return out
