"""An unstable mode as its amplitude grows: shape, frequency and growth by one harmonic, up to where it neither grows nor decays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

# Amplitudes at which the mode is followed: from this part of the one at which laws are felt, each by this factor over the one before, so
# many of them. Larger factors: Newton's method loses the mode. Smaller, and more of them: evaluations for nothing. A later beginning: laws
# that bend early are passed over (tests/nonlinear/test_hbm_cycle.py)
BEGIN, FACTOR, MOST = 0.1, 1.5, 60
# Newton steps at most, and the relative size of the last one. More, smaller: digits that a first guess does not need.
STEPS, SOLVED = 12, 1e-8
SECANTS = 4  # steps to the amplitude without growth


class Modes(Protocol):
    """Modes about rest: mass (n, n), rest (n,), roots (2 n,), shapes (n, 2 n), and the balance of one harmonic in the core."""

    M: np.ndarray
    rest: np.ndarray
    s: np.ndarray
    shapes: np.ndarray
    core: Any


def balanced(modes: Modes, i: int, felt: float) -> Iterator[tuple[np.ndarray, float]]:
    """First harmonic (n,) and frequency where the growth of mode i changes its sign, in

    (K - w^2 M + i w (C + 2 growth M)) c + law(c) = 0,   c^H M c = amplitude^2.
    """
    z = _packed(modes.shapes[:, i], abs(modes.s[i].imag), modes.s[i].real)
    amplitude, last = BEGIN * felt, None
    for _ in range(MOST):
        found = _solved(modes, amplitude, _scaled(z, amplitude))
        if found is None:
            return
        if last is not None and (last[1][-1] > 0.0) != (found[-1] > 0.0):
            yield _between(modes, last, (amplitude, found))
        last, z = (amplitude, found), found
        amplitude *= FACTOR


def _between(modes: Modes, low: tuple[float, np.ndarray], high: tuple[float, np.ndarray]) -> tuple[np.ndarray, float]:
    """By secants of the growth over the logarithm of the amplitude; the nearer end where Newton's method fails."""
    best = min(low, high, key=lambda p: abs(p[1][-1]))
    for _ in range(SECANTS):
        a, b = low[1][-1], high[1][-1]
        amplitude = float(np.exp((np.log(low[0]) * b - np.log(high[0]) * a) / (b - a)))
        found = _solved(modes, amplitude, _scaled(best[1], amplitude))
        if found is None:
            break
        best = (amplitude, found)
        if (found[-1] > 0.0) == (a > 0.0):
            low = best
        else:
            high = best
        if found[-1] == 0.0:
            break
    n = (len(best[1]) - 2) // 2
    return best[1][:n] - 1j * best[1][n : 2 * n], float(best[1][-2])


def _packed(c: np.ndarray, w: float, growth: float) -> np.ndarray:
    return np.concatenate([c.real, -c.imag, [w, growth]])


def _scaled(z: np.ndarray, amplitude: float) -> np.ndarray:
    """The same mode; its length is corrected by Newton's method."""
    return np.concatenate([z[:-2] * amplitude / np.linalg.norm(z[:-2]), z[-2:]])


def _solved(modes: Modes, amplitude: float, z: np.ndarray) -> np.ndarray | None:
    """[a, b, w, growth] of the motion a cos w t + b sin w t with this amplitude, at the phase of the guess; None without one."""
    M, n = modes.M, len(modes.rest)
    z = z.copy()
    z[:-2] *= amplitude / np.sqrt(z[:n] @ M @ z[:n] + z[n:-2] @ M @ z[n:-2])
    phase = np.concatenate([M @ z[n:-2], -M @ z[:n]])
    for _ in range(STEPS):
        a, b, w, growth = z[:n], z[n:-2], float(z[-2]), float(z[-1])
        if not (np.all(np.isfinite(z)) and w > 0.0):
            return None
        X = np.column_stack([modes.rest, a, b])
        with np.errstate(all="ignore"):
            out = modes.core.residual(modes.core.restrict(X), [w])
        turned = np.concatenate([M @ b, -M @ a])
        R, J = out["residual"][n:].copy(), np.zeros((2 * n + 2, 2 * n + 2))
        J[: 2 * n, : 2 * n], J[: 2 * n, -2] = out["jacobian"][n:, n:], out["slope"][n:]
        R += 2 * w * growth * turned
        J[:n, n : 2 * n] += 2 * w * growth * M
        J[n : 2 * n, :n] -= 2 * w * growth * M
        J[: 2 * n, -2] += 2 * growth * turned
        J[: 2 * n, -1] = 2 * w * turned
        J[-2, : 2 * n] = 2 * np.concatenate([M @ a, M @ b])
        J[-1, : 2 * n] = phase
        rest = np.concatenate([R, [a @ M @ a + b @ M @ b - amplitude**2, phase @ z[:-2]]])
        rows, columns = np.abs(J).max(axis=1), np.concatenate([np.full(2 * n, amplitude), [w, w]])
        if not (np.all(np.isfinite(J)) and np.all(rows > 0.0)):
            return None
        try:
            step = columns * np.linalg.solve(J / rows[:, None] * columns, -rest / rows)
        except np.linalg.LinAlgError:
            return None
        z += step
        if np.all(np.abs(step) <= SOLVED * columns):
            return z
    return None
