"""Accuracy and cost of one analysis over a grid of settings (see also `effect_study`)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import UNFIT
from .._lib.progress import Progress
from .._lib.text import Block, number, si
from ..errors import Interrupted, MbrsError, ModelError
from ..results import Result, Stats, result
from .measures import measure_for
from .timing import name_of, short, timed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["AccuracyStudy", "Recommendation", "accuracy_study"]

# Arguments that are vectors or lists by nature: they are passed as they stand unless `vary` names them.
VECTOR_ARGUMENTS = frozenset(
    [
        "force",
        "forces",
        "amplitude",
        "inputs",
        "outputs",
        "loads",
        "frequency",
        "omega",
        "speed",
        "t",
        "at",
        "x0",
        "without",
        "parameters",
        "elements",
    ]
)
_SMALLER_IS_FINER = frozenset({"rtol", "atol", "tol", "tolerance", "step", "h", "dt", "ds", "core_radius"})


@dataclass(frozen=True, eq=False)
class StudyPoint:
    """One run: its ``settings`` as labels, best wall ``time`` (s), ``error`` (nan if unknown), ``status``."""

    settings: Mapping[str, str]
    arguments: Mapping[str, Any]
    time: float
    error: float
    status: str
    estimate: float
    is_reference: bool = False
    numeric: Mapping[str, float] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The numeric settings, short, to stand beside a point in a plot."""
        return ", ".join(self.settings[name] for name in self.numeric)


@dataclass(frozen=True)
class Recommendation:
    """The cheapest setting that reaches an error, or the most accurate one where none does (not ``reached``)."""

    settings: Mapping[str, Any]
    time: float
    error: float
    reached: bool
    reason: str

    def __str__(self) -> str:
        return self.reason


@result
class AccuracyStudy(Result):
    """Measured error against measured time over a grid of settings; see `accuracy_study`.

    ``points`` holds the runs in the order of the grid, ``settings`` the names of the settings, ``measure`` what the error
    is, ``reference`` which run or object the error is measured against.
    """

    points: tuple[StudyPoint, ...]
    settings: tuple[str, ...]
    measure: str
    reference: str

    row: ClassVar[str] = "run"
    largest_error: ClassVar[float] = np.inf  # errors of runs, which the study measures; it has none of its own

    def labelled(self) -> dict[str, tuple[tuple[str, ...], Any, str, str]]:
        """One entry per run: its settings as texts, ``time`` (s), ``error``, ``estimate``, ``status``."""
        texts = {name: np.array([p.settings[name] for p in self.points], dtype=str) for name in self.settings}
        texts["status"] = np.array([p.status for p in self.points], dtype=str)
        numbers = {n: np.array([getattr(p, n) for p in self.points]) for n in ("time", "error", "estimate")}
        units = {"time": "s"}
        return {name: (("run",), value, units.get(name, ""), name) for name, value in {**texts, **numbers}.items()}

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "measure": self.measure, "reference": self.reference}

    def heading(self) -> str:
        return "accuracy study"

    def blocks(self) -> list[Block]:
        return [Block(*self.rows(), title=self.heading(), footer="\n".join(self.notes()), digits=4)]

    def lines(self) -> list[tuple[str, list[StudyPoint]]]:
        """The runs that succeeded, one group for each combination of categorical settings, with a label for it."""
        groups: dict[str, list[StudyPoint]] = {}
        for point in self.points:
            chosen = {name: text for name, text in point.settings.items() if name not in point.numeric}
            named = any(text[:1].isdigit() for text in chosen.values())
            label = ", ".join(f"{name} = {text}" if named else text for name, text in chosen.items())
            groups.setdefault(label, []).append(point)
        return list(groups.items())

    def recommend(self, error: float) -> Recommendation:
        """The cheapest setting whose measured error is at most ``error``, and why.

        Raises
        ------
        ModelError
            ``error`` is not a positive number, or no run has a measured error.
        """
        if not (isinstance(error, int | float | np.number) and error > 0.0 and math.isfinite(error)):
            raise ModelError(f"error={error!r} must be a positive number")
        known = [p for p in self.points if math.isfinite(p.error) and not p.is_reference]
        if not known:
            raise ModelError("no run of this study has a measured error; see print(study) for what happened")
        good = [p for p in known if p.error <= error]
        best = min(good, key=lambda p: p.time) if good else min(known, key=lambda p: (p.error, p.time))
        return Recommendation(best.arguments, best.time, best.error, bool(good), _reason(best, good, known, error))

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        columns = [*self.settings, "time [ms]", "error", "estimate", "status"]
        rows = []
        for p in self.points:
            status = p.status + (" (reference)" if p.is_reference else "")
            error = math.nan if p.is_reference else p.error
            rows.append(
                [*(p.settings[a] for a in self.settings), 1e3 * p.time, short(error), short(p.estimate), status]
            )
        return columns, rows

    def notes(self) -> list[str]:
        estimate = "estimate: the largest .error of the result itself"
        return [f"error: {self.measure}", f"reference: {self.reference}", estimate]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Error against time, logarithmic, one line for each categorical setting; returns the figure."""
        from ..plot import accuracy

        return accuracy(self, ax=ax)


def accuracy_study(
    fun: Callable[..., Any],
    *args: object,
    reference: object = None,
    repeat: int = 3,
    measure: Callable[[Any, Any], float] | None = None,
    vary: Sequence[str] = (),
    **settings: object,
) -> AccuracyStudy:
    """Run ``fun(*args, **one)`` for every combination of settings and measure its error and its time.

    A keyword given as a list or array of several values, or as a dict of label and value, spans the grid; everything
    else, a tuple (a range) and a list of one value included, is passed unchanged. A dict whose values are dicts
    sets several keywords at once: ``setup={"coarse": {"rtol": 1e-3}, "fine": {"rtol": 1e-9}}``. Arguments that are
    vectors by nature (``force``, ``frequency``, ``t``, ``inputs``, ...) never span the grid unless ``vary`` names them.

    Parameters
    ----------
    fun
        An analysis, such as ``mb.modes``.
    args
        Its positional arguments, the model first.
    reference
        The result to compare with: a result of the same kind, or what ``measure`` takes; None takes the run with the
        finest numeric settings (the smallest tolerance or step, the largest of others). Among methods at that setting
        it is the one whose own error estimate is smallest, or without estimates the one that the others agree with
        best.
    repeat
        The time of a setting is the best of this many runs.
    measure
        ``measure(result, reference) -> float``; None chooses by the kind of result (`mbrs.studies.measures`). Its docstring's
        first line is shown as the name of the error.
    vary
        Names of vector arguments that do span the grid.

    Returns
    -------
    AccuracyStudy
        Points in the order of the grid, the last setting fastest. A run that fails with an error of mbrs is recorded.

    Raises
    ------
    ModelError
        Nothing spans the grid; an empty list; no run succeeded; a reference of another kind than the results.
    Interrupted
        Ctrl-C; ``.result`` is the study of the settings that were finished.

    Notes
    -----
    Cost: ``repeat`` times the sum over the grid. An error measured against a self-made reference cannot be trusted
    below the error of that reference itself.

    Examples
    --------
    >>> def integral(f, n):
    ...     x = (np.arange(n) + 0.5) / n
    ...     return float(np.mean(f(x)))
    >>> study = accuracy_study(integral, np.exp, n=[10, 100, 1000], reference=float(np.e - 1), repeat=1)
    >>> [f"{p.error:.0e}" for p in study.points]
    ['4e-04', '4e-06', '4e-08']
    """
    if not (isinstance(repeat, int | np.integer) and repeat >= 1):
        raise ModelError(f"repeat={repeat!r} must be a whole number of at least 1")
    axes, fixed = _split(settings, vary)
    if not axes:
        raise ModelError("no setting spans the grid; give a list of several values, as in rtol=[1e-4, 1e-6, 1e-8]")
    try:
        runs: list[_Run] = []
        _run_all(runs, fun, args, fixed, axes, int(repeat))
    except KeyboardInterrupt:
        text = (
            f"the accuracy study was interrupted after {len(runs)} of {math.prod(len(a.labels) for a in axes)} settings"
        )
        worked = any(run.result is not None for run in runs)
        raise Interrupted(
            text, _study(runs, axes, reference, measure, repeat, "interrupted") if worked else None
        ) from None
    return _study(runs, axes, reference, measure, repeat)


def _study(
    runs: list[_Run],
    axes: list[_Axis],
    reference: Any,
    measure: Callable[[Any, Any], float] | None,
    repeat: int,
    status: str | None = None,
) -> AccuracyStudy:
    done = [run for run in runs if run.result is not None]
    if not done:
        raise ModelError(f"no setting of the study worked; the first failed with: {runs[0].status}")
    measure = measure or measure_for(done[0].result)
    chosen = None
    if reference is None:
        chosen, why = _self_made(done, axes, measure)
        reference = chosen.result
    else:
        why = (
            "the given result"
            if not isinstance(reference, int | float | complex)
            else f"the given value {number(reference)}"
        )
    points = tuple(_point(run, axes, measure, reference, run is chosen) for run in runs)
    stats = Stats(wall_time=sum(run.spent for run in runs), counts={"runs": int(repeat) * len(runs)})
    errors = np.array([p.error for p in points])
    names = tuple(axis.name for axis in axes)
    status = status or ("converged" if len(done) == len(runs) else "stopped")
    return AccuracyStudy(points, names, name_of(measure), why, stats=stats, error=errors, status=status)


@dataclass(frozen=True)
class _Axis:
    name: str
    labels: list[str]
    keywords: list[dict[str, Any]]
    numbers: list[float] | None

    def finest(self) -> float | None:
        """The value of the finest setting, or None for a categorical axis."""
        if self.numbers is None:
            return None
        return min(self.numbers) if self.name in _SMALLER_IS_FINER else max(self.numbers)


@dataclass(eq=False)
class _Run:
    place: tuple[int, ...]
    arguments: dict[str, Any]
    result: Any
    time: float
    spent: float
    status: str


def _split(settings: Mapping[str, Any], vary: Sequence[str]) -> tuple[list[_Axis], dict[str, Any]]:
    unknown = set(vary) - set(settings)
    if unknown:
        raise ModelError(f"vary names {sorted(unknown)}, which are not among the settings {sorted(settings)}")
    axes, fixed = [], {}
    for name, value in settings.items():
        if name in VECTOR_ARGUMENTS and name not in vary:
            fixed[name] = value
        elif isinstance(value, Mapping):
            axes.append(_axis(name, list(value.values()), [str(label) for label in value]))
        elif isinstance(value, list | np.ndarray) and np.ndim(np.asarray(value, dtype=object)) > 0 and len(value) != 1:
            axes.append(_axis(name, list(value), None))
        else:
            fixed[name] = value
    return axes, fixed


def _axis(name: str, values: list[Any], labels: list[str] | None) -> _Axis:
    if not values:
        raise ModelError(f"the setting {name!r} is empty; give it at least one value")
    values = [v.item() if isinstance(v, np.generic) else v for v in values]
    plain = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    keywords = [dict(v) if isinstance(v, Mapping) else {name: v} for v in values]
    shown = labels or [number(v, 4) if isinstance(v, int | float) else _text(v) for v in values]
    return _Axis(name, shown, keywords, [float(v) for v in values] if plain else None)


def _text(value: Any) -> str:
    return str(getattr(value, "__name__", value))


def _run_all(
    runs: list[_Run], fun: Callable[..., Any], args: Any, fixed: Mapping[str, Any], axes: list[_Axis], repeat: int
) -> None:
    """Appends a run for every setting, so that those before an interrupt are kept."""
    places = list(itertools.product(*(range(len(axis.labels)) for axis in axes)))
    with Progress("accuracy study", len(places)) as progress:
        for place in places:
            own: dict[str, Any] = {}
            for axis, i in zip(axes, place, strict=True):
                own |= axis.keywords[i]
            result, best, spent, status = timed(fun, args, {**fixed, **own}, repeat)
            runs.append(_Run(place, own, result, best, spent, status))
            progress.advance(note=", ".join(axis.labels[i] for axis, i in zip(axes, place, strict=True)))


def _self_made(done: list[_Run], axes: list[_Axis], measure: Callable[[Any, Any], float]) -> tuple[_Run, str]:
    """The run to compare with. Fine settings may have failed, so the ranks of what worked decide."""

    def rank(run: _Run) -> tuple[float, ...]:
        ranks = []
        for axis, i in zip(axes, run.place, strict=True):
            if axis.numbers is not None:
                ranks.append(axis.numbers[i] if axis.name in _SMALLER_IS_FINER else -axis.numbers[i])
        return tuple(ranks)

    finest = min(rank(run) for run in done)
    rivals = [run for run in done if rank(run) == finest]
    name = "finest setting" if finest else "one of the settings"
    if len(rivals) == 1:
        chosen, why = rivals[0], "the finest numeric setting that worked"
    else:
        chosen, why = _most_trusted(rivals, measure)
    label = ", ".join(axis.labels[i] for axis, i in zip(axes, chosen.place, strict=True))
    return chosen, f"self-made, {name} ({label}): {why}"


def _most_trusted(rivals: list[_Run], measure: Callable[[Any, Any], float]) -> tuple[_Run, str]:
    estimates = [_estimate(run.result) for run in rivals]
    if all(math.isfinite(e) for e in estimates):
        return rivals[int(np.argmin(estimates))], "its own error estimate is the smallest"
    distances = [[_safely(measure, one.result, other.result) for other in rivals if other is not one] for one in rivals]
    middle = [float(np.median(d)) for d in distances]
    if len(rivals) > 2 and all(math.isfinite(m) for m in middle):
        return rivals[int(np.argmin(middle))], "the others agree with it best"
    return max(rivals, key=lambda run: run.time), "the most expensive one, since nothing else tells them apart"


def _point(run: _Run, axes: list[_Axis], measure: Callable[[Any, Any], float], reference: Any, own: bool) -> StudyPoint:
    labels = {axis.name: axis.labels[i] for axis, i in zip(axes, run.place, strict=True)}
    numeric = {axis.name: axis.numbers[i] for axis, i in zip(axes, run.place, strict=True) if axis.numbers is not None}
    if run.result is None:
        return StudyPoint(labels, run.arguments, run.time, math.nan, run.status, math.nan, numeric=numeric)
    error = math.nan if own else float(measure(run.result, reference))
    return StudyPoint(labels, run.arguments, run.time, error, run.status, _estimate(run.result), own, numeric)


def _estimate(result: Any) -> float:
    """The largest error that a result estimates for itself, nan where it has none."""
    own = getattr(result, "error", None)
    if own is None:
        return math.nan
    try:
        values = np.abs(np.asarray(own, dtype=float))
    except UNFIT:
        return math.nan
    return float(np.nanmax(values)) if values.size and not np.isnan(values).all() else math.nan


def _safely(measure: Callable[[Any, Any], float], one: Any, other: Any) -> float:
    try:
        return float(measure(one, other))
    except MbrsError:
        return math.nan


def _reason(best: StudyPoint, good: list[StudyPoint], known: list[StudyPoint], error: float) -> str:
    label = ", ".join(f"{name}={text}" for name, text in best.settings.items())
    cost = f"{label}: error {best.error:.1e} in {si(best.time, 's', 3)}"
    if not good:
        return f"no setting reaches {error:.1e}; the most accurate is {cost}"
    others = sorted((p for p in good if p is not best), key=lambda p: p.time)
    if not others:
        return f"{cost}; the only one of {len(known)} settings within {error:.1e}"
    second = others[0]
    rival = ", ".join(f"{name}={text}" for name, text in second.settings.items())
    ratio = second.time / best.time if best.time > 0.0 else math.inf
    cheapest = f"the cheapest of {len(good)} settings within {error:.1e}"
    return f"{cost}; {cheapest}, the next ({rival}) takes {ratio:.2g} times as long"
