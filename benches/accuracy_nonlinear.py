"""The sections of docs/accuracy.md about harmonic balance: error against time over harmonics and samples."""

from __future__ import annotations

from functools import cache
from typing import Any

import mbrs as mb
import numpy as np
import rivals_nonlinear as rivals

# docs/theory.md (23.6), (23.10), by shooting with rtol 1e-13: peak of |x|, its omega, both folds; periods
DUFFING = np.array([2.5645599332, 2.3993334635, 2.3996492588, 1.3291743525])
PERIODS = {1.0: 6.66328686, 5.0: 11.61223067}
# For PyHarm: element, damping, force, range of omega, largest step, of x" + c x' + x + law = F cos(omega t). The oscillator with
# play in units of its play and of its own frequency sqrt(8e3 / 2) rad/s.
PLAY, OWN = 1e-3, (8e3 / 2.0) ** 0.5
CLEARANCE = ({"type": "PenaltyBilateralGap", "g": 1.0, "k": 5.0}, 20.0 / (2.0 * OWN), 3.0 / (8e3 * PLAY),
             (2 * np.pi * 8 / OWN, 2 * np.pi * 14 / OWN), 0.05)  # fmt: skip
FRICTION = ({"type": "Jenkins", "mu": 1.0, "N0": 0.2, "k": 0.5}, 0.02, 0.4, (0.6, 1.1), 0.05)
SWEPT = (
    "The lines of curves follow the branch to that point, ours and that of PyHarm (all harmonics; interpolated between its "
    "last points) where it is installed."
)


def smooth() -> tuple[str, str, str, Any]:
    def solve(harmonics: int, program: str) -> np.ndarray:
        if program != "mbrs":
            return _of_points(rivals.RIVALS[program](harmonics)())
        system = mb.examples.duffing(k3=1.0)
        curve = mb.frequency_response(system, force=[0.3], omega=(0.8, 3.0), harmonics=harmonics, stability=False)
        peak = curve.peak(harmonic=None)
        folds = sorted((e.omega for e in curve.events if e.kind == "fold"), reverse=True)
        return np.array([peak.largest(), peak.omega, *folds])

    def against_shooting(result: Any, reference: Any) -> float:
        """Largest relative error of the peak, of its frequency and of both folds, against shooting."""
        return float(np.max(np.abs(np.asarray(result) / reference - 1)))

    installed = ["mbrs", *(name for name in ("PyHarm", "harmonicbalance") if _installed(name))]
    for program in installed:
        solve(1, program)  # what is compiled or imported at the first use does not count
    study = mb.accuracy_study(
        solve,
        harmonics=[1, 3, 5, 7, 11, 15, 31],
        program={name: name for name in installed},
        reference=DUFFING,
        measure=against_shooting,
        repeat=1,
    )
    text = (
        "Duffing, x\" + 0.05 x' + x + x^3 = 0.3 cos(omega t), from 0.8 to 3 rad/s through both folds; time of the whole curve "
        "without stability. mbrs solves for peak and folds; the others give points, through which a spline goes here, so "
        "that their error ends where their points are too far apart. Programs that were not installed are left out: "
        f"{', '.join(name for name in ('PyHarm', 'harmonicbalance') if name not in installed) or 'none'}."
    )
    return "harmonic-balance-smooth", "Harmonic balance: a smooth law", text, study


def _installed(name: str) -> bool:
    import importlib.util

    return importlib.util.find_spec({"PyHarm": "pyHarm"}.get(name, name)) is not None


def _of_points(points: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Peak of |x|, its omega and both folds of a curve of points, by cubic splines over its length."""
    from scipy.interpolate import CubicSpline

    omega, c = points
    phase = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    size = np.max(np.real(c @ np.exp(1j * np.outer(np.arange(c.shape[1]), phase))), axis=1)
    s = np.append(0.0, np.cumsum(np.hypot(np.diff(omega), np.diff(size))))
    of_omega, of_size = CubicSpline(s, omega), CubicSpline(s, size)
    top = max(of_size.derivative().roots(extrapolate=False), key=of_size)
    folds = np.sort(of_omega(of_omega.derivative().roots(extrapolate=False)))
    return np.array([of_size(top), of_omega(top), folds[-1], folds[0]])


@cache
def clearance() -> tuple[Any, Any, Any, float]:
    """The oscillator with play, its force, its upper motion at 14 Hz, and max |x| there by shooting."""
    from mbrs.reference import hbm_shooting

    m = mb.examples.clearance_oscillator()
    curve = mb.frequency_response(m, inputs="mass.force.x", amplitude=3.0, frequency=(8, 14), harmonics=21)
    start, system = curve.point(-1), mb.nonlinear_system(m)
    fine = mb.harmonic_balance(system, force=[3.0], frequency=14.0, harmonics=99, x0=start)
    state = np.concatenate([fine.displacement(0.0)[:, 0], fine.velocity(0.0)[:, 0]])
    state, _ = hbm_shooting.shoot(system, [3.0], fine.omega, state)
    return system, start, state, _largest(system, state, fine.omega)


def _largest(system: Any, state: np.ndarray, omega: float) -> float:
    """max |x| over a period, integrated from the state."""
    from scipy.integrate import solve_ivp

    law, (M, C, K) = system.elements[0], (float(A[0, 0]) for A in (system.M, system.C, system.K))

    def rate(t: float, y: np.ndarray) -> list[float]:
        return [
            y[1],
            (3.0 * np.cos(omega * t) - C * y[1] - K * y[0] - float(law.w[0] * law.force(law.w[0] * y[0]))) / M,
        ]

    turn = [lambda t, y: y[1]]
    motion = solve_ivp(rate, (0, 2 * np.pi / omega), state, method="DOP853", rtol=1e-11, atol=1e-15, events=turn)
    return float(np.max(np.abs(motion.y_events[0][:, 0])))


def contact() -> tuple[str, str, str, Any]:
    system, start, _, exact = clearance()

    def solve(harmonics: int, program: str, samples: int) -> Any:
        if program == "PyHarm":
            return PLAY * _at_the_end(rivals.pyharm_sweep(harmonics, samples, *CLEARANCE))
        one = list(range(1, harmonics + 1, 2))
        if program == "sweep":
            curve = mb.frequency_response(
                system, force=[3.0], frequency=(8, 14), harmonics=one, n_samples=samples, stability=False
            )
            return curve.point(-1)
        return mb.harmonic_balance(system, force=[3.0], frequency=14.0, harmonics=one, n_samples=samples, x0=start)

    def against_shooting(result: Any, reference: float) -> float:
        """Relative error of the largest displacement, against shooting."""
        return abs(_size(result) / reference - 1)

    study = mb.accuracy_study(
        solve,
        harmonics=[3, 7, 15, 31, 63],
        method=_methods("PyHarm"),
        reference=exact,
        measure=against_shooting,
        repeat=1,
    )
    text = (
        "A mass with play between two stops (`mb.examples.clearance_oscillator`), on the upper branch at 14 Hz; odd "
        "harmonics. The stops act for a part of the period, and the series converges slowly: with few samples their "
        f"aliasing decides, with many the harmonics. {SWEPT}"
    )
    return "harmonic-balance-contact", "Harmonic balance: contact", text, study


def _methods(rival: str) -> dict[str, dict[str, Any]]:
    """Lines of a study: one solution with some numbers of samples, whole curves, and those of a rival that is installed."""
    lines: dict[str, dict[str, Any]] = {
        f"one solution, {n} samples": {"program": "mbrs", "samples": n} for n in (256, 1024, 4096)
    }
    lines["curve, 1024 samples"] = {"program": "sweep", "samples": 1024}
    if _installed(rival):
        for case in (CLEARANCE, FRICTION):
            rivals.pyharm_sweep(1, 64, *case)()  # what is compiled at the first use does not count
        lines[f"{rival}, curve, 1024 samples"] = {"program": rival, "samples": 1024}
    return lines


def _size(result: Any) -> float:
    """Largest displacement of one of our results, or what a rival gave."""
    return result if isinstance(result, float) else float(result.largest())


def _at_the_end(run: Any) -> float:
    """Largest |x| at the last frequency of a rival's sweep, interpolated between its last points."""
    from scipy.interpolate import BarycentricInterpolator

    omega, c = run()
    end = CLEARANCE[3][1] if abs(omega[-1] - CLEARANCE[3][1]) < abs(omega[-1] - FRICTION[3][1]) else FRICTION[3][1]
    phase = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    size = np.max(np.real(c[-4:] @ np.exp(1j * np.outer(np.arange(c.shape[1]), phase))), axis=1)
    return float(BarycentricInterpolator(omega[-4:], size)(end))


def friction() -> tuple[str, str, str, Any]:
    system = mb.examples.jenkins_oscillator()

    def solve(harmonics: int, program: str, samples: int) -> Any:
        if program == "PyHarm":
            return _at_the_end(rivals.pyharm_sweep(harmonics, samples, *FRICTION))
        one = list(range(1, harmonics + 1, 2))
        if program == "sweep":
            curve = mb.frequency_response(
                system, force=[0.4], omega=FRICTION[3], harmonics=one, n_samples=samples, stability=False
            )
            return curve.point(-1)
        return mb.harmonic_balance(system, force=[0.4], omega=1.1, harmonics=one, n_samples=samples)

    reference = mb.harmonic_balance(system, force=[0.4], omega=1.1, harmonics=list(range(1, 162, 2)), n_samples=16384)

    def against_fine(result: Any, reference: float) -> float:
        """Relative error of the largest displacement, against 161 harmonics and 16384 samples."""
        return abs(_size(result) / reference - 1)

    study = mb.accuracy_study(
        solve, harmonics=[1, 3, 7, 15, 31], method=_methods("PyHarm"), reference=reference.largest(), measure=against_fine,
        repeat=1,
    )  # fmt: skip
    text = (
        "A Jenkins slider (`mb.examples.jenkins_oscillator`), force 0.4, slipping over most of the period; odd harmonics. "
        f"The reference's own distance from integration in time over a period is {float(reference.verify()):.0e}. {SWEPT}"
    )
    return "harmonic-balance-friction", "Harmonic balance: friction", text, study


def cycles() -> tuple[str, str, str, Any]:
    def solve(harmonics: int, mu: float) -> Any:
        return mb.limit_cycle(mb.examples.van_der_pol(mu), harmonics=harmonics, method="harmonic-balance")

    def against_printed(result: Any, reference: Any) -> float:
        """Relative error of the period, against nine printed digits."""
        mu = -float(result.system.C[0, 0])
        return abs(result.period / reference[mu] - 1)

    solve(3, 1.0)
    study = mb.accuracy_study(
        solve, harmonics=[3, 7, 15, 31, 63, 127], mu={"1": {"mu": 1.0}, "5": {"mu": 5.0}}, reference=PERIODS,
        measure=against_printed, repeat=1,
    )  # fmt: skip
    text = "Limit cycles of van der Pol's oscillator without a guess, mu = 1 and 5 (known to nine digits, docs/theory.md (23.10))."
    return "harmonic-balance-cycles", "Harmonic balance: limit cycles", text, study


SECTIONS = {"smooth": smooth, "contact": contact, "friction": friction, "cycles": cycles}
