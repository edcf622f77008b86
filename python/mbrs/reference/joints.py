"""Constraint rows and free coordinates of joints, as functions of the relative pose u = A^T (p_B - p_A), R = A^T B.

Every coordinate's rate is a row G times the relative twist xi = (A^T (v_B - v_A at p_B), A^T (w_B - w_A)), so that a
force f along it is the wrench -G^T f on the second body at p_B in the first marker's axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from . import so3
from .jets import Jet, column, compose, cross, cross_matrix, dot, entry, jet, power, stack
from .reader import Link
from .rows import CONSTRAINTS, FREE, VELOCITY_CONSTRAINTS, Row, X, Y, Z
from .so3 import Array

Vectors = tuple[
    Jet, Jet
]  # of a body: velocity of the centre of mass and angular velocity, or force and moment, as rows


def position_rows(link: Link) -> list[Row]:
    """Rows that restrict positions."""
    return CONSTRAINTS[link.kind] if link.row is None else [link.row]


def velocity_rows(link: Link) -> list[Row]:
    """Rows that restrict velocities alone."""
    return [] if link.slides else VELOCITY_CONSTRAINTS.get(link.kind, [])


def all_rows(link: Link) -> list[Row]:
    """Rows of both levels, those of positions first."""
    return position_rows(link) + velocity_rows(link)


def terms(link: Link) -> list[tuple[Link, Any]]:
    """Whose rows a link sums, with what factors: a coupler those of its two joints."""
    return [(link, 1.0)] if link.first is None else [(link, 1.0), (link.first, -link.ratio)]


@dataclass
class Pair:
    """Two markers in motion: jets of u (1, 3), R and the first frame A (3, 3), and the arms (1, 3) from both centres of mass
    to the second point.
    """

    u: Jet
    R: Jet
    A: Jet
    arm_a: Jet
    arm_b: Jet
    radius: Array
    pitch: Array

    def twist(self, a: Vectors, b: Vectors) -> Jet:
        """Relative twists (m, 6) for m motions of the two bodies."""
        (va, wa), (vb, wb) = a, b
        slip = vb + cross(wb, self.arm_b) - va - cross(wa, self.arm_a)
        return slip @ self.A @ np.eye(3, 6) + (wb - wa) @ self.A @ np.eye(3, 6, 3)

    def forces(self, g: Jet) -> tuple[Vectors, Vectors]:
        """Force and moment about the centre of mass on both bodies, world axes, whose power is g (1, 6) times the relative twist."""
        force, moment = (g @ np.eye(6, 3, -k) @ self.A.T for k in (0, 3))
        return (-force, -(cross(self.arm_a, force) + moment)), (force, cross(self.arm_b, force) + moment)

    @cached_property
    def rotation_vector_rows(self) -> Jet:
        """J_l^-1(phi), phi = log R: first order at most, for phi' = J_l^-1 times the angular velocity hidden in R' R^T."""
        phi = so3.log(self.R.value)
        jets: list[Array | None] = [phi[None, :]]
        if self.R.order >= 1:
            omega = so3.vee(self.R.derivative() @ self.R.value.T)
            jets.append((omega @ so3.left_jacobian_inverse(phi).T)[..., None, :])
        vector = Jet(*jets)
        S, square = cross_matrix(vector), dot(vector, vector)
        g, dg = so3.cotangent_coefficient(square.value[0, 0])
        return np.eye(3) - 0.5 * S + compose(square, g * np.ones((1, 1)), dg) * (S @ S)


def pair(link: Link, a: Vectors, b: Vectors) -> Pair:
    """The relative pose of a link's markers; bodies as (centre of mass, rotation matrix)."""
    (ca, Ra), (cb, Rb) = a, b
    A, B = Ra @ link.a.F, Rb @ link.b.F
    arm_b = link.b.s[None, :] @ Rb.T
    arm_a = cb + arm_b - ca
    return Pair((arm_a - link.a.s[None, :] @ Ra.T) @ A, A.T @ B, A, arm_a, arm_b, link.radius, link.pitch)


def slope(row: Row, p: Pair) -> Jet:
    """G (1, 6) of a row."""
    kind, i, j = row
    if kind == "u":
        return jet(np.eye(6)[i : i + 1])
    if kind == "knife":
        return column(p.R, Z) @ np.eye(3, 6)
    if kind == "disc":
        return _disc(i, p)
    if kind == "stretch":  # d|u| = u . du / |u|
        return power(dot(p.u, p.u), -0.5) * p.u @ np.eye(3, 6)
    if kind == "thread":
        return jet(np.eye(6)[Z : Z + 1]) - p.pitch * slope(("angle", Z, 0), p)
    if kind == "dot":
        turn = cross(column(p.R, j), np.eye(3)[i : i + 1])
    elif kind == "log":
        turn = np.eye(3)[i : i + 1] @ p.rotation_vector_rows
    else:
        turn = _angle(p.R) if kind == "angle" else _beta(p.R)
    return turn @ np.eye(3, 6, 3)


def slopes(rows: Sequence[Row], p: Pair) -> Jet:
    """G (n, 6) of rows."""
    return stack([slope(row, p) for row in rows])


def value(row: Row, p: Pair) -> Array:
    """The function of a row that restricts positions; angles within half a turn, a thread on the nearest turn."""
    (kind, i, j), u, R = row, p.u.value[0], p.R.value
    if kind == "u":
        return u[i]
    if kind == "dot":
        return R[i, j]
    if kind == "log":
        return so3.log(R)[i]
    if kind == "angle":
        return so3.atan2(R[Y, X], R[X, X])
    if kind == "beta":
        return so3.atan2(R[Z, Y], R[Z, Z])
    if kind == "disc":
        return u[Z] - p.radius * np.sqrt(R[X, Z] ** 2 + R[Y, Z] ** 2)
    if kind == "thread":
        angle = value(("angle", Z, 0), p)
        turns = 0.0 if p.pitch == 0 else np.round(np.real(u[Z] / p.pitch - angle) / (2 * np.pi))
        return u[Z] - p.pitch * (angle + 2 * np.pi * turns)
    return so3.norm(u)


def _disc(k: int, p: Pair) -> Jet:
    """The velocity of the disc's material point at the contact, c = r ((n.z) n - z)/rho from its centre, along z (k = 0),
    the track n x z/rho (1) and z x (n x z)/rho (2).
    """
    n, z = column(p.R, Z), np.eye(3)[Z:]
    track = cross(n, z)
    inverse = power(dot(track, track), -0.5)
    contact = p.radius * inverse * (entry(p.R, Z, Z) * n - z)
    t = (jet(z), inverse * track, inverse * cross(z, track))[k]
    return t @ np.eye(3, 6) + cross(contact, t) @ np.eye(3, 6, 3)


def _angle(R: Jet) -> Jet:
    """d atan2(s, c) for B_x = (c, s, z) in A: the rotation axis, corrected where the z axes are not parallel."""
    c, s, z = (entry(R, i, X) for i in range(3))
    tilt = -z * power(c * c + s * s, -1.0)
    return tilt * c * np.eye(3)[:1] + tilt * s * np.eye(3)[1:2] + np.eye(3)[2:]


def _beta(R: Jet) -> Jet:
    """d atan2(A_z . B_y, A_z . B_z); written in the axes of B, then turned into those of A."""
    x, y, z = (entry(R, Z, j) for j in range(3))
    tilt = -x * power(y * y + z * z, -1.0)
    return (np.eye(3)[:1] + tilt * y * np.eye(3)[1:2] + tilt * z * np.eye(3)[2:]) @ R.T


def natural_value(link: Link) -> Any:
    """The value from which the coordinate of a spring-damper or torsion spring counts."""
    return link.length if link.kind in ("spring_damper", "torsion") else 0.0


def angle_places(kind: str) -> list[int]:
    """Indices of the free coordinates that are angles without limit."""
    return [i for i, row in enumerate(FREE[kind]) if row[0] in ("angle", "beta")]


def coordinate_values(link: Link, p: Pair, memory: Array | None = None) -> Array:
    """The free coordinates, from the natural value; with a memory, angles on the turns nearest to those remembered."""
    e = np.array([value(row, p) - natural_value(link) for row in FREE[link.kind]])
    for k, i in enumerate(angle_places(link.kind) if link.turns is not None and memory is not None else ()):
        assert memory is not None and link.turns is not None
        away = np.real(memory[link.turns + k] - e[i] - natural_value(link))
        e[i] += 2 * np.pi * np.round(away / (2 * np.pi))
    return e
