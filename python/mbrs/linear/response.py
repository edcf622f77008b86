"""Time response of linear systems and of linearised models to any load history."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.border import core_errors, require_memory
from .._lib.checks import UNFIT, choice, real_array, rising, shown
from .._lib.progress import call_progress
from .._lib.text import counted, number, without_rounding
from ..errors import ModelError
from ..results import Result, Stats, added_counts, quantity, result
from .linear_system import LinearSystem, Origin, directions, relaxes
from .matrices import MechanicalSystem
from .relaxation import States
from .second_order import linear_system

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..system.state import StateLike
    from .aliases import Linear, Loads, Ports

_KINDS = ("displacement", "velocity", "acceleration")
# bytes of a value: of a load its samples and their curvature, of an output three motions and their errors, once in the core and once here
_ROOM = 96.0
# Difference of a load by one call for all times from calls one by one, relative. Larger: functions that mean arrays otherwise pass.
# Smaller: rounding sends them one by one, which takes longer.
_SAME_LOAD = 1e-12


@dataclass(frozen=True, eq=False)
class LoadHistory:
    """Loads at the times ``t`` (n_t,): ``u`` (n_in, n_t), and ``bulge`` (n_in, n_t - 1), how far the load in the middle
    of each step lies above its chord."""

    t: np.ndarray
    u: np.ndarray
    bulge: np.ndarray


@result
class ResponseResult(Result):
    """Motion of the outputs over time.

    Attributes
    ----------
    t
        (n_t,) s.
    value
        (n_out, n_t) motion of the kind asked for; m, rad, and per s or s^2.
    displacement, velocity, acceleration
        (n_out, n_t) all three.
    outputs, inputs
        Names.
    error
        (n_out,) largest estimated error over time, relative to the largest value: what the load between the times
        adds to the response, plus rounding. Zero-load histories and loads that are linear between the times leave the
        rounding only.
    status
        "converged", or "unresolved" where an error exceeds 0.1.
    error_history
        (n_out, n_t) the same, absolute and over time.
    """

    t: np.ndarray = quantity(dims=("t",), unit="s")
    displacement: np.ndarray = quantity(dims=("output", "t"))
    velocity: np.ndarray = quantity(dims=("output", "t"))
    acceleration: np.ndarray = quantity(dims=("output", "t"))
    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    error_history: np.ndarray = quantity(dims=("output", "t"))
    linear: LinearSystem | None = field(default=None, kw_only=True)
    history: LoadHistory | None = field(default=None, kw_only=True)
    start: tuple[np.ndarray, np.ndarray] | None = field(default=None, kw_only=True)
    origin: Origin | None = field(default=None, kw_only=True)

    row: ClassVar[str] = "t"
    axes: ClassVar[Mapping[str, str]] = {"output": "outputs"}
    error_dims: ClassVar[tuple[str, ...]] = ("output",)

    @property
    def value(self) -> np.ndarray:
        chosen: np.ndarray = getattr(self, self.kind)
        return chosen

    def heading(self) -> str:
        span = f", {self.t[0]:.6g} to {self.t[-1]:.6g} s" if self.t.size else ""
        return f"{self.kind} of {counted(len(self.outputs), 'output')}, {counted(self.t.size, 'time')}{span}"

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "kind": self.kind}

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: extremes of each output."""
        rows: list[list[Any]] = []
        for name, y, e in zip(self.outputs, self.value, np.atleast_1d(self.error), strict=True):
            least, most, last = without_rounding([y.min(), y.max(), y[-1]], float(np.abs(y).max()), float(e)).tolist()
            rows.append([name, least, most, last, number(float(e), 2)])
        return ["output", "smallest", "largest", "last", "error"], rows

    def notes(self) -> list[str]:
        poor = "unresolved: the loads vary too fast between the times; give more of them"
        return [f"route: {self.stats.route}, {self.status}", *([poor] if self.status == "unresolved" else [])]

    def plot(self, *, ax: Axes | None = None, label: str | None = None) -> Figure:
        """The outputs over time; returns the figure."""
        from ..plot import response as draw

        return draw(self, ax=ax, label=label)


@result
class ResponseSensitivity(Result):
    """``value`` (n_out, n_t, n_p): derivative of the motion along each of the parameters ``labels``; ``error`` (n_out, n_p). A single array
    parameter keeps its shape in ``value``.
    """

    t: np.ndarray = quantity(dims=("t",), unit="s")
    value: np.ndarray = quantity(dims=("output", "t", "parameter"), name="dy_dp")
    kind: str
    outputs: tuple[str, ...]
    labels: tuple[str, ...]

    row: ClassVar[str] = "t"
    axes: ClassVar[Mapping[str, str]] = {"output": "outputs", "parameter": "labels"}
    error_dims: ClassVar[tuple[str, ...]] = ("output", "parameter")

    def heading(self) -> str:
        return f"d {self.kind} / d p at {counted(self.t.size, 'time')}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest derivative by each parameter."""
        sizes = np.abs(self.labelled()["dy_dp"][1]).max(axis=(0, 1)).tolist()
        return ["parameter", "largest |dy/dp|"], [list(row) for row in zip(self.labels, sizes, strict=True)]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """dy/dp over time, a line for each parameter and output; returns the figure."""
        from ..plot.derivatives import response_sensitivity

        return response_sensitivity(self, ax=ax)


def response(
    m: Linear,
    t: ArrayLike,
    loads: Loads,
    outputs: Ports,
    *,
    kind: str = "displacement",
    at: StateLike = None,
    without: Sequence[str] = (),
    x0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
) -> ResponseResult:
    """Solve M y" + D y' + S y = F u(t); exact where the loads are linear between the times.

    x_{k+1} = e^{hA} x_k + h [(phi_1 - phi_2) B u_k + phi_2 B u_{k+1}] of the uncoupled parts of x' = A x + B u, with
    the matrix exponential and its phi functions. No step of its own: ``t`` resolves the load, not the vibration.

    Parameters
    ----------
    m
        A `Model` (linearised at ``at``), a linearised model, or a `MechanicalSystem`.
    t
        (n_t,) increasing times in s, any spacing; the state ``x0``, ``v0`` holds just before t[0].
    loads
        ``{input: load}`` or a list of such pairs. An input is a port or coordinate as in `mb.frf` (a direction w (n,)
        in the form of pairs); a load is an array (n_t,) of values at the times or a function of time in s. A motion of
        the base is a displacement history in m or rad; outputs that see its rate take differences of it.
    outputs
        As in `mb.frf`.
    kind
        "displacement", "velocity" or "acceleration": what ``.value`` holds.
    at, without
        State to linearise at; effects to leave out.
    x0, v0
        (n,) start values of the coordinates (deviations from the state) and of their rates; zero by default.

    Returns
    -------
    ResponseResult

    Raises
    ------
    ModelError
        Times that do not increase, a load of the wrong length, NaN, unknown ports.
    SingularError
        A mass matrix that is not positive definite.

    Notes
    -----
    Equations: docs/theory.md (7.4) to (7.6).
    Source of the exponential: Higham 2005. Cost: O(n^3) once, then O(n) per time for uncoupled modes, O(n^2) for small
    or badly conditioned systems; one set of propagators for each different step. Error estimate: the response to the
    parabola between load and chord, from the middle of each step (functions) or second differences (arrays).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> s = mb.MechanicalSystem(M=[[2.0]], K=[[8.0]])
    >>> y = mb.response(s, t=[0.0, 1.0], loads={0: lambda t: t}, outputs=0)
    >>> abs(y.value[0, 1] - (1 - np.sin(2) / 2) / 8) < 1e-14
    True
    """
    begin = time.perf_counter()
    choice("kind", kind, tuple(_KINDS))
    if isinstance(m, MechanicalSystem) and len(m.elements) > 0:
        raise ModelError(
            f"response() is linear and this system has nonlinear elements, {m.elements[0]!r} the first; integrate them by "
            "mb.simulate(system, t, loads=..., x0=..., v0=...), find periodic motions by mb.harmonic_balance, or leave them out: "
            "MechanicalSystem(M, C, K)"
        )
    times = rising("t", t, 2)
    ports, functions = _load_pairs(loads)
    linear = _with_inputs(m, ports, outputs, at, without)
    columns = len(linear.inputs) + len(linear.outputs)
    what = f"a response of {len(linear.outputs)} outputs to {len(linear.inputs)} loads at {len(times)} times"
    require_memory(_ROOM * columns * len(times), what, "ask for fewer outputs, or for fewer times")
    history = load_history(times, functions, linear.inputs)
    if linear.shared:
        again = list(linear.shared)
        history = replace(history, u=_again(history.u, again), bulge=_again(history.bulge, again))
    state = (_state(x0, linear.n, "x0"), _state(v0, linear.n, "v0"))
    solved, begun = (linear, state) if linear.states is None else _extended(linear, linear.states, state)
    with core_errors(), call_progress(f"response at {len(times)} times", len(times) * float(solved.n) ** 2):
        raw = solved.core.response(solved.maps, (history.t, history.u, history.bulge, *begun))
    counts = added_counts(linear.source, raw["counts"])
    error_history = raw[f"{kind}_error"]
    return ResponseResult(
        t=times,
        displacement=raw["displacement"],
        velocity=raw["velocity"],
        acceleration=raw["acceleration"],
        kind=kind,
        inputs=linear.inputs,
        outputs=linear.outputs,
        error_history=error_history,
        linear=linear,
        history=history,
        start=state,
        origin=Origin(m, ports, outputs, at, tuple(without)),
        stats=Stats(time.perf_counter() - begin, counts, linear.effects, raw["route"]),
        error=_relative(error_history, raw[kind]) + _rounding(times),
        status="converged",
    )


def response_sensitivity(
    result: ResponseResult,
    parameters: Sequence[str],
    *,
    dM: np.ndarray | None = None,
    dD: np.ndarray | None = None,
    dS: np.ndarray | None = None,
    dF: np.ndarray | None = None,
    dL: np.ndarray | None = None,
    dD0: np.ndarray | None = None,
) -> ResponseSensitivity:
    """Solve M dy" + D dy' + S dy = dF u - dM y" - dD y' - dS y with the motion itself, exactly in the same sense.

    Parameters
    ----------
    result
        The response to differentiate; its loads and start values do not depend on the parameters.
    parameters
        n_p names.
    dM, dD, dS, dF, dL, dD0
        Derivatives of the matrices and maps with a last axis of n_p, or None where nothing changes.

    Returns
    -------
    ResponseSensitivity

    Notes
    -----
    Propagated by the exponential of [[A, 0], [dA, A]]. Cost per parameter: O((4n)^3) once and O(n^2) per time.
    """
    begin = time.perf_counter()
    linear, history, state = result.linear, result.history, result.start
    if linear is None or history is None or state is None:
        raise ModelError(
            "this response was made without its linear system; only results of mb.response have derivatives"
        )
    if linear.states is not None:
        raise relaxes(linear.states.names[0])
    changes = (None if a is None else np.asarray(a, dtype=float) for a in (dM, dD, dS, dF, dL, dD0))
    loads = (history.t, history.u, history.bulge, *state)
    with core_errors():
        raw = linear.core.response_sensitivity(linear.maps, loads, (len(parameters), *changes))
    shape = (len(linear.outputs), history.t.size, len(parameters))
    value, error = np.zeros(shape), np.zeros((shape[0], shape[2]))
    counts: dict[str, int] = {}
    for p, along in enumerate(raw):
        value[:, :, p] = along[result.kind]
        error[:, p] = _relative(along[f"{result.kind}_error"], along[result.kind]) + _rounding(history.t)
        for name, n in along["counts"].items():
            counts[name] = counts.get(name, 0) + n
    return ResponseSensitivity(
        t=history.t,
        value=value,
        kind=result.kind,
        outputs=linear.outputs,
        labels=tuple(parameters),
        stats=Stats(time.perf_counter() - begin, counts, linear.effects, "block exponential"),
        error=error,
    )


def load_history(t: np.ndarray, loads: Sequence[Any], names: Sequence[str]) -> LoadHistory:
    """Values at the times and in the middle of the steps."""
    u = np.empty((len(loads), t.size))
    bulge = np.empty((len(loads), t.size - 1))
    for j, (load, name) in enumerate(zip(loads, names, strict=True)):
        if callable(load):
            u[j] = _sample(load, t, name)
            middle = _sample(load, 0.5 * (t[1:] + t[:-1]), name)
            bulge[j] = middle - 0.5 * (u[j, 1:] + u[j, :-1])
            # rounding of the load is not curvature
            bulge[j, np.abs(bulge[j]) <= 4 * np.finfo(float).eps * np.abs(u[j]).max()] = 0.0
        else:
            u[j] = real_array(
                f"the load on {name}", load, t.shape, "give one value for each time, or a function of time"
            )
            bulge[j] = _curvature_bulge(t, u[j])
    return LoadHistory(t, u, bulge)


def _load_pairs(loads: Any) -> tuple[list[Any], list[Any]]:
    pairs: Iterable[Any]
    if isinstance(loads, Mapping):
        pairs = loads.items()
    elif isinstance(loads, list | tuple):
        pairs = loads
    else:
        raise ModelError(f"loads must be {{input: load}} or a list of pairs, got {type(loads).__name__}")
    ports, functions = [], []
    for pair in pairs:
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise ModelError(f"loads must hold pairs (input, load), got {shown(pair)}")
        ports.append(pair[0])
        functions.append(pair[1])
    return ports, functions


def _again(a: np.ndarray, rows: list[int]) -> np.ndarray:
    return a[[*range(len(a)), *rows]]


def _with_inputs(m: Any, ports: list[Any], outputs: Any, at: Any, without: Sequence[str]) -> LinearSystem:
    """Free motion has no loads: any coordinate is then the input, with zero force."""
    from .matrices import MechanicalSystem

    if isinstance(m, MechanicalSystem):
        if ports:
            made = [directions(p, m.coordinates, "loads") for p in ports]
            columns = [W for W, _ in made]
            wide = [p for p, W in zip(ports, columns, strict=True) if W.shape[1] != 1]
            if wide:
                raise ModelError(f"each load needs one direction, got {wide[0]!r}")
            linear = linear_system(m, np.hstack(columns), outputs, at, without, relaxing=True)
            return _renamed(linear, tuple(names[0] for _, names in made))
        return _renamed(linear_system(m, np.zeros(m.n), outputs, at, without), ())
    if not ports:
        raise ModelError("loads is empty; give at least one load (0.0 as a function of time for free motion)")
    return linear_system(m, ports, outputs, at, without, relaxing=True)


def _extended(linear: LinearSystem, own: States, state: tuple[Any, Any]) -> tuple[LinearSystem, tuple[Any, Any]]:
    """States of laws and of the air as further coordinates, at rest at the start."""
    m = len(own.own)
    coordinates = (*linear.coordinates, *(f"state of {name} ({j + 1})" for j, name in enumerate(own.names)))
    F, L = np.pad(linear.F, ((0, m), (0, 0))), np.pad(linear.L, ((0, 0), (0, m)))
    made = replace(linear, other=linear.source.extended, F=F, L=L, coordinates=coordinates)
    return made, tuple(np.pad(x, (0, m)) for x in state)  # type: ignore[return-value]


def _renamed(linear: LinearSystem, names: tuple[str, ...]) -> LinearSystem:
    k = len(names)
    return replace(linear, inputs=names, F=linear.F[:, :k], order_in=linear.order_in[:k])


def _state(x: Any, n: int, name: str) -> np.ndarray:
    return np.zeros(n) if x is None else real_array(name, x, (n,), "give one number for each coordinate")


def _sample(load: Callable[[Any], Any], t: np.ndarray, name: str) -> np.ndarray:
    values = _vectorised(load, t)
    if values is None:
        try:
            values = np.array([float(load(float(s))) for s in t])
        except UNFIT as problem:
            raise ModelError(f"the load on {name} must return one number for a time in s: {problem}") from None
    if not np.all(np.isfinite(values)):
        raise ModelError(f"the load on {name} is not finite at t = {t[~np.isfinite(values)][0]:.6g} s")
    return values


def _vectorised(load: Callable[[Any], Any], t: np.ndarray) -> np.ndarray | None:
    """All values in one call, where the function takes arrays and means them element by element."""
    try:
        values = np.asarray(load(t), dtype=float)
        if values.shape != t.shape:
            return None
        probe = [0, t.size // 2, t.size - 1]
        single = np.array([float(load(float(t[k]))) for k in probe])
    except Exception:
        return None
    return values if np.allclose(values[probe], single, rtol=_SAME_LOAD, atol=0.0, equal_nan=True) else None


def _curvature_bulge(t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """-h^2 u"/8 with u" from second differences: the bulge of a smooth load of which only samples are known."""
    if t.size < 3:
        return np.zeros(t.size - 1)
    h = np.diff(t)
    slope = np.diff(u) / h
    second = 2.0 * np.diff(slope) / (h[1:] + h[:-1])
    bulge: np.ndarray = -(h**2) / 8.0 * 0.5 * (np.append(second[0], second) + np.append(second, second[-1]))
    # samples on a straight line up to their rounding have none
    bulge[np.abs(bulge) <= 4 * np.finfo(float).eps * np.abs(u).max()] = 0.0
    return bulge


def _relative(error: np.ndarray, value: np.ndarray) -> np.ndarray:
    size = np.abs(value).max(axis=1)
    relative: np.ndarray = np.abs(error).max(axis=1) / np.where(size > 0.0, size, 1.0)
    return relative


def _rounding(t: np.ndarray) -> float:
    return float(np.finfo(float).eps * np.sqrt(t.size))
