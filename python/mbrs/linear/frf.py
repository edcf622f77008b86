"""Transfer functions of linear systems and of linearised models."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import choice, count, real_array
from .._lib.progress import call_progress
from .._lib.text import counted
from .._lib.warning import warn_user
from ..errors import ModelError
from ..results import Result, Stats, added_counts, quantity, result
from .linear_system import LinearSystem, Origin, csc_arrays, relaxes
from .relaxation import States
from .second_order import linear_system

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..system.state import StateLike
    from .aliases import Linear, Ports

# Half width of a peak over its frequency below which it counts as undamped, and the first step from such a pole over its frequency.
# Larger: points miss the flanks of sharp peaks; smaller: points where a value is only as large as the pole is near.
_UNDAMPED, _FIRST_STEP = 1e-9, 1e-4
ORDER_OUT = {"receptance": 0, "mobility": 1, "accelerance": 2, "transmissibility": 0}
_COARSE_POINTS = 200
# Relative distance from a pole at which its peak is looked at. Larger: narrow or weak resonances are not told. Smaller: undamped ones cost
# O(n^3) each, and modes that the ports do not see show by rounding. Pinned by tests/linear/test_frf.py.
_BESIDE_POLE = 1e-11


@result
class FrfResult(Result):
    """Transfer functions H(omega), time dependence exp(+i omega t).

    Attributes
    ----------
    value
        (n_out, n_in, n_freq) complex, output unit over input unit. Infinite at undamped resonances and, for free
        systems, at 0 Hz.
    frequency, omega
        (n_freq,) Hz and rad/s, ascending where a range was asked for, else in the order given.
    kind
        "receptance", "mobility", "accelerance" or "transmissibility".
    inputs, outputs
        Names.
    poles
        All poles in rad/s, complex, or None where the mass matrix is singular.
    error
        Largest relative difference from direct solves at the frequencies that were checked (the slowest, the fastest, the one
        nearest to a resonance): of all outputs together, and of each entry by its own size. Up to eight frequencies are solved
        directly and refined, each entry to its last digits.
    """

    value: np.ndarray = quantity(dims=("output", "input", "frequency"), name="H")
    frequency: np.ndarray = quantity(dims=("frequency",), unit="Hz")
    omega: np.ndarray = quantity(dims=("frequency",), unit="rad/s")
    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    poles: np.ndarray | None = quantity(dims=("pole",), unit="rad/s", default=None)
    linear: LinearSystem | None = field(default=None, kw_only=True)
    origin: Origin | None = field(default=None, kw_only=True)

    row: ClassVar[str] = "frequency"
    axes: ClassVar[Mapping[str, str]] = {"output": "outputs", "input": "inputs"}

    @property
    def magnitude(self) -> np.ndarray:
        """|H|, (n_out, n_in, n_freq)."""
        return np.asarray(np.abs(self.value))

    @property
    def phase(self) -> np.ndarray:
        """Phase in radians in (-pi, pi], (n_out, n_in, n_freq); nan where H is infinite."""
        return np.where(np.isfinite(self.value), np.angle(self.value), np.nan)

    def heading(self) -> str:
        n_out, n_in, n_freq = self.value.shape
        span = f", {self.frequency.min():.6g} to {self.frequency.max():.6g} Hz" if n_freq else ""
        return (
            f"{self.kind}: {counted(n_out, 'output')} x {counted(n_in, 'input')} x {counted(n_freq, 'frequency')}{span}"
        )

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "kind": self.kind}

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest magnitude of each transfer function."""
        rows: list[list[Any]] = []
        for i, j in np.ndindex(self.value.shape[:2]):
            size = self.magnitude[i, j]
            k = int(np.argmax(np.nan_to_num(size, nan=-1.0, posinf=np.inf)))
            rows.append([f"{self.outputs[i]} / {self.inputs[j]}", float(size[k]), float(self.frequency[k])])
        return ["output / input", "largest |H|", "at [Hz]"], rows

    def notes(self) -> list[str]:
        return [f"route: {self.stats.route}, error {self.error:.1e}, {self.status}"]

    def plot(
        self, kind: str = "bode", *, marks: ArrayLike = (), ax: Axes | None = None, label: str | None = None
    ) -> Figure:
        """``kind="bode"`` or ``"nyquist"``; ``ax``: axes to draw into, of a Bode plot one (magnitude) or two. Returns the
        figure; see `mbrs.plot.frf`.
        """
        from ..plot import frf as draw

        return draw(self, kind, marks=marks, ax=ax, label=label)


@result
class FrfSensitivity(Result):
    """Derivatives of transfer functions.

    ``value`` (n_out, n_in, n_freq, n_p) complex: dH/dp along each parameter alone, nan at singular frequencies; a single array
    parameter keeps its shape there. ``labels`` their names; the rest as in `FrfResult`. ``error`` is the relative error of the linear
    solutions.
    """

    value: np.ndarray = quantity(dims=("output", "input", "frequency", "parameter"), name="dH_dp")
    frequency: np.ndarray = quantity(dims=("frequency",), unit="Hz")
    omega: np.ndarray = quantity(dims=("frequency",), unit="rad/s")
    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    labels: tuple[str, ...]

    row: ClassVar[str] = "frequency"
    axes: ClassVar[Mapping[str, str]] = {"output": "outputs", "input": "inputs", "parameter": "labels"}

    def heading(self) -> str:
        return f"d {self.kind} / d p at {counted(self.frequency.size, 'frequency')}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest derivative by each parameter."""
        rows: list[list[Any]] = []
        sizes = np.nan_to_num(np.abs(self.labelled()["dH_dp"][1]), nan=-1.0).max(axis=(0, 1))
        for name, size in zip(self.labels, sizes.T, strict=True):
            k = int(np.argmax(size))
            rows.append([name, float(size[k]), float(self.frequency[k])])
        return ["parameter", "largest |dH/dp|", "at [Hz]"], rows

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """|dH/dp| over the frequency, a line for each parameter and pair of ports; returns the figure."""
        from ..plot.derivatives import frf_sensitivity

        return frf_sensitivity(self, ax=ax)


def frf(
    m: Linear,
    inputs: Ports,
    outputs: Ports,
    *,
    frequency: ArrayLike | None = None,
    omega: ArrayLike | None = None,
    kind: str = "receptance",
    modes: int | None = None,
    at: StateLike = None,
    without: Sequence[str] = (),
) -> FrfResult:
    """Transfer functions H(omega) = (i omega)^q (L Z^-1 F (i omega)^p + D0), Z = S - omega^2 M + i omega D.

    D = C + G, S = K + N; q = 0, 1, 2 for receptance, mobility, accelerance; p = 2 and D0 = the rigid part for a motion
    of the base, p = 0 and no D0 for forces.

    Parameters
    ----------
    m
        A `Model` (linearised at ``at``), a linearised model, or a `MechanicalSystem`.
    inputs, outputs
        Ports of a model, such as ``body.force("z")``, ``mb.base_motion("z")`` and ``body.motion("z")``, one or a list.
        For a `MechanicalSystem`: coordinate names or indices, a direction w (n,) or directions (n, k); an input is then
        the force w u, an output w . x.
    frequency, omega
        Exactly one, in Hz or rad/s. A 2-tuple is a range that is sampled as needed: 200 points, logarithmic where the
        range spans more than a decade, and around each pole s = -sigma +- i omega_d points at distances of sigma / 4 up
        to sigma, then growing by 1.6 (without damping from 1e-4 omega_d on). An array or list is the set of points.
    kind
        "receptance", "mobility", "accelerance", or "transmissibility" (motion per motion of the base).
    modes
        Sum up only this many lowest modes; ``error`` then says what the others would have added. All by default.
    at, without
        State to linearise at; effects to leave out.

    Returns
    -------
    FrfResult
        ``value`` (n_out, n_in, n_freq).

    Raises
    ------
    ModelError
        Unknown inputs or outputs, no or two frequency arguments, NaN.

    Warns
    -----
    MbrsWarning
        A resonance that the given points miss, and frequencies at which H is infinite.

    Notes
    -----
    Equations: docs/theory.md (7.1) to (7.3).
    Cost: O(n^3) once for a set of matrices (kept for later calls), then O(n) per entry and frequency for well
    conditioned modes, O(n b^2) per frequency for matrices of a narrow half-bandwidth b in some order (chains; damped ones
    need no modes then, their poles take O(n^2 b^2)), O(n^2) otherwise. Sparse systems of more than 400 coordinates stay sparse: one
    factorisation per frequency; poles are then known as far as the range or the points reach.

    Examples
    --------
    >>> import mbrs as mb
    >>> s = mb.MechanicalSystem(M=[[2.0]], C=[[0.4]], K=[[8.0]])
    >>> h = mb.frf(s, inputs=0, outputs=0, omega=[2.0])
    >>> abs(h.value[0, 0, 0] - 1 / (0.8j)) < 1e-14
    True
    """
    start = time.perf_counter()
    choice("kind", kind, tuple(ORDER_OUT))
    points, limits = _grid(frequency, omega)
    linear = linear_system(m, inputs, outputs, at, without, relaxing=True)
    if kind == "transmissibility" and np.any(linear.order_in[: len(linear.inputs)] != 2):
        raise ModelError("a transmissibility needs motions of the base as inputs, such as mb.base_motion('z')")
    if modes is not None:
        modes = count("modes=", modes, sys.maxsize)
    solver: _Dense | _Sparse | _Relaxing
    if linear.states is not None:
        solver = _Relaxing(linear, linear.states, ORDER_OUT[kind], modes)
    elif linear.is_large:
        solver = _Sparse(linear, ORDER_OUT[kind], points, limits)
    else:
        solver = _Dense(linear, ORDER_OUT[kind], modes)
    if linear.is_large and modes is not None:
        raise ModelError("modes= is for dense systems; a large sparse one is solved directly at each frequency")
    poles = solver.poles
    if points is None:
        assert limits is not None
        points = _sampled(limits, poles)
    with (
        core_errors(),
        call_progress(f"transfer function at {len(points)} frequencies", len(points) * float(linear.n) ** 2),
    ):
        raw = solver.evaluate(points)
        if limits is None:
            _warn_missed(solver, points, poles, raw["value"])
    _warn_singular(points, raw["singular"])
    counts = added_counts(linear.source, solver.counts, raw["counts"])
    return FrfResult(
        value=raw["value"],
        frequency=points / (2 * np.pi),
        omega=points,
        kind=kind,
        inputs=linear.inputs,
        outputs=linear.outputs,
        poles=poles,
        linear=linear,
        origin=Origin(m, inputs, outputs, at, tuple(without)),
        stats=Stats(time.perf_counter() - start, counts, linear.effects, raw["route"]),
        error=raw["error"],
        status="singular" if raw["singular"] else "converged",
    )


def frf_sensitivity(
    linear: LinearSystem,
    omega: np.ndarray,
    parameters: Sequence[str],
    *,
    kind: str = "receptance",
    dM: np.ndarray | None = None,
    dD: np.ndarray | None = None,
    dS: np.ndarray | None = None,
    dF: np.ndarray | None = None,
    dL: np.ndarray | None = None,
    dD0: np.ndarray | None = None,
) -> FrfSensitivity:
    """dH = dL Z^-1 F + L Z^-1 dF - L Z^-1 dZ Z^-1 F (+ dD0) from derivatives of the matrices and maps.

    Parameters
    ----------
    linear
        The system, such as ``FrfResult.linear``.
    omega
        (n_freq,) rad/s.
    parameters
        n_p names.
    dM, dD, dS
        (n, n, n_p) derivatives of M, D = C + G, S = K + N; None where nothing changes. Zeros cost nothing.
    dF, dL, dD0
        (n, n_in, n_p), (n_out, n, n_p), (n_out, n_in, n_p), or None; columns in the order of ``linear.F``.

    Returns
    -------
    FrfSensitivity

    Notes
    -----
    Cost: one factorisation O(n^3) per frequency, then O(non-zeros (n_in + n_out)) per parameter.
    """
    start = time.perf_counter()
    if linear.states is not None:
        raise relaxes(linear.states.names[0])
    omega = np.ascontiguousarray(omega, dtype=float)
    changes = (None if a is None else np.asarray(a, dtype=float) for a in (dM, dD, dS, dF, dL, dD0))
    with core_errors():
        raw = linear.core.sensitivity(linear.maps, ORDER_OUT[kind], omega, (len(parameters), *changes))
    return FrfSensitivity(
        value=linear.joined(raw["value"], 1),
        frequency=omega / (2 * np.pi),
        omega=omega,
        kind=kind,
        inputs=linear.inputs,
        outputs=linear.outputs,
        labels=tuple(parameters),
        stats=Stats(time.perf_counter() - start, raw["counts"], linear.effects, "direct"),
        error=raw["error"],
        status="singular" if raw["singular"] else "converged",
    )


class _Dense:
    """A system bound to its ports."""

    def __init__(self, linear: LinearSystem, order_out: int, modes: int | None) -> None:
        self.linear, self.order_out, self.modes = linear, order_out, modes
        self.poles: np.ndarray | None
        self.counts: Mapping[str, int]
        with core_errors():
            self.poles, self.counts = linear.core.poles()

    def evaluate(self, omega: np.ndarray, checked: bool = True) -> dict[str, Any]:
        p = self.linear
        raw = p.core.evaluate(p.maps, self.order_out, omega, self.modes, checked)
        return {**raw, "value": p.joined(raw["value"], 1)}


class _Relaxing:
    """A system with states z' = P y + R y' + A z of laws and of the air, which act by E z: H + H_E (s - A - B H_E)^-1 B H, B = P + s R."""

    def __init__(self, linear: LinearSystem, own: States, order_out: int, modes: int | None) -> None:
        if modes is not None:
            raise ModelError("modes= does not know states of laws or of the air; leave it out")
        self.linear, self.order_out, self.own = linear, order_out, own
        m = len(own.own)
        F, L = np.hstack([linear.F, own.effect]), np.vstack([linear.L, own.by_place, own.by_rate])
        D0 = None if linear.D0 is None else np.pad(linear.D0, ((0, 2 * m), (0, m)))
        names = tuple(f"u{j}" for j in range(F.shape[1]))
        order_in = np.concatenate([linear.order_in, np.zeros(m, dtype=np.int64)])
        other = None if own.stiffness is None else own.held_system(linear.M, linear.D, linear.S)
        bare = replace(linear, other=other, F=F, L=L, D0=D0, order_in=order_in, inputs=names, shared=())
        self.bare = _Dense(bare, 0, None)
        with core_errors():
            poles, counts = linear.source.extended.poles()
        # the zero roots belong to no motion
        assert poles is not None
        self.poles: np.ndarray | None = poles[np.argsort(np.abs(poles), kind="stable")][m:]
        self.counts: Mapping[str, int] = added_counts(self.bare.counts, counts)

    def evaluate(self, omega: np.ndarray, checked: bool = True) -> dict[str, Any]:
        m = len(self.own.own)
        raw = self.bare.evaluate(omega, checked)
        H, s = np.moveaxis(raw["value"], 2, 0), 1j * omega[:, None, None]
        driven = H[:, -2 * m : -m] + s * H[:, -m:]
        inner = s * np.eye(m) - self.own.own - driven[:, :, -m:]
        value = H[:, : -2 * m, :-m] + H[:, : -2 * m, -m:] @ np.linalg.solve(inner, driven[:, :, :-m])
        value = np.moveaxis(value, 0, 2) * (1j * omega) ** self.order_out
        return {**raw, "value": self.linear.joined(value, 1), "route": f"{raw['route']}, condensed states"}


class _Sparse:
    """A large system, solved anew at each frequency; its poles are computed up to the highest one."""

    _most_poles = 300

    def __init__(
        self,
        linear: LinearSystem,
        order_out: int,
        points: np.ndarray | None,
        limits: tuple[float, float] | None,
    ) -> None:
        self.linear, self.order_out = linear, order_out
        self.arrays = (
            csc_arrays(linear.M),
            None if linear.D is None else csc_arrays(linear.D),
            csc_arrays(linear.S),
        )
        self.counts: Mapping[str, int] = {}
        highest = limits[1] if limits is not None else float(np.abs(points).max()) if points is not None else 0.0
        self.poles = self._poles(highest)

    def _poles(self, highest: float) -> np.ndarray | None:
        """Poles within reach, or None where they cannot be counted or are too many to be worth it."""
        M, D, S = self.arrays
        with core_errors():
            try:
                below = _core.sparse_count(M, S, highest**2)
                if below is None or below > self._most_poles:
                    return None
                found = _core.sparse_modes(M, D, S, min(below + 2, self.linear.n))
            except _core.CoreError:
                return None
        self.counts = found["counts"]
        s = found["eigenvalue"] if "eigenvalue" in found else 1j * np.sqrt(found["lambda"].astype(complex))
        return np.concatenate([s, np.conj(s)])

    def evaluate(self, omega: np.ndarray, checked: bool = True) -> dict[str, Any]:
        """Each frequency is solved for, and its residual checked, whatever ``checked`` says."""
        p = self.linear
        raw = _core.sparse_frf(*self.arrays, p.L, p.F, p.order_in, p.D0, self.order_out, omega)
        return {**raw, "value": p.joined(raw["value"], 1)}


def _grid(frequency: Any, omega: Any) -> tuple[np.ndarray | None, tuple[float, float] | None]:
    """Points in rad/s, or the limits of a range in rad/s."""
    if (frequency is None) == (omega is None):
        raise ModelError("give exactly one of frequency= (Hz) and omega= (rad/s)")
    name, given, factor = ("frequency", frequency, 2 * np.pi) if omega is None else ("omega", omega, 1.0)
    values = real_array(name, given, None, "give points, or a range as the tuple (from, to)")
    if isinstance(given, tuple) and values.shape == (2,):
        low, high = (float(v) * factor for v in values)
        if not 0.0 <= low < high:
            raise ModelError(f"{name}={given} is not a range: it must satisfy 0 <= from < to")
        return None, (low, high)
    return real_array(name, np.atleast_1d(values), ("n",), "give at least one point") * factor, None


def _sampled(limits: tuple[float, float], poles: np.ndarray | None) -> np.ndarray:
    low, high = limits
    if low > 0.0 and high > 10.0 * low:
        coarse = np.geomspace(low, high, _COARSE_POINTS)
    else:
        coarse = np.linspace(low, high, _COARSE_POINTS)
    coarse[[0, -1]] = low, high
    parts: list[np.ndarray] = [coarse]
    for pole in _resonances(poles, low, high):
        width = abs(pole.real)
        undamped = width < _UNDAMPED * pole.imag
        step = _FIRST_STEP * pole.imag if undamped else width
        reach = max(0.15 * pole.imag, 4.0 * step)
        growing = step * 1.6 ** np.arange(1 + int(np.ceil(np.log(reach / step) / np.log(1.6))))
        near = step * np.arange(0.0 if not undamped else 0.25, 1.0, 0.25)
        offsets = np.concatenate([near, growing])
        parts += [pole.imag + offsets, pole.imag - offsets]
    points = np.unique(np.concatenate(parts))
    return points[(points >= low) & (points <= high)]


def _resonances(poles: np.ndarray | None, low: float, high: float) -> list[complex]:
    """Poles in the range that make a peak (damping ratio below 1/sqrt 2), repeated ones once."""
    return [] if poles is None else _core.resonances(_roots(poles), low, high).tolist()


def _roots(poles: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(poles, dtype=complex)


def _warn_missed(
    solver: _Dense | _Sparse | _Relaxing, points: np.ndarray, poles: np.ndarray | None, value: np.ndarray
) -> None:
    """A resonance is missed when its half-power band lies between two neighbouring points and its peak shows in H."""
    suspects = [] if poles is None else _core.unseen_resonances(_roots(poles), points)
    if not suspects:
        return
    # at an undamped pole itself the dynamic stiffness is singular, which costs a singular value decomposition each
    beside = np.array(suspects, dtype=float) * (1.0 + _BESIDE_POLE)
    peaks = solver.evaluate(beside, checked=False)["value"]
    found = _core.missed_resonances(points, _roots(value).ravel(), suspects, _roots(peaks).ravel())
    missed = [w / (2 * np.pi) for w in found]
    if missed:
        shown = ", ".join(f"{f:.6g}" for f in missed[:8]) + (", ..." if len(missed) > 8 else "")
        warn_user(
            f"the frequency points miss {len(missed)} resonance{'s' if len(missed) > 1 else ''} at {shown} Hz; "
            "a range such as frequency=(from, to) is sampled as needed"
        )


def _warn_singular(points: np.ndarray, singular: Sequence[int]) -> None:
    for index in list(singular)[:3]:
        f = points[index] / (2 * np.pi)
        why = "the system can move freely" if f == 0.0 else "it lies on an undamped resonance"
        warn_user(
            f"the dynamic stiffness is singular at {f:.6g} Hz ({why}): the transfer function is infinite at this frequency"
        )
