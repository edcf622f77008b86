"""Equations of motion in absolute coordinates, once more: what every scheme in time of this package steps through.

    M(q) a + h(q, v) - Q(q, v, t) + G(q)^T lam = 0,    Phi(q) = 0,    G(q) v = 0

per body the centre of mass in the world and a rotation matrix; velocities (r', w) and accelerations (r'', w') in the
world. All joints are constraints, redundant ones included: multipliers are those of least norm.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from . import dynamics as dyn
from . import joints as jt
from . import so3
from .assembly import constraint_values, link_rows
from .kinematics import State, System, link_pair, motion
from .linear import RANK_TOLERANCE
from .so3 import Array


@dataclass
class Instant:
    """A state at a time, with accelerations (6 nb,) and multipliers of all rows; ``a`` holds (r'', w') body by body."""

    t: float
    state: State
    a: Array
    lam: Array
    memory: Array


@dataclass
class History:
    """What a scheme went through, step by step, and how many Newton iterations it took."""

    instants: list[Instant] = field(default_factory=list)
    iterations: int = 0

    @property
    def t(self) -> Array:
        return np.array([i.t for i in self.instants])

    def positions(self, sys: System) -> Array:
        """Origins of all bodies (n_t, nb, 3), world."""
        return np.array([origins(sys, i.state) for i in self.instants])

    def energies(self, sys: System) -> Array:
        """(n_t,) energy of inertia, weight and linear springs."""
        return np.array([state_energy(sys, i.state) for i in self.instants])


def origins(sys: System, state: State) -> Array:
    """Origins of all bodies (nb, 3), world."""
    return np.array([state.r[i] - state.R[i] @ b.com for i, b in enumerate(sys.bodies)])


def state_energy(sys: System, state: State) -> float:
    """Kinetic energy, that of weight, and that of linear springs; laws are not counted."""
    v, bodies = dyn.twists_of(state), motion(state)
    total = 0.5 * v @ dyn.inertia_tangents(sys, state, np.zeros(6 * sys.nb))[2] @ v
    total = total - sum(b.mass * sys.gravity @ state.r[i] for i, b in enumerate(sys.bodies))
    for link in dyn.forcing_links(sys):
        e = jt.coordinate_values(link, link_pair(link, bodies))
        k, _, preload = dyn.law_numbers(link)
        total = total + preload @ e + 0.5 * e @ k @ e
    return float(np.real(total))


def moved(state: State, q: Array) -> State:
    """The state after increments (dr, dtheta) (6 nb,) in the world: R <- exp(dtheta) R; velocities stay."""
    d = q.reshape(-1, 6)
    R = np.array([so3.exp(d[i, 3:]) @ state.R[i] for i in range(len(d))])
    return replace(state, r=state.r + d[:, :3], R=R)


def with_velocity(state: State, v: Array) -> State:
    """The state with twists v (6 nb,)."""
    v = v.reshape(-1, 6)
    return replace(state, v=v[:, :3], w=v[:, 3:])


def gaps(sys: System, state: State) -> Array:
    """Phi of all position rows."""
    return constraint_values(sys, state, sys.joints)


def jacobian_rate(sys: System, state: State) -> Array:
    """dG/dt (rows, 6 nb), rows as in `dynamics.constraint_jacobian`."""
    bodies, blocks = motion(state, (state.v, state.w)), [np.zeros((0, 6 * sys.nb))]
    for table in (jt.CONSTRAINTS, jt.VELOCITY_CONSTRAINTS):
        for link in sys.joints:
            rows = table.get(link.kind, [])
            if rows:
                p = link_pair(link, bodies)
                on = dyn.reach(link, link_rows(link, p, rows), p)
                block = np.zeros((len(rows), 6 * sys.nb))
                block[:, on.columns] = on.J.derivative(1)[on.kept].T
                blocks.append(block)
    return np.concatenate(blocks)


@dataclass
class Scaling:
    """What makes the equations free of units: lengths by L_c, moments by L_c, the step by itself."""

    q: Array
    force: Array
    row: Array

    @classmethod
    def of(cls, sys: System) -> Scaling:
        """Increments in metres times 1/L_c, moments times 1/L_c, rows in metres times 1/L_c."""
        length = sys.length
        q = np.tile(np.repeat([length, 1.0], 3), sys.nb)
        return cls(q, np.tile(np.repeat([1.0, 1 / length], 3), sys.nb), np.where(_length_rows(sys), 1 / length, 1.0))


def _length_rows(sys: System) -> Array:
    flags = [
        jt.is_length(row)
        for table in (jt.CONSTRAINTS, jt.VELOCITY_CONSTRAINTS)
        for link in sys.joints
        for row in table.get(link.kind, [])
    ]
    return np.array(flags, dtype=bool)


def least_norm(A: Array, b: Array) -> Array:
    """x of least norm with A x = b for a matrix of any rank, by singular values above 1e-9 of the largest."""
    return np.linalg.lstsq(A, b, rcond=RANK_TOLERANCE)[0]


def saddle(A: Array, G: Array) -> Array:
    """[A G^T; G 0]."""
    return np.block([[A, G.T], [G, np.zeros((len(G), len(G)))]])


def project_velocity(sys: System, state: State) -> State:
    """The nearest velocities, in the norm of M, with G v = 0."""
    v, G = dyn.twists_of(state), dyn.constraint_jacobian(sys, state)[0]
    if len(G) == 0:
        return state
    M = dyn.inertia_tangents(sys, state, np.zeros(6 * sys.nb))[2]
    s = Scaling.of(sys)
    root = np.linalg.cholesky(M)
    # dv = M^-1 G^T x of least norm: with L^T dv = (G L^-T)^+ miss
    A = np.linalg.solve(root, (s.row[:, None] * G).T).T
    return with_velocity(state, v + np.linalg.solve(root.T, least_norm(A, -s.row * (G @ v))))


def acceleration(sys: System, state: State, memory: Array) -> tuple[Array, Array]:
    """a and lam of [M G^T; G 0] [a; lam] = [Q - h; -G' v] (METHODS.md c.3), of least norm where rows are redundant."""
    zero = np.zeros(6 * sys.nb)
    f, M = dyn.applied_residual(sys, state, zero, memory=memory), dyn.inertia_tangents(sys, state, zero)[2]
    G, s = dyn.constraint_jacobian(sys, state)[0], Scaling.of(sys)
    drift = jacobian_rate(sys, state) @ dyn.twists_of(state)
    root = np.linalg.cholesky(M)
    A = np.linalg.solve(root, (s.row[:, None] * G).T).T
    free = np.linalg.solve(M, -f)
    force = least_norm(A @ A.T, s.row * (G @ free + drift))
    lam = s.row * force
    return free - np.linalg.solve(M, G.T @ lam), lam


def begin(sys: System, state: State) -> Instant:
    """A consistent start at t = 0: velocities projected, accelerations and multipliers solved for, sliders centred."""
    state = project_velocity(sys, state)
    memory = np.zeros(sys.n_memory)
    a, lam = acceleration(sys, state, memory)
    return Instant(0.0, state, a, lam, memory)


def tangents(sys: System, state: State, a: Array, lam: Array) -> tuple[Array, Array, Array]:
    """K, C, M of the residual, world components of v and a held."""
    K, C, M = dyn.inertia_tangents(sys, state, a)
    Ke, Ce = dyn.element_tangents(sys, state)
    K = K + Ke + dyn.load_forces(sys, state)[1] + dyn.constraint_stiffness(sys, state, lam)
    return K, C + Ce, M


def memory_after(sys: System, state: State, memory: Array) -> Array:
    """What laws remember at the end of a step."""
    from .motion import law_motions

    out = memory.copy()
    for law, u, v, _ in law_motions(sys, state) if sys.n_memory else []:
        out[law.memory : law.memory + law.n_memory] = law(u, v, memory)[3]
    return out


def newton(residual: Any, matrix: Any, update: Any, limit: int = 30) -> int:
    """Iterates until the scaled step is at rounding: below 1e-14, or below 1e-9 and no longer halved. Counts steps."""
    previous = np.inf
    for count in range(1, limit + 1):
        d = least_norm(matrix(), -residual())
        update(d)
        size = float(np.max(np.abs(d)))
        if size < 1e-14 or (size < 1e-9 and size > 0.5 * previous):
            return count
        previous = size
    raise ConvergenceError(f"the step's equations were not solved in {limit} iterations; take a smaller step")


def simulate(sys: System, state: State, t: float, step: float, method: str = "generalized-alpha") -> History:
    """The motion up to t (s) in equal steps (s) by "generalized-alpha", "bdf" (order 4) or "explicit" (order 8).

    Cost O(n_steps (6 n_b + n_rows)^3): everything is dense.

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.reference import System, drawn_state, simulate
    >>> x = np.r_[np.zeros(3), 1, np.zeros(6), 1, 1, 1, 1, np.zeros(3), 2.0, np.zeros(5)]  # flies along x at 2 m/s
    >>> s = System(dict(x=x, body_name=["b"], body_x=[0]))
    >>> simulate(s, drawn_state(s), 0.5, 0.1).positions(s)[-1, 0].round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    from .bdf import bdf4
    from .explicit import explicit
    from .generalized_alpha import generalized_alpha

    schemes: dict[str, Any] = {"generalized-alpha": generalized_alpha, "bdf": bdf4, "explicit": explicit}
    if method not in schemes:
        raise ValueError(f"unknown method {method!r}; known are {', '.join(schemes)}")
    n = max(1, round(t / step))
    history: History = schemes[method](sys, begin(sys, state), t / n, n)
    return history
