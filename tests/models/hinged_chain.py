"""A long chain of rods."""

from __future__ import annotations

import mbrs as mb
import numpy as np


def hinged_chain(n: int) -> mb.Model:
    """Rods on hinges with oblique, unequal axes."""
    rng = np.random.default_rng(n)
    m = mb.Model("chain", gravity=(0.0, 1.0, -9.81))
    before, place, d = m.ground, np.zeros(3), np.array([0.6, 0.3, -0.2])
    for i in range(n):
        body = m.body(f"b{i}", mass=0.3, inertia=(0.01, 0.012, 0.009), at=place + d / 2)
        m.revolute(f"j{i}", before, body, at=place, axis=rng.normal(size=3))
        before, place = body, place + d
    return m
