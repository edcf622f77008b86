"""The system, its states, and the motion of bodies as jets."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from . import joints as jt
from . import laws, reader, so3
from .flexible import frames_named, modal_links, read_flexible
from .jets import Jet, column, cross, dot, jet, power
from .reader import Link
from .rows import Row, is_length
from .so3 import Array
from .topology import TreeJoint, spanning_tree


@dataclass
class State:
    """Centres of mass (nb, 3) in the world, rotation matrices (nb, 3, 3), velocities and angular velocities (nb,
    3) in the world.
    """

    r: Array
    R: Array
    v: Array
    w: Array

    @property
    def at_rest(self) -> State:
        return replace(self, v=0 * self.v, w=0 * self.w)


class System:
    """The tables as objects, with the spanning tree, the cut joints and the names of the coordinates.

    Parameters
    ----------
    tables
        The dict of docs/tables.md.
    x
        Numbers in place of ``tables["x"]``; may be complex (complex step).

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.reference import System
    >>> x = np.r_[np.zeros(3), 1, np.zeros(6), 1, 1, 1, 1, np.zeros(9)]  # at rest at the origin, 1 kg
    >>> System(dict(x=x, body_name=["b"], body_x=[0])).coordinates[:2]
    ['b.x', 'b.y']
    """

    def __init__(self, tables: Mapping[str, Any], x: Array | None = None) -> None:
        tables = self.tables = frames_named(tables)
        self.x = np.asarray(tables["x"] if x is None else x)
        self.bodies = reader.read_bodies(tables, self.x)
        self.n_bodies = len(self.bodies)
        self.flexible = read_flexible(tables, self.x, self.bodies)
        self.joints = reader.read_joints(tables, self.x, self.bodies)
        self.elements = reader.read_elements(tables, self.x, self.bodies)
        self.n_memory = laws.attach(tables, self.x, self.elements, self.joints)
        self.loads = reader.read_loads(tables, self.x, self.bodies)
        reader.refuse_others(tables)
        self.gravity = reader.read_gravity(tables, self.x)
        carriers = [i for f in self.flexible for i in f.carriers]
        links = modal_links(tables, self.x, self.bodies, self.flexible)
        self.tree, self.cut = spanning_tree(self.bodies, self.joints, links, carriers)
        imposed = reader.read_imposed(tables, self.x, self.joints)
        # rows like those of joints that are cut
        self.joints, self.cut = [*self.joints, *imposed], [*self.cut, *imposed]
        self.t = 0.0  # what motions read; linear analyses hold it
        self.length = reader.characteristic_length(reader.located_points(tables, self.x, self.bodies))

    def leaving_out(self, without: Collection[str]) -> System:
        """The system without drives or without nonholonomic rows, where these effects are named."""
        if not {"drives", "nonholonomic"} & set(without):
            return self
        out = copy(self)
        for name in ("joints", "cut"):
            kept = [link for link in getattr(self, name) if not ("drives" in without and link.kind == "drive")]
            slides = "nonholonomic" in without
            setattr(out, name, [replace(link, slides=slides) if jt.velocity_rows(link) else link for link in kept])
        return out

    @property
    def nb(self) -> int:
        return len(self.bodies)

    @property
    def n_tree(self) -> int:
        """Coordinates of the joints of the tree; the modal ones follow."""
        return self.tree[-1].stop if self.tree else 0

    @property
    def ny(self) -> int:
        return self.n_tree + sum(f.m for f in self.flexible)

    def modal_coordinates(self) -> list[tuple[Any, int]]:
        """Every flexible body with the place of its first modal coordinate among all."""
        starts = np.cumsum([self.n_tree, *(f.m for f in self.flexible)])
        return [(f, int(i)) for f, i in zip(self.flexible, starts, strict=False)]

    @cached_property
    def coordinates(self) -> list[str]:
        """Names of the tree coordinates and of the modal ones."""
        names = [name for t in self.tree for name in t.names]
        return names + [f"{f.name}.q{k + 1}" for f in self.flexible for k in range(f.m)]

    @cached_property
    def is_length(self) -> Array:
        """True for the tree coordinates in metres."""
        tree = [is_length(row) for t in self.tree for row in t.coordinates]
        return np.array(tree + [False] * (self.ny - self.n_tree), dtype=bool)


def drawn_state(sys: System) -> State:
    """The state as drawn, velocities included, with nothing assembled or projected."""
    b = sys.bodies
    return State(
        *(
            np.array(v)
            for v in ([o.centre for o in b], [o.R for o in b], [o.velocity for o in b], [o.angular_velocity for o in b])
        )
    )


def first_guess(sys: System) -> State:
    """The drawn state, with the bodies that have one at their guessed pose (origin 0:3, quaternion 3:7 at
    ``pose_x``).
    """
    state = drawn_state(sys)
    guesses = list(zip(sys.tables.get("pose_body", ()), sys.tables.get("pose_x", ()), strict=True))
    for body, i in guesses:
        state.R[body] = so3.from_quaternion(sys.x[i + 3 : i + 7])
        state.r[body] = sys.x[i : i + 3] + state.R[body] @ sys.bodies[body].com
    for f in sys.flexible if guesses else ():
        drawn = sys.bodies[f.frame]
        for node in f.nodes:
            state.R[node] = state.R[f.frame]
            arm = drawn.R.T @ (sys.bodies[node].centre - drawn.centre)
            state.r[node] = state.r[f.frame] + state.R[f.frame] @ arm
    return state


Motion = list[jt.Vectors]
GROUND_MOTION = (jet(np.zeros((1, 3))), jet(np.eye(3)))


def split(twists: Array) -> tuple[Array, Array]:
    """(..., 6 nb) to translations and rotations (..., nb, 3)."""
    t = twists.reshape(*twists.shape[:-1], twists.shape[-1] // 6, 6)
    return t[..., :3], t[..., 3:]


def twists_of(state: State) -> Array:
    """(v, w) per body in one vector (6 nb,)."""
    return np.concatenate([state.v, state.w], axis=1).reshape(-1)


def motion(state: State, *derivatives: tuple[Array, Array]) -> Motion:
    """Jets of every body's (centre of mass (1, 3), rotation matrix), ground last so that index -1 finds it.

    No derivative: the pose alone. One, (velocities, angular velocities), (nb, 3) or (m, nb, 3) for m directions. Two:
    their rates too.
    """
    out = []
    for i in range(len(state.r)):
        centre, frame = [state.r[i][None, :]], [state.R[i]]
        if derivatives:
            W = so3.skew(derivatives[0][1][..., i, :])
            centre.append(derivatives[0][0][..., i, None, :])
            frame.append(W @ state.R[i])
            if len(derivatives) == 2:
                centre.append(derivatives[1][0][..., i, None, :])
                frame.append((so3.skew(derivatives[1][1][..., i, :]) + W @ W) @ state.R[i])
        out.append((Jet(*centre), Jet(*frame)))
    return [*out, GROUND_MOTION]


@dataclass
class Moving:
    """Bodies in motion, ground last: poses, twists, their rates, and the poses without derivatives."""

    pose: Motion
    twist: list[jt.Vectors]
    rate: list[jt.Vectors]
    still: Motion

    def displacement(self, body: int) -> jt.Vectors:
        """The changes (m, 1, 3) of a pose along all directions, as values."""
        centre, R = self.pose[body]
        if body < 0:
            return GROUND_MOTION[0], GROUND_MOTION[0]
        return jet(centre.derivative()), jet(so3.vee(R.derivative() @ R.value.T)[..., None, :])


def moving(
    state: State, a: Array, pose: Array | None = None, twist: Array | None = None, rate: Array | None = None
) -> Moving:
    """The motion with twist rates a (6 nb,); with derivatives along m changes of pose, twists and their rates, each (m, 6 nb)."""

    def vectors(values: Array, changes: Array | None) -> list[jt.Vectors]:
        jets = [Jet(v[None], None) for v in values.reshape(-1, 3)]
        if changes is not None:
            jets = [Jet(j.value, changes[:, None, 3 * i : 3 * i + 3]) for i, j in enumerate(jets)]
        return [*zip(jets[::2], jets[1::2], strict=True), (GROUND_MOTION[0], GROUND_MOTION[0])]

    still = [(Jet(centre.value, None), Jet(R.value, None)) for centre, R in motion(state)]
    poses = still if pose is None else motion(state, split(pose))
    return Moving(poses, vectors(twists_of(state), twist), vectors(a, rate), still)


def link_pair(link: Link, bodies: Motion) -> jt.Pair:
    return jt.pair(link, bodies[link.a.body], bodies[link.b.body])


def unit_twists(sys: System) -> list[jt.Vectors]:
    """Every body moved alone: (6 nb, 3) each, ground last."""
    v, w = split(np.eye(6 * sys.nb))
    zero = jet(np.zeros((6 * sys.nb, 3)))
    return [*((jet(v[:, i]), jet(w[:, i])) for i in range(sys.nb)), (zero, zero)]


def _axis(t: TreeJoint, bodies: Motion, row: Row) -> Jet:
    """A coordinate's axis (1, 3) in the world, with the sign that makes it the motion of the outer body."""
    a, b = t.link.a, t.link.b
    m = b if row[0] == "beta" or (t.sign < 0 and t.link.kind != "universal") else a
    return t.sign * column(bodies[m.body][1] @ m.F, row[1])


def tree_twists(sys: System, bodies: Motion) -> list[jt.Vectors]:
    """Jets of B' body by body, ground last: (translations of the centre of mass, rotations), each (ny, 3), world axes.

    q_j = T(c_j - c_i) q_i + T(-(P - c_j)) diag(R, R) D delta (docs/theory.md (5.8)), joints from ground outwards.
    """
    one = np.eye(sys.ny)
    zero = jet(np.zeros((sys.ny, 3)))
    twists = [(zero, zero)] * (sys.nb + 1)
    for f, start in sys.modal_coordinates():
        for j, carrier in enumerate(f.carriers):
            held = one[:, start + 3 * j : min(start + 3 * j + 3, start + f.m)]
            twists[carrier] = (jet(np.pad(held, ((0, 0), (0, 3 - held.shape[1])))), zero)
    starts = {f.frame: start for f, start in sys.modal_coordinates()}
    for t in sys.tree:
        if t.link.kind == "modal":
            twists[t.outer] = _modal_twist(t, bodies, twists[t.inner], one[starts[t.link.a.body] :])
            continue
        trans, rot = twists[t.inner]
        centre, R = bodies[t.outer]
        arm = -(t.markers[1].s[None, :] @ R.T)
        trans = trans + cross(rot, centre - bodies[t.inner][0])
        for i, row in enumerate(t.coordinates):
            select, axis = one[:, t.start + i, None], _axis(t, bodies, row)
            if row[0] == "u":
                trans = trans + select @ axis
            else:
                rot, trans = rot + select @ axis, trans + select @ (cross(axis, arm) + t.link.pitch * axis)
        twists[t.outer] = (trans, rot)
    return twists


def _modal_twist(t: TreeJoint, bodies: Motion, inner: jt.Vectors, one: Array) -> jt.Vectors:
    """The twist of a node from that of its frame, or the other way round. ``one``: rows of all coordinates from the first
    modal one on.

    The node's rotation Rx Ry Rz turns about x of the frame, the line across x and the node's z, and the node's z.
    """
    frame, node = bodies[t.link.a.body], bodies[t.link.b.body]
    shape = t.link.node.shape
    select = one[: shape.shape[1]].T
    x, z = column(frame[1], 0), column(node[1], 2)
    across = cross(z, x)
    axes = (x, power(dot(across, across), -0.5) * across, z)
    q = t.link.node.owner.coordinates(bodies)
    turned = q.map(lambda c: np.einsum("...ak,ikl->...li", c, t.link.node.quadratic))
    slip = (select @ (jet(shape[:3].T) + turned)) @ frame[1].T
    turn = jet(np.zeros((len(select), 3)))
    for axis, row in zip(axes, shape[3:], strict=True):
        turn = turn + (select @ row)[:, None] @ axis
    trans, rot = inner
    arm = node[0] - frame[0]
    if t.sign > 0:
        return trans + cross(rot, arm) + slip, rot + turn
    rot = rot - turn
    return trans - cross(rot, arm) - slip, rot


def place_modal(t: TreeJoint, r: Array, R: Array) -> None:
    """Write into r, R the pose of a node from that of its frame, or the other way round."""
    u, turn = t.link.node.pose(r)
    if t.sign > 0:
        r[t.outer], R[t.outer] = r[t.inner] + R[t.inner] @ u, R[t.inner] @ turn
    else:
        R[t.outer] = R[t.inner] @ turn.T
        r[t.outer] = r[t.inner] - R[t.outer] @ u


def _moved(t: TreeJoint, u: Array, R: Array, y: Array) -> tuple[Array, Array]:
    """The outer marker's pose in the inner marker's frame after increments y."""
    u, s, e = u.copy() if np.iscomplexobj(u) else u.astype(np.result_type(u, y)), t.sign, np.eye(3)
    if t.link.kind == "universal":
        alpha, beta = so3.exp(s * y[0] * e[2]), so3.exp(s * y[1] * e[0])
        return u, (alpha @ R @ beta if s > 0 else beta @ R @ alpha)
    turn = np.zeros(3, dtype=y.dtype)
    for value, (kind, k, _) in zip(y, t.coordinates, strict=True):
        if kind == "u":
            u[k] += s * value
        else:
            turn[k] = s * value
            u[k] += s * t.link.pitch * value
    return u, so3.exp(turn) @ R


def advance(sys: System, state: State, y: Array) -> State:
    """The state after tree increments y (ny,): poses move joint by joint, world velocities stay as they are."""
    y = np.asarray(y)
    dtype = np.result_type(state.r, y, float)
    r, R = state.r.astype(dtype), state.R.astype(dtype)
    for f, start in sys.modal_coordinates():
        change = np.pad(y[start : start + f.m], (0, 3 * len(f.carriers) - f.m))
        r[f.carriers] = r[f.carriers] + change.reshape(-1, 3)
    for t in sys.tree:
        if t.link.kind == "modal":
            place_modal(t, r, R)
            continue
        place_outer(t, r, R, *_moved(t, *relative_pose(t, state.r, state.R), y[t.start : t.stop]))
    return replace(state, r=r, R=R)


def _pose(body: int, r: Array, R: Array) -> tuple[Array, Array]:
    return (np.zeros(3), np.eye(3)) if body < 0 else (r[body], R[body])


def relative_pose(t: TreeJoint, r: Array, R: Array) -> tuple[Array, Array]:
    """The outer marker seen from the inner one: displacement in the inner axes and rotation matrix."""
    inner, outer = t.markers
    (ci, Ri), (co, Ro) = _pose(inner.body, r, R), _pose(outer.body, r, R)
    frame = Ri @ inner.F
    return frame.T @ (co + Ro @ outer.s - ci - Ri @ inner.s), frame.T @ Ro @ outer.F


def place_outer(t: TreeJoint, r: Array, R: Array, u: Array, turn: Array) -> None:
    """Write into r, R the pose of the outer body whose marker is at (u, turn) in the inner marker's frame."""
    inner, outer = t.markers
    ci, Ri = _pose(inner.body, r, R)
    frame = Ri @ inner.F
    R[t.outer] = frame @ turn @ outer.F.T
    r[t.outer] = ci + Ri @ inner.s + frame @ u - R[t.outer] @ outer.s
