"""Rotors of equal blades, and how they load a steady wind along their axis."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from .._lib.checks import count, flag, real_array, shown
from ..errors import ModelError
from ..results import Result, Stats, quantity, result
from .blades import Blade
from .momentum import Annuli, Inflow, inflow

__all__ = ["Performance", "Rotor", "performance", "rotor"]

# Inflow angles, in rad, by which a root may miss the balance of blade elements and momentum. Larger: loads that do not balance
# are called converged. Smaller: rounding is called unresolved. Pinned by test_any_input_has_a_balance.
BALANCED = 1e-9


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
    hub = float(first if hub_radius is None else _number("hub_radius", hub_radius))
    tip = float(last if tip_radius is None else _number("tip_radius", tip_radius))
    if not 0.0 < hub <= first:
        raise ModelError(
            f"rotor: hub_radius must be positive and at most the first station's {first:g} m, it is {hub:g} m"
        )
    if not tip >= last:
        raise ModelError(f"rotor: tip_radius must be at least the last station's {last:g} m, it is {tip:g} m")
    cone = _number("precone", precone)
    if not abs(cone) < 0.5 * np.pi:
        raise ModelError(
            f"rotor: precone must be less than 90 degrees, it is {np.degrees(cone):g}; angles are in radians"
        )
    return Rotor(
        blade,
        _count(count),
        hub,
        tip,
        _number("pitch", pitch),
        cone,
        flag("rotor: tip_loss", tip_loss),
        flag("rotor: hub_loss", hub_loss),
    )


def _count(value: int) -> int:
    return count("rotor: count", value, 100)


def _number(name: str, value: Any) -> float:
    array = real_array(f"rotor: {name}", value)
    if array.ndim:
        raise ModelError(f"rotor: {name} must be one number, it is {shown(value)}")
    return float(array)


@result
class Performance(Result):
    """Power, thrust and torque coefficients of a rotor over tip speed ratios, by blade elements and momentum.

    ``tip_speed_ratio`` (n,), ``power_coefficient``, ``thrust_coefficient``, ``torque_coefficient`` (n,); at ``place`` (m,) m along
    the blade ``axial_induction`` and ``angle_of_attack`` (n, m) rad; ``radius`` m of the swept circle. ``error`` (n,): what half
    as many elements change, over the largest coefficient: of power and thrust the larger.
    """

    tip_speed_ratio: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="tip speed ratio")
    power_coefficient: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="power coefficient")
    thrust_coefficient: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="thrust coefficient")
    torque_coefficient: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="torque coefficient")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="distance from the axis along the blade")
    axial_induction: np.ndarray = quantity(dims=("tip_speed_ratio", "place"), unit="1", label="axial induction")
    angle_of_attack: np.ndarray = quantity(dims=("tip_speed_ratio", "place"), unit="rad", label="angle of attack")
    radius: float = quantity(unit="m", label="radius of the swept circle")

    row: ClassVar[str] = "tip_speed_ratio"
    axes: ClassVar[Mapping[str, str]] = {"tip_speed_ratio": "tip_speed_ratio", "place": "place"}
    error_dims: ClassVar[tuple[str, ...]] = ("tip_speed_ratio",)

    def power(self, speed: Any, density: float = 1.225) -> np.ndarray:
        """W: power at each tip speed ratio in wind of ``speed`` m/s (one, or one for each) and air of ``density`` kg/m^3."""
        return self.power_coefficient * self._force(speed, density) * np.asarray(speed, dtype=float)

    def thrust(self, speed: Any, density: float = 1.225) -> np.ndarray:
        """N: thrust along the axis; arguments as for `power`."""
        return self.thrust_coefficient * self._force(speed, density)

    def torque(self, speed: Any, density: float = 1.225) -> np.ndarray:
        """N m: torque about the axis; arguments as for `power`."""
        return self.torque_coefficient * self._force(speed, density) * self.radius

    def _force(self, speed: Any, density: float) -> np.ndarray:
        return 0.5 * density * np.pi * self.radius**2 * np.asarray(speed, dtype=float) ** 2

    def heading(self) -> str:
        best = int(np.argmax(self.power_coefficient))
        return (
            f"rotor performance: {self.status}, largest power coefficient {self.power_coefficient[best]:.6g} at tip speed ratio "
            f"{self.tip_speed_ratio[best]:.6g}"
        )

    def notes(self) -> list[str]:
        """Sentences on conditions in which momentum theory does not hold."""
        empirical = np.mean(self.axial_induction > 0.4)
        lines = [f"estimated error {np.max(self.error):.1e}: {len(self.place)} elements against half as many"]
        if empirical:
            lines.append(
                f"{100 * empirical:.0f} % of the sections have an axial induction above 0.4, where Buhl's empirical law acts"
            )
        return lines

    def plot(self, *, ax: Any = None) -> Any:
        """Power and thrust coefficients over the tip speed ratio; returns the figure."""
        from ..plot.aero import performance as draw

        return draw(self, ax=ax)


def performance(rotor: Rotor, tip_speed_ratio: Any, *, pitch: float = 0.0, elements: int = 80) -> Performance:
    """Coefficients of a rigid rotor in steady uniform wind along its axis, without structure.

        C_P = P / (rho A U^3 / 2),   C_T = T / (rho A U^2 / 2),   C_Q = C_P / lambda,   lambda = Omega R / U

    Parameters
    ----------
    rotor
        As from `mbrs.aero.rotor`.
    tip_speed_ratio
        (n,) or one number: lambda, positive.
    pitch
        rad, added to the rotor's.
    elements
        Along the blade, 8 to 10000; even.

    Returns
    -------
    Performance
        "converged" where blade elements and momentum balance in every section; ``error`` from half as many elements.

    Raises
    ------
    ModelError
        A tip speed ratio that is not positive; angles of attack that a polar does not hold, named with their station.

    Notes
    -----
    Sections and their balance: see `mbrs.aero.momentum.inflow` (S. A. Ning, Wind Energy 17 (2014) 1327). Integrals by Fejer's first
    rule, whose places are dense at root and tip; kinks of chord and twist at the stations limit it to about 1/m^2. Cost O(n m)
    section solutions.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.linspace(-np.pi, np.pi, 73)
    >>> section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.01 + np.sin(a) ** 4)
    >>> b = mb.aero.blade([2.0, 10.0, 40.0], [3.0, 3.5, 1.2], np.radians([20.0, 7.0, -2.0]), section)
    >>> p = mb.aero.performance(mb.aero.rotor(b, 3), tip_speed_ratio=[6.0, 7.0])
    >>> p.status, p.power_coefficient.round(3)
    ('converged', array([0.444, 0.461]))
    """
    start = time.perf_counter()
    if not isinstance(rotor, Rotor):
        raise ModelError(f"performance: rotor must be what mb.aero.rotor gives, it is {shown(rotor)}")
    ratio = np.atleast_1d(real_array("performance: tip_speed_ratio", tip_speed_ratio))
    if ratio.ndim != 1 or not ratio.size or np.any(ratio <= 0.0):
        raise ModelError(f"performance: tip_speed_ratio must be positive numbers, it is {shown(tip_speed_ratio)}")
    n = count("performance: elements", elements, 10000, 8)
    if n % 2:
        raise ModelError(f"performance: elements must be even, since half as many estimate the error; it is {n}")
    turned = replace(rotor, pitch=rotor.pitch + _number("pitch", pitch))
    power, thrust, flow = _integrals(turned, ratio, n)
    half_power, half_thrust, half = _integrals(turned, ratio, n // 2)
    places, _ = turned.elements(n)
    turned.blade.require(places, flow.angle_of_attack)
    balanced = max(np.max(flow.residual), np.max(half.residual)) <= BALANCED
    change = [np.abs(x - y) / np.max(np.abs(x)) for x, y in ((power, half_power), (thrust, half_thrust)) if np.any(x)]
    return Performance(
        tip_speed_ratio=ratio,
        power_coefficient=power,
        thrust_coefficient=thrust,
        torque_coefficient=power / ratio,
        place=places,
        axial_induction=-flow.axial / np.cos(turned.precone),
        angle_of_attack=flow.angle_of_attack,
        radius=turned.radius,
        stats=Stats(
            wall_time=time.perf_counter() - start,
            counts={"section_solutions": ratio.size * (n + n // 2), "polar_evaluations": flow.steps + half.steps},
            route="blade elements and momentum",
        ),
        error=np.max(change, axis=0) if change else np.zeros(ratio.size),
        status="converged" if balanced else "unresolved",
    )


def _integrals(rotor: Rotor, ratio: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, Inflow]:
    """Power and thrust coefficients (k,) and the flow at n elements, in wind of 1 m/s."""
    places, lengths = rotor.elements(n)
    cone = np.cos(rotor.precone)
    speed = ratio / rotor.radius
    flow = inflow(rotor.annuli(places), np.full((ratio.size, n), cone), speed[:, None] * places * cone)
    # over rho / 2, and the area pi R^2
    scale = rotor.count * rotor.blade.chords(places) * lengths * flow.speed**2 / (np.pi * rotor.radius**2)
    thrust = np.sum(scale * flow.normal, axis=-1) * cone
    torque = np.sum(scale * flow.driving * places, axis=-1) * cone
    return torque * speed, thrust, flow
