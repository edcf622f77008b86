"""What linearised motion does to flexible bodies: their energies, and the motion of nodes without a frame of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .model.rotations import quaternion_matrix
from .model.schema import BODY, SHAPES
from .tables import modal_part, modal_places

if TYPE_CHECKING:
    from .linearize import Linearization


def modal_masses(lin: Linearization) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Of each flexible body: its number, the rows (6 + m, dof) of its origin's twist (body axes) and of its modal coordinates,
    and its mass matrix (6 + m, 6 + m) over them.
    """
    t, out = lin.snapshot.tables, []
    for i, (body, own) in enumerate(modal_places(t)):
        turned = np.einsum("ji,kjn->kin", lin.poses["rotation"][body], lin.T[6 * body : 6 * body + 6].reshape(2, 3, -1))
        rows = np.vstack([turned.reshape(6, -1), lin.modal_map[own]])
        out.append((body, rows, mass_matrix_at(t, i, modal_part(t, lin.state.q)[own])))
    return out


def modal_strains(lin: Linearization) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Of each flexible body: its name, the rows (m, dof) of its modal coordinates and its stiffness (m, m)."""
    t, out = lin.snapshot.tables, []
    for i, (body, own) in enumerate(modal_places(t)):
        m = own.stop - own.start
        stiffness = t["x"][int(t["flexible_x"][i]) :][SHAPES.block.slice("K", m)].reshape(m, m)
        out.append((lin.bodies[body], lin.modal_map[own], stiffness))
    return out


def node_twist(lin: Linearization, name: str) -> tuple[int, np.ndarray, np.ndarray]:
    """Body, twist (6, dof) and point now (3,) of a node without a frame of its own."""
    owner, _, node = name.partition(".")
    body, modal = lin.bodies.index(owner), lin.model[owner].modal
    shape, R = modal.node_shape[modal.nodes.index(node)], lin.poses["rotation"][body]
    local = modal.node_position[modal.nodes.index(node)]
    own = next((own for b, own in modal_places(lin.snapshot.tables) if b == body), None)
    if own is None:
        return body, _at(lin.T[6 * body : 6 * body + 6], R @ local), lin.poses["position"][body] + R @ local
    w = shape @ modal_part(lin.snapshot.tables, lin.state.q)[own]
    arm = R @ (local + w[:3])
    twist, moving = _at(lin.T[6 * body : 6 * body + 6], arm), lin.modal_map[own]
    turned, axes = R, []
    for k in range(3):
        axes.append(turned[:, k])
        q = np.zeros(4)
        q[0], q[1 + k] = np.cos(0.5 * w[3 + k]), np.sin(0.5 * w[3 + k])
        turned = turned @ quaternion_matrix(q)
    twist[:3] += R @ shape[:3] @ moving
    twist[3:] += np.stack(axes, axis=1) @ shape[3:] @ moving
    return body, twist, lin.poses["position"][body] + arm


def _at(twist: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """The same rigid motion (6, n) at a point displaced by ``arm`` (3,)."""
    moved = twist.copy()
    moved[:3] += np.cross(twist[3:], arm[:, None], axis=0)
    return moved


def mass_matrix_at(tables: Mapping[str, Any], which: int, q: np.ndarray) -> np.ndarray:
    """(6 + m, 6 + m) mass matrix of a flexible body at q, about its origin, body axes (docs/tables.md)."""
    x, m, block = tables["x"], int(tables["flexible_modes"][which]), BODY.block
    body = x[int(tables["body_x"][int(tables["flexible_body"][which])]) :]
    com, mass = body[block.slice("com")], body[block.place("mass")]
    xx, yy, zz, xy, xz, yz = body[block.slice("inertia")]
    values = x[int(tables["flexible_x"][which]) :]
    S, P1, P2, KG = (values[SHAPES.block.slice(name, m)] for name in ("S", "P1", "P2", "KG"))
    S, P1, P2, KG = S.reshape(3, m), P1.reshape(m, 3, 3), P2.reshape(m, m, 3, 3), KG.reshape(12, m, m)
    S2, P12 = KG[:3], KG[3:].reshape(3, 3, m, m).transpose(2, 3, 1, 0)
    h = mass * com + S @ q + 0.5 * S2 @ q @ q
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + mass * (com @ com * np.eye(3) - np.outer(com, com))
    linear = np.einsum("kij,k->ij", P1, q) + 0.5 * np.einsum("klij,k,l->ij", P12, q, q)
    N = linear + linear.T + np.einsum("klij,k,l->ij", P2, q, q)
    J = J + np.trace(N) * np.eye(3) - N
    Q = P1 + np.einsum("lkij,l->kij", P2, q) + np.einsum("klij,l->kij", P12, q)
    H = np.array([[0.0, -h[2], h[1]], [h[2], 0.0, -h[0]], [-h[1], h[0], 0.0]])
    turning = np.array([[p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]] for p in Q])
    moving = (S + np.einsum("ikl,l->ik", S2, q)).T
    out = np.zeros((6 + m, 6 + m))
    out[:3, :3], out[:3, 3:6], out[3:6, 3:6] = mass * np.eye(3), -H, J
    out[6:, :3], out[6:, 3:6] = moving, turning
    out[3:6, :3], out[:3, 6:], out[3:6, 6:] = H, moving.T, turning.T
    out[6:, 6:] = np.trace(P2, axis1=2, axis2=3)
    return out
