"""Distances between two results of one kind: the errors that studies measure. All are relative, 0 for equal results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import ModelError

__all__ = [
    "curve_difference",
    "eigenvalue_difference",
    "frequency_difference",
    "largest_difference",
    "measure_for",
    "motion_difference",
    "own_estimate",
    "rotor_difference",
]
# Relative difference of frequencies and times at which two results are compared. Larger: results of different points are. Smaller: the
# rounding of a file refuses them.
_SAME_POINTS = 1e-9
# The same of times of motions, which no file rounds. Larger: what the motion does in between is called a difference.
_SAME_TIMES = 1e-12


def measure_for(result: Any) -> Callable[[Any, Any], float]:
    """The default measure for this kind of result.

    Modes are compared by their frequencies, transfer functions and responses by their values, harmonic-balance curves
    by their peak, motions by poses, rotors in wind by thrust and power, numbers and arrays element by element; anything else that
    has an ``error`` by that estimate.

    Raises
    ------
    ModelError
        Nothing in the result can be compared; give ``measure=``.
    """
    if hasattr(result, "poses") and hasattr(result, "t"):
        return motion_difference
    if hasattr(result, "eigenvalue") and hasattr(result, "frequency"):
        return frequency_difference
    if hasattr(result, "X") and hasattr(result, "omega"):
        return curve_difference
    if hasattr(result, "value") or isinstance(result, int | float | complex | np.ndarray | np.number | list | tuple):
        return largest_difference
    if hasattr(result, "thrust_coefficient") and hasattr(result, "power_coefficient"):
        return rotor_difference
    if getattr(result, "error", None) is not None:
        return own_estimate
    raise ModelError(
        f"there is no default measure for {type(result).__name__}; give measure=lambda result, reference: ..."
    )


def frequency_difference(result: Any, reference: Any) -> float:
    """Largest relative difference of the lowest frequencies.

    As many as both have. Where the reference frequency is 0 (rigid modes) the difference is divided by the lowest one
    above 0.
    """
    ours, theirs = _frequencies(result), _frequencies(reference)
    n = min(ours.size, theirs.size)
    if n == 0:
        raise ModelError("there are no frequencies to compare")
    ours, theirs = np.sort(ours)[:n], np.sort(theirs)[:n]
    positive = theirs[theirs > 0.0]
    scale = np.where(theirs > 0.0, theirs, positive.min() if positive.size else 1.0)
    return _largest(np.abs(ours - theirs) / scale)


def eigenvalue_difference(result: Any, reference: Any) -> float:
    """Largest relative distance between eigenvalues of the one and the nearest of the other.

    Unlike frequencies it sees a change of damping. A rigid mode's distance is divided by the lowest |s| above 0.
    """
    ours, theirs = np.ravel(result.eigenvalue), np.ravel(reference.eigenvalue)
    if ours.size == 0 or theirs.size == 0:
        raise ModelError("there are no eigenvalues to compare")
    distance = np.abs(ours[:, None] - theirs[None, :])
    size = np.abs(theirs)
    lowest = size[size > 0.0].min() if np.any(size > 0.0) else 1.0
    scale = np.where(size > 0.0, size, lowest)
    from_theirs = distance.min(axis=0) / scale
    from_ours = distance.min(axis=1) / scale[distance.argmin(axis=1)]
    return max(_largest(from_theirs), _largest(from_ours))


def _frequencies(result: Any) -> np.ndarray:
    return np.ravel(np.asarray(getattr(result, "frequency", result), dtype=float))


def largest_difference(result: Any, reference: Any) -> float:
    """Largest difference relative to the largest value of the reference."""
    ours, theirs = _values(result), _values(reference)
    if ours.shape != theirs.shape:
        raise ModelError(
            f"results of shapes {ours.shape} and {theirs.shape} cannot be compared; "
            "compute both at the same points (give frequency or t as an array)"
        )
    _same_points(result, reference)
    if ours.size == 0:
        raise ModelError("there are no values to compare")
    scale = float(np.max(np.abs(theirs)))
    return _largest(np.abs(ours - theirs)) / (scale if scale > 0.0 else 1.0)


def _values(result: Any) -> np.ndarray:
    value = np.asarray(getattr(result, "value", result))
    return value if np.iscomplexobj(value) else value.astype(float)


def _same_points(result: Any, reference: Any) -> None:
    for name in ("frequency", "t"):
        ours, theirs = getattr(result, name, None), getattr(reference, name, None)
        if ours is not None and theirs is not None and not np.allclose(ours, theirs, rtol=_SAME_POINTS, atol=0.0):
            raise ModelError(f"the results were computed at different {name}; give {name} as the same array to both")


def motion_difference(result: Any, reference: Any) -> float:
    """Largest distance of a body, over the characteristic length, or angle between its two orientations.

    At all outputs where both motions have the same ones, else at the end, which must be the same. Nodes of flexible bodies count where
    both motions follow them: without flexibility there are none.
    """
    ours, theirs = np.asarray(result.t, dtype=float), np.asarray(reference.t, dtype=float)
    if ours.size == 0 or theirs.size == 0 or not np.isclose(ours[-1], theirs[-1], rtol=_SAME_TIMES, atol=0.0):
        raise ModelError("motions that end at different times cannot be compared; give t= the same value")
    same = ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=_SAME_TIMES, atol=0.0)
    at = slice(None) if same else slice(-1, None)
    length = float(result.snapshot.system.characteristic_length)
    named = [tuple(one.snapshot.tables["body_name"]) for one in (result, reference)]
    both = [name for name in named[0] if name in named[1]]
    (p, q), (r, s) = (
        [one.poses[what][at][:, [names.index(name) for name in both]] for what in ("position", "orientation")]
        for one, names in zip((result, reference), named, strict=True)
    )
    chord = np.minimum(np.linalg.norm(q - s, axis=-1), np.linalg.norm(q + s, axis=-1))
    moved = np.linalg.norm(p - r, axis=-1) / length
    return max(_largest(moved), _largest(4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))))


def curve_difference(result: Any, reference: Any) -> float:
    """Relative difference of the peak of a response curve, in amplitude or frequency, the larger.

    The amplitude of a point is the norm of its harmonic coefficients; a single solution is its own peak.
    """
    (ours, our_omega), (theirs, their_omega) = _peak(result), _peak(reference)
    amplitude = abs(ours - theirs) / (theirs if theirs > 0.0 else 1.0)
    return _largest(np.array([amplitude, abs(our_omega - their_omega) / (abs(their_omega) or 1.0)]))


def _peak(result: Any) -> tuple[float, float]:
    coefficients = np.asarray(result.X, dtype=float)
    omega = np.ravel(np.asarray(result.omega, dtype=float))
    points = coefficients.reshape(omega.size, -1) if coefficients.ndim > 2 else coefficients.reshape(1, -1)
    size = np.linalg.norm(points, axis=1)
    i = int(np.argmax(size))
    return float(size[i]), float(omega[min(i, omega.size - 1)])


def rotor_difference(result: Any, reference: Any) -> float:
    """Relative difference of the thrust or the power of a rotor in wind, the larger; of a wake that of the means of its last turns."""
    apart = []
    for ours, theirs in zip(_rotor_loads(result), _rotor_loads(reference), strict=True):
        if ours.shape != theirs.shape:
            raise ModelError("rotors at different tip speed ratios cannot be compared; give both the same")
        size = float(np.max(np.abs(theirs)))
        apart.append(_largest(np.abs(ours - theirs)) / (size if size > 0.0 else 1.0))
    return max(apart)


def _rotor_loads(result: Any) -> tuple[np.ndarray, np.ndarray]:
    """Thrust and power: means of a wake, or coefficients over the tip speed ratio."""
    mean = not callable(result.thrust)
    pair = (result.thrust, result.power) if mean else (result.thrust_coefficient, result.power_coefficient)
    return np.atleast_1d(pair[0]), np.atleast_1d(pair[1])


def own_estimate(result: Any, reference: Any) -> float:
    """The error that the result estimates for itself (not measured)."""
    return _largest(np.abs(np.asarray(result.error, dtype=float)))


def _largest(values: np.ndarray) -> float:
    """nan wherever anything is nan: a result that is not a number is not close to anything."""
    return float(np.max(values)) if np.size(values) else float("nan")
