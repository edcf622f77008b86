"""Polars beyond their tables: a stalled section as a flat plate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._lib.checks import real_array
from ..errors import ModelError

Law = Callable[[float], tuple[float, float]]

# Lift of a section met from behind over that met from the front (AirfoilPrep).
REVERSED = 0.7
# Spacing of the angles that are added, in rad.
SPACING = np.radians(5.0)


def extension(base: Any, aspect_ratio: float, drag_max: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n,) in rad over the whole circle and coefficients (n, 3) of the polar ``base``; see `Polar.extend`."""
    low, high = base.angle[[0, -1]]
    if not (0.0 < high < np.pi / 2 and -np.pi / 2 < low < high):
        raise ModelError(
            f"polar {base.name!r}: the extension starts from stall, but the table goes from {np.degrees(low):g} to "
            f"{np.degrees(high):g} degrees; it must end between 0 and 90 and begin above -90"
        )
    slenderness = float(real_array(f"polar {base.name!r}: aspect_ratio", aspect_ratio))
    if slenderness <= 0.0:
        raise ModelError(f"polar {base.name!r}: the aspect ratio must be positive, it is {slenderness:g}")
    plate = min(1.11 + 0.018 * slenderness, 2.01) if drag_max is None else float(real_array("drag_max", drag_max))
    if plate <= 0.0:
        raise ModelError(f"polar {base.name!r}: drag_max must be positive, it is {plate:g}")
    below, above = _angles(low, high)
    angle = np.concatenate([below, base.angle, above])
    table = np.stack([base.lift, base.drag, base.moment], axis=1)
    values = np.concatenate([_plate_values(base, plate, below), table, _plate_values(base, plate, above)])
    return angle, values


def _angles(low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles below and above the table, those where branches meet among them."""
    above = np.union1d(_grid(high, np.pi), [np.pi - high])[1:]
    if low <= -high:
        return np.union1d(_grid(-np.pi, low), [-np.pi - low])[:-1], above
    mirrored = np.union1d(_grid(-np.pi, -high), [high - np.pi])
    return np.union1d(mirrored, _grid(-high, low))[:-1], above


def _viterna(angle: float, lift: float, drag: float, plate: float) -> Law:
    """The law (cl, cd) of angles from ``angle`` to 90 degrees that meets lift and drag at ``angle``."""
    s, c = np.sin(angle), np.cos(angle)
    a2 = (lift - plate * s * c) * s / c**2
    b2 = (drag - plate * s**2) / c

    def law(a: float) -> tuple[float, float]:
        cl = 0.5 * plate * np.sin(2.0 * a) + a2 * np.cos(a) ** 2 / np.sin(a)
        return float(cl), float(plate * np.sin(a) ** 2 + b2 * np.cos(a))

    return law


def _plate_values(base: Any, plate: float, angle: np.ndarray) -> np.ndarray:
    """(n, 3) coefficients at angles beyond the table."""
    low, high = base.angle[[0, -1]]
    positive = _viterna(high, base.lift[-1], base.drag[-1], plate)
    negative, front, start = positive, REVERSED, high
    if low <= -high:  # the table holds the negative stall: a law of its own meets that end
        negative, front, start = _viterna(-low, -base.lift[0], base.drag[0], plate), 1.0, -low
    least = np.min(base.drag)

    def force(a: float) -> tuple[float, float]:
        sign, size = np.sign(a), abs(a)
        law, factor, end = (positive, 1.0, high) if a > 0.0 else (negative, front, start)
        if size <= np.pi / 2:
            cl, cd = law(max(size, end))
            return sign * factor * cl, max(cd, least)
        back = np.pi - size
        cl, cd = law(max(back, end))
        share = min(back / end, 1.0)  # attached from behind: straight to no lift and the least drag
        return -sign * REVERSED * cl * share, max(least + (cd - least) * share, least)

    forces = np.array([force(a) for a in angle])
    if low > -high:
        gap = angle > -high  # between the mirrored branch and the table
        gap &= angle < low
        for k, (mirrored, end) in enumerate(zip(force(-high), (base.lift[0], base.drag[0]), strict=True)):
            forces[gap, k] = np.interp(angle[gap], [-high, low], [mirrored, end])
    return np.column_stack([forces, _moments(base, angle, forces)])


def _grid(first: float, last: float) -> np.ndarray:
    return np.linspace(first, last, 2 + int((last - first) / SPACING))


def _moments(base: Any, angle: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Moment coefficients from the centre of pressure, which moves linearly with the angle."""
    if not np.any(base.moment):
        return np.zeros(len(angle))
    normal = force[:, 0] * np.cos(angle) + force[:, 1] * np.sin(angle)
    arms = []
    for end, sign in ((-1, 1.0), (0, -1.0)):
        a = base.angle[end]
        n = base.lift[end] * np.cos(a) + base.drag[end] * np.sin(a)
        arm = -base.moment[end] / n if n * sign > 0.0 and sign * a > 0.0 else 0.25
        knots = [max(sign * a, 0.0), np.pi / 2, np.pi]
        arms.append(np.interp(np.abs(angle), knots, [np.clip(arm, -0.25, 0.75), 0.25, 0.5]))
    return -normal * np.where(angle > 0.0, arms[0], arms[1])
