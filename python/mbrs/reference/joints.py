"""Constraint rows and free coordinates of joints, as functions of the relative pose u = A^T (p_B - p_A), R = A^T B.

Every coordinate's rate is a row G times the relative twist xi = (A^T (v_B - v_A at p_B), A^T (w_B - w_A)), so that a
force f along it is the wrench -G^T f on the second body at p_B in the first marker's axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import so3
from .jets import Jet, column, compose, cross, cross_matrix, dot, entry, jet, power, stack
from .reader import Link
from .rows import CONSTRAINTS, FREE, VELOCITY_CONSTRAINTS, Row, X, Y, Z
from .so3 import Array


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
    """Two markers in motion: jets of u (1, 3), R and the first frame A (3, 3), the second point and both centres
    of mass (1, 3).
    """

    u: Jet
    R: Jet
    A: Jet
    point: Jet
    centre_a: Jet
    centre_b: Jet
    radius: Array
    pitch: Array

    def twist(self, a: tuple[Jet, Jet], b: tuple[Jet, Jet]) -> Jet:
        """Relative twists (m, 6) for m motions of the two bodies: rows of (velocity of the centre of mass, angular
        velocity).
        """
        (va, wa), (vb, wb) = a, b
        slip = vb + cross(wb, self.point - self.centre_b) - va - cross(wa, self.point - self.centre_a)
        turn = wb - wa
        return slip @ self.A @ np.eye(3, 6) + turn @ self.A @ np.eye(3, 6, 3)


def pair(link: Link, a: tuple[Jet, Jet], b: tuple[Jet, Jet]) -> Pair:
    """The relative pose of a link's markers; bodies as (centre of mass, rotation matrix)."""
    (ca, Ra), (cb, Rb) = a, b
    A, B = Ra @ link.a.F, Rb @ link.b.F
    p_a, p_b = ca + link.a.s[None, :] @ Ra.T, cb + link.b.s[None, :] @ Rb.T
    return Pair((p_b - p_a) @ A, A.T @ B, A, p_b, ca, cb, link.radius, link.pitch)


def translation_row(i: int) -> Jet:
    return jet(np.eye(6)[i : i + 1])


def _rotation_rows(n: Jet) -> Jet:
    return n @ np.eye(3, 6, 3)


def constraint_row(row: Row, p: Pair) -> Jet:
    """G (1, 6) of a constraint."""
    kind, i, j = row
    if kind == "u":
        return translation_row(i)
    if kind == "dot":
        return _rotation_rows(cross(column(p.R, j), np.eye(3)[i : i + 1]))
    if kind == "knife":
        return column(p.R, Z) @ np.eye(3, 6)
    if kind == "disc":
        return disc_row(i, p)
    if kind == "angle":
        return angle_row(p)
    if kind == "beta":
        return beta_row(p)
    if kind == "thread":
        return translation_row(Z) - p.pitch * angle_row(p)
    if kind == "log":
        return np.eye(3)[i : i + 1] @ rotation_vector_rows(p)
    return stretch_row(p)


def constraint_value(row: Row, p: Pair, length: Array) -> Array:
    kind, i, j = row
    if kind == "u":
        return p.u.value[0, i]
    if kind == "dot":
        return p.R.value[i, j]
    if kind == "disc":
        n = p.R.value[:, Z]
        return p.u.value[0, Z] - p.radius * np.sqrt(n[X] ** 2 + n[Y] ** 2)
    if kind == "thread":
        angle = so3.atan2(p.R.value[Y, X], p.R.value[X, X])
        way = p.u.value[0, Z]
        turns = 0.0 if p.pitch == 0 else np.round(np.real(way / p.pitch - angle) / (2 * np.pi))
        return way - p.pitch * (angle + 2 * np.pi * turns)
    return so3.norm(p.u.value) - length


def imposed_value(row: Row, p: Pair) -> Array:
    """The coordinate that a drive moves."""
    (kind, i, _), R = row, p.R.value
    if kind == "u":
        return p.u.value[0, i]
    if kind == "angle":
        return so3.atan2(R[Y, X], R[X, X])
    return so3.atan2(R[Z, Y], R[Z, Z]) if kind == "beta" else so3.log(R)[i]


def is_length(row: Row) -> bool:
    """True for rows in metres; products of axes have no unit."""
    return row[0] not in ("dot", "angle", "beta", "log")


def disc_row(k: int, p: Pair) -> Jet:
    """The velocity of the disc's material point at the contact, c = r ((n.z) n - z)/rho from its centre, along z (k = 0),
    the track n x z/rho (1) and z x (n x z)/rho (2).
    """
    n, z = column(p.R, Z), np.eye(3)[Z:]
    track = cross(n, z)
    inverse = power(dot(track, track), -0.5)
    contact = p.radius * inverse * (entry(p.R, Z, Z) * n - z)
    t = (jet(z), inverse * track, inverse * cross(z, track))[k]
    return t @ np.eye(3, 6) + cross(contact, t) @ np.eye(3, 6, 3)


def stretch_row(p: Pair) -> Jet:
    """d|u| = u . du / |u|."""
    return power(dot(p.u, p.u), -0.5) * p.u @ np.eye(3, 6)


def angle_row(p: Pair) -> Jet:
    """d atan2(s, c) for B_x = (c, s, z) in A: the rotation axis, corrected where the z axes are not parallel."""
    c, s, z = (entry(p.R, i, X) for i in range(3))
    tilt = -z * power(c * c + s * s, -1.0)
    return _rotation_rows(tilt * c * np.eye(3)[:1] + tilt * s * np.eye(3)[1:2] + np.eye(3)[2:])


def beta_row(p: Pair) -> Jet:
    """d atan2(A_z . B_y, A_z . B_z); written in the axes of B, then turned into those of A."""
    x, y, z = (entry(p.R, Z, j) for j in range(3))
    tilt = -x * power(y * y + z * z, -1.0)
    in_b = np.eye(3)[:1] + tilt * y * np.eye(3)[1:2] + tilt * z * np.eye(3)[2:]
    return _rotation_rows(in_b @ p.R.T)


def rotation_vector_rows(p: Pair) -> Jet:
    """J_l^-1(phi), phi = log R: first order at most, for phi' = J_l^-1 times the angular velocity hidden in R' R^T."""
    phi = so3.log(p.R.value)
    J = so3.left_jacobian_inverse(phi)
    jets: list[Array | None] = [phi[None, :]]
    if p.R.order >= 1:
        omega = so3.vee(p.R.derivative() @ p.R.value.T)
        jets.append((omega @ J.T)[..., None, :])
    vector = Jet(*jets)
    S, square = cross_matrix(vector), dot(vector, vector)
    g, dg = so3.cotangent_coefficient(square.value[0, 0])
    return _rotation_rows(np.eye(3) - 0.5 * S + compose(square, g * np.ones((1, 1)), dg) * (S @ S))


def coordinate_rows(kind: str, p: Pair) -> Jet:
    """G (n, 6) of the free coordinates of a joint or element."""
    rows = {"angle": angle_row, "beta": beta_row, "log": rotation_vector_rows, "stretch": stretch_row}
    return stack([translation_row(i) if c == "u" else rows[c](p) for c, i in FREE[kind]])


def angle_places(kind: str) -> list[int]:
    """Indices of the free coordinates that are angles without limit."""
    return [i for i, (c, _) in enumerate(FREE[kind]) if c in ("angle", "beta")]


def continued_values(link: Link, p: Pair, memory: Array | None) -> Array:
    """`coordinate_values` with angles on the turns nearest to those remembered."""
    e = coordinate_values(link, p)
    if link.turns is None or memory is None:
        return e
    natural = link.length if link.kind == "torsion" else 0.0
    for k, i in enumerate(angle_places(link.kind)):
        e[i] += 2 * np.pi * np.round(np.real(memory[link.turns + k] - e[i] - natural) / (2 * np.pi))
    return e


def coordinate_values(link: Link, p: Pair) -> Array:
    """The free coordinates themselves; a spring-damper's and a torsion spring's from their natural length."""
    u, R = p.u.value[0], p.R.value
    out: list[Array] = []
    for c, i in FREE[link.kind]:
        if c == "u":
            out.append(u[i])
        elif c == "angle":
            out.append(so3.atan2(R[Y, X], R[X, X]) - (link.length if link.kind == "torsion" else 0.0))
        elif c == "beta":
            out.append(so3.atan2(R[Z, Y], R[Z, Z]))
        elif c == "stretch":
            out.append(so3.norm(u) - link.length)
        else:
            out.extend(so3.log(R))
    return np.array(out)
