"""Forces and tangents in absolute coordinates: r = M a + h - Q + Phi_q^T lam, increments (dr, dtheta) per body at the
centre of mass.

Tangents are partial derivatives at fixed world components of v and a: K by (dr, dtheta), C by (dv, dw), M by (da,
dalpha).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..errors import ModelError
from . import flexible
from . import joints as jt
from .assembly import link_rows
from .jets import Jet, jet
from .kinematics import GROUND_MOTION, State, System, link_pair, motion
from .linear import minimum_norm
from .reader import Link
from .so3 import Array, skew

EFFECTS = (
    *("gravity", "gyroscopic", "centrifugal", "preload-stiffness", "constraint-force-stiffness", "damping"),
    *("friction", "contact", "law-slopes", "drives", "nonholonomic"),
)


def check_effects(without: Collection[str]) -> None:
    for name in without:
        if name not in EFFECTS:
            raise ModelError(f"unknown effect {name!r}; known are {', '.join(EFFECTS)}")


LEVELS = (jt.position_rows, jt.velocity_rows)


def _zeros(sys: System, state: State, *shape: int) -> Array:
    return np.zeros(shape, dtype=np.result_type(state.r, state.R, state.v, sys.x, float))


def body_rows(body: int) -> slice:
    return slice(6 * body, 6 * body + 6)


def forcing_links(sys: System) -> list[Link]:
    """Elements, and joints with springs or dampers on their free coordinates."""
    return [*sys.elements, *(j for j in sys.joints if j.has_force and jt.FREE[j.kind])]


def law_numbers(link: Link) -> tuple[Array, Array, Array]:
    """k, c (n, n) and preload (n,) of the n coordinates that the link has."""
    n = sum(3 if c == "log" else 1 for c, _ in jt.FREE[link.kind])
    return link.k[:n, :n], link.c[:n, :n], link.preload[:n]


# --- inertia -----


def world_inertia(sys: System, state: State, i: int) -> Array:
    return state.R[i] @ sys.bodies[i].inertia @ state.R[i].T


def inertia_force(sys: System, state: State, a: Array) -> Array:
    """(m a, I alpha + w x I w) per body for accelerations a (6 nb,)."""
    f = _zeros(sys, state, 6 * sys.nb).astype(np.result_type(a, state.r, sys.x))
    for i, b in enumerate(sys.bodies):
        inertia, w, k = world_inertia(sys, state, i), state.w[i], 6 * i
        f[k : k + 3] = b.mass * a[k : k + 3]
        f[k + 3 : k + 6] = inertia @ a[k + 3 : k + 6] + np.cross(w, inertia @ w)
    for body in sys.flexible:
        f[body.places] += flexible.inertia(body, flexible.moving(body, state, a)).value[0]
    return f


def inertia_tangents(sys: System, state: State, a: Array) -> tuple[Array, Array, Array]:
    """K, C, M of the inertia forces: with dI = [dtheta] I - I [dtheta],

    d(I alpha + w x I w) = ([I alpha]^T + I [alpha] + [w] ([I w]^T + I [w])) dtheta + ([w] I - [I w]) dw + I dalpha.
    """
    n = 6 * sys.nb
    K, C, M = (_zeros(sys, state, n, n).astype(np.result_type(a, state.r, state.w, sys.x)) for _ in range(3))
    for i, b in enumerate(sys.bodies):
        inertia, w, k = world_inertia(sys, state, i), state.w[i], 6 * i
        alpha, rot = a[k + 3 : k + 6], slice(k + 3, k + 6)
        M[k : k + 3, k : k + 3] = b.mass * np.eye(3)
        M[rot, rot] = inertia
        C[rot, rot] = skew(w) @ inertia - skew(inertia @ w)
        K[rot, rot] = inertia @ skew(alpha) - skew(inertia @ alpha)
        K[rot, rot] += skew(w) @ (inertia @ skew(w) - skew(inertia @ w))
    for body in sys.flexible:
        n, place = 6 + body.m, np.ix_(body.places, body.places)
        now = flexible.moving(body, state, a, directions=True)
        slopes = flexible.inertia(body, now).derivative_along(3 * n)[:, 0].T
        for j, total in enumerate((K, C, M)):
            total[place] += slopes[:, j * n : (j + 1) * n]
    return K, C, M


# --- given loads -----


def load_forces(sys: System, state: State, gravity: bool = True) -> tuple[Array, Array]:
    """Q (6 nb,) of gravity, forces and torques, and its tangent -dQ/dq."""
    Q, K = _zeros(sys, state, 6 * sys.nb), _zeros(sys, state, 6 * sys.nb, 6 * sys.nb)
    for i, b in enumerate(sys.bodies):
        if gravity:
            Q[6 * i : 6 * i + 3] += b.mass * sys.gravity
    for body in sys.flexible if gravity and np.any(sys.gravity) else ():
        pull = flexible.weight(body, flexible.moving(body, state, 0 * Q, directions=True), sys.gravity)
        Q[body.places] += pull.value[0]
        K[np.ix_(body.places, body.places)] -= pull.derivative_along(18 + 3 * body.m)[: 6 + body.m, 0].T
    for load in sys.loads:
        if load.body < 0:
            continue
        if load.kind == "modal":
            owner = next(f for f in sys.flexible if f.frame == load.body)
            Q[owner.modal_places[load.component]] += load.at(sys.t)[0]
            continue
        R, k = state.R[load.body], 6 * load.body
        arm, value = R @ load.s, load.at(sys.t)
        if load.follower:
            value = R @ sys.bodies[load.body].R.T @ value
        force, rot = slice(k, k + 3), slice(k + 3, k + 6)
        turning = -skew(value) if load.follower else np.zeros((3, 3))  # d value = turning dtheta
        if load.kind == "force":
            Q[force] += value
            Q[rot] += np.cross(arm, value)
            K[force, rot] -= turning
            K[rot, rot] -= skew(value) @ skew(arm) + skew(arm) @ turning
        else:
            Q[rot] += value
            K[rot, rot] -= turning
    return Q, K


# --- elements and constraints -----


@dataclass
class Reach:
    """Action of a link on its two bodies: J^T (12, n) and its derivative (12 directions, 12, n), and the rows'
    place in 6 nb.
    """

    J: Jet
    columns: Array
    kept: Array

    def add_matrix(self, total: Array, part: Array) -> None:
        total[np.ix_(self.columns, self.columns)] += part[np.ix_(self.kept, self.kept)]

    def add_vector(self, total: Array, part: Array) -> None:
        total[self.columns] += part[self.kept]

    def take(self, total: Array) -> Array:
        out = np.zeros(12, dtype=total.dtype)
        out[self.kept] = total[self.columns]
        return out

    def geometric(self, f: Array) -> Array:
        """d(J^T f)/dq at fixed f, (12, 12)."""
        return (self.J.derivative_along(12) @ f).T


def directions(state: State, link: Link) -> tuple[tuple[Jet, Jet], tuple[Jet, Jet]]:
    """The link's two bodies moving along (dr_a, dtheta_a, dr_b, dtheta_b) one unit at a time, twelve at once."""
    unit = np.eye(12)
    out = []
    for body, start in ((link.a.body, 0), (link.b.body, 6)):
        if body < 0:
            c, R = np.zeros(3), np.eye(3)
        else:
            c, R = state.r[body], state.R[body]
        velocity, spin = unit[:, start : start + 3], unit[:, start + 3 : start + 6]
        out.append((Jet(c[None, :], velocity[:, None, :]), Jet(R, skew(spin) @ R)))
    return out[0], out[1]


def unit_twists() -> tuple[tuple[Jet, Jet], tuple[Jet, Jet]]:
    unit = np.eye(12)
    a, b = (tuple(jet(unit[:, s + k : s + k + 3]) for k in (0, 3)) for s in (0, 6))
    return (a[0], a[1]), (b[0], b[1])


def reach(link: Link, rows: Jet, p: jt.Pair) -> Reach:
    ids = [(body, side) for side, body in enumerate((link.a.body, link.b.body)) if body >= 0]
    columns = np.concatenate([6 * body + np.arange(6) for body, _ in ids])
    kept = np.concatenate([6 * side + np.arange(6) for _, side in ids])
    return Reach(p.twist(*unit_twists()) @ rows.T, columns, kept)


def link_response(
    link: Link, e: Array, rate: Array, damping: bool, without: Collection[str] = (), memory: Array | None = None
) -> tuple[Array, Array, Array]:
    """Forces of a link's coordinates, preload + k e + c e' + laws, and their slopes; memory centred if not given."""
    k, c, f = law_numbers(link)
    f = f + k @ e
    if damping:
        f = f + c @ rate
    else:
        c = 0 * c
    for law in link.laws:
        if not law.acts(without):
            continue
        i = law.component
        z = np.zeros(law.memory + law.n_memory) if memory is None else memory
        force, by_e, by_rate, _ = law(e[i], rate[i], z)
        unit = np.eye(len(f))[i]
        f = f + force * unit
        if "law-slopes" not in without:
            k = k + by_e * np.outer(unit, unit)
            c = c + (by_rate if damping else 0.0) * np.outer(unit, unit)
    return f, k, c


def element_force(
    sys: System,
    state: State,
    damping: bool = True,
    without: Collection[str] = (),
    memory: Array | None = None,
) -> Array:
    """Resisting forces J^T (preload + k e + c e' + laws) of all elements and joint springs, (6 nb,)."""
    total, bodies, v = _zeros(sys, state, 6 * sys.nb), motion(state), twists_of(state)
    for link in forcing_links(sys):
        p = link_pair(link, bodies)
        on = reach(link, jt.coordinate_rows(link.kind, p), p)
        J = on.J.value
        e = jt.continued_values(link, p, memory)
        f, _, _ = link_response(link, e, J.T @ on.take(v), damping, without, memory)
        total = total.astype(np.result_type(total, f), copy=False)
        on.add_vector(total, J @ f)
    for body in sys.flexible:
        q, rate = body.coordinates(state.r), body.coordinates(state.v)
        total = total.astype(np.result_type(total, q, rate, body.K), copy=False)
        total[body.modal_places] += body.K @ q + (body.C @ rate if damping else 0.0)
    return total


def element_tangents(
    sys: System, state: State, damping: bool = True, geometric: bool = True, without: Collection[str] = ()
) -> tuple[Array, Array]:
    """K and C of the elements: J^T k J + (d J^T) f + J^T c (dJ v), and J^T c J."""
    n = 6 * sys.nb
    K, C, v = _zeros(sys, state, n, n), _zeros(sys, state, n, n), twists_of(state)
    for link in forcing_links(sys):
        p = jt.pair(link, *directions(state, link))
        on = reach(link, jt.coordinate_rows(link.kind, p), p)
        J, own = on.J.value, on.take(v)
        f, k, c = link_response(link, jt.coordinate_values(link, p), J.T @ own, damping, without)
        rate = np.swapaxes(on.J.derivative_along(12), -1, -2) @ own  # (12 directions, n)
        part = J @ k @ J.T + J @ c @ rate.T
        on.add_matrix(K, part + on.geometric(f) if geometric else part)
        on.add_matrix(C, J @ c @ J.T)
    for body in sys.flexible:
        place = np.ix_(body.modal_places, body.modal_places)
        K[place] += body.K
        C[place] += body.C if damping else 0.0
    return K, C


def twists_of(state: State) -> Array:
    """(v, w) per body in one vector (6 nb,)."""
    return np.concatenate([state.v, state.w], axis=1).reshape(-1)


def constraint_jacobian(sys: System, state: State) -> tuple[Array, Array]:
    """G (rows of all joints, 6 nb), velocity constraints last, and True for the rows whose multiplier is a force."""
    bodies, blocks, force = motion(state), [np.zeros((0, 6 * sys.nb))], [np.zeros(0, dtype=bool)]
    for rows_of in LEVELS:
        for link in sys.joints:
            rows = rows_of(link)
            if rows:
                block = np.zeros((len(rows), 6 * sys.nb), dtype=np.result_type(state.r, state.R, sys.x, float))
                for part, factor in jt.terms(link):
                    p = link_pair(part, bodies)
                    on = reach(part, link_rows(part, p, rows_of(part)), p)
                    block[:, on.columns] += factor * on.J.value[on.kept].T
                blocks.append(block)
                force.append(np.array([jt.is_length(row) for row in rows]))
    return np.concatenate(blocks), np.concatenate(force)


def multipliers(sys: System, state: State, f: Array) -> Array:
    """lam of all joint rows with G^T lam = -f, of least norm in (force, moment / L_c)."""
    G, force = constraint_jacobian(sys, state)
    weight = np.where(force, 1.0, sys.length)
    rows = np.tile(np.repeat([1.0, 1 / sys.length], 3), sys.nb)
    return weight * minimum_norm(rows[:, None] * G.T * weight, -rows * f)


def constraint_stiffness(sys: System, state: State, lam: Array) -> Array:
    """d(G^T lam)/dq of all joints."""
    K = _zeros(sys, state, 6 * sys.nb, 6 * sys.nb).astype(np.result_type(lam, state.r))
    start = 0
    for rows_of in LEVELS:
        for link in sys.joints:
            rows = rows_of(link)
            if rows:
                for part, factor in jt.terms(link):
                    p = jt.pair(part, *directions(state, part))
                    on = reach(part, link_rows(part, p, rows_of(part)), p)
                    on.add_matrix(K, on.geometric(factor * lam[start : start + len(rows)]))
                start += len(rows)
    return K


def applied_residual(
    sys: System, state: State, a: Array, without: Collection[str] = (), memory: Array | None = None
) -> Array:
    """f = M a + h - Q without constraint forces, (6 nb,)."""
    Q, _ = load_forces(sys, state, "gravity" not in without)
    f = element_force(sys, state, "damping" not in without, without, memory) - Q
    return f if "centrifugal" in without else f + inertia_force(sys, state, a)


def reactions(sys: System, state: State, lam: Array) -> dict[str, Array]:
    """Constraint wrench of every joint on its second body at the second body's marker, world axes, (6,) by name."""
    out: dict[str, Array] = {}
    bodies, start = [*motion(state)[:-1], GROUND_MOTION], 0
    for rows_of in LEVELS:
        for link in sys.joints:
            rows = rows_of(link)
            if not rows and link.name in out:
                continue
            p = link_pair(link, bodies)
            wrench = -(lam[start : start + len(rows)] @ link_rows(link, p, rows).value)
            A = p.A.value
            made = np.concatenate([A @ wrench[:3], A @ wrench[3:]])
            out[link.name] = out[link.name] + made if link.name in out else made  # both levels of a rolling disc
            start += len(rows)
    return out
