"""Types of the arguments of analyses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._lib.aliases import Matrix, Sparse
from ..model.model import Model
from ..model.ports import Port, PortLike, Ports
from .linearization import Linearization
from .matrices import MechanicalSystem

__all__ = [
    "Coefficients",
    "Force",
    "Linear",
    "Load",
    "LoadCase",
    "Loads",
    "Matrix",
    "PortLike",
    "Ports",
    "Shapes",
    "Sparse",
]

# A model, linearised where it is drawn or at a given state; its linearisation; matrices.
Linear = Model | Linearization | MechanicalSystem
# A port, or several with their complex amplitudes.
LoadCase = PortLike | Mapping[Port | str, complex]
# Values at the times (n_t,), or a function of time in s.
Load = ArrayLike | Callable[[float], Any]
Loads = Mapping[Any, Load] | Sequence[tuple[PortLike, Load]]
# A vector (n,) on the first harmonic, or vectors by harmonic; complex for phases.
Force = ArrayLike | Mapping[int, ArrayLike]


class HasShapes(Protocol):
    """Modes, computed or measured."""

    @property
    def eigenvalue(self) -> np.ndarray:
        """Roots (n,), 1/s."""

    @property
    def shape(self) -> np.ndarray:
        """Shapes (dof, n) by column."""


class HasCoefficients(Protocol):
    """A periodic motion."""

    @property
    def X(self) -> np.ndarray:
        """Fourier coefficients (dof, 2H+1)."""


# Modes, or their shapes (dof, n) by column.
Shapes = HasShapes | ArrayLike
Coefficients = HasCoefficients | ArrayLike
