"""Springs, bushings, torsion springs and loads: their numbers and addresses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .attached_laws import law_fields
from .book import Field, Item, plain, single
from .motions import MotionItem
from .names import problem

if TYPE_CHECKING:
    pass

HAS_K, HAS_C, HAS_PRELOAD, LENGTH_GIVEN = 1, 2, 4, 16
TYPES = {"spring_damper": 0, "bushing": 1, "torsion": 2}
SIZES = {"spring_damper": 10, "bushing": 88, "torsion": 10}
SIX = ("x", "y", "z", "rx", "ry", "rz")
LOAD_TYPES = {"force": 0, "torque": 1, "modal": 2}
LOAD_FRAMES = {"world": 0, "body": 1}
# Two points this close, relative to their distance from the world origin, have no direction between them.
_COINCIDENT = 1e-12


class Element(Item):
    """Handle of a spring-damper, bushing or torsion spring; see `Model.spring_damper` and its siblings."""

    __slots__ = ("a", "a_node", "b", "b_node", "flags", "one_point", "shapes", "type")
    a: int
    b: int
    a_node: int  # of a flexible body, else -1
    b_node: int
    flags: int
    one_point: bool
    shapes: dict[str, tuple[int, ...]]  # of k, c and preload as they were given
    type: str
    store = "element"
    kind = "element"

    @property
    def size(self) -> int:
        return SIZES[self.type]

    def check(self, values: Sequence[float]) -> None:
        if self.type == "spring_damper":
            check_drawn_length(self.name, "spring", values, self.flags, values[8])
        elif self.type == "torsion" and not math.hypot(*values[3:6]) > 0.0:
            raise problem(self.name + ".axis", "must not be a zero vector: give a direction")
        elif self.type == "bushing" and not math.hypot(*values[6:10]) > 0.0:
            raise problem(self.name + ".orientation", "must not be a zero quaternion; (1, 0, 0, 0) is no rotation")

    def fields(self) -> dict[str, Field]:
        made = {"spring_damper": _spring_fields, "bushing": _bushing_fields, "torsion": _torsion_fields}[self.type](
            self
        )
        return {**made, **law_fields(self)}


def _spring_fields(e: Element) -> dict[str, Field]:
    s = e.start
    out = {"at_a": plain(s, 3, "m"), "at_b": plain(s + 3, 3, "m"), "length": single(s + 8, "m")}
    for name, place, unit in (("k", 6, "N/m"), ("c", 7, "N s/m"), ("preload", 9, "N")):
        if name in e.shapes:
            out[name] = single(s + place, unit)
    return out


def _torsion_fields(e: Element) -> dict[str, Field]:
    s = e.start
    turned = Field(tuple((s + 3 + i,) for i in range(3)), (3,), ("rad",) * 3, "axis")
    out = {"at": plain(s, 3, "m"), "axis": turned, "angle": single(s + 8, "rad")}
    for name, place, unit in (("k", 6, "N m/rad"), ("c", 7, "N m s/rad"), ("preload", 9, "N m")):
        if name in e.shapes:
            out[name] = single(s + place, unit)
    return out


def _bushing_fields(e: Element) -> dict[str, Field]:
    s = e.start
    out = {"at_a": plain(s, 3, "m"), "at_b": plain(s + 3, 3, "m")}
    if e.one_point:
        out["at"] = Field(tuple((s + i, s + 3 + i) for i in range(3)), (3,), ("m",) * 3, "both")
    out["orientation"] = Field(tuple((s + 6 + i,) for i in range(4)), (4,), ("rad",) * 3, "orientation")
    for name, place, per_second in (("k", 10, ""), ("c", 46, " s")):
        if name in e.shapes:
            out[name] = _matrix_field(s + place, e.shapes[name], per_second)
    if "preload" in e.shapes:
        out["preload"] = plain(s + 82, 6, ["N"] * 3 + ["N m"] * 3)
    return out


def _matrix_field(start: int, shape: tuple[int, ...], second: str) -> Field:
    def unit(i: int, j: int) -> str:
        force = "N" if i < 3 else "N m"
        return f"{force}{second}/{'m' if j < 3 else 'rad'}"

    if shape == (6,):
        return Field(tuple((start + 7 * i,) for i in range(6)), shape, tuple(unit(i, i) for i in range(6)))
    pairs = [(i, j) for i in range(6) for j in range(6)]
    return Field(tuple((start + 6 * i + j,) for i, j in pairs), shape, tuple(unit(i, j) for i, j in pairs))


def check_drawn_length(name: str, what: str, values: Sequence[float], flags: int, length: float) -> None:
    """A line between two points needs a direction, and a natural length that is not negative."""
    a, b = values[0:3], values[3:6]
    if math.dist(a, b) <= _COINCIDENT * max(math.hypot(*a), math.hypot(*b)):
        raise problem(
            name + ".at",
            f"gives the {what} two coincident points, so that its direction is undefined; move one, or use a bushing",
        )
    if flags & LENGTH_GIVEN and length < 0.0:
        raise problem(name + ".length", f"must not be negative, got {length:g}")


class Load(Item):
    """Handle of a force or torque; see `Model.force` and `Model.torque`."""

    __slots__ = ("body", "frame", "motions", "node", "type")
    body: int
    node: int  # of a flexible body, else -1
    frame: str
    motions: list[MotionItem]  # of those components that vary in time
    type: str
    store = "load"
    kind = "load"

    @property
    def size(self) -> int:
        return 6

    def fields(self) -> dict[str, Field]:
        unit = "N" if self.type == "force" else "N m"
        out = {"value": plain(self.start + 3, 3, unit)}
        if self.type == "force":
            out = {"at": plain(self.start, 3, "m"), **out}
        for motion in self.motions:
            out.update(motion.motion_fields("xyz"[motion.component] + "_", unit))
        return out

    def recheck(self) -> None:
        super().recheck()
        for motion in self.motions:
            motion.recheck()
