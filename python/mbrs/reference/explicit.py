"""Explicit Runge-Kutta of order eight on tree increments, as in ``rust/src/analysis/transient/explicit8.rs``; and the
tight oracle, in minimal coordinates that may change from one output to the next:

    (B^T M B) y" = -B^T (M B' y' + h - Q),   q' = B y',   B = B' B'' (METHODS.md a.2)

There y are increments of the independent tree coordinates; the dependent ones close the loops by Newton's method, so no
constraint drifts. Rows of redundant constraints are dropped by their rank at the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import ModelError
from . import dynamics as dyn
from .assembly import close_loops, cut_jacobian, jacobian, null_space, partition, scales, twist_map
from .kinematics import State, System, advance, motion, tree_twists
from .linear import pivots
from .linearize import split
from .motion import Motion, increment_rates, with_rates
from .so3 import Array
from .transient import History, Instant, acceleration, consistent, marched, moved


class Chart:
    """Minimal coordinates around a state: ``places`` determine poses, the fewer ``speeds`` velocities, since rows that
    restrict velocities alone leave places free.
    """

    def __init__(self, sys: System, state: State) -> None:
        self.sys, self.base, self.part = sys, state, partition(sys, state)
        row, column = scales(sys, velocity=False)
        depend = pivots(row[:, None] * jacobian(sys, state, velocity=False) * column)
        self.places = np.setdiff1d(np.arange(sys.ny), depend)
        free = set(self.places.tolist())
        for t in sys.tree:
            turns = range(t.stop - 3, t.stop) if t.link.kind in ("spherical", "free") else ()
            if 0 < len(free.intersection(turns)) < 3:
                raise ModelError(
                    f"joint {t.link.name!r}: its three rotations depend on each other through a loop, and the charts of "
                    "mbrs.reference hold them together; use generalised-alpha or BDF"
                )

    @property
    def size(self) -> int:
        return len(self.places)

    def speeds(self, state: State) -> Array:
        """Rates of the independent coordinates in a state with consistent velocities."""
        B = twist_map(self.sys, motion(state), self.part).value
        return np.linalg.lstsq(B, dyn.twists_of(state), rcond=None)[0]

    def pose(self, y: Array) -> State:
        increment = np.zeros(self.sys.ny)
        increment[self.places] = y
        return close_loops(self.sys, advance(self.sys, self.base, increment), fixed=self.places)

    def state(self, y: Array, speed: Array) -> State:
        """The state at increments y of the places, with the speeds of `speeds`."""
        pose = self.pose(y)
        v, w = split(twist_map(self.sys, motion(pose), self.part).value @ speed)
        return replace(pose, v=v, w=w)

    def motion(self, y: Array, speed: Array, memory: Array) -> Motion:
        """The same with the rates of all tree coordinates."""
        pose = self.pose(y)
        return Motion(pose, self._rate(pose, speed), memory)

    def slopes(self, y: Array, speed: Array, memory: Array) -> tuple[Array, Array]:
        """Rates of the increments and of the speeds."""
        state = self.state(y, speed)
        T = twist_map(self.sys, motion(state, (state.v, state.w)), self.part)
        drift = T.derivative(1) @ speed
        f = dyn.applied_residual(self.sys, state, drift, memory=memory)
        M = dyn.inertia_tangents(self.sys, state, np.zeros(6 * self.sys.nb))[2]
        slope = np.linalg.solve(T.value.T @ M @ T.value, -T.value.T @ f)
        return self._increment_rates(state, y, speed), slope

    def _rate(self, state: State, speed: Array) -> Array:
        """Rates of all tree coordinates."""
        if len(self.part.dependent) == 0:
            return speed
        bodies = motion(state)
        return null_space(cut_jacobian(self.sys, bodies, tree_twists(self.sys, bodies)), self.part).value @ speed

    def _increment_rates(self, state: State, y: Array, speed: Array) -> Array:
        """Three rotations that act together turn by J_l^-1 of their vector."""
        increment = np.zeros(self.sys.ny)
        increment[self.places] = y
        return increment_rates(self.sys, increment, self._rate(state, speed))[self.places]


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
        for i, row in enumerate(A):
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
        chart = Chart(sys, with_rates(sys, now.motion))
        m, memory = chart.size, now.motion.memory

        def slope(_: float, z: Array, chart: Chart = chart, m: int = m, memory: Array = memory) -> Array:
            return np.concatenate(chart.slopes(z[:m], z[m:], memory))

        z = np.concatenate([np.zeros(m), chart.speeds(chart.base)])
        atol = 1e-2 * rtol * max(1.0, float(np.max(np.abs(z), initial=0.0)))
        run = solve_ivp(slope, (now.t, t), z, method="DOP853", rtol=rtol, atol=atol)
        end = chart.motion(run.y[:m, -1], run.y[m:, -1], memory)
        history.instants.append(marched(sys, consistent(sys, t, end)))
    return history
