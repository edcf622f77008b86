"""Force laws in plain NumPy: force, slope by displacement, slope by rate, for arrays of samples. The oracle of the
core's laws."""

from __future__ import annotations

from typing import Any

import numpy as np


def force(law: Any, u: np.ndarray, v: np.ndarray, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """f, df/du, df/dv of a law without memory at samples (u, v) and excitation phases."""
    if type(law).__name__ == "FunctionLaw":
        if law.derivatives is not None:
            return law.sampled(u, v)
        tiny = 1e-30  # the complex step: no difference is taken
        f_u, f_v = (np.imag(law.function(0.0, u + a, v + b)) / tiny for a, b in ((1j * tiny, 0.0), (0.0, 1j * tiny)))
        return law.force(u, v), f_u + np.zeros_like(u), f_v + np.zeros_like(u)
    p = np.asarray(law.numbers())
    zero = np.zeros_like(u)
    match type(law).__name__:
        case "Cubic":
            return p[0] * u**3, 3 * p[0] * u**2, zero
        case "Polynomial1D":
            c = p if law.code == 1 else p[: len(p) // 2]
            d = np.zeros(1) if law.code == 1 else p[len(p) // 2 :]
            P, Q = np.polynomial.Polynomial(c), np.polynomial.Polynomial(d)
            return P(u) + Q(v), P.deriv()(u) + zero, Q.deriv()(v) + zero
        case "Gap":
            f, k = _gap(u, *p)
            if law.code == 4:
                other, slope = _gap(-u, *p)
                return f - other, k + slope, zero
            return f, k, zero
        case "CoulombTanh":
            t = np.tanh(v / p[1])
            return p[0] * t, zero, p[0] / p[1] * (1 - t**2)
        case "Hertz":
            d = np.maximum(u - p[2], 0)
            return p[0] * d ** p[1], p[0] * p[1] * d ** (p[1] - 1), zero
        case "TableLaw":
            from scipy.interpolate import PchipInterpolator

            x, y = p[: len(p) // 2], p[len(p) // 2 :]
            spline = PchipInterpolator(x, y)
            slope = spline.derivative()
            inside = np.clip(u, x[0], x[-1])
            return spline(inside) + slope(inside) * (u - inside), slope(inside), zero
        case "VanDerPol":
            return p[0] * u**2 * v, 2 * p[0] * u * v, p[0] * u**2
        case "VaryingStiffness":
            k = p[0] * np.cos(p[1] * phase + p[2])
            return k * u, k, zero
    raise TypeError(f"{law!r} has memory or is unknown")


def _gap(u: np.ndarray, k: float, gap: float, smoothing: float) -> tuple[np.ndarray, np.ndarray]:
    d = u - gap
    if smoothing == 0:
        return k * np.maximum(d, 0), k * (d > 0)
    root = np.sqrt(d**2 + smoothing**2)
    return k * (d + root) / 2, k * (1 + d / root) / 2


def march(law: Any, u: np.ndarray, du: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f (n,) and df/dX (n, n_c) of a law with memory over the second of two periods; du (n, n_c) = du/dX at the
    samples."""
    n, n_c = du.shape
    f, df = np.zeros(n), np.zeros((n, n_c))
    pairs = np.asarray(law.numbers()).reshape(-1, 2)
    for k, slip in pairs:
        z, dz = 0.0, np.zeros(n_c)
        for step in range(2 * n):
            j = step % n
            trial = k * (u[j] - z)
            if abs(trial) <= slip:
                here, slope = trial, k * (du[j] - dz)
            else:
                here, slope = np.sign(trial) * slip, np.zeros(n_c)
                z, dz = u[j] - here / k, du[j].copy()
            if step >= n:
                f[j] += here
                df[j] += slope
    return f, df
