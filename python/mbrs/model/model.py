"""The model: names, units and numbers as the user gives them. It becomes Tables in `mbrs.tables`."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .addresses import Target, target
from .attached_laws import LawItem
from .bodies import Body, Ground, Marker, NodePlace, Pose, add_body, add_marker
from .book import Field, Item, Store, plain
from .drives import Coupler, Drive, DriveMethods
from .element_methods import ElementMethods
from .expressions import Program, rebuild_all
from .forces import Element, Load
from .joint_methods import JointMethods
from .joints import Joint
from .motions import MotionItem
from .names import GROUND, check_name, located, not_found, problem, shown
from .numbers import vector
from .parameters import ArrayParameter, ParameterSpace
from .parameters import Symbol as Parameter
from .varying import Driver, assign, read

if TYPE_CHECKING:
    from .flexible import FlexibleBody

# The order of their numbers in x.
STORES = (
    "body",
    "joint",
    "element",
    "load",
    "marker",
    "element_law",
    "joint_law",
    "pose",
    "gravity",
    "motion",
    "coupler",
    "flexible",
)


class Gravity(Item):
    """The three numbers of gravity."""

    __slots__ = ()
    store = "gravity"
    kind = "gravity"

    @property
    def size(self) -> int:
        return 3

    def fields(self) -> dict[str, Field]:
        return {"gravity": plain(self.start, 3, "m/s2")}


class Model(JointMethods, DriveMethods, ElementMethods):
    """A spatial multibody system as the user describes it: bodies, joints, springs, loads, parameters.

    Parameters
    ----------
    name
        Any string; it heads the tables and pages made from the model.
    gravity
        Acceleration (3,), m/s2, world; None (and nothing is computed for it) by default.

    Raises
    ------
    ModelError
        A wrong argument, here and in every method; the message names the object and the remedy.

    Notes
    -----
    World coordinates of the drawn configuration locate everything, SI units, radians. Adding an object costs O(1).

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("pendulum", gravity=(0, 0, -9.81))
    >>> length = m.parameter("length", 1.0)
    >>> rod = m.body("rod", mass=2.0, inertia=(0.2, 0.2, 0.01), at=(0, 0, -length / 2))
    >>> m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="x")
    <joint 'hinge' of 'pendulum'>
    >>> m.set({"length": 1.5}); m.value("rod.at")
    array([ 0.  ,  0.  , -0.75])
    """

    def __init__(self, name: str, gravity: Any = None) -> None:
        if not isinstance(name, str) or not name:
            raise ModelError(f"the name of a model must be a non-empty string, got {shown(name)}")
        self.name = name
        self.space = ParameterSpace()
        self.stores = {kind: Store() for kind in STORES}
        self.items: dict[str, Item] = {}
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []
        self.elements: list[Element] = []
        self.loads: list[Load] = []
        self.drives: list[Drive] = []
        self.couplers: list[Coupler] = []
        self.motions: list[MotionItem] = []
        self.markers: list[Marker] = []
        self.poses: list[Pose] = []
        self.laws: dict[str, list[LawItem]] = {"element": [], "joint": []}
        self.laws_of: dict[tuple[str, int], list[LawItem]] = {}
        self.gravity_item: Gravity | None = None
        self.body_index: dict[str, int] = {}
        self.marker_index: dict[str, int] = {}
        self.ground = Ground(self, GROUND)
        # Structure: what Tables' integers say. Values: what x says.
        self.structure_version = 0
        self.values_version = 0
        self._forget()
        if gravity is not None:
            self.gravity = gravity

    def _forget(self) -> None:
        self.cache: dict[str, Any] = {}
        self._targets: dict[str, Target] = {}
        self._core: dict[bool, Any] = {}

    def body(
        self,
        name: str,
        *,
        mass: Any,
        inertia: Any,
        at: Any = (0.0, 0.0, 0.0),
        com: Any = None,
        orientation: Any = None,
        pose: Any = None,
        velocity: Any = None,
        angular_velocity: Any = None,
    ) -> Body:
        """A rigid body; free until joints hold it.

        Parameters
        ----------
        name
            Unique in the model, without ``.``, ``[`` and ``]``.
        mass
            kg, positive.
        inertia
            (3,) or (3, 3), kg m2, about the centre of mass, body axes, products with the sign of the tensor
            (Ixy = - integral of x y dm). Planar data (0, 0, Izz) pass with a warning.
        at
            (3,), m, world: the body's origin as drawn, its centre of mass unless ``com`` is given.
        com
            (3,), m: centre of mass from the origin, body axes.
        orientation
            Quaternion (4,), scalar first, or matrix (3, 3), body to world, as drawn.
        pose
            (origin, orientation): first guess of where assembly brings the body when joints were given two points.
        velocity, angular_velocity
            (3,) of the origin, m/s, and (3,), rad/s, world axes.

        Returns
        -------
        Body

        Raises
        ------
        InertiaError
            A mass or an inertia that no body can have.
        ModelError
            Wrong shapes, types, numbers that are not finite, a name that is taken.

        Notes
        -----
        Every number may be an expression of parameters. Cost O(1).

        Examples
        --------
        >>> import mbrs as mb
        >>> m = mb.Model("one"); p = m.body("payload", mass=20.0, inertia=(0.15, 0.15, 0.15), at=(0, 0, 0.1))
        >>> p.force("z").name
        'payload.force.z'
        """
        return add_body(
            self,
            name,
            pose,
            mass=mass,
            inertia=inertia,
            at=at,
            com=com,
            orientation=orientation,
            velocity=velocity,
            angular_velocity=angular_velocity,
        )

    def flexible_body(
        self,
        name: str,
        modal_body: Any,
        *,
        at: Any = (0.0, 0.0, 0.0),
        orientation: Any = None,
        pose: Any = None,
        velocity: Any = None,
        angular_velocity: Any = None,
        modes: Any = None,
        nodes: Sequence[str] = (),
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
            Of the frame, as of `body`; the modal coordinates and their rates start at zero.
        modes
            How many of the modes, or their indices; all by default.
        nodes
            Nodes that results follow though nothing is attached to them; others do so as soon as `.node` names them.

        Returns
        -------
        FlexibleBody
            A body; ``.node("tip")`` stands wherever a body may, and ``at=`` may then be left out. Attaching the body
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
        from .flexible import add_flexible_body

        return add_flexible_body(
            self,
            name,
            modal_body,
            modes,
            nodes,
            pose,
            at=at,
            orientation=orientation,
            velocity=velocity,
            angular_velocity=angular_velocity,
        )

    def marker(self, name: str, body: Any, *, at: Any = None, orientation: Any = None) -> Marker:
        """A named point of a body (or of ground) at ``at`` (3,), world, m, as drawn: for inputs, outputs and
        trajectories.
        """
        return add_marker(self, name, body, at, orientation)

    def parameter(self, name: str, value: Any) -> Any:
        """A design variable, a number or an array of any shape, to be used wherever a number is expected.

        Arithmetic, indexing and NumPy functions of it give expressions, whose derivatives are exact.

        >>> import mbrs as mb
        >>> m = mb.Model("one"); V = m.parameter("V", [[1.0, 2.0], [3.0, 4.0]])
        >>> (2 * V[0, 1] + 1).value
        5.0
        """
        if isinstance(name, str) and name == "gravity":
            raise ModelError("a parameter must not be called 'gravity': that is the address of the model's gravity")
        check_name("parameter", name, self.items)
        if name in self.space.names:
            check_name("parameter", name, self.space.names)
        made: Parameter | ArrayParameter = self.space.add(name, value)
        self.structure_version += 1
        return made

    @property
    def gravity(self) -> np.ndarray | None:
        """Acceleration of gravity (3,), m/s2, world, or None. Assigning it replaces it."""
        return None if self.gravity_item is None else np.array(self.gravity_item.values(0, 3))

    @gravity.setter
    def gravity(self, value: Any) -> None:
        old, self.stores["gravity"] = self.stores["gravity"], Store()
        item = Gravity(self, "gravity")
        try:
            item.put(vector(value, "gravity"))
        except Exception:
            self.stores["gravity"] = old
            raise
        self.gravity_item = item
        self._changed_structure()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters, in the order of definition (that of V)."""
        return tuple(self.space.names)

    def __getitem__(self, name: str) -> Any:
        """The handle of a name: a body, joint, element, load, marker or parameter."""
        if not isinstance(name, str):
            raise ModelError(f"model {self.name!r} is indexed by names, got {shown(name)}")
        if name == GROUND:
            return self.ground
        if name in self.items:
            return self.items[name]
        if name in self.space.names:
            return self.space.handle(name)
        raise not_found(f"nothing in model {self.name!r}", name, [*self.items, *self.space.names])

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self.items or name in self.space.names)

    def value(self, address: str) -> Any:
        """The number(s) at an address now: a float, or an array for an address without an index.

        >>> import mbrs as mb
        >>> mb.Model("one", gravity=(0, 0, -9.81)).value("gravity[2]")
        -9.81
        """
        return read(self, self.target(address))

    def set(self, changes: Mapping[str, Any]) -> None:
        """Change numbers by address, keeping what was compiled: ``{"k_leg": 2e5, "payload.mass": 21.0}``.

        All changes are made or, where one is impossible, none. Numbers that a parameter drives change through the
        parameter. Setting the ``length`` of a spring gives it a natural length of its own. A new axis or orientation is
        set whole. Cost: O(changed numbers), plus one pass over the expressions where parameters change.

        Raises
        ------
        NameNotFoundError
            An unknown address; the message proposes the nearest.
        ModelError
            A value that fits the address in shape or sense no better than it would in the constructor.
        """
        if not isinstance(changes, Mapping):
            raise ModelError(f"m.set takes a mapping of addresses to values, got {shown(changes)}")
        restructured = assign(self, [(self.target(address), value) for address, value in changes.items()])
        if restructured:
            self._changed_structure()
        self.values_version += 1

    def target(self, address: str) -> Target:
        """What an address means; resolved once and kept while the structure stays."""
        found = self._targets.get(address) if isinstance(address, str) else None
        if found is None:
            found = target(self, address)
            self._targets[address] = found
        return found

    def driver(self) -> Driver:
        """The compiled expressions, renewed when objects were added."""
        cached = self.cache.get("driver")
        if cached is None or cached.version != self.structure_version:
            cached = self.cache["driver"] = Driver(self)
        return cached

    def compiled(self, flexible: bool = True) -> Any:
        """The core's System at the present values; the topology is compiled once. ``flexible=False``: flexible bodies are
        rigid there.
        """
        from .. import _core
        from ..tables import tables, x

        now = (self.structure_version, self.values_version)
        kept = self._core.get(flexible)
        if kept is None or kept[0][0] != now[0]:
            kept = (now, _core.System(tables(self, flexible)))
        elif kept[0] != now:
            kept = (now, kept[1].with_values(x(self)))
        self._core[flexible] = kept
        return kept[1]

    def _changed_structure(self) -> None:
        self.structure_version += 1
        self._targets.clear()

    def new_name(self, kind: str, name: Any) -> str:
        """The name, if a new object may have it."""
        check_name(kind, name, self.items)
        return check_name(kind, name, self.space.names)

    def register(self, item: Any, members: list[Any]) -> None:
        """Take a finished object into the model."""
        item.index = len(members)
        members.append(item)
        self.items[item.name] = item
        if isinstance(item, Body):
            self.body_index[item.name] = item.index
        elif isinstance(item, Marker):
            self.marker_index[item.name] = item.index
        self.structure_version += 1

    def find_body(self, body: Any, where: str, key: str = "body") -> int:
        """Index of a body given by handle or name; -1 is ground. ``key`` is the argument that named it."""
        if isinstance(body, (Body, Ground)) and body.model is self:
            return body.index
        if isinstance(body, str) and body in self.body_index:
            return self.body_index[body]
        if isinstance(body, str) and body == GROUND:
            return -1
        raise located(self._no_body(body, where), f"{where}.{key}")

    def _no_body(self, body: Any, where: str) -> ModelError:
        if isinstance(body, (Body, Ground)):
            return ModelError(f"{where} names {shown(body)}, which belongs to another model; use this model's own")
        if not isinstance(body, str):
            return ModelError(f"{where} needs a body (its handle or name, or m.ground), got {shown(body)}")
        if body in self.items:
            return ModelError(f"{where} needs a body, but {shown(body)} is a {self.items[body].kind}")
        return not_found(f"{where}: no body", body, [*self.body_index, GROUND])

    def body_name(self, index: int) -> str:
        """Name of a body by index."""
        return GROUND if index < 0 else self.bodies[index].name

    def frame_name(self, body: int, node: int) -> str:
        """Name of the frame that moves with a body or with its node."""
        from .flexible import frame_names, frame_of

        return self.body_name(body) if node < 0 else frame_names(self)[frame_of(self, body, node)]

    def frame_index(self, name: str) -> int:
        """Index of a frame of results by name: a body, or ``body.node`` of a flexible one."""
        if name in self.body_index:
            return self.body_index[name]
        from .flexible import frame_names

        return frame_names(self).index(name)

    def has_frame(self, name: str) -> bool:
        """Is there a body of this name, or a node ``body.node``?"""
        owner, _, node = name.partition(".")
        return owner in self.body_index and (not node or node in getattr(self.items[owner], "nodes", ()))

    @property
    def is_flexible(self) -> bool:
        """Is there a flexible body?"""
        return len(self.stores["flexible"].x) > 0

    def places(self, where: str, given: Sequence[tuple[str, Any]], at: Any, address: str) -> tuple[list[Any], Any]:
        """What something is attached to (body and node, -1 where there is none), and its point(s)."""
        from .flexible import Place, attachments

        noded = at is None or any(isinstance(b, NodePlace) or (isinstance(b, str) and "." in b) for _, b in given)
        if not self.is_flexible and not noded:
            return [Place(self.find_body(body, where, key)) for key, body in given], at
        return attachments(self, where, given, at, address)

    def connect(self, item: Any, where: str, a: Any, b: Any, at: Any) -> Any:
        """Put the two ends of an item on two different bodies or nodes; returns its point(s)."""
        (i, j), at = self.places(where, (("a", a), ("b", b)), at, f"{item.name}.at")
        if i == j:
            raise problem(where, f"connects {self.body_name(i.body)!r} with itself; name two different bodies")
        item.a, item.b, item.a_node, item.b_node = i.body, j.body, i.node, j.node
        return at

    def load_place(self, where: str, body: Any, at: Any, address: str) -> tuple[int, int, Any]:
        """Body, node and point of a load; the point of a rigid body without one is its origin."""
        from .flexible import FlexibleBody

        if at is None and not isinstance(body, NodePlace):
            found = self.find_body(body, where) if not (isinstance(body, str) and "." in body) else None
            if found is not None:
                if found >= 0 and isinstance(self.bodies[found], FlexibleBody):
                    raise problem(
                        address,
                        f"is missing: {self.body_name(found)!r} is flexible; name a node, {self.body_name(found)}.node(name)",
                    )
                return found, -1, self.bodies[found].entries(0, 3) if found >= 0 else (0.0, 0.0, 0.0)
        (place,), at = self.places(where, (("body", body),), at, address)
        return place.body, place.node, at

    def save(self, path: str | Path) -> Path:
        """Save as TOML; `load` brings back a model with identical Tables. Expressions stay expressions. Returns the
        path.
        """
        from .toml import save

        return save(self, path)

    @staticmethod
    def load(path: str | Path) -> Model:
        """A model from a TOML file. Errors name file, line and column."""
        from .toml import load

        return load(path)

    def copy(self) -> Model:
        """An independent copy."""
        return copy.deepcopy(self)

    def __getstate__(self) -> dict[str, Any]:
        state = {k: v for k, v in self.__dict__.items() if k not in ("cache", "_targets", "_core", "stores")}
        places = [(kind, i) for kind, store in self.stores.items() for i in store.driven]
        program = Program([self.stores[kind].driven[i] for kind, i in places])
        state["saved_numbers"] = {kind: store.x.tobytes() for kind, store in self.stores.items()}
        state["saved_expressions"] = (places, program.nodes, program.roots)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        saved, (places, nodes, roots) = state.pop("saved_numbers"), state.pop("saved_expressions")
        self.__dict__.update(state)
        self._forget()
        self.stores = {kind: Store() for kind in STORES}
        for kind, data in saved.items():
            self.stores[kind].x.frombytes(data)
        for (kind, i), node in zip(places, rebuild_all(self.space, nodes, roots), strict=True):
            self.stores[kind].driven[i] = node

    def __repr__(self) -> str:
        counts: Sequence[tuple[int, str]] = (
            (len(self.bodies), "bodies"),
            (len(self.joints), "joints"),
            (len(self.elements), "elements"),
            (len(self.loads), "loads"),
            (len(self.space.names), "parameters"),
        )
        return f"Model({self.name!r}: " + ", ".join(f"{n} {what}" for n, what in counts) + ")"
