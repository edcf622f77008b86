"""Flexible bodies of a model: the frame is a body like others, its modal coordinates and nodes come with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import UNFIT
from .aliases import Axis, PoseLike, Rotation, Vector3
from .argument_checks import pack
from .bodies import Body, enter, first_guess
from .book import Attachable, Book, Group, Item
from .names import GROUND, not_found, problem, shown
from .numbers import Number, numbers
from .ports import Port, make_port
from .schema import BODY, FIXED_BY_SHAPES, NODE, QUADRATIC, SHAPES, Kind
from .shapes import ShapeLike

if TYPE_CHECKING:
    from ..flexible import ModalBody

# A point of a joint counts as a node's where it is this close to it, relative to the extent of the nodes: rounding of a point that
# was typed or computed. Larger: a point beside the node is moved to it in silence. Pinned by the tests of nodes named by a point.
_AT_NODE = 1e-9


class FlexibleBody(Body):
    """Handle of a flexible body; see `Model.flexible_body`."""

    __slots__ = ("integrals", "modal", "used")
    modal: ModalBody
    integrals: ShapeNumbers
    used: set[int]  # nodes that something has asked for
    kind = "flexible body"
    modes_and_nodes = True

    @property
    def nodes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the nodes."""
        return self.modal.nodes

    @property
    def n_modes(self) -> int:
        """Number of modal coordinates."""
        return self.modal.n_modes

    def node(self, name: str) -> Node:
        """The node of this name, to be given wherever a body is."""
        return Node(self, self.use(_known_node(self, name)))

    def use(self, index: int) -> int:
        if index not in self.used:
            self.used.add(index)
            self.model.structure_version += 1
        return index

    def add_nodes(
        self, names: Sequence[str], position: np.ndarray, shape: np.ndarray, quadratic: np.ndarray
    ) -> list[int]:
        """Take further nodes (n, 3) m with shapes (n, 6, m) and second-order displacements (n, 3, m, m), and use them; their indices.

        Those that exist already must be the same.
        """
        from dataclasses import replace

        modal = self.modal
        new = [i for i, name in enumerate(names) if name not in modal.nodes]
        for i, name in enumerate(names):
            if i not in new and not np.array_equal(modal.node_position[modal.nodes.index(name)], position[i]):
                raise problem(self.name, f"has a node {shown(name)} at another place; rename one of them")
        if new:
            self.modal = replace(
                modal,
                nodes=(*modal.nodes, *(names[i] for i in new)),
                node_position=np.concatenate([modal.node_position, position[new]]),
                node_shape=np.concatenate([modal.node_shape, shape[new]]),
                node_quadratic=np.concatenate([modal.node_quadratic, quadratic[new]]),
            )
            added = _node_numbers((position[new], shape[new], quadratic[new]), self.integrals.quadratic)
            self.integrals.grow(added, len(new))
        return [self.use(self.modal.nodes.index(name)) for name in names]

    def refine(self) -> None:
        """Take the finer body of the same nodes (`ModalBody.finer`) in place of its own."""
        finer = self.modal.finer()
        if finer.nodes != self.nodes:
            raise problem(self.name, "has nodes that blades or section loads gave it, which a finer body does not have")
        if "K" not in self.modal.driven and self.integrals.values("K") != self.modal.K.ravel().tolist():
            raise problem(
                self.name, "has a stiffness that was changed after it was built, which a finer body does not have"
            )
        self.modal = finer
        self.integrals = _integrals(self)
        self.model.changed_structure()

    def moving(self) -> list[int]:
        """Nodes with a frame of their own: those in use that move against the body's."""
        return [i for i in sorted(self.used) if self.moves(i)]

    def moves(self, index: int) -> bool:
        """Does the node move against the frame? One whose shapes vanish is the frame."""
        return bool(np.any(self.modal.node_shape[index]))

    def node_point(self, index: int) -> list[Number]:
        """World coordinates of a node as drawn, expressions where the body's place is one."""
        e, (w, x, y, z) = self.entries("at"), self.entries("orientation")
        s = 2.0 / (w * w + x * x + y * y + z * z)
        p = self.integrals.entries_of_node(index)
        rows = (
            (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
            (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
            (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
        )
        return [e[i] + sum((r * v for r, v in zip(rows[i], p, strict=True) if not _is_zero(v)), 0.0) for i in range(3)]

    def node_at(self, point: Sequence[Number], where: str) -> int:
        """The node drawn at a world point."""
        given = np.array(numbers(point))
        drawn = np.array([numbers(self.node_point(i)) for i in range(len(self.nodes))]).reshape(-1, 3)
        reach = max(float(np.ptp(drawn, axis=0).max()) if len(drawn) else 0.0, float(np.abs(given).max()), 1e-300)
        distance = np.linalg.norm(drawn - given, axis=1)
        near = np.flatnonzero(distance <= _AT_NODE * reach)
        if len(near) == 0:
            known = ", ".join(
                f"{shown(name)} at ({', '.join(f'{v:.6g}' for v in p)})"
                for name, p in zip(self.nodes[:8], drawn, strict=False)
            )
            raise problem(
                where,
                f"is not a node of the flexible body {shown(self.name)}, which can be held at its nodes only: "
                f"{known or 'it has none'}; give {self.name}.node(name), or that point",
            )
        return self.use(int(near[0]))

    def fields(self) -> dict[str, Group]:
        own = {name: field for name, field in super().fields().items() if name not in FIXED_BY_SHAPES}
        return {**own, **self.integrals.fields()}


class ShapeNumbers(Item):
    """The numbers of a flexible body: S, P1, P2, K, C, KG, then of each node its position, its shape and, where the body has any, its
    second-order displacements.
    """

    __slots__ = ("m", "n_nodes", "quadratic")
    m: int
    n_nodes: int
    quadratic: bool
    store = "flexible"
    kind = "flexible body"

    @property
    def table(self) -> Kind:
        return SHAPES

    @property
    def size(self) -> int:
        return SHAPES.block.size(self.m) + self.n_nodes * self._node_size

    def _range(self, name: str) -> tuple[int, int]:
        if not name:
            return self.start, self.size
        part = SHAPES.block.slice(name, self.m)
        return self.start + part.start, part.stop - part.start

    @property
    def _node_size(self) -> int:
        return NODE.size(self.m) + self.quadratic * QUADRATIC.size(self.m)

    def grow(self, numbers: list[float], nodes: int) -> None:
        """Take the numbers of further nodes, behind those that are there; the others of the store move on."""
        store, end = self.model.stores[self.store], self.start + self.size
        store.x[end:end] = type(store.x)("d", numbers)
        store.driven = {place + len(numbers) * (place >= end): entry for place, entry in store.driven.items()}
        self.n_nodes += nodes
        for body in self.model.bodies:
            other = getattr(body, "integrals", None)
            if other is not None and other is not self and other.start >= end:
                other.start += len(numbers)
        self.model.changed_structure()

    def check(self, values: Sequence[float]) -> None:
        """`ModalBody` has checked them."""

    def fields(self) -> dict[str, Group]:
        out = {}
        for field in SHAPES.block:
            if field.listed == "always":
                start, n = self._range(field.name)
                slots = tuple((start + i,) for i in range(n))
                out[field.name] = Group(slots, (self.m, self.m), ("",) * n, store="flexible", checked=False)
        return out

    def entries_of_node(self, index: int) -> list[Number]:
        """Place (3,) of a node from the body's origin, body axes, numbers or the expressions that drive them."""
        start = self.node_start(index) + NODE.slice("position", self.m).start
        return self.model.stores[self.store].entries(start, 3)

    def node_start(self, index: int) -> int:
        """Index in the store of the first number of a node."""
        return self.start + SHAPES.block.size(self.m) + index * self._node_size

    def quadratic_start(self, index: int) -> int:
        """Index in the store of its second-order displacements, -1 without any."""
        return self.node_start(index) + NODE.size(self.m) if self.quadratic else -1


@dataclass(frozen=True)
class Node(Attachable):
    """A node of a flexible body; it may be given in place of a body."""

    body: FlexibleBody
    index: int

    def place_now(self) -> tuple[Book, int, int]:
        return self.body.model, self.body.index, self.index

    @property
    def name(self) -> str:
        """``body.node``, as results name it."""
        return f"{self.body.name}.{self.body.nodes[self.index]}"

    @property
    def at(self) -> np.ndarray:
        """World coordinates (3,) as drawn; expressions where the node follows parameters, so that what is drawn at it follows too."""
        point = self.body.node_point(self.index)
        return np.array(point, dtype=float if all(isinstance(v, float) for v in point) else object)

    def _port(self, kind: Any, direction: Axis) -> Port:
        frame = self.name if self.body.moves(self.index) else self.body.name
        point = None if self.body.moves(self.index) else tuple(numbers(self.body.node_point(self.index)))
        return make_port(kind, self.name, frame, None, direction, point)

    def force(self, direction: Axis) -> Port:
        """A unit force at the node along "x", "-y", ... or a vector (3,), world axes."""
        return self._port("force", direction)

    def torque(self, direction: Axis) -> Port:
        """A unit torque at the node, world axes."""
        return self._port("torque", direction)

    def motion(self, direction: Axis) -> Port:
        """Displacement of the node along "x", ... or its rotation about "rx", ..., world axes."""
        return self._port("motion", direction)

    def __repr__(self) -> str:
        return f"<node {self.body.nodes[self.index]!r} of {self.body.name!r}>"


def _known_node(body: FlexibleBody, name: Any) -> int:
    if not isinstance(name, str) or name not in body.modal.nodes:
        raise not_found(f"{body.name}: no node", name if isinstance(name, str) else shown(name), body.nodes)
    return body.modal.nodes.index(name)


def _chosen(name: str, modal: ModalBody, modes: Any) -> ModalBody:
    """The body with some of its modes."""
    if modes is None:
        return modal
    m = modal.n_modes
    chosen = list(range(modes)) if isinstance(modes, int) and not isinstance(modes, bool) else modes
    try:
        places = [int(i) for i in chosen]
    except UNFIT:
        places = []
    if not places or len(set(places)) != len(places) or any(not 0 <= i < m for i in places):
        raise problem(
            name + ".modes", f"must be a number of modes or their indices, of 0 to {m - 1}, got {shown(modes)}"
        )
    from dataclasses import replace

    pick = np.ix_(places, places)

    def cut_pairs(a: np.ndarray) -> np.ndarray:
        return a[..., places, :][..., places]

    cut: dict[str, Any] = {
        "S": lambda a: a[:, places],
        "P1": lambda a: a[places],
        **dict.fromkeys(("P2", "K", "C"), lambda a: a[pick]),
        "KG": cut_pairs,
    }
    several = cut | {"node_shape": lambda a: a[..., places], "node_quadratic": cut_pairs}
    return replace(
        modal,
        **{part: some(getattr(modal, part)) for part, some in cut.items()},
        driven={part: several.get(part, _as_it_is)(a) for part, a in modal.driven.items()},
        node_shape=modal.node_shape[..., places],
        line_shape=modal.line_shape[..., places],
        node_quadratic=cut_pairs(modal.node_quadratic),
        line_quadratic=cut_pairs(modal.line_quadratic),
    )


def _integrals(body: FlexibleBody) -> ShapeNumbers:
    """The numbers of its modal body, taken into the model."""
    made = ShapeNumbers(body.model, body.name)
    made.m, made.n_nodes = body.n_modes, len(body.nodes)
    made.quadratic = _is_quadratic(body.modal)
    made.put(_numbers_of(body.modal))
    return made


def _is_zero(v: Number) -> bool:
    return isinstance(v, float) and v == 0.0


def _as_it_is(a: Any) -> Any:
    return a


def _numbers_of(modal: ModalBody) -> list[Number]:
    parts = [modal.driven.get(name, getattr(modal, name)) for name in ("S", "P1", "P2", "K", "C", "KG")]
    of_nodes = [f"node_{part}" for part in ("position", "shape", "quadratic")]
    nodes = _node_numbers([modal.driven.get(name, getattr(modal, name)) for name in of_nodes], _is_quadratic(modal))
    return [*np.concatenate([part.ravel() for part in parts]).tolist(), *nodes]


def _is_quadratic(modal: ModalBody) -> bool:
    return bool(np.any(modal.node_quadratic) or np.any(modal.line_quadratic))


def _node_numbers(parts: Sequence[np.ndarray], is_quadratic: bool) -> list[Any]:
    """The numbers of nodes, one after the other, of their positions, shapes and second-order displacements."""
    rows = [part.reshape(len(part), -1) for part in (parts if is_quadratic else parts[:2])]
    made: list[Any] = np.concatenate(rows, axis=1).ravel().tolist()
    return made


# --- methods of `Model` -----


def flexible_body(
    self: Book,
    name: str,
    modal_body: ModalBody,
    *,
    at: Vector3 = (0.0, 0.0, 0.0),
    orientation: Rotation | None = None,
    pose: PoseLike | None = None,
    velocity: Vector3 | None = None,
    angular_velocity: Vector3 | None = None,
    modes: int | Sequence[int] | None = None,
    nodes: Sequence[str] = (),
    shape: ShapeLike | None = None,
) -> FlexibleBody:
    """An elastic body in a floating frame: the frame moves like a rigid body, and on it r + phi_k(r) q_k.

    Parameters
    ----------
    name
        As of `body`.
    modal_body
        The integrals of its shapes, `mbrs.flexible.ModalBody`: of `mbrs.flexible.beam`, `craig_bampton`, or made
        by hand.
    at, orientation, pose, velocity, angular_velocity
        Of the frame, as of `body`; the modal coordinates and their rates start at zero, or where `State.deformed` puts them.
    modes
        How many of the modes, or their indices; all by default.
    nodes
        Nodes that results follow though nothing is attached to them; others do so as soon as `.node` names them.
    shape
        As of `body`, fixed to the frame: it does not bend. Without one the line of the body is drawn, which bends.

    Returns
    -------
    FlexibleBody
        A body; ``.node("tip")`` may be given in place of a body, and ``at=`` may then be left out. Attaching the body
        itself needs ``at=`` a node's point.

    Raises
    ------
    ModelError
        Not a `ModalBody`, modes that it does not have, and what `body` raises.

    Notes
    -----
    Modal coordinates are named ``name.q1``, ... in results and stand behind those of the joints. Cost O(m^2) numbers
    for m modes.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> from mbrs.flexible import ModalBody
    >>> P1 = np.zeros((1, 3, 3)); P1[0, 0, 2] = 0.25     # a rod of 1 kg and 1 m along x that bends as x^2
    >>> P2 = np.zeros((1, 1, 3, 3)); P2[0, 0, 2, 2] = 0.2
    >>> shape = np.zeros((1, 6, 1)); shape[0, 2, 0] = 1.0; shape[0, 4, 0] = -2.0
    >>> bent = ModalBody(1.0, (0.5, 0, 0), np.diag([1e-4, 0.0834, 0.0834]), np.array([[0], [0], [1 / 3]]), P1, P2,
    ...                  np.array([[80.0]]), nodes=("frame", "tip"), node_position=np.array([[0, 0, 0], [1, 0, 0]]),
    ...                  node_shape=np.concatenate([np.zeros((1, 6, 1)), shape]))
    >>> m = mb.Model("cantilever"); rod = m.flexible_body("rod", bent)
    >>> m.fixed("clamp", m.ground, rod.node("frame"))
    <joint 'clamp' of 'cantilever'>
    """
    from ..flexible import ModalBody

    body = FlexibleBody(self, self.new_name("body", name))
    if not isinstance(modal_body, ModalBody):
        raise problem(name, f"needs a ModalBody (mb.flexible.beam, mb.flexible.craig_bampton), got {shown(modal_body)}")
    for node in modal_body.nodes:
        if "." in node or "[" in node or "]" in node or node == GROUND:
            raise problem(
                name, f"has a node {node!r}, whose name must not contain '.', '[' or ']', which addresses use"
            )
    body.modal = _chosen(name, modal_body, modes)
    body.used = {_known_node(body, node) for node in ([nodes] if isinstance(nodes, str) else nodes)}
    given = {
        **{part: body.modal.driven.get(part, getattr(body.modal, part)) for part in ("mass", "inertia", "com")},
        "at": at,
        "orientation": orientation,
        "velocity": velocity,
        "angular_velocity": angular_velocity,
    }
    entries, guess = pack(name, BODY, given).entries, first_guess(body, pose)
    body.check(body.evaluated(entries))
    body.integrals = _integrals(body)
    enter(body, entries, guess, shape)
    return body
