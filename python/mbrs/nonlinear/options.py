"""Options of harmonic balance in three groups, each checked when it is made: terms of the solution (`Fourier`), Newton's method
(`Newton`), steps along a branch (`Continuation`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._lib import checks
from ..errors import ModelError
from ..results import LARGEST_ERROR

# "lagrange" is of order 3
PREDICTORS = ("tangent", "secant", "lagrange", *(f"lagrange{order}" for order in range(1, 6)))
CORRECTORS = ("pseudo-arclength", "arclength", "moore-penrose")
HIGHEST = 4096  # harmonics, and their subharmonics; more would not fit into dense equations
MOST_HARMONICS = 255  # up to which "auto" adds harmonics
# Largest error that is called resolved where none was given, and with harmonics="auto". Larger: truncated series pass as solutions.
# Smaller: rough laws never converge, and "auto" takes more harmonics than anyone needs. Pinned by tests/nonlinear/test_hbm_honest.py.
UNRESOLVED = LARGEST_ERROR
AUTOMATIC = 1e-6
# Step along a branch that is certainly a mistake: the whole curve has about the length 1.
LARGEST_STEP = 10.0
# of a branch: beyond, they hardly fit into memory
MOST_POINTS = 10_000_000


@dataclass(frozen=True)
class Fourier:
    """Terms of a solution and the samples by which laws are transformed; `mbrs.harmonic_balance` explains them."""

    harmonics: int | str | Sequence[int] = 7
    n_samples: int | Sequence[int] | None = None
    subharmonic: int = 1
    condense: bool | str = "auto"
    tol: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.harmonics, str) and self.harmonics != "auto":
            raise ModelError(f'harmonics must be a number, a sequence or "auto", it is {checks.shown(self.harmonics)}')
        checks.count("subharmonic", self.subharmonic, HIGHEST)
        if self.tol is not None:
            checks.positive("tol", self.tol)

    @property
    def automatic(self) -> bool:
        """True if harmonics are added until ``tol`` is met."""
        return isinstance(self.harmonics, str)

    def limit(self, usual: float = UNRESOLVED) -> float:
        """Largest error that is called resolved; ``usual`` where harmonics are chosen and no ``tol`` was given."""
        if self.tol is not None:
            return float(self.tol)
        return AUTOMATIC if self.automatic else usual

    def chosen(self, harmonics: int | Sequence[int], **changes: Any) -> Fourier:
        """The same with harmonics that were chosen in place of "auto", whose tolerance stays."""
        return self.but(harmonics=harmonics, tol=self.limit() if self.automatic else self.tol, **changes)

    @property
    def terms(self) -> tuple[int, ...]:
        """The harmonics of omega / subharmonic that are kept, ascending."""
        return checked_harmonics(self.harmonics, self.subharmonic)

    def but(self, **changes: Any) -> Fourier:
        """The same with other values of some options."""
        return replace(self, **changes)


@dataclass(frozen=True)
class Newton:
    """Newton's method: largest last step relative to the coefficients of a coordinate, and most iterations."""

    tolerance: float = 1e-10
    max_iterations: int = 60

    def __post_init__(self) -> None:
        if checks.positive("tolerance", self.tolerance) >= 1.0:
            raise ModelError(
                f"tolerance = {self.tolerance} is of the last step relative to the solution; it must be below 1"
            )
        checks.count("max_iterations", self.max_iterations, 100_000)

    @property
    def core(self) -> dict[str, Any]:
        """Arguments of the core."""
        return dict(tolerance=float(self.tolerance), max_iterations=int(self.max_iterations))


@dataclass(frozen=True)
class Continuation:
    """Steps along a branch; `mbrs.frequency_response` explains them."""

    predictor: str = "tangent"
    corrector: str = "pseudo-arclength"
    step: float = 0.01
    min_step: float = 1e-9
    max_step: float = 0.1
    tolerance: float = 1e-9
    stability: bool = True
    events: bool = True

    def __post_init__(self) -> None:
        checks.choice("predictor", self.predictor, PREDICTORS)
        checks.choice("corrector", self.corrector, CORRECTORS)
        first, least, largest = (checks.positive(n, getattr(self, n)) for n in ("step", "min_step", "max_step"))
        if not least <= first <= largest:
            raise ModelError(f"min_step <= step <= max_step must hold, they are {least}, {first}, {largest}")
        if largest > LARGEST_STEP:
            raise ModelError(
                f"max_step = {largest:g} is larger than the whole curve, which has about the length 1; take 0.1"
            )
        checks.positive("tolerance", self.tolerance)
        for name in ("stability", "events"):
            checks.flag(name, getattr(self, name))

    @property
    def core(self) -> dict[str, Any]:
        """Arguments of the core."""
        return dict(
            predictor=self.predictor,
            corrector=self.corrector,
            first_step=float(self.step),
            least_step=float(self.min_step),
            largest_step=float(self.max_step),
            tolerance=float(self.tolerance),
            stability=bool(self.stability),
            events=bool(self.events),
        )


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


def points(value: Any, least: int = 1) -> int:
    """``max_points``, checked."""
    return checks.count("max_points", value, MOST_POINTS, least)


def point_number(value: Any, n: int) -> int:
    """The number of one of n points, of which -1 is the last."""
    return checks.count("the number of a point", value, n - 1, -n) % n


def integer(name: str, value: Any) -> int:
    """A positive integer, or `ModelError`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ModelError(
            f"{name} must be positive integers, not {checks.shown(value)}; the constant term is always kept"
        )
    return int(value)
