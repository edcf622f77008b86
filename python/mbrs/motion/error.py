"""The estimated error of a motion, from other runs of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.progress import Progress
from .._lib.warning import warn_user
from ..errors import Interrupted, MbrsError
from .options import ORDER, TIGHTENED, TIGHTEST

if TYPE_CHECKING:
    from ..system.snapshot import Snapshot
    from ..system.state import State
    from .trajectory import Trajectory

# how much tighter the run is that estimates the error of the methods in `TIGHTENED`
_TIGHTER = 30.0
# Steps of the explicit method over those of a motion with kinks beyond which it tells no errors. Larger: estimates of stiff motions take
# longer than these. Smaller: errors at kinks are not seen.
_AS_MANY = 100
# below it the error of bdf-bfgs no longer follows its tolerance: a tighter run is no better
_NOISE_WITHOUT_TANGENT = 1e-9
# the tolerance of a run by "explicit" that fixed steps are compared with
_SURE = 1e-9
# Steps of a controlled motion of the beginning over those of a whole motion by fixed steps beyond which it tells no errors. Larger:
# estimates of stiff motions take longer than these. Smaller: vibrations that all fixed steps damp are not seen.
_AS_MANY_AT_BEGINNING = 20
# fixed steps that the beginning has at least
_BEGINNING = 4
# outputs at which the error is estimated
_COMPARED = 50
# Estimated errors of fixed steps over those that steps a little longer tell, where steps of twice the length lie farther away than any
# order explains. Larger: what these lose where they are too long counts. Smaller: a distance that is small by chance is believed.
_FARTHER = 3.0

# Errors that grow so many times, while the time grows fourfold or from the tolerance at once, are told. Larger: motions of which nothing
# is left keep silent. Smaller: long motions are called sensitive.
_GROWN = 1e3
# The tolerance of fixed steps there.
_FIXED = 1e-4
# Places that are off by this part of the characteristic length say little.
_LOST = 0.05


def run_core(
    snapshot: Snapshot, state: State, without: Sequence[str], options: Mapping[str, Any], quiet: bool = False
) -> dict[str, Any]:
    """The numbers of a motion."""
    with Progress("motion", 1000, always=False if quiet else None) as progress, core_errors():

        def report(part: float) -> None:
            # a motion of no length is done when it begins
            progress.advance((int(1000 * part) if math.isfinite(part) else 1000) - progress.done)

        return _core.simulate_motion(snapshot.system, state.q, state.rate, list(without), dict(options), report)


def _tolerance_compared(traj: Trajectory, options: Mapping[str, Any]) -> tuple[float, float]:
    """Tolerance of the run that the error of controlled steps is estimated with, and the factor from the distance of both to the error.

    Errors of controlled steps scatter about their tolerance, most of all behind kinks, so that a tighter run tells more than a looser
    one; methods of order two could not afford it. The whole distance to a looser run counts, which may be as good by chance.
    """
    rtol = options["rtol"]
    looser = min(10.0 * rtol, 1.0)
    if traj.method not in TIGHTENED:
        return looser, 1.0 / 9.0
    best = _NOISE_WITHOUT_TANGENT if traj.method == "bdf-bfgs" else TIGHTEST
    if rtol / _TIGHTER < best:
        return looser, 1.0
    return rtol / _TIGHTER, _TIGHTER / (_TIGHTER - 1.0)


def _explicit_compared(traj: Trajectory, options: Mapping[str, Any]) -> dict[str, Any] | None:
    """Options of a run by "explicit" that tells the error where two runs by the same method err alike.

    Histories begin alike at each kink, and fixed steps over a contact that is shorter than they go wild each in its way.
    """
    if "step" in options and _core.motion_has_kinks(traj.snapshot.system, list(traj.without), True):
        rtol = _SURE
    elif "step" not in options and traj.method == "bdf-bfgs" and traj.stats.counts.get("kinks met", 0) > 0:
        rtol = max(float(options["rtol"]) / _TIGHTER, TIGHTEST)
    else:
        return None
    return {"method": "explicit", "rtol": rtol, "max_steps": _AS_MANY * len(traj.steps)}


def stretched(order: float) -> float:
    """The ratio by which steps are longer that err by twice as much."""
    return float(2.0 ** (1.0 / order))


def step_error(near: float, far: float, order: float, ratios: tuple[float, float]) -> float:
    """The error of fixed steps by their distances from steps that are longer by two ratios: a little, and about twice.

    Both distances tell the order q at work, from one to that of the scheme:

        near / far = (r_1^q - 1) / (r_2^q - 1),   error = near / (r_1^q - 1)

    Where near is a larger part of far, it is noise (rounding, remainders of equations): the distance of two errors of the same size, which
    may agree by chance. Where it is a smaller one, the steps of twice the length are too long for any order.
    """
    if not near < math.inf:
        return math.inf
    grown, doubled = (np.asarray(float(r)) for r in ratios)
    if not doubled > grown:
        # too few steps for both: the order is believed
        return near / float(grown**order - 1.0)
    orders = np.linspace(1.0, order, 200)
    parts = (grown**orders - 1.0) / (doubled**orders - 1.0)
    if near >= parts[0] * far:
        return max(near * min(2.0, 1.0 / float(grown - 1.0)), far / float(doubled - 1.0))
    if near <= parts[-1] * far:
        own = near / float(grown**order - 1.0)
        return max(own, min(far / float(doubled**order - 1.0), _FARTHER * own))
    at_work = float(np.interp(-near / far, -parts, orders))
    return near / float(grown**at_work - 1.0)


def _fixed_steps_error(
    traj: Trajectory, options: Mapping[str, Any], start: float, distances: Callable[[float], np.ndarray | None]
) -> np.ndarray | None:
    """Errors (..., n_t) of fixed steps; ``distances`` are those from a run by other steps, None where this does not reach the end."""
    # of the variant that was asked for, where it has an order of its own
    order = ORDER.get(options["method"], ORDER[traj.method])
    span = float(traj.t[-1]) - start
    h, ratios = min(float(options["step"]), span), (stretched(order), 2.0)
    near, far = (distances(r * h) if r * h <= span else None for r in ratios)
    if near is None:
        finer = distances(0.5 * h)
        # of order one, half of the error is left with half the step
        return None if finer is None else 2.0 * finer
    far = np.full(near.shape, math.inf) if far is None else far
    largest, farthest = near.max(axis=-1), far.max(axis=-1)
    error = np.vectorize(lambda n, f: step_error(n, f, order, ratios))(largest, farthest)
    part = np.divide(near, largest[..., None], out=np.ones(near.shape), where=largest[..., None] > 0.0)
    return np.asarray(error[..., None] * part)


def errors_from(
    traj: Trajectory, options: Mapping[str, Any], start: float, apart: Callable[[dict[str, Any]], np.ndarray | None]
) -> tuple[np.ndarray | None, bool]:
    """Errors (..., n_t) by the distances from other runs, None where none of these reaches the end, and whether runs by other fixed steps
    told them; ``apart``: the distances from the run with these options changed, None where it does not reach the end.
    """
    if (changed := _explicit_compared(traj, options)) is not None and (found := apart(changed)) is not None:
        return np.asarray(_TIGHTER / (_TIGHTER - 1.0) * found), False
    if "step" in options:
        return _fixed_steps_error(traj, options, start, lambda step: apart({"step": step})), True
    rtol, factor = _tolerance_compared(traj, options)
    found = apart({"rtol": rtol})
    return (None if found is None else np.asarray(factor * found)), False


def estimated_error(traj: Trajectory, state: State, options: dict[str, Any]) -> float | None:
    """Largest difference to other runs, scaled to the error of this one."""
    if traj.status != "finished":
        return None
    first = int(np.searchsorted(traj.t, state.t, side="right"))
    if first == len(traj.t):
        return 0.0  # nothing but the start
    compared = np.unique(np.linspace(first, len(traj.t) - 1, min(len(traj.t) - first, _COMPARED)).astype(int))
    apart = _Others(traj, state, options, compared).error()
    if apart is None:
        return math.inf
    _warn_of_growth(traj, traj.t[compared], apart, options.get("rtol", _FIXED))
    return max(float(apart.max()), _rounding(traj))


class _Others:
    """Other runs of a motion, and their distances from it at some of its outputs."""

    def __init__(self, traj: Trajectory, state: State, options: dict[str, Any], compared: np.ndarray) -> None:
        self.traj, self.state, self.compared = traj, state, compared
        method = traj.method if options["method"] == "auto" else options["method"]
        self.options = {**options, "method": method}

    def error(self) -> np.ndarray | None:
        """Estimated errors at the outputs; None where no other run reaches the end."""
        found, by_steps = errors_from(self.traj, self.options, self.state.t, self.distances)
        if found is None or not by_steps or self.traj.method == "explicit":
            return found
        return self.with_beginning(found)

    def with_beginning(self, found: np.ndarray) -> np.ndarray:
        """Errors that are not less than the distance from a controlled motion up to the first output, and over the first steps.

        What the first steps damp, the vibration of a stiff spring that is not at rest, longer ones damp as well.
        """
        start, times = self.state.t, self.traj.t[self.compared]
        end = max(float(times[0]), start + _BEGINNING * float(self.options["step"]))
        n = int(np.searchsorted(times, end * (1.0 + np.finfo(float).eps), side="right"))
        most = _AS_MANY_AT_BEGINNING * len(self.traj.steps)
        controlled = {"method": "radau", "rtol": _SURE, "max_steps": most, "end": float(times[n - 1])}
        apart = self.distances(controlled, first=n)
        return found if apart is None else np.concatenate([np.maximum(found[:n], apart), found[n:]])

    def distances(self, changed: dict[str, Any], first: int | None = None) -> np.ndarray | None:
        """Distances from a run by other options, at the (first) outputs; None where it does not reach the last of these."""
        compared = self.compared[:first]
        # a limit of steps is that of the motion itself, which had other ones
        leave = "max_steps" if "step" in changed else "step"
        options = {key: value for key, value in self.options.items() if key != leave} | changed
        options["outputs"] = self.traj.t[compared].tolist()
        if "max_steps" in changed:
            options["max_steps"] = float(changed["max_steps"])
        try:
            made = run_core(self.traj.snapshot, self.state, self.traj.without, options)
        except MbrsError:
            return None
        if made["status"] == "interrupted":
            raise Interrupted("the estimate of the error of a motion was interrupted", self.traj)
        if made["status"] != "finished":
            return None
        with core_errors():
            other = _core.motion_quantities(
                self.traj.snapshot.system,
                made["t"],
                made["q"],
                made["rate"],
                made["memory"],
                made["acceleration"],
                list(self.traj.without),
            )
        apart = _distances(self.traj, compared, other)
        return apart if np.isfinite(apart).all() else None


def _rounding(traj: Trajectory) -> float:
    """Error of a motion by rounding: every step leaves that of its pose, and a part of its rate that moves all that follows."""
    if traj.rate.shape[1] == 0:
        return 0.0  # nothing can move
    length = traj.snapshot.system.characteristic_length
    span = traj.t[-1] - traj.steps[0]
    poses = traj.poses
    away = np.abs(poses["position"]).max(initial=0.0) / length
    speeds = np.abs(poses["velocity"]).max(initial=0.0) / length, np.abs(poses["angular_velocity"]).max(initial=0.0)
    return float(np.finfo(float).eps * np.sqrt(len(traj.steps)) * (1.0 + away + span * max(speeds)))


def _warn_of_growth(traj: Trajectory, times: np.ndarray, apart: np.ndarray, tolerance: float) -> None:
    """Errors that grow as those of a chaotic motion do, or where a motion hangs on how it passes a pose."""
    after, largest = times - traj.steps[0], np.maximum.accumulate(apart)
    # errors that add up grow with the time, or its square: not so much while the time grows fourfold
    later = np.minimum(np.searchsorted(after, 4.0 * after, side="right"), len(after)) - 1
    grown = largest[later] > _GROWN * np.maximum(largest, tolerance)
    if largest[0] > max(_GROWN * tolerance, _LOST):
        early, t = tolerance, times[0]
    elif grown.any():
        first = int(np.argmax(grown))
        early, t = (
            max(largest[first], tolerance),
            times[int(np.argmax(largest > min(_LOST, 0.5 * largest[later[first]])))],
        )
    else:
        return
    warn_user(
        f"the motion amplifies errors: two runs, of nearly the same tolerance or step, are at first less than {early:.1e} and later "
        f"{largest[-1]:.1e} apart (characteristic lengths or radians). It depends sensitively on its start, as chaotic motions do, or "
        f"on how it passes a pose: from t = {t:.4g} s on places say little; shorten the time, or take averages"
    )


def _distances(traj: Trajectory, compared: np.ndarray, other: dict[str, Any]) -> np.ndarray:
    """Largest distance of poses at each time: over the characteristic length, and as an angle."""
    p, q = traj.poses["position"][compared], traj.poses["orientation"][compared]
    moved = np.linalg.norm(p - other["position"], axis=-1) / traj.snapshot.system.characteristic_length
    chord = np.minimum(
        np.linalg.norm(q - other["orientation"], axis=-1), np.linalg.norm(q + other["orientation"], axis=-1)
    )
    return np.asarray(np.maximum(moved, 2.0 * chord).max(axis=-1, initial=0.0))
