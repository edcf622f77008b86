"""Options and range of a branch of periodic solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from .._lib import checks
from ..errors import ModelError
from . import balance

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from ..linear.aliases import Coefficients, Force, Ports
    from ..system.state import StateLike


class BranchOptions(TypedDict, total=False):
    """Options of every function that follows a branch; `frequency_response` explains them, `Branch` has the defaults."""

    force: Force | Callable[..., Any] | None
    inputs: Ports | Mapping[int, Ports] | None
    amplitude: ArrayLike | Callable[[float], Any] | None
    omega: float | tuple[float, float] | None
    frequency: float | tuple[float, float] | None
    level: float | tuple[float, float]
    harmonics: int | str | Sequence[int]
    n_samples: int | None
    subharmonic: int
    condense: bool | str
    x0: Coefficients | None
    tol: float | None
    predictor: str
    corrector: str
    step: float
    min_step: float
    max_step: float
    tolerance: float
    stability: bool
    events: bool
    at: StateLike
    without: Sequence[str]


def first_set(force: Any) -> int:
    """Harmonics to begin with: those of the forces at least."""
    given = [h for h in force if isinstance(h, int)] if isinstance(force, dict) else []
    return max([3, *given])


def one_of_each(w: np.ndarray, level: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Frequency and level of a branch in a value, each as a range of one number."""
    if w.ndim != 0:
        raise ModelError("a branch in a parameter of the system works at one frequency")
    return (float(w), float(w)), (balance.checked_level(level), balance.checked_level(level))


def range_and_level(w: np.ndarray, level: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Ranges of frequency and level, one of which is a single number."""
    levels = checks.real_array("level", level)
    if w.shape == (2,) and levels.shape == ():
        if w[0] == w[1]:
            raise ModelError(f"the range of frequencies is empty: {w[0]} to {w[1]}")
        return (float(w[0]), float(w[1])), (float(levels), float(levels))
    if w.shape == () and levels.shape == (2,):
        if levels[0] == levels[1]:
            raise ModelError(f"the range of levels is empty: {levels[0]} to {levels[1]}")
        return (float(w), float(w)), (float(levels[0]), float(levels[1]))
    raise ModelError("a branch needs one range: omega=(a, b) with one level, or one omega with level=(a, b)")
