"""Numbers by which the wake of a rotor is cut into filaments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from .._lib.checks import choice, count, real_number, shown
from ..errors import ModelError
from .filaments import CORES
from .lattice import Cores

__all__ = ["WakeOptions", "wake_options"]


@dataclass(frozen=True)
class WakeOptions:
    """Numbers by which a wake is cut into filaments; see `rotor_wake`."""

    strips: int
    steps: int
    lattice: int
    free: int
    mean: int
    tail: int
    cores: Cores
    threads: int

    @property
    def turn(self) -> float:
        """rad: of the rotor in a step."""
        return 2.0 * np.pi / self.steps

    @property
    def far(self) -> int:
        """Ages of the filaments behind the lattice."""
        return self.free + self.mean - self.lattice


class WakeKeywords(TypedDict, total=False):
    """Options of `rotor_wake` for those who make wakes on the way."""

    strips: int
    steps: int
    lattice: float
    free_turns: float
    mean_turns: float
    tail_turns: float
    core_radius: float | None
    core_growth: float
    core: str
    exponent: float
    threads: int


def wake_options(
    rotor_radius: float,
    *,
    strips: int = 16,
    steps: int = 24,
    lattice: float = np.pi / 3.0,
    free_turns: float = 2.0,
    mean_turns: float = 2.0,
    tail_turns: float = 10.0,
    core_radius: float | None = None,
    core_growth: float = 2e-4,
    core: str = "vatistas",
    exponent: float = 2.0,
    threads: int = 0,
) -> WakeOptions:
    """The options of `rotor_wake`, checked, of a rotor of a radius in m."""
    n = count("rotor_wake: steps", steps, 720, 12)
    if n % 2:
        raise ModelError(f"rotor_wake: steps must be even, it is {n}")
    behind = max(round(real_number("rotor_wake: lattice", lattice) * n / (2.0 * np.pi)), 2)
    given = {"free_turns": free_turns, "mean_turns": mean_turns, "tail_turns": tail_turns}
    free, mean, tail = (round(real_number(f"rotor_wake: {name}", v) * n) for name, v in given.items())
    if min(free, mean - n, tail) < n // 2:
        raise ModelError(
            f"rotor_wake: free_turns and tail_turns must be at least 0.5, mean_turns 1.5; they are {given}"
        )
    radius = 0.05 * rotor_radius if core_radius is None else real_number("rotor_wake: core_radius", core_radius)
    if not radius > 0.0:
        raise ModelError(f"rotor_wake: core_radius must be positive, it is {shown(core_radius)}")
    choice("core of filaments", core, CORES)
    cores = Cores(
        radius, real_number("rotor_wake: core_growth", core_growth), core, real_number("rotor_wake: exponent", exponent)
    )
    return WakeOptions(
        count("rotor_wake: strips", strips, 400, 4),
        n,
        behind,
        free,
        mean,
        tail,
        cores,
        count("threads", threads, 1000, 0),
    )
