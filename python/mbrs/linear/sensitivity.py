"""Derivatives of linear results by any design parameter: one entry, `mb.sensitivity`, for every kind of result."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, Self, TypeVar, overload

import numpy as np

from .._lib.border import core_errors
from .._lib.rotations import quaternion_matrix, skew
from .._lib.text import without_rounding
from ..errors import ModelError
from ..model.directions import Directions, directions
from ..model.ports import Port, as_port
from ..model.schema import BODY, MARKER
from ..model.tables import tables
from ..results import Result, Stats, derived, quantity, result
from .eigen_sensitivity import EigenSensitivity, eigen_sensitivity
from .frf import FrfResult, FrfSensitivity, frf_sensitivity
from .linear_system import as_list
from .linearization import Linearization
from .modal_result import ModalResult, refuse_sparse_model
from .parts import split
from .response import ResponseResult, ResponseSensitivity, response_sensitivity
from .state_result import StateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class SparseDerivative:
    """Derivatives of a matrix along n_p directions by their entries that are not zero; the parameter axis is last."""

    row: np.ndarray
    column: np.ndarray
    direction: np.ndarray
    value: np.ndarray
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, entries: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], shape: tuple[int, int, int]) -> Self:
        """From what the core returns: rows, columns, directions, values."""
        row, column, direction, value = entries
        return cls(row, column, direction, value, shape)

    def dense(self) -> np.ndarray:
        """(n, n, n_p)."""
        out = np.zeros(self.shape)
        np.add.at(out, (self.row, self.column, self.direction), self.value)
        return out

    def symmetric(self, whole: np.ndarray) -> SparseDerivative:
        """The symmetric part, but for the directions where ``whole`` (n_p,); entries may then stand twice and add up."""
        half = ~whole[self.direction]
        return SparseDerivative(
            np.concatenate([self.row, self.column[half]]),
            np.concatenate([self.column, self.row[half]]),
            np.concatenate([self.direction, self.direction[half]]),
            np.concatenate([np.where(half, 0.5, 1.0) * self.value, 0.5 * self.value[half]]),
            self.shape,
        )


@result
class LinearizationSensitivity(Result):
    """Derivatives of a linearisation; the parameter axis is last.

    Attributes
    ----------
    M, C, G, K, N
        (dof, dof, n_p), None where the matrix itself is absent. C, G and N also exist where a parameter makes them: a damper
        of size zero, a single entry of a full bushing, a given velocity.
    T
        (6 n_bodies, dof, n_p), of `mb.sensitivity` of a linearisation.
    position, rotation
        (n_bodies, 3, n_p): how each body's origin moves, m, and how the body turns, world rotation vector, rad, per
        unit
        of the parameter. Zero where the configuration is held.
    coordinate
        (n_tree, n_p) the same in tree coordinates.
    labels, units
        Of the parameters.
    """

    mass: SparseDerivative
    damping: SparseDerivative
    stiffness: SparseDerivative
    T: np.ndarray | None
    position: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    rotation: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    coordinate: np.ndarray
    ground_coupling: np.ndarray | None
    labels: tuple[str, ...]
    units: tuple[str, ...]
    directions: Directions
    linearization: Linearization

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {
        "body": "bodies",
        "parameter": "labels",
        "coordinate": "coordinates",
        "coordinate_": "coordinates",
    }

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.linearization.bodies

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.linearization.coordinates

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dM")
    def M(self) -> np.ndarray:
        """dM/dp."""
        return self.mass.dense()

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dC")
    def C(self) -> np.ndarray | None:
        """dC/dp, the symmetric part of the derivative of the damping; without damping in the model, where a parameter brings it in."""
        symmetric = split(self.damping.dense())[0]
        return symmetric if self.linearization.C is not None or np.any(symmetric) else None

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dG")
    def G(self) -> np.ndarray | None:
        """dG/dp, the skew part of the derivative of the damping."""
        return self._skew(self.damping, self.has_G)

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dK")
    def K(self) -> np.ndarray:
        """dK/dp, the symmetric part of the derivative of the stiffness."""
        return split(self.stiffness.dense())[0]

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dN")
    def N(self) -> np.ndarray | None:
        """dN/dp, the skew part of the derivative of the stiffness."""
        return self._skew(self.stiffness, self.has_N)

    @staticmethod
    def _skew(of: SparseDerivative, has: np.ndarray) -> np.ndarray | None:
        return split(of.dense())[1] * has if np.any(has) else None

    @cached_property
    def has_G(self) -> np.ndarray:
        """(n_p,) bool: parameters whose dG counts; without G in the model, those that bring one in."""
        lin, along = self.linearization, self.directions
        if lin.G is not None:
            return np.ones(along.n, dtype=bool)
        moving = (BODY.block.slice("velocity"), BODY.block.slice("angular_velocity"))
        velocities = [
            int(s) + i for s in tables(lin.model)["body_x"] for part in moving for i in range(part.start, part.stop)
        ]
        return np.asarray(_cross_couples(lin.model, along, "c") | _touches(along, velocities))

    @cached_property
    def has_N(self) -> np.ndarray:
        """(n_p,) bool: parameters whose dN counts; without N in the model, those that bring one in."""
        lin, along = self.linearization, self.directions
        return np.ones(along.n, dtype=bool) if lin.N is not None else _cross_couples(lin.model, along, "k")

    @property
    def D(self) -> np.ndarray | None:
        """C + G."""
        parts = [a for a in (self.C, self.G) if a is not None]
        return sum(parts[1:], parts[0]) if parts else None

    @property
    def S(self) -> np.ndarray:
        """K + N."""
        return self.K if self.N is None else self.K + self.N

    def heading(self) -> str:
        return f"derivatives of {self.linearization.model.name!r}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest entries by each parameter."""
        sizes = [
            np.abs(a).reshape(-1, len(self.labels)).max(axis=0, initial=0.0) for a in (self.M, self.K, self.position)
        ]
        rows = [[*line] for line in zip(self.labels, self.units, *(s.tolist() for s in sizes), strict=True)]
        return ["parameter", "unit", "max |dM|", "max |dK|", "max |dx| [m]"], rows

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Largest entries of dM and dK by each parameter, each over the largest of its matrix; returns the figure."""
        from ..plot.derivatives import linearization_sensitivity

        return linearization_sensitivity(self, ax=ax)


@result
class EquilibriumSensitivity(Result):
    """Derivatives of an equilibrium or a steady motion: ``position`` and ``rotation`` (n_bodies, 3, n_p), world; ``coordinate`` (n_tree,
    n_p).
    """

    position: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    rotation: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    coordinate: np.ndarray
    bodies: tuple[str, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"body": "bodies", "parameter": "labels"}

    def heading(self) -> str:
        return "equilibrium per unit of each parameter"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: how each body moves by each parameter."""
        rows: list[list[Any]] = []
        for p, (label, unit) in enumerate(zip(self.labels, self.units, strict=True)):
            numbers = without_rounding(np.hstack([self.position[..., p], self.rotation[..., p]]))
            rows += [[body, label, unit, *line] for body, line in zip(self.bodies, numbers.tolist(), strict=True)]
        return ["body", "parameter", "unit", "dx", "dy", "dz", "drx", "dry", "drz"], rows

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Displacement of each body by each parameter, as bars; returns the figure."""
        from ..plot.derivatives import equilibrium_sensitivity

        return equilibrium_sensitivity(self, ax=ax)


Follow = Literal["follow", "hold"]
_Derivatives = TypeVar("_Derivatives", covariant=True)


class _HasSensitivity(Protocol[_Derivatives]):
    """A result that differentiates itself, as that of `mb.gradient`."""

    def sensitivity(self, parameters: str | Sequence[str]) -> _Derivatives:
        """Its derivatives by the parameters."""


@overload
def sensitivity(
    result: ModalResult, parameters: str | Sequence[str], *, equilibrium: Follow = ...
) -> EigenSensitivity: ...
@overload
def sensitivity(result: FrfResult, parameters: str | Sequence[str], *, equilibrium: Follow = ...) -> FrfSensitivity: ...
@overload
def sensitivity(
    result: ResponseResult, parameters: str | Sequence[str], *, equilibrium: Follow = ...
) -> ResponseSensitivity: ...
@overload
def sensitivity(
    result: StateResult, parameters: str | Sequence[str], *, equilibrium: Follow = ...
) -> EquilibriumSensitivity: ...
@overload
def sensitivity(
    result: Linearization, parameters: str | Sequence[str], *, equilibrium: Follow = ...
) -> LinearizationSensitivity: ...
@overload
def sensitivity(
    result: _HasSensitivity[_Derivatives], parameters: str | Sequence[str], *, equilibrium: Follow = ...
) -> _Derivatives: ...
def sensitivity(result: Any, parameters: str | Sequence[str], *, equilibrium: Follow = "follow") -> Any:
    """Exact derivatives of a result by design parameters.

    Parameters
    ----------
    result
        Of `mb.modes`, `mb.frf`, `mb.response`, `mb.equilibrium`, `mb.steady_motion` or `mb.linearize`, computed from a
        model.
    parameters
        Addresses such as "k_leg", "payload.mass", "leg0.at_b[2]", "hinge.axis" (three columns).
    equilibrium
        "follow": a result computed at an equilibrium or in a steady motion is differentiated with it moving along, the
        speeds staying as they are; "hold": the configuration stays as it is (but for what closing the loops needs). At
        other states both mean hold: of a moving loop the rates of the independent coordinates are held.

    Returns
    -------
    EigenSensitivity, FrfSensitivity, ResponseSensitivity, EquilibriumSensitivity or LinearizationSensitivity
        The parameter axis is last; one array parameter alone keeps its shape there.

    Raises
    ------
    NotDifferentiableError
        A parameter that breaks a redundant loop open.
    NameNotFoundError
        An unknown address.
    ModelError
        A model that was changed since, or a result without derivatives.

    Notes
    -----
    Equations: docs/theory.md (9.1) to (9.9).
    One pass of dual numbers through the linearisation per parameter; no differences.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("one"); k = m.parameter("k", 100.0)
    >>> p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    >>> rail = m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=k)
    >>> mb.sensitivity(mb.modes(m), "k").eigenvalue.round(9)   # d(i sqrt k)/dk = i / 20
    array([[0.+0.05j]])
    """
    if equilibrium not in ("follow", "hold"):
        raise ModelError(f"equilibrium= must be 'follow' or 'hold', got {equilibrium!r}")
    follow = equilibrium == "follow"
    if isinstance(result, Linearization):
        return _of_linearization(result, parameters, follow)
    if isinstance(result, StateResult):
        return _of_equilibrium(result, parameters)
    if isinstance(result, ModalResult):
        return _of_modes(result, parameters, follow)
    if isinstance(result, FrfResult | ResponseResult):
        return _of_ports(result, parameters, follow)
    if getattr(result, "answers_sensitivity", False):
        return result.sensitivity(parameters)
    raise ModelError(
        f"a {type(result).__name__} has no sensitivities; give a result of mb.modes, mb.frf, mb.response, mb.equilibrium, "
        "mb.steady_motion or mb.linearize"
    )


def _source(system: Any, what: str) -> Linearization:
    refuse_sparse_model(system, what)
    if not isinstance(system, Linearization):
        raise ModelError(
            f"sensitivities need a {what} computed from a mb.Model; a MechanicalSystem has no parameters "
            "(mb.eigen_sensitivity takes derivatives of its matrices)"
        )
    return system


def _of_linearization(
    lin: Linearization, parameters: str | Sequence[str], follow: bool, maps: bool = True
) -> LinearizationSensitivity:
    from .. import _core

    start = time.perf_counter()
    lin.snapshot.check_current("linearisation")
    if lin.state.turn is not None or np.any(lin.state.acceleration):
        raise ModelError(
            f"a steady motion of {lin.model.name!r} seen in {lin.state.frame} axes has no derivatives with respect to parameters; "
            "take differences of steady motions, or draw the model so that its joints' own axes serve (mb.steady_motion(...).frame)"
        )
    along = directions(lin.model, parameters)
    columns = [along.columns == p for p in range(along.n)]
    sparse = [(along.rows[c].tolist(), along.values[c].tolist()) for c in columns]
    followed = follow and lin.state.kind in ("equilibrium", "steady")
    how = lin.state.kind if followed or lin.state.kind == "drawn" else "hold"
    state = lin.state
    with core_errors():
        r = _core.directions(
            lin.snapshot.system,
            state.q,
            state.rate,
            list(lin.without),
            sparse,
            how,
            maps,
            list(state.driven),
            state.memory.tolist(),
        )
    motion = r["body_motion"].reshape(-1, 6, along.n)
    shape = (lin.n, lin.n, along.n)
    return LinearizationSensitivity(
        mass=SparseDerivative.of(r["dM"], shape),
        damping=SparseDerivative.of(r["dD"], shape),
        stiffness=SparseDerivative.of(r["dS"], shape),
        T=r.get("dT"),
        position=_origin_motion(lin, along, motion),
        rotation=motion[:, 3:],
        coordinate=r["tree_coordinates"],
        ground_coupling=r.get("d_ground_coupling"),
        labels=along.labels,
        units=along.units,
        directions=along,
        linearization=lin,
        stats=Stats(
            time.perf_counter() - start,
            {"directions": along.n},
            lin.effects,
            "follow" if followed else "hold",
        ),
        error=lin.error,
    )


def _cross_couples(model: Any, along: Directions, name: str) -> np.ndarray:
    """(n_p,) bool: directions along which the k or c of a full bushing becomes unsymmetric."""
    out = np.zeros(along.n, dtype=bool)
    places = tables(model)["element_x"]
    for element in model.elements:
        if element.shapes.get(name) == (6, 6):
            start = int(places[element.index]) + element.table.block.place(name)
            d = _slice(along, start, 36).reshape(6, 6, -1)
            out |= np.any(d != d.transpose(1, 0, 2), axis=(0, 1))
    return out


def _touches(along: Directions, places: Sequence[int]) -> np.ndarray:
    """(n_p,) bool: directions with a part in some of the places of x."""
    out = np.zeros(along.n, dtype=bool)
    out[along.columns[np.isin(along.rows, places)]] = True
    return out


def _origin_motion(lin: Linearization, along: Directions, motion: np.ndarray) -> np.ndarray:
    """Motion of origins from that of centres of mass: p = c - R com."""
    t = lin.snapshot.tables
    places = np.asarray(t["body_x"], dtype=int)[:, None] + np.r_[BODY.block.slice("com")]
    rotation = np.asarray(lin.poses["rotation"])
    com, change = np.asarray(t["x"])[places], np.zeros((places.size, along.n))
    # which number of which centre of mass a row of dx/dp is, if any
    number = np.full(len(t["x"]), -1)
    number[places.ravel()] = np.arange(places.size)
    at = number[along.rows]
    np.add.at(change, (at[at >= 0], along.columns[at >= 0]), along.values[at >= 0])
    arm = np.einsum("bij,bj->bi", rotation, com)
    turned = np.cross(motion[:, 3:], arm[:, :, None], axis=1)
    return np.asarray(
        motion[:, :3] - turned - np.einsum("bij,bjp->bip", rotation, change.reshape(*places.shape, along.n))
    )


def _slice(along: Directions, start: int, n: int) -> np.ndarray:
    """Rows start ... start + n of dx/dp, dense (n, n_p)."""
    out = np.zeros((n, along.n))
    inside = (along.rows >= start) & (along.rows < start + n)
    np.add.at(out, (along.rows[inside] - start, along.columns[inside]), along.values[inside])
    return out


def _of_equilibrium(result: Any, parameters: str | Sequence[str]) -> EquilibriumSensitivity:
    d = _of_linearization(result.linearization, parameters, follow=True, maps=False)
    shaped = d.directions.shaped
    return EquilibriumSensitivity(
        position=shaped(d.position),
        rotation=shaped(d.rotation),
        coordinate=shaped(d.coordinate),
        bodies=result.bodies,
        labels=d.labels,
        units=d.units,
        stats=d.stats,
        error=result.error,
    )


def _of_modes(result: Any, parameters: str | Sequence[str], follow: bool) -> Any:
    lin = _source(result.system, "modal result")
    d = _of_linearization(lin, parameters, follow, maps=False)
    # at rest damping, and without followers stiffness, is symmetric: what is not is left by unbalanced moments
    dD, dS = d.damping.symmetric(d.has_G), d.stiffness.symmetric(d.has_N)
    shapes = [d.directions.shape] if len(d.directions.shape) > 1 else None
    changes: tuple[Any, Any, Any] = (d.mass, dD, dS)
    return eigen_sensitivity(result, *changes, parameters=d.labels, units=d.units, shapes=shapes)


def _of_ports(result: Any, parameters: str | Sequence[str], follow: bool) -> Any:
    if result.linear is None or result.origin is None:
        raise ModelError(
            "this result was made without its model; only results of mb.frf and mb.response have derivatives"
        )
    lin = _source(result.linear.source, "result")
    d = _of_linearization(lin, parameters, follow)
    # as they were given: the name of a port along a vector does not tell all its digits
    inputs = [as_port(lin.model, p) for p in as_list(result.origin.inputs)]
    outputs = [as_port(lin.model, p) for p in as_list(result.origin.outputs)]
    tilts = [_tilt_change(d, inputs[j]) for j in result.linear.shared]
    direct = _direct_change(d, outputs, inputs)
    if direct is not None and tilts:
        direct = np.concatenate([direct, np.zeros((len(outputs), len(tilts), d.directions.n))], axis=1)
    maps = {
        "dF": np.stack([*(_input_change(d, port) for port in inputs), *tilts], axis=1),
        "dL": np.stack([_row_change(d, port) for port in outputs]),
        "dD0": direct,
    }
    matrices = {"dM": d.M, "dD": d.D, "dS": d.S}
    if type(result).__name__ == "FrfResult":
        made: Any = frf_sensitivity(result.linear, result.omega, d.labels, kind=result.kind, **matrices, **maps)
    else:
        made = response_sensitivity(result, d.labels, **matrices, **maps)
    return replace(made, value=d.directions.shaped(made.value))


def _arm_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    """(3, n_p): change of the vector from the body's origin to the port's point, world axes."""
    lin = d.linearization
    t, along = tables(lin.model), d.directions
    body = lin.snapshot.frame(port.body)
    # a node keeps its place in its body, of which it is enough to know how that was drawn
    start = t["body_x"][lin.snapshot.tables["owner"][body] if body >= len(t["body_x"]) else body]
    world = np.zeros((3, along.n))
    point = port.point
    if port.marker is not None and point is None:
        at = t["marker_x"][lin.model.marker_index[port.marker]]
        at += MARKER.block.place("at")
        point = tuple(t["x"][at : at + 3])
        world = _slice(along, at, 3)
    if point is None:
        return np.zeros((3, along.n))
    q = t["x"][start:][BODY.block.slice("orientation")]
    drawn = quaternion_matrix(q)
    local = world - _slice(along, start + BODY.block.place("at"), 3)
    turn = _rotation_rate(q, _slice(along, start + BODY.block.place("orientation"), 4))
    local = drawn.T @ (local - np.cross(turn.T, np.asarray(point) - t["x"][start:][BODY.block.slice("at")]).T)
    arm = lin.port_arm(port)
    return np.asarray(np.cross(d.rotation[body].T, arm).T + lin.poses["rotation"][body] @ local)


def _rotation_rate(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """World rotation vectors (3, n_p) of changes (4, n_p) of a quaternion: the vector part of 2 dq q* / |q|^2."""
    w, v = q[0], q[1:]
    return np.asarray(2.0 * (w * dq[1:] - np.outer(v, dq[0]) - np.cross(dq[1:].T, v).T) / (q @ q))


def _row_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    """(dof, n_p): change of the row of a port's motion."""
    lin = d.linearization
    if port.body == "ground":
        return np.zeros((lin.n, d.directions.n))
    body = lin.snapshot.frame(port.body)
    assert d.T is not None
    block = slice(6 * body, 6 * body + 6)
    direction = np.asarray(port.direction)
    turning = d.T[block][3:]
    if port.is_rotation:
        return np.asarray(np.einsum("i,ijp->jp", direction, turning))
    arm, darm = lin.port_arm(port), _arm_change(d, port)
    moved = d.T[block][:3] - np.einsum("ik,kjp->ijp", skew(arm), turning)
    moved -= np.stack([skew(darm[:, p]) @ lin.T[block][3:] for p in range(d.directions.n)], axis=2)
    return np.asarray(np.einsum("i,ijp->jp", direction, moved))


def _input_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    if port.kind != "base":
        return _row_change(d, port)
    assert d.ground_coupling is not None
    return np.asarray(-np.einsum("ikp,k->ip", d.ground_coupling, d.linearization._rigid(port)))


def _tilt_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    """(dof, n_p): change of the force per angle of ground that turns under gravity."""
    assert d.ground_coupling is not None
    model, lin = d.linearization.model, d.linearization
    assert model.gravity is not None
    change = _slice(d.directions, int(tables(model)["gravity_x"][0]), 3)
    moved = np.cross(change.T, port.direction).T
    return np.asarray(
        np.einsum("ikp,k->ip", d.ground_coupling[:, :3], np.cross(model.gravity, port.direction))
        + (lin.ground_coupling[:, :3] @ moved)
    )


def _direct_change(d: LinearizationSensitivity, outputs: Sequence[Port], inputs: Sequence[Port]) -> np.ndarray | None:
    """(n_out, n_in, n_p): only turning ground moves points by where they are."""
    lin = d.linearization
    out = np.zeros((len(outputs), len(inputs), d.directions.n))
    for j, source in enumerate(inputs):
        if source.kind != "base" or not source.is_rotation:
            continue
        for i, port in enumerate(outputs):
            if port.is_rotation or port.body == "ground":
                continue
            body = lin.snapshot.frame(port.body)
            moved = d.position[body] + _arm_change(d, port)
            out[i, j] = np.asarray(port.direction) @ np.cross(np.asarray(source.direction), moved.T).T
    return out if np.any(out) else None
