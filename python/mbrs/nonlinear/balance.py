"""Shared by all harmonic-balance analyses: checked arguments of users as arrays for the core."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .. import _core
from .._lib import checks
from .._lib.border import core_errors
from ..errors import ModelError, SingularError
from ..model.laws import FunctionLaw, Law
from . import condensation

NONSMOOTH_SAMPLES = 512
# of laws whose state has a rate: it is integrated from sample to sample with order four
STATE_SAMPLES = 2048
HIGHEST = 4096  # harmonics, and their subharmonics; more would not fit into dense equations
LARGEST_SAMPLE = 1 << 18
MOST_SAMPLES = 16384
MOST_HARMONICS = 255
ALIASED = 0.5  # part of the error from which on more samples pay
# aliasing, relative to the solution, that does not count where no tolerance was given: too large, friction and contact curves are
# rough; too small, every point takes all the samples there are (tests/nonlinear/test_hbm_sampling.py)
NEGLIGIBLE = 1e-4
# smallest over largest singular value of the scaled equations at rest below which they are singular, free of units: too large,
# soft coordinates are called loose; too small, loose ones are not named (tests/truth/test_hbm_loose.py)
SINGULAR = 1e-12


@dataclass(frozen=True)
class Setup:
    """A problem of the core with what is needed to read its answers."""

    system: Any
    harmonics: tuple[int, ...]
    subharmonic: int
    n_samples: int
    core: Any
    linear: condensation.Linear
    arguments: tuple[Any, ...] = ()
    member: Callable[[float], Any] | None = field(default=None, repr=False)

    def __reduce__(self) -> Any:
        # the core's object does not travel; it is made again
        return (prepare, self.arguments) if self.member is None else (of_family, self.arguments)

    @property
    def n_c(self) -> int:
        return 2 * len(self.harmonics) + 1

    @property
    def route(self) -> str:
        """Treatment of the linear part, in words."""
        return self.linear.route

    def expand(self, y: np.ndarray, omega: float, level: float = 1.0, value: float | None = None) -> np.ndarray:
        """Coefficients (dof, 2 H + 1) of all coordinates for a vector of the core's unknowns; ``value`` is that of the
        parameter on which the system depends."""
        if value is not None and self.member is not None and self.linear.route != "full":
            system, force = self.member(value)
            _, _, _, terms, given = self.arguments
            return prepare(system, force, terms, turn=False, **given).expand(y, omega, level)
        X = call_core(self.core.expand, y, [omega], level)
        X = X if self.linear.transform is None else self.linear.transform @ X
        if not np.all(np.isfinite(X)):
            loose = int(np.flatnonzero(~np.all(np.isfinite(X), axis=1))[0])
            raise SingularError(f"{coordinate_name(self.system, loose)} is not determined: nothing restrains it")
        return self.padded(X)

    def loose_coordinate(self, omega: float) -> str:
        """Name of the coordinate that moves most in the direction in which the equations at rest are singular, or ""."""
        size = self.core.size
        at = call_core(self.core.residual, np.zeros(size), [omega])["jacobian"]
        if not np.all(np.isfinite(at)):
            return ""
        row = np.max(np.abs(at), axis=1)
        scaled = at / np.where(row > 0, row, 1.0)[:, None]
        column = np.max(np.abs(scaled), axis=0)
        scaled = scaled / np.where(column > 0, column, 1.0)[None, :]
        _, values, right = np.linalg.svd(scaled)
        if values[-1] > SINGULAR * values[0]:
            return ""
        y = right[-1] / np.where(column > 0, column, 1.0)
        retained = np.asarray(self.linear.core.retained)
        moves = np.max(np.abs(y.reshape(self.n_c, len(retained))), axis=0)
        if self.linear.transform is not None:
            return ""
        return coordinate_name(self.system, int(retained[np.argmax(moves)]))

    def model(self, omega: float) -> tuple[np.ndarray, ...] | None:
        """The reduced model that tells the stability of a large system up to the frequency ``omega``."""
        return self.linear.stability_model((self.harmonics[-1] + 1) * omega / self.subharmonic)

    def exponents(self, y: np.ndarray, omega: float) -> np.ndarray | None:
        """Floquet exponents of a solution, or None where they cannot be told."""
        return call_core(self.core.floquet, y, [omega], model=self.model(omega))[0]

    def peak(
        self,
        y: np.ndarray,
        omega: float,
        level: float,
        weights: np.ndarray,
        harmonic: int | None,
        towards: np.ndarray | None,
    ) -> tuple[float, Any]:
        """(omega, y) of the largest amplitude of weights . x near y; ``towards`` is a step along the branch."""
        if self.linear.transform is not None:
            weights = self.linear.transform.T @ weights
        if harmonic is not None and harmonic not in (0, *self.harmonics):
            raise ModelError(f"harmonic {harmonic} is not among those of the curve")
        term = harmonic and self.harmonics.index(harmonic) + 1
        return call_core(self.core.peak, y, omega, level, np.ascontiguousarray(weights), term, towards)

    def padded(self, X: np.ndarray) -> np.ndarray:
        """Coefficients of the chosen harmonics (dof, n_c) with zeros for those left out, (dof, 2 H + 1)."""
        top = self.harmonics[-1]
        if len(self.harmonics) == top:
            return X
        out = np.zeros((X.shape[0], 2 * top + 1))
        out[:, 0] = X[:, 0]
        for j, h in enumerate(self.harmonics):
            out[:, 2 * h - 1 : 2 * h + 1] = X[:, 2 * j + 1 : 2 * j + 3]
        return out

    def start(self, x0: Any) -> np.ndarray:
        """The unknowns of the core for a first guess: None, coefficients (dof, 2 h + 1), or an earlier result."""
        X = np.zeros((self.system.n, self.n_c))
        if x0 is not None:
            given = checked_guess(self.system.n, x0)
            X[:, 0] = given[:, 0]
            for j, h in enumerate(self.harmonics):
                if 2 * h < given.shape[1]:
                    X[:, 2 * j + 1 : 2 * j + 3] = given[:, 2 * h - 1 : 2 * h + 1]
        T = self.linear.transform
        return self.core.restrict(X if T is None else T.T @ X)


def coordinate_name(system: Any, i: int) -> str:
    """Name of a coordinate in messages."""
    names = getattr(system, "coordinates", None)
    return f"coordinate {i}" if names is None else f"coordinate {str(names[i])!r}"


def call_core(call: Any, *args: Any, **kwargs: Any) -> Any:
    """Call a function of the core; its errors come out as those of `mbrs.errors`."""
    with core_errors():
        return call(*args, **kwargs)


def checked_guess(n: int, x0: Any) -> np.ndarray:
    """Coefficients (n, 2 h + 1) of a first guess: an array, or an earlier result."""
    given = checks.real_array("x0", getattr(x0, "X", x0))
    if given.ndim != 2 or given.shape[0] != n or given.shape[1] % 2 == 0:
        raise ModelError(f"x0 must be coefficients (dof, 2h+1) with dof = {n}, its shape is {given.shape}")
    return given


def steps(step: Any, least: Any, largest: Any) -> tuple[float, float, float]:
    """First, least and largest step of a continuation, checked."""
    first, low, high = (positive(n, v) for n, v in (("step", step), ("min_step", least), ("max_step", largest)))
    if not low <= first <= high:
        raise ModelError(f"min_step <= step <= max_step must hold, they are {low}, {first}, {high}")
    if high > 10.0:
        raise ModelError(f"max_step = {high:g} is larger than the whole curve, which has about the length 1; take 0.1")
    return first, low, high


def newton(tolerance: Any, max_iterations: Any) -> dict[str, Any]:
    """The options of Newton's method, checked."""
    if positive("tolerance", tolerance) >= 1.0:
        raise ModelError(f"tolerance = {tolerance} is of the last step relative to the solution; it must be below 1")
    return dict(
        tolerance=positive("tolerance", tolerance),
        max_iterations=checks.count("max_iterations", max_iterations, 100_000),
    )


def checked_level(level: Any) -> float:
    """A finite factor on the forces."""
    known = isinstance(level, int | float | np.integer | np.floating) and not isinstance(level, bool)
    if not known or not abs(level) <= checks.LARGEST:
        raise ModelError(f"level must be a finite number, it is {checks.shown(level)}")
    return float(level)


def scaled_force(force: Any, level: float) -> Any:
    """The same forces with another level; the static part stays."""
    if level == 1.0:
        return force
    given = dict(force) if isinstance(force, Mapping) else {1: force}
    return {h: np.asarray(f) * (level if h != 0 else 1.0) for h, f in given.items()}


def positive(name: str, value: Any) -> float:
    """A positive finite number, or `ModelError`."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0 < value < np.inf:
        raise ModelError(f"{name} must be a positive number, it is {checks.shown(value)}")
    return float(value)


def prepare(
    system: Any,
    force: Any,
    harmonics: Any,
    subharmonic: int = 1,
    n_samples: int | None = None,
    omega: float = 1.0,
    condense: bool | str = "auto",
    turn: bool = True,
    least_samples: int = 0,
) -> Setup:
    """Checks everything and builds the core's problem; samples that are chosen are at least ``least_samples``."""
    laws = checked_system(system)
    subharmonic = checks.count("subharmonic", subharmonic, HIGHEST)
    terms = checked_harmonics(harmonics, subharmonic)
    forces = _force_terms(system.n, force, terms, subharmonic)
    n = checked_samples(n_samples, laws, terms, subharmonic)
    if n_samples is None:
        n = max(n, least_samples)
    top = min(2 * terms[-1] + 1, terms[-1] + 6)  # the estimate looks at this many
    extra = [[h] for h in range(1, top + 1) if h not in terms]
    fine = max(2 * n, needed_samples(laws, (top,), subharmonic))
    linear = condensation.linear_part(system, laws, forces, 2 * len(terms) + 1, condense, turn)
    elements = core_elements(laws, linear.directions)
    indices = [[h] for h in terms]
    core = call_core(_core.HbmProblem, linear.core, elements, indices, subharmonic, [omega], [n], extra, [fine])
    arguments = (system, force, terms, subharmonic, n, omega, condense, turn)
    return Setup(system, terms, subharmonic, n, core, linear, arguments)


def of_family(
    member: Callable[[float], Any], value: float, span: float, harmonics: Any, given: Mapping[str, Any]
) -> Setup:
    """The problem of a system that depends on a parameter: ``member(value)`` returns system and force; ``given`` are options
    of `prepare`."""
    system, force = member(value)
    setup = prepare(system, force, harmonics, turn=False, **given)
    _, _, terms, subharmonic, _, _, condense, _ = setup.arguments

    def made(p: float) -> tuple[Any, Any]:
        system, force = member(p)
        laws = checked_system(system)
        forces = _force_terms(system.n, force, terms, subharmonic)
        linear = condensation.linear_part(system, laws, forces, 2 * len(terms) + 1, condense, turn=False)
        return linear.core, core_elements(laws, linear.directions)

    setup.core.with_family(made, value, 1e-5 * span)
    return replace(setup, member=member, arguments=(member, value, span, terms, dict(given)))


def more_samples(
    n: int, error: float, aliasing: float, laws: Sequence[Law], given: Any, tol: float | None
) -> int | None:
    """Double the number of samples if aliasing dominates the error and counts beside ``tol``, else None; None where the number
    was given."""
    least = negligible(tol)
    known = given is not None or all(law.kind.polynomial for law in laws)
    if known or 2 * n > MOST_SAMPLES or aliasing <= max(ALIASED * error, least):
        return None
    return 2 * n


def negligible(tol: float | None) -> float:
    """Aliasing that does not count: a tenth of the tolerance, `NEGLIGIBLE` where none was given."""
    return NEGLIGIBLE if tol is None else tol / 10


def checked_system(system: Any) -> tuple[Law, ...]:
    """The laws of the system's elements, their directions checked against its size."""
    if not all(hasattr(system, name) for name in ("M", "C", "K", "n", "elements")):
        raise ModelError(
            f"harmonic balance needs a MechanicalSystem (M, C, K and elements), it got a {type(system).__name__}"
        )
    for i, law in enumerate(system.elements):
        if not isinstance(law, Law):
            raise ModelError(f"elements[{i}] must be a law such as mb.Cubic(k3, w=[...]), it is {law!r}")
        if law.w is None:
            raise ModelError(f"elements[{i}], {law!r}, has no direction; give w (n,) with u = w . x")
        if law.w.size != system.n:
            raise ModelError(
                f"elements[{i}], {law!r}: w has {law.w.size} entries but the system {system.n} coordinates"
            )
        numbers = law.numbers()
        if not np.all(np.isfinite(numbers)):
            raise ModelError(f"elements[{i}], {law!r}: its numbers are {numbers}; all must be finite")
    return tuple(system.elements)


def checked_harmonics(harmonics: Any, subharmonic: int) -> tuple[int, ...]:
    """The harmonics of omega / subharmonic that are kept, ascending."""
    if isinstance(harmonics, int | np.integer) and not isinstance(harmonics, bool):
        if harmonics < 1:
            raise ModelError(f"harmonics must be at least 1, it is {harmonics}")
        _bounded(int(harmonics) * subharmonic)
        return tuple(range(1, int(harmonics) * subharmonic + 1))
    if isinstance(harmonics, str) or not isinstance(harmonics, Sequence | np.ndarray) or np.size(harmonics) == 0:
        given = checks.shown(harmonics)
        raise ModelError(f"harmonics must be a number or a sequence of positive integers, it is {given}")
    terms = [integer("harmonics", h) for h in np.atleast_1d(np.asarray(harmonics, dtype=object))]
    _bounded(max(terms))
    if len(set(terms)) != len(terms):
        raise ModelError(f"harmonics are given twice: {terms}")
    return tuple(sorted(terms))


def _bounded(top: int) -> None:
    if top > HIGHEST:
        raise ModelError(
            f"harmonics up to {checks.shown(top)} (of the excitation frequency over subharmonic) are too many; "
            f"take at most {HIGHEST}, or a sequence of those that matter"
        )


def integer(name: str, value: Any) -> int:
    """A positive integer, or `ModelError`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ModelError(
            f"{name} must be positive integers, not {checks.shown(value)}; the constant term is always kept"
        )
    return int(value)


def whole(name: str, value: Any) -> int:
    """An integer from 0 on, or `ModelError`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise ModelError(f"{name} must be an integer from 0 on, it is {checks.shown(value)}")
    return int(value)


def needed_samples(laws: Sequence[Law], terms: Sequence[int], subharmonic: int) -> int:
    """Samples per period without aliasing into the kept terms, (p + 1) H + 1 for a law of degree p, as a fast FFT
    size."""
    least = max([2 * terms[-1] + 2, *(alias_free(law, terms[-1], subharmonic) for law in laws)])
    return fast_size(least)


def alias_free(law: Law, top: int, subharmonic: int) -> int:
    """Least number of samples for one law."""
    match law.kind.name:
        case "Cubic" | "VanDerPol":
            return 4 * top + 1
        case "Polynomial1D":
            return len(law.values) // (2 if law.uses_rate else 1) * top + 1
        case _ if law.kind.state == "rate":
            return max(STATE_SAMPLES, 32 * top)
        case "VaryingStiffness":
            return 2 * top + int(law.values[1]) * subharmonic + 1
        case _:
            return max(NONSMOOTH_SAMPLES, 16 * top)


def checked_samples(n_samples: int | None, laws: Sequence[Law], terms: Sequence[int], subharmonic: int) -> int:
    """The number of samples: chosen, or what the user said if that does not alias polynomial laws."""
    if n_samples is None:
        return needed_samples(laws, terms, subharmonic)
    n = checks.count("n_samples", n_samples, LARGEST_SAMPLE)
    polynomial = [law for law in laws if law.kind.polynomial]
    least = max([2 * terms[-1] + 1, *(alias_free(law, terms[-1], subharmonic) for law in polynomial)])
    if n < least:
        raise ModelError(f"n_samples = {n} aliases harmonics up to {terms[-1]}; use at least {least}, or leave it out")
    return n


def fast_size(least: int) -> int:
    """The smallest 2^k or 3 2^k that is not below ``least``."""
    power = 1 << max(least - 1, 1).bit_length()
    return 3 * power // 4 if 3 * power // 4 >= least else power


def _force_terms(n: int, force: Any, terms: tuple[int, ...], subharmonic: int) -> np.ndarray:
    """Complex amplitudes (n_terms + 1, n), the constant first; keys are harmonics of omega, so term h subharmonic."""
    if callable(force):
        raise ModelError(
            "a force given as a function of time has one period: mb.harmonic_balance takes it; give {harmonic: (n,)}"
        )
    given = dict(force) if isinstance(force, Mapping) else {1: force}
    out = np.zeros((len(terms) + 1, n), complex)
    for h, vector in given.items():
        if isinstance(h, bool) or not isinstance(h, int | np.integer) or h < 0:
            raise ModelError(f"force: harmonics must be integers from 0 (static) on, not {h!r}")
        f = force_vector(n, vector, int(h))
        if h == 0:
            if np.any(f.imag != 0):
                raise ModelError("force: the static part (harmonic 0) must be real")
            out[0] = f
        elif h * subharmonic not in terms:
            if np.any(f != 0):
                raise ModelError(
                    f"force acts in harmonic {h}, which is not among the harmonics kept; add it to harmonics"
                )
        else:
            out[1 + terms.index(h * subharmonic)] = f
    return out


def force_vector(n: int, vector: Any, h: int) -> np.ndarray:
    """A complex force (n,) of one harmonic, checked."""
    if isinstance(vector, str | bytes) or vector is None:
        raise ModelError(f"force of harmonic {h} must be a vector (n,), it is {checks.shown(vector)}")
    f = checks.complex_array(f"force of harmonic {h}", vector)
    if f.shape != (n,):
        raise ModelError(f"force of harmonic {h} must have the shape ({n},), it has {f.shape}")
    return f


def core_elements(laws: Sequence[Law], directions: Sequence[np.ndarray]) -> Any:
    """Laws and sparse directions as the core wants them."""
    functions = [law.body(f"elements[{i}]") if isinstance(law, FunctionLaw) else None for i, law in enumerate(laws)]
    numbers = [law.numbers() if f is None else f[1] for law, f in zip(laws, functions, strict=True)]
    index = [np.flatnonzero(w) for w in directions]
    weight = [w[i] for w, i in zip(directions, index, strict=True)]
    start = np.concatenate([[0], np.cumsum([len(i) for i in index], dtype=int)])
    return _core.HbmElements(
        [law.code for law in laws],
        [len(v) for v in numbers],
        [x for v in numbers for x in v],
        [None if f is None else f[0] for f in functions],
        [int(i) for i in start],
        [int(i) for part in index for i in part],
        [float(x) for part in weight for x in part],
    )


def one_frequency(omega: Any, frequency: Any) -> Any:
    """omega in rad/s from exactly one of the two keywords; scalars and sequences pass unchanged otherwise."""
    if (omega is None) == (frequency is None):
        raise ModelError("give exactly one of omega (rad/s) and frequency (Hz)")
    value = omega if frequency is None else frequency
    name = "omega" if frequency is None else "frequency"
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ModelError(f"{name} must be real, it is {checks.shown(value)}") from None
    if array.size == 0 or not np.all(np.isfinite(array)) or np.any(array <= 0):
        raise ModelError(f"{name} must be positive and finite, it is {checks.shown(value)}")
    if np.any(array > checks.LARGEST) or np.any(array < 1 / checks.LARGEST):
        raise ModelError(f"{name} = {checks.shown(value)} is beyond what can be squared; choose other units")
    return array if frequency is None else 2 * np.pi * array
