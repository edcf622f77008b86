"""Forces given as functions of time, as Fourier coefficients: what harmonic balance takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .._lib import checks
from .._lib.checks import UNFIT
from ..errors import ModelError
from .condensation import dense

# Samples in a period: doubled until the coefficients of the upper half are rounding, or to the limit. Larger: seconds for a Python
# function. Smaller: jumps alias more; what aliases is in the error. Pinned by `tests/nonlinear/test_function_forces.py`.
_FEWEST, _MOST = 256, 16384
# Coefficients below this part of the largest, each over the weight of its coordinate, are rounding of the transform. Larger: weak
# harmonics are lost. Smaller: rounding is kept as force. Pinned by the same tests.
_ROUNDING = 1e-13
# A function whose ends of the period differ in a coordinate by more than this part of its size there does not repeat itself. Larger: a
# wrong period passes. Smaller: sin(omega t) at large t is refused. Pinned by the same tests.
_REPEATS = 1e-9
# Parts of the period at which that is asked: multiples of the golden section, where jumps do not lie.
_PARTS = [(k * 0.618033988749895) % 1.0 for k in range(1, 6)]


def weights_of(system: Any, omega: float) -> np.ndarray:
    """Per coordinate the root of its own dynamic stiffness at rest or at ``omega``, the larger one: lengths beside angles, times these,
    and forces over them are roots of energies, whatever their units."""
    M, D, S = (np.diag(a) for a in dense(system))
    stiffness = np.maximum(np.abs(S), np.abs(S - omega**2 * M + 1j * omega * D))
    return np.sqrt(np.where(stiffness > 0, stiffness, 1.0))


def harmonics_of(force: Callable[[float], Any], weights: np.ndarray, omega: float) -> dict[int, np.ndarray]:
    """Complex amplitudes a - i b (n,) of a cos + b sin by harmonic of omega, 0 the mean, of ``force(t)`` with the period 2 pi / omega;
    ``weights`` (n,) as of `weights_of`.

    Raises
    ------
    ModelError
        A function that returns something other than n finite numbers, or that does not repeat itself after a period.
    """
    period, n = 2 * np.pi / omega, len(weights)
    samples = _FEWEST
    while True:
        values = np.array([_value(force, n, period * j / samples) for j in range(samples)])
        spectrum = np.fft.rfft(values, axis=0) / samples
        spectrum[1:-1] *= 2.0
        sizes = np.max(np.abs(spectrum) / weights, axis=1)
        rounding = _ROUNDING * float(np.max(sizes))
        if samples >= _MOST or np.max(sizes[samples // 4 :]) <= rounding:
            break
        samples *= 2
    _check_period(force, weights, period, values)
    kept = [h for h in range(len(spectrum)) if h == 0 or sizes[h] > rounding]
    return {h: spectrum[h] if h else spectrum[0].real for h in kept}


def _value(force: Callable[[float], Any], n: int, t: float) -> np.ndarray:
    try:
        made = np.asarray(force(t), dtype=float)
    except UNFIT as reason:
        raise ModelError(f"force, a function of time, failed at t = {t:.6g} s: {reason}") from reason
    return checks.real_array(f"what force, a function of time, returned at t = {t:.6g} s", made, (n,))


def _check_period(force: Callable[[float], Any], weights: np.ndarray, period: float, values: np.ndarray) -> None:
    size = np.max(np.abs(values), axis=0)
    allowed = _REPEATS * size + _ROUNDING * weights * np.max(size / weights)
    for part in _PARTS:
        t = period * part
        change = _value(force, len(weights), t + period) - _value(force, len(weights), t)
        if np.any(np.abs(change) > allowed):
            raise ModelError(
                f"force, a function of time, does not repeat itself after the period of {period:.6g} s that omega= gives: it differs at "
                f"t = {t:.6g} s and {t + period:.6g} s"
            )


def cut(force: Mapping[int, np.ndarray], kept: set[int]) -> tuple[dict[int, np.ndarray], dict[int, np.ndarray]]:
    """The harmonics that a solution keeps, and the others."""
    inside = {h: f for h, f in force.items() if h == 0 or h in kept}
    return inside, {h: f for h, f in force.items() if h not in inside}


def linear_size(system: Any, force: Mapping[int, np.ndarray], weights: np.ndarray, omega: float) -> float:
    """The largest weighed amplitude of the linear part's answer to harmonics that were left out, added up over them: an estimate."""
    M, D, S = (a / np.outer(weights, weights) for a in dense(system))
    total = np.zeros(len(weights))
    for h, f in force.items():
        w = h * omega
        answer, *_ = np.linalg.lstsq(-(w**2) * M + 1j * w * D + S, np.asarray(f, complex) / weights, rcond=None)
        total += np.abs(answer)
    return float(np.max(total, initial=0.0))
