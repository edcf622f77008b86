"""Shared by all harmonic-balance analyses: checked arguments of users as arrays for the core."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, cast

import numpy as np

from .. import _core
from .._lib import checks
from .._lib.border import core_errors, require_memory
from .._lib.checks import shown
from ..errors import ModelError, SingularError
from ..model.function_law import FunctionLaw
from ..model.law import Law
from . import condensation
from .options import Fourier

NONSMOOTH_SAMPLES = 512
# of laws whose state has a rate: it is integrated from sample to sample with order four
STATE_SAMPLES = 2048
LARGEST_SAMPLE = 1 << 18
MOST_SAMPLES = 16384
ALIASED = 0.5  # part of the error from which on more samples pay
# aliasing, relative to the solution, that does not count where no tolerance was given: too large, friction and contact curves are
# rough; too small, every point takes all the samples there are (tests/nonlinear/test_hbm_sampling.py)
NEGLIGIBLE = 1e-4
# growth over the frequency up to which a motion counts as stable: larger, slow growth passes; smaller, motions that neither grow nor decay
# are called unstable by rounding
NEUTRAL = 1e-9
# step of the differences by the parameter of a family, over its range: larger, a curve that bends is followed with more corrections;
# smaller, rounding of the family turns the tangent (tests/nonlinear/test_hbm_parameter.py)
FAMILY_STEP = 1e-5
# smallest over largest singular value of the scaled equations at rest below which they are singular, free of units: too large,
# soft coordinates are called loose; too small, loose ones are not named (tests/truth/test_hbm_loose.py)
SINGULAR = 1e-12


@dataclass(frozen=True)
class Family:
    """Systems that depend on a parameter: ``member(value)`` is system and force, made first at ``value`` of a range of length
    ``span``."""

    member: Callable[[float], Any]
    value: float
    span: float


@dataclass(frozen=True)
class Setup:
    """A problem of the core with what is needed to read its answers; ``fourier`` has the harmonics and samples that were taken."""

    system: Any
    force: Any
    fourier: Fourier
    omega: float
    core: Any
    linear: condensation.Linear
    turn: bool = True
    family: Family | None = field(default=None, repr=False)

    def __reduce__(self) -> Any:
        # the core's object does not travel; it is made again
        if self.family is None:
            return prepare, (self.system, self.force, self.fourier, self.omega, self.turn)
        return prepare_family, (self.family.member, self.family.value, self.family.span, self.fourier, self.omega)

    @property
    def harmonics(self) -> tuple[int, ...]:
        """The harmonics of omega / subharmonic that are kept, ascending."""
        return self.fourier.terms

    @property
    def subharmonic(self) -> int:
        return self.fourier.subharmonic

    @property
    def n_samples(self) -> int:
        """Samples per period."""
        return cast(int, self.fourier.n_samples)

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
        if value is not None and self.family is not None and self.linear.route != "full":
            system, force = self.family.member(value)
            there = prepare(system, force, self.fourier, self.omega, turn=False)
            return there.expand(y, omega, level)
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

    def exponents(
        self, y: np.ndarray, omega: float, error: float, free: bool = False
    ) -> tuple[np.ndarray | None, bool]:
        """Floquet exponents of a solution with the relative ``error``, None where they cannot be told, and whether the harmonics
        that were left out do not decide which of them grow; ``free``: a limit cycle."""
        told = call_core(self.core.floquet, y, [omega], error=error, free=free, model=self.model(omega))
        return told["exponents"], told["settled"]

    def estimate(self, y: np.ndarray, omega: float, level: float = 1.0, value: float | None = None) -> float:
        """Estimated relative error of a solution; ``value`` is that of the parameter on which the system depends."""
        at = ([omega], level, None if self.family is None else value)
        return float(call_core(self.core.estimate, y, at))

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


def path(
    parameter: str, begin: float, ends: tuple[float, float], towards: np.ndarray | None = None, across: bool = False
) -> dict[str, Any]:
    """Parameter, range and first direction of a branch of the core, by name."""
    start, stop = ends
    named = {"parameter": parameter, "begin": begin, "start": start, "stop": stop}
    return {**named, "towards": towards, "across": across}


def checked_guess(n: int, x0: Any) -> np.ndarray:
    """Coefficients (n, 2 h + 1) of a first guess: an array, or an earlier result."""
    given = checks.real_array("x0", getattr(x0, "X", x0))
    if given.ndim != 2 or given.shape[0] != n or given.shape[1] % 2 == 0:
        raise ModelError(f"x0 must be coefficients (dof, 2h+1) with dof = {n}, its shape is {given.shape}")
    return given


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


def prepare(
    system: Any, force: Any, fourier: Fourier, omega: float = 1.0, turn: bool = True, least_samples: int = 0
) -> Setup:
    """Checks everything and builds the core's problem; samples that are chosen are at least ``least_samples``. Without ``turn``
    the coordinates stay what they are, whatever the laws touch."""
    laws = checked_system(system)
    terms, subharmonic = fourier.terms, fourier.subharmonic
    forces = _force_terms(system.n, force, terms, subharmonic)
    n = checked_samples(cast("int | None", fourier.n_samples), laws, terms, subharmonic)
    if fourier.n_samples is None:
        n = max(n, least_samples)
    top = min(2 * terms[-1] + 1, terms[-1] + 6)  # the estimate looks at this many
    extra = [[h] for h in range(1, top + 1) if h not in terms]
    fine = max(2 * n, needed_samples(laws, (top,), subharmonic))
    linear = condensation.linear_part(system, laws, forces, 2 * len(terms) + 1, fourier.condense, turn)
    elements = core_elements(laws, linear.directions)
    indices = [[h] for h in terms]
    core = call_core(_core.HbmProblem, linear.core, elements, indices, subharmonic, [omega], [n], extra, [fine])
    return Setup(system, force, fourier.but(harmonics=terms, n_samples=n), omega, core, linear, turn)


def prepare_family(
    member: Callable[[float], Any],
    value: float,
    span: float,
    fourier: Fourier,
    omega: float = 1.0,
    least_samples: int = 0,
) -> Setup:
    """The problem of a system that depends on a parameter: ``member(value)`` returns system and force, ``span`` is the length
    of the range of values."""
    system, force = member(value)
    setup = prepare(system, force, fourier, omega, turn=False, least_samples=least_samples)
    terms = setup.harmonics

    def made(p: float) -> tuple[Any, Any]:
        system, force = member(p)
        laws = checked_system(system)
        forces = _force_terms(system.n, force, terms, setup.subharmonic)
        linear = condensation.linear_part(system, laws, forces, setup.n_c, fourier.condense, turn=False)
        return linear.core, core_elements(laws, linear.directions)

    setup.core.with_family(made, value, FAMILY_STEP * span)
    return replace(setup, family=Family(member, value, span))


def without_samples(law: Law) -> bool:
    """True where samples cause no error of a law's force: polynomials do not alias, and sharp contacts are integrated exactly."""
    return law.kind.polynomial or (law.kind.name == "Gap" and law.numbers()[2] == 0.0)


def more_samples(n: int, error: float, aliasing: float, laws: Sequence[Law], fourier: Fourier) -> int | None:
    """Double the number of samples if aliasing dominates the error and counts beside the tolerance, else None; None where the
    number was given."""
    known = fourier.n_samples is not None or all(without_samples(law) for law in laws)
    if known or 2 * n > MOST_SAMPLES or aliasing <= max(ALIASED * error, _negligible(fourier)):
        return None
    return 2 * n


def _negligible(fourier: Fourier) -> float:
    """Aliasing that does not count: a tenth of the tolerance, `NEGLIGIBLE` where none was given."""
    return fourier.limit() / 10 if fourier.automatic or fourier.tol is not None else NEGLIGIBLE


def checked_system(system: Any) -> tuple[Law, ...]:
    """The laws of the system's elements, their directions checked against its size."""
    if not all(hasattr(system, name) for name in ("M", "C", "K", "n", "elements")):
        raise ModelError(
            f"harmonic balance needs a MechanicalSystem (M, C, K and elements), it got a {type(system).__name__}"
        )
    for i, law in enumerate(system.elements):
        if not isinstance(law, Law):
            raise ModelError(f"elements[{i}] must be a law such as mb.Cubic(k3, w=[...]), it is {shown(law)}")
        if law.w is None:
            raise ModelError(f"elements[{i}], {law!r}, has no direction; give w (n,) with u = w . x")
        entries = law.directions.shape[1]
        if entries != system.n:
            raise ModelError(f"elements[{i}], {law!r}: w has {entries} entries but the system {system.n} coordinates")
        numbers = law.numbers()
        if not np.all(np.isfinite(numbers)):
            raise ModelError(f"elements[{i}], {law!r}: its numbers are {numbers}; all must be finite")
    return tuple(system.elements)


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
    # forces, motion and residual
    size = 3.0 * 16.0 * (len(terms) + 1) * n
    require_memory(size, f"{len(terms)} harmonics of {n} coordinates", "take fewer harmonics, or reduce the system")
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
    return checks.complex_array(f"force of harmonic {h}", vector, (n,), "give one number for each coordinate")


class CoreElement(NamedTuple):
    """An element as the core reads it: a law by code and numbers, or by a function, with its states at rest and, for each of its
    coordinates, index and weight of the direction."""

    code: int
    numbers: list[float]
    function: Any
    start: list[float]
    directions: list[tuple[list[int], list[float]]]


def core_elements(laws: Sequence[Law], directions: Sequence[np.ndarray]) -> Any:
    """Laws, and the directions of the coordinates of one after the other, as the core wants them."""
    rest = iter(directions)
    parts = []
    for i, law in enumerate(laws):
        function, numbers = law.body(f"elements[{i}]") if isinstance(law, FunctionLaw) else (None, law.numbers())
        own = [next(rest) for _ in law.directions]
        touched = [np.flatnonzero(w) for w in own]
        sparse = [(index.tolist(), w[index].tolist()) for w, index in zip(own, touched, strict=True)]
        parts.append(CoreElement(law.code, numbers, function, list(law.start), sparse))
    return call_core(_core.HbmElements, parts)


def one_frequency(omega: Any, frequency: Any) -> Any:
    """omega in rad/s from exactly one of the two keywords; scalars and sequences pass unchanged otherwise."""
    if (omega is None) == (frequency is None):
        raise ModelError("give exactly one of omega (rad/s) and frequency (Hz)")
    value = omega if frequency is None else frequency
    name = "omega" if frequency is None else "frequency"
    array = checks.real_array(name, value, None, "give positive numbers")
    if array.size == 0 or np.any(array <= 0):
        raise ModelError(f"{name} must be positive, it is {checks.shown(value)}")
    if np.any(array > checks.LARGEST) or np.any(array < 1 / checks.LARGEST):
        raise ModelError(f"{name} = {checks.shown(value)} is beyond what can be squared; choose other units")
    return array if frequency is None else 2 * np.pi * array
