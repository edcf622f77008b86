"""Joints: kinds, their free coordinates, their numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from .attached_laws import add_laws, law_fields
from .book import Field, Item, plain, single
from .forces import HAS_C, HAS_K, HAS_PRELOAD, LENGTH_GIVEN, check_drawn_length
from .names import problem, shown
from .numbers import Number, array, axis, is_pair, scalar, shape_of, vector
from .rotations import quaternion

if TYPE_CHECKING:
    from .model import Model

FRAME_GIVEN = 8
_PERPENDICULAR = 1e-6
_ZEROS = (0.0,) * 6
_NONE: tuple[Number, ...] = (0.0, 0.0, 0.0)
_Z: tuple[Number, ...] = (0.0, 0.0, 1.0)
_NO_ROTATION: tuple[Number, ...] = (1.0, 0.0, 0.0, 0.0)


class JointKind(NamedTuple):
    """Code in Tables, free coordinates ("t" along, "r" about an axis) and their names, what else it needs."""

    code: int
    free: str
    coordinates: tuple[str, ...]
    needs_axis: bool = False
    two_axes: bool = False


KINDS = {
    "fixed": JointKind(0, "", ()),
    "revolute": JointKind(1, "r", ("rz",), True),
    "prismatic": JointKind(2, "t", ("z",), True),
    "cylindrical": JointKind(3, "tr", ("z", "rz"), True),
    "universal": JointKind(4, "rr", ("rz", "rx"), True, True),
    "spherical": JointKind(5, "rrr", ("rx", "ry", "rz")),
    "planar": JointKind(6, "ttr", ("x", "y", "rz"), True),
    "free": JointKind(7, "tttrrr", ("x", "y", "z", "rx", "ry", "rz")),
    "distance": JointKind(8, "", ()),
    "knife_edge": JointKind(9, "", (), True),
    "rolling_disc": JointKind(10, "", (), True, True),
}
NONHOLONOMIC = frozenset({"knife_edge", "rolling_disc"})


class Joint(Item):
    """Handle of a joint; see `Model.revolute` and its siblings."""

    __slots__ = ("a", "a_node", "b", "b_node", "flags", "one_point", "shapes", "type")
    a: int
    b: int
    a_node: int  # of a flexible body, else -1
    b_node: int
    flags: int
    one_point: bool
    shapes: dict[str, tuple[int, ...]]  # of k, c and preload as they were given
    type: str
    store = "joint"
    kind = "joint"

    @property
    def size(self) -> int:
        return 36

    def check(self, values: Sequence[float]) -> None:
        kind = KINDS[self.type]
        if self.flags & FRAME_GIVEN:
            if not math.hypot(*values[12:16]) > 0.0:
                raise problem(self.name + ".orientation", "must not be a zero quaternion; (1, 0, 0, 0) is no rotation")
        else:
            _check_axes(self.name, values, kind)
        if self.type == "distance":
            check_drawn_length(self.name, "distance joint", values, self.flags, values[34])
        if self.type == "rolling_disc" and not values[35] > 0.0:
            raise problem(self.name + ".radius", f"must be positive, got {values[35]:g}")

    def fields(self) -> dict[str, Field]:
        s, kind = self.start, KINDS[self.type]
        out = point_fields(s, self.one_point)
        if self.flags & FRAME_GIVEN:
            out["orientation"] = Field(tuple((s + 12 + i,) for i in range(4)), (4,), ("rad",) * 3, "orientation")
        elif kind.needs_axis or kind.free:
            out["axis"] = Field(tuple((s + 6 + i,) for i in range(3)), (3,), ("rad",) * 3, "axis")
        if kind.two_axes and not self.flags & FRAME_GIVEN:
            out["axis2"] = Field(tuple((s + 9 + i,) for i in range(3)), (3,), ("rad",) * 3, "axis")
        for place, name, units in (
            (16, "k", {"t": "N/m", "r": "N m/rad"}),
            (22, "c", {"t": "N s/m", "r": "N m s/rad"}),
            (28, "preload", {"t": "N", "r": "N m"}),
        ):
            if name in self.shapes:
                out[name] = plain(s + place, len(kind.free), [units[f] for f in kind.free], self.shapes[name])
        if self.type == "distance":
            out["length"] = single(s + 34, "m")
        if self.type == "rolling_disc":
            out["radius"] = single(s + 35, "m")
        out.update(law_fields(self))
        return out


def point_fields(start: int, one_point: bool) -> dict[str, Field]:
    """``at_a`` and ``at_b``, and ``at`` that moves both where one point was drawn."""
    out = {"at_a": plain(start, 3, "m"), "at_b": plain(start + 3, 3, "m")}
    if one_point:
        out["at"] = Field(tuple((start + i, start + 3 + i) for i in range(3)), (3,), ("m",) * 3, "both")
    return out


def _check_axes(name: str, values: Sequence[float], kind: JointKind) -> None:
    a, b = values[6:9], values[9:12]
    length = math.hypot(*a)
    if not length > 0.0:
        raise problem(name + ".axis", "must not be a zero vector: give a direction")
    if not kind.two_axes:
        return
    length2 = math.hypot(*b)
    if not length2 > 0.0:
        raise problem(name + ".axis2", "must not be a zero vector: give a direction")
    cosine = abs(sum(p * q for p, q in zip(a, b, strict=True))) / (length * length2)
    if kind.code == KINDS["universal"].code and cosine > _PERPENDICULAR:
        raise problem(
            name + ".axis2",
            f"must be perpendicular to axis, but the angle is {math.degrees(math.acos(min(cosine, 1.0))):.6g} degrees",
        )
    if cosine > 1.0 - _PERPENDICULAR:
        raise problem(name + ".axis2", "must not be parallel to axis")


def _frame(
    name: str, type_: str, kind: JointKind, axis_: Any, axis2: Any, orientation: Any
) -> tuple[list[Number], list[Number], list[Number]]:
    where = f"{name}.axis"
    if orientation is not None:
        if axis_ is not None or axis2 is not None:
            raise problem(where, "and orientation are both given; give one of them")
        return list(_Z), list(_NONE), quaternion(orientation, name + ".orientation")
    if axis_ is None and kind.needs_axis:
        raise problem(where, f"is missing: a {type_} joint needs axis= (a direction in the world) or orientation=")
    if axis2 is None and kind.two_axes:
        what = "the second axis, fixed in the second body" if type_ == "universal" else "the disc's axis, fixed in b"
        raise problem(name + ".axis2", f"is missing: a {type_} joint needs axis2=, {what}")
    if axis2 is not None and not kind.two_axes:
        raise problem(name + ".axis2", f"is not used by a {type_} joint; only universal and rolling_disc have two axes")
    first = list(_Z) if axis_ is None else axis(axis_, where)
    second = list(_NONE) if axis2 is None else axis(axis2, name + ".axis2")
    return first, second, list(_NO_ROTATION)


def _coordinate_numbers(joint: Joint, field: str, value: Any, kind: JointKind) -> Sequence[Number]:
    if value is None:
        return _ZEROS
    where, n = f"{joint.name}.{field}", len(kind.free)
    if n == 0:
        raise problem(
            where, f"is given, but a {joint.type} joint has no free coordinate; use a bushing or a spring_damper"
        )
    shape = shape_of(value)
    if shape == () and n == 1:
        joint.shapes[field] = ()
        return [scalar(value, where), *_ZEROS[1:]]
    if shape != (n,):
        raise problem(
            where,
            f"must be {n} numbers, one for each free coordinate ({', '.join(kind.coordinates)}), got {shown(value)}",
        )
    joint.shapes[field] = (n,)
    return [*array(value, (n,), where), *_ZEROS[n:]]


def add_joint(
    model: Model,
    type_: str,
    name: Any,
    a: Any,
    b: Any,
    *,
    at: Any,
    axis: Any = None,
    axis2: Any = None,
    orientation: Any = None,
    k: Any = None,
    c: Any = None,
    preload: Any = None,
    law: Any = None,
    length: Any = None,
    radius: Any = None,
) -> Joint:
    """Check and add a joint of any kind."""
    joint = Joint(model, model.new_name("joint", name))
    kind = KINDS[type_]
    joint.type, joint.shapes = type_, {}
    at = model.connect(joint, f"joint {name!r}", a, b, at)
    joint.one_point = not is_pair(at)
    if joint.one_point and type_ in ("distance", "rolling_disc"):
        raise problem(name + ".at", f"must be two points (P_a, P_b): a {type_} joint keeps a relation between them")
    where = name + ".at"
    at_a, at_b = (vector(at, where),) * 2 if joint.one_point else (vector(at[0], where), vector(at[1], where))
    z, x, q = _frame(name, type_, kind, axis, axis2, orientation)
    if type_ == "rolling_disc" and radius is None:
        raise problem(name + ".radius", "is missing: a rolling_disc needs its radius in m")
    entries = [
        *(*at_a, *at_b, *z, *x, *q),
        *_coordinate_numbers(joint, "k", k, kind),
        *_coordinate_numbers(joint, "c", c, kind),
        *_coordinate_numbers(joint, "preload", preload, kind),
        0.0 if length is None else scalar(length, name + ".length"),
        0.0 if radius is None else scalar(radius, name + ".radius"),
    ]
    joint.flags = (
        HAS_K * (k is not None)
        + HAS_C * (c is not None)
        + HAS_PRELOAD * (preload is not None)
        + FRAME_GIVEN * (orientation is not None)
        + LENGTH_GIVEN * (length is not None)
    )
    laws = add_laws(joint, law, len(kind.free), kind.coordinates)
    joint.put(entries)
    joint.index = len(model.joints)
    laws.commit(joint.index)
    model.register(joint, model.joints)
    return joint
