"""Periodic response over a range of frequencies, through folds, with stability and events."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from . import _balance, _checks
from .continuation import Branch
from .errors import ConvergenceError, ModelError
from .harmonic_balance import effects_of, harmonic_balance
from .nonlinear_system import as_system
from .response_curve import FrequencyResponse, Part, collect, follow, known_stability
from .results import Stats


def frequency_response(
    system: Any,
    *,
    force: Any = None,
    inputs: Any = None,
    amplitude: Any = None,
    omega: Any = None,
    frequency: Any = None,
    level: Any = 1.0,
    harmonics: Any = 7,
    n_samples: int | None = None,
    subharmonic: int = 1,
    condense: bool | str = "auto",
    x0: Any = None,
    tol: float | None = None,
    predictor: str = "tangent",
    corrector: str = "pseudo-arclength",
    step: float = 0.01,
    min_step: float = 1e-9,
    max_step: float = 0.1,
    tolerance: float = 1e-9,
    stability: bool = True,
    events: bool = True,
    max_points: int = 10000,
    progress: bool | None = None,
    at: Any = None,
    without: Any = (),
) -> FrequencyResponse:
    """Periodic responses of M x" + C x' + K x + sum_e w_e law_e = f(t) over a range of frequencies, through folds.

    Parameters
    ----------
    system, force, inputs, amplitude, harmonics, n_samples, subharmonic, condense, x0, at, without
        As for `harmonic_balance`; ``x0`` is a guess of the first point. ``harmonics="auto"`` adds harmonics, and samples
        for laws that are no polynomials, wherever the error exceeds ``tol``.
    omega, frequency
        Exactly one, in rad/s or Hz: a tuple (start, end), end below start included, is followed by continuation; a
        list or an array
        is a set of points, solved one after the other; one number together with ``level=(a, b)`` follows the force
        level.
    level
        Factor on the forces, the static one excepted: a number or a range.
    tol
        Largest ``.error`` that is called resolved; 0.1, and 1e-6 for ``harmonics="auto"``.
    predictor
        "tangent", "secant", "lagrange" (cubic through the last points).
    corrector
        "pseudo-arclength", "arclength", "moore-penrose".
    step, min_step, max_step
        First, least and largest step in the scaled space, where the solution has length at most 1 and so has the range.
    tolerance
        Of the last Newton step in that space.
    stability
        Floquet exponents of every point by Hill's method (not for laws with memory), O((2 dof (2H+1))^3) per point; of
        large condensed systems by the monodromy matrix of a reduced model (nan where there is none that has the dynamic
        stiffness of the system).
    events
        Locate special points; Neimark-Sacker and period doubling need ``stability``.
    max_points
        Points after which the curve is returned with the status "max-points"; `FrequencyResponse.resume` goes on.
    progress
        A line on standard error with frequency, amplitude, harmonics, step and number of events: None shows it on a
        terminal after a second, True always, False never.

    Returns
    -------
    FrequencyResponse
        Partial, with its reason in ``.status``, if the branch cannot be followed to the end.

    Raises
    ------
    ModelError
        Wrong input.
    ConvergenceError
        No first point was found.

    Notes
    -----
    Predictor and corrector in a space whose scaling is renewed at every point (Allgower and Georg, Introduction to
    Numerical
    Continuation Methods, SIAM 2003). Cost per point: that of about three iterations of `harmonic_balance`.

    Examples
    --------
    >>> import mbrs as mb
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
    >>> curve = mb.frequency_response(duffing, force=[0.18], omega=(0.5, 1.6), harmonics=7)
    >>> [f"{event.kind} {event.omega:.5f}" for event in curve.events]
    ['fold 1.26960', 'fold 1.11570']
    """
    started = perf_counter()
    most = _checks.count("max_points", max_points, 10_000_000)
    if progress is not None:
        progress = _checks.flag("progress", progress)
    system, force = as_system(system, force, amplitude, at, without, inputs)
    w = omega if frequency is None else frequency
    if not isinstance(w, tuple) and np.ndim(w) == 1:
        return _points(
            system, force, omega, frequency, level, harmonics, n_samples, subharmonic, condense, x0, tol, stability
        )
    branch = Branch(
        system,
        force=force,
        omega=omega,
        frequency=frequency,
        level=level,
        harmonics=harmonics,
        n_samples=n_samples,
        subharmonic=subharmonic,
        condense=condense,
        x0=x0,
        tol=tol,
        predictor=predictor,
        corrector=corrector,
        step=step,
        min_step=min_step,
        max_step=max_step,
        tolerance=tolerance,
        stability=stability,
        events=events,
    )
    follow(branch, most, progress)
    return collect(branch, perf_counter() - started)


def _points(
    system: Any,
    force: Any,
    omega: Any,
    frequency: Any,
    level: Any,
    harmonics: Any,
    n_samples: int | None,
    subharmonic: int,
    condense: bool | str,
    x0: Any,
    tol: float | None,
    stability: bool,
) -> FrequencyResponse:
    """A set of frequencies, each started from the solution before."""
    started = perf_counter()
    w = _balance.one_frequency(omega, frequency)
    if np.ndim(level) != 0:
        raise ModelError("a set of frequencies takes one level; give one frequency for a range of levels")
    _balance.checked_level(level)
    scaled = _balance.scaled_force(force, float(level))
    parts: list[Any] = []
    errors: list[float] = []
    stable: list[float] = []
    exponents: list[Any] = []
    status, guess, corrections = "converged", x0, 0
    for one_omega in w:
        try:
            one = harmonic_balance(
                system,
                force=scaled,
                omega=float(one_omega),
                harmonics=harmonics,
                n_samples=n_samples,
                subharmonic=subharmonic,
                condense=condense,
                x0=guess,
                tol=tol,
            )
        except ConvergenceError as problem:
            if not parts:
                raise
            status = f"stopped: {problem}"
            break
        setup = _balance.prepare(system, scaled, one.harmonics, subharmonic, one.n_samples, float(one_omega), condense)
        y = setup.start(one)
        s = setup.exponents(y, float(one_omega)) if stability else None
        # the forces of this set are scaled already
        parts.append(Part(setup, np.array([one_omega]), np.ones(1), y[None, :]))
        errors.append(one.error)
        exponents.append(s)
        stable.append(np.nan if s is None else float(np.all(s.real <= 1e-9 * one_omega / subharmonic)))
        corrections += one.stats.counts["evaluations"]
        status = one.status if status == "converged" else status
        guess = one
    n = len(parts)
    return FrequencyResponse(
        np.asarray(w[:n]),
        np.full(n, float(level)),
        known_stability(np.array(stable), stability),
        None if any(s is None for s in exponents) else np.array(exponents),
        (),
        tuple(parts),
        system,
        force,
        stats=Stats(
            perf_counter() - started,
            {"points": n, "corrections": corrections, "single solutions": n},
            effects_of(system),
            parts[-1].setup.route,
        ),
        error=np.array(errors),
        status=status,
    )
