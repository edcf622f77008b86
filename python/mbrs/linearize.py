"""Exact linearisation of a model at a state: the matrices, their coordinates, and the maps from ports to them."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ._border import core_errors
from ._parts import split_damping, split_stiffness
from ._rounding import motion_scale, stiffness_without_rounding
from .effects import check_without, effects
from .errors import MbrsWarning, ModelError
from .modal_frames import modal_masses, modal_strains, node_twist
from .model.bodies import INERTIA_PLACE
from .model.book import Book
from .model.ports import Port, as_port
from .model.schema import BODY, MARKER
from .report import without_rounding
from .results import Result, Stats, derived, quantity, result
from .state import State, state_of
from .tables import compiled, framed, tables

if TYPE_CHECKING:
    from .model.model import Model

# Rounding of a few dozen terms that cancel, relative to their size.
_CANCELLED = 1e-14
# An unbalanced force above this part of all forces makes a linearisation at rest questionable.
_BALANCED = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """The model as it was when a result was made: its compiled form, its numbers, and the versions that say whether it
    changed since.
    """

    model: Model
    system: Any
    versions: tuple[int, int]
    tables: dict[str, Any]

    @classmethod
    def of(cls, model: Model, without: Sequence[str] = ()) -> Snapshot:
        """Compile a model as it is now; without the effect "flexibility" its flexible bodies are rigid."""
        if not isinstance(model, Book):
            raise ModelError(f"expected a mb.Model, got {type(model).__name__}")
        with core_errors():
            flexible = not (model.is_flexible and "flexibility" in without)
            system = compiled(model, flexible)
        made = framed(tables(model, flexible))
        return cls(model, system, (model.structure_version, model.values_version), made)

    def frame(self, name: str) -> int:
        """Index of a body, or of a node ``body.node`` that the results follow."""
        names = self.tables["body_name"]
        if name not in names and "flexible_body" not in self.tables:
            name = name.partition(".")[0]
        if name not in names:
            raise ModelError(
                f"this result does not follow the node {name!r}, which was named after it: compute it again"
            )
        index: int = names.index(name)
        return index

    @property
    def current(self) -> bool:
        """True while the model is as it was."""
        return (self.model.structure_version, self.model.values_version) == self.versions

    def check_current(self, what: str) -> None:
        """Derivatives need the expressions as they were: refuse when the model was changed in between."""
        if not self.current:
            raise ModelError(
                f"model {self.model.name!r} was changed after this {what} was computed; compute it again, then its "
                "sensitivities"
            )

    def __getstate__(self) -> dict[str, Any]:
        raw = self.tables.get("raw", self.tables)
        return {"model": self.model, "current": self.current, "tables": raw, "flexible": "flexible_body" in raw}

    def data_state(self) -> dict[str, Any]:
        """What a file of data keeps: the Tables of a model as it is are made again from it."""
        state = self.__getstate__()
        return {**state, "tables": None} if state["current"] else state

    def __setstate__(self, state: dict[str, Any]) -> None:
        from . import _core

        model, current = state["model"], state["current"]
        if state["tables"] is None:
            state = {**state, "tables": tables(model, state["flexible"] or not model.is_flexible)}
        # a model that can be flexible, but was compiled without it
        system = (
            compiled(model, state["flexible"] or not model.is_flexible) if current else _core.System(state["tables"])
        )
        versions = (model.structure_version, model.values_version) if current else (-1, -1)
        for name, value in (
            ("model", model),
            ("system", system),
            ("versions", versions),
            ("tables", framed(state["tables"])),
        ):
            object.__setattr__(self, name, value)


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
    error
        The unbalanced part of all forces; what a linearisation off equilibrium leaves out.
    """

    M: np.ndarray = quantity(dims=("coordinate", "coordinate_"))
    C: np.ndarray | None = quantity(dims=("coordinate", "coordinate_"))
    G: np.ndarray | None = quantity(dims=("coordinate", "coordinate_"))
    K: np.ndarray = quantity(dims=("coordinate", "coordinate_"))
    N: np.ndarray | None = quantity(dims=("coordinate", "coordinate_"))
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

    row: ClassVar[str] = "coordinate"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates", "coordinate_": "coordinates", "body": "bodies"}

    @property
    @derived(dims=("body", "component", "coordinate"), name="T")
    def twists(self) -> np.ndarray:
        """(n_bodies, 6, dof) `T` by bodies."""
        return self.T.reshape(len(self.bodies), 6, self.n)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.coordinates)

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
            return self.snapshot.system.bodies(self.state.q, self.state.rate)

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
        modal = [np.linalg.cholesky(mass).T @ rows for _, rows, mass in modal_masses(self)]
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
    def geometry(self) -> Any:
        """Bodies, springs and joints to draw, at this state."""
        from .animate.geometry import scene_from_tables

        scene = scene_from_tables(self.snapshot.tables)
        return scene.moved(self.poses["position"], self.poses["rotation"])

    @cached_property
    def _strains(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        with core_errors():
            rows = self.snapshot.system.strains(self.state.q, list(self.without))
        out = []
        for name, a, b, point, gradients, k in rows:
            relative = self._at(b, point) - self._at(a, point)
            out.append((name, gradients @ relative, k))
        return out

    def element_strain_energy(self, shape: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the elastic elements and 1/2 e^H k e of each for each column of ``shape``, (n_elements, n); k holds the
        slopes of their laws at this state.
        """
        strains = [*self._strains, *modal_strains(self)]
        names = tuple(name for name, _, _ in strains)
        energy = np.zeros((len(names), shape.shape[1]))
        for i, (_, rows, k) in enumerate(strains):
            e = rows @ shape
            energy[i] = 0.5 * np.einsum("in,ij,jn->n", e.conj(), k, e).real
        return names, energy

    def _at(self, body: int, point: np.ndarray) -> np.ndarray:
        """Twist (6, dof) of the material point of a body that is at ``point`` now."""
        if body < 0:
            return np.zeros((6, self.n))
        twist = self.T[6 * body : 6 * body + 6]
        return twist_at(twist, point - self.poses["position"][body])

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
        r_drawn = _rotation(drawn[BODY.block.slice("orientation")])
        local = r_drawn.T @ (np.asarray(point) - drawn[BODY.block.slice("at")])
        return self.poses["rotation"][body] @ local

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
            return np.r_[port.direction, np.zeros(3)]
        fixed = [load.name for load in self.model.loads if load.frame == "world"]
        if fixed:
            raise ModelError(
                f"{port.name!r} turns ground, but the load {fixed[0]!r} keeps its direction in space, which this input map "
                "does not hold; use a translation, or leave the load out"
            )
        return np.r_[np.zeros(3), port.direction]

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

    def state_space(self, inputs: Any = None, outputs: Any = None) -> Any:
        """A, B, C, D of x = (y, y'), with the names of inputs and outputs: see `mb.state_space`."""
        from .state_space import state_space

        return state_space(self, inputs, outputs)

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

    def plot(self, *, ax: Any = None) -> Any:
        """Size of the entries of the matrices; with ``ax`` those of K. Returns the figure."""
        from .plot.matrices import matrices

        return matrices(self, ax=ax)


def mass_matrices(tables: Any, rotation: np.ndarray) -> np.ndarray:
    """(n_bodies, 6, 6) mass matrix of each body about its origin, world axes, for rotations (n_bodies, 3, 3)."""
    x = tables["x"]
    out = np.zeros((len(tables["body_x"]), 6, 6))
    for i, start in enumerate(tables["body_x"]):
        r = rotation[i]
        numbers = x[start:]
        m, arm = numbers[BODY.block.place("mass")], r @ numbers[BODY.block.slice("com")]
        xx, yy, zz, xy, xz, yz = numbers[BODY.block.slice("inertia")]
        inertia = r @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ r.T
        s = _skew(arm)
        out[i] = np.block([[m * np.eye(3), -m * s], [m * s, inertia - m * s @ s]])
    return out


_SENSE = {"M": "mass", "C": "damping", "G": "gyroscopic", "K": "stiffness", "N": "circulatory"}
_COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")


def twist_at(twist: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """The same rigid motion (6, n) at a point displaced by ``arm`` (3,)."""
    moved = twist.copy()
    moved[:3] -= _skew(arm) @ twist[3:]
    return moved


def _skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    q = np.asarray(quaternion, dtype=float)
    s = _skew(q[1:])
    return np.eye(3) + (2.0 / (q @ q)) * (q[0] * s + s @ s)


def linearize(m: Model, *, at: Any = None, without: Sequence[str] = ()) -> Linearization:
    """Linearise a model exactly at a state.

    M y" + (C + G) y' + (K + N) y = B^T f, with y the increments of the minimal coordinates: springs, preload, follower
    loads, gravity, gyroscopic and centrifugal terms, and the geometric stiffness of all constraint forces.

    Parameters
    ----------
    m
        The model, with its present values.
    at
        None: the drawn state with its given velocities; or an equilibrium, a steady motion, a state.
    without
        Names of effects to leave out, see `mb.effects`.

    Returns
    -------
    Linearization

    Raises
    ------
    AssemblyError
        Loops that cannot close.
    SingularError
        A singular pose.

    Warns
    -----
    MbrsWarning
        At rest off equilibrium: the matrices then belong to a state that does not last.

    Notes
    -----
    Cost O(n_bodies * depth) for the tree, O(path^2) for each element, O(n^3) where loops are closed. Recursions
    after Singh,
    Russo and Wensing (IEEE Robotics and Automation Letters 7(2), 2022), transformation after Jiang, Chen and Luo
    (2011).

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("rod", gravity=(0, -9.81, 0))
    >>> rod = m.body("rod", mass=1.0, inertia=(1/12, 1e-3, 1/12), at=(0, -0.5, 0))
    >>> hinge = m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="z")
    >>> mb.linearize(m).K.round(6).tolist()
    [[4.905]]
    """
    start = time.perf_counter()
    without = check_without(without)
    snapshot = Snapshot.of(m, without)
    state = state_of(m, snapshot.system, at)
    with core_errors():
        r = snapshot.system.linearize(
            state.q, state.rate, list(without), state.memory.tolist(), state.acceleration.tolist()
        )
    return _linearization(snapshot, state, r, without, start, warn=True)


def _linearization(
    snapshot: Snapshot, state: State, r: dict[str, Any], without: tuple[str, ...], start: float, warn: bool
) -> Linearization:
    model = snapshot.model
    r = _seen_from(state, r)
    D, S = _without_rounding(snapshot, state, r) if state.moving else (r["D"], r["S"])
    scale = r["force_scale"]
    reach = motion_scale(r["T"], snapshot.system.characteristic_length)
    forces = scale * np.outer(reach, reach)
    C, G = split_damping(D, state.moving or _cross_coupled(model, "c"))
    K, N = split_stiffness(S, forces, conservative=not state.moving and not _has_no_potential(model))
    unbalanced = float(np.max(np.abs(r["residual"]), initial=0.0))
    error = unbalanced / scale if scale > 0.0 else 0.0
    if state.kind == "equilibrium" and error > _BALANCED:  # of values that have changed since
        state = replace(state, kind="given")
    if warn and not state.moving and error > _BALANCED:
        warnings.warn(
            f"the {state.kind} state of {model.name!r} is not in balance: {_unbalance(r)}; linearise at mb.equilibrium(m) instead",
            MbrsWarning,
            stacklevel=3,
        )
    on = tuple(e for e in effects(model).on if e not in without)
    made = Linearization(
        M=r["M"],
        C=C,
        G=G,
        K=K,
        N=N,
        coordinates=tuple(r["coordinates"]),
        T=r["T"],
        bodies=tuple(snapshot.tables["body_name"]),
        residual=r["residual"],
        multipliers=r["multipliers"],
        ground_coupling=r["ground_coupling"],
        state=state,
        without=without,
        snapshot=snapshot,
        modal_map=r["modal_map"] if "modal_map" in r else np.zeros((0, len(r["coordinates"]))),
        stats=Stats(time.perf_counter() - start, r["counts"], on, "minimal coordinates"),
        error=error,
        status="converged" if error <= _BALANCED or state.moving else "off-equilibrium",
    )
    return made if state.moving else made.replaced(K=stiffness_without_rounding(made, forces))


def _unbalance(r: dict[str, Any]) -> str:
    """The coordinate that a state off balance sets in motion most, and how much."""
    try:
        acceleration = np.linalg.solve(r["M"], r["residual"])
    except np.linalg.LinAlgError:  # a coordinate without inertia
        worst = int(np.argmax(np.abs(r["residual"])))
        return f"{r['residual'][worst]:.3g} N or N m are left over at {r['coordinates'][worst]!r}"
    worst = int(np.argmax(np.abs(acceleration)))
    return f"{r['coordinates'][worst]!r} would accelerate at {-acceleration[worst]:.3g} (m or rad)/s2"


def _seen_from(state: State, r: dict[str, Any]) -> dict[str, Any]:
    """D and S of increments z in the axes of a steady motion, y = exp(W t) z: D + 2 M W and S + D W + M W^2."""
    W = state.turn
    if W is None:
        return r
    if W.shape != r["M"].shape:
        raise ModelError(
            f"at= is a steady motion with {len(W)} degrees of freedom, which are {len(r['M'])} here; compute it again from this model, "
            "with the same effects"
        )
    D = np.zeros_like(r["M"]) if r["D"] is None else r["D"]
    return {**r, "D": D + 2.0 * r["M"] @ W, "S": r["S"] + D @ W + r["M"] @ W @ W}


def _without_rounding(snapshot: Snapshot, state: State, r: dict[str, Any]) -> tuple[np.ndarray | None, np.ndarray]:
    """D and S of a moving state without entries that inertia terms leave where they cancel.

    Rotation at w adds terms of size w^2 sqrt(M_ii M_jj) to S_ij and w sqrt(M_ii M_jj) to D_ij. Their rounding in a row that
    nothing else holds, that of the turning itself, would pass for a stiffness there. It is taken out here, where w is known:
    the matrices alone do not tell it from a weak spring beside a stiff one, and in a plane motion D is rounding as well.
    """
    spin = np.linalg.norm(snapshot.system.bodies(state.q, state.rate)["angular_velocity"], axis=1)
    w = float(np.max(spin, initial=0.0))
    size = np.sqrt(np.diag(r["M"]))
    rounding = _CANCELLED * np.outer(size, size)

    def cleaned(x: np.ndarray, scale: float) -> np.ndarray:
        return np.where(np.abs(x) <= scale * rounding, 0.0, x)

    D = r["D"]
    return None if D is None else cleaned(D, w), cleaned(r["S"], w * w)


def _has_no_potential(model: Any) -> bool:
    return any(load.frame == "body" for load in model.loads) or _cross_coupled(model, "k")


def _cross_coupled(model: Any, name: str) -> bool:
    """True where a full 6 x 6 bushing is not symmetric, such as that of a journal bearing."""
    cached = model.cache.get("full bushings")
    if cached is None or cached[0] != model.structure_version:
        full = [(e.name, n) for e in model.elements for n in ("k", "c") if e.shapes.get(n) == (6, 6)]
        cached = model.cache["full bushings"] = (model.structure_version, full)
    values = (model.value(f"{element}.{n}") for element, n in cached[1] if n == name)
    return any(not np.array_equal(k, k.T) for k in values)


def second_order_of(m: Any, at: Any, without: Sequence[str]) -> Linearization:
    """What modes, transfer functions and responses work on: a linearisation, given or made."""
    if isinstance(m, Linearization):
        if at is not None or tuple(without):
            raise ModelError("at= and without= belong to the call of mb.linearize that made this linearisation")
        return m
    if isinstance(at, Linearization) and not without and at.model is m:
        return at
    return linearize(m, at=at, without=without)
