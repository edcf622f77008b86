"""What linearised motion does to flexible bodies: their energies, and the motion of nodes without a frame of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .model.flexible import mass_matrix_at, modal_places
from .model.rotations import quaternion_matrix

if TYPE_CHECKING:
    from .linearize import Linearization


def modal_masses(lin: Linearization) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Of each flexible body: its number, the rows (6 + m, dof) of its origin's twist (body axes) and of its modal coordinates,
    and its mass matrix (6 + m, 6 + m) over them.
    """
    t, out = lin.snapshot.tables, []
    for i, (body, m, row, first) in enumerate(modal_places(t, len(lin.bodies))):
        q = lin.state.relative[row : row + (m + 2) // 3, :3].ravel()[:m]
        turned = np.einsum("ji,kjn->kin", lin.poses["rotation"][body], lin.T[6 * body : 6 * body + 6].reshape(2, 3, -1))
        rows = np.vstack([turned.reshape(6, -1), lin.modal_map[first : first + m]])
        out.append((body, rows, mass_matrix_at(t, i, q)))
    return out


def modal_strains(lin: Linearization) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Of each flexible body: its name, the rows (m, dof) of its modal coordinates and its stiffness (m, m)."""
    t, out = lin.snapshot.tables, []
    for i, (body, m, _, first) in enumerate(modal_places(t, len(lin.bodies))):
        at = int(t["flexible_x"][i]) + 12 * m + 9 * m * m
        out.append((lin.bodies[body], lin.modal_map[first : first + m], t["x"][at : at + m * m].reshape(m, m)))
    return out


def node_twist(lin: Linearization, name: str) -> tuple[int, np.ndarray, np.ndarray]:
    """Body, twist (6, dof) and point now (3,) of a node without a frame of its own."""
    owner, _, node = name.partition(".")
    body, modal = lin.bodies.index(owner), lin.model[owner].modal
    shape, R = modal.node_shape[modal.nodes.index(node)], lin.poses["rotation"][body]
    local = modal.node_position[modal.nodes.index(node)]
    place = next((p for p in modal_places(lin.snapshot.tables, len(lin.bodies)) if p[0] == body), None)
    if place is None:
        return body, _at(lin.T[6 * body : 6 * body + 6], R @ local), lin.poses["position"][body] + R @ local
    _, m, row, first = place
    w = shape @ lin.state.relative[row : row + (m + 2) // 3, :3].ravel()[:m]
    arm = R @ (local + w[:3])
    twist, moving = _at(lin.T[6 * body : 6 * body + 6], arm), lin.modal_map[first : first + m]
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
