"""MJCF, the XML files of MuJoCo, https://mujoco.readthedocs.io/en/stable/XMLreference.html. Drawn is the configuration qpos0."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._lib.formats import Format, register, warn_of_omissions
from ..errors import DuplicateNameError, NameNotFoundError
from ..model.model import Model
from ._composites import Hinge
from ._mjcf_loops import add_equalities, add_tendons
from ._mjcf_parts import Angles, Defaults, geom_inertia, include, inertial
from ._poses import Frame, Inertia
from ._tree import Builder, Link, Site, Tree, omit_friction
from ._xml import LARGEST_XML, Node, clipped, parse

_GRAVITY = (0.0, 0.0, -9.81)
# elements that make bodies by rules of their own; without them the model would be another one
_REFUSED = ("attach", "composite", "flexcomp", "replicate", "flex", "skin", "plugin")
# of <compiler>: they change masses
_MASSES = ("boundmass", "boundinertia", "settotalmass")
_LISTED = (
    "actuator",
    "sensor",
    "contact",
    "asset",
    "keyframe",
    "tendon",
    "equality",
    "deformable",
    "custom",
    "extension",
)
_KINDS = {"hinge": "revolute", "slide": "prismatic", "ball": "spherical", "free": "free"}


def read(path: Path, functions: bool = False) -> Model:
    """A model from an MJCF file.

    Bodies keep their frames, joints their springs, dampers and armatures; masses come from ``inertial`` or from geoms; equality
    constraints (connect, weld, joint) close loops exactly, without MuJoCo's softness; sites are markers; a tendon between two sites
    is a spring.

    Raises
    ------
    ModelError
        What is wrong, with file, line and element; elements that make bodies by rules of their own, such as ``composite``.

    Warns
    -----
    OmissionWarning
        Contacts, actuators, limits and all else that a model does not have, by object.
    """
    root = parse(Path(path), "mujoco", "MJCF")
    include(root, Path(path).parent)
    with np.errstate(all="ignore"):
        model = Reader(root).model()
    root.source.ledger(root.element)
    warn_of_omissions(Path(path).name, root.source.omissions)
    return model


@dataclass
class _Place:
    """An element that waits: where it is, and what it inherits."""

    node: Node
    frame: Frame  # of the <body> or <frame> around it, world
    link: int
    childclass: str


class Reader:
    """Reads one file; `tree`, `links` and `hinges` are there for equalities and tendons."""

    def __init__(self, root: Node) -> None:
        self.root, self.source = root, root.source
        self.angles, self.defaults = Angles(), Defaults(root.source)
        self.tree = Tree()
        self.links: dict[str, int] = {"world": -1}
        self.sites: dict[str, Site] = {}
        self.hinges: set[str] = set()
        self.from_geoms = "auto"
        self.groups = (0.0, 5.0)
        # what closes loops, once there are bodies
        self.after: list[Callable[[], None]] = []

    def model(self) -> Model:
        """The model."""
        for element in self.root.element.iter():
            if str(element.tag) in _REFUSED:
                raise Node(self.source, element).error(
                    "makes parts by rules that are not read; save the compiled model: mj_saveLastXML"
                )
        for compiler in self.root.children("compiler"):
            self._compile(compiler)
        for default in self.root.children("default"):
            self.defaults.add(default)
        model = Model(self.root.text("model") or "MuJoCo Model", gravity=self._gravity())
        for section in self.root.children(*_LISTED):
            section.text("name")
        for world in self.root.children("worldbody"):
            self._add_bodies(world)
        omit_friction(self.source, [h for link in self.tree.links for h in link.hinges])
        builder = Builder(model, self.tree, self.source)
        equalities = [e for section in self.root.children("equality") for e in section.children()]
        add_equalities(self, builder, equalities)
        builder.build()
        for action in self.after:
            action()
        if self.after:
            # loops close as well as the file draws them
            size = float(np.ptp([link.frame.p for link in self.tree.links], axis=0).max()) if self.tree.links else 0.0
            model.tolerance = max(model.tolerance, self.source.accuracy.tolerance(size, self.angles.unit))
        add_tendons(self, builder, [t for section in self.root.children("tendon") for t in section.children("spatial")])
        return model

    def _compile(self, node: Node) -> None:
        self.angles.configure(node)
        if node.text("coordinate", "local") != "local":
            raise node.error("has global coordinates, which are not read")
        if "inertiafromgeom" in node:
            self.from_geoms = node.word("inertiafromgeom", ("auto", "true", "false"))
        if "inertiagrouprange" in node:
            low, high = node.numbers("inertiagrouprange", 2)
            self.groups = (low, high)
        for key in _MASSES:
            if key in node and node.number(key) > 0.0:
                raise node.error(
                    f"changes masses by {key!r}, which is not read; save the compiled model: mj_saveLastXML"
                )

    def _gravity(self) -> tuple[float, ...] | None:
        gravity: tuple[float, ...] | None = _GRAVITY
        for option in self.root.children("option"):
            if "gravity" in option:
                gravity = tuple(option.numbers("gravity", 3))
            for flag in option.children("flag"):
                if flag.word("gravity", ("enable", "disable"), "enable") == "disable":
                    gravity = None
        return gravity if gravity is not None and any(gravity) else None

    def _add_bodies(self, world: Node) -> None:
        """All bodies, those around others first."""
        waiting = [_Place(world, Frame(), -1, "main")]
        while waiting:
            here = waiting.pop(0)
            found: list[Inertia] = []
            for part in self._parts(here):
                tag = part.node.tag
                if tag == "body":
                    waiting.append(self._add_body(part))
                elif tag in ("joint", "freejoint"):
                    self._add_joint(part, tag)
                elif tag == "inertial":
                    self._add_inertial(part)
                elif tag == "geom":
                    found += self._weigh(part)
                elif tag == "site":
                    self._add_site(part)
            if here.link >= 0:
                link = self.tree.links[here.link]
                if link.inertia.mass == 0.0:
                    for one in found:
                        link.inertia = link.inertia + one

    def _parts(self, here: _Place) -> Iterator[_Place]:
        """The elements of a body that are read, through its <frame>s; the joints of a body are in its own frame."""
        waiting = [here]
        while waiting:
            outer = waiting.pop()
            for element in outer.node.element:
                tag = str(element.tag)
                if tag == "frame":
                    node = Node(self.source, element)
                    node.text("name")
                    own = outer.frame @ self.angles.frame(node)
                    waiting.append(_Place(node, own, outer.link, self._class(node, outer.childclass)))
                elif tag in ("body", "joint", "freejoint", "inertial", "geom", "site"):
                    node = (
                        Node(self.source, element)
                        if tag in ("body", "inertial")
                        else self.defaults.of(element, tag, outer.childclass)
                    )
                    yield _Place(node, outer.frame, outer.link, outer.childclass)

    def _class(self, node: Node, outer: str) -> str:
        name = node.text("childclass") or outer
        if name not in self.defaults.classes:
            raise node.error(f"names the class {clipped(name)!r}, which no <default> defines", NameNotFoundError)
        return name

    def _add_body(self, part: _Place) -> _Place:
        node = part.node
        if node.flag("mocap", False):
            node.omit("mocap, now at rest")
        name = node.text("name") or f"body {len(self.tree.links)}"
        if name in self.links:
            raise node.error("has a name that another one has", DuplicateNameError)
        self.links[name] = len(self.tree.links)
        frame = part.frame @ self.angles.frame(node)
        self.tree.links.append(Link(name, part.link, frame, node.where, weld=f"{name} weld"))
        return _Place(node, frame, self.links[name], self._class(node, part.childclass))

    def _add_joint(self, part: _Place, tag: str) -> None:
        node = part.node
        if part.link < 0:
            raise node.error("is a joint of the world, which does not move")
        link = self.tree.links[part.link]
        kind = "free" if tag == "freejoint" else node.word("type", tuple(_KINDS), "hinge")
        name = node.text("name") or f"{link.name} joint" + (f" {len(link.hinges) + 1}" if link.hinges else "")
        if name in self.hinges:
            raise node.error("has a name that another joint has", DuplicateNameError)
        self.hinges.add(name)
        hinge = Hinge(name, _KINDS[kind], part.frame.p, np.array([0.0, 0.0, 1.0]), where=node.where)
        if kind != "free":
            hinge.at = part.frame.point(node.numbers("pos", 3, (0.0, 0.0, 0.0)))
        if kind in ("hinge", "slide"):
            axis = np.array(node.numbers("axis", 3, (0.0, 0.0, 1.0)))
            if not np.any(axis):
                raise node.error("has the axis zero")
            hinge.axis = part.frame.R @ (axis / np.abs(axis).max())
        if tag == "joint":
            self._add_forces(node, hinge, kind)
        link.hinges.append(hinge)

    def _add_forces(self, node: Node, hinge: Hinge, kind: str) -> None:
        unit = self.angles.unit if kind == "hinge" else 1.0
        hinge.k, hinge.c = self._linear(node, "stiffness"), self._linear(node, "damping")
        rest, drawn = node.number("springref", 0.0) * unit, node.number("ref", 0.0) * unit
        if kind in ("hinge", "slide"):
            hinge.preload = hinge.k * (drawn - rest)
        hinge.friction, hinge.armature = node.number("frictionloss", 0.0), node.number("armature", 0.0)
        for key in ("k", "c", "friction", "armature"):
            if getattr(hinge, key) < 0.0:
                raise node.error("has a negative coefficient")
        if "springdamper" in node and any(node.numbers("springdamper", 2)):
            raise node.error("has 'springdamper', which needs the compiled masses; give stiffness and damping")
        limited = node.text("limited", "auto")
        if "range" in node:
            given = node.numbers("range", 2)
            if limited != "false" and any(given):
                self.source.omit(f"joint {hinge.name!r}", "limit")

    def _linear(self, node: Node, key: str) -> float:
        first, *rest = node.numbers(key, range(1, 9), (0.0,))
        if any(rest):
            raise node.error(f"has a nonlinear {key}, which is not read")
        return first

    def _add_inertial(self, part: _Place) -> None:
        if part.link < 0:
            raise part.node.error("belongs to the world, which has no mass")
        if self.from_geoms == "true":
            part.node.omit("inertial, since inertiafromgeom is true")
            return
        link = self.tree.links[part.link]
        made = inertial(part.node, self.angles)
        link.inertia = made.moved(part.frame.within(link.frame))

    def _weigh(self, part: _Place) -> list[Inertia]:
        """The inertia of a geom in its body's axes, where it counts."""
        node, link = part.node, part.link
        owner = self.tree.links[link].name if link >= 0 else "world"
        name = node.text("name")
        self.source.omit(
            f"geom {name!r}" if name else f"body {owner!r}",
            "contact and picture" if name else "contact and picture of geoms",
        )
        for key, (_, element) in node.given.items():
            self.source.read.add((element, key))
        for element in node.element.iter():
            self.source.read.add((element, ""))
        group = node.number("group", 0.0)
        has_own = any(str(e.tag) == "inertial" for e in node.element.getparent())
        if link < 0 or self.from_geoms == "false" or (has_own and self.from_geoms == "auto"):
            return []
        if not self.groups[0] <= group <= self.groups[1]:
            return []
        made = geom_inertia(node, self.angles)
        return [made.moved(part.frame.within(self.tree.links[link].frame))]

    def _add_site(self, part: _Place) -> None:
        node = part.node
        name = node.text("name")
        frame = part.frame @ self.angles.frame(node)
        for key, (_, element) in node.given.items():  # size and colour are for pictures
            self.source.read.add((element, key))
        if not name:
            return
        if name in self.sites:
            raise node.error("has a name that another site has", DuplicateNameError)
        self.sites[name] = site = Site(name, part.link, frame)
        self.tree.sites.append(site)

    def link(self, node: Node, key: str) -> int:
        """The link that an attribute names; the world by default."""
        name = node.text(key) or "world"
        if name not in self.links:
            raise node.error(f"names the body {clipped(name)!r}, which does not exist", NameNotFoundError)
        return self.links[name]

    def site(self, node: Node, key: str) -> Site:
        """The site that an attribute names."""
        name = node.required(key)
        if name not in self.sites:
            raise node.error(f"names the site {clipped(name)!r}, which does not exist", NameNotFoundError)
        return self.sites[name]


register(Format(".xml", "model", "MJCF", read, None, LARGEST_XML))
