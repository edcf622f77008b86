"""Branches of periodic solutions in frequency, force level or a parameter of the system, as an iterator: the engine under
`mbrs.frequency_response` and `mbrs.parameter_response`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from .. import _core
from .._lib.checks import positive, real_number, shown, two_ends
from .._lib.progress import Progress
from ..errors import ConvergenceError, Interrupted, MbrsError, ModelError, SingularError
from ..results import Stats
from . import balance
from .branch_options import BranchOptions, first_set, one_of_each, range_and_level
from .branch_points import STATUS, BranchPoint, Chunks, Event, checked_event, resolved, truncation
from .options import MOST_HARMONICS, Continuation, Fourier, Newton, point_number, points
from .periodic import effects_of, first_solution
from .response_curve import FrequencyResponse, Part, known_stability
from .system import as_system

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from ..linear.aliases import Coefficients, Force, Ports
    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from ..system.state import StateLike

F = TypeVar("F", bound=Callable[..., Any])
# Points between two looks at samples and progress: a count, so that no clock decides where samples change. Larger: more points with too
# many or too few samples. Smaller: looks cost more than points. Pinned by tests/nonlinear/test_continuation.py.
CHUNK_POINTS = 20
CORNERED = 1e-6  # steps below are those around corners that samples make
NO_WORK = {"corrections": 0, "factorisations": 0, "refinements": 0}


class Branch(Iterator[BranchPoint]):
    """A branch of periodic solutions that is stepped point by point; iterate over it, or call `run`.

    Takes what `mbrs.frequency_response` takes. With ``level=(a, b)`` the frequency is one number and the branch runs in a
    factor on the (non-static) forces. With ``value=(a, b)`` and ``family``, a function of the value that returns system and
    force, it runs in that value, frequency and level being numbers.

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
    >>> branch = mb.Branch(duffing, force=[0.18], omega=(0.5, 1.6))
    >>> round(next(branch).omega, 6)
    0.5
    """

    def __init__(
        self,
        system: Model | MechanicalSystem | None,
        *,
        force: Force | Callable[..., Any] | None = None,
        inputs: Ports | Mapping[int, Ports] | None = None,
        amplitude: ArrayLike | Callable[[float], Any] | None = None,
        omega: float | tuple[float, float] | None = None,
        frequency: float | tuple[float, float] | None = None,
        level: float | tuple[float, float] = 1.0,
        family: Callable[[float], tuple[Any, Any]] | None = None,
        value: tuple[float, float] | None = None,
        harmonics: int | str | Sequence[int] = 7,
        n_samples: int | None = None,
        subharmonic: int = 1,
        condense: bool | str = "auto",
        x0: Coefficients | None = None,
        tol: float | None = None,
        predictor: str = "tangent",
        corrector: str = "pseudo-arclength",
        step: float = 0.01,
        min_step: float = 1e-9,
        max_step: float = 0.1,
        tolerance: float = 1e-9,
        stability: bool = True,
        events: bool = True,
        at: StateLike = None,
        without: Sequence[str] = (),
    ) -> None:
        self.family = family
        self.value: tuple[float, float] | None = None
        w = balance.one_frequency(omega, frequency)
        self.over = "frequency" if omega is None else "omega"
        if family is None:
            self.system, self.force = as_system(system, force, amplitude, at, without, inputs)
            self.parameter = "omega" if w.shape == (2,) else "level"
            self.omega, self.level = range_and_level(w, level)
        else:
            self.parameter, self.value = "family", two_ends("value", value)
            self.omega, self.level = one_of_each(w, level)
            self.system, self.force = family(self.value[0])
        self.fourier = Fourier(harmonics, n_samples, subharmonic, condense, tol)
        self.continuation = Continuation(predictor, corrector, step, min_step, max_step, tolerance, stability, events)
        begin = first_set(force if inputs is None else inputs) if self.fourier.automatic else harmonics
        self.setup = self._problem(begin)
        self.chunks = Chunks()
        self.status, self.reason = "going", ""
        self.work, self._work_before = dict(NO_WORK), dict(NO_WORK)
        self._read = self._base = 0
        self._stalled = False
        self._exhausted = False  # more harmonics or samples did not find the branch again
        self._core = self._first(x0)

    @property
    def _span(self) -> tuple[float, float]:
        if self.value is not None:
            return self.value
        return self.omega if self.parameter == "omega" else self.level

    def _where(self, p: float) -> tuple[float, float, float | None]:
        """Frequency, level and value at the parameter p."""
        if self.parameter == "omega":
            return p, self.level[0], None
        return (self.omega[0], p, None) if self.parameter == "level" else (self.omega[0], self.level[0], p)

    def _problem(self, harmonics: Any, least_samples: int = 0) -> balance.Setup:
        fourier, omega = self.fourier.chosen(harmonics), self.omega[0]
        if self.family is None:
            setup = balance.prepare(self.system, self.force, fourier, omega, least_samples=least_samples)
        else:
            a, b = self._span
            setup = balance.prepare_family(self.family, a, abs(b - a), fourier, omega, least_samples)
        # a reduced model is that of one system; a family has its own matrices, or no stability
        stable = self.continuation.stability and self.family is None
        self._model = setup.model(max(self.omega)) if stable else None
        return setup

    def _first(self, x0: Any) -> Any:
        """The branch at the beginning of its range; where no start at rest leads there, with growing sets of harmonics."""
        begin = self._span[0]
        try:
            return self._start(self.setup.start(x0), begin, None)
        except ConvergenceError:
            if x0 is not None:
                raise
            omega, level, _ = self._where(begin)
            force = balance.scaled_force(self.force, level)
            fourier, newton = self.fourier.chosen(self.setup.harmonics), Newton(self.continuation.tolerance)
            setup, answer = first_solution(self.system, force, omega, fourier, newton, None)
            if not answer["converged"]:
                raise
            self.setup = self._problem(self.setup.harmonics, setup.n_samples)
            return self._start(answer["y"], begin, None)

    def _start(
        self,
        y: np.ndarray,
        begin: float,
        towards: np.ndarray | None,
        across: bool = False,
        step: float | None = None,
    ) -> Any:
        a, b = self._span
        steps = self.continuation if step is None else replace(self.continuation, step=step)
        return balance.call_core(
            _core.HbmBranch,
            self.setup.core,
            y,
            ([self.omega[0]], self.level[0]),
            balance.path(self.parameter, begin, (a, b), towards, across),
            steps.core,
            self._model,
        )

    @property
    def events(self) -> tuple[Event, ...]:
        """Special points so far, without the pairs of folds that corners of the samples make, and none told twice."""
        aliasing, growing = self.chunks.column("aliasing"), self.chunks.column("growing")
        return resolved(self.chunks.events, self._parameter_of, aliasing, growing)

    def follow(self, most: int, progress: bool | None, what: str = "frequency response") -> None:
        """Run up to so many points, with a line on a terminal about where the branch is."""
        with Progress(f"{what}, points", always=progress) as line:
            while self.status == "going" and len(self.chunks) < most:
                before = len(self.chunks)
                self.run(most - before, 0.2)
                line.advance(len(self.chunks) - before, note=self._note() if line.due else "")

    def _note(self) -> str:
        """Present point of the branch in words: frequency, amplitude, harmonics, step, events."""
        if len(self.chunks) == 0:
            return self.status
        last = self.point(len(self.chunks) - 1)
        where = f"{last.omega / (2 * np.pi):.6g} Hz"
        if self.parameter == "level":
            where += f"  level {last.level:.4g}"
        return (
            f"{where}  |X| {float(np.max(np.abs(last.X))):.4g}  H {self.setup.harmonics[-1]}  step {last.step:.1e}  "
            f"events {len(self.chunks.events)}"
        )

    def curve(self, wall_time: float = 0.0) -> FrequencyResponse:
        """The branch so far as a curve, also of a branch that `switch` began; run it first."""
        if self.family is not None:
            raise ModelError("a branch in a parameter of the system is collected by parameter_response")
        if len(self.chunks) == 0:
            raise ModelError("the branch has no points yet; call run() first")
        return FrequencyResponse(**self.fields(wall_time))

    def fields(self, wall_time: float) -> dict[str, Any]:
        """The branch so far as the fields of a `FrequencyResponse`."""
        error = self.chunks.column("error")
        limit = self.fourier.limit()
        status, events = "max-points" if self.status == "going" else self.status, self.events
        truncated = truncation(self.chunks.column("settled"), events)
        if status == "converged" and (truncated or not np.all(error <= limit)):
            status = "unresolved"
        chunks = [(setup, part) for setup, part in self.chunks.parts if len(part["p"])]
        parts = tuple(self._part(setup, part) for setup, part in chunks)
        counts = {
            "points": len(error),
            **self.work,
            "monodromies": sum(part["monodromies"] for _, part in chunks),
        }
        return dict(
            omega=np.concatenate([part.omega for part in parts]),
            level=np.concatenate([part.level for part in parts]),
            stable=known_stability(self.chunks.stable(), self.continuation.stability),
            exponents=self.chunks.exponents(),
            events=events,
            parts=parts,
            system=self.system,
            force=self.force,
            branch=self,
            reason="; ".join(filter(None, (self.reason, truncated))),
            over=self.over,
            stats=Stats(wall_time, counts, effects_of(self.system), self.setup.route),
            error=error,
            status=status,
        )

    def _part(self, setup: balance.Setup, chunk: dict[str, Any]) -> Part:
        p = chunk["p"]
        omega, level = np.full(len(p), self.omega[0]), np.full(len(p), self.level[0])
        if self.parameter == "family":
            return Part(setup, omega, level, chunk["y"], p)
        return Part(setup, p, level, chunk["y"]) if self.parameter == "omega" else Part(setup, omega, p, chunk["y"])

    def run(self, max_points: int = 1, seconds: float = np.inf) -> int:
        """Adds up to ``max_points`` points, within about ``seconds``; returns how many. `status` says why none came."""
        points(max_points, least=0)
        if seconds is not np.inf:
            seconds = real_number("seconds", seconds, 0.0)
        known = len(self.chunks)
        while len(self.chunks) < known + max_points and self.status == "going" and seconds > 0:
            if self._core is None:
                self._go_on()
                continue
            wanted = known + max_points - len(self.chunks)
            begin = time.perf_counter()
            try:
                self._take(balance.call_core(self._core.run, min(wanted, CHUNK_POINTS), np.inf))
                if self._stalled:
                    self._sample_finer()
            except MbrsError as problem:
                self._break_off(str(problem))
            except BaseException:  # Ctrl-C, or what a law of the user raised: the points until then are kept
                with suppress(MbrsError):
                    self._take(balance.call_core(self._core.run, 0, 0.0))
                raise
            seconds -= time.perf_counter() - begin
        return len(self.chunks) - known

    def _break_off(self, why: str) -> None:
        """Keeps what the core had found when an error ended the branch."""
        self._take(balance.call_core(self._core.run, 0, 0.0))
        if len(self.chunks) == 0:
            raise ConvergenceError(f"the branch has no first point: {why}")
        self.status, self.reason = "stopped", why

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_core": None, "_model": None}

    def _go_on(self) -> None:
        """The core's branch anew, from the last point in the direction of the last step: after a branch has been saved."""
        self.setup = self._problem(self.setup.harmonics, self.setup.n_samples)
        if len(self.chunks) < 2:
            self.chunks, self._base = Chunks(), 0
            self._core = self._first(None)
            return
        last, before = self._place(-1), self._place(-2)
        step = float(np.clip(self.chunks.column("step")[-1], self.continuation.min_step, self.continuation.max_step))
        if not self._take_up(self._restarted(last, last - before, step)):
            self.status, self.reason = (
                "stopped",
                "the last point was not found again; begin a new branch there, with x0=",
            )

    def _take_up(self, core: Any) -> bool:
        """Goes on with another core that begins at the last point."""
        if core is None:
            return False
        self._forget_last()  # it comes again
        self._core, self._base = core, len(self.chunks)
        self._work_before = dict(self.work)
        return True

    def _sample_finer(self) -> None:
        """Samples that come into contact one by one make corners in the equations that no step gets around; with more samples
        they are smaller."""
        samples = self._more_samples()
        if samples is not None and len(self.chunks) >= 2:
            self._sample_with(samples)

    def _sample_with(self, samples: int) -> None:
        """Goes on from the last point with another number of samples; with the present one where that does not find it."""
        setup, model = self.setup, self._model
        self.setup = self._problem(setup.harmonics, samples)
        last, before = self._place(-1), self._place(-2)
        if self._take_up(self._restarted(last, last - before)):
            self.status, self.reason = "going", ""
        else:
            self.setup, self._model = setup, model

    def _more_samples(self) -> int | None:
        """Four times the samples where their number is free and matters."""
        smooth = all(balance.without_samples(law) for law in self.system.elements)
        more = 4 * self.setup.n_samples
        return None if smooth or self.fourier.n_samples is not None or more > balance.MOST_SAMPLES else more

    def _place(self, i: int) -> np.ndarray:
        """[y, p] of a point, in the present set of harmonics."""
        i = range(len(self.chunks))[i]
        for setup, part in self.chunks.parts:
            if i < len(part["p"]):
                return self._embedded(setup, np.append(part["y"][i], part["p"][i]))
            i -= len(part["p"])
        raise IndexError(i)

    def _take(self, part: dict[str, Any]) -> None:
        base = len(self.chunks)
        events = part.pop("events")
        for event in events:
            event["before"] += self._base  # the core counts from where it was started
        setup = self.setup
        part, events = self._richer(part, events)
        self.chunks.parts.append((setup, part))
        for e in events:
            where = self._where(e["p"])
            s = None if e["exponent"] is None else complex(*e["exponent"])
            index = min(e["before"], base + len(part["p"]))
            built = partial(setup.expand, e["y"], *where)
            status = "converged" if e["settled"] else "unresolved"
            self.chunks.events.append(Event(e["kind"], where[0], where[1], s, index, where[2], status, built))
        self.work = {name: before + part.pop(name) for name, before in self._work_before.items()}
        self.status = STATUS.get(part["status"], part["status"])
        self._stalled = self.status == "stopped" and part.get("broken") is None
        if self.status == "stopped":
            self.reason = self._why(part.get("broken"))

    def _why(self, broken: int | None) -> str:
        if broken is not None:
            return f"elements[{broken}], {self.system.elements[broken]!r}, returned a force that is not finite"
        return f"the corrector does not converge with the least step {self.continuation.min_step:.0e}"

    def _richer(self, part: dict[str, Any], events: list[Any]) -> tuple[dict[str, Any], list[Any]]:
        """Cuts a chunk where harmonics or samples are too few, and goes on with more of them from the point before."""
        found = None if self._exhausted or not len(part["p"]) else self._poor(part)
        if found is None:
            return part, events
        first, harmonics, samples = found
        z = np.column_stack([part["y"], part["p"]])
        before = z[first - 1] if first > 0 else self._last_point()
        old, setup, model = self.setup, self.setup, self._model
        self.setup = self._problem(harmonics, samples)
        here = self._embedded(old, z[first] if before is None else before)
        towards = None if before is None else self._embedded(old, z[first]) - here
        core = self._restarted(here, towards)
        if core is None:
            self.setup, self._model, self._exhausted = setup, model, True
            return part, events
        self._core = core
        self._work_before = {name: before + part[name] for name, before in self._work_before.items()}
        kept = max(first - 1, 0)
        if first == 0 and before is not None:
            self._forget_last()
        part = {key: value[:kept] if isinstance(value, np.ndarray) else value for key, value in part.items()}
        part.update(NO_WORK, status="going")
        self._base = limit = len(self.chunks) + kept
        return part, [e for e in events if e["before"] < limit]

    def _restarted(self, here: np.ndarray, towards: np.ndarray | None, step: float | None = None) -> Any:
        """The branch in the present setup from a point of the last one, or None."""
        # a plane across the branch meets it also beside a fold, where no solution may exist at the old parameter
        first_of_all = towards is None or here[-1] == self._span[0]
        for across in (False, True) if first_of_all else (True, False):
            if across and towards is None:
                continue
            try:
                return self._start(here[:-1], float(here[-1]), towards, across, step)
            except (ConvergenceError, SingularError):
                continue
        return None

    def _forget_last(self) -> None:
        """The last point is about to come again, with more harmonics."""
        while self.chunks.parts and not len(self.chunks.parts[-1][1]["p"]):
            self.chunks.parts.pop()
        setup, part = self.chunks.parts[-1]
        shorter = {key: value[:-1] if isinstance(value, np.ndarray) else value for key, value in part.items()}
        self.chunks.parts[-1] = (setup, shorter)

    def _poor(self, part: dict[str, Any]) -> tuple[int, Any, int] | None:
        """The first point that lacks something, and the harmonics and samples to go on with; None where none does."""
        cornered = part["step"] < CORNERED if self._more_samples() else np.zeros(len(part["p"]), bool)
        cornered = cornered & (np.arange(len(part["p"])) + len(self.chunks) > 0)  # the first point has no step
        lacking = part["aliasing"] > balance.ALIASED * part["error"]
        automatic, limit = self.fourier.automatic, self.fourier.limit()
        if automatic:
            lacking = ~(part["error"] <= limit)
        if not np.any(lacking | cornered):
            return None
        laws, n = self.system.elements, self.setup.n_samples
        top, nu = self.setup.harmonics[-1], self.setup.subharmonic
        for i, (error, aliasing) in enumerate(zip(part["error"], part["aliasing"], strict=True)):
            if cornered[i]:
                return i, self.setup.harmonics, self._more_samples() or n
            wanted = not automatic or not error <= limit
            more = balance.more_samples(n, error, aliasing, laws, self.fourier) if wanted else None
            if more is not None:
                return i, self.setup.harmonics, more
            if automatic and wanted and top < MOST_HARMONICS * nu:
                order = max(top // nu, 1)
                return i, min(MOST_HARMONICS, order + max(2, order // 2)), n
        return None

    def _last_point(self) -> np.ndarray | None:
        for setup, part in reversed(self.chunks.parts):
            if len(part["p"]):
                z = np.append(part["y"][-1], part["p"][-1])
                return z if setup is self.setup else self._embedded(setup, z)
        return None

    def _embedded(self, setup: balance.Setup, z: np.ndarray) -> np.ndarray:
        """[y, p] of another set of harmonics in the present one; harmonic sets only grow, and keep their order."""
        out = np.zeros(self.setup.core.size + 1)
        out[: len(z) - 1] = z[:-1]
        out[-1] = z[-1]
        return out

    def switch(self, event: Event, *, side: int = 1, size: float = 0.01) -> Branch:
        """The other branch through a branch point of this one, or the motions of twice the period that leave it where the
        period doubles, followed over the same range.

        Parameters
        ----------
        event
            One of this branch's events, of the kind "branch-point" or "period-doubling".
        side
            1 or -1: to which side of this branch.
        size
            First distance from it, where the solution has length one; in the units of the coordinates where it is rest.

        Notes
        -----
        At the point [dR/dy, dR/dp] has two null vectors; the new branch leaves along the one that is orthogonal to
        this branch.
        """
        size = positive("size", size)
        if checked_event(event).second_frequency is not None:
            raise ModelError(
                f"no branch of periodic motions leaves at {event}: what begins there has a second frequency, "
                f"{event.second_frequency:.6g} rad/s at first (event.second_frequency), which no force gives and which changes along "
                "it; mb.quasi_periodic finds it: forces=[dict(force=..., omega=...), dict(omega=event.second_frequency)], x0=event"
            )
        if event.kind not in ("branch-point", "period-doubling"):
            raise ModelError(
                f"branches cross at branch points only, and leave at period doublings, not at a {event.kind}"
            )
        if side not in (1, -1):
            raise ModelError(f"side must be 1 or -1, it is {shown(side)}")
        other = Branch.__new__(Branch)
        other.__dict__.update(self.__dict__)
        apart = np.diff([self._coordinates(i) for i in self._around(event)], axis=0)[0]
        if event.kind == "period-doubling":
            apart = other._double(self, apart)
        p = self._parameter_of(event)
        y = other.setup.start(_stretched(event.X, other.setup.subharmonic // self.setup.subharmonic))
        at = balance.call_core(other.setup.core.residual, y, [event.omega], event.level, self.parameter, event.value)
        length = float(np.linalg.norm(y)) or 1.0
        scale = np.append(np.full(len(y), length), abs(self._span[1] - self._span[0]))
        matrix = np.column_stack([at["jacobian"], at["slope"]]) * scale
        null = np.linalg.svd(matrix)[2][-2:]
        along = null @ (apart / scale)
        across = null.T @ np.array([-along[1], along[0]]) / np.linalg.norm(along)
        step = side * size * across * scale
        other.chunks, other.status, other._exhausted = Chunks(), "going", False
        other._read = other._base = 0
        other.work, other._work_before = dict(NO_WORK), dict(NO_WORK)
        other._core = other._start(y + step[:-1], p + float(step[-1]), step, across=True)
        return other

    def _double(self, single: Branch, apart: np.ndarray) -> np.ndarray:
        """Makes this a branch of twice the period of another; a step of that one, in the unknowns of this one."""
        old = single.setup
        self.fourier = self.fourier.but(subharmonic=2 * old.subharmonic)
        self.setup = self._problem(max(1, old.harmonics[-1] // old.subharmonic))
        X = old.expand(apart[:-1], single.omega[0], 0.0)
        return np.append(self.setup.start(_stretched(X, 2)), apart[-1])

    def _around(self, event: Event) -> tuple[int, int]:
        """Numbers of the points on both sides of an event."""
        i = min(max(event.index, 1), len(self.chunks) - 1)
        return i - 1, i

    def _coordinates(self, i: int) -> np.ndarray:
        point = self.point(i)
        return np.append(self.setup.start(point.X), self._parameter_of(point))

    def _parameter_of(self, point: Any) -> float:
        if point.value is not None:
            return float(point.value)
        return float(point.omega if self.parameter == "omega" else point.level)

    def point(self, i: int) -> BranchPoint:
        """The point with this number."""
        i = point_number(i, len(self.chunks))
        stable = float(self.chunks.stable()[i])
        for setup, part in self.chunks.parts:
            if i < len(part["p"]):
                omega, level, value = self._where(float(part["p"][i]))
                exponents = None if part["exponents"] is None else part["exponents"][i]
                X = setup.expand(part["y"][i], omega, level, value)
                return BranchPoint(
                    omega,
                    level,
                    X,
                    float(part["error"][i]),
                    stable,
                    exponents,
                    float(part["step"][i]),
                    value,
                )
            i -= len(part["p"])
        raise IndexError(i)

    def __next__(self) -> BranchPoint:
        while self._read >= len(self.chunks):
            if self.status != "going":
                raise StopIteration
            self.run(1)
        self._read += 1
        return self.point(self._read - 1)


def _stretched(X: np.ndarray, factor: int) -> np.ndarray:
    """Coefficients in terms of a fundamental frequency that is smaller by an integer factor."""
    if factor == 1:
        return X
    top = (X.shape[1] - 1) // 2
    out = np.zeros((X.shape[0], 2 * factor * top + 1))
    out[:, 0] = X[:, 0]
    out[:, 2 * factor - 1 :: 2 * factor], out[:, 2 * factor :: 2 * factor] = X[:, 1::2], X[:, 2::2]
    return out


_OPTIONS = {
    name: p.replace(annotation=getattr(kind, "__forward_arg__", kind))
    for name, p in signature(Branch.__init__).parameters.items()
    if (kind := BranchOptions.__annotations__.get(name)) is not None
}
BRANCH_DEFAULTS: dict[str, Any] = {name: p.default for name, p in _OPTIONS.items()}


def interrupted(branch: Branch, collect: Callable[[], FrequencyResponse]) -> Interrupted:
    """The exception for Ctrl-C in a branch: with its points so far, if there are any."""
    n = len(branch.chunks)
    made = collect().replaced(status="interrupted") if n else None
    return Interrupted(f"a branch was interrupted after {n} points", made)


def takes_branch_options(function: F) -> F:
    """Shows the options of `Branch` in the signature of a function that passes them on as ``**options``."""
    own = signature(function)
    named = [p for p in own.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    shown = [p for p in named if p.kind is not Parameter.KEYWORD_ONLY]
    keywords = [*(p for p in named if p.kind is Parameter.KEYWORD_ONLY), *_OPTIONS.values()]
    function.__signature__ = own.replace(parameters=[*shown, *keywords])  # type: ignore[attr-defined]
    return function
