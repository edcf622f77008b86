"""Lags of first order, y + lag y' = force, over steps."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["lag_step", "lagged"]


def lag_step(h: Any, lag: Any, y: Any, force: Any, later: Any) -> Any:
    """y after a step h of y + lag y' = force, exactly for a force that goes straight from ``force`` to ``later``; shapes that broadcast."""
    keep = np.exp(-h / lag)
    ramp = 1.0 - (1.0 - keep) * lag / h
    return keep * y + (1.0 - keep) * force + ramp * (later - force)


def lagged(h: np.ndarray, force: np.ndarray, lag: np.ndarray) -> np.ndarray:
    """(n, ...) that begins as ``force`` (n, ...) and follows it over n - 1 steps ``h`` with lags ``lag``, both (n - 1, ...) in s."""
    out = force.copy()
    steps = np.broadcast_to(h, lag.shape)
    for i in range(len(steps)):
        out[i + 1] = lag_step(steps[i], lag[i], out[i], force[i], force[i + 1])
    return out
