"""Branches of periodic responses in any parameter of a system: the system is made anew for each value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from . import _balance
from ._picked import label, picked
from .continuation import MEANING
from .errors import ConvergenceError, ModelError
from .harmonic_balance import UNRESOLVED, PeriodicSolution, effects_of, harmonic_balance
from .report import html_table, table
from .results import Result, Stats


@dataclass(frozen=True, eq=False)
class ParameterResponse(Result):
    """A branch in a parameter: ``value`` (n,), ``X`` (n, dof, 2H+1), ``folds`` (values where the branch turns),
    ``error`` (n,).

    ``status``: "converged" (the end was reached), "left-at-start", "max-points", "stopped", "unresolved".
    """

    value: np.ndarray
    X: np.ndarray
    folds: np.ndarray
    omega: float
    family: Callable[[float], Any] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.value)

    def amplitude(self, dof: Any = 0, harmonic: int = 1) -> np.ndarray:
        """(n,) magnitude of one harmonic of one coordinate."""
        x = picked(self.X, self._system, dof)
        if _balance.whole("harmonic", harmonic) == 0:
            return np.abs(x[:, 0])
        if harmonic > (x.shape[1] - 1) // 2:
            return np.zeros(len(x))
        return np.hypot(x[:, 2 * harmonic - 1], x[:, 2 * harmonic])

    @property
    def _system(self) -> Any:
        return None if self.family is None else self.family(float(self.value[0]))

    def label(self, dof: Any = 0) -> str:
        """Name of a coordinate."""
        return label(self._system, dof, self.X.shape[1])

    def abscissa(self) -> tuple[np.ndarray, str, np.ndarray]:
        """What the branch is drawn over, its name, and where the folds are."""
        return self.value, "parameter", self.folds

    def ordinates(self, dof: Any = 0, index: Any = None) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Name of the harmonic, its amplitude, and at the folds that of the nearest point."""
        harmonic = 1 if index is None else index
        y = self.amplitude(dof, harmonic)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(self.value)))) + 1
        near = [y[min(turns, key=lambda i: abs(self.value[i] - fold), default=0)] for fold in self.folds]
        return [(f"harmonic {harmonic}", y, np.array(near))]

    def plot(self, dof: Any = 0, harmonic: int = 1, ax: Any = None) -> Any:
        """Amplitude over the parameter, folds marked; returns the figure."""
        from .plot.nonlinear import torus_branch

        return torus_branch(self, dof, harmonic, ax=ax)

    def to_xarray(self) -> Any:
        """Coefficients and error over the value of the parameter."""
        import xarray as xr

        return xr.Dataset(
            {"X": (("point", "coordinate", "coefficient"), self.X), "error": ("point", self.error)},
            {"value": ("point", self.value), "coordinate": [self.label(i) for i in range(self.X.shape[1])]},
            {"omega": self.omega, "status": self.status},
        )

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: ends, largest amplitude and folds, in the order of the curve."""
        moving = int(np.argmax(np.linalg.norm(self.X, axis=(0, 2))))
        y = self.amplitude(moving)
        picks = sorted({0: "first", int(np.argmax(y)): "largest", len(self) - 1: "last"}.items())
        rows: list[list[Any]] = [
            [i, name, float(self.value[i]), float(y[i]), f"{self.error[i]:.1e}"] for i, name in picks
        ]
        return ["point", "", "value", f"|{self.label(moving)}|", "error"], rows + [
            ["", "fold", float(fold), None, ""] for fold in self.folds
        ]

    def _heading(self) -> str:
        return (
            f"ParameterResponse: {self.status} ({MEANING.get(self.status, '')}), {len(self)} points, "
            f"omega = {self.omega:.8g} rad/s, largest estimated error {np.max(self.error):.1e}"
        )

    def __str__(self) -> str:
        return table(*self.rows(), title=self._heading(), footer="amplitudes of the first harmonic")

    def _repr_html_(self) -> str:
        return html_table(*self.rows(), title=self._heading(), footer="amplitudes of the first harmonic")


def parameter_response(
    family: Callable[[float], Any],
    *,
    value: tuple[float, float],
    force: Any,
    omega: float | None = None,
    frequency: float | None = None,
    harmonics: Any = 7,
    x0: Any = None,
    tol: float | None = None,
    step: float = 0.02,
    min_step: float = 1e-6,
    max_step: float = 0.1,
    max_points: int = 1000,
) -> ParameterResponse:
    """Periodic responses at one frequency while a parameter of the system changes, folds included.

    Parameters
    ----------
    family
        ``family(p)`` returns the `MechanicalSystem` for the value p, with the same coordinates for all values; for a model, for
        instance ``lambda p: (m.set({"k": p}), nonlinear_system(m))[1]``.
    value
        (start, end) of p.
    force, omega, frequency, harmonics, x0, tol
        As for `harmonic_balance`.
    step, min_step, max_step
        First, least and largest step where solution and range have length one.

    Returns
    -------
    ParameterResponse

    Raises
    ------
    ConvergenceError
        The first point was not found.

    Notes
    -----
    Pseudo-arclength continuation with the exact Jacobian of the core and a central difference along p: a slow path,
    some
    milliseconds and three systems per iteration. `frequency_response` is the fast one, for frequency and force level.

    Examples
    --------
    >>> import mbrs as mb
    >>> family = lambda k3: mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(k3, w=[1.0])])
    >>> mb.parameter_response(family, value=(0.01, 0.1), force=[0.18], omega=0.9).status
    'converged'
    """
    started = perf_counter()
    w = _balance.one_frequency(omega, frequency)
    if w.ndim != 0:
        raise ModelError("parameter_response works at one frequency")
    a, b = _range(value)
    limits = [_balance.positive(n, v) for n, v in [("step", step), ("min_step", min_step), ("max_step", max_step)]]
    most = _balance.integer("max_points", max_points)
    limit = _balance.positive("tol", UNRESOLVED if tol is None else tol)
    first = harmonic_balance(family(a), force=force, omega=float(w), harmonics=harmonics, x0=x0, condense=False)
    follower = _Follower(family, force, float(w), harmonics, (a, b), first, limits)
    while follower.status == "going" and len(follower.points) < most:
        follower.advance()
    values = np.array([z[-1] for z in follower.points])
    X = np.array([follower.expand(z) for z in follower.points])
    error = np.array([follower.error(z) for z in follower.points])
    status = "max-points" if follower.status == "going" else follower.status
    if status == "converged" and not np.all(error <= limit):
        status = "unresolved"
    counts = {"points": len(values), "corrections": follower.corrections}
    return ParameterResponse(
        values,
        X,
        np.array(follower.folds),
        float(w),
        family,
        stats=Stats(perf_counter() - started, counts, effects_of(family(a)), "full"),
        error=error,
        status=status,
    )


def _range(value: Any) -> tuple[float, float]:
    ends = np.asarray(value, dtype=float) if np.shape(value) == (2,) else np.zeros(0)
    if ends.size != 2 or not np.all(np.isfinite(ends)) or ends[0] == ends[1]:
        raise ModelError(f"value must be a range of two different finite numbers, it is {value!r}")
    return float(ends[0]), float(ends[1])


class _Follower:
    def __init__(
        self,
        family: Callable[[float], Any],
        force: Any,
        omega: float,
        harmonics: Any,
        span: tuple[float, float],
        first: PeriodicSolution,
        limits: list[float],
    ) -> None:
        self.family, self.force, self.omega, self.harmonics, self.span = family, force, omega, harmonics, span
        self.step, self.least, self.largest = limits
        self.status, self.corrections, self.folds = "going", 0, list[float]()
        setup = self._setup(span[0])
        z = np.append(setup.start(first), span[0])
        towards = np.zeros(len(z))
        towards[-1] = np.sign(span[1] - span[0])
        self.points = [z]
        self.tangent = self._correct(z, towards, self._scale(z))[1]

    def _setup(self, p: float) -> _balance.Setup:
        return _balance.prepare(self.family(p), self.force, self.harmonics, omega=self.omega, condense=False)

    def expand(self, z: np.ndarray) -> np.ndarray:
        return self._setup(z[-1]).expand(z[:-1], self.omega)

    def error(self, z: np.ndarray) -> float:
        options = dict(tolerance=1e-8, max_iterations=10)
        return float(_balance.translated(self._setup(z[-1]).core.solve, z[:-1], [self.omega], **options)["error"])

    def _scale(self, z: np.ndarray) -> np.ndarray:
        size = max(float(np.linalg.norm(z[:-1])), 1e-300)
        return np.append(np.full(len(z) - 1, size), abs(self.span[1] - self.span[0]))

    def _residual(self, z: np.ndarray) -> dict[str, Any]:
        return _balance.translated(self._setup(float(z[-1])).core.residual, z[:-1], [self.omega])

    def _linear(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        here = self._residual(z)
        h = 1e-5 * abs(self.span[1] - self.span[0])
        up, down = (self._residual(np.append(z[:-1], z[-1] + d))["residual"] for d in (h, -h))
        return here["residual"], np.column_stack([here["jacobian"], (up - down) / (2 * h)])

    def _correct(self, z: np.ndarray, border: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        """Newton's method in the plane through z across ``border`` (scaled); point, scaled tangent, iterations."""
        for iteration in range(1, 9):
            self.corrections += 1
            R, J = self._linear(z)
            A = np.vstack([J * scale, border])
            rows = np.max(np.abs(A), axis=1)
            step = np.linalg.solve(A / rows[:, None], -np.append(R, 0.0) / rows)
            z = z + step * scale
            if np.max(np.abs(step)) < 1e-8:
                tangent = np.linalg.solve(A / rows[:, None], np.append(np.zeros(len(R)), 1.0))
                return z, tangent / np.linalg.norm(tangent), iteration
        raise ConvergenceError("the corrector did not converge")

    def advance(self) -> None:
        z, scale = self.points[-1], self._scale(self.points[-1])
        while True:
            try:
                new, tangent, iterations = self._correct(z + self.step * self.tangent * scale, self.tangent, scale)
            except (ConvergenceError, np.linalg.LinAlgError):
                iterations, tangent = 99, self.tangent
            if iterations < 99 and tangent @ self.tangent > 0.5:
                break
            self.step /= 2
            if self.step < self.least:
                self.status = "stopped"
                return
        if tangent[-1] * self.tangent[-1] < 0:
            self.folds.append(self._fold(z, scale, self.tangent, self.step, tangent[-1]))
        turned = tangent * scale / self._scale(new)
        self.tangent = turned / np.linalg.norm(turned)
        self.step = min(self.largest, self.step * (1.5 if iterations <= 3 else 1.0 if iterations <= 5 else 0.6))
        self._append(new)

    def _append(self, new: np.ndarray) -> None:
        a, b = self.span
        forward = np.sign(b - a)
        if (new[-1] - b) * forward >= 0 or (new[-1] - a) * forward < 0:
            end = b if (new[-1] - b) * forward >= 0 else a
            self.status = "converged" if end == b else "left-at-start"
            old = self.points[-1]
            border = np.append(np.zeros(len(new) - 1), 1.0)
            new = old + (end - old[-1]) / (new[-1] - old[-1]) * (new - old)
            new[-1] = end
            new = self._correct(new, border, self._scale(new))[0]
        self.points.append(new)

    def _fold(self, z: np.ndarray, scale: np.ndarray, direction: np.ndarray, length: float, end: float) -> float:
        """Value where dp/ds = 0 between two points, by the method of false position (Illinois)."""
        low, high = (0.0, float(direction[-1])), (length, float(end))
        weights = [1.0, 1.0]
        value = z[-1]
        for _ in range(40):
            a, b = low[1] * weights[0], high[1] * weights[1]
            s = low[0] + (high[0] - low[0]) * a / (a - b)
            point, tangent, _ = self._correct(z + s * direction * scale, direction, scale)
            value = float(point[-1])
            if (tangent[-1] < 0) == (low[1] < 0):
                low, weights = (s, float(tangent[-1])), [1.0, weights[1] / 2]
            else:
                high, weights = (s, float(tangent[-1])), [weights[0] / 2, 1.0]
            if abs(tangent[-1]) < 1e-10 or high[0] - low[0] < 1e-10 * length:
                break
        return value
