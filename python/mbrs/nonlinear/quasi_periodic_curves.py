"""Branches of quasi-periodic responses in a factor on the frequencies, one of them, the level of the forces, or a parameter
of the system."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib import checks
from .._lib.checks import shown
from ..errors import Interrupted, ModelError
from ..model.book import Book
from ..results import Result, Stats, derived, quantity, result
from . import balance
from .branch_points import MEANING, STATUS
from .displacement import label
from .options import UNRESOLVED, Continuation, point_number, points
from .periodic import effects_of
from .quasi_periodic import MOST_AUTOMATIC, sources_of, torus_terms
from .quasi_periodic_solution import QuasiPeriodicSolution
from .torus import Torus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from ..system.state import StateLike
    from .displacement import Displacement


@result
class QuasiPeriodicResponse(Result):
    """A branch of quasi-periodic solutions.

    ``scale`` (n,) multiplies all frequencies, ``level`` (n,) all forces but the static one; ``omega`` (n, p); ``value`` (n,) is
    the parameter of the system of a branch in one, else None; ``X`` (n, dof, 2 n_k + 1) with the ``indices`` (n_k, p);
    ``folds`` are solutions at turning points of the branch, solved for; ``error`` (n,), of which those up to ``resolved`` are called
    resolved.
    """

    scale: np.ndarray = quantity(dims=("point",))
    level: np.ndarray = quantity(dims=("point",))
    omega: np.ndarray = quantity(dims=("point", "base"), unit="rad/s")
    X: np.ndarray = quantity(dims=("point", "coordinate", "coefficient"))
    indices: np.ndarray = quantity(dims=("term", "base"), name="index")
    folds: tuple[QuasiPeriodicSolution, ...]
    system: Any = field(default=None, repr=False)
    forces: Any = field(default=None, repr=False)
    static: Any = field(default=None, repr=False)
    value: np.ndarray | None = None
    parameter: str = "scale"
    family: Callable[[float], Any] | None = field(default=None, repr=False)
    fold_places: tuple[float, ...] = ()
    resolved: float = UNRESOLVED

    row: ClassVar[str] = "point"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates"}
    error_dims: ClassVar[tuple[str, ...]] = ("point",)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(self.label(i) for i in range(self.X.shape[1]))

    @property
    @derived(dims=("point",), name="parameter")
    def _parameter(self) -> np.ndarray:
        return self.axis()[0]

    def data_state(self) -> dict[str, Any]:
        return {**super().data_state(), "family": None}

    def __len__(self) -> int:
        return len(self.scale)

    def coefficient(self, dof: Displacement = 0, index: Sequence[int] = (1, 0)) -> np.ndarray:
        """(n,) a - i b of one term of one displacement."""
        return np.array([self.point(i).coefficient(dof, index) for i in range(len(self))])

    def amplitude(self, dof: Displacement = 0, index: Sequence[int] = (1, 0)) -> np.ndarray:
        """(n,) magnitude of one term of one displacement."""
        return np.abs(self.coefficient(dof, index))

    def label(self, dof: Displacement = 0) -> str:
        """Name of a displacement."""
        return label(self.system, dof, self.X.shape[1])

    @property
    def varies(self) -> str:
        """Quantity that varies along the branch: "scale", "level", "omega0" (a base frequency), or "value"."""
        return self.parameter

    def ordinates(
        self, dof: Displacement = 0, index: Sequence[int] | None = None
    ) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Name, amplitude and amplitude at the folds of the term ``index``, or of one term for each force."""
        chosen = np.eye(self.omega.shape[1], dtype=int).tolist() if index is None else [list(index)]
        return [
            (f"k = {tuple(k)}", self.amplitude(dof, k), np.array([f.amplitude(dof, k) for f in self.folds]))
            for k in chosen
        ]

    def point(self, i: int) -> QuasiPeriodicSolution:
        """One solution by itself."""
        i = point_number(i, len(self))
        one = _solution(self, self.X[i], self.omega[i], float(self.level[i]), float(self.error[i]))
        if self.family is not None and self.value is not None:
            one = one.replaced(system=self.family(float(self.value[i])))
        return one

    def plot(self, dof: Displacement = 0, index: Sequence[int] | None = None, ax: Axes | None = None) -> Figure:
        """Amplitude of one term, or of one for each force, over the parameter, folds marked; returns the figure."""
        from ..plot.nonlinear import torus_branch

        return torus_branch(self, dof, index, ax=ax)

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: ends and folds."""
        (x, name), marks = self.axis(), self.fold_places
        moving = int(np.argmax(np.linalg.norm(self.X, axis=(0, 2))))
        terms = self.ordinates(moving)
        heads = ["point", name, *(f"|{self.label(moving)}|, {text}" for text, _, _ in terms), "error"]
        rows: list[list[Any]] = [["first", float(x[0]), *(float(y[0]) for _, y, _ in terms), f"{self.error[0]:.1e}"]]
        for i, mark in enumerate(marks):
            rows.append(["fold", float(mark), *(float(y[i]) for _, _, y in terms), f"{self.folds[i].error:.1e}"])
        rows.append(["last", float(x[-1]), *(float(y[-1]) for _, y, _ in terms), f"{self.error[-1]:.1e}"])
        return heads, rows

    def heading(self) -> str:
        return (
            f"QuasiPeriodicResponse: {self.status} ({MEANING.get(self.status, '')}), {len(self)} points, "
            f"{len(self.folds)} folds, largest estimated error {np.max(self.error):.1e}"
        )

    def axis(self) -> tuple[np.ndarray, str]:
        """Abscissa of the branch, (n,), and its name; that of the folds is ``fold_places``."""
        if self.value is not None:
            return self.value, "value"
        if self.parameter.startswith("omega"):
            return self.omega[:, int(self.parameter[5:])], f"omega[{self.parameter[5:]}]"
        return (self.level, "force level") if self.parameter == "level" else (self.scale, "factor on the frequencies")


def quasi_periodic_response(
    system: Model | MechanicalSystem | Callable[[float], MechanicalSystem],
    forces: Sequence[Mapping[str, Any]],
    *,
    scale: float | tuple[float, float] = 1.0,
    level: float | tuple[float, float] = 1.0,
    value: tuple[float, float] | None = None,
    harmonics: int | str = 7,
    indices: ArrayLike | None = None,
    static: ArrayLike | None = None,
    n_samples: int | Sequence[int] | None = None,
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
    at: StateLike = None,
    without: Sequence[str] = (),
) -> QuasiPeriodicResponse:
    """Quasi-periodic responses along a branch, folds included.

    Parameters
    ----------
    scale, level, value
        One of them a range (a, b): the factor on all frequencies, that on all forces but the static one, or the parameter of a
        ``system`` that is a function of it. Or none of them a range, and one of the ``forces`` with ``omega=(a, b)``.
    system, forces, harmonics, indices, static, n_samples, condense, x0, tol, at, without
        As for `quasi_periodic`, also of a `Model` with ports; a ``system`` that is a function of ``value`` returns matrices.
        ``harmonics="auto"``: the branch is computed with as many as keep all of
        ``.error`` below ``tol``.
    predictor, corrector, step, min_step, max_step, tolerance, max_points
        As for `frequency_response`.

    Returns
    -------
    QuasiPeriodicResponse
        ``omega`` (n, p) rad/s, ``X`` (n, dof, 2 n_k + 1), ``error`` (n,), ``folds``, ``status``.

    Raises
    ------
    ModelError, ConvergenceError
        As `quasi_periodic`.

    Notes
    -----
    Equations: docs/theory.md (12.1), (12.2), (13.1) to (13.4).

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Cubic(1.5, w=[1.0])])
    >>> pair = [dict(force=[-0.25j], omega=2.0), dict(force=[-0.25j], omega=2.0 * 2**0.5)]
    >>> mb.quasi_periodic_response(duffing, pair, scale=(1.0, 0.75), harmonics=5).status
    'converged'
    """
    started = perf_counter()
    fourier = torus_terms(harmonics, indices, n_samples, condense, tol)
    # the exponents of a motion on a torus are not computed
    steps = Continuation(predictor, corrector, step, min_step, max_step, tolerance, stability=False)
    automatic, limit = fourier.automatic, fourier.limit()
    most = points(max_points)
    if callable(system):
        if at is not None or tuple(without):
            raise ModelError("at= and without= are for models; a function of the value returns matrices")
    else:
        system, forces = sources_of(system, forces, at, without)
    way = _way(system, forces, scale, level, value)
    top: Any = 3 if automatic else harmonics
    while True:
        problem = Torus(
            way.system, way.forces, fourier.but(harmonics=top, tol=limit), indices, static, turn=way.family is None
        )
        if problem.free is not None:
            raise ModelError(
                "a frequency of the motion's own, a mapping without force=, is solved for by mb.quasi_periodic: follow it point by "
                "point, each from the one before (x0=)"
            )
        parts = _followed(problem, way, x0, steps, most)
        curve = _collect(problem, way, parts, limit, perf_counter() - started)
        enough = not automatic or np.all(curve.error <= limit) or problem.estimated_unknowns > MOST_AUTOMATIC
        if parts[-1]["status"] == "interrupted":
            raise Interrupted(f"a branch was interrupted after {len(curve.scale)} points", curve)
        if enough:
            return curve
        top, x0 = top + 2, curve.point(0)


@dataclass(frozen=True)
class _Way:
    """Direction of a branch: the core's name of its parameter, its range, the system and forces at the beginning."""

    name: str
    ends: tuple[float, float]
    system: Any
    forces: Any
    scale: float = 1.0
    level: float = 1.0
    family: Callable[[float], Any] | None = None


def _way(system: Any, forces: Any, scale: Any, level: Any, value: Any) -> _Way:
    ranges = [name for name, x in (("scale", scale), ("level", level), ("value", value)) if np.shape(x) == (2,)]
    swept = [i for i, f in enumerate(forces if isinstance(forces, Sequence) else []) if _is_range(f)]
    if len(ranges) + len(swept) != 1:
        raise ModelError(
            "give one range: scale=(a, b), level=(a, b), value=(a, b), or omega=(a, b) in one of the forces"
        )
    if callable(system) != (ranges == ["value"]):
        raise ModelError("value=(a, b) and a system that is a function of the value belong together")
    if swept:
        i = swept[0]
        key = "omega" if "omega" in forces[i] else "frequency"
        factor = 1.0 if key == "omega" else 2 * np.pi
        a, b = _ends(f"{key} of forces[{i}]", forces[i][key], positive=True)
        begin = [dict(f, **{key: a}) if j == i else f for j, f in enumerate(forces)]
        fixed = _checked_scale(scale)
        ends = (fixed * factor * a, fixed * factor * b)
        return _Way(f"omega{i}", ends, system, begin, fixed, balance.checked_level(level))
    if ranges == ["value"]:
        ends = _ends("value", value)
        begin_system = system(ends[0])
        if isinstance(begin_system, Book):
            raise ModelError(
                "value=(a, b) follows a function that returns a MechanicalSystem, and this one returns a model; follow scale=, level= or "
                "the omega of a force of the model, or mb.parameter_response with one force"
            )
        return _Way("family", ends, begin_system, forces, _checked_scale(scale), balance.checked_level(level), system)
    if ranges == ["scale"]:
        return _Way("scale", _ends("scale", scale, positive=True), system, forces, 1.0, balance.checked_level(level))
    return _Way("level", _ends("level", level), system, forces, _checked_scale(scale), 1.0)


def _is_range(source: Any) -> bool:
    return isinstance(source, Mapping) and any(
        np.shape(source[k]) == (2,) for k in ("omega", "frequency") if k in source
    )


def _ends(name: str, value: Any, positive: bool = False) -> tuple[float, float]:
    ends = checks.two_ends(name, value)
    if positive and min(ends) <= 0.0:
        raise ModelError(f"{name} must be a range of two positive numbers, it is {checks.shown(value)}")
    return ends


def _checked_scale(scale: Any) -> float:
    fixed = balance.checked_level(scale)
    if fixed <= 0:
        raise ModelError(f"scale must be positive, it is {shown(scale)}")
    return fixed


def _followed(problem: Torus, way: _Way, x0: Any, steps: Continuation, most: int) -> list[dict[str, Any]]:
    a, b = way.ends
    if way.family is not None:
        family = way.family
        problem.core.with_family(lambda p: problem.member(family(p)), a, balance.FAMILY_STEP * abs(b - a))
    branch = balance.call_core(
        _core.HbmBranch,
        problem.core,
        problem.start(x0),
        ((problem.omega * way.scale).tolist(), way.level),
        balance.path(way.name, a, (a, b)),
        steps.core,
    )
    parts: list[dict[str, Any]] = []
    n = 0
    while n < most and (not parts or parts[-1]["status"] == "going"):
        try:
            parts.append(balance.call_core(branch.run, most - n, 0.2))
        except KeyboardInterrupt:
            if n == 0:
                raise
            parts[-1]["status"] = "interrupted"
        else:
            n += len(parts[-1]["p"])
    return parts


def _where(problem: Torus, way: _Way, p: float) -> tuple[np.ndarray, float, float]:
    """Frequencies, level and scale at the parameter p."""
    omega, level, scale = problem.omega * way.scale, way.level, way.scale
    if way.name == "scale":
        omega, scale = problem.omega * p, p
    elif way.name == "level":
        level = p
    elif way.name.startswith("omega"):
        omega = omega.copy()
        omega[int(way.name[5:])] = p
    return omega, level, scale


def _collect(
    problem: Torus, way: _Way, parts: list[dict[str, Any]], limit: float, wall_time: float
) -> QuasiPeriodicResponse:
    p = np.concatenate([part["p"] for part in parts])
    y = np.concatenate([part["y"] for part in parts if len(part["p"])])
    error = np.concatenate([part["error"] for part in parts])
    places = [_where(problem, way, float(x)) for x in p]
    omega = np.array([place[0] for place in places])
    level, scale = (np.array([place[i] for place in places]) for i in (1, 2))

    def expanded(row: np.ndarray, x: float) -> np.ndarray:
        w, at_level, _ = _where(problem, way, x)
        if way.family is None or problem.linear.route == "full":
            return problem.expand(row, w, at_level)
        there = problem.of_system(way.family(x))
        return there.expand(row, w, at_level)

    X = np.array([expanded(row, float(x)) for row, x in zip(y, p, strict=True)])
    last = parts[-1]["status"]
    status = "max-points" if last == "going" else STATUS[last]
    if status == "converged" and not np.all(error <= limit):
        status = "unresolved"
    counts = {"points": len(p), "corrections": parts[-1]["corrections"], "factorisations": parts[-1]["factorisations"]}
    stats = Stats(wall_time, counts, effects_of(problem.system), problem.linear.route)
    common: dict[str, Any] = dict(system=problem.system, forces=problem.forces, static=problem.static, stats=stats)
    value = p if way.family is not None else None
    curve = QuasiPeriodicResponse(
        scale,
        level,
        omega,
        X,
        problem.indices,
        (),
        error=error,
        status=status,
        value=value,
        family=way.family,
        parameter="value" if way.family is not None else way.name,
        resolved=limit,
        **common,
    )
    folds = []
    for event in (e for part in parts for e in part["events"] if e["kind"] == "fold"):
        w, at_level, _ = _where(problem, way, float(event["p"]))
        near = float(error[min(event["before"], len(error) - 1)])
        folds.append(_solution(curve, expanded(event["y"], float(event["p"])), w, at_level, near))
    where = tuple(float(e["p"]) for part in parts for e in part["events"] if e["kind"] == "fold")
    return curve.replaced(folds=tuple(folds), fold_places=where)


def _solution(
    curve: QuasiPeriodicResponse, X: np.ndarray, omega: np.ndarray, level: float, error: float
) -> QuasiPeriodicSolution:
    forces = [
        dict(force=np.asarray(source["force"]) * level, omega=float(w))
        for source, w in zip(curve.forces, omega, strict=True)
    ]
    return QuasiPeriodicSolution(
        X,
        curve.indices,
        omega,
        (),
        curve.system,
        forces,
        curve.static,
        stats=curve.stats,
        error=error,
        status="converged" if error <= curve.resolved else "unresolved",
    )
