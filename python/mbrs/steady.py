"""Steady motion: a state in which some joints turn at constant speed and everything else stays where it is."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ._border import core_errors
from .effects import check_without
from .errors import ConvergenceError, MbrsWarning, ModelError, SingularError
from .joints import KINDS
from .linearize import Linearization, Snapshot, _linearization
from .names import not_found
from .results import Result, Stats, derived, result
from .state import State, state_of

if TYPE_CHECKING:
    from .model import Model

_MAX_ITERATIONS = 60
_VARIES = 1e-8


@result
class SteadyMotion(Result):
    """A steadily turning state; give it as ``at=`` to other analyses.

    Attributes
    ----------
    state
        Poses and rates.
    speed
        rad/s of each driven coordinate.
    torque
        What keeps each driven coordinate at its speed, N m (N for sliding coordinates); zero without losses.
    linearization
        The exact linearisation there.
    error
        How much M, C + G and K + N change over a turn of the driven coordinates, relative: the linearisation has
        constant
        coefficients only where this is rounding.
    """

    state: State
    speed: dict[str, float]
    torque: dict[str, float]
    linearization: Linearization
    iterations: int

    @property
    def model(self) -> Any:
        """The model this belongs to."""
        return self.linearization.model

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, in the order of `poses`."""
        return self.linearization.bodies

    @property
    def poses(self) -> dict[str, np.ndarray]:
        """Position, rotation, velocity and angular velocity of the bodies' origins, world."""
        return self.linearization.poses

    row: ClassVar[str] = "coordinate"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "driven", "body": "bodies"}

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the driven coordinates."""
        return tuple(self.speed)

    @property
    @derived(dims=("coordinate",), unit="rad/s", name="speed")
    def _speeds(self) -> np.ndarray:
        return np.array(list(self.speed.values()), dtype=float)

    @property
    @derived(dims=("coordinate",), unit="N m", name="torque")
    def _torques(self) -> np.ndarray:
        return np.array(list(self.torque.values()), dtype=float)

    @property
    @derived(dims=("body", "axis"), unit="m", name="position")
    def _positions(self) -> np.ndarray:
        return np.asarray(self.poses["position"])

    @property
    @derived(dims=("body", "axis"), unit="m/s", name="velocity")
    def _velocities(self) -> np.ndarray:
        return np.asarray(self.poses["velocity"])

    def heading(self) -> str:
        return f"steady motion of {self.model.name!r}: {self.status}, {self.iterations} iterations"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: speed and torque of each driven coordinate."""
        rows = [[name, float(speed), float(self.torque[name])] for name, speed in self.speed.items()]
        return ["driven", "speed [rad/s]", "held by [N m]"], rows

    def notes(self) -> list[str]:
        return [f"coefficients vary over a turn by {self.error:.1e}"]

    def plot(self, *, ax: Any = None) -> Any:
        """The bodies with their velocities as arrows, in the plane in which the motion is widest; returns the figure."""
        from .plot.models import steady_motion as draw

        return draw(self, ax=ax)


def steady_motion(
    m: Model, speed: Mapping[str, float] | None = None, *, at: Any = None, without: Sequence[str] = ()
) -> SteadyMotion:
    """The state in which the named joints turn at constant speed and all forces, inertia included, balance.

    rho(y, y', 0) = 0 on all coordinates but the driven ones, y' = speed on these and zero elsewhere.

    Parameters
    ----------
    m
        The model.
    speed
        rad/s (m/s for sliding coordinates) by joint, body or coordinate: ``{"shaft": 60.0}``. A joint or body must
        have one
        rotation; name the coordinate ("rotor.rx") where it has several. Drives add their rates of t = 0, couplers what
        follows from them; a model whose drives move needs no ``speed``.
    at
        Where to start: None (drawn), an equilibrium, another steady motion.
    without
        Effects to leave out.

    Returns
    -------
    SteadyMotion

    Raises
    ------
    ModelError
        Speeds that closed loops do not allow to be constant.
    ConvergenceError
        No steady state near the start.

    Warns
    -----
    MbrsWarning
        Coefficients that vary over a turn: the linearisation then holds for the drawn angle alone.

    Notes
    -----
    Newton on the exact tangent, centrifugal stiffness included. Cost O(dof^3) per iteration.

    Examples
    --------
    >>> import mbrs as mb
    >>> turning = mb.steady_motion(mb.examples.rotor(), {"shaft": 60.0})
    >>> turning.status
    'converged'
    """
    start = time.perf_counter()
    without = check_without(without)
    snapshot = Snapshot.of(m, without)
    begin = state_of(m, snapshot.system, at)
    names = snapshot.system.topology()["coordinates"]
    given = {} if speed is None and m.drives and "drives" not in without else _items(speed)
    driven = {_coordinate(m, snapshot.system, names, key): _speed(key, value) for key, value in given.items()}
    rate = _rates(snapshot, begin, driven, without)
    if (m.drives or m.couplers) and np.any(rate):
        driven = {int(i): float(rate[i]) for i in np.flatnonzero(rate)}
    state, found, iterations = _solve(snapshot, begin, rate, names, driven, without)
    linearization = _linearization(snapshot, state, found, without, start, warn=False)
    varies = _variation(snapshot, state, found, driven, without)
    if varies > _VARIES:
        warnings.warn(
            f"the linearisation of {m.name!r} at this steady motion changes by {varies:.1e} over a turn (an "
            f"unsymmetric rotor on "
            "unsymmetric supports): its modes hold for the drawn angle alone",
            MbrsWarning,
            stacklevel=2,
        )
    residual = dict(zip(found["coordinates"], found["residual"], strict=True))
    residual.update(_drive_forces(snapshot, found, names, without))
    return SteadyMotion(
        state=state,
        speed={names[i]: value for i, value in driven.items()},
        torque={names[i]: float(residual.get(names[i], np.nan)) for i in driven},
        linearization=linearization,
        iterations=iterations,
        stats=Stats(time.perf_counter() - start, found["counts"], linearization.stats.effects, "Newton"),
        error=varies,
        status="converged",
    )


def _rates(snapshot: Snapshot, begin: State, driven: Mapping[int, float], without: tuple[str, ...]) -> np.ndarray:
    """Rates of the tree coordinates: the given ones, those of drives, and what couplers make of both; zero elsewhere."""
    rate = np.zeros(snapshot.system.n_tree)
    for index, value in driven.items():
        rate[index] = value
    model = snapshot.model
    if not (model.drives or model.couplers):
        return rate
    with core_errors():
        rows = snapshot.system.rows(begin.relative, np.zeros_like(rate), 0.0, list(without))
    held, values = np.eye(len(rate))[list(driven)], list(driven.values())
    found = np.linalg.lstsq(np.vstack([rows["jacobian"], held]), np.concatenate([-rows["rates"], values]), rcond=1e-10)[
        0
    ]
    return np.where(np.abs(found) > 1e-14 * np.max(np.abs(found), initial=0.0), found, 0.0)


def _drive_forces(
    snapshot: Snapshot, found: dict[str, Any], names: Sequence[str], without: tuple[str, ...]
) -> dict[str, float]:
    """What each drive of a tree joint exerts, by the coordinate that it moves."""
    model, out = snapshot.model, {}
    rows = list(snapshot.system.topology()["row_joint"])
    for drive in model.drives if "drives" not in without else ():
        joint = model.joints[drive.joint]
        ending = KINDS[joint.type].coordinates[drive.coordinate]
        if joint.type == "universal":
            ending = ("alpha", "beta")[drive.coordinate]
        name = joint.name if joint.name in names else f"{joint.name}.{ending}"
        out[name] = -float(found["multipliers"][rows.index(drive.name)])
    return out


def _items(speed: Any) -> Mapping[str, Any]:
    if not isinstance(speed, Mapping) or not speed:
        raise ModelError(f"speed= must name what turns and how fast, such as {{'shaft': 60.0}}; got {speed!r}")
    return speed


def _speed(key: str, value: Any) -> float:
    try:
        made = float(value)
    except (TypeError, ValueError):
        raise ModelError(f"the speed of {key!r} must be a number in rad/s, got {value!r}") from None
    if not np.isfinite(made):
        raise ModelError(f"the speed of {key!r} must be finite, got {value!r}")
    return made


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


def _turns(name: str) -> bool:
    return name.rsplit(".", 1)[-1] in ("rx", "ry", "rz", "alpha", "beta")


def _solve(
    snapshot: Snapshot,
    begin: State,
    rate: np.ndarray,
    names: Sequence[str],
    driven: Mapping[int, float],
    without: tuple[str, ...],
) -> tuple[State, dict[str, Any], int]:
    relative = begin.relative
    previous = np.inf
    for iteration in range(_MAX_ITERATIONS):
        with core_errors():
            r = snapshot.system.linearize(relative, rate, list(without))
        _check_rates(snapshot, r, relative, rate, without)
        place = {name: i for i, name in enumerate(names)}
        still = np.array([place[name] not in driven for name in r["coordinates"]], dtype=bool)
        residual = r["residual"][still]
        size = float(np.max(np.abs(residual), initial=0.0))
        scale = max(r["force_scale"], np.finfo(float).tiny)
        step = np.zeros(len(still))
        if residual.size:
            step[still] = _newton(r["S"][np.ix_(still, still)], residual, scale)
        tiny = float(np.max(np.abs(step), initial=0.0)) <= 1e-14 * max(1.0, snapshot.system.characteristic_length)
        if size <= 1e-14 * scale or tiny or (size >= previous and size <= 1e-10 * scale):
            return State(relative, rate, "steady", driven=tuple(driven)), r, iteration
        previous = size
        longest = float(np.max(np.abs(step)))
        step *= min(1.0, 0.3 / longest)
        with core_errors():
            relative = snapshot.system.advance(relative, step)
    raise ConvergenceError(
        f"no steady motion of {snapshot.model.name!r} was found at these speeds within {_MAX_ITERATIONS} iterations; "
        f"approach them in "
        "steps (at= takes a slower steady motion)"
    )


def _newton(S: np.ndarray, residual: np.ndarray, scale: float) -> np.ndarray:
    """-S^-1 r; directions without stiffness are left alone unless something pushes them."""
    step, _, rank, _ = np.linalg.lstsq(S, -residual, rcond=1e-13)
    if rank < len(residual) and np.max(np.abs(S @ step + residual)) > 1e-9 * scale:
        raise SingularError(
            "a force of the steady motion acts along a direction that nothing restrains; add a spring or a joint"
        )
    return step


def _check_rates(
    snapshot: Snapshot, r: dict[str, Any], relative: np.ndarray, rate: np.ndarray, without: tuple[str, ...]
) -> None:
    if "rank" not in r:
        return
    with core_errors():
        miss = snapshot.system.rate_mismatch(relative, rate, list(without))
    if miss > 1e-9 * float(np.max(np.abs(rate), initial=0.0)):
        raise ModelError(
            "a closed loop does not let these speeds be constant with everything else at rest; drive a joint outside "
            "the loops"
        )


def _variation(
    snapshot: Snapshot, state: State, found: dict[str, Any], driven: Mapping[int, float], without: tuple[str, ...]
) -> float:
    """Largest relative change of the matrices when the driven coordinates have turned on by angles of no symmetry."""
    names = list(snapshot.system.topology()["coordinates"])
    if snapshot.model.drives and "drives" not in without:
        # drives hold the angles that are to be turned
        without = (*without, "drives")
        with core_errors():
            found = snapshot.system.linearize(state.relative, state.rate, list(without))
    minimal = list(found["coordinates"])
    worst = 0.0
    for angle in (0.61, 1.93):
        step = np.zeros(len(minimal))
        for index, value in driven.items():
            if value != 0.0 and names[index] in minimal:
                step[minimal.index(names[index])] = angle
        with core_errors():
            relative = snapshot.system.advance(state.relative, step, list(without))
            turned = snapshot.system.linearize(relative, state.rate, list(without))
        for key in ("M", "D", "S"):
            a, b = found[key], turned[key]
            if a is not None and b is not None and np.any(a):
                worst = max(worst, float(np.max(np.abs(a - b)) / np.max(np.abs(a))))
    return worst
