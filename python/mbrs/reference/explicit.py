"""Explicit Runge-Kutta of order eight on tree increments, as in ``rust/src/analysis/transient/explicit8.rs``; and the
tight oracle, in minimal coordinates that may change from one output to the next:

    y" from [M J^T; J 0] [v'; lam] = [-h; -J' v - Phi_tt]

There y are increments of the independent tree coordinates; the dependent ones close the loops by Newton's method, so no
constraint drifts. Rows of redundant constraints are dropped by their rank at the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import ModelError
from .assembly import close_loops, jacobian, partition, scales
from .kinematics import State, System, advance
from .linear import pivots
from .motion import Motion, explicit_rates, increment_rates, tree_map, with_rates
from .so3 import Array
from .transient import History, Instant, acceleration, consistent, marched, moved


class Chart:
    """Minimal coordinates around a state: ``places`` determine poses, the fewer ``speeds`` velocities, since rows that
    restrict velocities alone leave places free.
    """

    def __init__(self, sys: System, state: State, t: float = 0.0) -> None:
        sys.t = t
        self.sys, self.base, self.part = sys, state, partition(sys, state)
        row, column = scales(sys, velocity=False)
        depend = pivots(row[:, None] * jacobian(sys, state, velocity=False) * column)
        self.places = np.setdiff1d(np.arange(sys.ny), depend)
        free = set(self.places.tolist())
        for joint in sys.tree:
            turns = range(joint.stop - 3, joint.stop) if joint.link.kind in ("spherical", "free") else ()
            if 0 < len(free.intersection(turns)) < 3:
                raise ModelError(
                    f"joint {joint.link.name!r}: its three rotations depend on each other through a loop, and the charts of "
                    "mbrs.reference hold them together; use generalised-alpha or BDF"
                )

    def pose(self, y: Array) -> State:
        increment = np.zeros(self.sys.ny)
        increment[self.places] = y
        return close_loops(self.sys, advance(self.sys, self.base, increment), fixed=self.places)

    def motion(self, t: float, y: Array, speed: Array, memory: Array) -> Motion:
        """The motion at the time t whose places are y after the start and whose independent rates are ``speed``: the
        others follow from J v + Phi_t = 0.
        """
        self.sys.t = t
        pose, rate, part = self.pose(y), np.zeros(self.sys.ny), self.part
        rate[part.independent] = speed
        if len(part.dependent):
            J = tree_map(self.sys, pose)[1].value.T[part.rows]
            miss = -explicit_rates(self.sys)[0][part.rows] - J @ rate
            rate[part.dependent] = np.linalg.solve(J[:, part.dependent], miss)
        return Motion(pose, rate, memory)

    def slopes(self, t: float, y: Array, speed: Array, memory: Array) -> tuple[Array, Array]:
        """Rates of the increments, which for three rotations that act together are J_l^-1 of the rates, and of the speeds."""
        m, increment = self.motion(t, y, speed, memory), np.zeros(self.sys.ny)
        increment[self.places] = y
        slope = acceleration(self.sys, m)[0][self.part.independent]
        return increment_rates(self.sys, increment, m.rate)[self.places], slope


def tableau() -> tuple[Array, Array]:
    """A (12, 12) and weights of Dormand and Prince's method of order 8 (Hairer, Norsett, Wanner, Solving ODEs I, 2nd
    ed., II.5), as SciPy holds them.
    """
    from scipy.integrate import DOP853

    return DOP853.A, DOP853.B


def explicit(sys: System, start: Instant, h: float, n: int, coefficients: Any = None) -> History:
    """n steps of length h (s) by the Runge-Kutta method (A, weights), of order 8 by default: theta' = J_l^-1(theta) v
    and v' of the equations with the rows at acceleration level; rows are closed and rates aligned after every step.
    """
    A, weights = tableau() if coefficients is None else coefficients
    history = History([start])
    for step in range(n):
        now = history.instants[-1].motion
        dy, dv = np.zeros((len(weights), sys.ny)), np.zeros((len(weights), sys.ny))
        for i, (row, node) in enumerate(zip(A, A.sum(axis=1), strict=True)):
            sys.t = start.t + (step + node) * h
            y = h * row[:i] @ dy[:i]
            sys.t = start.t + (step + np.sum(row[:i])) * h
            trial = moved(sys, now, y, now.rate + h * row[:i] @ dv[:i])
            dy[i], dv[i] = increment_rates(sys, y, trial.rate), acceleration(sys, trial)[0]
        end = moved(sys, now, h * weights @ dy, now.rate + h * weights @ dv)
        history.instants.append(marched(sys, consistent(sys, start.t + (step + 1) * h, end)))
    return history


def oracle(sys: System, start: Instant, times: Sequence[float] | Array, rtol: float = 1e-13) -> History:
    """The motion at ``times`` (s, ascending) by SciPy's DOP853 at rtol, a new chart at every one of them.

    Times must be so dense that no rotation of a ball joint or free body turns by pi between two, and that the
    independent coordinates stay independent. Scenes of a few bodies: the equations are plain NumPy.
    """
    from scipy.integrate import solve_ivp

    history = History([start])
    for t in np.asarray(times, dtype=float):
        now = history.instants[-1]
        if t <= now.t:
            continue
        chart = Chart(sys, with_rates(sys, now.motion), now.t)
        m, memory = len(chart.places), now.motion.memory

        def slope(t: float, z: Array, chart: Chart = chart, m: int = m, memory: Array = memory) -> Array:
            return np.concatenate(chart.slopes(t, z[:m], z[m:], memory))

        z = np.concatenate([np.zeros(m), now.motion.rate[chart.part.independent]])
        atol = 1e-2 * rtol * max(1.0, float(np.max(np.abs(z), initial=0.0)))
        run = solve_ivp(slope, (now.t, t), z, method="DOP853", rtol=rtol, atol=atol)
        end = chart.motion(t, run.y[:m, -1], run.y[m:, -1], memory)
        history.instants.append(marched(sys, consistent(sys, t, end)))
    return history
