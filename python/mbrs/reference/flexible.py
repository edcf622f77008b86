"""Flexible bodies as clouds of particles, once more: d'Alembert's principle summed particle by particle.

The integrals of docs/tables.md (mass, S, P1, P2, and KG as those of the second order of the shapes) are inner products
of the fields 1, r, phi_k and psi_kl over the mass. Their Gram matrix, as a sum of w_p u_p u_p^T, is a cloud of
particles of mass w_p with the same integrals, in which u_p holds what the fields are at particle p:

    X_p = one_p x + R s_p,   s_p = r_p + phi_pk q_k + psi_pkl q_k q_l / 2,   sum_p w_p dX_p/dz . (X_p" - one_p g) = Q_z

The frame (x, R) is at the centre of mass of the undeformed body. Masses may be negative (integrals of phi psi and psi psi are
left out) and complex (complex steps). Nothing here knows the formulas of the core: only this sum.

Frames of the reference: bodies, then moving nodes (massless, led by the modal coordinates), then carriers, frames that
hold three modal coordinates each as their place.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import so3
from .jets import Jet, cross, jet, product
from .reader import Body, Link, Marker, entries
from .so3 import Array

_EMPTY = 1e-16


@dataclass
class Cloud:
    """Particles: mass w (P,), what 1 is there (P,), place r (P, 3), shapes phi (P, 3, m) and psi (P, 3, m, m)."""

    w: Array
    one: Array
    r: Array
    phi: Array
    psi: Array

    def seen_from(self, point: Array) -> Cloud:
        """The same particles with places about another point of the frame."""
        return replace(self, r=self.r - self.one[:, None] * point)


@dataclass
class Flexible:
    """A flexible body: its frame, nodes and carriers among the frames, its particles, its elasticity."""

    name: str
    frame: int
    m: int
    nodes: list[int]
    carriers: list[int]
    cloud: Cloud
    K: Array
    C: Array

    def held(self, r: Array) -> Array:
        """q (m,) from the places of all frames."""
        return r[self.carriers].reshape(-1)[: self.m]

    def coordinates(self, vectors: list[tuple[Jet, Jet]]) -> Jet:
        """q (1, m) from the places of all frames, q' from their velocities, q" from their accelerations."""
        rows = [vectors[carrier][0] @ np.eye(3, self.m, 3 * j) for j, carrier in enumerate(self.carriers)]
        return sum(rows[1:], rows[0])


@dataclass
class Node:
    """A node in its frame: place (3,), shapes (6, m), displacements of second order (3, m, m)."""

    owner: Flexible
    place: Array
    shape: Array
    quadratic: Array

    def pose(self, r: Array) -> tuple[Array, Array]:
        """Displacement and rotation Rx Ry Rz seen from the frame."""
        q = self.owner.held(r)
        a, b, c = np.eye(3) * (self.shape[3:] @ q)[:, None]
        second = 0.5 * np.einsum("ikl,k,l->i", self.quadratic, q, q)
        return self.place + self.shape[:3] @ q + second, so3.exp(a) @ so3.exp(b) @ so3.exp(c)


def frames_named(t: Mapping[str, Any]) -> Mapping[str, Any]:
    """Tables in which what is attached to a moving node names its frame as its body."""
    if "flexible_body" not in t:
        return t
    moving = list(t["moving_node"])
    out = dict(t)
    ends = [(f"{kind}_{side}", f"{kind}_{side}_node") for kind in ("joint", "element") for side in "ab"]
    for key, node in [*ends, ("load_body", "load_node"), ("marker_body", "marker_node")]:
        given = zip(t.get(key, ()), t.get(node, ()), strict=True)
        n = len(t["body_name"])
        out[key] = np.array([n + moving.index(j) if j in moving else i for i, j in given], dtype=int)
    return out


def read_flexible(t: Mapping[str, Any], x: Array, bodies: list[Body]) -> list[Flexible]:
    """The flexible bodies; their nodes and carriers are added to the bodies, their frames lose the rigid inertia."""
    n, moving, out = len(bodies), list(t.get("moving_node", ())), []
    for index, m, i in entries(t, "flexible", "body modes x"):
        nodes = [n + j for j, node in enumerate(moving) if t["flexible_node_body"][node] == index]
        sizes = np.cumsum([0, 3 * m, 9 * m, 9 * m * m, m * m, m * m, 12 * m * m])
        S, P1, P2, K, C, KG = (x[i + a : i + b] for a, b in itertools.pairwise(sizes))
        b = bodies[index]
        cloud = particles(b, S.reshape(3, m), P1.reshape(m, 3, 3), P2.reshape(m, m, 3, 3), KG.reshape(12, m, m))
        K, C = K.reshape(m, m), C.reshape(m, m)
        out.append(Flexible(b.name, int(index), int(m), nodes, [], cloud.seen_from(b.com), K, C))
        bodies[index] = replace(b, mass=np.zeros(()), inertia=np.zeros((3, 3)))
    for j, node in enumerate(moving):
        owner = next(f for f in out if n + j in f.nodes)
        b, at = bodies[owner.frame], t["flexible_node_x"][node]
        arm = b.R @ (x[at : at + 3] - b.com)
        label = f"{b.name}.{t['flexible_node_name'][node]}"
        bodies.append(_massless(label, b.centre + arm, b.R, b.velocity + np.cross(b.angular_velocity, arm), b))
    for f in out:
        f.carriers = list(range(len(bodies), len(bodies) + -(-f.m // 3)))
        bodies.extend(_massless(f"{f.name}.q", np.zeros(3), np.eye(3), np.zeros(3), None) for _ in f.carriers)
    return out


def _massless(name: str, centre: Array, R: Array, velocity: Array, like: Body | None) -> Body:
    w = np.zeros(3) if like is None else like.angular_velocity
    return Body(name, centre, R, np.zeros(3), np.zeros(()), np.zeros((3, 3)), velocity, w)


def modal_links(t: Mapping[str, Any], x: Array, bodies: list[Body], flexible: list[Flexible]) -> dict[int, Link]:
    """For every node's frame the link with its body's frame."""
    out, n = {}, len(t["body_name"])
    none = np.zeros((6, 6))
    for f in flexible:
        for frame in f.nodes:
            at = t["flexible_node_x"][t["moving_node"][frame - n]]
            second = t["flexible_node_quadratic"][t["moving_node"][frame - n]]
            psi = x[second : second + 3 * f.m**2] if second >= 0 else np.zeros(3 * f.m**2)
            shape = x[at + 3 : at + 3 + 6 * f.m].reshape(6, f.m)
            node = Node(f, x[at : at + 3] - bodies[f.frame].com, shape, psi.reshape(3, f.m, f.m))
            inner, outer = (Marker(i, np.zeros(3), np.eye(3)) for i in (f.frame, frame))
            out[frame] = Link(f.name, "modal", inner, outer, none, none, np.zeros(6), node=node)
    return out


def particles(b: Body, S: Array, P1: Array, P2: Array, KG: Array) -> Cloud:
    """Particles with the given integrals, about the body's origin: as many as the Gram matrix has rows."""
    gram, fields = _gram(b, S, P1, P2, KG)
    n = 4 + 3 * S.shape[1]
    scale = np.sqrt(np.abs(np.diag(gram).real))
    scale[scale == 0] = 1.0  # a field that vanishes, such as y and z in a beam without thickness
    # the second orders have no squares; one size for all, so that entries near zero do no harm
    scale[n:] = max(np.max(np.abs(gram.real[:n, n:]) / scale[:n, None], initial=0.0), 1e-300)
    weights, columns = [], []
    for part, unit in ((gram.real, 1.0), (gram.imag, 1j)):
        if np.any(part):
            value, vector = np.linalg.eigh(part / np.outer(scale, scale))
            kept = np.abs(value) > _EMPTY * np.max(np.abs(value))
            weights.append(unit * value[kept])
            columns.append(vector[:, kept] * scale[:, None])
    u, w = np.concatenate(columns, axis=1), np.concatenate(weights)
    m = S.shape[1]
    psi = np.zeros((len(w), 3, m, m))
    for (k, n), row in fields.items():
        psi[:, :, k, n] = psi[:, :, n, k] = u[row : row + 3].T
    phi = u[4 : 4 + 3 * m].reshape(m, 3, -1).transpose(2, 1, 0)
    return Cloud(w, u[0], u[1:4].T, phi, psi)


def _gram(b: Body, S: Array, P1: Array, P2: Array, KG: Array) -> tuple[Array, dict[tuple[int, int], int]]:
    """Inner products of 1, r (3), phi_k (3 each) and psi_kl (3 each, k <= l, where it is not zero)."""
    m = S.shape[1]
    pairs = [(k, n) for k in range(m) for n in range(k, m) if np.any(KG[:, k, n])]
    fields = {pair: 4 + 3 * m + 3 * i for i, pair in enumerate(pairs)}
    dtype = np.result_type(S, P1, P2, KG, b.mass, float)
    out = np.zeros((4 + 3 * m + 3 * len(pairs),) * 2, dtype=dtype)
    second = 0.5 * np.trace(b.inertia) * np.eye(3) - b.inertia + b.mass * np.outer(b.com, b.com)
    out[0, 0], out[0, 1:4], out[1:4, 1:4] = 0.5 * b.mass, b.mass * b.com, 0.5 * second
    for k in range(m):
        at = slice(4 + 3 * k, 7 + 3 * k)
        out[0, at], out[1:4, at] = S[:, k], P1[k]
        for n in range(m):
            out[at, 4 + 3 * n : 7 + 3 * n] = 0.5 * P2[k, n]
    for (k, n), row in fields.items():
        out[0, row : row + 3] = KG[:3, k, n]
        out[1:4, row : row + 3] = KG[3:, k, n].reshape(3, 3).T
    return out + out.T, fields


# --- the sum over particles -----


@dataclass
class Moving:
    """A flexible body in motion, as jets of rows: R (3, 3); w, v', w' (1, 3) in world axes; q, q', q" (1, m)."""

    R: Jet
    w: Jet
    a: Jet
    alpha: Jet
    q: Jet
    dq: Jet
    ddq: Jet


def moving(f: Flexible, now: Any) -> Moving:
    """Its part of the motion of all bodies."""
    (_, R), (_, w), (a, alpha) = now.pose[f.frame], now.twist[f.frame], now.rate[f.frame]
    return Moving(R, w, a, alpha, *(f.coordinates(vectors) for vectors in (now.pose, now.twist, now.rate)))


def inertia(f: Flexible, now: Moving) -> Jet:
    """Force, moment about the frame's point (world axes) and modal forces in one row (1, 6 + m)."""
    cloud = f.cloud
    place = _displaced(cloud, now.q, now.q, 0.5) + jet(cloud.r)
    rate = _displaced(cloud, now.dq, now.q, 1.0)
    second = _displaced(cloud, now.ddq, now.q, 1.0) + _bent(cloud, now.dq, now.dq)
    w, alpha, a = now.w @ now.R, now.alpha @ now.R, now.a @ now.R
    pushed = cloud.one[:, None] * a + cross(alpha, place) + cross(w, cross(w, place)) + 2.0 * cross(w, rate) + second
    return _summed(cloud, now, place, pushed)


def weight(f: Flexible, now: Moving, gravity: Array) -> Jet:
    """The generalised force of gravity, in one row like `inertia`."""
    cloud = f.cloud
    place = _displaced(cloud, now.q, now.q, 0.5) + jet(cloud.r)
    pulled = cloud.one[:, None] * (jet(gravity[None, :]) @ now.R)
    return _summed(cloud, now, place, pulled)


def height(f: Flexible, state: Any, gravity: Array) -> Any:
    """sum w one g . X: minus the potential energy of weight."""
    q, c = f.held(state.r), f.cloud
    place = c.r + c.phi @ q + 0.5 * np.einsum("pakl,k,l->pa", c.psi, q, q)
    X = c.one[:, None] * state.r[f.frame] + place @ state.R[f.frame].T
    return (c.w * c.one) @ X @ gravity


def _displaced(cloud: Cloud, a: Jet, q: Jet, half: float) -> Jet:
    """phi_k a_k + half psi_kl a_k q_l, (P, 3)."""
    return a.map(lambda c: np.einsum("...ik,pak->...pa", c, cloud.phi)) + half * _bent(cloud, a, q)


def _bent(cloud: Cloud, a: Jet, b: Jet) -> Jet:
    return product(lambda x, y: np.einsum("...ik,...il,pakl->...pa", x, y, cloud.psi), a, b)


def _summed(cloud: Cloud, now: Moving, place: Jet, pushed: Jet) -> Jet:
    """sum_p w dX/dz . pushed over the frame's displacement, its rotation and the modal coordinates."""
    force = pushed.map(lambda c: np.einsum("p,...pa->...a", cloud.w * cloud.one, c)[..., None, :]) @ now.R.T
    moment = cross(place, pushed).map(lambda c: np.einsum("p,...pa->...a", cloud.w, c)[..., None, :]) @ now.R.T
    shape = now.q.map(lambda c: np.einsum("...il,pakl->...pak", c, cloud.psi)) + jet(cloud.phi)
    modal = product(lambda s, x: np.einsum("p,...pak,...pa->...k", cloud.w, s, x)[..., None, :], shape, pushed)
    m = cloud.phi.shape[2]
    return force @ np.eye(3, 6 + m) + moment @ np.eye(3, 6 + m, 3) + modal @ np.eye(m, 6 + m, 6)
