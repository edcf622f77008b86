"""Derivatives of the steps of a motion: the run that is differentiated, where it has none, and those of its quantities."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import positive
from .._lib.vetter import Derivative
from .._lib.warning import warn_user
from ..errors import KinkWarning, ModelError, NotDifferentiableError
from ..model.aerodynamics import STEPPED
from ..model.directions import Directions, directions
from ..system.effects import with_rate_laws
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .quantities import Names, QuantityKey

if TYPE_CHECKING:
    from ..model.model import Model

# relative changes that a motion amplifies by more than this are warned of
_AMPLIFIED = 1e4
# times that are closer than this part of the motion's end are one
_ROUNDED = 1e-12
# spectral radius at infinity, as in mb.simulate
RHO = 0.8
# (t, element, what) of a kink that was passed.
Kink = tuple[float, str, str]
# (s, sides) of a stretch between kinks of laws: where it begins, and on which side of each kink the motion is in it
Stretch = tuple[float, list[int]]
# Part of a step that is not worth one of its own. Larger: steps are longer than asked for. Smaller: rounding makes splinters.
_SPLINTER = 1e-9
# Step of differences of the start, over the value of the parameter or the model's length. Larger: what bends is taken for what is wrong.
# Smaller: rounding hides it.
_STEP = 1e-5
# Differences of the start that are off by more than this (relative) show a start that moves otherwise than its derivative says.
_OFF = 1e-4
# Accuracy of a closed start, over the model's length. Larger: starts that a guess moves a little pass. Smaller: the closing of loops is
# taken for a guess.
_CLOSED = 1e-12


@dataclass(frozen=True)
class Nodes:
    """Instants at which quantities are read: first the ends of all steps, then nodes inside the steps.

    Attributes
    ----------
    t
        (n_r,) s.
    n_ends
        How many of them are ends of steps, the start included.
    quadrature
        (n_r,) s, weights of an integral over the motion, of the order of the scheme.
    """

    t: np.ndarray
    n_ends: int
    quadrature: np.ndarray

    @property
    def ends(self) -> np.ndarray:
        """(n_t,) s."""
        return self.t[: self.n_ends]


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
    # instants at which quantities are wanted, going forwards; none: at all
    read: list[bool] = field(default_factory=list)
    # quantities are also wanted at the nodes inside the steps
    inner: bool = False
    # of the steps of "bdf", as a trajectory has them; none: of fixed steps
    orders: Sequence[int] = ()
    # stretches between kinks of laws, at which steps end; none: no law has any
    smooth: Sequence[Stretch] = ()
    # kinks within its steps
    missed: tuple[Kink, ...] = ()
    # the run that chose the times, where it kept its steps
    kept: _core.KeptMotion | None = None

    @property
    def nodes(self) -> Nodes:
        """Instants at which quantities are read, with the weights of an integral."""
        t = self.times
        with core_errors():
            found, inside = _core.motion_quadrature(
                self.snapshot.system, self.scheme, t.tolist(), list(self.orders), kink_times(self.smooth)
            )
        weights = np.array(found)
        if not (self.inner and inside):
            return Nodes(t, len(t), weights[: len(t)])
        inner = t[:-1, None] + np.diff(t)[:, None] * np.array(inside)
        return Nodes(np.concatenate([t, inner.ravel()]), len(t), weights)

    def options(self, asked: Sequence[QuantityKey], along: Directions | None) -> dict[str, Any]:
        """Arguments of the core."""
        pairs: list[tuple[list[int], list[float]]] = []
        if along is not None:
            for p in range(along.n):
                inside = along.columns == p
                pairs.append((along.rows[inside].tolist(), along.values[inside].tolist()))
        return {
            "times": self.times.tolist(),
            "orders": list(self.orders),
            "memory": self.state.memory.tolist(),
            "scheme": self.scheme,
            "rho": self.rho,
            "weight": self.weight,
            "keep": self.keep,
            "read": self.read,
            "inner": self.inner,
            "kept": self.kept,
            "smooth": list(self.smooth),
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
                self.state.q,
                self.state.rate,
                list(self.without),
                pairs,
                "equilibrium",
                False,
            )
        columns: list[list[float]] = np.asarray(r["tree_coordinates"]).T.tolist()
        return columns

    def direct(self, asked: Sequence[QuantityKey], along: Directions | None) -> dict[str, Any]:
        """Values of quantities at all steps, and their derivatives."""
        with core_errors():
            return _core.motion_directions(
                self.snapshot.system,
                self.state.q,
                self.state.rate,
                list(self.without),
                self.options(asked, along),
            )


def differentiated_by(
    snapshot: Snapshot, state: State, without: tuple[str, ...], end: float, step: float | None
) -> str:
    """The scheme that is accurate at the least cost."""
    fixed = None if step is None else positive("step=", step)
    with core_errors():
        explicit = _core.motion_is_explicit(
            snapshot.system, state.q, state.rate, state.memory.tolist(), list(without), (state.t, end), fixed
        )
    if explicit:
        return "explicit"
    # fixed steps may go over a vibration, which the one keeps and the other damps; steps by a tolerance are a few of order five
    return "radau" if step is None else "ali3p"


def kink_times(smooth: Sequence[Stretch]) -> list[float]:
    """Times of the kinks between stretches."""
    return [t for t, _ in smooth[1:]]


def grid(start: float, end: float, step: float, through: Sequence[float] = ()) -> np.ndarray:
    """Times of steps of at most ``step`` that end at ``end`` and at the times given, equal between these."""
    marks = _apart([start, *sorted(float(x) for x in through if start < x < end), end])
    out = [start]
    for a, b in itertools.pairwise(marks):
        n = max(1, math.ceil((b - a) / step * (1 - _ROUNDED) - _SPLINTER))
        out.extend(np.linspace(a, b, n + 1)[1:].tolist())
    return np.array(out)


def least_gap(start: float, end: float) -> float:
    """Times that are closer than this are one."""
    return max(_ROUNDED * (end - start), 4 * np.finfo(float).eps * max(abs(start), abs(end)))


def _apart(times: Sequence[float]) -> list[float]:
    """Increasing times without those that follow another by rounding; first and last are kept."""
    near, out = least_gap(times[0], times[-1]), [times[0]]
    for x in times[1:-1]:
        if x - out[-1] > near and times[-1] - x > near:
            out.append(x)
    return [*out, times[-1]]


def warn_of_growth(growth: float) -> None:
    if growth > _AMPLIFIED:
        warn_user(
            f"the motion amplifies relative changes of the parameters {growth:.1e} times: over this time span it is chaotic, or nearly "
            "chaotic. The derivative is exact for these steps and may say nothing about the continuous motion; compare other steps (.error "
            "of mb.gradient does), or end earlier"
        )


def require_exact_tangents(m: Model, without: tuple[str, ...]) -> None:
    """Refuse motions whose steps have tangents that are not the derivatives of their forces: air with steps of its own, effects."""
    stepped = [] if "aerodynamics" in without else [air for air in m.airs if air.inflow in STEPPED]
    if stepped:
        air = stepped[0]
        raise NotDifferentiableError(
            f"the air {air.name!r} (inflow {air.inflow!r}) has no gradients of motions: its inflow advances by steps of its own, which are "
            'not differentiated. Give it inflow="bem" or "none", leave it out with without=(\'aerodynamics\',), or take differences of '
            "mb.simulate"
        )
    why = None
    if "centrifugal" in without:
        why = "without=('centrifugal',)"
    rated = with_rate_laws(m) if "damping" in without else []
    if rated:
        why = f"without=('damping',) with the law of {rated[0].name!r}, which feels rates,"
    if why:
        raise ModelError(
            f"{why} has no gradients: leave the effect in, or take differences of mb.simulate (relative steps of 1e-5)"
        )


def warn_of(kinks: Sequence[Kink]) -> None:
    """Say where a differentiated motion has no derivative."""
    if not kinks:
        return
    named = "; ".join(f"{name!r} at t = {t:.6g} s ({what})" for t, name, what in kinks[:3])
    more = f" and {len(kinks) - 3} more" if len(kinks) > 3 else ""
    warn_user(
        f"the motion passes {named}{more}: it is not differentiable there; the gradient ignores the kink and is "
        "first-order accurate there. Take smaller steps, or smooth the law (smoothing=, a larger v_ref)",
        KinkWarning,
    )


def quantity_derivative(run: Run, parameters: Sequence[str], what: str, t: np.ndarray) -> Derivative:
    """The derivative of a named quantity at output times (n_t,) by parameters; see `Trajectory.sensitivity`."""
    require_exact_tangents(run.model, run.without)
    along = directions(run.model, parameters)
    asked = Names(run.snapshot.tables).address(what)
    require_followed_guess(run, along)
    made = run.direct([asked], along)
    warn_of((*run.missed, *made["kinks"]))
    at = np.searchsorted(made["t"], t - least_gap(float(t[0]), float(t[-1])))
    values, d = made["values"][at], made["derivatives"][at]
    sizes = np.nan_to_num([value_at(run.model, label) for label in along.labels], nan=1.0)
    warn_of_growth(float(np.abs(d * sizes).max(initial=0.0) / (np.abs(values).max(initial=0.0) or math.inf)))
    if asked[0] == "rotation":
        # the world rotation vector of dR R^T
        R = values.reshape(-1, 3, 3)
        spin = np.einsum("nijp,nkj->nikp", d.reshape(len(d), 3, 3, -1), R)
        d = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    single = d.shape[1] == 1
    shaped = along.shaped(d[:, 0] if single else d)
    return Derivative.of(shaped, along.shape, 0 if single else 1)


def require_followed_guess(run: Run, along: Directions) -> None:
    """Compare the derivative of a start that first guesses (``pose=``) led to with differences of the assembly.

    Raises
    ------
    NotDifferentiableError
        A parameter that moves the start through the guess; names it. Two assemblies for each parameter, where there are guesses.
    """
    if run.state.kind != "drawn" or not run.model.poses:
        return
    asked: list[QuantityKey] = []
    for body in range(len(run.model.bodies)):
        asked += [("point", body, 0, None, None), ("rotation", body, 0, None, None)]
    start = replace(run, times=run.times[:1])
    length = float(run.snapshot.system.characteristic_length)
    natural = np.tile([length] * 3 + [1.0] * 9, len(run.model.bodies))
    exact = start.direct(asked, along)["derivatives"][0] / natural[:, None]
    x = np.array(run.snapshot.tables["x"], dtype=float)
    for p, (label, unit) in enumerate(zip(along.labels, along.units, strict=True)):
        way = along.dense[:, p]
        if not way.any():
            continue
        value = max(float(np.abs(x[way != 0.0]).max()), {"m": length, "rad": 1.0}.get(unit, 0.0))
        size = _STEP * (value or length) / float(np.abs(way).max())
        ends = [_values(start, x + side * size * way, asked) / natural for side in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * size)
        rounding = _CLOSED * float(np.abs(ends[0]).max()) / size
        if (
            np.abs(difference - exact[:, p]).max()
            > _OFF * np.abs(difference).max() + rounding + _OFF * np.abs(exact[:, p]).max()
        ):
            raise NotDifferentiableError(
                f"{label!r} moves the start through the first guess pose= of a body, of which there is no derivative: draw the bodies "
                "where they start, or begin at a state or an equilibrium with at="
            )


def _values(run: Run, x: np.ndarray, asked: list[QuantityKey]) -> np.ndarray:
    system = run.snapshot.system.with_values(x)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        state = state_of(run.model, system, None, hold=False, without=run.without)
    moved = Snapshot(run.model, system, run.snapshot.versions, run.snapshot.tables)
    found: np.ndarray = replace(run, snapshot=moved, state=state).direct(asked, None)["values"][0]
    return found


def value_at(m: Model, label: str) -> float:
    """The number that a column belongs to; those of axes and orientations are turns and have none."""
    turns = label.rpartition("[")[0].endswith((".axis", ".axis2", ".orientation"))
    return math.nan if turns else float(m.value(label))
