"""Drives and couplers: joint coordinates that follow a motion, or each other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from .._lib.checks import is_word
from .aliases import Scalar
from .argument_checks import pack
from .book import Book, Group, Item
from .joint import Joint
from .motions import MotionItem, MotionLike
from .names import not_found, problem, shown
from .schema import COUPLER, DRIVE, Kind

JointLike = Joint | str


class Drive(MotionItem):
    """Handle of a drive; see `Model.drive`. Its numbers are those of its motion."""

    __slots__ = ("coordinate", "joint")
    joint: int
    coordinate: int
    kind = "drive"

    @property
    def table(self) -> Kind:
        return DRIVE

    def fields(self) -> dict[str, Group]:
        return self.motion_fields(unit=_unit(self.model.joints[self.joint], self.coordinate))


class Coupler(Item):
    """Handle of a coupler; see `Model.coupler`."""

    __slots__ = ("first", "first_coordinate", "second", "second_coordinate")
    first: int
    first_coordinate: int
    second: int
    second_coordinate: int
    store = "coupler"
    kind = "coupler"

    @property
    def table(self) -> Kind:
        return COUPLER

    def fields(self) -> dict[str, Group]:
        ends = ((self.first, self.first_coordinate), (self.second, self.second_coordinate))
        a, b = (_unit(self.model.joints[joint], coordinate) for joint, coordinate in ends)
        units = {"ratio": "" if a == b else f"{b}/{a}", "offset": b}
        return {name: replace(group, units=(units[name],)) for name, group in super().fields().items()}


def _unit(joint: Joint, coordinate: int) -> str:
    return "m" if joint.table.free[coordinate] == "t" else "rad"


def find_joint(book: Book, joint: Any, where: str, key: str) -> Joint:
    """A joint by handle or name."""
    if isinstance(joint, Joint):
        if joint.model is not book:
            raise problem(
                f"{where}.{key}", f"names {shown(joint)}, which belongs to another model; use this model's own"
            )
        return joint
    if not isinstance(joint, str):
        raise problem(f"{where}.{key}", f"must be a joint (its handle or name), got {shown(joint)}")
    item = book.items.get(joint)
    if isinstance(item, Joint):
        return item
    if item is not None:
        raise problem(f"{where}.{key}", f"must be a joint, but {shown(joint)} is a {item.kind}")
    raise not_found(f"{where}.{key}: no joint", joint, [j.name for j in book.joints])


def coordinate_of(joint: Joint, coordinate: Any, where: str, key: str) -> int:
    """Index of a free coordinate, by name; the only one where there is one."""
    known = joint.table.coordinates
    address = f"{where}.{key}"
    if not known:
        raise problem(
            address,
            f"does not exist: a {joint.type} joint such as {shown(joint.name)} has no free coordinate that could move",
        )
    if coordinate is None:
        if len(known) > 1:
            raise problem(address, f"is missing: joint {shown(joint.name)} has several, name one of {', '.join(known)}")
        return 0
    if joint.type == "universal" and isinstance(coordinate, str):
        # as systems and modes call them
        coordinate = {"alpha": "rz", "beta": "rx"}.get(coordinate, coordinate)
    if not is_word(coordinate, known):
        raise problem(
            address, f"must be one of {', '.join(known)} for joint {shown(joint.name)}, got {shown(coordinate)}"
        )
    return known.index(coordinate)


# --- methods of `Model` -----


def drive(self: Book, name: str, joint: JointLike, motion: MotionLike, coordinate: str | None = None) -> Drive:
    """Let a joint coordinate follow a motion: e(q) - m(t) = 0, with rate m' and acceleration m".

    Parameters
    ----------
    name
        Unique in the model.
    joint
        Its handle or name; its free coordinates count from the drawn position, b relative to a. Angles go through any
        number of turns.
    motion
        `Ramp`, `Sine`, `Polynomial`, `Table`, a number (held there), or a Python function of t (s) that returns the
        value, or (value, rate, acceleration). If they are not returned, central differences over 3 ms are used (also before
        t = 0), good to about 1e-9 for motions slower than 10 Hz.
    coordinate
        "x", "y", "z" (m) or "rx", "ry", "rz" (rad, of a spherical or free joint components of the rotation vector);
        needed where the joint has several.

    Returns
    -------
    Drive

    Raises
    ------
    NameNotFoundError
        An unknown joint.
    ModelError
        A coordinate that the joint does not leave free, or that another drive moves; a motion that is none.

    Notes
    -----
    Linear analyses and equilibrium hold it at its value of t = 0, at rest. Reactions and trajectories give its wrench on the
    joint's second body under the drive's name. Cost: one constraint row.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("fan"); r = m.body("rotor", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
    >>> shaft = m.revolute("shaft", m.ground, r, at=(0, 0, 0), axis="z")
    >>> m.drive("motor", shaft, mb.Ramp(60.0))
    <drive 'motor' of 'fan'>
    """
    made = Drive(self, self.new_name("drive", name))
    found = find_joint(self, joint, name, "joint")
    made.joint, made.coordinate = found.index, coordinate_of(found, coordinate, name, "coordinate")
    for other in self.drives:
        if (other.joint, other.coordinate) == (made.joint, made.coordinate):
            raise problem(
                name + ".joint", f"is moved by drive {shown(other.name)} already; one coordinate follows one motion"
            )
    made.owner, made.component = None, -1
    entries = made.take(motion, name, 0)
    made.put(entries)
    made.place = len(self.motions)
    self.motions.append(made)
    self.register(made, self.drives)
    return made


def coupler(
    self: Book,
    name: str,
    first: JointLike,
    second: JointLike,
    ratio: Scalar,
    *,
    first_coordinate: str | None = None,
    second_coordinate: str | None = None,
    offset: Scalar = 0.0,
) -> Coupler:
    """Let one joint coordinate follow another: e_second = ratio e_first + offset (gears, rack, screw).

    Parameters
    ----------
    name
        Unique in the model.
    first, second
        Joints, handles or names; tree joints or joints that close loops.
    ratio
        Of the second rate to the first: -z1/z2 for outer gears, the pitch radius (m/rad) for a rack, the lead over 2 pi
        for a screw.
    first_coordinate, second_coordinate
        As in `drive`; needed where a joint has several. Both of a cylindrical joint may be coupled: a screw.
    offset
        m or rad; 0 keeps the drawn positions.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("rack")
    >>> p = m.body("pinion", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
    >>> r = m.body("rack bar", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, -0.1, 0))
    >>> turn = m.revolute("turn", m.ground, p, at=(0, 0, 0), axis="z")
    >>> slide = m.prismatic("slide", m.ground, r, at=(0, -0.1, 0), axis="x")
    >>> m.coupler("mesh", turn, slide, 0.1)
    <coupler 'mesh' of 'rack'>
    """
    made = Coupler(self, self.new_name("coupler", name))
    a, b = find_joint(self, first, name, "first"), find_joint(self, second, name, "second")
    made.first, made.second = a.index, b.index
    made.first_coordinate = coordinate_of(a, first_coordinate, name, "first_coordinate")
    made.second_coordinate = coordinate_of(b, second_coordinate, name, "second_coordinate")
    if (made.first, made.first_coordinate) == (made.second, made.second_coordinate):
        raise problem(name + ".second", "is the same coordinate as the first; couple two different ones")
    made.put(pack(name, COUPLER, {"ratio": ratio, "offset": offset}).entries)
    self.register(made, self.couplers)
    return made
