"""Steady wind with shear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import positive, real_array, real_number, shown
from ..errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Wind", "wind"]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Wind:
    """A steady wind; `wind` makes and checks it.

    Attributes
    ----------
    speed
        m/s at the reference height.
    direction, up
        (3,) unit vectors in world axes: where the wind blows to, and where height is counted.
    shear
        Exponent of the power law.
    reference_height
        m, or None without shear.
    ground
        m: where height is zero along ``up``.
    """

    speed: float
    direction: np.ndarray
    shear: float
    reference_height: float | None
    up: np.ndarray
    ground: float = 0.0

    def velocity(self, points: ArrayLike) -> np.ndarray:
        """(..., 3) m/s in world axes at points (..., 3) m; without shear the same everywhere, with shear still at and below height 0."""
        p = np.asarray(points, dtype=float)
        if self.reference_height is None:
            return np.broadcast_to(self.speed * self.direction, p.shape).copy()
        height = np.maximum(p @ self.up - self.ground, 0.0) / self.reference_height
        return (self.speed * height**self.shear)[..., None] * self.direction


def wind(
    speed: float,
    direction: str | ArrayLike = "x",
    shear: float = 0.0,
    reference_height: float | None = None,
    up: str | ArrayLike = "z",
    ground: float = 0.0,
) -> Wind:
    """Describe a steady wind.

        u(z) = speed (z / reference_height)^shear

    Parameters
    ----------
    speed
        m/s at the reference height; not negative.
    direction
        "x", "y", "z" or a vector (3,) in world axes: where the wind blows to.
    shear
        Exponent of the power law, 0 (the same everywhere) to 1; 0.2 over open land, 0.14 offshore.
    reference_height
        m above the ground; needed with shear.
    up
        "x", "y", "z" or a vector (3,): the direction in which height is counted.
    ground
        m: coordinate of the ground along ``up``; 0 by default, negative where the world's origin is above it.

    Raises
    ------
    ModelError
        nan, a negative speed, a shear without its height.

    Notes
    -----
    T. Burton et al., "Wind Energy Handbook", section 2.6.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.aero.wind(8.0, "x", shear=0.2, reference_height=84.0).velocity([0.0, 0.0, 42.0]).round(4)
    array([6.9644, 0.    , 0.    ])
    """
    u, exponent = real_number("wind: speed", speed), real_number("wind: shear", shear, 0.0, 1.0)
    if u < 0.0:
        raise ModelError(f"wind: speed must not be negative, it is {shown(speed)}; turn the direction instead")
    height = None if reference_height is None else positive("wind: reference_height", reference_height)
    if exponent and height is None:
        raise ModelError("wind: shear needs reference_height=, the height in m at which the wind has its speed")
    return Wind(
        float(u),
        _direction("direction", direction),
        float(exponent),
        float(height) if exponent and height is not None else None,
        _direction("up", up),
        float(real_array("wind: ground", ground)),
    )


def _direction(name: str, value: Any) -> np.ndarray:
    vector = real_array(f"wind: {name}", _AXES.get(value, value) if isinstance(value, str) else value)
    if vector.shape != (3,) or not np.any(vector):
        raise ModelError(f'wind: {name} must be "x", "y", "z" or a vector of three numbers, it is {shown(value)}')
    vector = vector / np.max(np.abs(vector))
    return vector / np.linalg.norm(vector)
