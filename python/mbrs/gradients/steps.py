"""The motion that is differentiated: where it starts, its scheme, and steps that end where objectives are read."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._lib.checks import positive, real_number
from ..errors import ConvergenceError, ModelError
from ..motion.options import DEFAULT, require_room
from ..motion.simulate import to_be_differentiated
from ..motion.tangent import (
    Kink,
    Run,
    Stretch,
    differentiated_by,
    grid,
    kink_times,
    least_gap,
    require_exact_tangents,
)
from ..system.snapshot import Snapshot
from ..system.state import state_of
from .objectives import Integral, Objective

if TYPE_CHECKING:
    from ..model.model import Model
    from ..system.state import State


def prepare(
    m: Model,
    objectives: Sequence[Objective],
    t: float,
    step: float | None,
    rtol: float | None,
    at: Any,
    without: tuple[str, ...],
    keep: int,
    **kind: Any,
) -> Run:
    """Start and steps of a motion."""
    snapshot = Snapshot.of(m, without)
    require_exact_tangents(m, without)
    state = state_of(m, snapshot.system, at, hold=False, without=without)
    end = real_number("t=", t, state.t)
    slack = least_gap(state.t, end)
    for o in objectives:
        if np.any(np.diff(o.times) <= slack) and end > state.t:
            raise ModelError(
                f"mb.AtTimes names times closer than {slack:.1e} s, which cannot be told apart; name each once"
            )
    for x in (x for o in objectives for x in o.times):
        if not state.t - slack <= x <= end + slack:
            raise ModelError(f"mb.AtTimes names t = {x:.12g} s, outside the motion from {state.t:.12g} to {end:.12g} s")
    through = [min(max(x, state.t), end) for o in objectives for x in o.times]
    if step is not None and rtol is not None:
        raise ModelError("give rtol= (steps chosen first) or step= (fixed steps), not both")
    if kind["scheme"] == "auto":
        kind["scheme"] = differentiated_by(snapshot, state, without, end, step)
    orders: tuple[int, ...] = ()
    kept: _core.KeptMotion | None = None
    smooth: list[Stretch] = []
    missed: tuple[Kink, ...] = ()
    if end == state.t:
        times = np.array([end])
    elif step is not None:
        h = positive("step=", step)
        if (end - state.t) / h > 1e8:
            raise ModelError(f"step={step} would need more than 1e8 steps")
        require_room(
            (end - state.t) / h,
            state,
            f"a gradient over {(end - state.t) / h:.0f} steps",
            "take longer steps, or rtol=",
        )
        breaks = _core.motion_breaks(snapshot.system, state.t)
        times = grid(state.t, end, h, [*through, *breaks])
        if _core.motion_has_kinks(snapshot.system, list(without), False):
            try:
                times, smooth, missed = located(m, state, without, times, kind)
            except ConvergenceError as stopped:
                missed = _stopped(m, stopped)
    else:
        marks = np.array(sorted({*(x for x in through if x > state.t), end}))
        run: dict[str, Any] = {"rtol": DEFAULT if rtol is None else rtol, "at": state, "without": without}
        multistep = kind["scheme"] == "bdf"
        if multistep and len(marks) > 1:
            # every mark has a step that ends near it
            run["max_step"] = 0.9 * float(np.diff(marks).min())
        if kind["scheme"] in ("radau", "bdf") and len(marks) == 1:
            # no step has to move
            run["keep"] = keep
        run |= _as_method(kind)
        traj, made = to_be_differentiated(m, marks, **run)
        kept, smooth, missed = made.get("kept"), made["smooth"], tuple(made["missed"])
        if multistep:
            breaks = [*_core.motion_breaks(snapshot.system, state.t), *kink_times(smooth)]
            times, orders = _drawn_to(traj.steps, traj.orders, marks, breaks, slack)
        else:
            times = _with_marks(traj.steps, marks, kink_times(smooth))
    inner = any(isinstance(o, Integral) for o in objectives)
    found: dict[str, Any] = {"orders": orders, "smooth": smooth, "missed": missed, "kept": kept}
    return Run(m, snapshot, state, without, times, keep=keep, inner=inner, **found, **kind)


def located(
    m: Model, state: State, without: tuple[str, ...], times: np.ndarray, kind: dict[str, Any]
) -> tuple[np.ndarray, list[Stretch], tuple[Kink, ...]]:
    """Steps between these times that end at kinks of laws as well, the stretches between kinks, and kinks at which none ends.

    The motion of the scheme itself is at its kinks there; that of "bdf", whose histories depend on all lengths, as far as it is accurate.
    """
    method = {"method": "radau"} if kind["scheme"] == "bdf" else _as_method(kind)
    asked: dict[str, Any] = {
        "step": float(np.diff(times).max()),
        "ends": times.tolist(),
        "at": state,
        "without": without,
    }
    traj, made = to_be_differentiated(m, float(times[-1]), **asked, **method)
    return traj.steps, made["smooth"], tuple(made["missed"])


def halved(run: Run) -> Run:
    """The motion over fixed steps half as long, those beside kinks too, with kinks where these find them."""
    times = np.insert(run.times, np.arange(1, len(run.times)), 0.5 * (run.times[:-1] + run.times[1:]))
    ends = times[~np.isin(times, kink_times(run.smooth))]
    found, smooth, missed = located(run.model, run.state, run.without, ends, {"scheme": run.scheme, "rho": run.rho})
    return replace(run, times=found, smooth=smooth, missed=missed, orders=(), kept=None)


def resampled(run: Run, ratio: float, held: Sequence[float]) -> tuple[Run, float]:
    """The motion over steps longer by a ratio, those that end at the held times still do; and the ratio that comes out.

    Lengths follow those of the motion. Where there is more than one step between held times, longer steps are fewer.
    """
    orders = np.array(run.orders, dtype=int)
    ends = np.flatnonzero(np.isin(run.times, [run.times[0], *held, run.times[-1]]))
    if len(orders):
        # a history begins anew where it did
        ends = np.union1d(ends, np.flatnonzero(orders < 0))
    places, found = [np.zeros(1)], []
    for a, b in itertools.pairwise(ends.tolist()):
        n = max(1, min(round((b - a) / ratio), b - a - 1) if ratio > 1.0 else round((b - a) / ratio))
        places.append(np.linspace(a, b, n + 1)[1:])
        if len(orders):
            found.append(_history(orders[a:b], n))
    index = np.concatenate(places)
    times = np.interp(index, np.arange(len(run.times)), run.times)
    of_steps = tuple(np.concatenate(found).tolist()) if found else ()
    return replace(run, times=times, orders=of_steps, kept=None), (len(run.times) - 1) / (len(times) - 1)


def _history(orders: np.ndarray, n: int) -> np.ndarray:
    """Orders of n steps that take the place of others; a beginning stays one, and no order is more than a beginning has room for."""
    own = np.abs(orders[(np.arange(n) * len(orders)) // n])
    if orders[0] < 0:
        own = np.minimum(own, np.arange(1, n + 1))
        own[0] = orders[0]
    return own


def _stopped(m: Model, error: ConvergenceError) -> tuple[Kink, ...]:
    """The one place at which a motion stopped because no step ended at a kink."""
    traj = error.result
    at = float(traj.t[-1]) if traj is not None and len(traj.t) else 0.0
    return ((at, m.name, "no step ends at a kink of one of its laws"),)


def _with_marks(steps: np.ndarray, marks: np.ndarray, held: Sequence[float]) -> np.ndarray:
    """Steps that end at the marks too; those nearer to a mark than a hundredth of their length move to it, unless they are held."""
    length = np.minimum(np.diff(steps, prepend=-np.inf), np.diff(steps, append=np.inf))
    far = np.abs(steps[:, None] - marks[None, :]).min(axis=1) > 0.01 * length
    far |= np.isin(steps, [steps[0], *held])
    return np.unique(np.concatenate([steps[far], marks]))


def _drawn_to(
    steps: np.ndarray, orders: Sequence[int], marks: np.ndarray, breaks: Sequence[float], near: float
) -> tuple[np.ndarray, tuple[int, ...]]:
    """The same steps, the nearest of which end at the marks: lengths and orders of a history go on evenly.

    The start and the breaks stay where they are: a mark that is nearest to one of them has a step of its own.
    """
    if np.isin(marks, steps).all():
        return steps, tuple(orders)
    held = {0, *np.flatnonzero(np.isin(steps, breaks)).tolist()}
    ends, own = {i: float(steps[i]) for i in held}, []
    for mark in marks.tolist():
        nearest = int(np.abs(steps - mark).argmin())
        if nearest not in held or abs(mark - steps[nearest]) <= near:
            ends[nearest] = mark
        else:
            own.append(mark)
    places = sorted(ends)
    times = np.interp(steps, steps[places], [ends[i] for i in places])
    times[places] = [ends[i] for i in places]
    kinds = list(orders)
    for mark in own:
        i = int(np.searchsorted(times, mark))
        times = np.insert(times, i, mark)
        # the other part of a step that begins a history goes on at its order
        kinds.insert(i, abs(kinds[i - 1]))
    return times, tuple(kinds)


def _as_method(kind: dict[str, Any]) -> dict[str, Any]:
    scheme = kind["scheme"]
    return {"method": scheme} | {
        "explicit": {"coordinates": "tree"},
        "radau": {},
        "bdf": {},
        "ali3p": {},
        "generalized-alpha": {"rho": kind["rho"]},
    }[scheme]
