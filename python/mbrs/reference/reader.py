"""Tables to plain objects: the numbers of each body, joint, element and load, taken out of the one vector x
(docs/tables.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import ModelError
from . import so3
from .rows import FREE
from .so3 import Array
from .time_functions import FUNCTION, TimeFunction, time_function

JOINTS = ["fixed", "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free"]
JOINTS += ["distance", "knife_edge", "rolling_disc", "screw", "point_on_line"]
ELEMENTS = ("spring_damper", "bushing", "torsion")
HAS_K, HAS_C, HAS_PRELOAD, OWN_FRAME, OWN_LENGTH = 1, 2, 4, 8, 16


@dataclass
class Body:
    """A rigid body as drawn: pose of its centre of mass in the world, inertia about it in body axes."""

    name: str
    centre: Array
    R: Array
    com: Array
    mass: Array
    inertia: Array
    velocity: Array
    angular_velocity: Array


@dataclass
class Marker:
    """A frame fixed in a body: point from the centre of mass and axes, both in body axes."""

    body: int
    s: Array
    F: Array


@dataclass
class Link:
    """A joint or an element: marker a, marker b and the linear law f = preload + k e + c e' of its coordinates."""

    name: str
    kind: str
    a: Marker
    b: Marker
    k: Array
    c: Array
    preload: Array
    length: Array = field(default_factory=lambda: np.zeros(()))
    has_force: bool = False
    laws: list[Any] = field(default_factory=list)
    turns: int | None = None  # where in the memory its angles continue, of links whose force depends on them
    radius: Array = field(default_factory=lambda: np.zeros(()))
    pitch: Array = field(default_factory=lambda: np.zeros(()))  # of a screw, m per radian
    # of a drive or coupler: its row, the motion it follows, the joint, row and ratio that it is coupled with
    row: Any = None
    motion: TimeFunction | None = None
    first: Link | None = None
    ratio: Array = field(default_factory=lambda: np.zeros(()))
    slides: bool = False  # without its velocity rows
    node: Any = None  # of a flexible body, whose frame a modal link joins with it


@dataclass
class Load:
    """A force at a point or a torque; value in world axes as drawn; a follower turns with its body. ``component``
    of a modal force is the modal coordinate it acts on.
    """

    name: str
    kind: str
    follower: bool
    body: int
    s: Array
    value: Array
    varying: list[tuple[int, TimeFunction]] = field(default_factory=list)
    component: int = 0

    def at(self, t: float) -> Array:
        """The value at a time."""
        out = self.value
        for component, motion in self.varying:
            out = out + np.eye(3)[component] * motion(t)[0]
        return out


GROUND = Body("ground", np.zeros(3), np.eye(3), np.zeros(3), np.zeros(()), np.zeros((3, 3)), np.zeros(3), np.zeros(3))


def read_bodies(t: Mapping[str, Any], x: Array) -> list[Body]:
    bodies = []
    for name, i in entries(t, "body", "name x"):
        R = so3.from_quaternion(x[i + 3 : i + 7])
        com, w = x[i + 7 : i + 10], x[i + 20 : i + 23]
        xx, yy, zz, xy, xz, yz = x[i + 11 : i + 17]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        arm = R @ com
        bodies.append(
            Body(name, x[i : i + 3] + arm, R, com, x[i + 10], inertia, x[i + 17 : i + 20] + np.cross(w, arm), w)
        )
    return bodies


def marker(bodies: list[Body], body: int, point: Array, frame: Array) -> Marker:
    """The marker of a world point and world axes in the drawn pose of its body."""
    b = GROUND if body < 0 else bodies[body]
    return Marker(int(body), b.R.T @ (point - b.centre), b.R.T @ frame)


def axis_frame(axis: Array) -> Array:
    """Frame with z along the axis; x from the world axis that is most nearly perpendicular to it (first on ties)."""
    return frame_of(axis, np.eye(3)[int(np.argmin(np.abs((axis / so3.norm(axis)).real)))])


def frame_of(axis: Array, towards: Array) -> Array:
    """z along the axis, x along the part of the other vector that is orthogonal to it."""
    z = axis / so3.norm(axis)
    x = towards - (towards @ z) * z
    x = x / so3.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def entries(t: Mapping[str, Any], kind: str, columns: str) -> Iterator[Any]:
    """The named columns of all objects of a kind, one object after the other."""
    return zip(*(t.get(f"{kind}_{k}", ()) for k in columns.split()), strict=True)


def read_motions(t: Mapping[str, Any], x: Array) -> list[TimeFunction]:
    """All motions as functions of time."""
    return [
        time_function(int(code), x[i : i + n], t["functions"][of] if code == FUNCTION else None, int(output))
        for code, n, i, of, output in entries(t, "motion", "type n x function output")
    ]


def _law(flags: int, k: Array, c: Array, preload: Array) -> dict[str, Any]:
    """Numbers whose flag is absent count as zero."""
    return dict(
        k=k if flags & HAS_K else 0 * k,
        c=c if flags & HAS_C else 0 * c,
        preload=preload if flags & HAS_PRELOAD else 0 * preload,
        has_force=bool(flags & (HAS_K | HAS_C | HAS_PRELOAD)),
    )


def _length(flags: int, at_a: Array, at_b: Array, given: Array) -> Array:
    return given if flags & OWN_LENGTH else so3.norm(at_b - at_a) + given


def read_joints(t: Mapping[str, Any], x: Array, bodies: list[Body]) -> list[Link]:
    joints = []
    for name, kind, a, b, flags, i in entries(t, "joint", "name type a b flags x"):
        label = JOINTS[int(kind)]
        if a == b:
            raise ModelError(f"joint {name!r} connects a body with itself; give two different bodies")
        at_a, at_b, axis, axis2 = x[i : i + 3], x[i + 3 : i + 6], x[i + 6 : i + 9], x[i + 9 : i + 12]
        if flags & OWN_FRAME:
            frame = so3.from_quaternion(x[i + 12 : i + 16])
        elif label == "universal":
            frame = frame_of(axis, axis2)
        elif label in ("spherical", "distance", "free", "fixed") and not np.any(axis.real):
            frame = np.eye(3)
        else:
            frame = axis_frame(axis)
        law = _law(flags, np.diag(x[i + 16 : i + 22]), np.diag(x[i + 22 : i + 28]), x[i + 28 : i + 34])
        second = axis_frame(axis2) if label == "rolling_disc" else frame
        ends = marker(bodies, a, at_a, frame), marker(bodies, b, at_b, second)
        length = _length(flags, at_a, at_b, x[i + 34])
        joints.append(Link(name, label, *ends, **law, length=length, radius=x[i + 35], pitch=x[i + 36]))
    return joints


def read_elements(t: Mapping[str, Any], x: Array, bodies: list[Body]) -> list[Link]:
    elements = []
    for name, kind, a, b, flags, i in entries(t, "element", "name type a b flags x"):
        label = ELEMENTS[int(kind)]
        at_a, at_b, length, frame = x[i : i + 3], x[i + 3 : i + 6], np.zeros(()), np.eye(3)
        if label == "bushing":
            frame = so3.from_quaternion(x[i + 6 : i + 10])
            law = _law(flags, x[i + 10 : i + 46].reshape(6, 6), x[i + 46 : i + 82].reshape(6, 6), x[i + 82 : i + 88])
        else:
            law = _law(flags, x[i + 6 : i + 7].reshape(1, 1), x[i + 7 : i + 8].reshape(1, 1), x[i + 9 : i + 10])
            length = x[i + 8]
        if label == "torsion":
            frame, at_b = axis_frame(at_b), at_a
        if label == "spring_damper":
            length = _length(flags, at_a, at_b, length)
        ends = marker(bodies, a, at_a, frame), marker(bodies, b, at_b, frame)
        elements.append(Link(name, label, *ends, **law, length=length))
    return elements


def read_loads(t: Mapping[str, Any], x: Array, bodies: list[Body]) -> list[Load]:
    loads: list[Load] = []
    for name, kind, body, frame, i in entries(t, "load", "name type body frame x"):
        m = marker(bodies, body, x[i : i + 3], np.eye(3))
        label = ("force", "torque", "modal")[int(kind)]
        loads.append(Load(name, label, bool(frame), int(body), m.s, x[i + 3 : i + 6], component=int(frame)))
    motions = read_motions(t, x)
    for load, component, motion in entries(t, "load_motion", "load component motion"):
        loads[load].varying.append((int(component), motions[motion]))
    return loads


def read_imposed(t: Mapping[str, Any], x: Array, joints: list[Link]) -> list[Link]:
    """Drives, then couplers, as links with one row each on the markers of their joint (of a coupler the second one)."""
    motions, out = read_motions(t, x), []
    none = np.zeros((6, 6))

    def link(name: str, kind: str, joint: Link, coordinate: int) -> Link:
        return Link(name, kind, joint.a, joint.b, none, none, np.zeros(6), row=FREE[joint.kind][coordinate])

    for name, joint, coordinate, motion in entries(t, "drive", "name joint coordinate motion"):
        out.append(link(name, "drive", joints[joint], coordinate))
        out[-1].motion = motions[motion]
    for name, a, b, of_a, of_b, i in entries(t, "coupler", "name first second first_coordinate second_coordinate x"):
        out.append(link(name, "coupler", joints[b], of_b))
        out[-1].first = link(name, "drive", joints[a], of_a)
        out[-1].ratio, out[-1].length = x[i], x[i + 1]
    return out


def refuse_others(t: Mapping[str, Any]) -> None:
    """Raise for parts of a model that the equations here do not have."""
    for key, what in (("air_name", "aerodynamics"), ("constraint_name", "constraints that are functions")):
        for name in t.get(key, ()):
            raise ModelError(f"the reference has no {what}, but the model has {name!r}; compare a model without it")


def read_gravity(t: Mapping[str, Any], x: Array) -> Array:
    i = int(np.atleast_1d(t.get("gravity_x", -1))[0])
    return np.zeros(3) if i < 0 else x[i : i + 3]


def located_points(t: Mapping[str, Any], x: Array, bodies: list[Body]) -> Array:
    """Centres of mass, both ends of joints, both ends of elements (a torsion spring has one point)."""
    points = [b.centre for b in bodies[: len(t["body_name"])]]
    for i in t.get("joint_x", ()):
        points += [x[i : i + 3], x[i + 3 : i + 6]]
    for kind, i in entries(t, "element", "type x"):
        points += [x[i : i + 3]] if ELEMENTS[int(kind)] == "torsion" else [x[i : i + 3], x[i + 3 : i + 6]]
    return np.array(points).reshape(-1, 3)


def characteristic_length(points: Array) -> float:
    """Largest distance of a point from the mean; only a scale, so its own derivative is left out."""
    if len(points) == 0:
        return 1.0
    largest = float(np.max(np.linalg.norm(points.real - points.real.mean(axis=0), axis=1)))
    # points that are one but for rounding make no length
    return largest if largest > 1e-12 * np.max(np.abs(points.real)) else 1.0
