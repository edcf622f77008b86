"""Types of the arguments of flexible bodies."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from .._lib.aliases import HasValue, Matrix

__all__ = ["Along", "Matrix"]

# A property along a beam: a number or values at the stations, or parameters in their place.
Along = ArrayLike | HasValue | Sequence[HasValue | float]
