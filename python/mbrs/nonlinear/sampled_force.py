"""Forces given as functions of time, as Fourier coefficients: what harmonic balance takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .._lib import checks
from .._lib.checks import UNFIT
from ..errors import ModelError

# Samples in a period: doubled until the coefficients of the upper half are rounding, or to the limit. Larger: seconds for a Python
# function. Smaller: jumps alias more; what aliases is in the error. Pinned by `tests/nonlinear/test_function_forces.py`.
_FEWEST, _MOST = 256, 16384
# Coefficients below this part of the largest are rounding of the transform. Larger: weak harmonics are lost. Smaller: rounding is kept as
# force. Pinned by the same tests.
_ROUNDING = 1e-13
# A function whose ends of the period differ by more than this part of its size does not repeat itself. Larger: a wrong period passes.
# Smaller: sin(omega t) at large t is refused. Pinned by the same tests.
_REPEATS = 1e-9
# Parts of the period at which that is asked: multiples of the golden section, where jumps do not lie.
_PARTS = [(k * 0.618033988749895) % 1.0 for k in range(1, 6)]


def harmonics_of(force: Callable[[float], Any], n: int, omega: float) -> dict[int, np.ndarray]:
    """Complex amplitudes a - i b (n,) of a cos + b sin by harmonic of omega, 0 the mean, of ``force(t)`` with the period 2 pi / omega.

    Raises
    ------
    ModelError
        A function that returns something other than n finite numbers, or that does not repeat itself after a period.
    """
    period = 2 * np.pi / omega
    samples = _FEWEST
    while True:
        values = np.array([_value(force, n, period * j / samples) for j in range(samples)])
        spectrum = np.fft.rfft(values, axis=0) / samples
        spectrum[1:-1] *= 2.0
        largest = float(np.max(np.abs(spectrum), initial=0.0))
        if samples >= _MOST or np.max(np.abs(spectrum[samples // 4 :])) <= _ROUNDING * largest:
            break
        samples *= 2
    _check_period(force, n, period, values)
    kept = [h for h in range(len(spectrum)) if h == 0 or np.max(np.abs(spectrum[h])) > _ROUNDING * largest]
    return {h: spectrum[h] if h else spectrum[0].real for h in kept}


def _value(force: Callable[[float], Any], n: int, t: float) -> np.ndarray:
    try:
        made = np.asarray(force(t), dtype=float)
    except UNFIT as reason:
        raise ModelError(f"force, a function of time, failed at t = {t:.6g} s: {reason}") from reason
    return checks.real_array(f"what force, a function of time, returned at t = {t:.6g} s", made, (n,))


def _check_period(force: Callable[[float], Any], n: int, period: float, values: np.ndarray) -> None:
    size = float(np.max(np.abs(values), initial=0.0))
    for part in _PARTS:
        t = period * part
        if np.max(np.abs(_value(force, n, t + period) - _value(force, n, t))) > _REPEATS * size:
            raise ModelError(
                f"force, a function of time, does not repeat itself after the period of {period:.6g} s that omega= gives: it differs at "
                f"t = {t:.6g} s and {t + period:.6g} s"
            )


def cut(force: Mapping[int, np.ndarray], kept: set[int]) -> tuple[dict[int, np.ndarray], dict[int, np.ndarray]]:
    """The harmonics that a solution keeps, and the others."""
    inside = {h: f for h, f in force.items() if h == 0 or h in kept}
    return inside, {h: f for h, f in force.items() if h not in inside}


def linear_size(system: Any, force: Mapping[int, np.ndarray], omega: float) -> float:
    """The largest amplitude of the linear part's answer to harmonics that were left out, added up over them: an estimate."""
    dense = lambda a: 0.0 if a is None else a.toarray() if hasattr(a, "toarray") else a  # noqa: E731
    M, D, S = dense(system.M), dense(system.C) + dense(system.G), dense(system.K) + dense(system.N)
    total = 0.0
    for h, f in force.items():
        w = h * omega
        answer, *_ = np.linalg.lstsq(-(w**2) * M + 1j * w * D + S, np.asarray(f, complex), rcond=None)
        total += float(np.max(np.abs(answer), initial=0.0))
    return total
