"""Branches of periodic solutions in frequency or force level, as an iterator: the engine under
`mbrs.frequency_response`."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _balance, _core
from .errors import ModelError
from .harmonic_balance import MOST_HARMONICS

STATUS = {"end": "converged", "start": "left-at-start", "stalled": "stopped"}
MEANING = {
    "converged": "the end of the range was reached",
    "left-at-start": "the branch came back and left the range where it began",
    "max-points": "cut at max_points; .resume() goes on",
    "stopped": "the step became smaller than min_step; the points so far are kept",
    "unresolved": "the end was reached, but an estimated error exceeds the tolerance: take more harmonics",
}
CHUNK_SECONDS = 0.2


@dataclass(frozen=True, eq=False)
class Event:
    """A special point of a branch: ``kind`` "fold", "branch-point", "neimark-sacker" or "period-doubling".

    ``omega`` (rad/s) and ``level`` say where, ``X`` (dof, 2H+1) the motion there, ``exponent`` the Floquet exponent
    that crosses
    (None where it does not matter), ``index`` the number of the first point of the branch behind it.
    """

    kind: str
    omega: float
    level: float
    X: np.ndarray
    exponent: complex | None
    index: int

    @property
    def frequency(self) -> float:
        """Excitation frequency, Hz."""
        return self.omega / (2 * np.pi)

    def __str__(self) -> str:
        return f"{self.kind} at omega = {self.omega:.10g} rad/s, level = {self.level:.6g}"


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """One solution of a branch: ``omega``, ``level``, coefficients ``X`` (dof, 2H+1), ``error``, ``stable`` (nan: not
    known),
    Floquet ``exponents`` or None, the ``step`` that led here."""

    omega: float
    level: float
    X: np.ndarray
    error: float
    stable: float
    exponents: np.ndarray | None
    step: float


class Chunks:
    """What has been computed of a branch so far, as lists of arrays; ``terms`` of a chunk say which harmonics it
    holds."""

    def __init__(self) -> None:
        self.parts: list[tuple[_balance.Setup, dict[str, Any]]] = []
        self.events: list[Event] = []

    def __len__(self) -> int:
        return sum(len(part["p"]) for _, part in self.parts)

    def column(self, name: str) -> np.ndarray:
        """One number per point."""
        return np.concatenate([part[name] for _, part in self.parts]) if self.parts else np.zeros(0)

    def exponents(self) -> np.ndarray | None:
        """(n, 2 dof) where every point has them."""
        parts = [part for _, part in self.parts if len(part["p"])]
        known = [part["exponents"] for part in parts if "exponents" in part]
        return np.concatenate(known) if known and len(known) == len(parts) else None


class Branch(Iterator[BranchPoint]):
    """A branch of periodic solutions that is stepped point by point; iterate over it, or call `run`.

    Takes what `mbrs.frequency_response` takes. With ``level=(a, b)`` the frequency is one number and the branch runs
    in a factor on
    the (non-static) forces.

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
    >>> branch = mb.continuation.Branch(duffing, force=[0.18], omega=(0.5, 1.6))
    >>> round(next(branch).omega, 6)
    0.5
    """

    def __init__(
        self,
        system: Any,
        *,
        force: Any,
        omega: Any = None,
        frequency: Any = None,
        level: Any = 1.0,
        harmonics: Any = 7,
        n_samples: int | None = None,
        subharmonic: int = 1,
        condense: bool | str = "auto",
        x0: Any = None,
        tol: float | None = None,
        predictor: str = "tangent",
        corrector: str = "pseudo-arclength",
        step: float = 0.01,
        min_step: float = 1e-9,
        max_step: float = 0.1,
        tolerance: float = 1e-9,
        stability: bool = True,
        events: bool = True,
    ) -> None:
        self.system, self.force = system, force
        w = _balance.one_frequency(omega, frequency)
        self.parameter = "omega" if w.shape == (2,) else "level"
        self.omega, self.level = _range_and_level(w, level)
        self._auto = isinstance(harmonics, str)
        if self._auto and harmonics != "auto":
            raise ModelError(f'harmonics must be a number, a sequence or "auto", it is {harmonics!r}')
        self.tol = _balance.positive("tol", tol) if tol is not None else (1e-6 if self._auto else None)
        self._prepare: dict[str, Any] = dict(subharmonic=subharmonic, n_samples=n_samples, condense=condense)
        self.setup = self._problem(3 if self._auto else harmonics)
        limits = [_balance.positive(n, v) for n, v in [("step", step), ("min_step", min_step), ("max_step", max_step)]]
        if not limits[1] <= limits[0] <= limits[2]:
            raise ModelError(f"min_step <= step <= max_step must hold, they are {limits[1]}, {limits[0]}, {limits[2]}")
        self._options: dict[str, Any] = dict(
            predictor=predictor,
            corrector=corrector,
            first_step=limits[0],
            least_step=limits[1],
            largest_step=limits[2],
            tolerance=_balance.positive("tolerance", tolerance),
            stability=bool(stability),
            events=bool(events),
        )
        self.stability = bool(stability)
        self.chunks = Chunks()
        self.status = "going"
        self.corrections = self.factorisations = 0
        self._corrections_before = self._factorisations_before = 0
        self._read = self._base = 0
        self._core = self._start(self.setup.start(x0), self._span[0], None)

    @property
    def _span(self) -> tuple[float, float]:
        return self.omega if self.parameter == "omega" else self.level

    def _problem(self, harmonics: Any) -> _balance.Setup:
        return _balance.prepare(self.system, self.force, harmonics, omega=self.omega[0], **self._prepare)

    def _start(self, y: np.ndarray, begin: float, towards: np.ndarray | None, across: bool = False) -> Any:
        a, b = self._span
        return _balance.translated(
            _core.HbmBranch,
            self.setup.core,
            y,
            [self.omega[0]],
            self.level[0],
            self.parameter,
            begin,
            a,
            b,
            towards=towards,
            across=across,
            **self._options,
        )

    def run(self, max_points: int = 1, seconds: float = np.inf) -> int:
        """Adds up to ``max_points`` points, within about ``seconds``; returns how many. `status` says why none came."""
        wanted = max_points
        while wanted > 0 and self.status == "going" and seconds > 0:
            points = min(wanted, 20) if self._auto else wanted
            part = _balance.translated(self._core.run, points, min(seconds, CHUNK_SECONDS))
            seconds -= CHUNK_SECONDS
            wanted -= len(part["p"])
            self._take(part)
        return max_points - wanted

    def _take(self, part: dict[str, Any]) -> None:
        base = len(self.chunks)
        events = part.pop("events")
        for event in events:
            event["before"] += self._base  # the core counts from where it was started
        if self._auto and self.tol is not None:
            part, events = self._richer(part, events)
        self.chunks.parts.append((self.setup, part))
        for e in events:
            omega, level = (e["p"], self.level[0]) if self.parameter == "omega" else (self.omega[0], e["p"])
            X = self.setup.expand(e["y"], omega)
            s = None if e["exponent"] is None else complex(*e["exponent"])
            self.chunks.events.append(Event(e["kind"], omega, level, X, s, min(e["before"], base + len(part["p"]))))
        self.corrections = self._corrections_before + part.pop("corrections")
        self.factorisations = self._factorisations_before + part.pop("factorisations")
        self.status = STATUS.get(part["status"], part["status"])

    def _richer(self, part: dict[str, Any], events: list[Any]) -> tuple[dict[str, Any], list[Any]]:
        """Cuts a chunk where its error passes the tolerance and goes on from there with more harmonics."""
        poor = np.flatnonzero(~(part["error"] <= self.tol))
        top = self.setup.harmonics[-1]
        if len(poor) == 0 or top >= MOST_HARMONICS * self.setup.subharmonic:
            return part, events
        first = int(poor[0])
        z = np.column_stack([part["y"], part["p"]])
        before = z[first - 1] if first > 0 else self._last_point()
        old, order = self.setup, max(top // self.setup.subharmonic, 1)
        self.setup = self._problem(min(MOST_HARMONICS, order + max(2, order // 2)))
        begin = float(part["p"][first])
        here = self._embedded(old, z[first])
        towards = None if before is None else here - self._embedded(old, before)
        if towards is not None and len(part["p"]) == 1 and first == 0 and not np.any(towards):
            towards = None
        self._corrections_before += part["corrections"]
        self._factorisations_before += part["factorisations"]
        self._core = self._start(here[:-1], begin, towards)
        part["corrections"] = part["factorisations"] = 0
        part = {key: value[:first] if isinstance(value, np.ndarray) else value for key, value in part.items()}
        part["status"] = "going"
        self._base = limit = len(self.chunks) + first
        return part, [e for e in events if e["before"] < limit]

    def _last_point(self) -> np.ndarray | None:
        for setup, part in reversed(self.chunks.parts):
            if len(part["p"]):
                z = np.append(part["y"][-1], part["p"][-1])
                return z if setup is self.setup else self._embedded(setup, z)
        return None

    def _embedded(self, setup: _balance.Setup, z: np.ndarray) -> np.ndarray:
        """[y, p] of another set of harmonics in the present one; harmonic sets only grow, and keep their order."""
        out = np.zeros(self.setup.core.size + 1)
        out[: len(z) - 1] = z[:-1]
        out[-1] = z[-1]
        return out

    def switch(self, event: Event, *, side: int = 1, size: float = 0.01) -> Branch:
        """The other branch through a branch point of this one, followed over the same range.

        Parameters
        ----------
        event
            One of this branch's events, of the kind "branch-point".
        side
            1 or -1: to which side of this branch.
        size
            First distance from it, where the solution has length one.

        Notes
        -----
        At the point [dR/dy, dR/dp] has two null vectors; the new branch leaves along the one that is orthogonal to
        this branch.
        """
        if event.kind != "branch-point":
            raise ModelError(f"branches cross at branch points only, not at a {event.kind}")
        if side not in (1, -1):
            raise ModelError(f"side must be 1 or -1, it is {side!r}")
        over_omega = self.parameter == "omega"
        p = event.omega if over_omega else event.level
        y = self.setup.start(event.X)
        at = _balance.translated(self.setup.core.residual, y, [event.omega], event.level, self.parameter)
        scale = np.append(np.full(len(y), max(float(np.linalg.norm(y)), 1e-300)), abs(self._span[1] - self._span[0]))
        matrix = np.column_stack([at["jacobian"], at["slope"]]) * scale
        null = np.linalg.svd(matrix)[2][-2:]
        i = min(max(event.index, 1), len(self.chunks) - 1)
        along = null @ ((self._coordinates(i) - self._coordinates(i - 1)) / scale)
        across = null.T @ np.array([-along[1], along[0]]) / np.linalg.norm(along)
        step = side * size * across * scale
        other = copy.copy(self)
        other.chunks, other.status = Chunks(), "going"
        other._read = other._base = other.corrections = other.factorisations = 0
        other._corrections_before = other._factorisations_before = 0
        other._core = other._start(y + step[:-1], p + float(step[-1]), step, across=True)
        return other

    def _coordinates(self, i: int) -> np.ndarray:
        point = self.point(i)
        return np.append(self.setup.start(point.X), point.omega if self.parameter == "omega" else point.level)

    def point(self, i: int) -> BranchPoint:
        """The point with this number."""
        for setup, part in self.chunks.parts:
            if i < len(part["p"]):
                p = float(part["p"][i])
                omega, level = (p, self.level[0]) if self.parameter == "omega" else (self.omega[0], p)
                exponents = part["exponents"][i] if "exponents" in part else None
                X = setup.expand(part["y"][i], omega)
                return BranchPoint(
                    omega,
                    level,
                    X,
                    float(part["error"][i]),
                    float(part["stable"][i]),
                    exponents,
                    float(part["step"][i]),
                )
            i -= len(part["p"])
        raise IndexError(i)

    def __next__(self) -> BranchPoint:
        if self._read >= len(self.chunks) and self.run(1) == 0:
            raise StopIteration
        self._read += 1
        return self.point(self._read - 1)


def _range_and_level(w: np.ndarray, level: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    try:
        levels = np.asarray(level, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"level must be a number or a range (a, b), it is {level!r}") from None
    if not np.all(np.isfinite(levels)):
        raise ModelError(f"level must be finite, it is {level!r}")
    if w.shape == (2,) and levels.shape == ():
        if w[0] == w[1]:
            raise ModelError(f"the range of frequencies is empty: {w[0]} to {w[1]}")
        return (float(w[0]), float(w[1])), (float(levels), float(levels))
    if w.shape == () and levels.shape == (2,):
        if levels[0] == levels[1]:
            raise ModelError(f"the range of levels is empty: {levels[0]} to {levels[1]}")
        return (float(w), float(w)), (float(levels[0]), float(levels[1]))
    raise ModelError("a branch needs one range: omega=(a, b) with one level, or one omega with level=(a, b)")
