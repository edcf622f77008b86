"""The matrices of a linearised model, their coordinates, and the maps from ports to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.rotations import quaternion_matrix, twist_at
from .._lib.text import without_rounding
from ..errors import ModelError
from ..model.bodies import INERTIA_PLACE
from ..model.ports import Port, as_port
from ..model.schema import BODY, MARKER, SHAPES
from ..model.tables import modal_part, modal_places
from ..results import Result, derived, quantity, result
from ..system.snapshot import Snapshot
from ..system.state import State
from ..view.scene import SceneGeometry
from .constraint_maps import cut_map, open_map
from .first_order import StateSpace, first_order
from .floquet import Periodic
from .inertia import mass_matrices, mass_matrix_at
from .linear_system import assembled
from .matrices import EFFECT_OF
from .relaxation import States, extended, states_of
from .strains import Strains, strains_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model
    from ..model.ports import Ports

_SQUARE = ("coordinate", "coordinate_")


@result
class Linearization(Result):
    """M y" + (C + G) y' + (K + N) y = B^T f in minimal coordinates, exact at a state.

    Attributes
    ----------
    M, C, G, K, N
        (dof, dof): mass, damping (symmetric), gyroscopic (skew), stiffness (symmetric), circulatory (skew); C, G
        and N are
        None where nothing acts. SI units; rotations in radians.
    coordinates
        Names of the minimal coordinates: increments of joint coordinates, see docs/tables.md.
    T
        (6 n_bodies, dof): twist of each body's origin (x y z rx ry rz, world axes), bodies in the order of ``bodies``.
    modal_map
        (n_modal, dof): modal coordinates of the flexible bodies.
    residual
        (dof,) generalised force that is not in balance; zero at an equilibrium.
    over_turn
        M, D = C + G and S = K + N at the azimuths of a turn, whose means are M, C, G, K, N (`mb.steady_motion`, ``average``); or None.
    error
        The unbalanced part of the forces, the largest of all coordinates, each over the forces on the bodies that it is connected with;
        what a linearisation off equilibrium leaves out.
    """

    core: _core.SecondOrder
    coordinates: tuple[str, ...]
    T: np.ndarray
    bodies: tuple[str, ...]
    residual: np.ndarray = quantity(dims=("coordinate",))
    multipliers: np.ndarray
    ground_coupling: np.ndarray
    state: State
    without: tuple[str, ...]
    snapshot: Snapshot
    modal_map: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    over_turn: Periodic | None = None

    row: ClassVar[str] = "coordinate"
    largest_error: ClassVar[float] = np.inf  # forces of motions that are not steady are not in balance, and need not be
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates", "coordinate_": "coordinates", "body": "bodies"}

    @cached_property
    @derived(dims=_SQUARE)
    def M(self) -> np.ndarray:
        """(dof, dof) mass."""
        kept: np.ndarray = _kept(self.core.M)
        return kept

    @cached_property
    @derived(dims=_SQUARE)
    def C(self) -> np.ndarray | None:
        """(dof, dof) damping, or None."""
        kept: np.ndarray | None = _kept(self.core.C)
        return kept

    @cached_property
    @derived(dims=_SQUARE)
    def G(self) -> np.ndarray | None:
        """(dof, dof) gyroscopic, or None."""
        kept: np.ndarray | None = _kept(self.core.G)
        return kept

    @cached_property
    @derived(dims=_SQUARE)
    def K(self) -> np.ndarray:
        """(dof, dof) stiffness."""
        kept: np.ndarray = _kept(self.core.K)
        return kept

    @cached_property
    @derived(dims=_SQUARE)
    def N(self) -> np.ndarray | None:
        """(dof, dof) circulatory, or None."""
        kept: np.ndarray | None = _kept(self.core.N)
        return kept

    @cached_property
    def states(self) -> States | None:
        """States of laws and of the air that answer with a time of their own, or None."""
        return states_of(self)

    @cached_property
    def extended(self) -> _core.SecondOrder:
        """The system with `states` as further coordinates."""
        if self.states is None:
            return self.core
        return extended(self, self.states)

    def data_state(self) -> dict[str, Any]:
        """The fields, with the matrices in place of what the core holds."""
        state = super().data_state()
        del state["core"]
        return {**{name: getattr(self, name) for name in _SENSE}, **state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        given = [state.pop(name) for name in "MCGKN"]
        with core_errors():
            self.__dict__.update(state, core=_core.SecondOrder(*given))

    @property
    @derived(dims=("body", "component", "coordinate"), name="T")
    def twists(self) -> np.ndarray:
        """(n_bodies, 6, dof) `T` by bodies."""
        return self.T.reshape(len(self.bodies), 6, self.n)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.coordinates)

    @cached_property
    def B_open(self) -> np.ndarray:
        """(6 n_bodies, n_tree) B', the open-loop constraint matrix: twists of the bodies by the tree coordinates, from which
        B'^T X B' makes the matrices of the open tree. `T` = B_open @ B_cut.

        Computed when asked for, O(n_tree n_bodies); docs/theory.md (5.1) to (5.6).
        """
        return open_map(self.snapshot.system, self.state)

    @cached_property
    def B_cut(self) -> np.ndarray:
        """(n_tree, dof) B'', the cut-joint constraint matrix: tree coordinates by minimal ones; the identity without loops.

        Computed when asked for, O(n_tree^3) where loops are closed.
        """
        return cut_map(self.snapshot.system, self.state, self.coordinates, self.without)

    @property
    def model(self) -> Model:
        """The model this belongs to."""
        return self.snapshot.model

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that ran."""
        return self.stats.effects

    @property
    def is_sparse(self) -> bool:
        """Linearised models are dense; large ones have a route of their own in `mb.modes`."""
        return False

    @cached_property
    def poses(self) -> dict[str, np.ndarray]:
        """Position (n, 3), rotation (n, 3, 3), velocity and angular velocity (n, 3) of the bodies' origins, world."""
        with core_errors():
            return dict(self.snapshot.system.bodies(self.state.q, self.state.rate))

    @cached_property
    def body_mass_matrices(self) -> np.ndarray:
        """(n_bodies, 6, 6) mass matrix of each body about its origin, world axes; of flexible ones undeformed."""
        return mass_matrices(self.snapshot.tables, self.poses["rotation"])

    @property
    def mass_factor(self) -> np.ndarray:
        """(6 n_bodies, dof) F with M = F^T F: it keeps light bodies whose mass M adds to a heavy one's."""
        t = self.snapshot.tables
        places, x, rotation = np.asarray(t["body_x"], dtype=int), np.asarray(t["x"]), np.asarray(self.poses["rotation"])
        if not len(places):
            return np.zeros((0, self.T.shape[1]))
        com, inertia = (places[:, None] + np.r_[BODY.block.slice(name)] for name in ("com", "inertia"))
        principal, axes = np.linalg.eigh(x[inertia][:, np.ravel(INERTIA_PLACE)].reshape(-1, 3, 3))
        twist = self.T.reshape(len(places), 6, -1)
        arm = np.einsum("bij,bj->bi", rotation, x[com])
        moved = twist[:, :3] - np.cross(arm[:, :, None], twist[:, 3:], axis=1)
        turning = np.swapaxes(rotation @ axes, 1, 2) @ twist[:, 3:]
        weighed = (
            np.sqrt(x[places + BODY.block.place("mass")])[:, None, None] * moved,
            np.sqrt(np.maximum(principal, 0.0))[:, :, None] * turning,
        )
        made = np.concatenate(weighed, axis=1).reshape(6 * len(places), -1)
        if not modal_masses(self):
            return made
        flexible = [body for body, _, _ in modal_masses(self)]
        kept = made.reshape(len(places), 6, -1)[[i for i in range(len(places)) if i not in flexible]]
        modal = [_factor(mass) @ rows for _, rows, mass in modal_masses(self)]
        return np.vstack([kept.reshape(-1, made.shape[1]), *modal])

    def body_kinetic_energy(self, shape: np.ndarray) -> np.ndarray:
        """v^H M v of each body for each column of ``shape``, (n_bodies, n)."""
        v = (self.T @ shape).reshape(len(self.bodies), 6, -1)
        energy: np.ndarray = np.einsum("bin,bij,bjn->bn", v.conj(), self.body_mass_matrices, v).real
        for body, rows, mass in modal_masses(self):
            w = rows @ shape
            energy[body] = np.einsum("in,ij,jn->n", w.conj(), mass, w).real
        return energy

    @cached_property
    def geometry(self) -> SceneGeometry:
        """Bodies, springs and joints to draw, at this state."""
        return self.snapshot.scene.moved(self.poses["position"], self.poses["rotation"])

    @cached_property
    def strains(self) -> Strains:
        """Strains of elastic elements and joints with stiffness by the coordinates, with the slopes of their laws, at this state."""
        return strains_at(self.snapshot, self.state.q, self.without, self.T, self.poses["position"])

    def element_strain_energy(self, shape: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the elastic elements and 1/2 e^H k e of each for each column of ``shape``, (n_elements, n); k holds the
        slopes of their laws at this state.
        """
        made = self.strains
        each = (made.rows[own] for own in made.own)
        strains = [*zip(made.names, each, made.stiffness, strict=True), *modal_strains(self)]
        names = tuple(name for name, _, _ in strains)
        energy = np.zeros((len(names), shape.shape[1]))
        for i, (_, rows, k) in enumerate(strains):
            e = rows @ shape
            energy[i] = 0.5 * np.einsum("in,ij,jn->n", e.conj(), k, e).real
        return names, energy

    def port_row(self, port: Port) -> tuple[np.ndarray, int, np.ndarray]:
        """The row (dof,) of a port's motion, the index of its body (-1 ground) and its point now (3,)."""
        if port.body != "ground" and port.marker is None and port.body not in self.bodies:
            body, twist, point = node_twist(self, port.body)
            return np.asarray(port.direction) @ (twist[3:] if port.is_rotation else twist[:3]), body, point
        arm = self.port_arm(port)
        if port.body == "ground":
            return np.zeros(self.n), -1, arm
        body = self.snapshot.frame(port.body)
        point = self.poses["position"][body] + arm
        twist = twist_at(self.T[6 * body : 6 * body + 6], arm)
        return np.asarray(port.direction) @ (twist[3:] if port.is_rotation else twist[:3]), body, point

    def port_arm(self, port: Port) -> np.ndarray:
        """From the origin of a port's body to its point, world axes, now; of a port on ground its world point."""
        t = self.snapshot.tables
        point = port.point
        if port.marker is not None and point is None:
            start = t["marker_x"][self.model.marker_index[port.marker]]
            point = tuple(t["x"][start:][MARKER.block.slice("at")])
        if port.body == "ground":
            return np.zeros(3) if point is None else np.asarray(point, dtype=float)
        if point is None:
            return np.zeros(3)
        body = self.snapshot.frame(port.body)
        start = t["body_x"][body]
        drawn = t["x"][start:]
        r_drawn = quaternion_matrix(drawn[BODY.block.slice("orientation")])
        local = r_drawn.T @ (np.asarray(point) - drawn[BODY.block.slice("at")])
        return np.asarray(self.poses["rotation"][body] @ local)

    def input_map(self, ports: Sequence[Any]) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
        """Columns (dof, n_in) of inputs, the derivative of the input they multiply (2 for base motion), and their
        names.
        """
        made = [as_port(self.model, p) for p in ports]
        columns, order = [], []
        for port in made:
            if port.kind == "motion":
                raise ModelError(
                    f"the input {port.name!r} is a motion; inputs are forces, torques or mb.base_motion, such as "
                    f"{port.body}.force.{port.name.rsplit('.', 1)[-1]}"
                )
            if port.kind == "base":
                columns.append(-self.ground_coupling @ self._rigid(port))
                order.append(2)
            else:
                columns.append(self.port_row(port)[0])
                order.append(0)
        stacked = np.array(columns).reshape(len(made), self.n).T
        return stacked, np.array(order, dtype=np.int64), tuple(p.name for p in made)

    def _rigid(self, port: Port) -> np.ndarray:
        """The twist (6,) of ground at the world origin for unit base motion."""
        if self.state.moving:
            raise ModelError("base motion of a moving (rotating) state is not available; linearise at rest")
        if not port.is_rotation:
            return np.asarray(np.r_[port.direction, np.zeros(3)])
        fixed = [load.name for load in self.model.loads if load.frame == "world"]
        if fixed:
            raise ModelError(
                f"{port.name!r} turns ground, but the load {fixed[0]!r} keeps its direction in space, which this input map "
                "does not hold; use a translation, or leave the load out"
            )
        return np.asarray(np.r_[np.zeros(3), port.direction])

    def tilt_map(self, ports: Sequence[Any]) -> tuple[np.ndarray, tuple[int, ...]]:
        """Columns (dof, k) of those inputs that turn ground under gravity, times their angle, and which inputs they are.

        Seen from ground gravity turns by -angle: each body feels m (g x direction) angle.
        """
        columns, which = [], []
        if self.model.gravity is not None and "gravity" not in self.without:
            for j, port in enumerate(as_port(self.model, p) for p in ports):
                if port.kind == "base" and port.is_rotation:
                    columns.append(self.ground_coupling[:, :3] @ np.cross(self.model.gravity, port.direction))
                    which.append(j)
        return np.array(columns).reshape(len(which), self.n).T, tuple(which)

    def output_map(
        self, ports: Sequence[Any], inputs: Sequence[Any] = ()
    ) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
        """Rows (n_out, dof) of output motions, the part (n_out, n_in) that follows base motion directly, and their
        names.
        """
        made, sources = [as_port(self.model, p) for p in ports], [as_port(self.model, p) for p in inputs]
        rows, direct = np.zeros((len(made), self.n)), np.zeros((len(made), len(sources)))
        for i, port in enumerate(made):
            if port.kind != "motion":
                raise ModelError(
                    f"the output {port.name!r} is a {port.kind}; outputs are motions, such as body.motion('z')"
                )
            rows[i], _, point = self.port_row(port)
            for j, source in enumerate(sources):
                if source.kind == "base":
                    rigid = twist_at(self._rigid(source)[:, None], point)[:, 0]
                    direct[i, j] = np.asarray(port.direction) @ (rigid[3:] if port.is_rotation else rigid[:3])
        return rows, direct, tuple(p.name for p in made)

    def state_space(self, inputs: Ports | None = None, outputs: Ports | None = None) -> StateSpace:
        """A, B, C, D of x = (y, y'), with the names of inputs and outputs: see `mb.state_space`."""
        effects = [name for kind, name in EFFECT_OF.items() if getattr(self, kind) is not None]
        return first_order(assembled(self, effects, inputs, outputs))

    def heading(self) -> str:
        present = [f"{name} ({_SENSE[name]})" for name in "MCGKN" if getattr(self, name) is not None]
        return f"linearisation of {self.model.name!r}: {self.n} degrees of freedom, {', '.join(present)}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the diagonals of mass and stiffness."""
        scale = [float(np.abs(a).max(initial=0.0)) for a in (self.M, self.K)]
        m, k = (without_rounding(np.diag(a), s) for a, s in zip((self.M, self.K), scale, strict=True))
        return ["coordinate", "M", "K"], [
            [n, float(a), float(b)] for n, a, b in zip(self.coordinates, m, k, strict=True)
        ]

    def notes(self) -> list[str]:
        return [f"unbalanced force: {self.error:.1e} of all forces"]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Size of the entries of the matrices; with ``ax`` those of K. Returns the figure."""
        from ..plot.matrices import matrices

        return matrices(self, ax=ax)


def _kept(a: Any) -> Any:
    """A matrix of the core, for reading."""
    if a is not None:
        a.flags.writeable = False
    return a


_SENSE = {"M": "mass", "C": "damping", "G": "gyroscopic", "K": "stiffness", "N": "circulatory"}


def modal_masses(lin: Linearization) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Each flexible body: its number, the rows (6 + m, dof) of its origin's twist (body axes) and of its modal coordinates,
    and its mass matrix (6 + m, 6 + m) over them.
    """
    t, out = lin.snapshot.tables, []
    for i, (body, own) in enumerate(modal_places(t)):
        turned = np.einsum("ji,kjn->kin", lin.poses["rotation"][body], lin.T[6 * body : 6 * body + 6].reshape(2, 3, -1))
        rows = np.vstack([turned.reshape(6, -1), lin.modal_map[own]])
        out.append((body, rows, mass_matrix_at(t, i, modal_part(t, lin.state.q)[own])))
    return out


def modal_strains(lin: Linearization) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Each flexible body: its name, the rows (m, dof) of its modal coordinates and its stiffness (m, m)."""
    t, out = lin.snapshot.tables, []
    for i, (body, own) in enumerate(modal_places(t)):
        m = own.stop - own.start
        stiffness = t["x"][int(t["flexible_x"][i]) :][SHAPES.block.slice("K", m)].reshape(m, m)
        out.append((lin.bodies[body], lin.modal_map[own], stiffness))
    return out


def node_twist(lin: Linearization, name: str) -> tuple[int, np.ndarray, np.ndarray]:
    """Body, twist (6, dof) and point now (3,) of a node without a frame of its own."""
    owner, _, node = name.partition(".")
    body, modal = lin.bodies.index(owner), lin.model[owner].modal
    shape, R = modal.node_shape[modal.nodes.index(node)], lin.poses["rotation"][body]
    local = modal.node_position[modal.nodes.index(node)]
    own = next((own for b, own in modal_places(lin.snapshot.tables) if b == body), None)
    if own is None:
        return body, twist_at(lin.T[6 * body : 6 * body + 6], R @ local), lin.poses["position"][body] + R @ local
    q = modal_part(lin.snapshot.tables, lin.state.q)[own]
    index = modal.nodes.index(node)
    w, arm = shape @ q, R @ modal.places(q)[index]
    slope = shape[:3] + modal.node_quadratic[index] @ q
    twist, moving = twist_at(lin.T[6 * body : 6 * body + 6], arm), lin.modal_map[own]
    turned, axes = R, []
    for k in range(3):
        axes.append(turned[:, k])
        q = np.zeros(4)
        q[0], q[1 + k] = np.cos(0.5 * w[3 + k]), np.sin(0.5 * w[3 + k])
        turned = turned @ quaternion_matrix(q)
    twist[:3] += R @ slope @ moving
    twist[3:] += np.stack(axes, axis=1) @ shape[3:] @ moving
    return body, twist, lin.poses["position"][body] + arm


def _factor(mass: np.ndarray) -> np.ndarray:
    """F with F^T F = mass, which is semidefinite where a body has no inertia about an axis, such as a beam about its own."""
    size = np.sqrt(np.diag(mass))
    size[size == 0.0] = 1.0
    square, axes = np.linalg.eigh(mass / np.outer(size, size))
    rounding = len(mass) * np.finfo(float).eps * square[-1]
    factor: np.ndarray = np.sqrt(np.where(square > rounding, square, 0.0))[:, None] * axes.T * size
    return factor
