"""Lift of a section in attached flow: the straight line that its polar follows before it stalls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .._lib.monotone import cubic_pieces

__all__ = ["attached_line", "lift_at"]

# rad: angles among which the attached slope is looked for, and how near to the angle of no lift its quotient is not formed. Wider: plates
# in stall take part. Narrower: thick sections have no attached part. Pinned by tests/aero/test_dynamic_stall.py.
_ATTACHED, _NEAR = np.radians(30.0), np.radians(0.5)


def attached_line(lift: Callable[[np.ndarray], np.ndarray], n: int) -> tuple[np.ndarray, np.ndarray]:
    """Slope in 1/rad and angle of no lift in rad, (n,) each, by lifts (k, n) over angles (k, n).

    The slope is the steepest line from the angle of no lift to the curve within 30 degrees of it; lift that does not grow through zero
    has the slope zero: a cylinder has nothing to separate.
    """
    a = np.linspace(-_ATTACHED, _ATTACHED, 601)
    values = lift(np.repeat(a[:, None], n, axis=1))
    slope, zero = np.zeros(n), np.zeros(n)
    for k in range(n):
        y = values[:, k]
        rises = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
        if rises.size:
            i = int(rises[np.argmin(np.abs(a[rises]))])
            zero[k] = a[i] - y[i] * (a[i + 1] - a[i]) / (y[i + 1] - y[i])
            apart = a - zero[k]
            slope[k] = np.max(y[np.abs(apart) > _NEAR] / apart[np.abs(apart) > _NEAR])
    return slope, zero


def lift_at(polar: Mapping[str, Any], angle: np.ndarray) -> np.ndarray:
    """(k,) lifts of a polar as plain data at angles (k,) rad, beyond its table those of its ends."""
    a = np.asarray(polar["angle"])
    circle = bool(a[0] == -np.pi and a[-1] == np.pi)
    c = cubic_pieces(a, np.asarray(polar["lift"], dtype=float)[:, None], polar.get("interpolation", "pchip"), circle)[
        ..., 0
    ]
    inside = np.clip(angle, a[0], a[-1])
    i = np.clip(np.searchsorted(a, inside, side="right") - 1, 0, len(a) - 2)
    x = inside - a[i]
    return np.asarray(((c[3, i] * x + c[2, i]) * x + c[1, i]) * x + c[0, i])
