"""A mass on a spring that strikes a stop."""

from __future__ import annotations

from ..model.laws import Gap
from ..model.model import Model


def gap_problem(mass: float = 1.0, k: float = 100.0, stop: float = 1e4, gap: float = 0.05, speed: float = 2.0) -> Model:
    """A mass on the guide "guide" along x with a spring to ground and a stop on one side: x" = -(k x + stop max(x - gap,
    0)) / mass.

    ``k`` and ``stop`` N/m, ``gap`` m, ``speed`` m/s towards the stop at the start, x = 0. Data invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.gap_problem()).dof
    1
    """
    m = Model("gap problem")
    b = m.body("mass", mass=mass, inertia=(1e-3, 1e-3, 1e-3), at=(0, 0, 0), velocity=(speed, 0, 0))
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis="x", k=k, law=Gap(stop, gap))
    return m
