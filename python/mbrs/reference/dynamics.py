"""Forces in absolute coordinates: r = M a + h - Q + Phi_q^T lam, per body force and moment about the centre of mass.

Each term is written once, as a jet: along changes of pose, twist and twist rate its derivatives are the tangents, at fixed world
components of v and a.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from ..errors import ModelError
from . import flexible
from . import joints as jt
from .assembly import RowsOf, row_map
from .jets import Jet, cross, jet, stack
from .kinematics import Moving, State, System, link_pair, motion, moving, unit_twists
from .laws import BoundLaw
from .linear import minimum_norm
from .reader import Link
from .rows import FREE, is_length
from .so3 import Array

EFFECTS = (
    *("gravity", "gyroscopic", "centrifugal", "preload-stiffness", "constraint-force-stiffness", "damping"),
    *("friction", "contact", "law-slopes", "drives", "nonholonomic"),
)
LEVELS = (jt.position_rows, jt.velocity_rows)


def check_effects(without: Collection[str]) -> None:
    for name in without:
        if name not in EFFECTS:
            raise ModelError(f"unknown effect {name!r}; known are {', '.join(EFFECTS)}")


def forcing_links(sys: System) -> list[Link]:
    """Elements, and joints with springs or dampers on their free coordinates."""
    return [*sys.elements, *(j for j in sys.joints if j.has_force and FREE[j.kind])]


def law_numbers(link: Link) -> tuple[Array, Array, Array]:
    """k, c (n, n) and preload (n,) of the n coordinates that the link has."""
    n = len(FREE[link.kind])
    return link.k[:n, :n], link.c[:n, :n], link.preload[:n]


class Forces:
    """Sums body by body of forces and moments about the centre of mass, rows in world axes."""

    def __init__(self, sys: System) -> None:
        self.parts: list[list[Jet]] = [[jet(np.zeros((1, 6)))] for _ in range(sys.nb)]

    def add(self, body: int, force: Any, moment: Any) -> None:
        if body >= 0:
            self.parts[body].append(force @ np.eye(3, 6) + moment @ np.eye(3, 6, 3))

    def add_pair(self, link: Link, p: jt.Pair, g: Jet) -> None:
        """The wrenches of a link, of power g (1, 6) times its relative twist."""
        for marker, both in zip((link.a, link.b), p.forces(g), strict=True):
            self.add(marker.body, *both)

    def add_flexible(self, body: flexible.Flexible, row: Jet) -> None:
        """A row (1, 6 + m) on the frame and the modal coordinates, which their carriers hold three by three."""
        self.parts[body.frame].append(row @ np.eye(6 + body.m, 6))
        for j, carrier in enumerate(body.carriers):
            self.parts[carrier].append(row @ np.eye(6 + body.m, 3, -6 - 3 * j) @ np.eye(3, 6))

    def row(self) -> Jet:
        """All of them, (1, 6 nb)."""
        return stack([sum(parts[1:], parts[0]).T for parts in self.parts]).T


def inertia(sys: System, now: Moving) -> Jet:
    """(m a, I alpha + w x I w) per body."""
    total = Forces(sys)
    for i, b in enumerate(sys.bodies):
        if b.mass != 0 or np.any(b.inertia != 0):
            (_, R), (_, w), (a, alpha) = now.pose[i], now.twist[i], now.rate[i]
            I = R @ (b.inertia @ R.T)  # noqa: E741
            total.add(i, b.mass * a, alpha @ I + cross(w, w @ I))
    for body in sys.flexible:
        total.add_flexible(body, flexible.inertia(body, flexible.moving(body, now)))
    return total.row()


def loads(sys: System, now: Moving, without: Collection[str] = ()) -> Jet:
    """Q of gravity, forces and torques."""
    total, zero = Forces(sys), jet(np.zeros((1, 3)))
    if "gravity" not in without and np.any(sys.gravity):
        for i, b in enumerate(sys.bodies):
            total.add(i, jet(b.mass * sys.gravity[None]), zero)
        for body in sys.flexible:
            total.add_flexible(body, flexible.weight(body, flexible.moving(body, now), sys.gravity))
    for load in sys.loads:
        value = jet(load.at(sys.t)[None])
        if load.kind == "modal":
            owner = next(f for f in sys.flexible if f.frame == load.body)
            total.add_flexible(owner, value @ np.eye(3, 1) @ np.eye(1, 6 + owner.m, 6 + load.component))
        elif load.body >= 0:
            R = now.pose[load.body][1]
            if load.follower:
                value = value @ (sys.bodies[load.body].R @ R.T)
            arm = load.s[None] @ R.T
            total.add(load.body, *((value, cross(arm, value)) if load.kind == "force" else (zero, value)))
    return total.row()


def law_force(law: BoundLaw, e: Jet, rate: Jet, without: Collection[str], memory: Array | None) -> Jet:
    """The law at its coordinate (1, 1) and rate, its memory held; centred if it is not given."""
    z = np.zeros(law.memory + law.n_memory) if memory is None else memory
    force, by_e, by_rate, _ = law(e.value[0, 0], rate.value[0, 0], z)
    out = jet(np.reshape(force, (1, 1)))
    if "law-slopes" not in without:
        out = out + by_e * (e - e.value)
        out = out if "damping" in without else out + by_rate * (rate - rate.value)
    return out


def elements(sys: System, now: Moving, without: Collection[str] = (), memory: Array | None = None) -> Jet:
    """Resisting forces G^T (preload + k e + c e' + laws) of all elements and joint springs."""
    total = Forces(sys)
    for link in forcing_links(sys):
        p, fixed = link_pair(link, now.pose), link_pair(link, now.still)
        G, twist = jt.slopes(FREE[link.kind], p), p.twist(now.twist[link.a.body], now.twist[link.b.body])
        e, rate = Jet(jt.coordinate_values(link, fixed, memory)[:, None], None), G @ twist.T
        if now.pose is not now.still:
            change = fixed.twist(now.displacement(link.a.body), now.displacement(link.b.body))
            e = Jet(e.value, G.value @ change.T.value)
        k, c, preload = law_numbers(link)
        f = preload[:, None] + k @ e + (0.0 if "damping" in without else 1.0) * (c @ rate)
        for law in link.laws:
            if law.acts(without):
                unit = np.eye(len(preload))[law.component][None]
                f = f + unit.T @ law_force(law, unit @ e, unit @ rate, without, memory)
        if "preload-stiffness" in without:
            p, G = fixed, jet(G.value)
        total.add_pair(link, p, f.T @ G)
    for body in sys.flexible:
        q, dq = (body.coordinates(both) for both in (now.pose, now.twist))
        pull = q @ body.K.T if "damping" in without else q @ body.K.T + dq @ body.C.T
        total.add_flexible(body, pull @ np.eye(body.m, 6 + body.m, 6))
    return total.row()


def multiplied(sys: System, lam: Array) -> Iterator[tuple[Link, RowsOf, Array]]:
    """Every joint with its rows of one level and their multipliers (1, n); velocity constraints last."""
    start = 0
    for rows_of in LEVELS:
        for link in sys.joints:
            n = len(rows_of(link))
            yield link, rows_of, lam[None, start : start + n]
            start += n


def constraint_forces(sys: System, now: Moving, lam: Array) -> Jet:
    """G^T lam of all joints."""
    total = Forces(sys)
    for link, rows_of, own in multiplied(sys, lam):
        for part, factor in jt.terms(link) if own.size else ():
            p = link_pair(part, now.pose)
            total.add_pair(part, p, factor * (own @ jt.slopes(rows_of(part), p)))
    return total.row()


def constraint_jacobian(sys: System, state: State) -> tuple[Array, Array]:
    """G (rows of all joints, 6 nb), velocity constraints last, and True for the rows whose multiplier is a force."""
    bodies, unit = motion(state), unit_twists(sys)
    G = [row_map(sys.joints, bodies, unit, rows_of).value.T for rows_of in LEVELS]
    force = [is_length(row) for rows_of in LEVELS for link in sys.joints for row in rows_of(link)]
    return np.concatenate(G), np.array(force, dtype=bool)


def multipliers(sys: System, state: State, f: Array) -> Array:
    """lam of all joint rows with G^T lam = -f, of least norm in (force, moment / L_c)."""
    G, force = constraint_jacobian(sys, state)
    weight = np.where(force, 1.0, sys.length)
    rows = np.tile(np.repeat([1.0, 1 / sys.length], 3), sys.nb)
    return weight * minimum_norm(rows[:, None] * G.T * weight, -rows * f)


def applied_residual(
    sys: System, state: State, a: Array, without: Collection[str] = (), memory: Array | None = None
) -> Array:
    """f = M a + h - Q without constraint forces, (6 nb,)."""
    now = moving(state, a)
    f = elements(sys, now, without, memory) - loads(sys, now, without)
    return (f if "centrifugal" in without else f + inertia(sys, now)).value[0]


def reactions(sys: System, state: State, lam: Array) -> dict[str, Array]:
    """Constraint wrench of every joint on its second body at the second body's marker, world axes, (6,) by name."""
    out = {link.name: np.zeros(6, dtype=lam.dtype) for link in sys.joints}
    bodies = motion(state)
    for link, rows_of, own in multiplied(sys, lam):
        p = link_pair(link, bodies)
        wrench = -(own @ jt.slopes(rows_of(link), p).value)[0].reshape(2, 3)
        out[link.name] = out[link.name] + (wrench @ p.A.value.T).ravel()  # both levels of a rolling disc
    return out
