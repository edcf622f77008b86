"""Parts of MJCF that have rules of their own: included files, defaults, orientations, masses of geometric bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix
from ..errors import ModelError, NameNotFoundError
from ._poses import Array, Frame, Inertia, rotation_matrix
from ._xml import Node, Source, clipped, parse

# Files that include each other end here. Too small: deeply nested models are refused. Pinned by tests/io/test_hostile.py.
_DEEPEST = 16
_ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
# kg/m3, MuJoCo's default
_DENSITY = 1000.0

Given = Mapping[str, tuple[str, Any]]


def include(root: Node, folder: Path) -> None:
    """Put the elements of included files in the place of <include>; each file once, only from the folder of the model."""
    seen: set[Path] = {Path(root.source.path).resolve()}
    waiting = [(root, 0)]
    while waiting:
        node, depth = waiting.pop()
        for element in list(node.element.iter("include")):
            at = Node(root.source, element)
            name = at.required("file")
            path = _inside(at, folder, name)
            if path in seen:
                raise at.error(f"includes {clipped(name)!r} again")
            if depth >= _DEEPEST:
                raise at.error(f"is nested more than {_DEEPEST} files deep")
            seen.add(path)
            inner = parse(path, _root_of(path), "MJCF", root.source)
            parent = element.getparent()
            place = parent.index(element)
            parent.remove(element)
            for child in reversed(list(inner.element)):
                parent.insert(place, child)
                waiting.append((Node(root.source, child), depth + 1))


def _inside(node: Node, folder: Path, name: str) -> Path:
    try:
        path = (folder / name).resolve()
    except (OSError, ValueError, RuntimeError):
        path = Path("/")
    if Path(name).is_absolute() or not path.is_relative_to(folder.resolve()):
        raise node.error(f"names {clipped(name)!r}, which is outside the folder of the model; such files are not read")
    return path


def _root_of(path: Path) -> str:
    """Included files have <mujoco> or <mujocoinclude> for root."""
    head = b""
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(100_000)
    return "mujocoinclude" if b"<mujocoinclude" in head else "mujoco"


class Defaults:
    """Attributes that elements have unless they say otherwise, by class and tag; a class has those of the one around it."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.classes: dict[str, dict[str, dict[str, tuple[str, Any]]]] = {"main": {}}

    def add(self, top: Node) -> None:
        """A <default> section."""
        waiting = [(top, "main", True)]
        while waiting:
            node, outer, first = waiting.pop()
            name = node.text("class", "main" if first else None)
            if not name:
                raise node.error("lacks the attribute 'class'")
            if name in self.classes and not (first and name == "main"):
                raise node.error(f"defines the class {clipped(name)!r} again")
            made = {tag: dict(given) for tag, given in self.classes[outer].items()}
            self.classes[name] = made
            inner = []
            for child in node.children():
                if child.tag == "default":
                    inner.append((child, name, False))
                else:
                    made.setdefault(child.tag, {}).update(child.given)
            waiting.extend(inner)

    def of(self, element: Any, tag: str, childclass: str) -> Node:
        """The element with its defaults."""
        node = Node(self.source, element)
        name = node.text("class") or childclass
        if name not in self.classes:
            raise node.error(f"names the class {clipped(name)!r}, which no <default> defines", NameNotFoundError)
        return Node(self.source, element, self.classes[name].get(tag))


class Angles:
    """Units of angles and the order of Euler angles, from <compiler>."""

    def __init__(self) -> None:
        self.unit = math.pi / 180.0
        self.sequence = "xyz"

    def configure(self, node: Node) -> None:
        """Read them."""
        if "angle" in node:
            self.unit = 1.0 if node.word("angle", ("degree", "radian")) == "radian" else math.pi / 180.0
        if "eulerseq" in node:
            self.sequence = node.required("eulerseq")
            if len(self.sequence) != 3 or not set(self.sequence) <= set("xyzXYZ"):
                raise node.error(f"has eulerseq = {clipped(self.sequence)!r}; it is three letters of x, y, z, X, Y, Z")

    def rotation(self, node: Node) -> Array:
        """The orientation (3, 3) of an element; the identity without one."""
        given = [key for key in _ORIENTATIONS if key in node]
        own = [key for key in given if key in node.element.attrib]
        if len(own) > 1:
            raise node.error(f"has several orientations: {', '.join(own)}")
        key = (own or given or [""])[0]
        if not key:
            return np.eye(3)
        if key == "quat":
            q = node.numbers(key, 4)
            return quaternion_matrix(_direction(node, key, q))
        if key == "axisangle":
            *axis, angle = node.numbers(key, 4)
            return rotation_matrix(_direction(node, key, axis), angle * self.unit)
        if key == "zaxis":
            return _towards(_direction(node, key, node.numbers(key, 3)))
        if key == "xyaxes":
            v = np.array(node.numbers(key, 6))
            x = _direction(node, key, v[:3])
            y = _direction(node, key, v[3:] - (v[3:] @ x) * x)
            return np.column_stack([x, y, np.cross(x, y)])
        R = np.eye(3)
        for letter, angle in zip(self.sequence, node.numbers(key, 3), strict=True):
            step = rotation_matrix(np.eye(3)["xyz".index(letter.lower())], angle * self.unit)
            R = R @ step if letter.islower() else step @ R
        return R

    def frame(self, node: Node) -> Frame:
        """Position and orientation of an element."""
        return Frame(self.rotation(node), np.array(node.numbers("pos", 3, (0.0, 0.0, 0.0))))


def _direction(node: Node, key: str, values: Any) -> Array:
    v = np.asarray(values, dtype=float)
    size = float(np.abs(v).max())
    length = float(np.linalg.norm(v / size)) if size > 0.0 else 0.0
    if not length > 0.0:
        raise node.error(f"has no direction in {key!r}")
    return v / size / length


def _towards(z: Array) -> Array:
    """The smallest rotation that takes the z axis to a unit vector."""
    axis = np.array([-z[1], z[0], 0.0])
    sine = float(np.hypot(z[0], z[1]))
    if sine == 0.0:
        return np.eye(3) if z[2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    return rotation_matrix(axis, math.atan2(sine, z[2]))


def geom_inertia(node: Node, angles: Angles) -> Inertia:
    """Mass and inertia of a <geom> in the axes of its body: a solid of uniform density.

    Raises
    ------
    ModelError
        A mesh, a shell, or sizes that no solid has.
    """
    kind = node.text("type", "sphere") or ""
    if kind in ("plane", "hfield"):
        return Inertia()
    mass = node.number("mass") if "mass" in node else None
    density = node.number("density", _DENSITY)
    if mass == 0.0 or (mass is None and density == 0.0):
        return Inertia()
    if node.text("shellinertia", "false") == "true" or node.text("fluidshape", "none") != "none":
        raise node.error("is a shell, whose inertia is not computed; give its body an <inertial>")
    if kind not in _SOLIDS:
        raise node.error(f"is a {clipped(kind)}, whose mass is not computed; give its body an <inertial>")
    frame, size = placed(node, kind, angles)
    needed = _SOLIDS[kind]
    if len(size) < needed or any(s <= 0.0 for s in size[:needed]):
        raise node.error(f"needs {needed} positive number{'s' * (needed > 1)} in 'size'")
    volume, moments = _unit_solid(kind, size)
    if not 0.0 < volume < math.inf:
        raise node.error("has a size whose volume is not a number")
    made = density * volume if mass is None else mass
    if made < 0.0:
        raise node.error(f"has the negative mass {made:g}")
    return Inertia(made, np.zeros(3), made * np.diag(moments)).moved(frame)


_SOLIDS = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}


def placed(node: Node, kind: str, angles: Angles) -> tuple[Frame, list[float]]:
    """Frame and half sizes, of elements given from point to point as well."""
    size = node.numbers("size", (1, 2, 3), (0.0,))
    if "fromto" not in node:
        return angles.frame(node), size
    ends = np.array(node.numbers("fromto", 6)).reshape(2, 3)
    along = ends[1] - ends[0]
    frame = Frame(_towards(_direction(node, "fromto", along)), ends.mean(axis=0))
    half = 0.5 * float(np.linalg.norm(along))
    if kind == "sphere":
        raise node.error("is a sphere, which has no 'fromto'")
    return frame, [size[0], half] if kind in ("capsule", "cylinder") else [size[0], size[0], half]


def _unit_solid(kind: str, size: list[float]) -> tuple[float, list[float]]:
    """Volume, and principal moments of a solid of mass 1 with these half sizes, its axis along z."""
    if kind in ("sphere", "ellipsoid"):
        a, b, c = size[:1] * 3 if kind == "sphere" else size
        return 4.0 / 3.0 * math.pi * a * b * c, [(b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5]
    if kind == "box":
        a, b, c = size
        return 8.0 * a * b * c, [(b * b + c * c) / 3, (a * a + c * c) / 3, (a * a + b * b) / 3]
    r, h = size[:2]
    tube = 2.0 * math.pi * r * r * h
    if kind == "cylinder":
        return tube, [r * r / 4 + h * h / 3] * 2 + [r * r / 2]
    ball = 4.0 / 3.0 * math.pi * r * r * r
    whole = tube + ball
    if whole == 0.0:  # sizes so small that the volume is lost
        return whole, [0.0] * 3
    across = tube * (r * r / 4 + h * h / 3) + ball * (0.4 * r * r + h * h + 0.75 * h * r)
    return whole, [across / whole] * 2 + [(tube * r * r / 2 + ball * 0.4 * r * r) / whole]


def inertial(node: Node, angles: Angles) -> Inertia:
    """An <inertial> in the axes of its body."""
    mass = node.number("mass")
    if mass < 0.0:
        raise node.error(f"has the negative mass {mass:g}")
    frame = angles.frame(node)
    if "fullinertia" in node:
        if "diaginertia" in node:
            raise node.error("has both fullinertia and diaginertia")
        xx, yy, zz, xy, xz, yz = node.numbers("fullinertia", 6)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        tensor = np.diag(node.numbers("diaginertia", 3, (0.0, 0.0, 0.0)))
    if mass == 0.0 and np.any(tensor):
        raise ModelError(f"{node.where} has an inertia and no mass")
    return Inertia(mass, np.zeros(3), tensor).moved(frame)
