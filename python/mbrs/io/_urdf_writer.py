"""A model as URDF: a tree of links whose frames are where their joints are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from .._lib.files import write_atomic
from .._lib.formats import Omission, warn_of_omissions
from .._lib.rotations import quaternion_matrix
from ..errors import ModelError
from ..model.bodies import INERTIA_PLACE
from ..model.shapes import plain
from ..view.shapes import frame as along
from ._poses import Array, Frame, roll_pitch_yaw_of

# A limit this large is none: URDF wants numbers for every prismatic joint. Too small: a real limit is taken for none. Pinned by
# tests/io/test_urdf.py.
NO_LIMIT = 1e30
_SINGLE = {"revolute": "continuous", "prismatic": "prismatic", "planar": "planar", "free": "floating", "fixed": "fixed"}
_COMPOSED = ("cylindrical", "universal", "spherical")
_FORCES = ("k", "preload")


def write(model: Any, path: Path) -> Path:
    """Write a model as URDF.

    Cylindrical, universal and spherical joints become several in a row with massless links between, loads and springs are left out.

    Raises
    ------
    ModelError
        What would be another mechanism: closed loops, flexible bodies, joints that URDF does not have, joints drawn apart.

    Warns
    -----
    OmissionWarning
        What URDF does not have, by object.
    """
    writer = _Writer(model)
    text = writer.text()
    done = write_atomic(path, text)
    warn_of_omissions(Path(path).name, writer.omissions)
    return done


class _Writer:
    def __init__(self, model: Any) -> None:
        self.model = model
        self.omissions: list[Omission] = []
        self.root = ElementTree.Element("robot", name=model.name)
        # where the frame of each body's link is; -1: ground
        self.frames: dict[int, Frame] = {-1: Frame()}
        self.link_of: dict[int, str] = {-1: "world"}
        self.used: set[str] = {"world"}
        self.mimics: dict[str, ElementTree.Element] = {}

    def text(self) -> bytes:
        """The file."""
        self._refuse()
        ElementTree.SubElement(self.root, "link", name="world")
        for joint, inner, outer in self._tree():
            self._add(joint, inner, outer)
        self._add_markers()
        self._add_couplers()
        self._name_the_rest()
        ElementTree.indent(self.root)
        return b'<?xml version="1.0"?>\n' + ElementTree.tostring(self.root) + b"\n"

    def _omit(self, item: Any, feature: str) -> None:
        self.omissions.append(Omission(f"{item.kind} {item.name!r}", feature))

    def _refuse(self) -> None:
        wrong = [f"flexible body {b.name!r}" for b in self.model.bodies if b.modes_and_nodes]
        wrong += [f"{j.type} joint {j.name!r}" for j in self.model.joints if j.type not in (*_SINGLE, *_COMPOSED)]
        points = [b.values("at") for b in self.model.bodies] + [j.values("at_a") for j in self.model.joints]
        size = float(np.ptp(points, axis=0).max()) if points else 0.0
        for j in self.model.joints:
            if (
                j.type != "distance"
                and np.linalg.norm(np.subtract(j.values("at_a"), j.values("at_b"))) > self.model.tolerance * size
            ):
                wrong.append(f"{j.type} joint {j.name!r}, whose points are drawn apart")
        if wrong:
            raise ModelError(f"URDF cannot hold {'; '.join(wrong)}")

    def _tree(self) -> list[tuple[Any, int, int]]:
        """(joint or None, inner, outer) from ground outwards; bodies that no joint carries are free."""
        beside: dict[int, list[Any]] = {}
        for joint in self.model.joints:
            beside.setdefault(joint.a, []).append(joint)
            beside.setdefault(joint.b, []).append(joint)
        order: list[tuple[Any, int, int]] = []
        reached, used = {-1}, set()
        for start in (-1, *range(len(self.model.bodies))):
            if start not in reached:
                order.append((None, -1, start))
                reached.add(start)
            waiting = [start]
            while waiting:
                inner = waiting.pop(0)
                for joint in beside.get(inner, ()):
                    outer = joint.b if joint.a == inner else joint.a
                    if joint.index in used or outer in reached:
                        continue
                    used.add(joint.index)
                    reached.add(outer)
                    order.append((joint, inner, outer))
                    waiting.append(outer)
        loops = [repr(j.name) for j in self.model.joints if j.index not in used]
        if loops:
            raise ModelError(
                f"URDF has no closed loops, and joint{'s' * (len(loops) > 1)} {', '.join(loops)} would close some"
            )
        return order

    def _body_frame(self, body: int, at: Sequence[float]) -> Frame:
        return Frame(quaternion_matrix(self.model.bodies[body].values("orientation")), np.array(at))

    def _add(self, joint: Any, inner: int, outer: int) -> None:
        body = self.model.bodies[outer]
        name = self._new(body.name)
        self.link_of[outer] = name
        at = body.values("at") if joint is None else joint.values("at_a")
        self.frames[outer] = frame = self._body_frame(outer, at)
        if joint is None:
            self._joint(
                self._new(f"{body.name} free"), "floating", self.link_of[inner], name, frame.within(self.frames[inner])
            )
        else:
            self._chain(joint, inner, outer, frame)
        self._link(name, body, frame)

    def _new(self, wanted: str) -> str:
        made, n = wanted, 2
        while made in self.used:
            made, n = f"{wanted} {n}", n + 1
        self.used.add(made)
        return made

    def _link(self, name: str, body: Any, frame: Frame) -> None:
        link = ElementTree.SubElement(self.root, "link", name=name)
        inertial = ElementTree.SubElement(link, "inertial")
        own = self._body_frame(body.index, body.values("at"))
        moments = body.values("inertia")
        _origin(inertial, Frame(np.eye(3), frame.R.T @ (own.point(body.values("com")) - frame.p)))
        ElementTree.SubElement(inertial, "mass", value=_text(body.values("mass")[0]))
        tensor = {f"i{'xyz'[r]}{'xyz'[c]}": _text(moments[INERTIA_PLACE[r][c]]) for r in range(3) for c in range(r, 3)}
        ElementTree.SubElement(inertial, "inertia", tensor)
        for shape in body.shape:
            self._visual(link, body, own, frame, plain(shape))
        if any(body.values("velocity")) or any(body.values("angular_velocity")):
            self._omit(body, "velocity")

    def _visual(self, link: ElementTree.Element, body: Any, own: Frame, frame: Frame, shape: dict[str, Any]) -> None:
        """A shape, in the frame of the link."""
        kind = shape["type"]
        if kind == "sphere" and isinstance(shape["radius"], list):
            self._omit(body, "ellipsoid")
            return
        visual = ElementTree.SubElement(link, "visual")
        turn = quaternion_matrix(shape.get("orientation", (1.0, 0.0, 0.0, 0.0)))
        if "axis" in shape:
            turn = turn @ along(shape["axis"])
        place = (own @ Frame(turn, np.array(shape.get("at", (0.0, 0.0, 0.0))))).within(frame)
        _origin(visual, place)
        geometry = ElementTree.SubElement(visual, "geometry")
        if kind == "mesh":
            scale = np.broadcast_to(shape.get("scale", 1.0), (3,))
            given = {"filename": shape["file"], "scale": " ".join(_text(float(v)) for v in scale)}
        elif kind == "box":
            given = {"size": " ".join(_text(v) for v in shape["size"])}
        else:
            given = {key: _text(shape[key]) for key in ("radius", "length") if key in shape}
        ElementTree.SubElement(geometry, kind, given)
        if "colour" in shape:
            rgb = (int(shape["colour"][i : i + 2], 16) / 255 for i in (1, 3, 5))
            material = ElementTree.SubElement(visual, "material", name=shape["colour"])
            ElementTree.SubElement(material, "color", rgba=" ".join([*(f"{v:.6g}" for v in rgb), "1"]))

    def _joint(self, name: str, type_: str, parent: str, child: str, place: Frame) -> ElementTree.Element:
        node = ElementTree.SubElement(self.root, "joint", name=name, type=type_)
        _origin(node, place)
        ElementTree.SubElement(node, "parent", link=parent)
        ElementTree.SubElement(node, "child", link=child)
        return node

    def _chain(self, joint: Any, inner: int, outer: int, frame: Frame) -> None:
        """A joint, or several with massless links between that move as it does."""
        parts = self._parts(joint, reversed_=joint.a == outer)
        parent, outside = self.link_of[inner], self.frames[inner]
        damping = _coefficients(joint, "c")
        friction = self._friction(joint)
        coordinates = joint.table.coordinates
        for i, (coordinate, type_, axis) in enumerate(parts):
            last = i == len(parts) - 1
            child = self.link_of[outer] if last else self._new(f"{joint.name} {coordinate} link")
            name = self._new(joint.name if len(parts) == 1 else f"{joint.name} {coordinate}")
            if not last:
                ElementTree.SubElement(self.root, "link", name=child)
            node = self._joint(name, type_, parent, child, frame.within(outside))
            if type_ not in ("fixed", "floating"):
                ElementTree.SubElement(node, "axis", xyz=_text(*(frame.R.T @ axis)))
            if type_ == "prismatic":
                ElementTree.SubElement(
                    node,
                    "limit",
                    dict.fromkeys(("effort", "velocity", "upper"), _text(NO_LIMIT)) | {"lower": _text(-NO_LIMIT)},
                )
            mine = [coordinates.index(coordinate)] if coordinate else list(range(len(coordinates)))
            self._dynamics(node, joint, [damping[m] for m in mine], [friction[m] for m in mine])
            self.mimics[f"{joint.name}/{coordinate or next(iter(coordinates), '')}"] = node
            parent, outside = child, frame
        if joint.type == "spherical":
            self._omit(
                joint, "rotation vector, now three hinges in a row, which lock when the second one turns by 90 degrees"
            )
        for key in _FORCES:
            if any(_coefficients(joint, key)):
                self._omit(joint, "stiffness" if key == "k" else "preload")

    def _parts(self, joint: Any, reversed_: bool) -> list[tuple[str, str, Array]]:
        """(coordinate of the model's joint or "", URDF type, world axis) from the inner to the outer link."""
        sign = -1.0 if reversed_ else 1.0
        one = _SINGLE.get(joint.type)
        if joint.type in ("fixed", "free"):
            return [("", str(one), np.zeros(3))]
        z, x = _axes(joint)
        if one:
            return [("" if joint.type == "planar" else joint.table.coordinates[0], one, sign * z)]
        parts = {
            "cylindrical": [("z", "prismatic", z), ("rz", "continuous", z)],
            "universal": [("rz", "continuous", z), ("rx", "continuous", x)],
            "spherical": [("rx", "continuous", x), ("ry", "continuous", np.cross(z, x)), ("rz", "continuous", z)],
        }[joint.type]
        return [(c, t, sign * axis) for c, t, axis in (reversed(parts) if reversed_ else parts)]

    def _friction(self, joint: Any) -> list[float]:
        """Dry friction of each coordinate; other laws are named."""
        from ._tree import FRICTION_RATE

        out = [0.0] * len(joint.table.coordinates)
        for law in self.model.laws_of.get(("joint", joint.index), ()):
            values = law.values()
            if law.name == "CoulombTanh" and values[1] == FRICTION_RATE and out[law.component] == 0.0:
                out[law.component] = values[0]
            else:
                self._omit(joint, f"law {law.name}")
        return out

    def _dynamics(self, node: ElementTree.Element, joint: Any, damping: list[float], friction: list[float]) -> None:
        given = {}
        for key, values in (("damping", damping), ("friction", friction)):
            if any(values) and min(values) == max(values):
                given[key] = _text(values[0])
            elif any(values):
                self._omit(joint, f"{key} that differs between its coordinates")
        if given:
            ElementTree.SubElement(node, "dynamics", given)

    def _add_markers(self) -> None:
        for marker in self.model.markers:
            name = self._new(marker.name)
            ElementTree.SubElement(self.root, "link", name=name)
            here = Frame(quaternion_matrix(marker.values("orientation")), np.array(marker.values("at")))
            place = here.within(self.frames[marker.body])
            self._joint(self._new(f"{marker.name} fixed"), "fixed", self.link_of[marker.body], name, place)

    def _add_couplers(self) -> None:
        for coupler in self.model.couplers:
            ends = []
            for key in ("first", "second"):
                joint = self.model.joints[getattr(coupler, key)]
                coordinate = joint.table.coordinates[getattr(coupler, f"{key}_coordinate")]
                ends.append(
                    self.mimics.get(f"{joint.name}/{coordinate}")
                    if joint.type not in ("planar", "free", "spherical")
                    else None
                )
            first, second = ends
            if first is None or second is None or second.find("mimic") is not None:
                self._omit(coupler, "coupling")
                continue
            (ratio,), (offset,) = coupler.values("ratio"), coupler.values("offset")
            given = {"joint": first.attrib["name"], "multiplier": _text(ratio), "offset": _text(offset)}
            ElementTree.SubElement(second, "mimic", given)

    def _name_the_rest(self) -> None:
        for item in (*self.model.elements, *self.model.loads, *self.model.drives, *self.model.constraints):
            self._omit(item, getattr(item, "type", item.kind))
        whole = f"model {self.model.name!r}"
        if self.model.gravity is not None:
            self.omissions.append(Omission(whole, "gravity"))
        if self.model.parameters:
            self.omissions.append(Omission(whole, "parameters, now their present values"))


def _axes(joint: Any) -> tuple[Array, Array]:
    """z and x of the joint frame in the world: its axis and, of a universal joint, the second one."""
    if joint.has("orientation"):
        R = quaternion_matrix(joint.values("orientation"))
        return R[:, 2], R[:, 0]
    z = np.array(joint.values("axis"))
    z = z / np.linalg.norm(z)
    if joint.type == "universal":
        x = np.array(joint.values("axis2"))
        return z, x / np.linalg.norm(x)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    return z, x / np.linalg.norm(x)


def _coefficients(joint: Any, key: str) -> list[float]:
    n = len(joint.table.coordinates)
    return joint.values(key)[:n] if joint.has(key) else [0.0] * n


def _text(*numbers: float) -> str:
    return " ".join(repr(float(v) + 0.0) for v in numbers)


def _origin(node: ElementTree.Element, frame: Frame) -> None:
    ElementTree.SubElement(node, "origin", xyz=_text(*frame.p), rpy=_text(*roll_pitch_yaw_of(frame.R)))
