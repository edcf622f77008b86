"""Self-excited periodic motion, M x" + C x' + K x + sum_e w_e law_e = static forces, with an unknown frequency."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib import checks
from ..errors import ConvergenceError, ModelError, SingularError
from ..model.book import Book
from ..results import Stats, quantity, result
from . import balance, condensation, cycle_start
from .options import MOST_HARMONICS, UNRESOLVED, Fourier, Newton, checked_harmonics
from .periodic import PeriodicSolution, effects_of
from .system import nonlinear_system

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..linear.aliases import Coefficients
    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from ..system.state import StateLike

# Largest coefficient over that of the start from which on a motion is a cycle. Larger: small cycles beside a guess that is far too large
# are thrown away. Smaller: rest, which solves the equations at every frequency, is taken for one.
AT_REST = 1e-4


@result
class LimitCycle(PeriodicSolution):
    """A limit cycle. ``omega`` is found with it, ``period`` = 2 pi / omega.

    ``exponents`` (2 dof,) are Floquet exponents in 1/s, one of them zero, or None where they cannot be told or the harmonics that
    were left out decide which of them grow; ``stable`` is None then. ``error`` estimates coefficients and frequency together.
    """

    exponents: np.ndarray | None = quantity(dims=("exponent",), unit="1/s", default=None, kw_only=True)

    @property
    def stable(self) -> bool | None:
        """True where every exponent but the trivial one decays."""
        if self.exponents is None:
            return None
        others = np.delete(self.exponents, np.argmin(np.abs(self.exponents)))
        return bool(np.all(others.real <= balance.NEUTRAL * self.omega))

    @property
    def multipliers(self) -> np.ndarray | None:
        """(2 dof,) Floquet multipliers exp(s T), one of them 1, or None."""
        return None if self.exponents is None else np.exp(self.exponents * self.period)

    def plot_multipliers(self) -> Figure:
        """Floquet multipliers in the complex plane with the unit circle; returns the figure."""
        from ..plot.nonlinear import multipliers

        return multipliers(self)

    def heading(self) -> str:
        word = {True: "stable", False: "unstable", None: "stability unknown"}[self.stable]
        return f"{super().heading()}\nperiod {self.period:.10g} s, {word}"


def limit_cycle(
    system: Model | MechanicalSystem,
    *,
    harmonics: int | str | Sequence[int] = 15,
    force: Mapping[int, ArrayLike] | None = None,
    omega: float | None = None,
    x0: Coefficients | None = None,
    n_samples: int | None = None,
    condense: bool | str = "auto",
    tol: float | None = None,
    method: str = "auto",
    tolerance: float = 1e-10,
    max_iterations: int = 60,
    at: StateLike = None,
    without: Sequence[str] = (),
) -> LimitCycle:
    """Periodic motion without periodic excitation, its frequency unknown.

    Parameters
    ----------
    system
        `MechanicalSystem` (or `Model`, its geometry linearised at the state ``at``, ``without`` some effects) whose
        equilibrium is unstable, or that has a cycle anyway (then give ``x0``).
    harmonics
        Highest harmonic H, a sequence, or "auto": as many as ``.error <= tol`` needs.
    force
        Static forces ``{0: (n,)}`` or None.
    omega, x0
        First guess of frequency (rad/s) and coefficients (dof, 2h+1). Without them: the unstable mode of the
        equilibrium with the
        amplitude at which one harmonic balances energy, refined harmonic by harmonic; if that fails, integration in
        time from a
        small disturbance until the motion repeats.
    tol
        Largest ``.error`` that is called resolved; 0.01, and 1e-6 for ``harmonics="auto"``.
    method
        "harmonic-balance"; "collocation" on an adapted mesh in time (SciPy's ``solve_bvp``), which relaxation oscillations
        need; or "auto": the first, and with ``harmonics="auto"`` the second where 255 harmonics are too few. ``X`` of
        collocation holds at least H harmonics, and as many as ``tol`` needs; its ``error`` is the change of the last
        refinement of the mesh and what those harmonics leave out.

    Returns
    -------
    LimitCycle
        ``period``, ``X``, ``error``, ``status``: "unresolved" where H harmonics do not represent the motion.

    Raises
    ------
    ConvergenceError
        No cycle was found; ``.result`` is the last iterate or None.

    Notes
    -----
    Equations: docs/theory.md (15.1).
    The phase is fixed by <dx_0/dt, x> = 0 with the first guess x_0.

    Examples
    --------
    >>> import mbrs as mb
    >>> oscillator = mb.MechanicalSystem([[1.0]], [[-1.0]], [[1.0]], elements=[mb.VanDerPol(1.0, w=[1.0])])
    >>> round(mb.limit_cycle(oscillator, harmonics=31).period, 6)
    6.663287
    """
    started = perf_counter()
    if isinstance(system, Book):
        system = nonlinear_system(system, at=at, without=without)
    elif at is not None or checks.one_or_names("without", without):
        raise ModelError("at= and without= are for models; a MechanicalSystem is what its matrices are")
    balance.checked_system(system)
    checks.choice("method", method, ("auto", "harmonic-balance", "collocation"))
    fourier, newton = Fourier(harmonics, n_samples, 1, condense, tol), Newton(tolerance, max_iterations)
    limit = fourier.limit(UNRESOLVED / 10)
    static = _static_force(system, force)
    _refuse_conservative(system)
    guessed = x0 is not None
    starts = _starts(system, static, x0, omega)
    if method == "collocation":
        return _collocated(system, static, starts, None if fourier.automatic else harmonics, limit, started)
    last = _balanced(system, static, starts, not guessed, fourier, limit, newton, started)
    if last is not None and last.status == "converged":
        return last
    if fourier.automatic and method == "auto" and not any(law.has_memory for law in system.elements):
        try:
            return _better(last, _collocated(system, static, starts if guessed else [], None, limit, started))
        except ConvergenceError:
            if last is not None:
                return last
    if last is None:
        raise ConvergenceError("no limit cycle was found; give a guess with omega= and x0=", None)
    return last


def _refuse_conservative(system: Any) -> None:
    if condensation.conservative(system):
        raise ConvergenceError(
            "no limit cycle was found: nothing in this system takes or gives energy, so that its periodic motions come in "
            "families; give it damping, a follower (unsymmetric) stiffness or a law of the velocity",
            None,
        )


def _starts(system: Any, force: Any, x0: Any, omega: Any) -> list[Any]:
    """Coefficients and frequencies to begin at: the user's, or those near the unstable modes of the equilibrium."""
    if x0 is not None or omega is not None:
        omega = float(balance.one_frequency(checks.positive("omega (needed beside x0)", omega), None))
    if x0 is not None:
        return [(balance.checked_guess(system.n, x0), omega)]
    return list(cycle_start.candidates(system, force, omega))


def _balanced(
    system: Any,
    force: Any,
    starts: list[Any],
    integrate: bool,
    fourier: Fourier,
    limit: float,
    newton: Newton,
    started: float,
) -> LimitCycle | None:
    """The first resolved cycle by harmonic balance, else the last one that was found, or None.

    ``integrate``: where no start leads to a resolved cycle, a motion in time is one more start, near enough for large sets of harmonics.
    """
    sets = _enrichment(fourier)
    last: LimitCycle | None = None
    for start in starts:
        last = _refine(system, force, start, sets, limit, newton, started) or last
        if last is not None and last.status == "converged":
            return last
    found = cycle_start.by_integration(system, force) if integrate else None
    if found is not None:
        largest = sets[-4:] if fourier.automatic else sets[-1:]
        last = _refine(system, force, (found.X, found.omega), largest, limit, newton, started) or last
    return last


def _better(last: LimitCycle | None, other: LimitCycle) -> LimitCycle:
    return other if last is None or other.error < last.error else last


def _enrichment(fourier: Fourier) -> list[Fourier]:
    """Sets of harmonics of growing size, so that each start is near."""
    sizes = (1, 3, 5, 9, 15, 23, 35, 53, 79, 119, 179)
    if fourier.automatic:
        return [fourier.but(harmonics=top) for top in (*sizes, MOST_HARMONICS)]
    return [fourier.but(harmonics=top) for top in (*(h for h in sizes if h < fourier.terms[-1]), fourier.harmonics)]


def _static_force(system: Any, force: Any) -> dict[int, np.ndarray]:
    if force is None:
        return {0: np.zeros(system.n)}
    if not isinstance(force, dict) or set(force) - {0}:
        raise ModelError(
            "a limit cycle has static forces alone, force={0: vector}; harmonic_balance takes periodic ones"
        )
    return {0: balance.force_vector(system.n, force.get(0, np.zeros(system.n)), 0).real}


def _refine(
    system: Any,
    force: Any,
    start: tuple[Any, float],
    sets: list[Fourier],
    limit: float,
    newton: Newton,
    started: float,
) -> LimitCycle | None:
    """From one start through all sets of harmonics; the last cycle that was found, or None."""
    X, w = start
    size = np.max(np.abs(np.asarray(getattr(X, "X", X))[:, 1:]))
    found = None
    for fourier in sets:
        setup = balance.prepare(system, force, fourier, w)
        z = np.append(setup.start(X), w)
        answer = balance.call_core(setup.core.cycle, z, ([w], 0), **newton.core)
        w_new = float(answer["z"][-1])
        if not answer["converged"] or w_new <= 0:
            continue
        X_new = setup.expand(answer["z"][:-1], w_new)
        if np.max(np.abs(X_new[:, 1:])) < AT_REST * size:
            continue  # the equilibrium, which solves the equations for every frequency
        X, w = X_new, w_new
        if fourier is sets[-1] or answer["error"] <= limit:
            found = _result(system, force, setup, answer, limit, started)
        if answer["error"] <= limit and sets[-1].harmonics == MOST_HARMONICS:
            return found
    return found


def _result(system: Any, force: Any, setup: Any, answer: Any, limit: float, started: float) -> LimitCycle:
    y, w = answer["z"][:-1], float(answer["z"][-1])
    try:
        exponents, settled = setup.exponents(y, w, answer["error"], free=True)
    except SingularError:
        exponents, settled = None, True  # the cycle is a result also where its stability is not
    counts = {key: answer[key] for key in ("iterations", "evaluations")}
    return LimitCycle(
        setup.expand(y, w),
        w,
        setup.harmonics,
        1,
        setup.n_samples,
        system,
        force,
        exponents=exponents if settled else None,
        stats=Stats(perf_counter() - started, counts, effects_of(system), setup.route),
        error=answer["error"],
        status="converged" if answer["error"] <= limit else "unresolved",
    )


def _collocated(system: Any, force: Any, starts: list[Any], harmonics: Any, limit: float, started: float) -> LimitCycle:
    top = 1 if harmonics is None else checked_harmonics(harmonics, 1)[-1]
    given = len(starts) == 1 and starts[0][0] is not None
    start = cycle_start.from_coefficients(*starts[0]) if given else cycle_start.by_integration(system, force)
    if start is None:
        raise ConvergenceError("no limit cycle was found by integration; give a guess with omega= and x0=", None)
    X, period, error, nodes = cycle_start.collocate(system, force, start, top, limit)
    top = (X.shape[1] - 1) // 2
    return LimitCycle(
        X,
        2 * np.pi / period,
        tuple(range(1, top + 1)),
        1,
        nodes,
        system,
        force,
        stats=Stats(perf_counter() - started, {"mesh": nodes}, effects_of(system), "collocation"),
        error=error,
        status="converged" if error <= limit else "unresolved",
    )
