"""Gradients of a motion: `mb.gradient`, and the sensitivities of a trajectory."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import choice, is_word, real_number, shown
from .._lib.progress import Elapsed
from .._lib.vetter import Derivative
from ..errors import MbrsError, ModelError, NameNotFoundError
from ..model.addresses import target
from ..model.directions import Directions, directions
from ..motion.error import step_error, stretched
from ..motion.options import DEFAULT
from ..motion.quantities import Names
from ..motion.tangent import (
    RHO,
    Kink,
    Run,
    kink_times,
    require_followed_guess,
    value_at,
    warn_of,
    warn_of_growth,
)
from ..results import Stats, added_counts
from ..system.effects import check_without, effects
from .motion_gradient import MotionGradient, effects_of
from .objectives import Evaluation, Integral, NewReading, Objective, Reader, evaluate, number
from .steps import halved, prepare, resampled

if TYPE_CHECKING:
    from ..model.model import Model
    from ..system.state import StateLike

# order of the error of a gradient, or a little less: its estimate divides by a power of two of it
_ORDERS = {"explicit": 7, "radau": 5, "bdf": 4, "ali3p": 2, "generalized-alpha": 2}
# gradients of two step sizes that differ by more than this (relative) have not begun to converge
_UNRELATED = 0.3
# Steps of a motion up to which shorter ones are made as well: fewer, longer ones may err alike. Larger: estimates take longer.
_FEW = 20
# a tolerance over one whose motion errs by less than half as much, of any order
_STRICTER = 16.0
# a tolerance beside rounding
_FINEST = 1e-13
METHODS = ("direct", "adjoint", "auto")
SCHEMES = ("explicit", "radau", "bdf", "ali3p", "generalized-alpha")
_READINGS = 20


@dataclass(frozen=True)
class ObjectiveGradients:
    """Values, gradients (n_obj, n_p), work counts, kinks; what a change of all readings by their sizes does to each objective."""

    values: np.ndarray
    gradients: np.ndarray
    counts: dict[str, int]
    kinks: tuple[Kink, ...]
    read: np.ndarray


class GradientOptions(TypedDict, total=False):
    """Options of `gradient` for those who compute gradients on the way."""

    step: float | None
    rtol: float | None
    scheme: str
    method: str
    at: StateLike
    without: Sequence[str]
    weight: str | None
    rho: float | None
    keep: int


def gradient(
    m: Model,
    objective: Objective | Sequence[Objective],
    parameters: str | Sequence[str],
    t: float,
    *,
    step: float | None = None,
    rtol: float | None = None,
    scheme: str | None = None,
    method: str = "auto",
    at: StateLike = None,
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
        s, fixed steps (equal, at most so long, ending at t and at kinks of laws); or a tolerance that chooses them first. 1e-7 if
        neither is given.
    scheme
        "explicit" (order 8, for scenes that are not stiff), "radau" (order 5, for stiff scenes), "bdf" (orders 1 to 5, order
        4 with ``step``, for stiff scenes), "ali3p" or "generalized-alpha"
        (order 2), with the discrete solution that `mb.simulate` has by that method and those steps; "explicit" in tree coordinates.
        "auto": "explicit" where the motion is not stiff and follows its fastest vibration (with ``step``: not faster than 1/step),
        else "radau" with steps by a tolerance and "ali3p" with fixed steps, which may go over a vibration. None: "auto" with steps by
        a tolerance, "ali3p" with ``step`` or ``weight``.
    method
        "direct": one tangent linear model per parameter along with the motion. "adjoint": the steps backwards, once per
        objective. "auto": by their numbers.
    at
        Start, as in `mb.simulate`; a drawn start follows the parameters (the steps of the assembly and consistent velocities), an
        equilibrium moves along, other states (of a trajectory, a steady motion) are held.
    without
        Effects to leave out.
    weight
        ALI3-P: metric of the projections, "tangent" (M + h/2 C + h^2/4 K; default) or "mass".
    rho
        Generalised-alpha: spectral radius at infinite frequency, 0 <= rho <= 1 (default 0.8).
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
        An objective that is not analytic; a parameter that breaks a redundant loop, or that moves the start through a first
        guess ``pose=``; a drive whose rate jumps on the way (an impact); air whose inflow advances by steps of its own.

    Warns
    -----
    KinkWarning
        A motion that passes kinks of forces at which no step ends, with times and elements (``.kinks``).
    MbrsWarning
        A motion that is very sensitive to the parameters over this time span (``.growth``).

    Notes
    -----
    Equations: docs/theory.md (20.1) to (20.11).
    Direct: O(n_p) tangent steps; adjoint: O(1) in n_p. Sources: ALI3-P after Dopico and co-workers; generalised-alpha after
    O. Bruels, A. Cardona and M. Arnold, Mech. Mach. Theory 48 (2012) 121-137. Its Newton iterations are taken as converged, by
    which the derivative differs from that of every iterate by less than 1e-9 h^2 |a| of a step. The explicit scheme is that of
    order 8 by Dormand and Prince (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd edition,
    Springer 1993). "bdf" differentiates its histories: orders, lengths and charts are those of the motion.

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
    choice("method", method, METHODS)
    kind = _variant(scheme, step, weight, rho)
    objectives, many = _objectives(objective)
    run = prepare(m, objectives, t, step, rtol, at, check_without(without), _kept(keep), **kind)
    along = directions(m, parameters)
    require_followed_guess(run, along)
    chosen = ("adjoint" if along.n > 8 * len(objectives) else "direct") if method == "auto" else method
    found = _gradients(run, objectives, along, chosen)
    kinks, gradients = (*found.kinks, *run.missed), found.gradients
    warn_of(kinks)
    shaped = along.shaped(gradients if many else gradients[0])
    judged: Any = lambda g: _judged(g, step, rtol)  # noqa: E731
    made = MotionGradient(
        value=found.values if many else float(found.values[0]),
        gradient=Derivative.of(shaped, along.shape, 1 if many else 0),
        labels=along.labels,
        units=along.units,
        where=np.array([value_at(m, label) for label in along.labels]),
        t=run.times,
        method=chosen,
        kinks=kinks,
        status="kinks" if kinks else judged,
        error=lambda g: _estimated(g, run, objectives, along, step, rtol),
        stats=Stats(
            time.perf_counter() - begin,
            found.counts,
            tuple(e.name for e in effects(m) if e.on and e.name not in run.without),
            f"{run.scheme}, {chosen}, {len(run.times) - 1} steps",
        ),
    )
    return _with_growth(made, found.read)


def _gradients(run: Run, objectives: Sequence[Objective], along: Directions, method: str) -> ObjectiveGradients:
    with Elapsed("gradient of a motion"):
        return _adjoint(run, objectives, along) if method == "adjoint" else _direct(run, objectives, along)


def _with_growth(made: MotionGradient, read: np.ndarray) -> MotionGradient:
    largest = np.abs(effects_of(made, made.gradient)).max(axis=1)
    growth = float(np.max(largest[read > 0.0] / read[read > 0.0], initial=0.0))
    warn_of_growth(growth)
    return made.replaced(growth=growth)


def _estimated(
    made: MotionGradient,
    run: Run,
    objectives: Sequence[Objective],
    along: Directions,
    step: float | None,
    rtol: float | None,
) -> float | None:
    """The difference to longer steps, by the order that these show; to a finer motion where steps end at kinks.

    Between two kinks there may be one step alone, which none is twice as long as.
    """
    m = run.model
    if len(run.times) < 3 or run.snapshot.versions != (m.structure_version, m.values_version):
        return None

    def apart(other: Callable[..., Run], *how: Any) -> float | None:
        """None where the other steps cannot be made, or an objective is not defined along them."""
        try:
            found = _apart(made, other(*how), objectives, along)
        except (MbrsError, ArithmeticError, ValueError):
            return None
        return found if math.isfinite(found) else None

    if kink_times(run.smooth):
        finer = apart(_finer, run, objectives, step, rtol)
        # of order one, half of the error is left with half the step
        return math.inf if finer is None else 2.0 * finer
    held = [*(x for o in objectives for x in o.times), *_core.motion_breaks(run.snapshot.system, float(run.times[0]))]
    order = float(np.median(np.abs(run.orders))) if len(run.orders) else _ORDERS[run.scheme]
    (longer, grown), (coarse, doubled) = (resampled(run, ratio, held) for ratio in (stretched(order), 2.0))
    near, far = (math.inf if d is None else d for d in (apart(lambda: longer), apart(lambda: coarse)))
    wild = max(near, far) > _UNRELATED
    finer = apart(lambda: resampled(run, 0.5, held)[0]) if wild or len(run.times) <= _FEW else None
    if wild:
        # longer steps may leave the region of stability, where shorter ones do not
        return near if finer is None else 2.0 * finer
    told = max(near, far) if made.kinks else step_error(near, far, order, (grown, doubled))
    return max(told, finer or 0.0)


def _judged(made: MotionGradient, step: float | None, rtol: float | None) -> str:
    """Derivatives lose up to half of the digits of their motion where it meets stiff stops: beyond, they are not what was asked for."""
    if made.error is None:
        return "computed"
    asked = _UNRELATED if step is not None else math.sqrt(DEFAULT if rtol is None else rtol)
    # where nothing has an effect the difference is that of rounding in so many steps
    effect = np.abs(effects_of(made, made.gradient)).max(axis=1)
    rounding = np.finfo(float).eps * len(made.t) * np.abs(np.ravel(made.value))
    is_rounding = bool(np.all(made.error * effect <= rounding))
    return "converged" if made.error <= asked or is_rounding else "unresolved"


def _finer(run: Run, objectives: Sequence[Objective], step: float | None, rtol: float | None) -> Run:
    """The motion by steps half as long, or by a smaller tolerance; beside rounding by a larger one."""
    if step is not None:
        return halved(run)
    given = DEFAULT if rtol is None else rtol
    rtol = given / _STRICTER if given > _STRICTER * _FINEST else given * _STRICTER
    kind = {"scheme": run.scheme, "weight": run.weight, "rho": run.rho}
    return prepare(run.model, objectives, run.times[-1], None, rtol, run.state, run.without, run.keep, **kind)


def _apart(made: MotionGradient, other: Run, objectives: Sequence[Objective], along: Directions) -> float:
    """The distance from the gradient of other steps, over the largest effect of a parameter."""
    gradients = _gradients(other, objectives, along, made.method).gradients
    own, others = effects_of(made, made.gradient), effects_of(made, gradients)
    size = np.abs(own).max(axis=1)
    miss = np.abs(others - own).max(axis=1)
    return float(np.max(miss[size > 0.0] / size[size > 0.0], initial=0.0))


def _objectives(objective: Any) -> tuple[list[Objective], bool]:
    """The objectives, and whether there may be several."""
    many = isinstance(objective, (list, tuple))
    objectives: list[Any] = list(objective) if many else [objective]
    if not objectives or not all(isinstance(o, Objective) for o in objectives):
        raise ModelError(
            f"objective= takes mb.Integral, mb.Final or mb.AtTimes, or several of them, got {shown(objective)}"
        )
    return objectives, many


def _variant(scheme: str | None, step: Any, weight: str | None, rho: float | None) -> dict[str, Any]:
    """Options of a scheme, checked."""
    if scheme is None:
        scheme = "auto" if step is None and weight is None else "ali3p"
    if not is_word(scheme, (*SCHEMES, "auto")):
        raise ModelError(
            f"scheme={shown(scheme)} has no sensitivities; those that have are "
            f"{', '.join(f'scheme={name!r}' for name in SCHEMES)} (mb.simulate runs them as method=)"
        )
    if weight is not None and (scheme != "ali3p" or not is_word(weight, ("tangent", "mass"))):
        raise ModelError(
            f"weight= is 'tangent' or 'mass' and belongs to scheme='ali3p', got {shown(weight)} with {scheme!r}"
        )
    if rho is not None and scheme != "generalized-alpha":
        raise ModelError(f"rho= belongs to scheme='generalized-alpha', not to {scheme!r}")
    radius = RHO if rho is None else real_number("rho=", rho, 0.0, 1.0)
    return {"scheme": scheme, "weight": weight or "tangent", "rho": radius}


def _kept(keep: Any) -> int:
    if isinstance(keep, bool) or not isinstance(keep, (int, np.integer)) or keep < 0:
        raise ModelError(f"keep= is how many numbers may be kept, an integer of at least 0, got {shown(keep)}")
    return min(int(keep), sys.maxsize)


def _reader(run: Run) -> Reader:
    return Reader(Names(run.snapshot.tables), run.model.value)


def _read(run: Run, objectives: Sequence[Objective], reader: Reader) -> None:
    """Quantities that the objectives read at the start: values are fetched one by one until they are content."""
    short = replace(run, times=run.times[:1], inner=False)
    for _ in range(10 * _READINGS):
        row = short.direct(list(reader.places), None)["values"][0] if reader.places else np.zeros(0)
        try:
            for o in objectives:
                _try(o, reader, run.times, row)
            return
        except NewReading as new:
            reader.add(new.asked)
    raise ModelError("the objective reads more quantities than a motion has; check its function")


def _try(objective: Objective, reader: Reader, times: np.ndarray, row: np.ndarray) -> None:
    """Read what an objective reads, with the state of the start and the time of its own first instant."""
    if isinstance(objective, Integral):
        number(objective, reader.instant(float(times[0]), 0, row))
        return
    try:
        number(objective, reader.instant(float((objective.times or times[-1:])[0]), 0, row))
    except NameNotFoundError:
        raise
    except (ModelError, ArithmeticError):
        # it may be defined at its own instants alone, and is checked there
        return


def _direct(run: Run, objectives: Sequence[Objective], along: Directions) -> ObjectiveGradients:
    reader = _reader(run)
    _read(run, objectives, reader)
    nodes = run.nodes
    needed = np.any([o.weights(nodes) != 0.0 for o in objectives], axis=0)
    run = replace(run, read=needed[: nodes.n_ends].tolist())
    for _ in range(_READINGS):
        made = run.direct(list(reader.places), along)
        try:
            found = [evaluate(o, reader, nodes, made["values"]) for o in objectives]
            break
        except NewReading as new:
            reader.add(new.asked)
    else:
        raise ModelError("the objective reads new quantities again and again; let it read the same ones at all times")
    gradients = np.array([np.einsum("tc,tcp->p", f.seeds, made["derivatives"]) for f in found])
    for i, f in enumerate(found):
        gradients[i] += explicit_part(run.model, f.explicit, along)
    values = np.array([f.value for f in found])
    return ObjectiveGradients(
        values, gradients, dict(made["counts"]), tuple(made["kinks"]), _reads(found, made["values"])
    )


def _reads(found: Sequence[Evaluation], rows: np.ndarray) -> np.ndarray:
    sizes = np.abs(rows).max(axis=0, initial=0.0)
    return np.array([np.sum(np.abs(f.seeds) @ sizes) for f in found])


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
    found = target(m, label)
    if found.group is None:
        return out
    inside = own.columns == c
    for p in range(along.n):
        if out[p] == 0.0:
            there = (along.columns == p) & np.isin(along.rows, own.rows[inside][:1])
            out[p] = along.values[there].sum()
    return out


def _adjoint(run: Run, objectives: Sequence[Objective], along: Directions) -> ObjectiveGradients:
    reader = _reader(run)
    _read(run, objectives, reader)
    for _ in range(_READINGS):
        with core_errors():
            forward = _core.MotionForward(
                run.snapshot.system,
                run.state.q,
                run.state.rate,
                list(run.without),
                run.options(list(reader.places), along),
            )
        try:
            found = [evaluate(o, reader, run.nodes, forward.values()) for o in objectives]
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
    values = np.array([f.value for f in found])
    return ObjectiveGradients(
        values, gradients, added_counts(*counts), tuple(forward.kinks()), _reads(found, forward.values())
    )
