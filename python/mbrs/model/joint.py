"""The handle of a joint and its checks; `mbrs.model.joints` has the constructors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from .argument_checks import pack
from .attach import connect
from .book import Book, Group, Item
from .law_items import add_laws, law_fields
from .names import problem, shown
from .schema import JOINTS, Kind

# Sine of the angle by which the axes of a universal joint may miss the right angle, and by which two axes must differ: hand-typed
# directions of seven digits pass. Larger: a leaning cross is taken as square. Pinned by the tests of wrong joints.
_PERPENDICULAR = 1e-6
# Two points this close, relative to their distance from the world origin, have no direction between them: rounding of what was
# typed is all that is left of it. Pinned by the tests of coincident points.
_COINCIDENT = 1e-12


class Joint(Item):
    """Handle of a joint; see `Model.revolute` and its siblings."""

    __slots__ = ("a", "a_node", "b", "b_node", "flags", "one_point", "shapes", "type")
    a: int
    b: int
    a_node: int  # of a flexible body, else -1
    b_node: int
    type: str
    store = "joint"
    kind = "joint"

    @property
    def table(self) -> Kind:
        return JOINTS[self.type]

    def check_together(self, values: Sequence[float]) -> None:
        block = self.table.block
        if "axis2" in self.table.axes and not self.has("orientation"):
            _check_axes(self.name, values[block.slice("axis")], values[block.slice("axis2")], self.type == "universal")
        if self.type == "distance":
            check_apart(self.name, "distance joint", values[block.slice("at_a")], values[block.slice("at_b")])

    def fields(self) -> dict[str, Group]:
        return {**super().fields(), **law_fields(self)}


def check_apart(name: str, what: str, a: Sequence[float], b: Sequence[float]) -> None:
    """A line between two points needs a direction."""
    if math.dist(a, b) <= _COINCIDENT * max(math.hypot(*a), math.hypot(*b)):
        raise problem(
            name + ".at",
            f"gives the {what} two coincident points, so that its direction is undefined; move one, or use a bushing",
        )


def _check_axes(name: str, a: Sequence[float], b: Sequence[float], square: bool) -> None:
    cosine = abs(sum(p * q for p, q in zip(a, b, strict=True))) / (math.hypot(*a) * math.hypot(*b))
    if square and cosine > _PERPENDICULAR:
        raise problem(
            name + ".axis2",
            f"must be perpendicular to axis, but the angle is {math.degrees(math.acos(min(cosine, 1.0))):.6g} degrees",
        )
    if cosine > 1.0 - _PERPENDICULAR:
        raise problem(name + ".axis2", "must not be parallel to axis")


def _check_frame(name: str, kind: Kind, given: dict[str, Any]) -> None:
    """Exactly what the type needs to have a frame: its axes, or an orientation."""
    axis, axis2, type_ = given.get("axis"), given.get("axis2"), kind.type
    if given.get("orientation") is not None:
        if axis is not None or axis2 is not None:
            raise problem(name + ".axis", "and orientation are both given; give one of them")
        return
    if axis is None and "axis" in kind.axes:
        raise problem(
            name + ".axis", f"is missing: a {type_} joint needs axis= (a direction in the world) or orientation="
        )
    if axis2 is None and "axis2" in kind.axes:
        what = "the second axis, fixed in the second body" if type_ == "universal" else "the disc's axis, fixed in b"
        raise problem(name + ".axis2", f"is missing: a {type_} joint needs axis2=, {what}")


def add_joint(book: Book, type_: str, name: Any, a: Any, b: Any, law: Any = None, **given: Any) -> Joint:
    """Check and add a joint of any type."""
    kind = JOINTS[type_]
    joint = Joint(book, book.new_name("joint", name))
    joint.type = type_
    i, j, given["at"] = connect(joint, f"joint {shown(name)}", a, b, given["at"])
    joint.a, joint.b, joint.a_node, joint.b_node = i.body, j.body, i.node, j.node
    _check_frame(name, kind, given)
    if type_ == "rolling_disc" and given["radius"] is None:
        raise problem(name + ".radius", "is missing: a rolling_disc needs its radius in m")
    if type_ == "screw" and given["pitch"] is None:
        raise problem(name + ".pitch", "is missing: a screw needs its pitch in m per radian (the lead over 2 pi)")
    packed = pack(name, kind, given)
    joint.flags, joint.shapes, joint.one_point = packed.flags, packed.shapes, packed.one_point
    laws = add_laws(joint, law, len(kind.free), kind.coordinates)
    joint.put(packed.entries)
    laws.commit(len(book.joints))
    book.register(joint, book.joints)
    return joint
