"""Piecewise cubics through the rows of a table that are monotone where the table is."""

from __future__ import annotations

import numpy as np


def cubic_pieces(a: np.ndarray, y: np.ndarray, interpolation: str, periodic: bool) -> np.ndarray:
    """(4, n - 1, k) coefficients of the powers of the distance from the left end of each piece.

    ``a`` (n,) increases, ``y`` is (n, k). ``interpolation``: "linear", or "pchip" (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat.
    Comput. 5, 300 (1984)). ``periodic``: the first and the last row are one.
    """
    h, rise = np.diff(a)[:, None], np.diff(y, axis=0)
    secant = rise / h
    if interpolation == "linear":
        return np.stack([y[:-1], secant, np.zeros_like(secant), np.zeros_like(secant)])
    d = _monotone_slopes(h, secant, periodic)
    return np.stack([y[:-1], d[:-1], (3.0 * secant - 2.0 * d[:-1] - d[1:]) / h, (d[:-1] + d[1:] - 2.0 * secant) / h**2])


def _monotone_slopes(h: np.ndarray, secant: np.ndarray, periodic: bool) -> np.ndarray:
    """(n, 3) slopes: weighted harmonic means of the neighbouring secants where these agree in sign, else zero."""
    if periodic:
        h, secant = np.concatenate([h[-1:], h, h[:1]]), np.concatenate([secant[-1:], secant, secant[:1]])
    if len(h) == 1:
        return np.concatenate([secant, secant])
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    agree = secant[1:] * secant[:-1] > 0.0
    left, right = np.where(agree, secant[:-1], 1.0), np.where(agree, secant[1:], 1.0)
    inner = np.where(agree, (w1 + w2) / (w1 / left + w2 / right), 0.0)
    if periodic:
        return inner
    return np.concatenate(
        [
            _end_slope(h[0], h[1], secant[0], secant[1])[None],
            inner,
            _end_slope(h[-1], h[-2], secant[-1], secant[-2])[None],
        ]
    )


def _end_slope(h0: np.ndarray, h1: np.ndarray, s0: np.ndarray, s1: np.ndarray) -> np.ndarray:
    """The slope of the parabola through three points at its end, limited so that the piece is monotone."""
    d = ((2.0 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    d = np.where(d * s0 <= 0.0, 0.0, d)
    return np.where((s0 * s1 <= 0.0) & (np.abs(d) > 3.0 * np.abs(s0)), 3.0 * s0, d)
