"""Lifting lines of a rotor's blades: where their bound vortices are, how their sections stand and move."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from .blades import Blade, strips

if TYPE_CHECKING:
    from .rotors import Rotor

__all__ = ["Lines", "rigid_lines"]


@dataclass(frozen=True, eq=False)
class Lines:
    """b blades of n strips at one time, in world axes.

    Attributes
    ----------
    edges
        (b, n+1, 3) m: ends of the strips' bound vortices, at the aerodynamic centre.
    trailing
        (b, n+1, 3) m: the trailing edge behind them, where the wake begins.
    points
        (b, n, 3) m: middles of the bound vortices.
    forward, suction
        (b, n, 3) unit vectors of the sections: to the leading edge, and to the side that lift pushes to.
    rear
        (b, n, 3) m: three quarters of the chord behind the leading edge, where the angle of attack is taken.
    velocity, rear_velocity
        (b, n, 3) m/s: of the sections at ``points`` and ``rear``.
    """

    edges: np.ndarray
    trailing: np.ndarray
    points: np.ndarray
    forward: np.ndarray
    suction: np.ndarray
    rear: np.ndarray
    velocity: np.ndarray
    rear_velocity: np.ndarray

    @property
    def span(self) -> np.ndarray:
        """(b, n, 3) unit vectors across the sections, from root to tip: forward x suction."""
        return np.cross(self.forward, self.suction)

    @property
    def width(self) -> np.ndarray:
        """(b, n) m: length of the bound vortices."""
        return np.linalg.norm(np.diff(self.edges, axis=1), axis=-1)

    def rotate(self, rotation: np.ndarray) -> Lines:
        """The lines turned about the origin by a matrix, velocities too."""
        parts = ("edges", "trailing", "points", "forward", "suction", "rear", "velocity", "rear_velocity")
        return replace(self, **{name: getattr(self, name) @ rotation.T for name in parts})

    def angles(self, wind: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angle of attack (..., b, n) rad, speed m/s across the span, and the direction (..., b, n, 3) of that wind."""
        normal = np.sum(wind * self.suction, axis=-1)
        along = -np.sum(wind * self.forward, axis=-1)
        speed = np.hypot(normal, along)
        across = normal[..., None] * self.suction - along[..., None] * self.forward
        return np.arctan2(normal, along), speed, across / np.where(speed > 0.0, speed, 1.0)[..., None]

    def forces(self, wind: np.ndarray, circulation: np.ndarray, drag: np.ndarray) -> np.ndarray:
        """(b, n, 3) m^3/s^2: force of each strip over the density in the wind (b, n, 3) m/s at ``points``.

        Lift is what Kutta and Joukowski's law gives; ``drag`` (b, n) m: the coefficient times the chord.
        """
        _, speed, direction = self.angles(wind)
        across = speed[..., None] * direction
        lift = circulation[..., None] * np.cross(across, self.span)
        return self.width[..., None] * (lift + 0.5 * (drag * speed)[..., None] * across)


def rigid_lines(rotor: Rotor, n: int, speed: float) -> Lines:
    """Lines of a rigid rotor about the x axis through the origin, which turns at ``speed`` rad/s; blade 1 along z.

    The wind blows to +x where it turns the rotor; a cone leans the blades to +x.
    """
    edges, middles = strips(rotor.hub_radius, rotor.tip_radius, n)
    azimuth = 2.0 * np.pi * np.arange(rotor.count) / rotor.count
    axis = np.array([1.0, 0.0, 0.0])
    out = np.stack([np.zeros(rotor.count), -np.sin(azimuth), np.cos(azimuth)], axis=-1)
    ahead = np.cross(axis, out)[:, None]  # the way the blades go
    span = (np.cos(rotor.precone) * out + np.sin(rotor.precone) * axis)[:, None]
    normal = (np.cos(rotor.precone) * axis - np.sin(rotor.precone) * out)[:, None]

    def forward(places: np.ndarray) -> np.ndarray:
        pitch = rotor.blade.twists(places) + rotor.pitch
        return np.cos(pitch)[:, None] * ahead - np.sin(pitch)[:, None] * normal

    def behind(places: np.ndarray, fraction: float) -> np.ndarray:
        back = fraction - np.interp(places, rotor.blade.stations, rotor.blade.aerodynamic_center)
        return places[:, None] * span - (back * rotor.blade.chords(places))[:, None] * forward(places)

    points, rear = middles[:, None] * span, behind(middles, 0.75)
    return Lines(
        edges=edges[:, None] * span,
        trailing=behind(edges, 1.0),
        points=points,
        forward=forward(middles),
        suction=np.cross(span, forward(middles)),
        rear=rear,
        velocity=np.cross(speed * axis, points),
        rear_velocity=np.cross(speed * axis, rear),
    )


class HasSections(Protocol):
    """Strips of equal blades with their polars."""

    @property
    def chord(self) -> np.ndarray:
        """(n,) m."""

    def coefficients(self, angle: np.ndarray, slope: bool = False) -> np.ndarray:
        """(..., n, 3) lift, drag and moment at angles of attack (..., n) rad, or their slopes."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Chord (n,) m and shares of the polars of the strips of equal blades."""

    blade: Blade
    places: np.ndarray
    chord: np.ndarray
    weights: np.ndarray

    @classmethod
    def along(cls, blade: Blade, places: np.ndarray) -> Sections:
        """Sections of a blade at places (n,) m."""
        return cls(blade, places, blade.chords(places), blade.weights(places))

    def coefficients(self, angle: np.ndarray, slope: bool = False) -> np.ndarray:
        """(..., n, 3) lift, drag and moment at angles of attack (..., n) rad, or their slopes."""
        return self.blade.mix(self.weights, angle, slope)
