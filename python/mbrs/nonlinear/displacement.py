"""Selection of a displacement of a nonlinear result: a coordinate by number or name, or a motion port of the model."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._lib.checks import shown
from ..errors import ModelError
from ..model.names import not_found
from ..model.ports import Port

# The number or the name of a coordinate, or a motion of a model such as ``body.motion("z")``.
Displacement = int | str | Port


def displacement_coefficients(X: np.ndarray, system: Any, which: Any) -> np.ndarray:
    """The coefficients (..., n_c) of one displacement from those of all coordinates (..., dof, n_c)."""
    return weigh(X, weights(system, which, X.shape[-2]))


def weigh(X: np.ndarray, by: int | np.ndarray) -> np.ndarray:
    """`displacement_coefficients` where the `weights` are known."""
    return X[..., by, :] if isinstance(by, int) else np.einsum("i,...ij->...j", by, X)


def weights(system: Any, which: Any, n: int) -> int | np.ndarray:
    """The number of a coordinate, or the row (n,) of a motion."""
    if isinstance(which, Port) or (isinstance(which, str) and which not in _names(system, n)):
        return _port_row(system, which, n)
    return _number(system, which, n)


def label(system: Any, which: Any, n: int) -> str:
    """Its name, for axes and tables."""
    if isinstance(which, str | Port):
        return str(which)
    return _names(system, n)[_number(system, which, n)]


def _names(system: Any, n: int) -> list[str]:
    return [str(name) for name in getattr(system, "coordinates", [f"x{i}" for i in range(n)])]


def _number(system: Any, which: Any, n: int) -> int:
    if isinstance(which, str):
        return _names(system, n).index(which)
    if isinstance(which, bool) or not isinstance(which, int | np.integer):
        raise ModelError(
            f"dof must be the number or name of a coordinate, or a motion such as body.motion('z'); it is {shown(which)}"
        )
    if not -n <= which < n:
        raise ModelError(f"there is no coordinate {which}; the system has {n}, numbered from 0")
    return int(which) % n


def _port_row(system: Any, which: Any, n: int) -> np.ndarray:
    lin = getattr(system, "linearization", None)
    if lin is None or (isinstance(which, str) and "." not in which):
        raise not_found("no coordinate", str(which), _names(system, n))
    return np.asarray(lin.output_map([which])[0][0])
