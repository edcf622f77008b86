"""Long ladders: closed loops by the hundred, of which the modes are known.

A ladder of N layers whose rungs sway: stiles of mass m_s and length l turn by (x_i - x_(i-1))/l on four hinges with springs k_h
in each layer, rungs of mass m_r (the last one half) shift by x_i. Bloch waves solve it exactly:

    omega_j^2 = 2 k (1 - cos p) / (m_r + (2 m_s/3)(2 + cos p)),   p = (2 j - 1) pi/(2 N),   k = 4 k_h/l^2
"""

from __future__ import annotations

import mbrs as mb
import numpy as np
from mbrs._lib.rotations import quaternion_matrix

Q = np.array([0.31, -0.52, 0.47, 0.64])
WORLD = Q / np.linalg.norm(Q)


def ladder(n: int, *, m_r: float, m_s: float, k_h: float, length: float, order: bool = False) -> mb.Model:
    """Turned in space; ``order``: the upper hinges of each layer are defined before the lower ones, which cuts other joints."""
    R, width = quaternion_matrix(WORLD), 0.7 * length
    m, below = mb.Model("ladder"), None

    def at(x: float, y: float) -> tuple[float, ...]:
        return tuple(R @ np.array([x, y, 0.0]))

    for i in range(1, n + 1):
        around = (m_s * length**2 / 12, 0.03 * m_s * length**2, m_s * length**2 / 12)
        stiles = [
            m.body(
                f"S{i},{u}", mass=m_s, inertia=around, at=at((u - 0.5) * width, (i - 0.5) * length), orientation=WORLD
            )
            for u in (0, 1)
        ]
        mass = m_r if i < n else m_r / 2
        rung = m.body(
            f"R{i}", mass=mass, inertia=(0.02 * m_r * length**2,) * 3, at=at(0.0, i * length), orientation=WORLD
        )
        carrier = m.ground if below is None else below
        lower = [(f"a{i},{u}", carrier, stiles[u], at((u - 0.5) * width, (i - 1) * length)) for u in (0, 1)]
        upper = [(f"b{i},{u}", stiles[u], rung, at((u - 0.5) * width, i * length)) for u in (0, 1)]
        for name, a, b, point in upper + lower if order else lower + upper:
            m.revolute(name, a, b, at=point, axis=tuple(R[:, 2]), k=k_h)
        below = rung
    return m


def exact(n: int, count: int, *, m_r: float, m_s: float, k_h: float, length: float) -> np.ndarray:
    """The first circular frequencies."""
    p = (2 * np.arange(1, count + 1) - 1) * np.pi / (2 * n)
    k = 4 * k_h / length**2
    return np.sqrt(4 * k * np.sin(p / 2) ** 2 / (m_r + (2 * m_s / 3) * (2 + np.cos(p))))


NUMBERS = (
    {"m_r": 1.0, "m_s": 0.5, "k_h": 10.0, "length": 0.2},
    {"m_r": 0.37, "m_s": 2.3, "k_h": 4.1e3, "length": 13.7},
)
