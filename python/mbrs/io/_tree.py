"""The common part of robot formats: a tree of links with several joints on each, made into a model with one joint between two bodies.

A link without mass does not become a body: welded to another it becomes a marker there; moving, it takes the mass of what is welded to it,
or its joints go to its only successor (two hinges become a universal joint, ...).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InertiaError, MbrsError, ModelError
from ..model.laws import CoulombTanh
from ..model.model import Model
from ..model.shapes import Shape
from ._composites import Composite, Hinge, compose
from ._pictures import Picture
from ._poses import Array, Frame, Inertia
from ._xml import Source, clipped

# rad/s or m/s; the rate at which 76 % of a dry friction acts, tanh(rate / this). Too small: steps of integrators become tiny. Too
# large: joints that should stick creep. Pinned by tests/io/test_urdf.py.
FRICTION_RATE = 1e-3


@dataclass
class Link:
    """A rigid part: where it is drawn, what carries it (-1: ground), its joints from there on (none: welded), its mass."""

    name: str
    parent: int
    frame: Frame
    where: str
    hinges: list[Hinge] = field(default_factory=list)
    inertia: Inertia = field(default_factory=Inertia)
    weld: str = ""  # name of the joint that welds it
    # what else stays with it: must it exist, because something names it?
    named: bool = False


@dataclass
class Coupling:
    """e_second = ratio e_first + offset of two joints of the file."""

    name: str
    first: str
    second: str
    ratio: float
    offset: float
    where: str = ""


@dataclass
class Site:
    """A named frame on a link."""

    name: str
    link: int
    frame: Frame


@dataclass
class Tree:
    """All that a file says about rigid parts."""

    links: list[Link] = field(default_factory=list)
    sites: list[Site] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)


class Names:
    """Names that a model allows, for objects whose names may collide in the file."""

    def __init__(self, model: Model, source: Source) -> None:
        self.model, self.source = model, source

    def new(self, kind: str, wanted: str) -> str:
        """``wanted``, or the nearest name that is free; a change is noted."""
        base = "".join("_" if ch in ".[]" else ch for ch in wanted) or kind
        made, n = base, 1
        while made in self.model or made in ("ground", "gravity"):
            made = f"{base} {kind}" if n == 1 else f"{base} {kind} {n}"
            n += 1
        if made != wanted:
            self.source.omit(f"{kind} {wanted!r}", f"name, now {clipped(made)!r}")
        return made


class Builder:
    """Makes a model of a tree; afterwards `body` and `place` tell where links and joints went."""

    def __init__(self, model: Model, tree: Tree, source: Source) -> None:
        self.model, self.tree, self.source = model, tree, source
        self.names = Names(model, source)
        self.home: list[int] = list(range(len(tree.links)))  # the link that a link became part of; -1: ground
        self._bodies: dict[int, Any] = {-1: model.ground}
        self._places: dict[str, tuple[str, str | None, float]] = {}

    def body(self, link: int) -> Any:
        """The handle of the body that a link is, or is part of."""
        while link >= 0 and self.home[link] != link:
            link = self.home[link]
        return self._bodies[link]

    def place(self, hinge: str, where: str) -> tuple[str, str | None, float]:
        """The place of the coordinate of a joint of the file: joint of the model, coordinate, sign."""
        if hinge not in self._places:
            raise ModelError(f"{where}: there is no joint {clipped(hinge)!r} with one coordinate")
        return self._places[hinge]

    def build(self) -> None:
        """Bodies, joints, markers and couplers."""
        links = self.tree.links
        self._merge_welded()
        for i in range(len(links)):
            self._check_moving(i)
        for i, link in enumerate(links):
            if self.home[i] == i:
                self.guarded(link.where, lambda i=i: self._add_body(i))  # type: ignore[misc]
        for i, link in enumerate(links):
            if self.home[i] == i:
                self.guarded(link.where, lambda i=i: self._add_joint(i))  # type: ignore[misc]
            else:
                self._add_marker(link.name, i, link.frame)
        for site in self.tree.sites:
            self._add_marker(site.name, site.link, site.frame)
        for coupling in self.tree.couplings:
            self.guarded(coupling.where, lambda c=coupling: self._add_coupler(c))  # type: ignore[misc]

    def guarded(self, where: str, action: Callable[[], Any]) -> Any:
        """An error of the model says where in the file its cause is."""
        try:
            return action()
        except MbrsError as reason:
            if str(reason).startswith(where):
                raise
            raise type(reason)(f"{where}: {reason}") from None

    def _merge_welded(self) -> None:
        links = self.tree.links
        for i, link in enumerate(links):  # parents come first
            if link.hinges or link.inertia.mass > 0.0:
                continue
            self.home[i] = link.parent if link.parent < 0 else self._root(link.parent)
        for i in reversed(range(len(links))):
            link = links[i]
            parent = self._root(link.parent)
            if self.home[i] != i or link.hinges or parent < 0 or links[parent].inertia.mass > 0.0:
                continue
            # a link without mass that moves takes what is welded to it
            held = links[parent]
            local = link.frame.within(held.frame)
            held.inertia = held.inertia + link.inertia.moved(local)
            self.home[i] = parent

    def _root(self, link: int) -> int:
        while link >= 0 and self.home[link] != link:
            link = self.home[link]
        return link

    def _check_moving(self, i: int) -> None:
        """A moving link without mass passes its joints on to its only successor."""
        links = self.tree.links
        link = links[i]
        if self.home[i] != i or link.inertia.mass > 0.0:
            return
        # links that became part of it and need a marker there; those with joints have passed them on
        parts = [j for j in range(len(links)) if j != i and self._root(j) == i and not links[j].hinges]
        after = [j for j in range(len(links)) if self.home[j] == j and j != i and self._root(links[j].parent) == i]
        held = link.named or parts or any(self._root(s.link) == i for s in self.tree.sites)
        if len(after) != 1 or held or not links[after[0]].hinges:
            raise InertiaError(
                f"{link.where} moves and has no mass: give it its small mass and inertia"
                + ("" if after else ", or weld it to what carries it")
            )
        links[after[0]].hinges[:0] = link.hinges
        links[after[0]].parent = link.parent
        self.home[i] = after[0]
        self.source.omit(f"link {link.name!r}", "massless link between two joints")

    def _add_body(self, i: int) -> None:
        link = self.tree.links[i]
        given = link.inertia
        self._bodies[i] = self.model.body(
            self.names.new("link", link.name),
            mass=given.mass,
            inertia=given.symmetric,
            at=link.frame.p,
            com=given.com if np.any(given.com) else None,
            orientation=None if np.array_equal(link.frame.R, np.eye(3)) else link.frame.R,
            shape=self._pictures.get(i),
        )

    @cached_property
    def _pictures(self) -> dict[int, list[Shape]]:
        """The shapes of each link, with those of what is welded to it; ground has none."""
        found: dict[int, list[Shape]] = {}
        for one in self.tree.pictures:
            home = self._root(one.link)
            if home >= 0:
                found.setdefault(home, []).extend(one.shapes(self.tree.links[home].frame))
            elif self.tree.links[one.link].name:
                self.source.omit(f"link {self.tree.links[one.link].name!r}", "picture of ground")
        return found

    def _add_joint(self, i: int) -> None:
        link = self.tree.links[i]
        a, b = self.body(link.parent), self.body(i)
        if not link.hinges:
            self.model.fixed(self.names.new("joint", link.weld or f"{link.name} weld"), a, b, at=link.frame.p)
            return
        made = compose(link.hinges, self._size(link), link.where)
        for note in made.notes:
            self.source.omit(f"link {link.name!r}", note)
        name = self.names.new("joint", made.name)
        joint = getattr(self.model, made.kind)(name, a, b, at=made.at, **made.frame, **_forces(made))
        for hinge, coordinate, sign in made.places:
            named = coordinate if len(joint.table.coordinates) > 1 else None
            self._places[hinge.name] = (name, named, sign)
            if hinge.armature:
                self._add_rotor(hinge, name, named)

    def _size(self, link: Link) -> float:
        """Against which two points are the same one."""
        points = [h.at for h in link.hinges] + [link.frame.p, link.frame.point(link.inertia.com)]
        origin = self.tree.links[link.parent].frame.p if link.parent >= 0 else np.zeros(3)
        return float(max(np.linalg.norm(p - origin) for p in points))

    def _add_rotor(self, hinge: Hinge, joint: str, coordinate: str | None) -> None:
        """Inertia that a joint's motor adds, a/2 q'^2: a body that only the joint moves, on ground, where nothing else turns it."""
        if hinge.kind not in ("revolute", "prismatic"):
            self.source.omit(f"joint {hinge.name!r}", "armature")
            return
        turning = hinge.kind == "revolute"
        size = hinge.armature
        name = self.names.new("body", f"{hinge.name} rotor")
        # the weight of a sliding mass must do no work
        axis: Any = hinge.axis if turning else _level(self.model.gravity)
        moment = (size, size, size) if turning else (0.0, 0.0, 0.0)
        rotor = self.model.body(name, mass=1.0 if turning else size, inertia=moment, at=hinge.at)
        bearing = self.names.new("joint", f"{hinge.name} bearing")
        getattr(self.model, hinge.kind)(bearing, self.model.ground, rotor, at=hinge.at, axis=axis)
        self.model.coupler(
            self.names.new("coupler", f"{hinge.name} gear"), joint, bearing, 1.0, first_coordinate=coordinate
        )
        self.source.omit(f"joint {hinge.name!r}", "armature, now a body on ground that is coupled to the joint")

    def _add_marker(self, name: str, link: int, frame: Frame) -> None:
        moved = self._root(link)
        if not name:
            return
        if link >= 0 and self.tree.links[link].hinges and moved != link:
            return  # a massless link between two joints, noted already
        self.model.marker(self.names.new("marker", name), self.body(link), at=frame.p, orientation=frame.R)

    def _add_coupler(self, coupling: Coupling) -> None:
        (a, ca, sa), (b, cb, sb) = (self.place(n, coupling.where) for n in (coupling.first, coupling.second))
        self.model.coupler(
            self.names.new("coupler", coupling.name), a, b, coupling.ratio * sa * sb,
            first_coordinate=ca, second_coordinate=cb, offset=coupling.offset * sb,
        )  # fmt: skip


def _level(gravity: Any) -> Array:
    """A direction in which weight does no work."""
    g = np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float)
    return np.cross(g, np.eye(3)[int(np.argmin(np.abs(g)))]) if np.any(g) else np.array([1.0, 0.0, 0.0])


def _forces(made: Composite) -> dict[str, Any]:
    """Springs, dampers and friction of the free coordinates, where there are any."""
    given: dict[str, Any] = {}
    for key, values in (("k", made.k), ("c", made.c), ("preload", made.preload)):
        if np.any(values):
            given[key] = [float(v) for v in values]
    laws = {name: CoulombTanh(f, FRICTION_RATE) for name, f in made.friction.items() if f}
    return {**given, "law": laws} if laws else given


def omit_friction(source: Source, hinges: Sequence[Hinge]) -> None:
    """Note joints whose dry friction is regularised."""
    for hinge in hinges:
        if hinge.friction:
            source.omit(f"joint {hinge.name!r}", f"friction, now smooth: F tanh(rate / {FRICTION_RATE:g})")
