"""Derivatives of linear results by any design parameter: one entry, `mb.sensitivity`, for every kind of result."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, Protocol, TypeVar, overload

import numpy as np

from .._lib.border import core_errors
from .._lib.checks import shown
from ..errors import ModelError
from ..model.directions import Directions, directions
from ..model.ports import as_port
from ..model.schema import BODY
from ..results import Stats
from .eigen_sensitivity import EigenSensitivity, eigen_sensitivity
from .frf import FrfResult, FrfSensitivity, frf_sensitivity
from .linear_system import as_list
from .linearization import Linearization
from .linearization_sensitivity import EquilibriumSensitivity, LinearizationSensitivity, SparseDerivative
from .modal_result import ModalResult, refuse_sparse_model
from .port_sensitivity import map_changes
from .response import ResponseResult, ResponseSensitivity, response_sensitivity
from .state_result import StateResult

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
        raise ModelError(f"equilibrium= must be 'follow' or 'hold', got {shown(equilibrium)}")
    follow = equilibrium == "follow"
    if isinstance(result, Linearization):
        return _of_linearization(result, parameters, follow).with_shape()
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
        parameter_shape=(along.n,),
        stats=Stats(
            time.perf_counter() - start,
            {"directions": along.n},
            lin.effects,
            "follow" if followed else "hold",
        ),
        error=lin.error,
        status=lin.status,
    )


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
        status=result.status,
    )


def _of_modes(result: Any, parameters: str | Sequence[str], follow: bool) -> Any:
    lin = _source(result.system, "modal result")
    d = _of_linearization(lin, parameters, follow, maps=False)
    # at rest damping, and without followers stiffness, is symmetric: what is not is left by unbalanced moments
    dD, dS = d.damping.symmetric(d.has_G), d.stiffness.symmetric(d.has_N)
    labels, shapes = d.labels, None
    if len(d.directions.shape) > 1:
        labels, shapes = (labels[0].rpartition("[")[0],), [d.directions.shape]
    changes: tuple[Any, Any, Any] = (d.mass, dD, dS)
    return eigen_sensitivity(result, *changes, parameters=labels, units=d.units, shapes=shapes)


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
    maps = map_changes(d, inputs, outputs, result.linear.shared)
    matrices = {"dM": d.M, "dD": d.D, "dS": d.S}
    if type(result).__name__ == "FrfResult":
        made: Any = frf_sensitivity(result.linear, result.omega, d.labels, kind=result.kind, **matrices, **maps)
    else:
        made = response_sensitivity(result, d.labels, **matrices, **maps)
    return replace(made, value=d.directions.shaped(made.value))
