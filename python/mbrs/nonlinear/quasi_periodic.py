"""Response to several incommensurable frequencies: Fourier series on a torus of phases tau_i = omega_i t."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import field
from math import comb
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from .. import _core
from .._lib import checks
from .._lib.text import without_rounding
from ..errors import ConvergenceError, MbrsWarning, ModelError
from ..model.book import Book
from ..model.laws import Law
from ..results import Result, Stats, derived, quantity, result
from . import balance, condensation
from .displacement import displacement_coefficients, label
from .fourier import FourierMotion
from .options import Fourier, Newton, integer
from .periodic import effects_of
from .system import as_system, force_of_ports, nonlinear_system

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from ..system.state import StateLike
    from .displacement import Displacement
    from .verify_full import Distance

COMMENSURABLE = 1e-9
SLOW = 1e-3
NONSMOOTH_SAMPLES = 96
MOST_UNKNOWNS = 6000
MOST_COMBINATIONS = 200_000
MOST_AUTOMATIC = 3000  # unknowns, of the estimate too, up to which "auto" adds terms
MOST_SAMPLES = 1 << 18


@result
class QuasiPeriodicSolution(FourierMotion, Result):
    """x(t) = a_0 + sum_j a_j cos(phi_j) + b_j sin(phi_j) with phi_j = (k_j . omega) t.

    Attributes
    ----------
    indices
        (n_k, p) index vectors k_j, the first entry that is not zero being positive; the constant term is not among
        them.
    X
        (dof, 2 n_k + 1) coefficients [a_0, a_1, b_1, a_2, b_2, ...].
    omega
        (p,) base frequencies, rad/s.
    error
        Estimate of the truncation error relative to the largest coefficient: one Newton step with more terms and
        samples.
    status
        "converged", or "unresolved" where ``error`` exceeds the tolerance.
    """

    X: np.ndarray
    indices: np.ndarray = quantity(dims=("term", "base"), name="index")
    omega: np.ndarray = quantity(dims=("base",), unit="rad/s")
    n_samples: tuple[int, ...] = ()
    system: Any = field(default=None, repr=False)
    forces: Any = field(default=None, repr=False)
    static: Any = field(default=None, repr=False)

    row: ClassVar[str] = "term"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates"}

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(str(c) for c in getattr(self.system, "coordinates", range(len(self.X))))

    @property
    @derived(dims=("coordinate",))
    def mean(self) -> np.ndarray:
        """(dof,) the constant term."""
        return self.X[:, 0]

    @property
    @derived(dims=("coordinate", "term", "part"), name="X")
    def _coefficients(self) -> np.ndarray:
        return np.stack([self.X[:, 1::2], self.X[:, 2::2]], axis=2)

    @property
    @derived(dims=("base",), unit="Hz")
    def frequency(self) -> np.ndarray:
        """Base frequencies, Hz."""
        return self.omega / (2 * np.pi)

    def coefficient(self, dof: Displacement = 0, index: Sequence[int] = (1, 0)) -> complex:
        """a - i b of one term; zero for a term that is not kept. The term -k is the conjugate of k.

        ``dof``: number or name of a coordinate, or, of a model, a motion such as ``body.motion("z")``.
        """
        x = displacement_coefficients(self.X, self.system, dof)
        k = np.asarray(index)
        if k.shape != (len(self.omega),) or not np.issubdtype(k.dtype, np.integer):
            raise ModelError(f"index must be {len(self.omega)} integers, one for each base frequency; it is {index!r}")
        if not k.any():
            return complex(x[0])
        for sign in (1, -1):
            found = np.flatnonzero(np.all(self.indices == sign * k, axis=1))
            if len(found):
                a, b = x[2 * found[0] + 1 : 2 * found[0] + 3]
                return complex(a, -sign * b)
        return 0j

    def amplitude(self, dof: Displacement = 0, index: Sequence[int] = (1, 0)) -> float:
        """Magnitude of one term of one displacement."""
        return abs(self.coefficient(dof, index))

    def term_frequencies(self) -> np.ndarray:
        """(n_k,) circular frequency of every term, rad/s."""
        return self.indices @ self.omega

    def lines(self, dof: Displacement = 0) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Frequencies in Hz, amplitudes and index vectors of the terms, by frequency, the mean first."""
        x = displacement_coefficients(self.X, self.system, dof)
        f = np.append(0.0, np.abs(self.indices @ self.frequency))
        size = np.append(abs(x[0]), np.hypot(x[1::2], x[2::2]))
        names = ["", *("(" + ", ".join(str(int(i)) for i in k) + ")" for k in self.indices)]
        order = np.argsort(f, kind="stable")
        return f[order], size[order], [names[i] for i in order]

    def label(self, dof: Displacement = 0) -> str:
        """Name of a displacement."""
        return label(self.system, dof, len(self.X))

    def verify(self, cycles: float = 20.0, rtol: float = 1e-9, *, full: bool | None = None) -> Distance:
        """Integrates from the solution's own state over so many of the longest base periods and returns the largest
        distance relative to the largest displacement; of an unstable motion it tells only that. ``full``, and what the
        number holds: as of `PeriodicSolution.verify`."""
        from .verify import verify_torus

        return verify_torus(self, cycles, rtol, full)

    def plot(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """Spectrum: amplitude over frequency in Hz, the largest terms named by index; returns the figure."""
        from ..plot.nonlinear import spectrum

        return spectrum(self, dof, ax=ax)

    def plot_orbit(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """Thirty cycles of the slowest force in time, and velocity over displacement; returns the figure."""
        from ..plot.nonlinear import orbit

        return orbit(self, dof, ax=ax)

    def rows(self, most: int = 12) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest terms."""
        size = np.max(np.hypot(self.X[:, 1::2], self.X[:, 2::2]), axis=0)
        moving = np.argsort(-np.linalg.norm(self.X, axis=1), kind="stable")[:3]
        scale = np.abs(self.X[moving]).max(axis=1)
        heads = ["k", "f [Hz]", *(f"|{self.label(int(i))}|" for i in moving)]
        rows: list[list[Any]] = [["0", 0.0, *without_rounding(np.abs(self.X[moving, 0]), scale)]]
        for j in np.argsort(-size, kind="stable")[:most]:
            k = "(" + ", ".join(str(int(i)) for i in self.indices[j]) + ")"
            amplitude = without_rounding([float(np.hypot(*self.X[i, 2 * j + 1 : 2 * j + 3])) for i in moving], scale)
            rows.append([f"k = {k}", float(abs(self.indices[j] @ self.frequency)), *amplitude])
        return heads, rows

    def heading(self) -> str:
        return (
            f"QuasiPeriodicSolution: {self.status}, omega = {', '.join(f'{w:.8g}' for w in self.omega)} rad/s, "
            f"{len(self.indices)} terms, estimated error {self.error:.1e}"
        )

    def notes(self) -> list[str]:
        cut = f"(the largest 12 of {len(self.indices)} terms)" if len(self.indices) > 12 else ""
        poor = "unresolved: the estimated error exceeds the tolerance; take more harmonics"
        return list(filter(None, [cut, poor if self.status == "unresolved" else ""]))


def n_terms(p: int, m: int) -> int:
    """Number of index vectors of `diamond`, (sum_i 2^i C(p, i) C(m, i) - 1) / 2: docs/theory.md (12.2)."""
    return (sum(2**i * comb(p, i) * comb(m, i) for i in range(min(p, m) + 1)) - 1) // 2


def _diamond_of(p: int, harmonics: Any) -> np.ndarray:
    m = integer("harmonics", harmonics)
    if m > MOST_UNKNOWNS or 2 * n_terms(p, m) + 1 > MOST_UNKNOWNS:
        raise ModelError(f"harmonics = {checks.shown(harmonics)} with {p} frequencies are too many terms; take fewer")
    return diamond(p, m)


def diamond(p: int, m: int) -> np.ndarray:
    """Index vectors (n_k, p) with sum |k_i| <= m, one of each pair +-k (first non-zero entry positive), by order,
    without 0."""
    box = np.zeros((1, 0), dtype=int)
    for _ in range(p):
        left = m - np.abs(box).sum(axis=1)
        box = np.vstack([np.append(k, i) for k, n in zip(box, left, strict=True) for i in range(-n, n + 1)])
    box = box[np.any(box != 0, axis=1)]
    first = box[np.arange(len(box)), np.argmax(box != 0, axis=1)]
    box = box[first > 0]
    return box[np.lexsort([*(-box.T[::-1]), np.abs(box).sum(axis=1)])]


def quasi_periodic(
    system: Model | MechanicalSystem,
    forces: Sequence[Mapping[str, Any]],
    *,
    harmonics: int | str = 7,
    indices: ArrayLike | None = None,
    static: ArrayLike | None = None,
    n_samples: int | Sequence[int] | None = None,
    condense: bool | str = "auto",
    x0: QuasiPeriodicSolution | None = None,
    tol: float | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 60,
    at: StateLike = None,
    without: Sequence[str] = (),
) -> QuasiPeriodicSolution:
    """Response of M x" + C x' + K x + sum_e w_e law_e(w_e . x, w_e . x') to forces of p >= 2 incommensurable
    frequencies.

    Parameters
    ----------
    system
        `MechanicalSystem` with nonlinear ``elements`` (laws without memory), or a `Model`, whose geometry is linearised.
    forces
        One mapping per frequency: ``force`` (n,), real for a cosine, complex a - i b for a cos + b sin, or of a model
        ``inputs`` (ports) and ``amplitude``; and ``omega`` (rad/s) or ``frequency`` (Hz).
    harmonics
        m: terms with |k_1| + ... + |k_p| <= m are kept. "auto": as many as ``.error <= tol`` needs.
    indices
        (n_k, p) index vectors in place of that set; those of the forces must be among them.
    static
        Static force (n,) or None.
    n_samples
        Samples per dimension; chosen without aliasing for polynomial laws, 96 for others, doubled while aliasing is the
        larger part of ``error``.
    x0
        An earlier solution to start from, of whatever terms; by default the solution with about m/2.
    tol
        Largest ``.error`` that is called resolved; 0.1, and 1e-6 for ``harmonics="auto"``.
    at, without
        State of a model and effects to leave out, as for `mb.linearize`.

    Returns
    -------
    QuasiPeriodicSolution
        ``indices`` (n_k, p), ``X`` (dof, 2 n_k + 1).

    Raises
    ------
    ModelError
        Wrong input; frequencies with a small common divisor, whose response is periodic: use `harmonic_balance`.
    ConvergenceError
        Newton's method gave up.

    Warns
    -----
    MbrsWarning
        A kept combination k . omega is almost zero: the motion beats slowly, and many terms may be needed.

    Notes
    -----
    Equations: docs/theory.md (12.1), (12.2).
    Index set after Kim and Choi (1997), with the p-dimensional FFT; cost per iteration O(N log N) for N samples and
    O((n (2 n_k + 1))^3) for the linear equations.

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Cubic(1.5, w=[1.0])])
    >>> pair = [dict(force=[-0.25j], omega=2.0), dict(force=[-0.25j], omega=2.0 * 2**0.5)]
    >>> f"{mb.quasi_periodic(duffing, pair, harmonics=7).coefficient(0, (0, 1)):.7f}"
    '-0.0014476+0.0357440j'
    """
    started = perf_counter()
    system, forces = sources_of(system, forces, at, without)
    fourier = torus_terms(harmonics, indices, n_samples, condense, tol)
    newton = Newton(tolerance, max_iterations)
    if fourier.automatic:
        return _automatic(system, forces, static, fourier, newton, x0, started)
    problem, top = Torus(system, forces, fourier, indices, static), fourier.harmonics
    if x0 is None and indices is None and isinstance(top, int) and top > 2:
        # a small set finds the branch, the large one only refines it
        smaller = Torus(system, forces, fourier.but(harmonics=max(1, top // 2), n_samples=None), None, static)
        answer = balance.call_core(smaller.core.solve, smaller.start(None), list(smaller.omega), **newton.core)
        x0 = smaller.solution(answer, started) if answer["converged"] else None
    return _solved(problem, newton, x0, started)


def torus_terms(harmonics: Any, indices: Any, n_samples: Any, condense: Any, tol: Any) -> Fourier:
    """Options of a series on a torus: the order of its combinations, or "auto" without indices."""
    if isinstance(harmonics, str) and (harmonics != "auto" or indices is not None):
        raise ModelError(f'harmonics must be a number or, without indices, "auto"; it is {checks.shown(harmonics)}')
    fourier = Fourier(harmonics, n_samples, 1, condense, tol)
    return fourier if fourier.automatic else fourier.but(tol=fourier.limit())


def sources_of(system: Any, forces: Any, at: Any, without: Sequence[str]) -> tuple[Any, Any]:
    """System and forces as vectors, from a model with ports or a system with vectors."""
    if not isinstance(system, Book):
        return as_system(system, (), None, at, without)[0], forces
    made, plain = nonlinear_system(cast("Model", system), at=at, without=without), []
    for i, source in enumerate(forces if isinstance(forces, Sequence) else []):
        if not isinstance(source, Mapping) or not {"inputs", "force"} & set(source):
            raise ModelError(f"forces[{i}] must be dict(inputs=port, amplitude=..., omega=...), it is {source!r}")
        rest = {key: value for key, value in source.items() if key not in ("inputs", "force", "amplitude")}
        ports = source["inputs"] if "inputs" in source else source["force"]
        plain.append(dict(force=force_of_ports(made, ports, source.get("amplitude")), **rest))
    return made, plain


def _solved(problem: Torus, newton: Newton, x0: Any, started: float) -> QuasiPeriodicSolution:
    """A solution of one set of terms, with more samples while they are what lacks."""
    while True:
        answer = balance.call_core(problem.core.solve, problem.start(x0), list(problem.omega), **newton.core)
        result = problem.solution(answer, started)
        finer = problem.finer(answer) if answer["converged"] else None
        if finer is None:
            break
        problem, x0 = finer, result
    if not answer["converged"]:
        raise ConvergenceError(
            f"quasi-periodic balance did not converge: {answer['reason']} after {answer['iterations']} iterations; "
            "start nearer (x0=) or follow a branch with quasi_periodic_response",
            result.replaced(status="stopped"),
        )
    return result


def _automatic(
    system: Any, forces: Any, static: Any, fourier: Fourier, newton: Newton, x0: Any, started: float
) -> QuasiPeriodicSolution:
    """Larger sets until the error estimate is below the tolerance, each started from the last."""
    best, top, limit = None, 2, fourier.limit()
    while True:
        problem = Torus(system, forces, fourier.but(harmonics=top, tol=limit), None, static)
        if best is not None and problem.estimated_unknowns > MOST_AUTOMATIC:
            return best
        try:
            best = _solved(problem, newton, best if best is not None else x0, started)
        except ConvergenceError:
            if problem.estimated_unknowns > MOST_AUTOMATIC // 4:
                raise
        if best is not None and best.error <= limit:
            return best
        top += 2 if top < 9 else 4


class Torus:
    """The core's problem for a set of forces and terms."""

    def __init__(
        self,
        system: Any,
        forces: Sequence[Mapping[str, Any]],
        fourier: Fourier,
        indices: Any,
        static: Any,
        least_samples: list[int] | None = None,
        turn: bool = True,
    ) -> None:
        laws = balance.checked_system(system)
        for i, law in enumerate(laws):
            if law.has_memory:
                raise ModelError(f"elements[{i}], {law!r}, has a memory; quasi-periodic balance needs laws without")
        self.system, self.forces, self.static = system, forces, static
        self.fourier = fourier
        self._given_indices = indices
        self.omega, vectors = _sources(system.n, forces)
        p = len(self.omega)
        self.indices = _diamond_of(p, fourier.harmonics) if indices is None else _checked(indices, p)
        top = int(np.max(np.abs(self.indices).sum(axis=1)))
        if n_terms(p, max(top + 2, 5)) > MOST_COMBINATIONS:
            raise ModelError(
                f"{p} frequencies in combinations up to the order {top} are too many; take fewer of them or a lower order"
            )
        self._refuse_periodic(top)
        kept = {tuple(k) for k in self.indices.tolist()}
        extra = np.array([k for k in diamond(p, top + 2).tolist() if tuple(k) not in kept]).reshape(-1, p)
        self.dims, fine = self._samples(laws, extra, least_samples)
        self.terms, self.turn = self._terms(system.n, vectors), turn
        n_c = 2 * len(self.indices) + 1
        self.linear = condensation.linear_part(system, laws, self.terms, n_c, fourier.condense, turn)
        if self.linear.core.size * n_c > MOST_UNKNOWNS:
            raise ModelError(
                f"{self.linear.core.size * n_c} unknowns are too many; take fewer harmonics or coordinates"
            )
        self.estimated_unknowns = self.linear.core.size * (n_c + 2 * len(extra))
        elements = balance.core_elements(laws, self.linear.directions)
        self.core = balance.call_core(
            _core.HbmProblem,
            self.linear.core,
            elements,
            self.indices.tolist(),
            1,
            self.omega.tolist(),
            self.dims,
            extra.tolist(),
            fine,
        )

    def _samples(self, laws: Any, extra: np.ndarray, least: list[int] | None) -> tuple[list[int], list[int]]:
        """Samples per phase of the terms, and of the finer grid on which the terms beyond them are estimated."""
        dims = _samples(self.fourier.n_samples, laws, self.indices)
        if least is not None:
            dims = [max(n, m) for n, m in zip(dims, least, strict=True)]
        fine = [max(a, b) for a, b in zip(dims, _samples(None, laws, np.vstack([self.indices, extra])), strict=True)]
        if any(not law.kind.polynomial for law in laws):
            fine = [max(n, 3 * own // 2) for n, own in zip(fine, dims, strict=True)]  # to see the aliasing
        if np.prod([float(n) for n in fine]) > MOST_SAMPLES:
            raise ModelError(
                f"{' x '.join(str(n) for n in fine)} samples are too many; give fewer (n_samples=), or take fewer harmonics"
            )
        return dims, fine

    def _terms(self, n: int, vectors: Sequence[np.ndarray]) -> np.ndarray:
        """Complex forces of the terms, the constant first."""
        terms = np.zeros((len(self.indices) + 1, n), complex)
        if self.static is not None:
            terms[0] = balance.force_vector(n, self.static, 0)
        for i, (vector, unit) in enumerate(zip(vectors, np.eye(len(self.omega), dtype=int), strict=True)):
            at = np.flatnonzero(np.all(self.indices == unit, axis=1))
            if len(at) == 0:
                raise ModelError(f"indices lack the term of forces[{i}] itself, {unit.tolist()}")
            terms[1 + at[0]] = vector
        return terms

    def finer(self, answer: Mapping[str, Any]) -> Torus | None:
        """The same with twice the samples per dimension, where they are what limits an answer."""
        n = int(np.prod(self.dims))
        if n << len(self.dims) > MOST_SAMPLES:
            return None
        if balance.more_samples(1, answer["error"], answer["aliasing"], self.system.elements, self.fourier) is None:
            return None
        return self.of_system(self.system, [2 * n for n in self.dims])

    def of_system(self, system: Any, least_samples: list[int] | None = None) -> Torus:
        """The same forces and terms with another system, or with more samples."""
        return Torus(system, self.forces, self.fourier, self._given_indices, self.static, least_samples, self.turn)

    def member(self, system: Any) -> tuple[Any, Any]:
        """Linear part and elements of another system under the same forces, for the core."""
        laws = balance.checked_system(system)
        linear = condensation.linear_part(
            system, laws, self.terms, 2 * len(self.indices) + 1, self.fourier.condense, False
        )
        return linear.core, balance.core_elements(laws, linear.directions)

    def _refuse_periodic(self, top: int) -> None:
        k = diamond(len(self.omega), max(top, 5))
        distance = np.abs(k @ self.omega) / np.max(self.omega)
        worst = int(np.argmin(distance))
        combination = " + ".join(f"{int(n)} * {w:.6g}" for n, w in zip(k[worst], self.omega, strict=True) if n)
        if distance[worst] < COMMENSURABLE:
            raise ModelError(
                f"the frequencies are commensurable: {combination} = 0, so the motion is periodic; "
                "use harmonic_balance at their common divisor with forces in its harmonics"
            )
        if distance[worst] < SLOW and np.abs(k[worst]).sum() <= top:
            warnings.warn(
                f"the frequencies are almost commensurable: {combination} is only {distance[worst]:.1e} of the "
                "largest; the motion beats slowly and may need many terms",
                MbrsWarning,
                stacklevel=4,
            )

    def start(self, x0: Any) -> np.ndarray:
        """Unknowns of the core from an earlier solution."""
        X = np.zeros((self.system.n, 2 * len(self.indices) + 1))
        if x0 is not None:
            if not isinstance(x0, QuasiPeriodicSolution) or x0.X.shape[0] != self.system.n:
                raise ModelError("x0 must be a QuasiPeriodicSolution of a system of the same size")
            place = {tuple(k): j for j, k in enumerate(x0.indices.tolist())}
            X[:, 0] = x0.X[:, 0]
            for j, k in enumerate(self.indices.tolist()):
                if tuple(k) in place:
                    old = place[tuple(k)]
                    X[:, 2 * j + 1 : 2 * j + 3] = x0.X[:, 2 * old + 1 : 2 * old + 3]
        T = self.linear.transform
        return self.core.restrict(X if T is None else T.T @ X)

    def expand(self, y: np.ndarray, omega: np.ndarray, level: float = 1.0) -> np.ndarray:
        """(dof, 2 n_k + 1) of all coordinates."""
        X = balance.call_core(self.core.expand, y, omega.tolist(), level)
        return X if self.linear.transform is None else self.linear.transform @ X

    def solution(self, answer: Mapping[str, Any], started: float) -> QuasiPeriodicSolution:
        """An answer of the core as a result."""
        counts = {key: answer[key] for key in ("iterations", "evaluations", "factorisations")}
        return QuasiPeriodicSolution(
            self.expand(answer["y"], self.omega),
            self.indices,
            self.omega,
            tuple(self.dims),
            self.system,
            self.forces,
            self.static,
            stats=Stats(perf_counter() - started, counts, effects_of(self.system), self.linear.route),
            error=answer["error"],
            status="converged" if answer["converged"] and answer["error"] <= self.fourier.limit() else "unresolved",
        )


def _sources(n: int, forces: Any) -> tuple[np.ndarray, list[np.ndarray]]:
    if isinstance(forces, Mapping | str) or not isinstance(forces, Sequence) or len(forces) < 2:
        raise ModelError(
            "forces must list at least two mappings dict(force=(n,), omega=...); harmonic_balance takes one"
        )
    omega, vectors = [], []
    for i, source in enumerate(forces):
        if not isinstance(source, Mapping) or "force" not in source or set(source) - {"force", "omega", "frequency"}:
            raise ModelError(f"forces[{i}] must be dict(force=(n,), omega=...) or with frequency=, it is {source!r}")
        w = balance.one_frequency(source.get("omega"), source.get("frequency"))
        if w.ndim != 0:
            raise ModelError(f"forces[{i}] needs one frequency, not {w.tolist()}")
        omega.append(float(w))
        vectors.append(balance.force_vector(n, source["force"], 1))
    return np.array(omega), vectors


def _checked(indices: Any, p: int) -> np.ndarray:
    try:
        k = np.asarray(indices)
    except (ValueError, OverflowError):
        k = np.zeros(0)
    if k.ndim != 2 or k.shape[1] != p or k.shape[0] == 0 or not np.issubdtype(k.dtype, np.integer):
        raise ModelError(f"indices must be integers (n_k, {p}), their shape is {k.shape}")
    if not np.all(np.any(k != 0, axis=1)):
        raise ModelError("indices contain the zero vector; the constant term is always kept")
    first = k[np.arange(len(k)), np.argmax(k != 0, axis=1)]
    k = k * np.sign(first)[:, None]
    if len(np.unique(k, axis=0)) != len(k):
        raise ModelError("indices contain a vector twice, k and -k being the same term")
    return k.astype(int)


def _samples(n_samples: Any, laws: Sequence[Law], indices: np.ndarray) -> list[int]:
    """Samples per dimension; a law of degree q makes terms up to q times the largest index, so that (q + 1) k + 1
    do."""
    reach = np.max(np.abs(indices), axis=0)
    if n_samples is None:
        return [balance.fast_size(max([2 * k + 2, *(_least(law, k) for law in laws)])) for k in reach.tolist()]
    given = np.ravel(n_samples).tolist() if isinstance(n_samples, Sequence | np.ndarray) else [n_samples] * len(reach)
    if len(given) != len(reach):
        raise ModelError(f"n_samples must be one number or {len(reach)}, it is {checks.shown(n_samples)}")
    given = [checks.count("n_samples", n, balance.LARGEST_SAMPLE) for n in given]
    polynomial = [law for law in laws if law.kind.polynomial]
    for i, (n, k) in enumerate(zip(given, reach.tolist(), strict=True)):
        least = max([2 * k + 1, *(_least(law, k) for law in polynomial)])
        if n < least:
            raise ModelError(f"n_samples[{i}] = {n} aliases indices up to {k}; use at least {least}, or leave it out")
    return given


def _least(law: Law, k: int) -> int:
    return balance.alias_free(law, k, 1) if law.kind.polynomial else max(NONSMOOTH_SAMPLES, 6 * k)
