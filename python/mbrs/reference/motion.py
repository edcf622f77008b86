"""Motion in time by the scheme of ``rust/src/analysis/transient/explicit.rs``, and where laws act.

Tree coordinates y with rates v, classical Runge-Kutta on joint increments, rows J of cut joints of both levels:
[M J^T; J 0] [v'; lam] = [-h; -J' v]. After a step position rows are closed, then v is projected, in the norm of M; what
laws remember is frozen within a step. Complex-safe: a complex step in x gives the derivative of the discrete motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import dynamics as dyn
from . import joints as jt
from . import so3
from .assembly import cut_jacobian, scales
from .flexible import height
from .jets import Jet, stack
from .kinematics import State, System, advance, link_pair, motion, tree_twists
from .laws import BoundLaw
from .linear import pivots
from .linearize import Linearization, split
from .so3 import Array


@dataclass
class Motion:
    """Poses, rates of the tree coordinates (ny,), memory of all laws."""

    state: State
    rate: Array
    memory: Array


def start(sys: System, state: State, rate: Array) -> Motion:
    """A motion that begins with sliders centred."""
    dtype = np.result_type(sys.x, float)
    return Motion(state, np.asarray(rate, dtype=dtype), np.zeros(sys.n_memory, dtype=dtype))


def tree_map(sys: System, state: State, moving: bool = False) -> tuple[Jet, Jet]:
    """T (6 nb, ny) of the centres of mass and J^T (ny, rows) of the cut rows, with their rates if ``moving``."""
    bodies = motion(state, (state.v, state.w)) if moving else motion(state)
    twists = tree_twists(sys, bodies)
    return stack([half.T for body in twists[:-1] for half in body]), cut_jacobian(sys, bodies, twists)


def with_rates(sys: System, m: Motion) -> State:
    """The state with the velocities that the tree's rates make."""
    v, w = split(tree_map(sys, m.state)[0].value @ m.rate)
    return replace(m.state, v=v, w=w)


def independent_rows(sys: System, state: State) -> tuple[Array, int]:
    """Cut rows that imply the others, position rows first, and how many of these there are."""
    row, column = scales(sys)
    J = row[:, None] * tree_map(sys, state)[1].value.T.real * column
    velocity = velocity_rows(sys)
    position = np.flatnonzero(~velocity)
    kept = list(position[pivots(J[position].T)])
    n = len(kept)
    for i in np.flatnonzero(velocity):
        if len(pivots(J[[*kept, i]].T)) > len(kept):
            kept.append(i)
    return np.array(kept, dtype=int), n


def velocity_rows(sys: System) -> Array:
    """True for the cut rows that restrict velocities only."""
    flags = [[False] * len(jt.position_rows(link)) + [True] * len(jt.velocity_rows(link)) for link in sys.cut]
    return np.array([f for link in flags for f in link], dtype=bool)


def explicit_rates(sys: System) -> tuple[Array, Array]:
    """Phi_t and Phi_tt of the cut rows at the time of the system: what drives do by themselves."""
    out: list[Any] = []
    for link in sys.cut:
        if link.motion is not None:
            out.append(-link.motion(sys.t)[1:])
        else:
            out += [np.zeros(2)] * len(jt.all_rows(link))
    both = np.array(out).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def accelerations(sys: System, m: Motion, rows: Array) -> Array:
    """v' of the tree coordinates."""
    state = with_rates(sys, m)
    T, Jt = tree_map(sys, state, moving=True)
    drift = T.derivative(1) @ m.rate
    h = T.value.T @ dyn.applied_residual(sys, state, drift, memory=m.memory)
    J, turning = Jt.value.T[rows], (Jt.derivative(1).T @ m.rate)[rows]
    M = mass(sys, state, T.value)
    turning = turning + explicit_rates(sys)[1][rows]
    return np.linalg.solve(_saddle(M, J), np.concatenate([-h, -turning]))[: sys.ny]


def mass(sys: System, state: State, T: Array) -> Array:
    """T^T M T."""
    return T.T @ dyn.inertia_tangents(sys, state, np.zeros(6 * sys.nb))[2] @ T


def _saddle(M: Array, J: Array) -> Array:
    return np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]])


def _correction(M: Array, J: Array, miss: Array) -> Array:
    return np.linalg.solve(_saddle(M, J), np.concatenate([np.zeros(len(M)), miss]))[: len(M)]


def project(sys: System, m: Motion, rows: Array, n_position: int) -> Motion:
    """Position rows closed by three Newton steps, then rates that satisfy all rows."""
    from .assembly import constraint_values

    state = m.state
    if len(rows) == 0:
        return m
    if n_position:
        position = np.flatnonzero(~velocity_rows(sys))
        which = np.searchsorted(position, rows[:n_position])
        for _ in range(3):
            T, Jt = tree_map(sys, state)
            miss = -constraint_values(sys, state, sys.cut)[which]
            step = _correction(mass(sys, state, T.value), Jt.value.T[rows[:n_position]], miss)
            state = advance(sys, state, step)
    T, Jt = tree_map(sys, state)
    J = Jt.value.T[rows]
    miss = -J @ m.rate - explicit_rates(sys)[0][rows]
    rate = m.rate + _correction(mass(sys, state, T.value), J, miss)
    return Motion(state, rate, m.memory)


def increment_rates(sys: System, increment: Array, rate: Array) -> Array:
    """Rates of the increments: theta' = J_l^-1(theta) omega where three rotations act together, y' elsewhere."""
    out = np.array(rate)
    for t in sys.tree:
        if t.link.kind in ("spherical", "free"):
            last = slice(t.stop - 3, t.stop)
            out[last] = so3.left_jacobian_inverse(t.sign * increment[last]) @ rate[last]
    return out


def turned_increment(sys: System, dy: Array, h: float, v0: Array, v1: Array) -> Array:
    """dy - h^2/12 v0 x v1 of three rotations that act together: the rotation vector of a step whose rate goes evenly from v0
    to v1, to fourth order (Magnus' series, in the axes of the joint's first body). Coordinates of a reversed joint count
    backwards.
    """
    parts, place = [], 0
    for t in sys.tree:
        if t.link.kind in ("spherical", "free"):
            last = slice(t.stop - 3, t.stop)
            parts += [dy[place : t.stop - 3], dy[last] - t.sign * h * h / 12 * np.cross(v0[last], v1[last])]
            place = t.stop
    return np.concatenate([*parts, dy[place:]])


def remember(sys: System, m: Motion) -> Array:
    """Memories of the laws after the motion came here."""
    if sys.n_memory == 0:
        return m.memory
    state, out = with_rates(sys, m), m.memory.copy()
    for law, u, v, _ in law_motions(sys, state, m.memory):
        out[law.memory : law.memory + law.n_memory] = law(u, v, m.memory)[3]
    bodies = motion(state)
    for link in dyn.forcing_links(sys):
        if link.turns is not None:
            places = jt.angle_places(link.kind)
            e = jt.continued_values(link, link_pair(link, bodies), m.memory)[places]
            out[link.turns : link.turns + len(places)] = e + (link.length if link.kind == "torsion" else 0.0)
    return out


def law_motions(sys: System, state: State, memory: Array | None = None) -> list[tuple[BoundLaw, Array, Array, Array]]:
    """Every law with its displacement, rate and the row (6 nb,) that makes its rate from the twists of the bodies."""
    bodies, v, out = motion(state), dyn.twists_of(state), []
    for link in dyn.forcing_links(sys):
        if not link.laws:
            continue
        p = link_pair(link, bodies)
        on = dyn.reach(link, jt.coordinate_rows(link.kind, p), p)
        e = jt.continued_values(link, p, memory)
        for law in link.laws:
            row = np.zeros(6 * sys.nb, dtype=np.result_type(on.J.value, float))
            row[on.columns] = on.J.value[on.kept, law.component]
            out.append((law, e[law.component], row @ v, row))
    return out


def law_rows(sys: System, lin: Linearization) -> list[tuple[BoundLaw, Array, Array]]:
    """Every law with its displacement at a linearised state and its direction w (dof,) in the minimal coordinates."""
    from .assembly import twist_map

    T = twist_map(sys, motion(lin.state), lin.partition).value
    return [(law, u, row @ T) for law, u, _, row in law_motions(sys, lin.state)]


def step(sys: System, m: Motion, h: float, rows: Array, n_position: int) -> Motion:
    """One step of length h from the time that the system holds, which moves on."""
    slopes: list[tuple[Array, Array]] = []
    before = sys.t
    for fraction in (0.0, 0.5 * h, 0.5 * h, h):
        sys.t = before + fraction
        increment, trial = 0 * m.rate, m
        if fraction:
            dy, dv = slopes[-1]
            increment = fraction * dy
            trial = Motion(advance(sys, m.state, increment), m.rate + fraction * dv, m.memory)
        slopes.append((increment_rates(sys, increment, trial.rate), accelerations(sys, trial, rows)))
    weights = np.array([h / 6, h / 3, h / 3, h / 6])
    total = [weights @ np.array([s[i] for s in slopes]) for i in range(2)]
    moved = Motion(advance(sys, m.state, total[0]), m.rate + total[1], m.memory)
    moved = project(sys, moved, rows, n_position)
    return replace(moved, memory=remember(sys, moved))


def integrate(sys: System, m: Motion, h: float, n: int) -> list[Motion]:
    """The motion after every step, the start included."""
    rows, n_position = independent_rows(sys, m.state)
    history = [m]
    for _ in range(n):
        history.append(step(sys, history[-1], h, rows, n_position))
    return history


def positions(sys: System, m: Motion) -> Array:
    """Origins of all bodies (nb, 3), world."""
    return np.array([m.state.r[i] - m.state.R[i] @ b.com for i, b in enumerate(sys.bodies[: sys.n_bodies])])


def energy(sys: System, m: Motion) -> float:
    """Kinetic energy, that of weight, and that of linear springs."""
    state = with_rates(sys, m)
    v, bodies = dyn.twists_of(state), motion(state)
    total = 0.5 * v @ dyn.inertia_tangents(sys, state, np.zeros(6 * sys.nb))[2] @ v
    total = total - sum(b.mass * sys.gravity @ state.r[i] for i, b in enumerate(sys.bodies))
    for body in sys.flexible:
        q = body.coordinates(state.r)
        total = total + 0.5 * q @ body.K @ q - height(body, state, sys.gravity)
    for link in dyn.forcing_links(sys):
        e = jt.coordinate_values(link, link_pair(link, bodies))
        k, _, preload = dyn.law_numbers(link)
        total = total + preload @ e + 0.5 * e @ k @ e
    return float(total.real)
