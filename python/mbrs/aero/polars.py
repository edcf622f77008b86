"""Polars: lift, drag and moment coefficients of a section over its angle of attack."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import choice, real_array, shown
from .._lib.monotone import cubic_pieces
from ..errors import ModelError
from .stall import extension

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["Polar", "polar"]

INTERPOLATIONS = ("pchip", "linear")
# Angles, in rad, by which a table may miss -pi or pi and still be the whole circle: rounding of degrees to radians is 4e-16,
# half a unit of the last digit of the coarsest tables 1e-4. Larger: gaps of a table are bridged in silence. Smaller: tables
# written in radians with five digits do not close. Pinned by test_a_whole_circle_closes.
CLOSED = 1e-4
# Coefficients at -180 and 180 degrees, which are the same flow, may differ by half a unit of the fourth digit. Larger: a jump
# in the force. Smaller: tables that were rounded differently at their ends are refused. Pinned by test_a_whole_circle_closes.
SAME_END = 1e-4


class Polar:
    """A table of section coefficients, interpolated; `polar` and `read_polar` make it. It does not change.

    Attributes
    ----------
    name
        What errors call it.
    angle
        (n,) rad, increasing, within -pi to pi.
    lift, drag, moment
        (n,) coefficients; the moment is about the aerodynamic centre, positive nose up.
    thickness
        Of the section over its chord, or None.
    interpolation
        "pchip" or "linear".
    """

    def __init__(
        self,
        name: str,
        angle: np.ndarray,
        values: np.ndarray,
        thickness: float | None,
        interpolation: str,
    ) -> None:
        self.name, self.thickness, self.interpolation = name, thickness, interpolation
        self.angle, self._values = angle, values
        self._pieces = cubic_pieces(angle, values, interpolation, self.whole_circle)
        for array in (self.angle, self._values, self._pieces):
            array.flags.writeable = False

    lift = property(lambda self: self._values[:, 0])
    drag = property(lambda self: self._values[:, 1])
    moment = property(lambda self: self._values[:, 2])

    def __repr__(self) -> str:
        low, high = np.degrees(self.angle[[0, -1]])
        return f"Polar({self.name!r}, {len(self.angle)} angles from {low:g} to {high:g} degrees, {self.interpolation})"

    @property
    def whole_circle(self) -> bool:
        """The table holds all angles."""
        return bool(self.angle[0] == -np.pi and self.angle[-1] == np.pi)

    def covers(self, angle: ArrayLike) -> np.ndarray:
        """True where the table holds the angles (rad, of any turn)."""
        a = wrap(angle)
        return (a >= self.angle[0]) & (a <= self.angle[-1])

    def coefficients(self, angle: ArrayLike) -> np.ndarray:
        """(..., 3) lift, drag and moment coefficient at angles (...) rad of any turn.

        Raises
        ------
        ModelError
            An angle that the table does not hold.
        """
        self._require(angle)
        return self.clip_values(angle)

    def slopes(self, angle: ArrayLike) -> np.ndarray:
        """(..., 3) derivatives of the coefficients by the angle, 1/rad; exact derivatives of the interpolation.

        Raises
        ------
        ModelError
            An angle that the table does not hold.
        """
        self._require(angle)
        return self.clip_slopes(angle)

    def clip_values(self, angle: ArrayLike) -> np.ndarray:
        """As `coefficients`; beyond the table its nearest end, for searches whose end is checked with `covers`."""
        x, c = self._piece(angle)
        return c[0] + x * (c[1] + x * (c[2] + x * c[3]))

    def clip_slopes(self, angle: ArrayLike) -> np.ndarray:
        """Derivatives of `clip_values`: beyond the table zero."""
        x, c = self._piece(angle)
        return np.where(self.covers(angle)[..., None], c[1] + x * (2.0 * c[2] + 3.0 * x * c[3]), 0.0)

    def plain(self) -> dict[str, Any]:
        """The table as plain data: the arguments of `polar`."""
        columns = {"angle": self.angle, "lift": self.lift, "drag": self.drag, "moment": self.moment}
        thickness = {} if self.thickness is None else {"thickness": self.thickness}
        lists = {key: value.tolist() for key, value in columns.items()}
        return {"name": self.name, **lists, **thickness, "interpolation": self.interpolation}

    def extend(self, aspect_ratio: float, drag_max: float | None = None) -> Polar:
        """The polar over all angles, beyond its table by Viterna's equations of a stalled plate.

            cl = A1 sin 2a + A2 cos^2 a / sin a,    cd = B1 sin^2 a + B2 cos a,    B1 = 2 A1 = drag_max

        A2 and B2 meet the last angle of the table. Past 90 degrees and at negative angles that the table does not hold the lift
        is mirrored with the factor 0.7 of a reversed section, the drag unchanged; the gap between the table and the mirrored
        branch is bridged linearly. The centre of pressure moves linearly from where the table ends to the middle of the
        chord at 90 and three quarters of it at 180 degrees; where the moments of the table are all zero they stay so.

        Parameters
        ----------
        aspect_ratio
            Of the blade, its length over the chord at three quarters of it.
        drag_max
            Drag coefficient at 90 degrees; 1.11 + 0.018 ``aspect_ratio`` by default, at most 2.01.

        Raises
        ------
        ModelError
            A table whose last angle is not between 0 and 90 degrees, or that begins below -90 or above its last angle.

        Notes
        -----
        L. A. Viterna and R. D. Corrigan, "Fixed pitch rotor performance of large horizontal axis wind turbines", NASA CP-2230
        (1982); mirroring as in C. Hansen's AirfoilPrep.
        """
        if self.whole_circle:
            return self
        angle, values = extension(self, aspect_ratio, drag_max)
        return polar(angle, *values.T, thickness=self.thickness, name=self.name, interpolation=self.interpolation)

    def _require(self, angle: Any) -> None:
        outside = np.atleast_1d(wrap(angle))[~np.atleast_1d(self.covers(angle))]
        if outside.size:
            low, high = np.degrees(self.angle[[0, -1]])
            raise ModelError(
                f"polar {self.name!r} covers {low:.4g} to {high:.4g} degrees, not {np.degrees(outside[0]):.4g}; give a longer table, or "
                "ask for .extend(aspect_ratio=...)"
            )

    def _piece(self, angle: Any) -> tuple[np.ndarray, np.ndarray]:
        a = np.clip(wrap(angle), self.angle[0], self.angle[-1])
        i = np.clip(np.searchsorted(self.angle, a, side="right") - 1, 0, len(self.angle) - 2)
        return (a - self.angle[i])[..., None], self._pieces[:, i]


def polar(
    angle: ArrayLike,
    lift: ArrayLike,
    drag: ArrayLike,
    moment: ArrayLike | None = None,
    *,
    thickness: float | None = None,
    name: str = "polar",
    interpolation: str = "pchip",
) -> Polar:
    """A table of section coefficients over the angle of attack.

    Parameters
    ----------
    angle
        (n,) rad, increasing, within -pi to pi, at least two. A table from -pi to pi is periodic.
    lift, drag, moment
        (n,) coefficients; the moment (0 where absent) is about the aerodynamic centre, positive nose up.
    thickness
        Of the section over its chord: what `blade` interpolates polars by.
    name
        What errors call it.
    interpolation
        "pchip": monotone piecewise cubics with a continuous slope. They have no maximum that the table does not have, so that
        drag stays positive and stall is not overshot, as it would be with splines. "linear": straight between the angles.

    Raises
    ------
    ModelError
        Angles that do not increase or leave -pi to pi, negative drag, lengths that differ, nan, a whole circle whose ends
        differ.

    Notes
    -----
    F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 300 (1984). An evaluation costs O(log n).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.radians([-10.0, 0.0, 10.0])
    >>> p = mb.aero.polar(a, lift=2 * np.pi * a, drag=[0.02, 0.01, 0.02], name="thin")
    >>> np.round(p.coefficients(np.radians(5.0)), 4)
    array([0.5483, 0.0125, 0.    ])
    >>> p.coefficients(0.5)
    Traceback (most recent call last):
    mbrs.errors.ModelError: polar 'thin' covers -10 to 10 degrees, not 28.65; give a longer table, or ask for .extend(aspect_ratio=...)
    """
    what = f"polar {shown(name)}"
    a = real_array(f"{what}: angle", angle)
    if a.ndim != 1 or len(a) < 2:
        raise ModelError(f"{what}: angle must be a list of at least two angles, its shape is {a.shape}")
    columns = [lift, drag, np.zeros(len(a)) if moment is None else moment]
    arrays = [real_array(f"{what}: {n}", v) for n, v in zip(("lift", "drag", "moment"), columns, strict=True)]
    for n, array in zip(("lift", "drag", "moment"), arrays, strict=True):
        if array.shape != a.shape:
            raise ModelError(f"{what}: {n} must have the {len(a)} entries of angle, its shape is {array.shape}")
    if np.any(np.diff(a) <= 0.0):
        i = int(np.argmax(np.diff(a) <= 0.0)) + 1
        raise ModelError(f"{what}: the angles must increase; entry {i + 1} ({a[i]:g} rad) does not; sort the table")
    if a[0] < -np.pi - CLOSED or a[-1] > np.pi + CLOSED:
        raise ModelError(f"{what}: angles are in radians within -pi to pi, they go from {a[0]:g} to {a[-1]:g}")
    if np.any(arrays[1] < 0.0):
        raise ModelError(f"{what}: the drag is negative at {a[int(np.argmax(arrays[1] < 0.0))]:g} rad")
    if thickness is not None:
        thickness = float(real_array(f"{what}: thickness", thickness))
        if thickness <= 0.0:
            raise ModelError(f"{what}: the thickness over the chord must be positive, it is {thickness:g}")
    values = np.stack(arrays, axis=1)
    a, values = _close(what, a, values)
    return Polar(str(name), a, values, thickness, choice("interpolation of polars", interpolation, INTERPOLATIONS))


def wrap(angle: Any) -> np.ndarray:
    """Angles within -pi to pi; those already there stay as they are, bit by bit."""
    a = np.asarray(angle, dtype=float)
    return np.where(np.abs(a) <= np.pi, a, np.mod(a + np.pi, 2.0 * np.pi) - np.pi)


def _close(what: str, a: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends at -pi and pi exactly, and equal there, where the table holds the whole circle."""
    if a[0] > -np.pi + CLOSED or a[-1] < np.pi - CLOSED:
        return np.clip(a, -np.pi, np.pi), values
    if np.max(np.abs(values[0] - values[-1])) > SAME_END * (1.0 + np.max(np.abs(values[[0, -1]]))):
        raise ModelError(f"{what}: -180 and 180 degrees are the same flow, but the coefficients there differ")
    a, values = a.copy(), values.copy()
    a[[0, -1]] = -np.pi, np.pi
    values[[0, -1]] = 0.5 * (values[0] + values[-1])
    return a, values
