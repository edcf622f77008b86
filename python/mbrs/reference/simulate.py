"""A motion in equal steps by a scheme of choice."""

from __future__ import annotations

from typing import Any

from .bdf import bdf4
from .explicit import explicit
from .generalized_alpha import generalized_alpha
from .kinematics import State, System
from .transient import History, begin


def simulate(sys: System, state: State, t: float, step: float, method: str = "generalized-alpha") -> History:
    """The motion up to t (s) in equal steps (s) by "generalized-alpha", "bdf" (order 4) or "explicit" (order 8).

    Cost O(n_steps (n_y + n_rows)^3): everything is dense.

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.reference import System, drawn_state, simulate
    >>> x = np.r_[np.zeros(3), 1, np.zeros(6), 1, 1, 1, 1, np.zeros(3), 2.0, np.zeros(5)]  # flies along x at 2 m/s
    >>> s = System(dict(x=x, body_name=["b"], body_x=[0]))
    >>> simulate(s, drawn_state(s), 0.5, 0.1).positions(s)[-1, 0].round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    schemes: dict[str, Any] = {"generalized-alpha": generalized_alpha, "bdf": bdf4, "explicit": explicit}
    if method not in schemes:
        raise ValueError(f"unknown method {method!r}; known are {', '.join(schemes)}")
    n = max(1, round(t / step))
    history: History = schemes[method](sys, begin(sys, state), t / n, n)
    return history
