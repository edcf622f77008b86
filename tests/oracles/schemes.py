"""A motion in equal steps by a scheme of choice."""

from __future__ import annotations

from typing import Any

from mbrs.reference.kinematics import State, System
from mbrs.reference.simulate import begin
from oracles.bdf import bdf4
from oracles.explicit import explicit
from oracles.generalized_alpha import generalized_alpha
from oracles.steps import Steps

SCHEMES: dict[str, Any] = {"generalized-alpha": generalized_alpha, "bdf": bdf4, "explicit": explicit}


def simulate(sys: System, state: State, t: float, step: float, method: str = "generalized-alpha") -> Steps:
    """The motion up to t (s) in equal steps (s) by "generalized-alpha", "bdf" (order 4) or "explicit" (order 8).

    Cost O(n_steps (n_y + n_rows)^3): everything is dense.
    """
    n = max(1, round(t / step))
    history: Steps = SCHEMES[method](sys, begin(sys, state), t / n, n)
    return history
