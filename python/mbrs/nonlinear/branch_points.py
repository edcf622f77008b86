"""Data of a branch of periodic solutions: points, events, and the chunks in which they come from the core."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .._lib.checks import shown
from ..errors import ModelError
from . import balance

STATUS = {"end": "converged", "start": "left-at-start", "stalled": "stopped", "interrupted": "interrupted"}
MEANING = {
    "converged": "the end of the range was reached",
    "left-at-start": "the branch came back and left the range where it began",
    "interrupted": "cut by Ctrl-C; .resume() goes on",
    "max-points": "cut at max_points; .resume() goes on",
    "stopped": "the step became smaller than min_step; the points so far are kept",
    "unresolved": "the end was reached, but the motion or its stability needs more harmonics",
}


@dataclass(frozen=True, eq=False)
class Event:
    """A special point of a branch: ``kind`` "fold", "branch-point", "neimark-sacker", "period-doubling", "grazing" where the
    exponents jump across the axis because a contact opens or closes, or "unresolved" where they are on both sides of it and no motion
    that was found has them on it, though no law has a contact or a kink: so it may be where the harmonics are too few.

    ``omega`` (rad/s), ``level`` and, on a branch in a parameter, its ``value`` say where, ``X`` (dof, 2H+1) is the motion
    there (built when asked for), ``exponent`` the Floquet exponent that crosses (None where it does not matter), ``index``
    the number of the first point of the branch behind it. ``status`` is "unresolved" where the harmonics that were left out decide
    whether there is such a point.
    """

    kind: str
    omega: float
    level: float
    exponent: complex | None
    index: int
    value: float | None = None
    status: str = "converged"
    built: Callable[[], np.ndarray] | None = field(default=None, repr=False)

    @cached_property
    def X(self) -> np.ndarray:
        """(dof, 2H+1) coefficients of the motion there."""
        assert self.built is not None
        return self.built()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "X": self.X, "built": None}

    @property
    def frequency(self) -> float:
        """Excitation frequency, Hz."""
        return self.omega / (2 * np.pi)

    @property
    def second_frequency(self) -> float | None:
        """The frequency (rad/s) that a motion begins to have beside its own where it loses stability at a Neimark-Sacker point,
        the imaginary part of the exponent: known up to its sign and whole multiples of the motion's. None at other events."""
        if self.kind != "neimark-sacker" or self.exponent is None:
            return None
        return abs(self.exponent.imag)

    def __str__(self) -> str:
        if self.value is not None:
            return f"{self.kind} at value = {self.value:.10g}, omega = {self.omega:.6g} rad/s"
        return f"{self.kind} at omega = {self.omega:.10g} rad/s, level = {self.level:.6g}"


def checked_event(event: Any) -> Event:
    """An event, or `ModelError`."""
    if not isinstance(event, Event):
        raise ModelError(f"event must be one of those in .events of the branch or curve, it is {shown(event)}")
    return event


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """One solution of a branch: ``omega``, ``level``, coefficients ``X`` (dof, 2H+1), ``error``, ``stable`` (nan: not
    known),
    Floquet ``exponents`` or None, the ``step`` that led here, the ``value`` of the parameter of a branch in one."""

    omega: float
    level: float
    X: np.ndarray
    error: float
    stable: float
    exponents: np.ndarray | None
    step: float
    value: float | None = None


class Chunks:
    """Points of a branch that have been computed so far, as lists of arrays; ``terms`` of a chunk say which harmonics it
    holds."""

    def __init__(self) -> None:
        self.parts: list[tuple[balance.Setup, dict[str, Any]]] = []
        self.events: list[Event] = []

    def __len__(self) -> int:
        return sum(len(part["p"]) for _, part in self.parts)

    def column(self, name: str) -> np.ndarray:
        """One number per point."""
        return np.concatenate([part[name] for _, part in self.parts]) if self.parts else np.zeros(0)

    def stable(self) -> np.ndarray:
        """1 or 0 per point, nan where not known: also between two points of which one repeats the other."""
        growing = self.column("growing")
        out = np.where(np.isnan(growing), np.nan, growing == 0)
        for kept, repeated in repetitions(self.events, growing):
            first, last = sorted((kept.index, repeated.index))
            out[first:last] = np.nan
        return out

    def exponents(self) -> np.ndarray | None:
        """(n, 2 dof) where every point has them; nan fills up where reduced models have fewer."""
        parts = [part for _, part in self.parts if len(part["p"])]
        known = [part["exponents"] for part in parts if part["exponents"] is not None]
        if not known or len(known) < len(parts):
            return None
        return filled_up([row for part in known for row in part])


def filled_up(rows: list[np.ndarray]) -> np.ndarray:
    """Exponents (n, most) of n points, with nan where a point has fewer than another."""
    out = np.full((len(rows), max(len(row) for row in rows)), np.nan, complex)
    for i, row in enumerate(rows):
        out[i, : len(row)] = row
    return out


def truncation(settled: np.ndarray, events: Sequence[Event]) -> str:
    """Count of what the harmonics that were left out decide on a curve, with the remedy; "" where they decide nothing."""
    points, special = int(np.sum(~settled.astype(bool))), [e for e in events if e.status == "unresolved"]
    counts = [(points, "the stability of {} point"), (len(special), "{} special point")]
    what = [text.format(n) + "s" * (n > 1) for n, text in counts if n]
    return f"harmonics that were left out decide {' and '.join(what)}: take more harmonics" if what else ""


CROSSINGS = {"fold": 1, "branch-point": 1, "period-doubling": 1, "neimark-sacker": 2}


def repetitions(events: list[Event], growing: np.ndarray) -> list[tuple[Event, Event]]:
    """Pairs of a point where the determinant vanishes and of one where a real exponent does, of which the second is the first one
    told again: the exponents, integrated over a period, do not vanish at just the place where the truncated equations are singular,
    and the end of a step may lie between the two places. Fewer exponents change sides there than the events say."""
    found: list[tuple[Event, Event]] = []
    for i, event in enumerate(events):
        if event.exponent is not None or event.kind not in ("fold", "branch-point"):
            continue
        others = [e for e in events[max(i - 1, 0) : i + 2] if e.kind == "branch-point" and e.exponent is not None]
        if not others or not _too_many(events, event, event, growing):
            continue
        other = min(others, key=lambda e: abs(e.index - event.index))
        first, last = sorted((event, other), key=lambda e: e.index)
        if _too_many(events, first, last, growing):
            found.append((event, other))
    return found


def _too_many(events: list[Event], first: Event, last: Event, growing: np.ndarray) -> bool:
    """True where the number of growing exponents changes from before one event to behind another by an odd number more or less than
    the events in between say."""
    known = np.flatnonzero(~np.isnan(growing))
    before, behind = known[known < first.index], known[known >= last.index]
    if not len(before) or not len(behind):
        return False
    crossings = [CROSSINGS.get(e.kind) for e in events if before[-1] < e.index <= behind[0]]
    if None in crossings:
        return False
    return bool((growing[behind[0]] - growing[before[-1]] - sum(n for n in crossings if n)) % 2)


def resolved(
    events: list[Event], parameter: Callable[[Event], float], aliasing: np.ndarray, growing: np.ndarray
) -> tuple[Event, ...]:
    """The events without those told twice, and without pairs of folds that lie nearer to each other than the error that samples
    make: where samples come into contact one by one, the sampled equations have corners, at which their branch turns and turns
    back."""
    kept: list[Event] = []
    again = [repeated for _, repeated in repetitions(events, growing)]
    for event in events:
        if any(event is other for other in again):
            continue
        last = kept[-1] if kept else None
        if event.kind == "fold" and last is not None and last.kind == "fold" and len(aliasing):
            a, b = parameter(last), parameter(event)
            near = aliasing[max(min(last.index, len(aliasing)) - 1, 0) : event.index + 1]
            if abs(a - b) <= float(np.max(near, initial=0.0)) * abs(a):
                kept.pop()
                continue
        kept.append(event)
    return tuple(kept)
