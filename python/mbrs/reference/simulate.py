"""Equations of motion in tree coordinates, integrated by SciPy and projected onto the constraints:

    M(q) v' + h(q, v, t) + J^T lam = 0,    Phi(q, t) = 0,    J v + Phi_t = 0             (docs/theory.md (3.9))

q are poses that move by increments of the tree coordinates, v their rates, J the rows of all cut joints, redundant ones
included: multipliers are those of least norm; the time is what ``sys.t`` holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from . import dynamics as dyn
from .assembly import close_loops, constraint_values, scales
from .kinematics import State, System, advance, moving, twists_of
from .linear import minimum_norm
from .motion import (
    Motion,
    energy,
    explicit_rates,
    increment_rates,
    positions,
    remember,
    tree_map,
    velocity_rows,
    with_rates,
)
from .so3 import Array


@dataclass
class Instant:
    """A motion at a time, with its accelerations (ny,) and the multipliers of all rows."""

    t: float
    motion: Motion
    a: Array
    lam: Array


@dataclass
class History:
    """A motion, instant by instant."""

    instants: list[Instant] = field(default_factory=list)

    @property
    def t(self) -> Array:
        return np.array([i.t for i in self.instants])

    @property
    def rates(self) -> Array:
        """(n_t, ny) rates of the tree coordinates."""
        return np.array([i.motion.rate for i in self.instants])

    def positions(self, sys: System) -> Array:
        """Origins of all bodies (n_t, nb, 3), world."""
        return np.array([positions(sys, i.motion) for i in self.instants])

    def energies(self, sys: System) -> Array:
        """(n_t,) energy of inertia, weight and linear springs; laws are not counted."""
        return np.array([energy(sys, i.motion) for i in self.instants])


def rows(sys: System, m: Motion) -> tuple[Array, Array]:
    """Phi, zero for rows that restrict velocities only, and J (rows, ny)."""
    velocity = velocity_rows(sys)
    J = tree_map(sys, m.state)[1].value.T
    phi = np.zeros(len(velocity), dtype=J.dtype)
    phi[~velocity] = constraint_values(sys, m.state, sys.cut)
    return phi, J


def row_rates(sys: System, rate: Array, J: Array) -> Array:
    """J v + Phi_t."""
    return J @ rate + explicit_rates(sys)[0]


def mass_matrix(sys: System, state: State) -> Array:
    """M (ny, ny)."""
    T = tree_map(sys, state)[0].value
    pushed = dyn.inertia(sys, moving(state.at_rest, np.zeros(len(T)), rate=T.T))
    return T.T @ pushed.derivative_along(sys.ny)[:, 0].T


def ways(sys: System, state: State) -> Array:
    """Tree increments (ny, ny) of unit kinetic energy: the shortest combination moves the least."""
    return np.linalg.inv(np.linalg.cholesky(mass_matrix(sys, state))).T


def close(sys: System, m: Motion) -> Motion:
    """The position rows brought to zero by Newton steps of least kinetic energy."""
    return replace(m, state=close_loops(sys, m.state, 1e-14, ways=lambda state: ways(sys, state)))


def align(sys: System, m: Motion) -> Motion:
    """Rates brought to J v + Phi_t = 0 by the change of least kinetic energy."""
    J, s = rows(sys, m)[1], scales(sys)[0]
    if len(J) == 0:
        return m
    W = ways(sys, m.state)
    return replace(m, rate=m.rate + W @ minimum_norm(s[:, None] * J @ W, -s * row_rates(sys, m.rate, J)))


def acceleration(sys: System, m: Motion) -> tuple[Array, Array]:
    """v' and lam of [M J^T; J 0] [v'; lam] = [-h; -J' v - Phi_tt] (docs/theory.md (3.9))."""
    state = with_rates(sys, m)
    T, Jt = tree_map(sys, state, moving=True)
    now, J = moving(state, T.derivative(1) @ m.rate, rate=T.value.T), Jt.value.T
    pushed = dyn.inertia(sys, now)
    f = dyn.elements(sys, now, memory=m.memory) - dyn.loads(sys, now) + pushed
    M = T.value.T @ pushed.derivative_along(sys.ny)[:, 0].T
    free = np.linalg.solve(M, -T.value.T @ f.value[0])
    if len(J) == 0:
        return free, np.zeros(0)
    s, bias = scales(sys)[0], Jt.derivative(1).T @ m.rate + explicit_rates(sys)[1]
    A = np.linalg.solve(np.linalg.cholesky(M), (s[:, None] * J).T).T
    lam = s * minimum_norm(A @ A.T, s * (J @ free + bias))
    return free - np.linalg.solve(M, J.T @ lam), lam


def consistent(sys: System, t: float, m: Motion) -> Instant:
    """Closed, aligned, with accelerations: what an accepted step ends with."""
    sys.t = t
    m = align(sys, close(sys, m))
    return Instant(t, m, *acceleration(sys, m))


def begin(sys: System, state: State, rate: Array | None = None) -> Instant:
    """A consistent start at t = 0 with sliders centred; rates from the state's velocities unless they are given."""
    sys.t = 0.0
    if rate is None:
        rate = np.linalg.lstsq(tree_map(sys, state)[0].value, twists_of(state), rcond=None)[0]
    return consistent(sys, 0.0, Motion(state, np.asarray(rate, dtype=float), np.zeros(sys.n_memory)))


def advance_memory(sys: System, end: Instant) -> Instant:
    """An accepted end, its memories brought there."""
    return replace(end, motion=replace(end.motion, memory=remember(sys, end.motion)))


def simulate(
    sys: System, start: State | Instant, times: Sequence[float] | Array, rtol: float = 1e-13, method: str = "DOP853"
) -> History:
    """The motion at ``times`` (s, ascending, from 0) by a method of SciPy's ``solve_ivp``; closed and aligned at every one.

    The unknowns between two times are increments of all tree coordinates from the first of them, theta' = J_l^-1(theta) v for
    three rotations that act together, and rates v with the rows at acceleration level; they begin anew where such a rotation has
    come a radian far. Sliders of laws move at the times only. Scenes of a few bodies: the equations are plain NumPy.

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.reference import System, drawn_state, simulate
    >>> x = np.r_[np.zeros(3), 1, np.zeros(6), 1, 1, 1, 1, np.zeros(3), 2.0, np.zeros(5)]  # flies along x at 2 m/s
    >>> s = System(dict(x=x, body_name=["b"], body_x=[0]))
    >>> simulate(s, drawn_state(s), [0.25, 0.5]).positions(s)[-1, 0].round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    from scipy.integrate import solve_ivp

    free = np.array(
        [t.start + k for t in sys.tree if t.turns_freely for k in range(len(t.coordinates) - 3, len(t.coordinates))]
    )

    def radian_left(t: float, z: Array) -> float:
        """Zero where a rotation vector has come a radian far: there the increments begin anew."""
        return 1.0 - float(np.max(np.abs(z[free]), initial=0.0)) if len(free) else 1.0

    radian_left.terminal = True  # type: ignore[attr-defined]
    history = History([start if isinstance(start, Instant) else begin(sys, start)])
    now = history.instants[-1]
    for end in np.asarray(times, dtype=float):
        while now.t < end:

            def slope(t: float, z: Array, now: Instant = now) -> Array:
                sys.t = t
                y, rate = np.split(z, 2)
                m = Motion(advance(sys, now.motion.state, y), rate, now.motion.memory)
                return np.concatenate([increment_rates(sys, y, rate), acceleration(sys, m)[0]])

            z = np.concatenate([np.zeros(sys.ny), now.motion.rate])
            atol = 1e-2 * rtol * max(1.0, float(np.max(np.abs(z), initial=0.0)))
            found = solve_ivp(slope, (now.t, end), z, method=method, rtol=rtol, atol=atol, events=radian_left)
            y, rate = np.split(found.y[:, -1], 2)
            m = Motion(advance(sys, now.motion.state, y), rate, now.motion.memory)
            now = advance_memory(sys, consistent(sys, float(found.t[-1]), m))
        if now.t > history.instants[-1].t:
            history.instants.append(now)
    return history
