"""Motion of a whole system: rates of the tree coordinates to twists of the bodies, where laws act, energy.

Tree coordinates y with rates v; twists of all bodies T v, rows J of the cut joints of both levels. Complex-safe.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import dynamics as dyn
from . import joints as jt
from . import so3
from .assembly import cut_jacobian, twist_map
from .flexible import height
from .jets import Jet, stack
from .kinematics import State, System, link_pair, motion, moving, split, tree_twists, twists_of, unit_twists
from .laws import BoundLaw
from .linearize import Linearization
from .rows import FREE
from .so3 import Array


@dataclass
class Motion:
    """Poses, rates of the tree coordinates (ny,), memory of all laws."""

    state: State
    rate: Array
    memory: Array


def tree_map(sys: System, state: State, moving: bool = False) -> tuple[Jet, Jet]:
    """T (6 nb, ny) of the centres of mass and J^T (ny, rows) of the cut rows, with their rates if ``moving``."""
    bodies = motion(state, (state.v, state.w)) if moving else motion(state)
    twists = tree_twists(sys, bodies)
    return stack([half.T for body in twists[:-1] for half in body]), cut_jacobian(sys, bodies, twists)


def with_rates(sys: System, state: State, rate: Array) -> State:
    """The state with the velocities that rates (ny,) of the tree coordinates make."""
    v, w = split(tree_map(sys, state)[0].value @ rate)
    return replace(state, v=v, w=w)


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


def increment_rates(sys: System, increment: Array, rate: Array) -> Array:
    """Rates of the increments: theta' = J_l^-1(theta) omega where three rotations act together, y' elsewhere."""
    out = np.array(rate)
    for t in sys.tree:
        if t.turns_freely:
            last = slice(t.stop - 3, t.stop)
            out[last] = so3.left_jacobian_inverse(t.sign * increment[last]) @ rate[last]
    return out


def remember(sys: System, m: Motion) -> Array:
    """Memories of the laws after the motion came here."""
    if sys.n_memory == 0:
        return m.memory
    state, out = with_rates(sys, m.state, m.rate), m.memory.copy()
    for law, u, v, _ in law_motions(sys, state, m.memory):
        out[law.memory : law.memory + law.n_memory] = law(u, v, m.memory)[3]
    bodies = motion(state)
    for link in dyn.forcing_links(sys):
        if link.turns is not None:
            places = jt.angle_places(link.kind)
            e = jt.coordinate_values(link, link_pair(link, bodies), m.memory)[places]
            out[link.turns : link.turns + len(places)] = e + jt.natural_value(link)
    return out


def law_motions(sys: System, state: State, memory: Array | None = None) -> list[tuple[BoundLaw, Array, Array, Array]]:
    """Every law with its displacement, rate and the row (6 nb,) that makes its rate from the twists of the bodies."""
    bodies, v, unit, out = motion(state), twists_of(state), unit_twists(sys), []
    for link in dyn.forcing_links(sys):
        if not link.laws:
            continue
        p = link_pair(link, bodies)
        rows = jt.slopes(FREE[link.kind], p).value @ p.twist(unit[link.a.body], unit[link.b.body]).value.T
        e = jt.coordinate_values(link, p, memory)
        out += [(law, e[i], rows[i] @ v, rows[i]) for law in link.laws for i in [law.component]]
    return out


def law_rows(sys: System, lin: Linearization) -> list[tuple[BoundLaw, Array, Array]]:
    """Every law with its displacement at a linearised state and its direction w (dof,) in the minimal coordinates."""
    T = twist_map(sys, motion(lin.state), lin.partition).value
    return [(law, u, row @ T) for law, u, _, row in law_motions(sys, lin.state)]


def positions(sys: System, m: Motion) -> Array:
    """Origins of all bodies (nb, 3), world."""
    return np.array([m.state.r[i] - m.state.R[i] @ b.com for i, b in enumerate(sys.bodies[: sys.n_bodies])])


def energy(sys: System, m: Motion) -> float:
    """Kinetic energy, that of weight, and that of linear springs."""
    state = with_rates(sys, m.state, m.rate)
    v, bodies = twists_of(state), motion(state)
    momentum = dyn.inertia(sys, moving(state.at_rest, v)).value[0]
    total = 0.5 * v @ momentum
    total = total - sum(b.mass * sys.gravity @ state.r[i] for i, b in enumerate(sys.bodies))
    for body in sys.flexible:
        q = body.held(state.r)
        total = total + 0.5 * q @ body.K @ q - height(body, state, sys.gravity)
    for link in dyn.forcing_links(sys):
        e = jt.coordinate_values(link, link_pair(link, bodies))
        k, _, preload = dyn.law_numbers(link)
        total = total + preload @ e + 0.5 * e @ k @ e
    return float(total.real)
