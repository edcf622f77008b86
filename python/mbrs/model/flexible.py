"""Flexible bodies of a model: the frame is a body like others, its modal coordinates and nodes come with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .bodies import Body, NodePlace, Pose, body_numbers
from .book import Field, Item, plain
from .names import GROUND, not_found, problem, shown
from .numbers import Number, numbers, vector
from .ports import Port, make_port

if TYPE_CHECKING:
    from ..flexible import ModalBody
    from .model import Model

__all__ = ["FlexibleBody", "Node", "Place", "attachments", "frame_names", "frame_of", "node_tables"]

# A point of a joint counts as a node's where it is this close to it, relative to the extent of the nodes.
_AT_NODE = 1e-9
# Numbers of a body that its shapes' integrals depend on: they are not varied alone.
_FIXED = ("com", "mass", "inertia")


class FlexibleBody(Body):
    """Handle of a flexible body; see `Model.flexible_body`."""

    __slots__ = ("modal", "shapes", "used")
    modal: ModalBody
    shapes: ShapeNumbers
    used: set[int]  # nodes that something has asked for
    kind = "flexible body"

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes."""
        return self.modal.nodes

    @property
    def n_modes(self) -> int:
        """Number of modal coordinates."""
        return self.modal.n_modes

    def node(self, name: str) -> Node:
        """The node of this name, to be given wherever a body is."""
        return Node(self, self._use(_known_node(self, name)))

    def _use(self, index: int) -> int:
        if index not in self.used:
            self.used.add(index)
            self.model.structure_version += 1
        return index

    def moves(self, index: int) -> bool:
        """Does the node move against the frame? One whose shapes vanish is the frame."""
        return bool(np.any(self.modal.node_shape[index]))

    def node_point(self, index: int) -> list[Number]:
        """World coordinates of a node as drawn, expressions where the body's place is one."""
        e = self.entries(0, 7)
        w, x, y, z = e[3:]
        s = 2.0 / (w * w + x * x + y * y + z * z)
        p = [float(v) for v in self.modal.node_position[index]]
        rows = (
            (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
            (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
            (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
        )
        return [e[i] + sum((r * v for r, v in zip(rows[i], p, strict=True) if v), 0.0) for i in range(3)]

    def node_at(self, point: Sequence[Number], where: str) -> int:
        """The node drawn at a world point."""
        given = np.array(numbers(point))
        drawn = np.array([numbers(self.node_point(i)) for i in range(len(self.nodes))]).reshape(-1, 3)
        reach = max(float(np.ptp(drawn, axis=0).max()) if len(drawn) else 0.0, float(np.abs(given).max()), 1e-300)
        distance = np.linalg.norm(drawn - given, axis=1)
        near = np.flatnonzero(distance <= _AT_NODE * reach)
        if len(near) == 0:
            known = ", ".join(
                f"{name!r} at ({', '.join(f'{v:.6g}' for v in p)})"
                for name, p in zip(self.nodes[:8], drawn, strict=False)
            )
            raise problem(
                where,
                f"is no node of the flexible body {self.name!r}, which can be held at its nodes only: "
                f"{known or 'it has none'}; give {self.name}.node(name), or that point",
            )
        return self._use(int(near[0]))

    def fields(self) -> dict[str, Field]:
        own = {name: field for name, field in super().fields().items() if name not in _FIXED}
        return {**own, **self.shapes.fields()}


class ShapeNumbers(Item):
    """The numbers of a flexible body: S, P1, P2, K, C, KG, then position and shape of each node."""

    __slots__ = ("m", "n_nodes")
    m: int
    n_nodes: int
    store = "flexible"
    kind = "flexible body"

    @property
    def size(self) -> int:
        m = self.m
        return 12 * m + 23 * m * m + self.n_nodes * (3 + 6 * m)

    def fields(self) -> dict[str, Field]:
        m = self.m
        k, c = self.start + 12 * m + 9 * m * m, self.start + 12 * m + 10 * m * m
        return {
            "K": Field(plain(k, m * m, "").slots, (m, m), ("",) * (m * m), store="flexible"),
            "C": Field(plain(c, m * m, "").slots, (m, m), ("",) * (m * m), store="flexible"),
        }

    def damping(self) -> list[float]:
        """The entries of C now."""
        return self.values(12 * self.m + 10 * self.m * self.m, self.m * self.m)

    def node_start(self, index: int) -> int:
        """Where the numbers of a node start in the store."""
        return self.start + 12 * self.m + 23 * self.m * self.m + index * (3 + 6 * self.m)


@dataclass(frozen=True)
class Node(NodePlace):
    """A node of a flexible body; it stands wherever a body may."""

    body: FlexibleBody
    index: int

    @property
    def name(self) -> str:
        """``body.node``, as results name it."""
        return f"{self.body.name}.{self.body.nodes[self.index]}"

    @property
    def at(self) -> np.ndarray:
        """World coordinates (3,) as drawn."""
        return np.array(numbers(self.body.node_point(self.index)))

    def _port(self, kind: Any, direction: Any) -> Port:
        frame = self.name if self.body.moves(self.index) else self.body.name
        point = None if self.body.moves(self.index) else tuple(self.at)
        return make_port(kind, self.name, frame, None, direction, point)

    def force(self, direction: Any) -> Port:
        """A unit force at the node along "x", "-y", ... or a vector (3,), world axes."""
        return self._port("force", direction)

    def torque(self, direction: Any) -> Port:
        """A unit torque at the node, world axes."""
        return self._port("torque", direction)

    def motion(self, direction: Any) -> Port:
        """Displacement of the node along "x", ... or its rotation about "rx", ..., world axes."""
        return self._port("motion", direction)

    def __repr__(self) -> str:
        return f"<node {self.body.nodes[self.index]!r} of {self.body.name!r}>"


@dataclass(frozen=True)
class Place:
    """What something is attached to: a body (-1 ground) and a node of it (-1 none)."""

    body: int
    node: int = -1


def attachments(
    model: Model, where: str, given: Sequence[tuple[str, Any]], at: Any, address: str
) -> tuple[list[Place], Any]:
    """Places of one or two attached bodies, and ``at`` filled in from nodes where it was left out.

    A flexible body named without a node is taken at the node where ``at`` is.
    """
    found = [_place(model, body, where, key) for key, body in given]
    if at is None:
        at = _drawn_at(model, found, address)
    return [_at_node(model, place, _point_of(at, i, address), address) for i, place in enumerate(found)], at


def _place(model: Model, body: Any, where: str, key: str) -> Place:
    if isinstance(body, Node) and body.body.model is model:
        return Place(body.body.index, body.index)
    if isinstance(body, Node):
        raise ModelError(f"{where} names {shown(body)}, which belongs to another model; use this model's own")
    if isinstance(body, str) and "." in body and body not in model.body_index:
        owner, _, node = body.partition(".")
        flexible = model.items.get(owner)
        if isinstance(flexible, FlexibleBody):
            return Place(flexible.index, flexible.node(node).index)
    return Place(model.find_body(body, where, key))


def _drawn_at(model: Model, places: Sequence[Place], address: str) -> Any:
    points = [_flexible(model, p).node_point(p.node) if p.node >= 0 else None for p in places]
    known = [p for p in points if p is not None]
    if not known:
        raise problem(address, "is missing: give the point (3,), world, where it acts")
    if len(points) == 2 and len(known) == 2 and numbers(known[0]) != numbers(known[1]):
        return (known[0], known[1])
    return known[0]


def _point_of(at: Any, side: int, address: str) -> Any:
    from .numbers import is_pair

    return at[side] if is_pair(at) else at


def _at_node(model: Model, place: Place, point: Any, address: str) -> Place:
    body = model.bodies[place.body] if place.body >= 0 else None
    if place.node >= 0 or not isinstance(body, FlexibleBody):
        return place
    return Place(place.body, body.node_at(vector(point, address), address))


def _flexible(model: Model, place: Place) -> FlexibleBody:
    body = model.bodies[place.body]
    if not isinstance(body, FlexibleBody):
        raise ModelError(f"{body.name!r} is a rigid body and has no nodes")
    return body


def add_flexible_body(
    model: Model, name: Any, modal: Any, modes: Any, nodes: Any, pose: Any, **given: Any
) -> FlexibleBody:
    """Check and add a flexible body."""
    from ..flexible import ModalBody

    body = FlexibleBody(model, model.new_name("body", name))
    if not isinstance(modal, ModalBody):
        raise problem(name, f"needs a ModalBody (mb.flexible.beam, mb.flexible.craig_bampton), got {shown(modal)}")
    for node in modal.nodes:
        if "." in node or "[" in node or "]" in node or node == GROUND:
            raise problem(
                name, f"has a node {node!r}, whose name must not contain '.', '[' or ']', which addresses use"
            )
    body.modal = _chosen(name, modal, modes)
    body.used = {_known_node(body, node) for node in ([nodes] if isinstance(nodes, str) else nodes)}
    inertia = body.modal.inertia
    body.put(body_numbers(name, mass=modal.mass, inertia=inertia, com=modal.com, **given))
    body.index = len(model.bodies)
    numbers_ = ShapeNumbers(model, name)
    numbers_.m, numbers_.n_nodes = body.n_modes, len(body.nodes)
    numbers_.put(_numbers_of(body.modal))
    body.shapes = numbers_
    if pose is not None:
        _add_guess(model, body, pose)
    model.register(body, model.bodies)
    return body


def _known_node(body: FlexibleBody, name: Any) -> int:
    if not isinstance(name, str) or name not in body.modal.nodes:
        raise not_found(f"{body.name}: no node", name if isinstance(name, str) else shown(name), body.nodes)
    return body.modal.nodes.index(name)


def _add_guess(model: Model, body: Body, pose: Any) -> None:
    from .rotations import quaternion

    if not isinstance(pose, (list, tuple)) or len(pose) != 2:
        raise problem(body.name + ".pose", "must be (origin, orientation): a point (3,) and a quaternion or matrix")
    guess = Pose(model, body.name)
    guess.body = body.index
    guess.put([*vector(pose[0], body.name + ".pose"), *quaternion(pose[1], body.name + ".pose")])
    model.poses.append(guess)


def _chosen(name: str, modal: ModalBody, modes: Any) -> ModalBody:
    """The body with some of its modes."""
    if modes is None:
        return modal
    m = modal.n_modes
    chosen = list(range(modes)) if isinstance(modes, int) and not isinstance(modes, bool) else modes
    try:
        places = [int(i) for i in chosen]
    except (TypeError, ValueError):
        places = []
    if not places or len(set(places)) != len(places) or any(not 0 <= i < m for i in places):
        raise problem(
            name + ".modes", f"must be a number of modes or their indices, of 0 to {m - 1}, got {shown(modes)}"
        )
    from dataclasses import replace

    pick = np.ix_(places, places)
    return replace(
        modal,
        S=modal.S[:, places],
        P1=modal.P1[places],
        P2=modal.P2[pick],
        K=modal.K[pick],
        C=modal.C[pick],
        KG=modal.KG[:, places][:, :, places],
        node_shape=modal.node_shape[..., places],
        line_shape=modal.line_shape[..., places],
    )


def _numbers_of(modal: ModalBody) -> list[Number]:
    parts = [modal.S, modal.P1, modal.P2, modal.K, modal.C, modal.KG]
    nodes = [np.r_[p, s.ravel()] for p, s in zip(modal.node_position, modal.node_shape, strict=True)]
    return np.concatenate([part.ravel() for part in (*parts, *nodes)]).tolist()  # type: ignore[no-any-return]


def node_tables(model: Model, base: dict[str, int]) -> dict[str, Any]:
    """The part of Tables that flexible bodies make; nothing of a model without them."""
    bodies = [b for b in model.bodies if isinstance(b, FlexibleBody)]
    if not bodies:
        return {}
    start, nodes = base["flexible"], _all_nodes(model)
    number = {place: i for i, place in enumerate(nodes)}
    tips = [place for place in nodes if _has_frame(model, place)]

    def of(items: Sequence[Any], body: str, node: str) -> np.ndarray:
        return _integers(number.get((getattr(i, body), getattr(i, node)), -1) for i in items)

    return {
        "flexible_body": _integers(b.index for b in bodies),
        "flexible_modes": _integers(b.n_modes for b in bodies),
        "flexible_x": _integers(start + b.shapes.start for b in bodies),
        "flexible_node_name": [model.bodies[b].nodes[i] for b, i in nodes],  # type: ignore[attr-defined]
        "flexible_node_body": _integers(b for b, _ in nodes),
        "flexible_node_x": _integers(start + model.bodies[b].shapes.node_start(i) for b, i in nodes),  # type: ignore[attr-defined]
        "moving_node": _integers(number[place] for place in tips),
        "joint_a_node": of(model.joints, "a", "a_node"),
        "joint_b_node": of(model.joints, "b", "b_node"),
        "element_a_node": of(model.elements, "a", "a_node"),
        "element_b_node": of(model.elements, "b", "b_node"),
        "load_node": of(model.loads, "body", "node"),
        "marker_node": of(model.markers, "body", "node"),
    }


def _integers(values: Any) -> np.ndarray:
    out = np.array(list(values), dtype=np.int64)
    out.setflags(write=False)
    return out


def _all_nodes(model: Model) -> list[tuple[int, int]]:
    bodies = [b for b in model.bodies if isinstance(b, FlexibleBody)]
    return [(b.index, i) for b in bodies for i in range(len(b.nodes))]


def _has_frame(model: Model, place: tuple[int, int]) -> bool:
    body = model.bodies[place[0]]
    return isinstance(body, FlexibleBody) and place[1] in body.used and body.moves(place[1])


def frame_names(model: Model) -> tuple[str, ...]:
    """Names of all frames of results: the bodies, then ``body.node`` of each moving node in use."""
    names = [b.name for b in model.bodies]
    for body, node in _all_nodes(model):
        if _has_frame(model, (body, node)):
            names.append(f"{names[body]}.{model.bodies[body].nodes[node]}")  # type: ignore[attr-defined]
    return tuple(names)


def frame_of(model: Model, body: int, node: int) -> int:
    """Index of the frame that moves with a place."""
    if node < 0 or not _has_frame(model, (body, node)):
        return body
    tips = [place for place in _all_nodes(model) if _has_frame(model, place)]
    return len(model.bodies) + tips.index((body, node))


def modal_places(tables: Mapping[str, Any], n_bodies: int) -> list[tuple[int, int, int, int]]:
    """Of each flexible body: its number, the number of its modes, the row of a state where its coordinates start (three in
    each row, columns 0..2), and its first place among all modal coordinates.
    """
    out, row, first = [], n_bodies, 0
    for body, m in zip(tables.get("flexible_body", ()), tables.get("flexible_modes", ()), strict=True):
        out.append((int(body), int(m), row, first))
        row, first = row + (int(m) + 2) // 3, first + int(m)
    return out


def mass_matrix_at(tables: Mapping[str, Any], which: int, q: np.ndarray) -> np.ndarray:
    """(6 + m, 6 + m) mass matrix of a flexible body at q, about its origin, body axes (docs/tables.md)."""
    x, m, at = tables["x"], int(tables["flexible_modes"][which]), int(tables["flexible_x"][which])
    body = tables["x"][int(tables["body_x"][int(tables["flexible_body"][which])]) :]
    com, mass = body[7:10], body[10]
    xx, yy, zz, xy, xz, yz = body[11:17]
    S, P1 = x[at : at + 3 * m].reshape(3, m), x[at + 3 * m : at + 12 * m].reshape(m, 3, 3)
    P2 = x[at + 12 * m : at + 12 * m + 9 * m * m].reshape(m, m, 3, 3)
    KG = x[at + 12 * m + 11 * m * m : at + 12 * m + 23 * m * m].reshape(12, m, m)
    S2, P12 = KG[:3], KG[3:].reshape(3, 3, m, m).transpose(2, 3, 1, 0)
    h = mass * com + S @ q + 0.5 * S2 @ q @ q
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + mass * (com @ com * np.eye(3) - np.outer(com, com))
    linear = np.einsum("kij,k->ij", P1, q) + 0.5 * np.einsum("klij,k,l->ij", P12, q, q)
    N = linear + linear.T + np.einsum("klij,k,l->ij", P2, q, q)
    J = J + np.trace(N) * np.eye(3) - N
    Q = P1 + np.einsum("lkij,l->kij", P2, q) + np.einsum("klij,l->kij", P12, q)
    H = np.array([[0.0, -h[2], h[1]], [h[2], 0.0, -h[0]], [-h[1], h[0], 0.0]])
    turning = np.array([[p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]] for p in Q])
    moving = (S + np.einsum("ikl,l->ik", S2, q)).T
    out = np.zeros((6 + m, 6 + m))
    out[:3, :3], out[:3, 3:6], out[3:6, 3:6] = mass * np.eye(3), -H, J
    out[6:, :3], out[6:, 3:6] = moving, turning
    out[3:6, :3], out[:3, 6:], out[3:6, 6:] = H, moving.T, turning.T
    out[6:, 6:] = np.trace(P2, axis1=2, axis2=3)
    return out
