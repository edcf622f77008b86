"""Prescribed functions of time: value, rate and acceleration (docs/tables.md). Complex-safe in their numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .so3 import Array

RAMP, SINE, SINE_HERTZ, POLYNOMIAL, TABLE, LINES, FUNCTION = range(7)
TimeFunction = Callable[[float], Array]  # t -> (3,): value, rate, acceleration


def time_function(code: int, p: Array, function: Callable[[float], list[float]] | None, output: int) -> TimeFunction:
    """A motion of the tables, from its numbers or from a function that gives several motions one behind the other."""
    if code != FUNCTION:
        return _built_in(code, p)
    assert function is not None
    return lambda t: np.array([*function(t)[output:], 0.0, 0.0][:3])


def _built_in(code: int, p: Array) -> TimeFunction:
    if code == RAMP:
        return lambda t: np.array([p[1] + p[0] * (t - p[2]), p[0], 0 * p[0]] if t >= p[2].real else [p[1], 0.0, 0.0])
    if code in (SINE, SINE_HERTZ):
        amplitude, omega, phase, offset = p
        omega = omega * (2 * np.pi if code == SINE_HERTZ else 1.0)
        return lambda t: np.array(
            [
                offset + amplitude * np.sin(omega * t + phase),
                amplitude * omega * np.cos(omega * t + phase),
                -amplitude * omega**2 * np.sin(omega * t + phase),
            ]
        )
    if code == POLYNOMIAL:
        powers = np.arange(len(p))
        return lambda t: np.array(
            [
                sum(c * t**k for k, c in zip(powers, p, strict=True)),
                sum(k * c * t ** (k - 1) for k, c in zip(powers, p, strict=True) if k > 0),
                sum(k * (k - 1) * c * t ** (k - 2) for k, c in zip(powers, p, strict=True) if k > 1),
            ]
        )
    n = len(p) // 2
    return _table(p[:n], p[n:], second_derivatives(p[:n], p[n:]) if code == TABLE else np.zeros(n))


def second_derivatives(t: Array, v: Array) -> Array:
    """M of the natural spline: one dense system, M_0 = M_n = 0 and continuous slopes between."""
    n = len(t)
    A, b, h = np.eye(n, dtype=np.result_type(t, v)), np.zeros(n, dtype=np.result_type(t, v)), np.diff(t)
    for i in range(1, n - 1):
        A[i, i - 1 : i + 2] = h[i - 1] / 6, (h[i - 1] + h[i]) / 3, h[i] / 6
        b[i] = (v[i + 1] - v[i]) / h[i] - (v[i] - v[i - 1]) / h[i - 1]
    return np.linalg.solve(A, b)


def _table(t: Array, v: Array, m: Array) -> TimeFunction:
    def at(now: float) -> Array:
        if now < t[0].real or now >= t[-1].real:
            return np.array([v[0] if now < t[0].real else v[-1], 0.0, 0.0])
        i = int(np.searchsorted(t.real, now, side="right")) - 1
        h, s = t[i + 1] - t[i], now - t[i]
        slope = (v[i + 1] - v[i]) / h - h * (2 * m[i] + m[i + 1]) / 6
        bend = (m[i + 1] - m[i]) / h
        return np.array(
            [v[i] + s * (slope + s * (m[i] / 2 + s * bend / 6)), slope + s * (m[i] + s * bend / 2), m[i] + s * bend]
        )

    return at
