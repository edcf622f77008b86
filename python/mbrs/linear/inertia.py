"""Mass matrices of bodies, rigid and flexible, from their numbers in the Tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._lib.rotations import skew
from ..model.schema import BODY, SHAPES


def mass_matrices(tables: Any, rotation: np.ndarray) -> np.ndarray:
    """(n_bodies, 6, 6) mass matrix of each body about its origin, world axes, for rotations (n_bodies, 3, 3)."""
    x = tables["x"]
    out = np.zeros((len(tables["body_x"]), 6, 6))
    for i, start in enumerate(tables["body_x"]):
        r = rotation[i]
        numbers = x[start:]
        m, arm = numbers[BODY.block.place("mass")], r @ numbers[BODY.block.slice("com")]
        xx, yy, zz, xy, xz, yz = numbers[BODY.block.slice("inertia")]
        inertia = r @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ r.T
        s = skew(arm)
        out[i] = np.block([[m * np.eye(3), -m * s], [m * s, inertia - m * s @ s]])
    return out


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
    H = skew(h)
    turning = np.array([[p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]] for p in Q])
    moving = (S + np.einsum("ikl,l->ik", S2, q)).T
    out = np.zeros((6 + m, 6 + m))
    out[:3, :3], out[:3, 3:6], out[3:6, 3:6] = mass * np.eye(3), -H, J
    out[6:, :3], out[6:, 3:6] = moving, turning
    out[3:6, :3], out[:3, 6:], out[3:6, 6:] = H, moving.T, turning.T
    out[6:, 6:] = np.trace(P2, axis1=2, axis2=3)
    return out
