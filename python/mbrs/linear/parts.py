"""Symmetric and skew parts."""

from __future__ import annotations

import numpy as np


def split(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Symmetric and skew part over the first two axes."""
    t = np.swapaxes(x, 0, 1)
    return 0.5 * (x + t), 0.5 * (x - t)
