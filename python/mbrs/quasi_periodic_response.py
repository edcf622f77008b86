"""Branches of quasi-periodic responses, in a common factor on the frequencies or in the level of the forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from . import _balance, _core
from ._picked import label
from .continuation import MEANING, STATUS
from .errors import ModelError
from .harmonic_balance import UNRESOLVED, effects_of
from .quasi_periodic import QuasiPeriodicSolution, Torus
from .report import html_table, table
from .results import Result, Stats


@dataclass(frozen=True, eq=False)
class QuasiPeriodicResponse(Result):
    """A branch of quasi-periodic solutions.

    ``scale`` (n,) multiplies all frequencies, ``level`` (n,) all forces but the static one; ``omega`` (n, p); ``X``
    (n, dof,
    2 n_k + 1) with the ``indices`` (n_k, p); ``folds`` are solutions at turning points of the branch, solved for;
    ``error`` (n,).
    """

    scale: np.ndarray
    level: np.ndarray
    omega: np.ndarray
    X: np.ndarray
    indices: np.ndarray
    folds: tuple[QuasiPeriodicSolution, ...]
    system: Any = field(default=None, repr=False)
    forces: Any = field(default=None, repr=False)
    static: Any = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.scale)

    def coefficient(self, dof: Any = 0, index: Sequence[int] = (1, 0)) -> np.ndarray:
        """(n,) a - i b of one term of one displacement."""
        return np.array([self.point(i).coefficient(dof, index) for i in range(len(self))])

    def amplitude(self, dof: Any = 0, index: Sequence[int] = (1, 0)) -> np.ndarray:
        """(n,) magnitude of one term of one displacement."""
        return np.abs(self.coefficient(dof, index))

    def label(self, dof: Any = 0) -> str:
        """Name of a displacement."""
        return label(self.system, dof, self.X.shape[1])

    @property
    def varies(self) -> str:
        """What changes along the branch: "scale" or "level"."""
        return "scale" if np.ptp(self.scale) > 0 else "level"

    def abscissa(self) -> tuple[np.ndarray, str, np.ndarray]:
        """What the branch is drawn over, its name, and where the folds are."""
        if self.varies == "level":
            first = [np.max(np.abs(np.asarray(f["force"], complex))) for f in self.forces]
            given = [
                np.max(np.abs(np.asarray(f.forces[i]["force"]))) for f in self.folds for i in [int(np.argmax(first))]
            ]
            return self.level, "force level", np.array(given) / max(first)
        base = self.omega[0] / self.scale[0]
        return self.scale, "factor on the frequencies", np.array([f.omega[0] / base[0] for f in self.folds])

    def ordinates(self, dof: Any = 0, index: Any = None) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Name, amplitude and amplitude at the folds of the term ``index``, or of one term for each force."""
        chosen = np.eye(self.omega.shape[1], dtype=int).tolist() if index is None else [list(index)]
        return [
            (f"k = {tuple(k)}", self.amplitude(dof, k), np.array([f.amplitude(dof, k) for f in self.folds]))
            for k in chosen
        ]

    def point(self, i: int) -> QuasiPeriodicSolution:
        """One solution by itself."""
        return _solution(self, self.X[i], self.omega[i], float(self.level[i]), float(self.error[i]))

    def plot(self, dof: Any = 0, index: Sequence[int] | None = None, ax: Any = None) -> Any:
        """Amplitude of one term, or of one for each force, over the parameter, folds marked; returns the figure."""
        from .plot.nonlinear import torus_branch

        return torus_branch(self, dof, index, ax=ax)

    def to_xarray(self) -> Any:
        """Coefficients and error over the points, with scale and level as coordinates."""
        import xarray as xr

        return xr.Dataset(
            {
                "X": (("point", "coordinate", "coefficient"), self.X),
                "error": ("point", self.error),
                "index": (("term", "base"), self.indices),
                "omega": (("point", "base"), self.omega),
            },
            {
                "scale": ("point", self.scale),
                "level": ("point", self.level),
                "coordinate": [self.label(i) for i in range(self.X.shape[1])],
            },
            {"status": self.status},
        )

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: ends and folds."""
        x, name, marks = self.abscissa()
        moving = int(np.argmax(np.linalg.norm(self.X, axis=(0, 2))))
        terms = self.ordinates(moving)
        heads = ["point", name, *(f"|{self.label(moving)}|, {text}" for text, _, _ in terms), "error"]
        rows: list[list[Any]] = [["first", float(x[0]), *(float(y[0]) for _, y, _ in terms), f"{self.error[0]:.1e}"]]
        for i, mark in enumerate(marks):
            rows.append(["fold", float(mark), *(float(y[i]) for _, _, y in terms), f"{self.folds[i].error:.1e}"])
        rows.append(["last", float(x[-1]), *(float(y[-1]) for _, y, _ in terms), f"{self.error[-1]:.1e}"])
        return heads, rows

    def _heading(self) -> str:
        return (
            f"QuasiPeriodicResponse: {self.status} ({MEANING.get(self.status, '')}), {len(self)} points, "
            f"{len(self.folds)} folds, largest estimated error {np.max(self.error):.1e}"
        )

    def __str__(self) -> str:
        return table(*self.rows(), title=self._heading())

    def _repr_html_(self) -> str:
        return html_table(*self.rows(), title=self._heading())


def quasi_periodic_response(
    system: Any,
    forces: Sequence[Mapping[str, Any]],
    *,
    scale: Any = 1.0,
    level: Any = 1.0,
    harmonics: int = 7,
    indices: Any = None,
    static: Any = None,
    n_samples: Any = None,
    condense: bool | str = "auto",
    x0: QuasiPeriodicSolution | None = None,
    tol: float | None = None,
    predictor: str = "tangent",
    corrector: str = "pseudo-arclength",
    step: float = 0.01,
    min_step: float = 1e-9,
    max_step: float = 0.1,
    tolerance: float = 1e-9,
    max_points: int = 10000,
) -> QuasiPeriodicResponse:
    """Quasi-periodic responses along a branch, folds included.

    Parameters
    ----------
    scale, level
        One of them a range (a, b): the factor on all frequencies, or that on all forces but the static one.
    system, forces, harmonics, indices, static, n_samples, condense, x0, tol
        As for `quasi_periodic`; the frequencies keep their ratios.
    predictor, corrector, step, min_step, max_step, tolerance, max_points
        As for `frequency_response`.

    Raises
    ------
    ModelError, ConvergenceError
        As `quasi_periodic`.

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Cubic(1.5, w=[1.0])])
    >>> pair = [dict(force=[-0.25j], omega=2.0), dict(force=[-0.25j], omega=2.0 * 2**0.5)]
    >>> mb.quasi_periodic_response(duffing, pair, scale=(1.0, 0.75), harmonics=5).status
    'converged'
    """
    started = perf_counter()
    problem = Torus(system, forces, harmonics, indices, static, n_samples, condense)
    name, (a, b), other = _range(scale, level)
    limit = _balance.positive("tol", UNRESOLVED if tol is None else tol)
    most = _balance.integer("max_points", max_points)
    branch = _balance.translated(
        _core.HbmBranch,
        problem.core,
        problem.start(x0),
        (problem.omega * (1.0 if name == "scale" else other)).tolist(),
        1.0 if name == "level" else other,
        name,
        a,
        a,
        b,
        predictor=predictor,
        corrector=corrector,
        first_step=_balance.positive("step", step),
        least_step=_balance.positive("min_step", min_step),
        largest_step=_balance.positive("max_step", max_step),
        tolerance=_balance.positive("tolerance", tolerance),
        stability=False,
        events=True,
    )
    parts: list[dict[str, Any]] = []
    n = 0
    while n < most and (not parts or parts[-1]["status"] == "going"):
        parts.append(_balance.translated(branch.run, most - n, 0.2))
        n += len(parts[-1]["p"])
    return _collect(problem, parts, name, other, limit, perf_counter() - started)


def _range(scale: Any, level: Any) -> tuple[str, tuple[float, float], float]:
    for name, value, other in (("scale", scale, level), ("level", level, scale)):
        if np.shape(value) == (2,):
            ends = np.asarray(value, float)
            if not np.all(np.isfinite(ends)) or ends[0] == ends[1] or (name == "scale" and np.any(ends <= 0)):
                raise ModelError(f"{name} must be a range of two different finite numbers, it is {value!r}")
            if np.shape(other) != ():
                break
            return name, (float(ends[0]), float(ends[1])), _balance.checked_level(other)
    raise ModelError("give one range: scale=(a, b) or level=(a, b)")


def _collect(
    problem: Torus, parts: list[dict[str, Any]], name: str, other: float, limit: float, wall_time: float
) -> QuasiPeriodicResponse:
    p = np.concatenate([part["p"] for part in parts])
    y = np.concatenate([part["y"] for part in parts if len(part["p"])])
    error = np.concatenate([part["error"] for part in parts])
    fixed = np.full(len(p), other)
    scale, level = (p, fixed) if name == "scale" else (fixed, p)
    omega = scale[:, None] * problem.omega
    X = np.array([problem.expand(row, w) for row, w in zip(y, omega, strict=True)])
    last = parts[-1]["status"]
    status = "max-points" if last == "going" else STATUS[last]
    if status == "converged" and not np.all(error <= limit):
        status = "unresolved"
    counts = {"points": len(p), "corrections": parts[-1]["corrections"], "factorisations": parts[-1]["factorisations"]}
    stats = Stats(wall_time, counts, effects_of(problem.system), problem.linear.route)
    common: dict[str, Any] = dict(system=problem.system, forces=problem.forces, static=problem.static, stats=stats)
    curve = QuasiPeriodicResponse(scale, level, omega, X, problem.indices, (), error=error, status=status, **common)
    folds = []
    for event in (e for part in parts for e in part["events"] if e["kind"] == "fold"):
        w = problem.omega * (event["p"] if name == "scale" else other)
        at_level = event["p"] if name == "level" else other
        near = float(error[min(event["before"], len(error) - 1)])
        folds.append(_solution(curve, problem.expand(event["y"], w), w, float(at_level), near))
    object.__setattr__(curve, "folds", tuple(folds))
    return curve


def _solution(
    curve: QuasiPeriodicResponse, X: np.ndarray, omega: np.ndarray, level: float, error: float
) -> QuasiPeriodicSolution:
    forces = [
        dict(force=np.asarray(source["force"]) * level, omega=float(w))
        for source, w in zip(curve.forces, omega, strict=True)
    ]
    return QuasiPeriodicSolution(
        X, curve.indices, omega, (), curve.system, forces, curve.static, stats=curve.stats, error=error
    )
