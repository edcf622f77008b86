"""Gradients of a motion: `mb.gradient`, and the sensitivities of a trajectory."""

from __future__ import annotations

import itertools
import math
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core
from ._border import core_errors
from .effects import check_without, effects
from .errors import KinkWarning, ModelError
from .linearize import Snapshot
from .matrix_calculus import Derivative
from .names import shown
from .objectives import AtTimes, Final, Integral, NewReading, Objective, Reader, evaluate
from .readings import Asked, Names
from .results import Result, Stats, added_counts
from .state import State, state_of
from .tables import Directions, directions

if TYPE_CHECKING:
    from .model import Model
    from .trajectory import Trajectory

# spectral radius at infinity, as in mb.simulate
RHO = 0.8
METHODS = ("direct", "adjoint", "auto")
SCHEMES = ("ali3p", "generalized-alpha")
_READINGS = 20


@dataclass(frozen=True, eq=False, repr=False)
class MotionGradient(Result):
    """Value and gradient of objectives of a motion; unpacks as ``value, gradient``.

    Attributes
    ----------
    value
        A float, or (n_obj,) for several objectives.
    gradient
        (n_p,), or in the shape of the one array parameter; (n_obj, ...) for several objectives. ``.vetter()`` gives the
        block layout.
    labels, units
        Of the parameters.
    where
        (n_p,) the values of the parameters; nan for turns of axes and orientations.
    t
        (n_t,) s; ends of the steps.
    method
        "direct" or "adjoint".
    kinks
        ``(t, element, what)`` of places that the motion passed where a force has a kink (a gap that closes or opens, a slider
        that begins or ceases to slide, friction that changes its sign within a step): it is not differentiable there. The
        gradient is that of the steps on both sides of them; ``status`` is then "kinks" instead of "converged".
    """

    value: Any
    gradient: Derivative
    labels: tuple[str, ...]
    units: tuple[str, ...]
    where: np.ndarray
    t: np.ndarray
    method: str
    kinks: tuple[tuple[float, str, str], ...] = ()

    def __iter__(self) -> Iterator[Any]:
        return iter((self.value, self.gradient))

    def __str__(self) -> str:
        from .parameter_units import unit_note
        from .report import table

        flat = np.asarray(self.gradient).reshape(-1, len(self.labels))
        named = zip(self.labels, self.units, self.where, strict=True)
        rows = [(label, unit, where, *flat[:, p]) for p, (label, unit, where) in enumerate(named)]
        names = ["gradient"] if np.ndim(self.value) == 0 else [f"gradient {i}" for i in range(len(flat))]
        value = f"{self.value:.9g}" if np.ndim(self.value) == 0 else ", ".join(f"{v:.9g}" for v in self.value)
        title, footer = f"objective {value} ({self.stats.route})", unit_note(self.labels, self.units)
        return table(["parameter", "unit", "value", *names], rows, title=title, footer=footer)

    __repr__ = __str__

    def sensitivity(self, parameters: str | Sequence[str]) -> MotionSensitivity:
        """The gradient as `mb.sensitivity` returns derivatives: ``value``, parameter axis last."""
        named = [parameters] if isinstance(parameters, str) else list(parameters)
        missing = [p for p in named if p not in self.labels]
        if missing:
            raise ModelError(
                f"this gradient is by {', '.join(self.labels)}, not by {missing[0]!r}; compute it with that parameter"
            )
        flat = np.asarray(self.gradient).reshape(*np.shape(self.value), len(self.labels))
        chosen = [self.labels.index(p) for p in named]
        return MotionSensitivity(
            value=flat[..., chosen],
            labels=tuple(named),
            units=tuple(self.units[i] for i in chosen),
            stats=self.stats,
        )

    def plot(self, kind: str = "tornado", **options: Any) -> Any:
        """Bars of the change of the objective by one per cent of each parameter, or by ``change=`` ("tornado")."""
        if kind != "tornado":
            raise ModelError(f"there is no plot {kind!r} of a gradient; known is 'tornado'")
        from .plot import gradients

        return gradients.tornado(self, **options)

    def to_xarray(self) -> Any:
        """`xarray.Dataset` over the parameters."""
        import xarray

        flat = np.asarray(self.gradient).reshape(-1, len(self.labels))
        return xarray.Dataset(
            {"gradient": (("objective", "parameter"), flat), "value": (("objective",), np.atleast_1d(self.value))},
            coords={
                "parameter": list(self.labels),
                "unit": ("parameter", list(self.units)),
                "where": ("parameter", self.where),
            },
            attrs={"method": self.method},
        )


@dataclass(frozen=True, eq=False, repr=False)
class MotionSensitivity(Result):
    """Derivatives of objectives of a motion: ``value`` (..., n_p), by ``labels``."""

    value: np.ndarray
    labels: tuple[str, ...]
    units: tuple[str, ...]

    def __str__(self) -> str:
        from .parameter_units import unit_note
        from .report import table

        flat = self.value.reshape(-1, len(self.labels))
        rows = [(label, unit, *flat[:, p]) for p, (label, unit) in enumerate(zip(self.labels, self.units, strict=True))]
        columns = ["parameter", "unit", *("derivative" for _ in flat)]
        return table(columns, rows, title="objectives of a motion", footer=unit_note(self.labels, self.units))

    __repr__ = __str__

    def to_xarray(self) -> Any:
        """`xarray.Dataset` over objectives and parameters."""
        import xarray

        return xarray.Dataset(
            {"derivative": (("objective", "parameter"), self.value.reshape(-1, len(self.labels)))},
            coords={"parameter": list(self.labels), "unit": ("parameter", list(self.units))},
        )


# (t, element, what) of a kink that was passed.
Kink = tuple[float, str, str]
# Values, gradients (n_obj, n_p), work counts, kinks.
Found = tuple[np.ndarray, np.ndarray, dict[str, int], tuple[Kink, ...]]


@dataclass
class Run:
    """A motion to be differentiated: model, start, times of the steps."""

    model: Model
    snapshot: Snapshot
    state: State
    without: tuple[str, ...]
    times: np.ndarray
    weight: str = "tangent"
    keep: int = 2**23
    scheme: str = "ali3p"
    rho: float = RHO

    def options(self, asked: Sequence[Asked], along: Directions | None) -> dict[str, Any]:
        """What the core takes."""
        pairs: list[tuple[list[int], list[float]]] = []
        if along is not None:
            for p in range(along.n):
                inside = along.columns == p
                pairs.append((along.rows[inside].tolist(), along.values[inside].tolist()))
        return {
            "times": self.times.tolist(),
            "memory": self.state.memory.tolist(),
            "scheme": self.scheme,
            "rho": self.rho,
            "weight": self.weight,
            "keep": self.keep,
            "drawn": self.state.kind in ("drawn", "equilibrium"),
            "velocities": self.state.kind == "drawn",
            "quantities": list(asked),
            "directions": pairs,
            "shift": self._shift(pairs),
        }

    def _shift(self, pairs: list[tuple[list[int], list[float]]]) -> list[list[float]]:
        if self.state.kind != "equilibrium" or not pairs:
            return []
        with core_errors():
            r = _core.directions(
                self.snapshot.system,
                self.state.relative,
                self.state.rate,
                list(self.without),
                pairs,
                "equilibrium",
                False,
            )
        return np.asarray(r["tree_coordinates"]).T.tolist()

    def direct(self, asked: Sequence[Asked], along: Directions | None) -> dict[str, Any]:
        """Values of quantities at all steps, and their derivatives."""
        with core_errors():
            return _core.motion_directions(
                self.snapshot.system,
                self.state.relative,
                self.state.rate,
                list(self.without),
                self.options(asked, along),
            )


def grid(start: float, end: float, step: float, through: Sequence[float] = ()) -> np.ndarray:
    """Times of steps of at most ``step`` that end at ``end`` and at the times given, equal between these."""
    marks = [start, *sorted(x for x in {float(x) for x in through} if start < x < end), end]
    out = [start]
    for a, b in itertools.pairwise(marks):
        n = max(1, math.ceil((b - a) / step * (1 - 1e-12) - 1e-9))
        out.extend(np.linspace(a, b, n + 1)[1:].tolist())
    return np.array(out)


def gradient(
    m: Model,
    objective: Objective | Sequence[Objective],
    parameters: str | Sequence[str],
    t: float,
    *,
    step: float | None = None,
    rtol: float | None = None,
    scheme: str = "ali3p",
    method: str = "auto",
    at: Any = None,
    without: Sequence[str] = (),
    weight: str | None = None,
    rho: float | None = None,
    keep: int = 2**23,
) -> MotionGradient:
    """Objectives of a motion and their exact derivatives by any design parameters.

    The derivative is that of the discrete solution: of the steps as they are, with their lengths and iterations frozen.

    Parameters
    ----------
    m
        The model, with its present values.
    objective
        `mb.Integral`, `mb.Final`, `mb.AtTimes`, or several of them.
    parameters
        Addresses such as "spring1.length", "k", "crank.mass", "V" (an array parameter: the gradient keeps its shape).
    t
        s; the end of the motion. Zero length is allowed: the start alone.
    step, rtol
        s, fixed steps (equal, at most so long, ending at t); or a tolerance that chooses them first. 1e-7 if neither is given.
    scheme
        "ali3p" or "generalized-alpha", with the discrete solution that `mb.simulate` has by that method and those steps.
    method
        "direct": one tangent linear model per parameter along with the motion. "adjoint": the steps backwards, once per
        objective. "auto": by their numbers.
    at
        Start, as in `mb.simulate`; a drawn start follows the parameters (the steps of the assembly and consistent velocities), an
        equilibrium moves along, other states are held.
    without
        Effects to leave out.
    weight
        ALI3-P: metric of the projections, "tangent" (M + h/2 C + h^2/4 K; default) or "mass".
    rho
        Generalised-alpha: what is left of infinitely fast oscillations after a step, 0 to 1 (0.8).
    keep
        Adjoint: a motion of more numbers than this is not kept but run again between checkpoints, as many as the root of
        its steps.

    Returns
    -------
    MotionGradient
        Unpacks as ``value, gradient``; the parameter axis is last.

    Raises
    ------
    NameNotFoundError
        An unknown address; the message proposes the nearest.
    ModelError
        An objective that returns no finite number, a scheme without sensitivities.
    NotDifferentiableError
        An objective that is not analytic; a parameter that breaks a redundant loop; a drive whose rate jumps on the way (an
        impact).

    Warns
    -----
    KinkWarning
        A motion that passes kinks of forces, with times and elements (``.kinks``).

    Notes
    -----
    Direct: O(n_p) tangent steps; adjoint: O(1) in n_p. Sources: ALI3-P after Dopico and co-workers; generalised-alpha after
    O. Bruels, A. Cardona and M. Arnold, Mech. Mach. Theory 48 (2012) 121-137. Its Newton iterations are taken as converged, by
    which the derivative differs from that of every iterate by less than 1e-9 h^2 |a| of a step.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> m = mb.Model("one"); k = m.parameter("k", 4.0)
    >>> p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0), velocity=(0, 0, 0))
    >>> rail = m.prismatic("rail", m.ground, p, at=(1, 0, 0), axis="x", k=k, preload=4.0)
    >>> value, grad = mb.gradient(m, mb.Final(lambda s: s.position("p")[0]), "k", t=1.0, step=1e-3)
    >>> bool(abs(value - np.cos(2.0)) < 1e-5)
    True
    """
    begin = time.perf_counter()
    if scheme not in SCHEMES:
        raise ModelError(
            f"scheme={scheme!r} has no sensitivities; those that have are "
            f"{' and '.join(f'scheme={name!r}' for name in SCHEMES)} (mb.simulate runs them as method=)"
        )
    if method not in METHODS:
        raise ModelError(f"method= is one of {', '.join(map(repr, METHODS))}, got {shown(method)}")
    kind = _variant(scheme, weight, rho)
    many = isinstance(objective, (list, tuple))
    objectives: list[Any] = list(objective) if isinstance(objective, (list, tuple)) else [objective]
    if not objectives or not all(isinstance(o, Objective) for o in objectives):
        raise ModelError(
            f"objective= takes mb.Integral, mb.Final or mb.AtTimes, or several of them, got {shown(objective)}"
        )
    run = replace(prepare(m, objectives, t, step, rtol, at, check_without(without), **kind), keep=max(0, int(keep)))
    along = directions(m, parameters)
    chosen = ("adjoint" if along.n > 8 * len(objectives) else "direct") if method == "auto" else method
    found = _adjoint(run, objectives, along) if chosen == "adjoint" else _direct(run, objectives, along)
    values, gradients, counts, kinks = found
    warn_of(kinks)
    shaped = along.shaped(gradients if many else gradients[0])
    return MotionGradient(
        value=values if many else float(values[0]),
        gradient=Derivative.of(shaped, along.shape, 1 if many else 0),
        labels=along.labels,
        units=along.units,
        where=np.array([_value_at(m, label) for label in along.labels]),
        t=run.times,
        method=chosen,
        kinks=kinks,
        status="kinks" if kinks else "converged",
        stats=Stats(
            time.perf_counter() - begin,
            counts,
            tuple(e.name for e in effects(m) if e.on and e.name not in run.without),
            f"{scheme}, {chosen}, {len(run.times) - 1} steps",
        ),
    )


def _variant(scheme: str, weight: str | None, rho: float | None) -> dict[str, Any]:
    """What distinguishes a scheme, checked."""
    if weight is not None and (scheme != "ali3p" or weight not in ("tangent", "mass")):
        raise ModelError(
            f"weight= is 'tangent' or 'mass' and belongs to scheme='ali3p', got {shown(weight)} with {scheme!r}"
        )
    if rho is not None and scheme != "generalized-alpha":
        raise ModelError(f"rho= belongs to scheme='generalized-alpha', not to {scheme!r}")
    radius = RHO if rho is None else _number("rho", rho, 0.0)
    if radius > 1.0:
        raise ModelError(f"rho= lies between 0 and 1, got {rho}")
    return {"scheme": scheme, "weight": weight or "tangent", "rho": radius}


def _number(name: str, value: Any, least: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ModelError(f"{name}= must be a number, got {shown(value)}") from None
    if not math.isfinite(number) or number < least:
        raise ModelError(f"{name}= must be a finite number of at least {least:g}, got {shown(value)}")
    return number


def prepare(
    m: Model,
    objectives: Sequence[Objective],
    t: float,
    step: float | None,
    rtol: float | None,
    at: Any,
    without: tuple[str, ...],
    **kind: Any,
) -> Run:
    """Start and steps of a motion."""
    snapshot = Snapshot.of(m, without)
    state = state_of(m, snapshot.system, at, hold=False, without=without)
    end = _number("t", t, state.t)
    through = [x for o in objectives for x in o.times]
    for x in through:
        if not state.t <= x <= end:
            raise ModelError(f"mb.AtTimes names t = {x:g} s, outside the motion from {state.t:g} to {end:g} s")
    if step is not None and rtol is not None:
        raise ModelError("give rtol= (steps chosen first) or step= (fixed steps), not both")
    if end == state.t:
        times = np.array([end])
    elif step is not None:
        h = _number("step", step, np.finfo(float).tiny)
        if (end - state.t) / h > 1e8:
            raise ModelError(f"step={step} would need more than 1e8 steps")
        breaks = _core.motion_breaks(snapshot.system, state.t)
        times = grid(state.t, end, h, [*through, *breaks])
    else:
        from .simulate import simulate

        marks = np.array(sorted({*(x for x in through if x > state.t), end}))
        traj = simulate(m, marks, rtol=1e-7 if rtol is None else rtol, at=state, without=without, **_as_method(kind))
        times = np.unique(np.concatenate([traj.steps, marks]))
    return Run(m, snapshot, state, without, times, **kind)


def _as_method(kind: dict[str, Any]) -> dict[str, Any]:
    if kind["scheme"] == "ali3p":
        return {"method": "ali3p"}
    return {"method": kind["scheme"], "rho": kind["rho"]}


def warn_of(kinks: Sequence[Kink]) -> None:
    """Say where a differentiated motion has no derivative."""
    if not kinks:
        return
    named = "; ".join(f"{name!r} at t = {t:.6g} s ({what})" for t, name, what in kinks[:3])
    more = f" and {len(kinks) - 3} more" if len(kinks) > 3 else ""
    warnings.warn(
        f"the motion passes {named}{more}: it is not differentiable there; the gradient is that of the steps on both sides, with an "
        "error of first order in the step. Take smaller steps, or smooth the law (smoothing=, a larger v_ref)",
        KinkWarning,
        stacklevel=3,
    )


def _reader(run: Run) -> Reader:
    return Reader(Names(run.snapshot.tables), run.model.value)


def _read(run: Run, objectives: Sequence[Objective], reader: Reader) -> None:
    """What the objectives read at the start: values are fetched one by one until they are content."""
    from .objectives import number

    short = replace(run, times=run.times[:1])
    for _ in range(10 * _READINGS):
        row = short.direct(list(reader.places), None)["values"][0] if reader.places else np.zeros(0)
        try:
            for o in objectives:
                number(o, reader.instant(float(run.times[0]), 0, row))
            return
        except NewReading as new:
            reader.add(new.asked)
    raise ModelError("the objective reads more quantities than a motion has; check its function")


def _direct(run: Run, objectives: Sequence[Objective], along: Directions) -> Found:
    reader = _reader(run)
    _read(run, objectives, reader)
    for _ in range(_READINGS):
        made = run.direct(list(reader.places), along)
        try:
            found = [evaluate(o, reader, made["t"], made["values"]) for o in objectives]
            break
        except NewReading as new:
            reader.add(new.asked)
    else:
        raise ModelError("the objective reads new quantities again and again; let it read the same ones at all times")
    gradients = np.array([np.einsum("tc,tcp->p", f.seeds, made["derivatives"]) for f in found])
    for i, f in enumerate(found):
        gradients[i] += explicit_part(run.model, f.explicit, along)
    return np.array([f.value for f in found]), gradients, dict(made["counts"]), tuple(made["kinks"])


def explicit_part(m: Model, explicit: dict[str, np.ndarray], along: Directions) -> np.ndarray:
    """(n_p,): objectives that read numbers of the model itself."""
    out = np.zeros(along.n)
    for address, d in explicit.items():
        own = directions(m, address)
        for c, label in enumerate(own.labels):
            out += d[c] * _number_by_parameters(m, label, own, c, along)
    return out


def _number_by_parameters(m: Model, label: str, own: Directions, c: int, along: Directions) -> np.ndarray:
    """d(number)/dp: one where it is the parameter itself, else what its place in x does."""
    out = np.array([1.0 if label == other else 0.0 for other in along.labels])
    target = m.target(label)
    if target.field is None:
        return out
    inside = own.columns == c
    for p in range(along.n):
        if out[p] == 0.0:
            there = (along.columns == p) & np.isin(along.rows, own.rows[inside][:1])
            out[p] = along.values[there].sum()
    return out


def _adjoint(run: Run, objectives: Sequence[Objective], along: Directions) -> Found:
    reader = _reader(run)
    _read(run, objectives, reader)
    for _ in range(_READINGS):
        with core_errors():
            forward = _core.MotionForward(
                run.snapshot.system,
                run.state.relative,
                run.state.rate,
                list(run.without),
                run.options(list(reader.places), along),
            )
        try:
            found = [evaluate(o, reader, run.times, forward.values()) for o in objectives]
            break
        except NewReading as new:
            reader.add(new.asked)
    else:
        raise ModelError("the objective reads new quantities again and again; let it read the same ones at all times")
    counts = [forward.counts()]
    gradients = np.zeros((len(found), along.n))
    for i, f in enumerate(found):
        with core_errors():
            gradients[i], work = forward.gradient(np.ascontiguousarray(f.seeds))
        gradients[i] += explicit_part(run.model, f.explicit, along)
        counts.append(work)
    return np.array([f.value for f in found]), gradients, added_counts(*counts), tuple(forward.kinks())


def trajectory_sensitivity(traj: Trajectory, what: str) -> Derivative:
    """The derivative of a named quantity at the outputs of a trajectory; see `Trajectory.sensitivity`."""
    if traj.start is None or not len(traj.parameters):
        raise ModelError(
            "this motion has no sensitivities; run mb.simulate(..., parameters=['...']) with method='ali3p' or "
            "'generalized-alpha' to get them"
        )
    traj.snapshot.check_current("motion")
    run = Run(
        traj.model,
        traj.snapshot,
        traj.start,
        traj.without,
        traj.steps,
        scheme=traj.method,
        rho=RHO if traj.rho is None else traj.rho,
    )
    along = directions(traj.model, traj.parameters)
    names = Names(run.snapshot.tables)
    asked = names.address(what)
    made = run.direct([asked], along)
    warn_of(made["kinks"])
    at = np.searchsorted(made["t"], traj.t - 1e-12 * max(1.0, abs(float(traj.t[-1]))))
    values, d = made["values"][at], made["derivatives"][at]
    if asked[0] == "rotation":
        # the world rotation vector of dR R^T
        R = values.reshape(-1, 3, 3)
        spin = np.einsum("nijp,nkj->nikp", d.reshape(len(d), 3, 3, -1), R)
        d = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    single = d.shape[1] == 1
    shaped = along.shaped(d[:, 0] if single else d)
    return Derivative.of(shaped, along.shape, 0 if single else 1)


def _value_at(m: Model, label: str) -> float:
    """The number that a column belongs to; those of axes and orientations are turns and have none."""
    turns = label.rpartition("[")[0].endswith((".axis", ".axis2", ".orientation"))
    return math.nan if turns else float(m.value(label))


__all__ = ["AtTimes", "Final", "Integral", "MotionGradient", "gradient"]
