"""Types of arguments that every folder knows."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike


class Sparse(Protocol):
    """A sparse matrix of SciPy."""

    def toarray(self) -> np.ndarray:
        """The matrix with its zeros."""


class HasValue(Protocol):
    """A parameter, or an expression of parameters."""

    @property
    def value(self) -> float:
        """The number now."""


Matrix = ArrayLike | Sparse
