"""Spanning tree, cut joints and coordinate names, by the rule of docs/tables.md."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from .reader import Body, Link, Marker
from .rows import FREE, Row, coordinate_name

ALWAYS_CUT = ("distance", "knife_edge", "rolling_disc", "point_on_line")
NEVER_CANDIDATE = ("free", *ALWAYS_CUT)


@dataclass
class TreeJoint:
    """A joint of the spanning tree: moves body ``outer`` relative to ``inner``; sign -1 where b is the inner body."""

    link: Link
    inner: int
    outer: int
    sign: int
    start: int

    @property
    def markers(self) -> tuple[Marker, Marker]:
        """On the inner body and on the outer one."""
        return (self.link.a, self.link.b) if self.sign > 0 else (self.link.b, self.link.a)

    @property
    def coordinates(self) -> list[Row]:
        return FREE[self.link.kind]

    @property
    def translations(self) -> list[int]:
        """Axes of the inner marker along which the outer one is free."""
        return [row[1] for row in self.coordinates if row[0] == "u"]

    @property
    def turns_freely(self) -> bool:
        """True where three rotations act together."""
        return self.link.kind in ("spherical", "free")

    @property
    def stop(self) -> int:
        return self.start + len(self.coordinates)

    @property
    def names(self) -> list[str]:
        if len(self.coordinates) == 1:
            return [self.link.name]
        return [f"{self.link.name}.{coordinate_name(self.link.kind, row)}" for row in self.coordinates]


def implicit_free_joint(body: int, b: Body) -> Link:
    """An unattached body hangs on ground by six free coordinates, named after the body."""
    zero = np.zeros((6, 6))
    ground = Marker(-1, b.centre, np.eye(3))
    return Link(b.name, "free", ground, Marker(body, np.zeros(3), b.R.T), zero, zero, np.zeros(6))


class _Growth:
    """The tree while it grows from ground."""

    def __init__(
        self, bodies: list[Body], joints: list[Link], modal: Mapping[int, Link], carriers: Collection[int]
    ) -> None:
        self.bodies, self.joints, self.modal = bodies, joints, modal
        self.reached, self.tree = {-1, *carriers}, list[TreeJoint]()
        self.queue, self.used, self.ny = deque([-1]), set[int](), 0

    def attach(self, link: Link, inner: int) -> None:
        a_is_inner = link.a.body == inner
        outer = link.b.body if a_is_inner else link.a.body
        self.tree.append(TreeJoint(link, inner, outer, 1 if a_is_inner else -1, self.ny))
        self.ny = self.tree[-1].stop
        self.reached.add(outer)
        self.queue.append(outer)
        self.follow(outer)

    def follow(self, reached: int) -> None:
        """The frame and the nodes of a flexible body go together."""
        frame = self.modal[reached].a.body if reached in self.modal else reached
        if frame not in self.reached:
            self.attach(self.modal[reached], reached)  # the frame then brings the other nodes
            return
        for node, link in self.modal.items():
            if link.a.body == frame and node not in self.reached:
                self.attach(link, frame)

    def spread(self) -> None:
        while self.queue:
            node = self.queue.popleft()
            for i, link in enumerate(self.joints):
                ends = (link.a.body, link.b.body)
                if link.kind in NEVER_CANDIDATE or node not in ends or self.reached.issuperset(ends):
                    continue
                self.used.add(i)
                self.attach(link, node)

    def bridge(self) -> None:
        for i, link in enumerate(self.joints):
            ends = (link.a.body, link.b.body)
            if link.kind == "free" and len(self.reached.intersection(ends)) == 1:
                self.used.add(i)
                self.attach(link, ends[0] if ends[0] in self.reached else ends[1])
                return
        body = min(set(range(len(self.bodies))) - self.reached)
        self.attach(implicit_free_joint(body, self.bodies[body]), -1)


def spanning_tree(
    bodies: list[Body], joints: list[Link], modal: Mapping[int, Link] | None = None, carriers: Collection[int] = ()
) -> tuple[list[TreeJoint], list[Link]]:
    """Tree joints in the order bodies are reached, and the cut ones in order of definition.

    ``modal``: for every frame of a node the link with its flexible body; ``carriers``: frames that no joint moves.
    """
    growth = _Growth(bodies, joints, modal or {}, carriers)
    growth.spread()
    while len(growth.reached) <= len(bodies):
        growth.bridge()
        growth.spread()
    cut = [link for i, link in enumerate(joints) if i not in growth.used and link.kind != "free"]
    return growth.tree, cut
