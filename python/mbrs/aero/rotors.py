"""Rotors of equal blades."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._lib.checks import count, flag, real_number, shown
from ..errors import ModelError
from .blades import Blade
from .momentum import Annuli

__all__ = ["Rotor", "rotor"]


@dataclass(frozen=True, eq=False)
class Rotor:
    """Equal blades about an axis; `rotor` makes and checks it. Radii in m are measured along the blade from the axis."""

    blade: Blade
    count: int
    hub_radius: float
    tip_radius: float
    pitch: float
    precone: float
    tip_loss: bool
    hub_loss: bool

    @property
    def radius(self) -> float:
        """m: of the circle that the tips go through."""
        return self.tip_radius * float(np.cos(self.precone))

    def __repr__(self) -> str:
        return f"Rotor({self.count} blades, {self.hub_radius:g} to {self.tip_radius:g} m)"

    def elements(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """(n,) m places and weights of Fejer's first quadrature (1933): dense at root and tip, where loads change fast."""
        angle = (np.arange(n) + 0.5) * np.pi / n
        j = np.arange(1, n // 2 + 1)
        weights = (1.0 - 2.0 * np.cos(2.0 * np.outer(angle, j)) @ (1.0 / (4.0 * j**2 - 1.0))) * 2.0 / n
        half = 0.5 * (self.tip_radius - self.hub_radius)
        return self.hub_radius + half * (1.0 - np.cos(angle)), half * weights

    def annuli(self, places: np.ndarray) -> Annuli:
        """The annuli through places (m,) m of the blade."""
        r, half = places * np.cos(self.precone), 0.5 * self.count
        loss = []
        if self.tip_loss:
            loss.append(half * (self.tip_radius - places) / places)
        if self.hub_loss:
            loss.append(half * (places - self.hub_radius) / self.hub_radius)
        weights = self.blade.weights(places)
        return Annuli(
            coefficients=lambda alpha: self.blade.mix(weights, alpha),
            twist=self.blade.twists(places) + self.pitch,
            solidity=self.count * self.blade.chords(places) / (2.0 * np.pi * r),
            loss=np.array(loss).reshape(len(loss), len(places)),
        )


def rotor(
    blade: Blade,
    count: int = 3,
    *,
    hub_radius: float | None = None,
    tip_radius: float | None = None,
    pitch: float = 0.0,
    precone: float = 0.0,
    tip_loss: bool = True,
    hub_loss: bool = True,
) -> Rotor:
    """Equal blades about an axis.

    Parameters
    ----------
    blade
        As from `mbrs.aero.blade`; its stations are distances from the axis along the blade, m.
    count
        Of blades, 1 to 100.
    hub_radius, tip_radius
        m: where the blade begins and ends; the first and the last station by default. Between them and the stations chord, twist
        and polar are those of the nearest station.
    pitch
        rad, added to the twist.
    precone
        rad: angle of the blades to the plane of rotation; loads and wind are resolved across the blade.
    tip_loss, hub_loss
        Prandtl's losses at tip and hub; False is a rotor of infinitely many blades.

    Raises
    ------
    ModelError
        Radii that are not positive or do not hold the stations, a cone of 90 degrees, nan.
    """
    if not isinstance(blade, Blade):
        raise ModelError(f"rotor: blade must be what mb.aero.blade gives, it is {shown(blade)}")
    first, last = blade.stations[[0, -1]]
    hub = float(first if hub_radius is None else real_number("rotor: hub_radius", hub_radius))
    tip = float(last if tip_radius is None else real_number("rotor: tip_radius", tip_radius))
    if not 0.0 < hub <= first:
        raise ModelError(
            f"rotor: hub_radius must be positive and at most the first station's {first:g} m, it is {hub:g} m"
        )
    if not tip >= last:
        raise ModelError(f"rotor: tip_radius must be at least the last station's {last:g} m, it is {tip:g} m")
    cone = real_number("rotor: precone", precone)
    if not abs(cone) < 0.5 * np.pi:
        raise ModelError(
            f"rotor: precone must be less than 90 degrees, it is {np.degrees(cone):g}; angles are in radians"
        )
    return Rotor(
        blade,
        _count(count),
        hub,
        tip,
        real_number("rotor: pitch", pitch),
        cone,
        flag("rotor: tip_loss", tip_loss),
        flag("rotor: hub_loss", hub_loss),
    )


def _count(value: int) -> int:
    return count("rotor: count", value, 100)
