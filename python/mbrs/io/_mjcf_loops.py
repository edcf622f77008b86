"""Equality constraints of MJCF as joints and couplers, tendons between two sites as springs. ``reader`` is that of `mbrs.io.mjcf`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix
from ..errors import NameNotFoundError
from ._poses import Frame
from ._tree import Builder, Coupling
from ._xml import Node, clipped

# How far a <weld> may ask bodies from where they are drawn, in m and rad: hand-typed poses of seven digits pass. Pinned by
# tests/io/test_mjcf.py.
_AS_DRAWN = 1e-6
_SOFTNESS = ("solref", "solimp", "torquescale")


def add_equalities(reader: Any, builder: Builder, nodes: Sequence[Node]) -> None:
    """Couplings into the tree; what needs bodies waits in ``reader.after``."""
    for i, given in enumerate(nodes):
        if given.tag not in ("connect", "weld", "joint"):
            reader.source.read.discard((given.element, ""))  # the ledger names it
            continue
        node = reader.defaults.of(given.element, "equality", "main")
        name = node.text("name") or f"{node.tag} {i + 1}"
        if not node.flag("active", True):
            reader.source.omit(f"equality {name!r}", "constraint that is not active")
            for key in node.given:
                node.text(key)
            continue
        if any(key in node for key in _SOFTNESS):
            for key in _SOFTNESS:
                node.text(key)
            reader.source.omit(f"equality {name!r}", "softness, now exact")
        _EQUALITIES[node.tag](reader, builder, node, name)


def _connect(reader: Any, builder: Builder, node: Node, name: str) -> None:
    def act() -> None:
        if "site1" in node:
            one, two = reader.site(node, "site1"), reader.site(node, "site2")
            _join(builder, "spherical", node, name, (one.link, two.link), (one.frame.p, two.frame.p))
        else:
            links = reader.link(node, "body1"), reader.link(node, "body2")
            at = _frame(reader, links[0]).point(node.numbers("anchor", 3))
            _join(builder, "spherical", node, name, links, (at, at))

    reader.after.append(act)
    _hold(reader, node)


def _weld(reader: Any, builder: Builder, node: Node, name: str) -> None:
    def act() -> None:
        if "site1" in node:
            one, two = reader.site(node, "site1"), reader.site(node, "site2")
            _check_drawn(node, one.frame.within(two.frame))
            _join(builder, "fixed", node, name, (one.link, two.link), (one.frame.p, two.frame.p))
            return
        links = reader.link(node, "body1"), reader.link(node, "body2")
        first, second = _frame(reader, links[0]), _frame(reader, links[1])
        relative = node.numbers("relpose", 7, (0.0,) * 7)
        if any(relative[3:]):
            wanted = Frame(quaternion_matrix(relative[3:]), np.array(relative[:3]))
            _check_drawn(node, second.within(first @ wanted))
        node.text("anchor")
        _join(builder, "fixed", node, name, links, (second.p, second.p))

    reader.after.append(act)
    _hold(reader, node)


def _hold(reader: Any, node: Node) -> None:
    """Links that a constraint names stay bodies or become parts of one, and never pass their joints on."""
    for key in ("body1", "body2"):
        if key in node:
            link = reader.link(node, key)
            if link >= 0:
                reader.tree.links[link].named = True
    for key in ("site1", "site2"):
        if key in node:
            link = reader.site(node, key).link
            if link >= 0:
                reader.tree.links[link].named = True


def _frame(reader: Any, link: int) -> Frame:
    return reader.tree.links[link].frame if link >= 0 else Frame()


def _check_drawn(node: Node, relative: Frame) -> None:
    gap = max(float(np.abs(relative.p).max()), float(np.abs(relative.R - np.eye(3)).max()))
    if gap > _AS_DRAWN:
        raise node.error(
            f"holds its bodies away from where they are drawn (by {gap:.3g}); a fixed joint holds them as drawn"
        )


def _join(builder: Builder, kind: str, node: Node, name: str, links: tuple[int, int], at: tuple[Any, Any]) -> None:
    a, b = builder.body(links[0]), builder.body(links[1])
    if a is b:
        raise node.error("holds a body to itself")
    points = at[0] if np.array_equal(at[0], at[1]) else at
    made: Callable[..., Any] = getattr(builder.model, kind)
    builder.guarded(node.where, lambda: made(builder.names.new("equality", name), a, b, at=points))


def _joint(reader: Any, builder: Builder, node: Node, name: str) -> None:
    joints = [node.required("joint1")] + ([node.required("joint2")] if "joint2" in node else [])
    for joint in joints:
        if joint not in reader.hinges:
            raise node.error(f"names the joint {clipped(joint)!r}, which does not exist", NameNotFoundError)
    offset, ratio, *higher = node.numbers("polycoef", 5, (0.0, 1.0, 0.0, 0.0, 0.0))
    if len(joints) == 2 and any(higher):
        raise node.error("couples its joints by a curve; only polycoef = a0 a1 0 0 0 is read")
    if len(joints) == 2:
        builder.tree.couplings.append(Coupling(name, joints[1], joints[0], ratio, offset, node.where))
        return

    def hold() -> None:
        joint, coordinate, sign = builder.place(joints[0], node.where)
        builder.model.drive(builder.names.new("drive", name), joint, offset * sign, coordinate)

    reader.after.append(lambda: builder.guarded(node.where, hold))


_EQUALITIES: dict[str, Callable[[Any, Builder, Node, str], None]] = {
    "connect": _connect,
    "weld": _weld,
    "joint": _joint,
}


def add_tendons(reader: Any, builder: Builder, nodes: Sequence[Node]) -> None:
    """Springs and dampers between two sites; tendons around more are named by the ledger."""
    for i, given in enumerate(nodes):
        node = reader.defaults.of(given.element, "tendon", "main")
        name = node.text("name") or f"tendon {i + 1}"
        sites = list(node.children())
        if len(sites) != 2 or any(s.tag != "site" for s in sites):
            reader.source.omit(f"tendon {name!r}", "path around more than two sites")
            continue
        one, two = (reader.site(s, "site") for s in sites)
        k, c = node.number("stiffness", 0.0), node.number("damping", 0.0)
        given_length = node.numbers("springlength", (1, 2), (-1.0,))
        if given_length[0] != given_length[-1]:
            reader.source.omit(f"tendon {name!r}", "spring with a range of lengths without force")
            continue
        if k == 0.0 and c == 0.0:
            reader.source.omit(f"tendon {name!r}", "tendon without spring and damper")
            continue
        options: dict[str, Any] = {} if given_length[0] < 0.0 else {"length": given_length[0]}
        a, b = builder.body(one.link), builder.body(two.link)
        at = (one.frame.p, two.frame.p)
        builder.guarded(
            node.where,
            lambda n=name, a=a, b=b, at=at, k=k, c=c, o=options: builder.model.spring_damper(  # type: ignore[misc]
                builder.names.new("tendon", n), a, b, at=at, k=k, c=c, **o
            ),
        )
