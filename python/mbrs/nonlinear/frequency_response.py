"""Periodic response over a range of frequencies, through folds, with stability and events."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from .._lib import checks
from ..errors import ConvergenceError, Interrupted, ModelError
from ..results import Stats
from . import balance
from .branch import BRANCH_DEFAULTS, Branch, interrupted, takes_branch_options
from .branch_options import BranchOptions
from .branch_points import filled_up, truncation
from .options import Fourier, points
from .periodic import effects_of, harmonic_balance
from .response_curve import FrequencyResponse, Part, known_stability
from .system import as_system

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model


@takes_branch_options
def frequency_response(
    system: Model | MechanicalSystem,
    *,
    max_points: int = 10000,
    progress: bool | None = None,
    **options: Unpack[BranchOptions],
) -> FrequencyResponse:
    """Periodic responses of M x" + C x' + K x + sum_e w_e law_e = f(t) over a range of frequencies, through folds.

    Parameters
    ----------
    system, force, inputs, amplitude, harmonics, n_samples, subharmonic, condense, x0, at, without
        As for `harmonic_balance`; ``x0`` is a guess of the first point. ``harmonics="auto"`` adds harmonics, and samples
        for laws that are not polynomials, wherever the error exceeds ``tol``.
    omega, frequency
        Exactly one, in rad/s or Hz: a tuple (start, end), end below start included, is followed by continuation; a
        list or an array is a set of points, solved one after the other; one number together with ``level=(a, b)``
        follows the force level.
    level
        Factor on the forces, the static one excepted: a number or a range.
    tol
        Largest ``.error`` that is called resolved; 0.1, and 1e-6 for ``harmonics="auto"``.
    predictor
        "tangent", "secant", or "lagrange1" to "lagrange5": the polynomial of that order through the last points over the length of
        the branch between them, of lower order while there are fewer; "lagrange" is "lagrange3", "lagrange1" the secant.
    corrector
        "pseudo-arclength", "arclength", "moore-penrose".
    step, min_step, max_step
        First, least and largest step in the scaled space, where the solution has length at most 1 and so has the range.
    tolerance
        Of the last Newton step in that space.
    stability
        Floquet exponents of every point (not for laws with memory) by Hill's method, O((2 dof (2H+1))^3), or by the
        monodromy matrix where both agree at the first point, O(dof^3) times some hundred steps; of large condensed systems
        by the monodromy matrix of a reduced model (nan where there is none that has the dynamic stiffness of the system).
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
    Interrupted
        Ctrl-C; ``.result`` is the curve so far.

    Notes
    -----
    Equations: docs/theory.md (13.1) to (13.5), (14.1) to (14.3).
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
    most = points(max_points)
    if progress is not None:
        progress = checks.flag("progress", progress)
    w: Any = options.get("omega") if options.get("frequency") is None else options.get("frequency")
    if not isinstance(w, tuple) and np.ndim(w) == 1:
        return _points(system, options)
    branch = Branch(system, **options)
    try:
        branch.follow(most, progress)
    except KeyboardInterrupt:
        raise interrupted(branch, lambda: branch.curve(perf_counter() - started)) from None
    return branch.curve(perf_counter() - started)


def _points(system: Any, options: BranchOptions) -> FrequencyResponse:
    """A set of frequencies, each started from the solution before."""
    started = perf_counter()
    given: dict[str, Any] = {name: options.get(name, default) for name, default in BRANCH_DEFAULTS.items()}
    system, force = as_system(system, *(given[n] for n in ("force", "amplitude", "at", "without", "inputs")))
    w = balance.one_frequency(given["omega"], given["frequency"])
    level, stability = given["level"], checks.flag("stability", given["stability"])
    if np.ndim(level) != 0:
        raise ModelError("a set of frequencies takes one level; give one frequency for a range of levels")
    scaled = balance.scaled_force(force, balance.checked_level(level))
    of_each = {name: given[name] for name in ("n_samples", "subharmonic", "condense", "tol", "harmonics")}
    found, status = _solved_one_by_one(system, scaled, list(map(float, w)), given["x0"], of_each, stability)
    parts, errors, exponents, settled, evaluations = zip(*found, strict=True)
    n, borders = len(found), balance.NEUTRAL * w[: len(found)] / given["subharmonic"]
    stable = np.array(
        [np.nan if s is None else np.all(s.real <= b) for s, b in zip(exponents, borders, strict=True)], float
    )
    stable[~np.array(settled)] = np.nan
    truncated = truncation(np.array(settled), ())
    made = FrequencyResponse(
        np.asarray(w[:n]),
        np.full(n, float(level)),
        known_stability(stable, stability),
        None if any(s is None for s in exponents) else filled_up(list(exponents)),
        (),
        parts,
        system,
        force,
        reason=truncated,
        over="frequency" if given["omega"] is None else "omega",
        stats=Stats(
            perf_counter() - started,
            {"points": n, "corrections": sum(evaluations), "single solutions": n},
            effects_of(system),
            parts[-1].setup.route,
        ),
        error=np.array(errors),
        status="unresolved" if status == "converged" and truncated else status,
    )
    if status == "interrupted":
        raise Interrupted(f"a set of {len(w)} frequencies was interrupted after {n} of them", made)
    return made


def _solved_one_by_one(
    system: Any, force: Any, frequencies: Sequence[float], x0: Any, options: dict[str, Any], stability: bool
) -> tuple[list[tuple[Part, float, Any, bool, int]], str]:
    """(point, error, exponents or None, whether they are settled, evaluations) of each frequency up to the first without a solution,
    and the status."""
    fourier = Fourier(**options)
    found: list[tuple[Part, float, Any, bool, int]] = []
    status, guess = "converged", x0
    try:
        for omega in frequencies:
            try:
                one = harmonic_balance(system, force=force, omega=omega, x0=guess, **options)
            except ConvergenceError as problem:
                if not found:
                    raise
                status = f"stopped: {problem}"
                break
            chosen = fourier.chosen(one.harmonics, n_samples=one.n_samples)
            setup = balance.prepare(system, force, chosen, omega)
            y = setup.start(one)
            # the forces of this set are scaled already
            part = Part(setup, np.array([omega]), np.ones(1), y[None, :])
            s, settled = setup.exponents(y, omega, one.error) if stability else (None, True)
            found.append((part, one.error, s, settled, one.stats.counts["evaluations"]))
            status, guess = one.status if status == "converged" else status, one
    except KeyboardInterrupt:
        if not found:
            raise Interrupted("a set of frequencies was interrupted before its first solution") from None
        status = "interrupted"
    return found, status
