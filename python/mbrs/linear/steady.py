"""Steady motion: a state in which some joints turn at constant speed and everything else stays where it is."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import count, real_number, shown
from .._lib.rotations import skew
from .._lib.text import counted, number
from ..errors import ConvergenceError, ModelError, SingularError
from ..model.names import not_found
from ..results import Result, Stats, derived, result
from ..system.effects import check_without
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .blades import constant_frame
from .linearization import Linearization
from .linearize import averaged, linearization_at, matrices_at
from .periodic_turn import BALANCED, RESOLVED, PeriodicTurn
from .spin import Spin, spin_of
from .state_result import StateResult
from .turning_frames import STILL_AIR, Frame, sampled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model
    from ..system.state import StateLike

_MAX_ITERATIONS = 60
_LEAST_AZIMUTHS, _MOST_AZIMUTHS = 5, 999
# Singular values over the largest, free of units, below which rates of loops and the stiffness of the motion have no rank. Larger:
# soft directions are left where they are; smaller: rounding moves what nothing holds.
_NO_RATE, _NO_STIFFNESS = 1e-10, 1e-13
# Changes of a pose (rad, characteristic lengths) and parts of the largest rate that are rounding. Larger: motions keep the error of
# the last step; smaller: iterations repeat themselves.
_ROUNDED = 1e-14
# Mismatch of a loop over the fastest body, 1/s over 1/s, from which on its speeds are not constant. Larger: a loop that tears passes;
# smaller: rounding of drawn points refuses one that holds.
_TORN = 1e-9
_Found = tuple[State, dict[str, Any], int, bool]


@result
class SteadyMotion(StateResult, Result):
    """A steadily turning state; give it as ``at=`` to other analyses.

    Attributes
    ----------
    state
        Poses and rates.
    speed
        rad/s (m/s of sliding coordinates) of each driven coordinate.
    torque
        Torque (or force) required to hold the prescribed speed, N m (N); zero without losses.
    frame
        The axes in which the linearisation is constant, and in which its modes and transfer functions are: "fixed",
        "rotating" (with the rotor), "joint" (each coordinate in the axes of its own joint), or "multiblade" (the hub fixed,
        the blades together; see `mb.multiblade`). In the drawn position the coordinates of all of them are the same.
    carried
        Names of bodies without a joint that elastic elements carry around with what is driven.
    linearization
        The exact linearisation there, in these axes.
    error
        Largest change of a row of M, C + G, K + N over a turn, relative to the row, beyond rounding; at most 1e-8, or ten
        times the model's tolerance. With ``average`` that is what the means leave out, and ``.error`` of `mb.modes` what it does to each.
    status
        "converged", or "unresolved" where the residual is above 1e-9 of the forces at work: stiff parts make such forces of the
        rounding of places. With ``average`` also where it is above 1e-3 between the azimuths: take more of them.
    """

    state: State
    speed: dict[str, float]
    torque: dict[str, float]
    linearization: Linearization
    iterations: int
    frame: str
    carried: tuple[str, ...] = ()

    row: ClassVar[str] = "coordinate"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "driven", "body": "bodies"}
    largest_error: ClassVar[float] = np.inf  # of what means leave out of matrices: the state is judged by its residual

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the driven coordinates."""
        return tuple(self.speed)

    @property
    @derived(dims=("coordinate",), name="speed")
    def _speeds(self) -> np.ndarray:
        return np.array(list(self.speed.values()), dtype=float)

    @property
    @derived(dims=("coordinate",), label="unit of the speed")
    def speed_unit(self) -> np.ndarray:
        """(n,) of the driven coordinates: rad/s, or m/s where they slide."""
        return np.array(["rad/s" if _turns_about_itself(self.model, name) else "m/s" for name in self.speed], dtype=str)

    @property
    @derived(dims=("coordinate",), name="torque")
    def _torques(self) -> np.ndarray:
        return np.array([self.torque[name] for name in self.speed], dtype=float)

    @property
    @derived(dims=("coordinate",), label="unit of the torque")
    def torque_unit(self) -> np.ndarray:
        """(n,) of the driven coordinates: N m, or N where they slide."""
        return np.array(["N m" if _turns_about_itself(self.model, name) else "N" for name in self.speed], dtype=str)

    @property
    @derived(dims=("body", "axis"), unit="m", name="position")
    def _positions(self) -> np.ndarray:
        return np.asarray(self.poses["position"])

    @property
    @derived(dims=("body", "axis"), unit="m/s", name="velocity")
    def _velocities(self) -> np.ndarray:
        return np.asarray(self.poses["velocity"])

    def heading(self) -> str:
        return f"steady motion of {self.model.name!r}: {self.status}, {counted(self.iterations, 'iteration')}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: speed and torque of each driven coordinate."""
        units = zip(self.speed_unit.tolist(), self.torque_unit.tolist(), strict=True)
        rows = [
            [name, number(speed), rate, number(self.torque[name], 4), force]
            for (name, speed), (rate, force) in zip(self.speed.items(), units, strict=True)
        ]
        return ["driven", "speed", "unit", "held by", "unit"], rows

    def notes(self) -> list[str]:
        carried = [f"carried around: {', '.join(self.carried)}"] if self.carried else []
        if self.state.orbit is not None:
            return [f"averaged over {len(self.state.orbit.q) // 2} azimuths of the turn in {self.frame} axes"]
        return [*carried, f"constant in {self.frame} axes"]

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "frame": self.frame}

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The bodies with their velocities as arrows, in the plane in which the motion is widest; returns the figure."""
        from ..plot.models import steady_motion as draw

        return draw(self, ax=ax)


def steady_motion(
    m: Model,
    speed: Mapping[str, float] | None = None,
    *,
    at: StateLike = None,
    without: Sequence[str] = (),
    average: int | None = None,
) -> SteadyMotion:
    """The state in which the named joints turn at constant speed and all forces, inertia included, balance.

    rho(y, v, v') = 0 on all coordinates but the driven ones, v = speed on these. Bodies without a joint that elastic elements tie
    to something that turns (bushings, torsion springs, beams) turn with it; everything else is at rest.

    Parameters
    ----------
    m
        The model.
    speed
        rad/s (m/s for sliding coordinates) by joint, body or coordinate: ``{"shaft": 60.0}``. A joint or body must have one
        rotation; name the coordinate ("rotor.rx") where it has several. Drives add their rates of t = 0, couplers and rolling
        what follows from them; a model whose drives move needs no ``speed``.
    at
        Initial guess: None (drawn), an equilibrium, another steady motion.
    without
        Effects to leave out.
    average
        For rotors of three or more equal blades in sheared or slanting wind, or with weight across the axis: an odd number of azimuths (25
        is usual) of the periodic motion, over which linear analyses average in multiblade coordinates. None refuses such rotors.

    Returns
    -------
    SteadyMotion

    Raises
    ------
    ModelError
        Speeds that closed loops do not allow to be constant. An elastic element whose force would grow with every turn. A
        linearisation that is constant in no axes: an unsymmetric rotor on unsymmetric supports, unbalance, weight across the axis.
        The message names the object.
    ConvergenceError
        No steady state near the initial guess.

    Notes
    -----
    Equations: docs/theory.md (8.1) to (8.3), (8.7).
    Newton on the exact tangent, centrifugal stiffness included. The tangent at five angles of the turn decides about the axes: the
    first of fixed, rotating, joint and multiblade ones in which no row changes by more than (8.3) allows is taken (G. Bir, Multiblade
    coordinate transformation and its application to wind turbine analysis, AIAA 2008-1300).
    Cost O(dof^3) per iteration and angle; with ``average`` O((average dof)^3) per iteration.

    Examples
    --------
    >>> import mbrs as mb
    >>> turning = mb.steady_motion(mb.examples.rotor(), {"shaft": 60.0})
    >>> turning.status, turning.frame
    ('converged', 'fixed')
    """
    start = time.perf_counter()
    without = check_without(without)
    snapshot = Snapshot.of(m, without)
    begin = state_of(m, snapshot.system, at)
    names = snapshot.system.topology()["coordinates"]
    given = {} if speed is None and m.drives and "drives" not in without else _items(speed)
    driven = {_coordinate(m, snapshot.system, names, key): _speed(key, value) for key, value in given.items()}
    rate = _rates(snapshot, begin, driven, without)
    if (m.drives or m.couplers or m.constraints) and np.any(rate):
        driven = {int(i): float(rate[i]) for i in np.flatnonzero(rate)}
    spin = spin_of(snapshot, begin.q, rate, tuple(driven), without)
    if average is not None:
        return _averaged(snapshot, begin, spin, names, driven, without, average, start)
    state, found, iterations, balanced = _solve(snapshot, begin, spin, names, driven, without)
    frame = _frame(snapshot, spin, state, found, without)
    turns = np.any(frame.W)
    state = replace(state, turn=frame.W if turns else None, frame=frame.name)
    linearization = linearization_at(snapshot, state, matrices_at(snapshot, state, without), without, start, warn=False)
    residual = dict(zip(found["coordinates"], found["residual"], strict=True))
    residual.update(_drive_forces(snapshot, found, names, without))
    return SteadyMotion(
        state=state,
        speed={names[i]: value for i, value in driven.items()},
        torque={names[i]: float(residual.get(names[i], np.nan)) for i in driven},
        linearization=linearization,
        iterations=iterations,
        frame=frame.name,
        carried=tuple(name for name, _, _ in spin.carried),
        stats=Stats(time.perf_counter() - start, found["counts"], linearization.stats.effects, "Newton"),
        error=frame.varies,
        status="converged" if balanced else "unresolved",
    )


def _averaged(
    snapshot: Snapshot,
    begin: State,
    spin: Spin,
    names: Sequence[str],
    driven: Mapping[int, float],
    without: tuple[str, ...],
    average: Any,
    start: float,
) -> SteadyMotion:
    """The periodic motion of a rotor, and its matrices averaged over the turn."""
    if count("average", average, _MOST_AZIMUTHS) % 2 == 0 or average < _LEAST_AZIMUTHS:
        raise ModelError(f"average must be an odd number of azimuths from {_LEAST_AZIMUTHS} on, got {average}")
    if not np.any(spin.rate):
        raise ModelError("average= belongs to a rotor that turns; give speed= or a drive")
    held = bool(snapshot.model.drives) and "drives" not in without
    by_name = {names[i]: value for i, value in driven.items()}
    turn = PeriodicTurn(snapshot, spin, begin, tuple(by_name), (*without, "drives") if held else without, average)
    orbit, residual, size, between, iterations, counts = turn.solve()
    state = State(
        orbit.q[0],
        orbit.rate[0],
        "steady",
        driven=tuple(driven),
        acceleration=orbit.acceleration[0],
        turn=None,
        orbit=orbit,
    )
    keep = [name for name in turn.names if not (held and name in by_name)]
    places = [turn.names.index(name) for name in keep]
    state = replace(state, turn=turn.W[np.ix_(places, places)], frame="multiblade", memory=turn.memory(orbit))
    linearization = averaged(snapshot, state, without, start)
    assert linearization.over_turn is not None
    return SteadyMotion(
        state=state,
        speed=by_name,
        torque={name: float(residual[turn.names.index(name)]) for name in by_name},
        linearization=linearization,
        iterations=iterations,
        frame="multiblade",
        stats=Stats(time.perf_counter() - start, counts, linearization.stats.effects, "Newton, all azimuths at once"),
        error=linearization.over_turn.varies,
        status="converged" if size <= BALANCED and between <= RESOLVED else "unresolved",
    )


def _frame(snapshot: Snapshot, spin: Spin, state: State, found: dict[str, Any], without: tuple[str, ...]) -> Frame:
    """The axes in which the linearisation is constant; W over the coordinates of ``found``."""
    names = list(found["coordinates"])
    if not state.moving:
        return Frame("fixed", np.zeros((len(names),) * 2), 0.0)
    # drives hold the angles that are to be turned
    held = snapshot.model.drives and "drives" not in without
    turn = sampled(snapshot, spin, state, (*without, "drives") if held else without)
    frame = constant_frame(turn)
    keep = [turn.names.index(name) for name in names]
    return replace(frame, W=frame.W[np.ix_(keep, keep)])


def _rates(snapshot: Snapshot, begin: State, driven: Mapping[int, float], without: tuple[str, ...]) -> np.ndarray:
    """Rates of the tree coordinates: the given ones, those of drives, what couplers, constraints and rolling make of them; else zero."""
    rate = np.zeros(snapshot.system.n_tree)
    for index, value in driven.items():
        rate[index] = value
    model = snapshot.model
    rolls = "nonholonomic" not in without and any(j.type in ("knife_edge", "rolling_disc") for j in model.joints)
    if not (model.drives or model.couplers or model.constraints or rolls):
        return rate
    with core_errors():
        rows = snapshot.system.rows(begin.q, np.zeros_like(rate), 0.0, list(without))
    held, values = np.eye(len(rate))[list(driven)], list(driven.values())
    found = np.linalg.lstsq(
        np.vstack([rows["jacobian"], held]), np.concatenate([-rows["rates"], values]), rcond=_NO_RATE
    )[0]
    return np.where(np.abs(found) > _ROUNDED * np.max(np.abs(found), initial=0.0), found, 0.0)


def _drive_forces(
    snapshot: Snapshot, found: dict[str, Any], names: Sequence[str], without: tuple[str, ...]
) -> dict[str, float]:
    """Force or torque of each drive of a tree joint, by the coordinate that it moves."""
    model, out = snapshot.model, {}
    rows = list(snapshot.system.topology()["row_joint"])
    for drive in model.drives if "drives" not in without else ():
        joint = model.joints[drive.joint]
        ending = joint.table.coordinates[drive.coordinate]
        if joint.type == "universal":
            ending = ("alpha", "beta")[drive.coordinate]
        name = joint.name if joint.name in names else f"{joint.name}.{ending}"
        out[name] = -float(found["multipliers"][rows.index(drive.name)])
    return out


def _items(speed: Any) -> Mapping[str, Any]:
    if not isinstance(speed, Mapping) or not speed:
        raise ModelError(f"speed= must name what turns and how fast, such as {{'shaft': 60.0}}; got {shown(speed)}")
    return speed


def _speed(key: str, value: Any) -> float:
    return real_number(f"the speed of {key!r} in rad/s", value)


def _coordinate(model: Any, system: Any, names: Sequence[str], key: Any) -> int:
    """Index of the tree coordinate that a joint, body or coordinate name means."""
    key = getattr(key, "name", key)
    if key in names:
        return list(names).index(key)
    stem = key
    for body, _, joint, _ in system.topology()["tree"]:
        if body == key:
            stem = joint or body
    turning = [i for i, name in enumerate(names) if name == stem or (name.startswith(f"{stem}.") and _turns(name))]
    if not turning:
        raise not_found(f"speed of model {model.name!r}: no joint, body or coordinate", str(key), list(names))
    if len(turning) > 1:
        options = ", ".join(repr(names[i]) for i in turning)
        raise ModelError(f"{key!r} can turn in several ways; name one of its coordinates: {options}")
    return turning[0]


def _turns_about_itself(model: Any, name: str) -> bool:
    """Is this coordinate an angle?"""
    _, _, ending = name.rpartition(".")
    if _turns(name):
        return True
    return ending not in ("x", "y", "z") and not any(j.name == name and j.type == "prismatic" for j in model.joints)


def _turns(name: str) -> bool:
    return name.rsplit(".", 1)[-1] in ("rx", "ry", "rz", "alpha", "beta")


def _solve(
    snapshot: Snapshot,
    begin: State,
    spin: Spin,
    names: Sequence[str],
    driven: Mapping[int, float],
    without: tuple[str, ...],
) -> _Found:
    """The state, what the core found there, iterations, and whether the residual is small beside the forces at work."""
    q = begin.q
    best = np.inf
    known: _Found = (begin, {}, 0, False)
    place = {name: i for i, name in enumerate(names)}
    for iteration in range(_MAX_ITERATIONS):
        rate, acceleration = spin.at(q)
        with core_errors():
            r = snapshot.system.linearize(q, rate, list(without), [], acceleration.tolist(), raw=True)
        _check_rates(snapshot, r, q, rate, without)
        still = np.array([place[name] not in driven for name in r["coordinates"]], dtype=bool)
        # coordinates of the order of a radian, forces over those of the bodies that they act on
        reach = r["reach"][still]
        unit = 1.0 / np.where(reach > 0.0, reach, 1.0)
        forces = np.maximum(np.asarray(r["force_sizes"])[still], np.finfo(float).tiny)
        residual = r["residual"][still] * unit
        size = float(np.max(np.abs(residual) / forces, initial=0.0))
        step = np.zeros(len(still))
        if residual.size:
            S = _carried_stiffness(r, spin, rate, place)[np.ix_(still, still)]
            step[still] = unit * _newton(S * np.outer(unit, unit), residual, forces)
            natural = np.sum(np.abs(S * np.outer(unit, unit)), axis=1)
            # that of places, with the arms of forces and the strains of springs, comes beside it
            own = _core.ENTRY_ROUNDING * np.finfo(float).eps * (forces + natural)
            explained = np.abs(residual) <= own + r["hidden_forces"][still] * unit
            # nothing is there to balance: all forces are rounding, or this one is the centrifugal force of rounded places
            spun = np.abs(residual) <= r["hidden_centrifugal"][still] * unit
            nothing = (explained & np.asarray(r["is_idle"])[still]) | spun
            balanced = bool(np.all(nothing | (np.abs(residual) <= BALANCED * forces)))
        else:
            explained, balanced = np.ones(0, dtype=bool), True
        longest = _natural_size(r, step, snapshot.system.characteristic_length)
        moving = acceleration if np.any(acceleration) else np.zeros(0)
        now = State(q, rate, "steady", driven=tuple(driven), acceleration=moving), r, iteration, balanced
        if size <= _ROUNDED or longest <= _ROUNDED:
            return now
        # what Newton's method does not lessen is rounding, or good enough
        if size >= best and (known[3] or np.all(explained)):
            return known if known[3] else now
        if size < best:
            best, known = size, now
        step *= min(1.0, 0.3 / longest)
        with core_errors():
            q = snapshot.system.advance(q, step, list(STILL_AIR))
    raise ConvergenceError(
        f"no steady motion of {snapshot.model.name!r} was found at these speeds within {_MAX_ITERATIONS} iterations; approach them in "
        "steps (at= takes a slower steady motion)"
    )


def _natural_size(r: dict[str, Any], step: np.ndarray, length: float) -> float:
    """The largest motion of a body that a step makes: rad, or characteristic lengths."""
    moved = np.abs((r["T"] @ step).reshape(-1, 2, 3)) / np.array([length, 1.0])[None, :, None]
    modal = np.abs(r["modal_map"] @ step) / length if "modal_map" in r else np.zeros(0)
    return float(max(np.max(moved, initial=0.0), np.max(modal, initial=0.0)))


def _carried_stiffness(r: dict[str, Any], spin: Spin, rate: np.ndarray, place: Mapping[str, int]) -> np.ndarray:
    """S at rates that follow the configuration: a carried body that is displaced moves on with the displacement turned."""
    if not spin.carried:
        return np.asarray(r["S"])
    W = np.zeros((len(place), len(place)))
    for _, first, _ in spin.carried:
        cross = skew(rate[first + 3 : first + 6])
        W[first : first + 3, first : first + 3] = W[first + 3 : first + 6, first + 3 : first + 6] = cross
    kept = [place[name] for name in r["coordinates"]]
    W = W[np.ix_(kept, kept)]
    D = np.zeros_like(r["M"]) if r["D"] is None else r["D"]
    return np.asarray(r["S"] + D @ W + r["M"] @ W @ W)


def _newton(S: np.ndarray, residual: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """-S^-1 r; directions without stiffness are left alone unless something pushes them."""
    step, _, rank, _ = np.linalg.lstsq(S, -residual, rcond=_NO_STIFFNESS)
    if rank < len(residual) and np.max(np.abs(S @ step + residual) / forces) > BALANCED:
        raise SingularError(
            "a force of the steady motion acts along a direction that nothing restrains; add a spring or a joint"
        )
    return np.asarray(step)


def _check_rates(
    snapshot: Snapshot, r: dict[str, Any], q: np.ndarray, rate: np.ndarray, without: tuple[str, ...]
) -> None:
    if "rank" not in r:
        return
    with core_errors():
        miss = snapshot.system.rate_mismatch(q, rate, list(without))
        moved = snapshot.system.bodies(q, rate)
    length = snapshot.system.characteristic_length
    fastest = max(
        float(np.max(np.abs(moved["angular_velocity"]), initial=0.0)),
        float(np.max(np.abs(moved["velocity"]), initial=0.0)) / length,
    )
    if miss > _TORN * fastest:
        raise ModelError(
            "a closed loop does not let these speeds be constant with everything else at rest; drive a joint outside "
            "the loops"
        )
