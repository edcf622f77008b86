"""Motions beside wakes: the structure moves from one step of the wake to the next, and sees induced velocities in between."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.progress import Progress
from ..aero.coupled import Induction, RotorWakeInduction, Rows, induction, rotor_frame
from ..errors import ModelError
from ..model.aerodynamics import STEPPED, Aerodynamics
from ..model.air_schema import INFLOWS
from ..model.tables import tables, tables_with_nodes
from ..system.air_flow import FLOW, flows
from ..system.snapshot import Snapshot
from ..system.state import State
from .wake_steps import warn_long_steps, warn_long_turn

# Largest change of an induced velocity, over the wind, at which a step of a tightly coupled wake is done, and rounds until then.
AGREED, MOST_ROUNDS = 1e-4, 8
# A window shorter than this part of a step ends with the one before: rounding of times that were added up.
SHORTEST = 1e-9

Run = Callable[[Snapshot, State, dict[str, Any]], dict[str, Any]]


@dataclass
class Going:
    """A wake at one of its steps, from which a motion goes on: its time, the last induced velocities and those before."""

    inflow: Induction
    t: float
    found: list[np.ndarray] = field(default_factory=list)


@dataclass(frozen=True)
class Wakes:
    """The wake along a motion: at ``times`` (n,) s the ``filaments`` (b, 2, q, 3) m that roll up, and ``going``, from which it goes on."""

    going: Going
    times: np.ndarray
    filaments: list[np.ndarray]


def stepped(model: Any, without: tuple[str, ...], absolute: bool = False) -> Aerodynamics | None:
    """The air whose inflow advances by steps, if the model has one."""
    if "aerodynamics" in without:
        return None
    found = [air for air in model.airs if air.inflow in STEPPED]
    if len(found) > 1 or (found and len(model.airs) > 1):
        raise ModelError(f"{found[0].name!r}: a wake has no other air beside it; give all blades to one m.aerodynamics")
    if found and absolute:
        raise ModelError(
            f'{found[0].name!r}: a motion in coordinates="absolute" takes no wake; give it inflow "none", "bem" or "dynamic-inflow", '
            f"not {found[0].inflow!r}"
        )
    return found[0] if found else None


def march(
    air: Aerodynamics, snapshot: Snapshot, state: State, without: tuple[str, ...], options: dict[str, Any], run: Run
) -> tuple[dict[str, Any], Snapshot, Wakes]:
    """The motion, window by window: what the core made, the snapshot with the history of the induced velocities, the wake.

    The induced velocities are straight lines between the steps of the wake. Loose: those at the end of a window are extrapolated from
    the two steps before it. Tight: the window is repeated until they are those of the wake there.
    """
    blades, n = len(air.blades), len(air.sections.places)
    going = copy.deepcopy(state.air) if isinstance(state.air, Going) else None
    if going is None:
        # a motion of no length: drives have their rates, and laws their memory
        first = run(snapshot, state, {**options, "end": state.t, "outputs": [state.t]})
        flow = flows(snapshot.system, first["t"], first["q"], first["rate"], first["memory"])
        rows = rows_of(flow, blades)
        inflow = induction(air, rows)
        warn_long_steps(air, snapshot, flow, inflow.step)
        going = Going(inflow, state.t, [inflow.start(rows)])
    inflow, h, end = going.inflow, going.inflow.step, options["end"]
    total = max(int(np.ceil((end - going.t) / h - SHORTEST)), 1)
    times = going.t + h * np.arange(total + 1)
    history = _History(snapshot.model, without, n, times, going.found[-1])
    window = _Window(air, inflow, history, options, run)
    parts: list[dict[str, Any]] = []
    filaments = _drawn(inflow)
    cut = False
    with Progress("motion with a wake", total) as progress:
        for k in range(total):
            last = k + 1 == total
            until = end if last else float(times[k + 1])
            whole = until >= times[k + 1] - SHORTEST * h
            try:
                made, there, found = window.pass_through(k, state, until, going.found, whole)
            except KeyboardInterrupt:
                if not parts:
                    raise
                cut = True
                break
            parts.append(made)
            if there is None:
                break
            inflow.accept()
            going = Going(inflow, float(times[k + 1]), [*going.found[-1:], found])
            filaments += _drawn(inflow)
            state = there
            progress.advance(note=f"t = {until:.4g} s")
    warn_long_turn(air, window.fastest, h)
    out = _joined(parts, options, window.rounds)
    if cut:
        out["status"] = "interrupted"
    return out, history.snapshot(), Wakes(going, times[: len(filaments)], filaments)


class _Window:
    """Passes through the time between two steps of a wake."""

    def __init__(
        self, air: Aerodynamics, inflow: Induction, history: _History, options: dict[str, Any], run: Run
    ) -> None:
        self.inflow, self.history, self.options, self.run = inflow, history, options, run
        self.blades = len(air.blades)
        self.most = MOST_ROUNDS if air.coupling == "tight" else 1
        self.scale = max(abs(air.values("speed")[0]), 1e-300)
        self.rounds = 0
        # rad/s: of the rotor, at the ends of windows
        self.fastest = 0.0

    def pass_through(
        self, k: int, state: State, until: float, known: list[np.ndarray], whole: bool
    ) -> tuple[dict[str, Any], State | None, np.ndarray]:
        """The core's motion, the state and the induced velocities at the end; None where the motion or the window ended before."""
        guess = known[-1] if len(known) == 1 else 2.0 * known[-1] - known[-2]
        there = None
        for _ in range(self.most):
            self.rounds += 1
            self.history.put(k + 1, guess)
            made = self.run(self.history.snapshot(), state, _window(self.options, state, until))
            if made["status"] != "finished" or not whole:
                return made, None, guess
            there = State(made["q"][-1], made["rate"][-1], "given", made["memory"][-1], until)
            rows = rows_of(flows(self.history.system, *_one(there)), self.blades)
            self.fastest = max(self.fastest, abs(rotor_frame(self.inflow.blades, rows)[1]))
            found = self.inflow.trial(rows)
            change, guess = float(np.max(np.abs(found - guess))) / self.scale, found
            if change <= AGREED:
                break
        return made, there, guess


def rows_of(flow: np.ndarray, blades: int) -> Rows:
    """Places and velocities of sections, from rows (1, b n, 36)."""
    names = ("centre", "rear", "forward", "span", "ahead", "suction", "centre_velocity", "rear_velocity")
    return Rows(*(flow[0, :, FLOW[name]].reshape(blades, -1, 3) for name in names))


def _one(state: State) -> tuple[np.ndarray, ...]:
    return np.array([state.t]), state.q[None], state.rate[None], state.memory[None]


def _drawn(inflow: Induction) -> list[np.ndarray]:
    return [inflow.filaments()] if isinstance(inflow, RotorWakeInduction) else []


def _window(options: dict[str, Any], state: State, until: float) -> dict[str, Any]:
    """Options of the part of a motion between a state and a time, which is its last output."""
    made = {**options, "t": state.t, "memory": state.memory.tolist(), "end": until}
    if "outputs" in options:
        inside = [t for t in options["outputs"] if state.t < t < until or t == state.t == options["t"]]
        made["outputs"] = [*inside, until]
    return made


def _joined(parts: list[dict[str, Any]], options: dict[str, Any], rounds: int) -> dict[str, Any]:
    """The parts of a motion as one; instants at which windows meet are outputs only where they were asked for."""
    asked = set(options["outputs"]) if "outputs" in options else None
    out = dict(parts[-1])
    for name in ("t", "q", "rate", "memory", "acceleration", "multipliers", "joints"):
        rows = []
        for i, part in enumerate(parts):
            t = part["t"]
            keep = np.array([asked is None or x in asked for x in t], dtype=bool)
            if asked is None and i and len(t):
                keep[0] = t[0] > parts[i - 1]["t"][-1]
            rows.append(part[name][keep])
        out[name] = np.concatenate(rows)
    out["steps"] = np.concatenate([parts[0]["steps"], *(part["steps"][1:] for part in parts[1:])])
    out["orders"] = [order for part in parts for order in part["orders"]]
    out["local_error"] = np.concatenate([part["local_error"] for part in parts])
    counts: dict[str, int] = {}
    for part in parts:
        for what, count in dict(part["counts"]).items():
            counts[what] = counts.get(what, 0) + count
    out["counts"] = {**counts, "wake windows": len(parts), "wake rounds": rounds}
    for name in ("position_correction", "velocity_correction"):
        out[name] = parts[0][name]
    return out


class _History:
    """Tables of a model with a place for the induced velocities at all steps of a wake."""

    def __init__(self, model: Any, without: tuple[str, ...], n: int, times: np.ndarray, first: np.ndarray) -> None:
        made = tables(model, not (model.is_flexible and "flexibility" in without))
        self.model, self.n, self.start = model, n, len(made["x"])
        self.x = np.concatenate([made["x"], np.tile(first.ravel(), len(times))])
        self.tables = {
            **made,
            "air_history_x": np.array([self.start]),
            "air_times": [times.tolist()],
            "air_inflow": np.array([INFLOWS["given"]]),
        }
        with core_errors():
            self.system = _core.System({**self.tables, "x": self.x})

    def put(self, k: int, velocity: np.ndarray) -> None:
        """The velocities (n, 3) at step k and, until others are known, later."""
        size = 3 * self.n
        self.x[self.start + k * size :].reshape(-1, size)[:] = velocity.ravel()
        with core_errors():
            self.system = self.system.with_values(self.x)

    def snapshot(self) -> Snapshot:
        """The model with the history so far; it is never the model as it is now, which has none."""
        made = {**self.tables, "x": self.x.copy()}
        return Snapshot(self.model, self.system, (-1, -1), tables_with_nodes(made))
