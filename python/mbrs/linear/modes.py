"""Modes of linear and linearised systems: the dense route, and the choice of the sparse one."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.border import core_errors
from .._lib.checks import LARGEST, one_or_names, real_array, shown
from .._lib.progress import call_progress
from ..errors import ConvergenceError, ModelError, SingularError
from ..model.book import Book
from ..model.schema import LAW_OF_CODE
from .discretisation import discretisation
from .linearization import Linearization
from .linearize import second_order_of
from .matrices import EFFECT_OF, MechanicalSystem, check_matrix_effects
from .modal_result import ModalResult, modal_result
from .relaxation import relaxing_modes
from .sparse_modes import DENSE_INSTEAD, is_large, model_modes, sparse_modes
from .stiffness_factor import stiffness_factor

if TYPE_CHECKING:
    from ..system.state import StateLike
    from .aliases import Linear, Matrix


def modes(
    m: Linear,
    *,
    at: StateLike = None,
    n: int | None = None,
    without: Iterable[str] = (),
    stiffness_factor: Matrix | None = None,
    shift: float | None = None,
) -> ModalResult:
    """Modes: all solutions of (s^2 M + s (C + G) + K + N) phi = 0.

    Parameters
    ----------
    m
        A `Model`, or a `MechanicalSystem` (dense or sparse).
    at
        State to linearise a model at: None (the drawn state), an equilibrium, a steady motion, ``traj.state(t)``.
    n
        How many of the lowest modes to return; None returns all, one for each degree of freedom.
    shift
        Hz. The ``n`` modes whose squared frequencies lie nearest to its square, in place of the lowest; ``n`` is then needed.
        Sparse routes solve there (symmetric systems only), and inertia counts prove that none is missing; where the damping of a
        large model is too strong for that, the dense route answers up to 4000 coordinates.
    without
        Effects to leave out. Plain matrices know "damping" (C), "gyroscopic" (G) and "circulatory" (N).
    stiffness_factor
        (any, dof) matrix F with K = F^T F, such as sqrt(k) times the rows of relative displacement. It keeps low
        frequencies accurate where a stiffness ratio beyond 1e8 would lose them in the rounding of an assembled K;
        used for undamped and proportionally damped systems.

    Returns
    -------
    ModalResult
        In ascending |s|; normalisation there.

    Raises
    ------
    SingularError
        M is not positive definite; the message names the coordinate without inertia.
    ModelError
        Matrices that are not symmetric (M, C, K) or skew (G, N), not finite, or of different sizes; ``n`` out of range; a
        shift without ``n``, negative, or for sparse matrices whose damping is not proportional. `RouteError`, one of them: a shift
        for a model above 4000 coordinates whose damping is too strong to prove which modes are nearest.

    Notes
    -----
    Equations: docs/theory.md (6.1) to (6.9).
    Without damping, or with damping that the undamped modes diagonalise, one symmetric eigenproblem and scalar
    quadratics; where a bound from all residuals says that digits are lost (very different stiffnesses or masses), singular
    values of a factor of K by Jacobi's method, and residuals in twice the precision. A model hands over the factor of its
    own elements where assembling them has lost digits; geometry then decides which modes are rigid. Conservative gyroscopic
    systems one Hermitian eigenproblem; where symmetric damping couples the undamped modes less than they lie apart, corrections of
    all of them at once; all else the balanced state matrix in energy coordinates, which have the scaling of
    Fan, Lin and Van Dooren built in, with Rayleigh corrections of all roots and Newton corrections of the pairs whose
    backward error exceeds max(dof, 16) eps or whose vectors may be wrong. Cost O(dof^3).

    Examples
    --------
    >>> import mbrs as mb
    >>> system = mb.MechanicalSystem(M=[[1.0, 0.0], [0.0, 1.0]], C=None, K=[[2.0, -1.0], [-1.0, 2.0]])
    >>> mb.modes(system).omega.round(6).tolist()
    [1.0, 1.732051]
    """
    shift = _shift(shift, n)
    found = _modes(m, at, n, one_or_names("without", without), stiffness_factor, shift)
    return found.replaced(shift=shift, discretisation=_of_meshes)


def _of_meshes(result: ModalResult) -> np.ndarray:
    return discretisation(result, modes)


def _modes(
    m: Any, at: Any, n: int | None, without: Iterable[str], stiffness_factor: Any, shift: float | None
) -> ModalResult:
    """By the dense or the sparse route."""
    start = time.perf_counter()
    if _is_large_model(m, n) and not _has_state_rates(m):
        if stiffness_factor is not None:
            raise ModelError("stiffness_factor= belongs to matrices; a model knows its own")
        found = model_modes(m, at, _positive(n), tuple(without), start, shift)
        if found is not None:
            return found
    system, effects = _second_order(m, at, tuple(without))
    n = _count(n, len(system.coordinates))
    if getattr(system, "is_sparse", False):
        return _sparse(system, n, effects, shift, start)
    return _dense(system, n, effects, stiffness_factor, shift, start)


def _second_order(m: Any, at: Any, without: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    if not isinstance(m, MechanicalSystem):
        system = second_order_of(m, at, without)
        return system, tuple(getattr(system, "effects", ()))
    if at is not None:
        raise ModelError("at= is the state to linearise a model at; a MechanicalSystem is linear already, leave it out")
    check_matrix_effects(without)
    m = m.leaving_out(frozenset(a for a, name in EFFECT_OF.items() if name in without))
    return m, tuple(name for a, name in EFFECT_OF.items() if getattr(m, a) is not None)


def _has_state_rates(m: Any) -> bool:
    """True if a model has laws whose states have rates: only the dense route knows those that relax."""
    return any(law.body is None and LAW_OF_CODE[law.code].state == "rate" for laws in m.laws.values() for law in laws)


def _is_large_model(m: Any, n: Any) -> bool:
    if n is None or not isinstance(m, Book):
        return False
    return is_large(m, _positive(n))


def _count(n: int | None, dof: int) -> int | None:
    return None if n is None else min(_positive(n), dof)


def _positive(n: Any) -> int:
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
        raise ModelError(f"n must be a positive number of modes, got {shown(n)}")
    return int(n)


def _shift(shift: Any, n: int | None) -> float | None:
    if shift is None:
        return None
    if isinstance(shift, bool) or not isinstance(shift, int | float | np.number) or not 0.0 <= shift <= LARGEST:
        raise ModelError(f"shift must be a frequency in Hz, zero or positive, got {shown(shift)}")
    if n is None:
        raise ModelError("shift= asks for the modes nearest to a frequency: say how many with n=")
    return float(shift)


def _nearest(r: dict[str, Any], n: int, shift: float) -> dict[str, Any]:
    """All results with the n modes nearest to a frequency first, in ascending order."""
    distance = np.abs(np.abs(r["eigenvalue"]) ** 2 - (2.0 * math.pi * shift) ** 2)
    near = np.argsort(distance, kind="stable")
    order = np.concatenate([np.sort(near[:n]), np.sort(near[n:])])
    place = np.argsort(order)
    out = dict(r)
    for key in ("eigenvalue", "partner", "backward_error", "condition", "error", "near_defective", "kind"):
        out[key] = np.asarray(r[key])[order]
    for key in ("shape", "left"):
        out[key] = None if r[key] is None else r[key][:, order]
    out["partner_mode"] = place[r["partner_mode"]]
    # members stay neighbours, except where the choice has cut a group
    out["groups"] = [(int(np.min(place[a : a + count])), count) for a, count in r["groups"]]
    return out


def _sparse(system: Any, n: int | None, effects: tuple[str, ...], shift: float | None, start: float) -> ModalResult:
    try:
        return sparse_modes(system, n, effects, shift, start)
    except ConvergenceError as problem:
        size = system.M.shape[0]
        general = system.C is not None or system.G is not None or system.N is not None
        if size > DENSE_INSTEAD or not general:
            raise ConvergenceError(f"modes of {size} coordinates: {problem}", problem.result) from None
    found = _dense(system, n, effects, None, shift, start)
    route = f"{found.stats.route} (dense: the sparse route did not converge)"
    return found.replaced(stats=replace(found.stats, route=route))


def _dense(
    system: Any, n: int | None, effects: tuple[str, ...], factor: Any, shift: float | None, start: float
) -> ModalResult:
    f = None if factor is None else _matrix("stiffness_factor", factor)
    if system.states is not None:
        with core_errors():
            r = relaxing_modes(system.extended, system.states)
        r["error"] = r["error"] + _dropped_by_means(system, r)
        return modal_result(system, r if shift is None or n is None else _nearest(r, n, shift), n, effects, start)
    try:
        with core_errors(), call_progress(f"modes of {system.n} coordinates", 100.0 * float(system.n) ** 3):
            r, mf = _with_its_masses(system, f)
            f = _factor_for(system, r) if f is None else None
            if f is not None:
                r = system.core.modes(f, mf)
    except SingularError as problem:
        names = tuple(system.coordinates)
        text = re.sub(r"\{coordinate (\d+)\}", lambda hit: f"coordinate {names[int(hit[1])]!r}", str(problem))
        raise SingularError(text) from None
    r["error"] = r["error"] + _rounding_of_places(system, r) + _dropped_by_means(system, r)
    if shift is not None and n is not None:
        r = _nearest(r, n, shift)
    return modal_result(system, r, n, effects, start)


def _rounding_of_places(system: Any, r: dict[str, Any]) -> np.ndarray:
    """Relative error of each root by the rounding of places that a model is drawn with, which its M and K inherit."""
    if not isinstance(system, Linearization):
        return np.zeros(len(r["error"]))
    place = np.finfo(float).eps * system.snapshot.system.remoteness(system.state.q)
    return np.where(np.isnan(r["condition"]), 0.0, place * r["condition"])


def _dropped_by_means(system: Any, r: dict[str, Any]) -> np.ndarray | float:
    """Relative change of each root by the parts that matrices averaged over a turn leave out."""
    turn = system.over_turn if isinstance(system, Linearization) else None
    return 0.0 if turn is None else turn.left_out(np.asarray(r["eigenvalue"]))


def _with_its_masses(system: Any, f: np.ndarray | None) -> tuple[dict[str, Any], np.ndarray | None]:
    """Modes, and the factor of M that they need where light bodies are lost beside heavy ones in M itself."""
    mf = system.mass_factor if isinstance(system, Linearization) and system.core.is_light() else None
    return system.core.modes(f, mf), mf


def _factor_for(system: Any, r: dict[str, Any]) -> np.ndarray | None:
    """A model's own factor of K, where assembled matrices have lost digits of soft modes or hide them among the rigid ones."""
    if r["route"] not in ("undamped", "proportional") or not hasattr(system, "snapshot"):
        return None
    if not r["blurred"] and "rigid" not in r["kind"]:
        return None
    rigid = np.array(r["kind"]) == "rigid"
    factor = stiffness_factor(system)
    if factor is None or r["blurred"]:
        return factor
    return factor if system.core.is_strained(factor, r["shape"][:, rigid].real) else None


def _matrix(name: str, a: Any) -> np.ndarray:
    return real_array(name, a, ("m", "n"), "give a matrix with one column for each coordinate")
