"""Periodic response of M x" + C x' + K x + sum_e w_e law_e(w_e . x, w_e . x') = f(t) by harmonic balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.text import without_rounding
from ..errors import ConvergenceError, ModelError
from ..results import Result, Stats, derived, quantity, result
from . import balance, condensation
from .displacement import displacement_coefficients, label
from .fourier import FourierMotion
from .options import MOST_HARMONICS, Fourier, Newton
from .sampled_force import cut, harmonics_of, linear_size, weights_of
from .settled_start import settled

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..linear.aliases import Coefficients, Force, Ports
    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from ..system.state import StateLike
    from .displacement import Displacement
    from .verify_full import Distance

# Largest harmonic, over that of the guess, of a free vibration that has gone to rest: Newton's method leaves 1e-10 and less. Pinned by
# tests/nonlinear/test_hbm_honest.py.
AT_REST = 1e-6


@result
class PeriodicSolution(FourierMotion, Result):
    """One periodic motion x(t) = a0 + sum_h a_h cos(h omega t / nu) + b_h sin(h omega t / nu), nu = ``subharmonic``.

    Attributes
    ----------
    X
        (dof, 2H+1) coefficients [a0, a1, b1, a2, b2, ...], zero for harmonics left out.
    omega
        Excitation frequency, rad/s.
    error
        Estimate of the truncation error relative to the largest coefficient of the coordinates that are solved for: one
        Newton step on more harmonics and samples, and the linear answer to the laws' forces in the harmonics beyond.
    status
        "converged", or "unresolved" where ``error`` exceeds the tolerance (0.1 unless ``tol`` was given).
    """

    X: np.ndarray
    omega: float = quantity(unit="rad/s")
    harmonics: tuple[int, ...]
    subharmonic: int = 1
    n_samples: int = 0
    system: Any = field(default=None, repr=False)
    force: Any = field(default=None, repr=False)

    row: ClassVar[str] = "coordinate"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates", "harmonic": "orders"}

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(str(n) for n in getattr(self.system, "coordinates", [f"x{i}" for i in range(len(self.X))]))

    @property
    def orders(self) -> np.ndarray:
        """Numbers of the harmonics, 0 the mean."""
        return np.arange((self.X.shape[1] - 1) // 2 + 1)

    @property
    @derived(dims=("coordinate", "harmonic", "part"), name="X", label="Fourier coefficients")
    def _coefficients(self) -> np.ndarray:
        out = np.zeros((len(self.X), len(self.orders), 2))
        out[:, :, 0] = np.concatenate([self.X[:, :1], self.X[:, 1::2]], axis=1)
        out[:, 1:, 1] = self.X[:, 2::2]
        return out

    def attributes(self) -> dict[str, Any]:
        return {
            **super().attributes(),
            "omega": self.omega,
            "frequency": self.frequency,
            "subharmonic": self.subharmonic,
        }

    @property
    @derived(unit="Hz", label="excitation frequency")
    def frequency(self) -> float:
        """Excitation frequency, Hz."""
        return self.omega / (2 * np.pi)

    @property
    @derived(unit="s")
    def period(self) -> float:
        """Period of the motion, s."""
        return 2 * np.pi * self.subharmonic / self.omega

    def coefficient(self, dof: Displacement = 0, harmonic: int = 1) -> complex:
        """Complex amplitude a - i b of one harmonic: the motion is its real part times exp(i h omega t / nu).

        ``dof``: number or name of a coordinate, or, of a model, a motion such as ``body.motion("z")``.
        """
        x = displacement_coefficients(self.X, self.system, dof)
        if not 0 <= balance.whole("harmonic", harmonic) <= (len(x) - 1) // 2:
            return 0j
        return complex(x[0]) if harmonic == 0 else complex(x[2 * harmonic - 1], -x[2 * harmonic])

    def amplitude(self, dof: Displacement = 0, harmonic: int = 1) -> float:
        """Magnitude sqrt(a^2 + b^2) of one harmonic of one displacement (``dof`` as for `coefficient`)."""
        return abs(self.coefficient(dof, harmonic))

    def term_frequencies(self) -> np.ndarray:
        """(n_k,) circular frequency of every harmonic, rad/s."""
        return np.arange(1, (self.X.shape[1] - 1) // 2 + 1) * self.omega / self.subharmonic

    def largest(self, dof: Displacement = 0) -> float:
        """Largest |x| of one displacement over a period: the best of many instants, refined by Newton's method."""
        x = displacement_coefficients(self.X, self.system, dof)
        h = np.arange((len(x) - 1) // 2 + 1)
        c = x[0::2].astype(complex)
        c[1:] = x[1::2] - 1j * x[2::2]

        def motion(phase: Any, derivative: int = 0) -> np.ndarray:
            return np.real(np.exp(1j * np.multiply.outer(phase, h)) @ (c * (1j * h) ** derivative))

        n_t = max(256, 16 * len(h))
        spectrum = c * np.where(h == 0, n_t, n_t / 2)
        series = np.abs(np.fft.irfft(np.pad(spectrum, (0, n_t // 2 + 1 - len(h))), n_t))
        best, between = float(np.max(series)), 2 * np.pi / n_t
        at = float(np.argmax(series)) * between
        for _ in range(8):
            bend = float(motion(at, 2))
            step = -float(motion(at, 1)) / bend if bend else 0.0
            at += float(np.clip(step, -between, between))
            best = max(best, abs(float(motion(at))))
        return best

    def lines(self, dof: Displacement = 0) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Frequencies in Hz, amplitudes and names of the harmonics, the mean first."""
        h = np.arange((self.X.shape[1] - 1) // 2 + 1)
        size = np.array([self.amplitude(dof, int(i)) for i in h])
        return h * self.frequency / self.subharmonic, size, [str(i) for i in h]

    def label(self, dof: Displacement = 0) -> str:
        """Name of a displacement."""
        return label(self.system, dof, len(self.X))

    @property
    def multipliers(self) -> np.ndarray | None:
        """(2 dof,) Floquet multipliers exp(s T) over one period of the motion, computed when asked for; None where they cannot be
        told (laws with memory, large systems without a reduced model, growth that the harmonics that were left out decide)."""
        fourier = Fourier(self.harmonics, self.n_samples or None, self.subharmonic)
        setup = balance.prepare(self.system, self.force, fourier, self.omega)
        s, settled = setup.exponents(setup.start(self), self.omega, self.error)
        return None if s is None or not settled else np.exp(s * self.period)

    def verify(self, rtol: float = 1e-9, *, full: bool | None = None) -> Distance:
        """Integrates one period from the solution's own state at t = 0 and returns the largest distance between the
        two motions, relative to the largest displacement: a number with ``.balanced`` and ``.full``.

        ``.balanced`` is against the equations that were balanced, by DOP853; by the implicit midpoint rule with halved
        steps for more than 60 coordinates and for laws with memory, whose sliders start where two periods of the solution
        leave them. ``.full``, for models and then the number itself, is against its full equations by `mb.simulate`,
        hence with the error of the linearised geometry. ``full``: True demands it, False leaves it out, None takes it where
        it can be had (``.why`` says why not). An unstable motion leaves its orbit, and both distances grow by its
        multiplier."""
        from .verify import verify

        return verify(self, rtol, full)

    def plot(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """Harmonics as bars; returns the matplotlib figure. ``ax``: axes to draw into."""
        from ..plot.nonlinear import harmonics

        return harmonics(self, dof, ax=ax)

    def plot_orbit(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """One period in time, and velocity over displacement; returns the figure."""
        from ..plot.nonlinear import orbit

        return orbit(self, dof, ax=ax)

    def plot_spectrum(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """Amplitude over frequency in Hz; returns the figure."""
        from ..plot.nonlinear import spectrum

        return spectrum(self, dof, ax=ax)

    def rows(self, most: int = 20) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the coordinates that move most, in their order."""
        top = min(3, (self.X.shape[1] - 1) // 2)
        size = np.linalg.norm(self.X, axis=1)
        chosen = np.sort(np.argsort(-size, kind="stable")[:most])
        heads = ["coordinate", "mean", *(f"|harmonic {h}|" for h in range(1, top + 1)), "largest |x|"]
        return heads, [
            [
                self.label(int(i)),
                *without_rounding(
                    [float(self.X[i, 0]), *(self.amplitude(int(i), h) for h in range(1, top + 1))], self.largest(int(i))
                ),
                self.largest(int(i)),
            ]
            for i in chosen
        ]

    def heading(self) -> str:
        nu = "" if self.subharmonic == 1 else f", of omega / {self.subharmonic}"
        return (
            f"{type(self).__name__}: {self.status}, omega = {self.omega:.10g} rad/s ({self.frequency:.6g} Hz), "
            f"{len(self.harmonics)} harmonics up to {self.harmonics[-1]}{nu}, estimated error {self.error:.1e}"
        )

    def notes(self) -> list[str]:
        notes = []
        if len(self.X) > 20:
            notes.append(f"({len(self.X)} coordinates, the 20 that move most are shown)")
        if self.status == "unresolved":
            notes.append("unresolved: the estimated error exceeds the tolerance; take more harmonics")
        return notes


def harmonic_balance(
    system: Model | MechanicalSystem,
    *,
    force: Force | Callable[..., Any] | None = None,
    inputs: Ports | Mapping[int, Ports] | None = None,
    amplitude: ArrayLike | Callable[[float], Any] | None = None,
    omega: float | None = None,
    frequency: float | None = None,
    harmonics: int | str | Sequence[int] = 7,
    n_samples: int | None = None,
    subharmonic: int = 1,
    condense: bool | str = "auto",
    x0: Coefficients | None = None,
    tol: float | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 60,
    at: StateLike = None,
    without: Sequence[str] = (),
) -> PeriodicSolution:
    """One periodic solution of M x" + C x' + K x + sum_e w_e law_e(w_e . x, w_e . x') = f(t) by harmonic balance.

    Where several solutions exist, the one found depends on ``x0``; `frequency_response` follows them all.

    Parameters
    ----------
    system
        `MechanicalSystem` with nonlinear ``elements``, or a `Model`, whose geometry is then linearised
        (`nonlinear_system`).
    force
        Amplitudes (n,) of the first harmonic, real for a cosine, complex a - i b for a cos + b sin; or
        ``{harmonic: (n,)}`` with 0 for a static (real) force; or a function ``f(t)`` -> (n,) with the period 2 pi / omega, which is
        sampled and transformed, its harmonics beyond those kept counted in ``error``. Force units of the system.
    inputs, amplitude
        In its place, of a model: a port such as ``body.force("x")`` or a list of them, or ``{harmonic: ports}``, and their
        amplitudes, N or N m: one number or one for each, complex a - i b for a cos + b sin. 1 if left out. A function
        ``amplitude(t)``, a number or one for each port, is a force over time as above.
    omega, frequency
        Excitation frequency in rad/s or in Hz; exactly one of them.
    harmonics
        Highest harmonic H, or a sequence of those to keep (of omega / subharmonic), or "auto": as many as ``.error <=
        tol`` needs.
    n_samples
        Samples per period; by default as many as polynomial laws need not to alias; for others at least 512, and doubled
        while aliasing is the larger part of ``error``.
    subharmonic
        nu: the motion may have the period 2 pi nu / omega.
    condense
        Solve for the coordinates that elements touch alone, the others being eliminated exactly, harmonic by harmonic:
        True, False, or "auto" for systems large enough to gain from it; by one sparse factorisation per harmonic, of
        narrow bands eight at once ("sparse"), or by the modes of the rest while these coordinates are held, none left
        out ("modal"): by what takes less time, set-up included, where neither is asked for. ``.stats.route`` tells what
        was done: "condensed, banded", "condensed, sparse", "condensed, modal".
    x0
        First guess: coefficients (dof, 2h+1) or an earlier result. The default starts at rest with the linear response;
        if that fails, the force is raised step by step, and if that fails, the harmonics are.
    tol
        Largest ``.error`` that is called resolved; 0.1, and 1e-6 for ``harmonics="auto"``.
    tolerance, max_iterations
        Of Newton's method: last step relative to the coefficients of a coordinate.
    at, without
        State of a model and effects to leave out, as for `mb.linearize`.

    Returns
    -------
    PeriodicSolution
        ``X`` (dof, 2H+1), ``amplitude``, ``error``, ``status``.

    Raises
    ------
    ModelError
        Wrong shapes, values or harmonics.
    ConvergenceError
        Newton's method gave up, or went to rest from a guess ``x0`` of a free vibration; ``.result`` is what it had reached.

    Notes
    -----
    Equations: docs/theory.md (11.1) to (11.9).
    Alternating frequency and time (Cameron and Griffin, J. Appl. Mech. 56 (1989) 149-154) with the exact Jacobian from
    the FFT of the
    force derivatives. Per iteration O(n_t log n_t + H^2) for each element and O((n (2H+1))^3) for the linear equations.

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
    >>> one = mb.harmonic_balance(duffing, force=[0.18], omega=0.8, harmonics=7)
    >>> round(one.amplitude(), 6)
    0.474872
    """
    from .system import as_system

    system, force = as_system(system, force, amplitude, at, without, inputs)
    w = balance.one_frequency(omega, frequency)
    if w.ndim != 0:
        raise ModelError("harmonic_balance solves at one frequency; frequency_response takes a range")
    fourier = Fourier(harmonics, n_samples, subharmonic, condense, tol)
    newton = Newton(tolerance, max_iterations)
    if callable(force):
        return _of_function(system, force, float(w), fourier, newton, x0)
    return _periodic(system, force, float(w), fourier, newton, x0)


def _periodic(system: Any, force: Any, w: float, fourier: Fourier, newton: Newton, x0: Any) -> PeriodicSolution:
    """A solution under forces by harmonic."""
    if fourier.automatic:
        return _automatic(system, force, w, fourier, newton, x0)
    started = perf_counter()
    setup, answer = _solved(system, force, w, fourier, newton, x0)
    loose = "" if answer["converged"] or "singular" not in answer["reason"] else setup.loose_coordinate(w)
    if loose and not np.all(np.isfinite(answer["y"])):
        raise _failure(system, answer, None, loose)
    result = PeriodicSolution(
        setup.expand(answer["y"], w),
        w,
        setup.harmonics,
        setup.subharmonic,
        setup.n_samples,
        system,
        force,
        stats=Stats(perf_counter() - started, _counts(answer), effects_of(system), setup.route),
        error=answer["error"],
        status="converged" if answer["converged"] and answer["error"] <= fourier.limit() else "unresolved",
    )
    if not answer["converged"]:
        raise _failure(system, answer, result, loose)
    if _went_to_rest(system, force, setup.expand(setup.start(x0), w), result.X):
        raise ConvergenceError(
            "harmonic balance went to rest: without force a conservative system has families of free vibrations, of which no single "
            "one can be solved for; give it light damping and a small force=, and follow frequency_response: its peak (.peak()) "
            "lies on the backbone of the free vibration",
            result.replaced(status="stopped"),
        )
    return result


def _went_to_rest(system: Any, force: Any, guess: np.ndarray, X: np.ndarray) -> bool:
    """True where nothing drives a conservative system and the motion that was guessed is gone."""
    varying = [f for h, f in force.items() if h != 0] if isinstance(force, Mapping) else [force]
    if any(np.any(np.asarray(f)) for f in varying):
        return False
    guessed, found = (float(np.max(np.abs(x[:, 1:]), initial=0.0)) for x in (guess, X))
    return guessed > 0.0 and found <= AT_REST * guessed and condensation.conservative(system)


def _solved(
    system: Any, force: Any, omega: float, fourier: Fourier, newton: Newton, x0: Any
) -> tuple[balance.Setup, dict[str, Any]]:
    """Solve; on failure restart from fewer harmonics; refine the sampling if aliasing dominates."""
    setup, answer = first_solution(system, force, omega, fourier, newton, x0)
    while answer["converged"]:
        more = balance.more_samples(setup.n_samples, answer["error"], answer["aliasing"], system.elements, fourier)
        if more is None:
            break
        finer = balance.prepare(system, force, fourier, omega, least_samples=more)
        again = _solve(finer, answer["y"], omega, newton)
        if not again["converged"]:
            break
        setup, answer = finer, _after(answer, again)
    return setup, answer


def first_solution(
    system: Any, force: Any, omega: float, fourier: Fourier, newton: Newton, x0: Any
) -> tuple[balance.Setup, dict[str, Any]]:
    """The core's answer from a guess or from rest; where it fails, with more samples: too few make the equations of a stiff
    contact rough."""
    laws = balance.checked_system(system)
    smooth = fourier.n_samples is not None or all(balance.without_samples(law) for law in laws)
    top = 0
    answer: dict[str, Any] = {}
    for least in (0,) if smooth else (0, balance.MOST_SAMPLES // 8, balance.MOST_SAMPLES // 2):
        setup = balance.prepare(system, force, fourier, omega, least_samples=least)
        answer = _after(answer, _solve(setup, setup.start(x0), omega, newton, ramp=x0 is not None))
        if x0 is None and not least and not _ended(answer) and not all(law.kind.polynomial for law in laws):
            answer, top = _from_motion(setup, omega, newton, answer)
        if x0 is None and not _ended(answer):
            answer = _from_fewer_harmonics(setup, omega, newton, least, answer)
        if x0 is None and not _ended(answer):
            answer = _after(answer, _solve(setup, setup.start(None), omega, newton))
        if _ended(answer):
            break
    return setup, {**answer, "top": top}


def _solve(setup: balance.Setup, start: np.ndarray, omega: float, newton: Newton, ramp: bool = True) -> dict[str, Any]:
    return balance.call_core(setup.core.solve, start, [omega], ramp=ramp, **newton.core)


def _after(earlier: dict[str, Any], answer: dict[str, Any]) -> dict[str, Any]:
    """An answer whose counts hold the work of an earlier attempt as well."""
    return answer | {
        name: answer[name] + earlier.get(name, 0) for name in ("iterations", "evaluations", "factorisations")
    }


def _ended(answer: dict[str, Any]) -> bool:
    """True where another guess would bring nothing."""
    return answer["converged"] or answer["broken"] is not None


def _from_motion(
    setup: balance.Setup, omega: float, newton: Newton, answer: dict[str, Any]
) -> tuple[dict[str, Any], int]:
    """The core's answer from what a motion from rest settles to, or the given one; and the harmonics that such a motion needs where
    it is periodic and the answer has too few of them, else 0."""
    guess = settled(setup.system, setup.force, omega, setup.fourier)
    if guess is None:
        return answer, 0
    answer = _after(answer, _solve(setup, setup.start(guess.X), omega, newton, ramp=False))
    lacking = guess.repeats and guess.top > setup.harmonics[-1]
    return answer, guess.top if lacking and not answer["converged"] else 0


def _from_fewer_harmonics(
    setup: balance.Setup, omega: float, newton: Newton, least_samples: int, answer: dict[str, Any]
) -> dict[str, Any]:
    """The core's answer from sets of harmonics that grow, or the given one where no set has a solution: a ramp of the forces costs
    little with few harmonics, and with many of them the cube of their number in each of its steps."""
    system, force, fourier = setup.system, setup.force, setup.fourier
    harmonics, nu = fourier.terms, fourier.subharmonic
    forced = [h * nu for h in force] if isinstance(force, Mapping) else [nu]
    guess = None
    for top in (1, 2, 3, 5, 9, 17, 33, 65, 129):
        fewer = [h for h in harmonics if h <= max(top, *forced)]
        if len(fewer) == len(harmonics):
            break
        coarse = balance.prepare(system, force, fourier.but(harmonics=fewer), omega, least_samples=least_samples)
        found = _solve(coarse, coarse.start(guess), omega, newton, ramp=guess is None)
        answer = _after(found, answer)
        if found["converged"]:
            guess = coarse.expand(found["y"], omega)
    return answer if guess is None else _after(answer, _solve(setup, setup.start(guess), omega, newton, ramp=False))


def _automatic(system: Any, force: Any, omega: float, fourier: Fourier, newton: Newton, x0: Any) -> PeriodicSolution:
    """More harmonics until the error estimate is below the tolerance."""
    forced = max((h for h in force), default=1) if isinstance(force, Mapping) else 1
    top, guess, tol = max(3, int(forced)), x0, fourier.limit()
    while True:
        one = _periodic(system, force, omega, fourier.chosen(top), newton, guess)
        if one.error <= tol or top >= MOST_HARMONICS:
            return one
        top, guess = min(MOST_HARMONICS, top + max(2, top // 2)), one


def _of_function(system: Any, force: Any, omega: float, fourier: Fourier, newton: Newton, x0: Any) -> PeriodicSolution:
    """A force f(t), transformed; the answer of the linear part to harmonics that are not kept is added to the error."""
    balance.checked_system(system)
    weights = weights_of(system, omega)
    series = harmonics_of(force, weights, omega)
    nu, limit = fourier.subharmonic, fourier.limit()
    one = fourier.but(harmonics=3 * nu) if fourier.automatic else fourier
    while True:
        inside, outside = cut(series, {h // nu for h in one.terms if h % nu == 0})
        found = _periodic(system, inside, omega, one, newton, x0)
        largest = float(np.max(np.abs(found.X) * weights[:, None], initial=0.0))
        missed = linear_size(system, outside, weights, omega) if outside else 0.0
        error = found.error + (missed / largest if largest else float(missed > 0.0))
        top: Any = one.harmonics
        if not fourier.automatic or error <= limit or top >= MOST_HARMONICS:
            return found.replaced(error=error, status="converged" if error <= limit else "unresolved")
        one, x0 = one.but(harmonics=min(MOST_HARMONICS, top + max(2, top // 2))), found


def _counts(answer: dict[str, Any]) -> dict[str, int]:
    return {key: answer[key] for key in ("iterations", "evaluations", "factorisations")}


def effects_of(system: Any) -> tuple[str, ...]:
    """Names of what a system contains beside mass and stiffness."""
    names = [type(law).__name__ for law in system.elements]
    linear = [] if system.C is None else ["damping"]
    return tuple(dict.fromkeys(linear + names))


def _failure(system: Any, answer: dict[str, Any], result: PeriodicSolution | None, loose: str) -> ConvergenceError:
    broken = answer["broken"]
    if broken is not None:
        text = f"elements[{broken}], {system.elements[broken]!r}, returned a force that is not finite"
        advice = "check its numbers and the range of displacements"
    elif "singular" in answer["reason"] and loose:
        text = f"harmonic balance did not converge: the equations are singular, nothing restrains {loose}"
        advice = "restrain it, or drive or remove its joint"
    elif answer.get("top"):
        text = f"harmonic balance did not converge: {answer['reason']} after {answer['iterations']} iterations"
        advice = f"the motion that begins at rest settles to one with harmonics up to {answer['top']}: take harmonics={answer['top']}"
    else:
        text = f"harmonic balance did not converge: {answer['reason']} after {answer['iterations']} iterations"
        advice = "start nearer (x0=), raise the force in steps, or follow the branch with frequency_response"
    return ConvergenceError(f"{text}; {advice}", None if result is None else result.replaced(status="stopped"))
