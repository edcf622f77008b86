"""Response to several incommensurable frequencies: `quasi_periodic`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

from .._lib import checks
from .._lib.checks import shown
from ..errors import ConvergenceError, ModelError
from ..model.book import Book
from . import balance, own_frequency
from .branch_points import Event
from .options import Fourier, Newton
from .quasi_periodic_solution import QuasiPeriodicSolution
from .system import as_system, force_of_ports, nonlinear_system
from .torus import Torus

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from ..system.state import StateLike

MOST_AUTOMATIC = 3000  # unknowns, of the estimate too, up to which "auto" adds terms


def quasi_periodic(
    system: Model | MechanicalSystem,
    forces: Sequence[Mapping[str, Any]],
    *,
    harmonics: int | str = 7,
    indices: ArrayLike | None = None,
    static: ArrayLike | None = None,
    n_samples: int | Sequence[int] | None = None,
    condense: bool | str = "auto",
    x0: QuasiPeriodicSolution | Event | None = None,
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
        ``inputs`` (ports) and ``amplitude``; and ``omega`` (rad/s) or ``frequency`` (Hz). A mapping with ``omega`` alone is a
        frequency of the motion's own, such as it begins to have at a Neimark-Sacker point: a first guess, which is solved for
        together with the motion. One of them at most, and then ``x0`` is needed.
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
        An earlier solution to start from, of whatever terms; by default the solution with about m/2. Or a Neimark-Sacker event
        of a frequency response, at which a torus with an own frequency begins: near ``event.second_frequency`` for an excitation
        near ``event.omega``, on the side where periodic motion is unstable, or where the torus comes back (below it, unstable).
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
        Newton's method gave up, or fell back to the periodic motion, which has no frequency of its own.

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
    if x0 is None and problem.free is None and indices is None and isinstance(top, int) and top > 2:
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
        if not isinstance(source, Mapping) or not {"inputs", "force", "omega", "frequency"} & set(source):
            raise ModelError(f"forces[{i}] must be dict(inputs=port, amplitude=..., omega=...), it is {shown(source)}")
        if not {"inputs", "force", "amplitude"} & set(source):
            plain.append(dict(source))  # a frequency of the motion's own
            continue
        if not {"inputs", "force"} & set(source):
            raise ModelError(f"forces[{i}] has an amplitude and no inputs=, it is {shown(source)}")
        rest = {key: value for key, value in source.items() if key not in ("inputs", "force", "amplitude")}
        ports = source["inputs"] if "inputs" in source else source["force"]
        plain.append(dict(force=force_of_ports(made, ports, source.get("amplitude")), **rest))
    return made, plain


def _solved(problem: Torus, newton: Newton, x0: Any, started: float) -> QuasiPeriodicSolution:
    """A solution of one set of terms, with more samples while they are what lacks."""
    if problem.free is not None:
        return own_frequency.solved(problem, newton, x0, started)
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
