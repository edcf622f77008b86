"""The result of `mb.simulate`: what moved, how, and how accurately it is known."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import real_array, real_number
from .._lib.rotations import quaternion_matrix
from .._lib.text import counted
from ..errors import ModelError
from ..model.names import index
from ..model.schema import BODY, JOINTS, MARKER
from ..model.tables import modal_part, modal_places
from ..results import Result, result
from ..system.snapshot import Snapshot
from ..system.state import State
from . import elements
from .air import AirMotion
from .air_march import Wakes
from .energy import Energy
from .quantities import Names
from .tangent import RHO, Kink, Run, Stretch, quantity_derivative

if TYPE_CHECKING:
    from pathlib import Path

    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .._lib.vetter import Derivative
    from ..model.aliases import BodyLike, ItemLike, Items, Vector3
    from ..model.model import Model
    from ..view.modes import Viewer
    from ..view.motion import MotionPage


# Part of a motion by which a time may miss the output that it names. Larger: a neighbour is taken. Smaller: sums like 0.1 + 0.2 miss.
_SAME_TIME = 1e-9


def _squeezed(values: np.ndarray) -> np.ndarray:
    return values[:, 0] if values.shape[1] == 1 else values


@result
class Trajectory(AirMotion, Result):
    """A motion in time.

    Attributes
    ----------
    t
        (n_t,) s.
    q, rate, memory
        (n_t, n_q), (n_t, n_tree), (n_t, n_memory): the states as the core holds them; `state` makes one of them.
    acceleration, multipliers
        (n_t, n_tree), (n_t, n_rows): of the tree coordinates, and of the rows of the joints that close loops.
    steps, local_error
        Times of all accepted steps, and the estimated local error of each over its tolerance (empty for fixed steps).
    orders
        Of every accepted step of "bdf": 0 of steps by another method, with which fixed ones start, and -1 of one that begins at order
        one from rates. Zeros for other methods.
    error
        Estimated error: the largest |dx|/(characteristic length) and angle of rotation of any body at up to 50 of the outputs,
        from a second run, tighter where the order of the method is high, else looser, or from two with longer fixed steps (made when
        first asked for).
    status
        "finished", "interrupted" (Ctrl-C) or "stopped" (a step that could not be made; `message` says why).
    """

    t: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    memory: np.ndarray
    acceleration: np.ndarray
    multipliers: np.ndarray
    joints: np.ndarray
    steps: np.ndarray
    local_error: np.ndarray
    method: str
    message: str
    snapshot: Snapshot
    without: tuple[str, ...]
    parameters: str | Sequence[str] = ()
    start: State | None = None
    rho: float | None = None
    wake: Wakes | None = None
    orders: Sequence[int] = ()
    # of a motion with parameters by a tolerance: stretches between kinks of laws, and kinks at which no step ended
    smooth: Sequence[Stretch] = ()
    missed: Sequence[Kink] = ()

    row: ClassVar[str] = "time"

    def __len__(self) -> int:
        return len(self.t)

    @property
    def model(self) -> Model:
        """The model this belongs to."""
        return self.snapshot.model

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(self.snapshot.tables["body_name"])

    @property
    def _instants(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        return self.t, self.q, self.rate, self.memory, self.acceleration

    @cached_property
    def _quantities(self) -> dict[str, Any]:
        with core_errors():
            return _core.motion_quantities(self.snapshot.system, *self._instants, list(self.without))

    def _body(self, body: BodyLike) -> int:
        return index("no body", body, self.bodies)

    def position(self, body: BodyLike) -> np.ndarray:
        """(n_t, 3) world position of a body's origin, m."""
        return np.asarray(self._quantities["position"][:, self._body(body)])

    def velocity(self, body: BodyLike) -> np.ndarray:
        """(n_t, 3) world velocity of a body's origin, m/s."""
        return np.asarray(self._quantities["velocity"][:, self._body(body)])

    def orientation(self, body: BodyLike) -> np.ndarray:
        """(n_t, 4) unit quaternion of a body, scalar first, body to world; its sign is continuous in time."""
        q = self._quantities["orientation"][:, self._body(body)]
        flips = np.sum(q[1:] * q[:-1], axis=1) < 0.0
        sign = np.concatenate([[1.0], np.where(np.cumsum(flips) % 2, -1.0, 1.0)]) if len(q) else np.zeros(0)
        return np.asarray(q * sign[:, None])

    def angular_velocity(self, body: BodyLike) -> np.ndarray:
        """(n_t, 3) angular velocity of a body, rad/s, world axes."""
        return np.asarray(self._quantities["angular_velocity"][:, self._body(body)])

    def rotation(self, body: BodyLike) -> np.ndarray:
        """(n_t, 3, 3) rotation matrix of a body, body to world."""
        return quaternion_matrix(self._quantities["orientation"][:, self._body(body)])

    def point(self, marker: ItemLike | Vector3, *, of: BodyLike | None = None) -> np.ndarray:
        """(n_t, 3) world position of a marker (by name), or of a drawn world point ``marker`` (3,) fixed in body ``of``."""
        t = self.snapshot.tables
        x = t["x"]
        if of is None:
            i = index("no marker", marker, t["marker_name"])
            body, start = int(t["marker_body"][i]), int(t["marker_x"][i])
            drawn = x[start:][MARKER.block.slice("at")]
        else:
            body = self._body(of)
            drawn = real_array("a point fixed in a body", marker, (3,), "give three coordinates in m")
        if body < 0:
            return np.broadcast_to(drawn, (len(self.t), 3)).copy()
        start = int(t["body_x"][body])
        body_numbers = x[start:]
        turned = quaternion_matrix(body_numbers[BODY.block.slice("orientation")])
        local = turned.T @ (drawn - body_numbers[BODY.block.slice("at")])
        name = self.bodies[body]
        return np.asarray(self.position(name) + self.rotation(name) @ local)

    def modal(self, body: BodyLike) -> np.ndarray:
        """(n_t, m) modal coordinates of a flexible body."""
        return self._modal(body)[1][0]

    def modal_rate(self, body: BodyLike) -> np.ndarray:
        """(n_t, m) rates of the modal coordinates of a flexible body."""
        return self._modal(body)[1][1]

    @property
    def flexible(self) -> list[str]:
        """Names of the flexible bodies that have modal coordinates in this motion."""
        return [self.bodies[body] for body, _ in modal_places(self.snapshot.tables)]

    def _modal(self, body: Any) -> tuple[Any, tuple[np.ndarray, np.ndarray]]:
        index = self._body(body)
        owner = self.model.bodies[index] if index < len(self.model.bodies) else None
        tables = self.snapshot.tables
        for number, own in modal_places(tables):
            if number == index:
                return owner, (modal_part(tables, self.q)[:, own], modal_part(tables, self.rate)[:, own])
        raise ModelError(f"{self.bodies[index]!r} has no modal coordinates in this motion: it is rigid there")

    def node_positions(self, body: BodyLike) -> np.ndarray:
        """(n_t, n, 3) world positions of all nodes of a flexible body, in their order, deformed."""
        owner, (q, _) = self._modal(body)
        local = owner.modal.places(q)
        moved: np.ndarray = self.position(body)[:, None] + np.einsum("tij,tnj->tni", self.rotation(body), local)
        return moved

    def joint(self, name: ItemLike) -> np.ndarray:
        """Free coordinates of a joint: (n_t,) where it has one, else (n_t, n); rad and m, angles continuous over turns."""
        places = self._joint_places
        start, n = list(places.values())[index("no joint with free coordinates", name, list(places))]
        return self.joints[:, start] if n == 1 else self.joints[:, start : start + n]

    def joint_rate(self, name: ItemLike) -> np.ndarray:
        """Rates of the free coordinates of a joint, in the shape of `joint`; of rotation vectors the rates of their numbers."""
        return _squeezed(elements.joint_rates(self, name))

    def length(self, name: ItemLike) -> np.ndarray:
        """(n_t,) distance of the end points of a spring-damper, m."""
        found = elements.element_motion(self, name)
        if found.type != "spring_damper":
            raise ModelError(f"{getattr(name, 'name', name)!r} is not a spring_damper; see deformation")
        return found.coordinate[:, 0]

    def deformation(self, name: ItemLike) -> np.ndarray:
        """e of f = preload + k e + c e': (n_t,) of a spring-damper (m) or torsion spring (rad; it follows hinges over turns), (n_t, 6) of
        a bushing, frame of its first body.
        """
        return _squeezed(elements.element_motion(self, name).displacement)

    def deformation_rate(self, name: ItemLike) -> np.ndarray:
        """The rate e' of `deformation`."""
        return _squeezed(elements.element_motion(self, name).rate)

    def element_force(self, name: ItemLike) -> np.ndarray:
        """preload + k e + c e' + laws of a spring-damper (N, positive in tension), bushing or torsion spring, in the shape of
        `deformation`; the moments of a bushing belong to the rates of its rotation vector. Laws with internal states have those of the
        motion.
        """
        return _squeezed(elements.element_motion(self, name).force)

    @cached_property
    def _joint_places(self) -> dict[str, tuple[int, int]]:
        out, start = {}, 0
        for name, kind in zip(self.snapshot.tables["joint_name"], self.snapshot.tables["joint_type"], strict=True):
            n = _FREE[int(kind)]
            if n:
                out[name] = (start, n)
            start += n
        return out

    @cached_property
    def energy(self) -> Energy:
        """Energies (J) and powers (W); ``traj.energy`` itself acts as the (n_t,) total."""
        q = self._quantities
        stored: dict[str, np.ndarray] = {}
        power: dict[str, np.ndarray] = {}
        for k, name in enumerate(q["elements"]):
            if not np.any(np.isnan(q["stored"][:, k])):
                stored[name] = q["stored"][:, k]
            power[name] = q["power"][:, k]
        total = q["kinetic"] + q["gravity"] + sum(stored.values(), np.zeros(len(self.t)))
        return Energy(np.asarray(self.t), total, q["kinetic"], q["gravity"], stored, power)

    def sensitivity(self, what: str) -> Derivative:
        """The exact derivative of a quantity of the discrete motion by ``parameters=`` of `mb.simulate`, parameter axis last.

        Parameters
        ----------
        what
            "crank.position", "crank.velocity", "crank.acceleration", "crank.rotation" (world rotation vector, rad),
            "crank.angular_velocity", "crank.angular_acceleration"; "P2", "P2.velocity", "P2.acceleration" of a marker; "A"
            (the coordinates of a joint), "A.reaction".

        Returns
        -------
        ndarray
            (n_t, 3, n_p), (n_t, n_p) of a joint with one coordinate; an array parameter keeps its shape, ``.vetter()`` gives
            the block layout.

        Raises
        ------
        ModelError
            A motion without ``parameters=``, or a model that was changed since.
        """
        if self.start is None or not len(self.parameters):
            raise ModelError(
                "this motion has no sensitivities; run mb.simulate(..., parameters=['...']) with method='explicit', 'radau', "
                "'bdf', 'ali3p' or 'generalized-alpha' to get them"
            )
        self.snapshot.check_current("motion")
        rho = RHO if self.rho is None else self.rho
        run = Run(
            self.model,
            self.snapshot,
            self.start,
            self.without,
            self.steps,
            scheme=self.method,
            rho=rho,
            orders=self.orders,
            smooth=self.smooth,
            missed=tuple(self.missed),
        )
        return quantity_derivative(run, self.parameters, what, self.t)

    @property
    def residual(self) -> np.ndarray:
        """(n_t, 3): constraint residuals at position, velocity and acceleration level.

        Over the characteristic length, and over that times w and w^2, w the largest speed of a body over the characteristic
        length, its largest angular velocity, or one over the time of the whole motion if they are smaller.
        """
        w = self._pace
        left: np.ndarray = self._quantities["residual"] / [1.0, w, w * w]
        return left

    @cached_property
    def _pace(self) -> float:
        length = self.snapshot.system.characteristic_length
        linear, angular = (np.linalg.norm(self._quantities[k], axis=-1) for k in ("velocity", "angular_velocity"))
        fastest = max(float(linear.max(initial=0.0)) / length, float(angular.max(initial=0.0)))
        span = float(np.ptp(self.t)) if len(self.t) else 0.0
        return max(fastest, 1.0 / span if span > 0.0 else 0.0) or 1.0

    def state(self, t: float | int | None = None) -> State:
        """The state at an output time (the last one without ``t``), to be given as ``at=`` to any analysis.

        Raises
        ------
        ModelError
            A time that is not an output time.
        """
        i = len(self.t) - 1 if t is None else self._output(t)
        return State(self.q[i], self.rate[i], "given", self.memory[i], float(self.t[i]), air=self._going(i))

    def reaction(self, name: ItemLike) -> np.ndarray:
        """(n_t, 6) wrench of a joint's constraints on its second body at its point: force (N) and moment (N m), world axes.

        What the joint's own k=, c= and law= do along its free coordinates is not in it, nor the force of a drive, which
        has its own by the drive's name. A rolling disc's point is the centre of the disc.
        Where constraints are redundant these are the reactions of minimum norm over all joints, moments divided by the
        characteristic length.
        """
        return self._reactions[:, index("no joint", name, self._constrained)]

    def drive_force(self, name: ItemLike) -> np.ndarray:
        """(n_t,) force (N) or torque (N m) that a drive or coupler exerts along its coordinate, of a coupler the second one."""
        known = [*self.snapshot.tables["drive_name"], *self.snapshot.tables["coupler_name"]]
        rows = list(self.snapshot.system.topology()["row_joint"])
        return -self.multipliers[:, rows.index(known[index("no drive or coupler", name, known)])]

    def constraint_force(self, name: ItemLike) -> np.ndarray:
        """(n_t, r) forces of the r rows of a constraint that is a function: -lam. Motion k feels their sum times dPhi/du_k, or D_k."""
        known = self.snapshot.tables.get("constraint_name", [])
        rows = np.array(self.snapshot.system.topology()["row_joint"])
        return -self.multipliers[:, rows == known[index("no constraint", name, known)]]

    @property
    def reactions(self) -> dict[str, np.ndarray]:
        """`reaction` of every joint and drive by name."""
        return {name: self._reactions[:, i] for i, name in enumerate(self._constrained)}

    @property
    def _constrained(self) -> list[str]:
        """Names of joints and drives, in the order of their reactions."""
        return [*self.snapshot.tables["joint_name"], *self.snapshot.tables["drive_name"]]

    @cached_property
    def _reactions(self) -> np.ndarray:
        with core_errors():
            return _core.motion_reactions(self.snapshot.system, *self._instants, self.multipliers, list(self.without))

    @property
    def poses(self) -> dict[str, np.ndarray]:
        """Position (n_t, n_b, 3), orientation (n_t, n_b, 4), velocity and angular velocity (n_t, n_b, 3), world."""
        return {k: self._quantities[k] for k in ("position", "orientation", "velocity", "angular_velocity")}

    @property
    def parameter_labels(self) -> list[str]:
        """Names of the columns of `sensitivity`, one for each number of a parameter."""
        from ..model.directions import directions

        return list(directions(self.snapshot.model, self.parameters).labels)

    @property
    def parameter_units(self) -> list[str]:
        """Their units, "" where unknown (see `mbrs.model.directions.directions`)."""
        from ..model.directions import directions

        return list(directions(self.snapshot.model, self.parameters).units)

    def unit_of(self, what: str) -> str:
        """The unit of a quantity named as in `sensitivity`; empty where its components differ."""
        names = Names(self.snapshot.tables)
        return names.unit(names.address(what))

    def component_names(self, what: str) -> list[str]:
        """Names of the numbers of a quantity: x y z, rx ry rz after them of a wrench, a joint's own coordinates."""
        names = Names(self.snapshot.tables)
        return names.components(names.address(what))

    def _output(self, t: Any) -> int:
        """The output at a time."""
        asked = real_number("t", t, give="name an output time, one of traj.t")
        i = int(np.argmin(np.abs(self.t - asked)))
        if abs(self.t[i] - asked) > _SAME_TIME * max(self.t[-1] - self.t[0], abs(asked)):
            raise ModelError(f"t = {t} is not an output time; the nearest is {self.t[i]:.9g}: name times with t=[...]")
        return i

    def sensitivity_table(self, what: str, t: float | None = None) -> str:
        """`sensitivity` at an output time (the last one without ``t``), and its largest absolute value, as a table."""
        from .._lib.text import table, unit_note

        at = len(self.t) - 1 if t is None else self._output(t)
        labels = self.parameter_labels
        d = np.asarray(self.sensitivity(what)).reshape(len(self.t), -1, len(labels))
        names = ["derivative"] if d.shape[1] == 1 else [f"{what} {axis}" for axis in self.component_names(what)]
        rows = [
            (label, unit, *d[at, :, p], np.abs(d[:, :, p]).max())
            for p, (label, unit) in enumerate(zip(labels, self.parameter_units, strict=True))
        ]
        unit = f" [{self.unit_of(what)} per unit of the parameter]" if self.unit_of(what) else ""
        title = f"derivatives of {what}{unit} at t = {self.t[at]:.6g} s"
        footer = unit_note(labels, self.parameter_units)
        return table(["parameter", "unit", *names, "largest ever"], rows, title=title, footer=footer)

    def plot(
        self, what: str = "motion", *, of: Items = None, ax: Axes | None = None, label: str | None = None
    ) -> Figure:
        """Curves over time; returns the figure.

        Parameters
        ----------
        what
            "motion": coordinates, energy, constraints and steps below each other. One of them alone: "coordinates" (of joints),
            "positions" (m), "velocities" (m/s), "energy" (J), "power" (W into each element), "residual" (of constraints, scaled, on
            three levels), "steps" (s), "error" (of each step over its tolerance), "reactions" (N), "sensitivity".
        ax
            Axes into which the first of these goes alone.
        of
            Names or handles of joints, bodies, markers or elements, by default those that move most. Of "sensitivity" the
            quantity, as in `sensitivity`.
        label
            Of this motion among several.
        """
        if what == "sensitivity":
            from ..plot import gradients

            return gradients.over_time(self, of, ax=ax)
        from ..plot import motion

        return motion.plot(self, what, of=of, ax=ax, label=label)

    def animate(self, path: str | Path | None = None, **options: Unpack[MotionPage]) -> Path | Viewer:
        """The motion as one self-contained page that plays; written to ``path`` if that is given.

        ``options``: ``pace`` (seconds of motion in a second of playing), ``at`` (s, paused there), ``paths`` (markers and bodies whose
        way is drawn), ``follow`` (a body that the view follows), ``title``.
        """
        from ..view import motion

        return motion.motion(self, path, **options)

    def labelled(self) -> dict[str, tuple[tuple[str, ...], Any, str, str]]:
        """Poses and velocities of the bodies, joint coordinates, reactions, forces of drives, energies (nan where an element
        has no potential) and powers of the elements, residuals.
        """
        q = self._quantities
        out: dict[str, tuple[tuple[str, ...], Any, str, str]] = {}
        units = {"position": "m", "orientation": "1", "velocity": "m/s", "angular_velocity": "rad/s"}
        for name, unit in units.items():
            last = "quaternion" if name == "orientation" else "axis"
            out[name] = (("time", "body", last), q[name], unit, name.replace("_", " "))
        out |= {
            n: (("time",), v, "J", f"{n} energy") for n, v in (("kinetic", q["kinetic"]), ("gravity", q["gravity"]))
        }
        out["energy"] = (("time",), self.energy.total, "J", "total energy")
        out["residual"] = (("time", "level"), self.residual, "1", "residual of the constraints")
        for name in self._joint_places:
            v = self.joint(name)
            dims = ("time",) if v.ndim == 1 else ("time", f"{name}_")
            out[f"joint {name}"] = (dims, v, "", f"coordinate of {name}")
        for name in self.flexible:
            out[f"modal {name}"] = (("time", f"mode of {name}"), self.modal(name), "", f"modal coordinates of {name}")
        for name, (dims, v) in self._labelled_forces().items():
            out[name] = (dims, v, {"power": "W", "stored": "J"}.get(name, ""), name)
        return out

    def labels_of(self, dimension: str) -> Sequence[object] | np.ndarray | None:
        known: dict[str, Any] = {"time": self.t, "body": self.bodies, **self._labels()}
        return known.get(dimension, super().labels_of(dimension))

    def attributes(self) -> dict[str, Any]:
        computed = {} if callable(self.__dict__["error"]) or self.error is None else {"error": self.error}
        return {
            "result": "Trajectory",
            "status": self.status,
            "method": self.method,
            "model": self.model.name,
            **computed,
        }

    def to_xarray(self, sensitivity: Sequence[str] = ()) -> xarray.Dataset:
        """`xarray.Dataset` over time.

        ``sensitivity`` names quantities as in `sensitivity`: their derivatives come along as "d crank.position", over
        "parameter".
        """
        data = super().to_xarray()
        for what in [sensitivity] if isinstance(sensitivity, str) else sensitivity:
            names = self.component_names(what)
            d = np.asarray(self.sensitivity(what)).reshape(len(self.t), -1, len(self.parameter_labels))
            own = "axis" if names == ["x", "y", "z"] else f"{what} component"
            data = data.assign_coords({own: names, "parameter": self.parameter_labels})
            data[f"d {what}"] = (("time", own, "parameter"), d)
        return data

    def _labels(self) -> dict[str, list[str]]:
        t = self.snapshot.tables
        labels = {
            "joint": list(t["joint_name"]),
            "element": list(self.energy.power),
            "drive": [*t["drive_name"], *t["coupler_name"]],
        }
        wrench = {"wrench": ["x", "y", "z", "rx", "ry", "rz"]} if labels["joint"] else {}
        return {**{k: v for k, v in labels.items() if v}, **wrench}

    def _labelled_forces(self) -> dict[str, Any]:
        """Reactions, forces of drives and couplers, energies and powers of elements, as far as there are any."""
        labels, energy = self._labels(), self.energy
        out: dict[str, Any] = {}
        if "joint" in labels:
            reactions = np.stack([self.reaction(name) for name in labels["joint"]], axis=1)
            out["reaction"] = (("time", "joint", "wrench"), reactions)
        if "drive" in labels:
            forces = np.stack([self.drive_force(name) for name in labels["drive"]], axis=1)
            out["drive force"] = (("time", "drive"), forces)
        if "element" in labels:
            nothing = np.full(len(self.t), np.nan)
            stored = [energy.stored.get(name, nothing) for name in labels["element"]]
            out["power"] = (("time", "element"), np.stack(list(energy.power.values()), axis=1))
            out["stored"] = (("time", "element"), np.stack(stored, axis=1))
        return out

    def heading(self) -> str:
        span = f"{self.t[0]:.6g} to {self.t[-1]:.6g} s" if len(self.t) else "nothing"
        return f"motion of {self.model.name!r}: {self.status}, {span}, {counted(len(self.t), 'output')}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """No table: `notes` say what there is."""
        return [], []

    def notes(self) -> list[str]:
        n = self.stats.counts
        lines = [
            f"  {self.stats.route}",
            f"  {len(self.steps) - 1} steps, {n.get('rejected steps', 0)} rejected, "
            f"{n.get('force evaluations', 0)} force evaluations, {n.get('tangents', 0)} tangents, "
            f"{self.stats.wall_time:.3g} s",
        ]
        if len(self.t):
            p, v, a = self.residual.max(axis=0)
            lines.append(f"  constraints hold to {p:.1e} (position), {v:.1e} (velocity), {a:.1e} (acceleration)")
        return [*lines, f"  {self.message}"] if self.message else lines


_FREE = {kind.code: len(kind.free) for kind in JOINTS.values()}
