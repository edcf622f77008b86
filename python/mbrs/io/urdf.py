"""URDF: robots as links and joints, http://wiki.ros.org/urdf/XML. The drawn configuration is the one with all coordinates zero."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .._lib.formats import Format, register, warn_of_omissions
from ..errors import DuplicateNameError, NameNotFoundError
from ..model.model import Model
from ._composites import Hinge
from ._poses import Frame, Inertia, roll_pitch_yaw
from ._tree import Builder, Coupling, Link, Tree, omit_friction
from ._urdf_writer import NO_LIMIT, write
from ._xml import LARGEST_XML, Node, clipped, parse

_KINDS = {
    "fixed": "fixed",
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "planar": "planar",
    "floating": "free",
}
_XACRO = "xacro"


def read(path: Path, functions: bool = False) -> Model:
    """A model from a URDF file; the root link is ground, or welded to it where it has a mass.

    Links become bodies with their own frames, ``revolute`` and ``continuous`` joints hinges, ``floating`` ones free joints; dampings
    stay, friction is made smooth, ``mimic`` becomes a coupler, links without mass that do not move become markers. Gravity is not
    part of the format: assign ``m.gravity``.

    Raises
    ------
    ModelError
        What is wrong, with file, line and element.

    Warns
    -----
    OmissionWarning
        Limits, pictures, transmissions and all else that a model does not have, by object.
    """
    robot = parse(Path(path), "robot", "URDF")
    with np.errstate(all="ignore"):
        model = _Reader(robot).model()
    robot.source.ledger(robot.element)
    warn_of_omissions(Path(path).name, robot.source.omissions)
    return model


def frame_of(node: Node | None) -> Frame:
    """The pose of an <origin>; without one that of the frame around it."""
    if node is None:
        return Frame()
    unknown = [key for key in node.given if key not in ("xyz", "rpy")]
    if unknown:
        raise node.error(
            f"has the attribute {clipped(unknown[0])!r}, which is not read; a pose is given by xyz and rpy"
        )
    r, p, y = node.numbers("rpy", 3, (0.0, 0.0, 0.0))
    return Frame(roll_pitch_yaw(r, p, y), np.array(node.numbers("xyz", 3, (0.0, 0.0, 0.0))))


class _Reader:
    def __init__(self, robot: Node) -> None:
        self.robot, self.source = robot, robot.source
        for element in robot.element.iter():
            if _XACRO in str(element.tag).rpartition("}")[0]:
                raise robot.error(
                    "contains xacro commands; write the robot that they make: xacro file.xacro > file.urdf"
                )
        self.links = self._named("link")
        self.joints = self._named("joint")
        if not self.links:
            raise robot.error("has no links")

    def _named(self, tag: str) -> dict[str, Node]:
        found: dict[str, Node] = {}
        for node in self.robot.children(tag):
            name = node.required("name")
            if name in found:
                raise node.error("has a name that another one has", DuplicateNameError)
            found[name] = node
        return found

    def model(self) -> Model:
        model = Model(self.robot.text("name") or self.source.path.stem)
        tree = Tree()
        carried, root = self._carriers()
        self._add_root(tree, root)
        place = {root: 0}
        waiting = [root]
        children: dict[str, list[str]] = {}
        for child, (_, parent) in carried.items():
            children.setdefault(parent, []).append(child)
        while waiting:
            parent = waiting.pop(0)
            for child in children.get(parent, ()):
                place[child] = len(tree.links)
                self._add_link(tree, child, carried[child][0], place[parent])
                waiting.append(child)
        self._check_mimicked(tree)
        omit_friction(self.source, [h for link in tree.links for h in link.hinges])
        Builder(model, tree, self.source).build()
        return model

    def _carriers(self) -> tuple[dict[str, tuple[Node, str]], str]:
        """(joint, parent link) of every link but the root, and the root."""
        carried: dict[str, tuple[Node, str]] = {}
        for joint in self.joints.values():
            ends = []
            for tag in ("parent", "child"):
                node = joint.child(tag)
                link = node.required("link") if node else None
                if link is None or node is None:
                    raise joint.error(f"lacks its <{tag} link=...>")
                if link not in self.links:
                    raise node.error(
                        f"of {joint.what} names the link {clipped(link)!r}, which does not exist", NameNotFoundError
                    )
                ends.append(link)
            if ends[1] in carried:
                other = carried[ends[1]][0].what
                raise joint.error(
                    f"carries link {clipped(ends[1])!r}, which {other} carries already: URDF has no loops"
                )
            carried[ends[1]] = (joint, ends[0])
        roots = [name for name in self.links if name not in carried]
        if len(roots) != 1:
            named = ", ".join(repr(clipped(r)) for r in roots[:5])
            raise self.robot.error(
                f"has {len(roots)} links that no joint carries ({named}); one is needed"
                if roots
                else "has links in a circle"
            )
        reached, waiting = {roots[0]}, [roots[0]]
        below: dict[str, list[str]] = {}
        for child, (_, parent) in carried.items():
            below.setdefault(parent, []).append(child)
        while waiting:
            for child in below.get(waiting.pop(), ()):
                reached.add(child)
                waiting.append(child)
        lost = [name for name in self.links if name not in reached]
        if lost:
            raise self.links[lost[0]].error("is in a circle of links that the root does not reach")
        return carried, roots[0]

    def _add_root(self, tree: Tree, name: str) -> None:
        node = self.links[name]
        inertia = self._inertia(node)
        if name == "world" and inertia.mass == 0.0:
            # by convention the frame of the world itself, which needs no marker
            tree.links.append(Link("", -1, Frame(), node.where, inertia=inertia))
        else:
            tree.links.append(Link(name, -1, Frame(), node.where, inertia=inertia, weld=f"{name} on ground"))

    def _add_link(self, tree: Tree, name: str, joint: Node, parent: int) -> None:
        node = self.links[name]
        frame = tree.links[parent].frame @ frame_of(joint.child("origin"))
        link = Link(name, parent, frame, node.where, inertia=self._inertia(node), weld=joint.required("name"))
        kind = _KINDS[joint.word("type", tuple(_KINDS))]
        axis_node = joint.child("axis")
        axis = np.array(axis_node.numbers("xyz", 3) if axis_node else (1.0, 0.0, 0.0))
        dynamics, mimic = joint.child("dynamics"), joint.child("mimic")
        self._limits(joint)
        if kind != "fixed":
            size = float(np.abs(axis).max())
            if size == 0.0 and kind != "free":
                raise (axis_node or joint).error("of a joint must not be zero")
            world = frame.R @ (axis / (size or 1.0))
            hinge = Hinge(joint.required("name"), kind, frame.p, world, where=joint.where)
            if dynamics is not None:
                hinge.c = _not_negative(dynamics, "damping")
                hinge.friction = _not_negative(dynamics, "friction")
            link.hinges.append(hinge)
        elif dynamics is not None:
            joint.omit("dynamics of a fixed joint")
        if mimic is not None:
            self._mimic(tree, joint, mimic, kind)
        tree.links.append(link)

    def _limits(self, joint: Node) -> None:
        limit = joint.child("limit")
        if limit is None:
            return
        given = [limit.number(key) for key in ("lower", "upper", "effort", "velocity") if key in limit]
        if any(abs(v) < NO_LIMIT for v in given):
            joint.omit("limit")

    def _mimic(self, tree: Tree, joint: Node, mimic: Node, kind: str) -> None:
        if kind not in ("revolute", "prismatic"):
            raise mimic.error(f"of {joint.what} needs a joint with one coordinate; this one is {joint.text('type')}")
        first, second = mimic.required("joint"), joint.required("name")
        if first == second:
            raise mimic.error(f"of {joint.what} names the joint itself")
        ratio, offset = mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)
        tree.couplings.append(Coupling(f"{second} mimics {first}", first, second, ratio, offset, mimic.where))

    def _check_mimicked(self, tree: Tree) -> None:
        known = {h.name for link in tree.links for h in link.hinges if h.kind in ("revolute", "prismatic")}
        for c in tree.couplings:
            if c.first not in known:
                raise NameNotFoundError(
                    f"{c.where} names {clipped(c.first)!r}, which is not a joint with one coordinate"
                )

    def _inertia(self, link: Node) -> Inertia:
        node = link.child("inertial")
        if node is None:
            return Inertia()
        frame = frame_of(node.child("origin"))
        mass, tensor = node.child("mass"), node.child("inertia")
        if mass is None or tensor is None:
            raise node.error(f"of {link.what} needs <mass> and <inertia>")
        size = mass.number("value")
        xx, xy, xz, yy, yz, zz = (tensor.number(f"i{key}", 0.0) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
        moment = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if size < 0.0 or (size == 0.0 and np.any(moment)):
            raise mass.error(f"of {link.what} must be positive, got {size:g}")
        return Inertia(size, np.zeros(3), moment).moved(frame)


def _not_negative(node: Node, key: str) -> float:
    value = node.number(key, 0.0)
    if value < 0.0:
        raise node.error(f"has a negative {key}, {value:g}")
    return value


register(Format(".urdf", "model", "URDF", read, write, LARGEST_XML))
