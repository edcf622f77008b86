"""Influence of the effects of a model: an analysis with each of them off in turn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import one_or_names
from .._lib.progress import Progress
from .._lib.text import Block, si
from ..errors import Interrupted, MbrsError, ModelError
from ..model.aerodynamics import with_inflow
from ..results import Result, Stats, derived, result
from ..system.effects import LINEAR_ONLY, effects
from .measures import eigenvalue_difference, frequency_difference, measure_for
from .timing import name_of, short, timed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model

__all__ = ["EffectRow", "EffectStudy", "effect_study"]


@dataclass(frozen=True)
class EffectRow:
    """One effect left out: relative ``change`` (nan: unknown), share of time ``saved``, ``fewer`` work counts."""

    effect: str
    change: float
    time: float
    saved: float
    fewer: Mapping[str, int]
    status: str


@result
class EffectStudy(Result):
    """Influence and cost of each effect of a model; see `effect_study`. ``time``: the full run."""

    runs: tuple[EffectRow, ...]
    measure: str
    time: float

    row: ClassVar[str] = "effect"
    axes: ClassVar[Mapping[str, str]] = {"effect": "names"}

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that were left out."""
        return tuple(run.effect for run in self.runs)

    @property
    @derived(dims=("effect",), unit="1")
    def change(self) -> np.ndarray:
        """(n,) relative change of the result without each effect; nan where unknown."""
        return np.array([run.change for run in self.runs], dtype=float)

    @property
    @derived(dims=("effect",), unit="1")
    def saved(self) -> np.ndarray:
        """(n,) share of the time that leaving each effect out saves."""
        return np.array([run.saved for run in self.runs], dtype=float)

    @property
    @derived(dims=("effect",), unit="s", name="time")
    def _times(self) -> np.ndarray:
        return np.array([run.time for run in self.runs], dtype=float)

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "measure": self.measure, "time": self.time}

    def heading(self) -> str:
        return "effect study" if self.runs else "effect study: no effect of this model can be switched off"

    def blocks(self) -> list[Block]:
        return [Block(*self.rows(), title=self.heading(), footer="\n".join(self.notes()) or None, digits=4)]

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        columns = ["without", "change", "time [ms]", "saved [%]", "work", "status"]
        return columns, [
            [
                r.effect,
                short(r.change),
                1e3 * r.time,
                round(100.0 * r.saved) if math.isfinite(r.saved) else None,
                sum(r.fewer.values()),
                r.status,
            ]
            for r in self.runs
        ]

    def notes(self) -> list[str]:
        if not self.runs:
            return []
        lines = [f"change: {self.measure}; all effects on: {si(self.time, 's')}, best of the repeats"]
        for r in self.runs:
            if r.fewer:
                lines.append(f"work without {r.effect}: " + ", ".join(f"{n:+d} {name}" for name, n in r.fewer.items()))
        return lines

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Change and time saved as bars, with ``ax`` the change; returns the figure."""
        from ..plot import effects

        return effects(self, ax=ax)


def effect_study(
    fun: Callable[..., Any],
    model: Model,
    *args: object,
    repeat: int = 3,
    measure: Callable[[Any, Any], float] | None = None,
    effects: Sequence[str] | None = None,
    **settings: object,
) -> EffectStudy:
    """Run an analysis with each effect that is on switched off in turn: what changes, and what it saves.

    Parameters
    ----------
    fun
        An analysis with ``without=``, such as ``mb.modes``.
    model, args, settings
        What it takes; ``without`` among the settings is off in every run.
    repeat
        Times are the best of this many runs.
    measure
        ``measure(result, reference) -> float``; None chooses by the kind of result (`mbrs.studies.measures`).
    effects
        Names of effects to try; None takes those that ``mb.effects(model)`` lists as on and that can be switched off. With
        "aerodynamics" the air is also tried with simpler inflows than its own: "induced velocity" left out is inflow "none",
        "wake" or "lag of the inflow" left out is inflow "bem".

    Returns
    -------
    EffectStudy
        Rows from the largest change to the smallest. An effect whose absence makes the analysis fail is recorded.

    Raises
    ------
    ModelError
        The analysis fails with all effects on.
    Interrupted
        Ctrl-C; ``.result`` is the study of the effects that were finished, None before the first comparison.

    Notes
    -----
    Cost: ``repeat`` x (number of rows + 1) + 1 runs.

    Examples
    --------
    >>> import mbrs as mb
    >>> study = mb.effect_study(mb.modes, mb.examples.quarter_car())
    >>> sorted(row.effect for row in study.runs)[:3]
    ['constraint-force-stiffness', 'damping', 'drives']
    """
    off = one_or_names("without", settings.pop("without", ()))
    names = tuple(effects) if effects is not None else _effects_on(model, fun)
    keywords = {**settings, **({"without": off} if off else {})}
    try:
        # a first run that is not timed: it alone pays for compiling, which every effect would seem to cost
        _, _, warm_up, _ = timed(fun, (model, *args), keywords, 1)
        whole, full, spent, status = timed(fun, (model, *args), keywords, repeat)
    except KeyboardInterrupt:
        raise Interrupted("the effect study was interrupted before there was anything to compare") from None
    spent += warm_up
    if whole is None:
        raise ModelError(f"the analysis fails with all effects on, so there is nothing to compare with: {status}")
    measure = measure or _measure(whole)
    rows: list[EffectRow] = []
    cases = [(name, model, (*off, name)) for name in names if name not in off]
    if any(name == "aerodynamics" for name, _, _ in cases):
        cases += [(label, simpler, off) for label, simpler in _simpler_inflows(model)]

    def study(status: str) -> EffectStudy:
        rows.sort(key=lambda row: -row.change if math.isfinite(row.change) else math.inf)
        stats = Stats(wall_time=spent, counts={"runs": repeat * (len(rows) + 1) + 1})
        return EffectStudy(tuple(rows), name_of(measure), full, stats=stats, error=None, status=status)

    try:
        with Progress("effect study", len(cases)) as progress:
            for name, tried, without in cases:
                given = {**settings, **({"without": without} if without else {})}
                row, cost = _effect_row(name, fun, (tried, *args), given, repeat, measure, (whole, full))
                rows.append(row)
                spent += cost
                progress.advance(note=name)
    except KeyboardInterrupt:
        text = f"the effect study was interrupted after {len(rows)} of {len(cases)} effects"
        raise Interrupted(text, study("interrupted")) from None
    return study("converged")


def _measure(whole: Any) -> Callable[[Any, Any], float]:
    """Modes by their eigenvalues: frequencies alone would not see damping."""
    chosen = measure_for(whole)
    return eigenvalue_difference if chosen is frequency_difference else chosen


def _simpler_inflows(model: Any) -> list[tuple[str, Any]]:
    """The loss of each simpler inflow by name, and the model with that inflow."""
    inflows = {air.inflow for air in getattr(model, "airs", ())}
    out = []
    if inflows - {"none"}:
        out.append(("induced velocity", with_inflow(model, "none")))
    if inflows & {"prescribed-wake", "free-wake"}:
        out.append(("wake", with_inflow(model, "bem")))
    elif "dynamic-inflow" in inflows:
        out.append(("lag of the inflow", with_inflow(model, "bem")))
    return out


def _effect_row(
    name: str,
    fun: Callable[..., Any],
    args: Any,
    settings: Mapping[str, Any],
    repeat: int,
    measure: Any,
    whole: tuple[Any, float],
) -> tuple[EffectRow, float]:
    result, best, spent, status = timed(fun, args, settings, repeat)
    reference, full = whole
    if result is None:
        return EffectRow(name, math.nan, best, math.nan, {}, status), spent
    try:
        change = float(measure(result, reference))
    except MbrsError as problem:
        change, status = math.nan, f"not comparable: {problem}"
    saved = 1.0 - best / full if full > 0.0 else math.nan
    return EffectRow(name, change, best, saved, _fewer(reference, result), status), spent


def _fewer(whole: Any, part: Any) -> dict[str, int]:
    """Differences of the work counts, part - whole, where they are not zero."""
    before = dict(getattr(getattr(whole, "stats", None), "counts", {}) or {})
    after = dict(getattr(getattr(part, "stats", None), "counts", {}) or {})
    changes = {name: int(after.get(name, 0)) - int(before.get(name, 0)) for name in sorted({*before, *after})}
    return {name: change for name, change in changes.items() if change}


def _effects_on(model: Any, fun: Callable[..., Any]) -> tuple[str, ...]:
    """Effects that are on and that the analysis can leave out: a motion knows no parts of a linearisation."""
    motion = getattr(fun, "__name__", "") == "simulate"
    listed = effects(model)
    entries = listed.items() if isinstance(listed, Mapping) else [(getattr(e, "name", None), e) for e in listed]
    return tuple(
        str(name)
        for name, entry in entries
        if getattr(entry, "on", entry) and getattr(entry, "switchable", True) and not (motion and name in LINEAR_ONLY)
    )
