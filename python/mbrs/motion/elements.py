"""Relative motions and forces of elements and joints along a motion, from the poses of their bodies (docs/tables.md, "Derived
quantities").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from .._lib.rotations import quaternion_matrix
from ..errors import ModelError, NameNotFoundError
from ..model.names import nearest
from ..model.schema import BODY, ELEMENTS, JOINTS, LAW_OF_CODE

__all__ = ["Relative", "element", "element_force", "joint"]

_ELEMENTS = {kind.code: kind for kind in ELEMENTS.values()}
_JOINTS = {kind.code: kind for kind in JOINTS.values()}
# Angle (rad) below which the series of the inverse Jacobian of SO(3) is used; both forms agree to 1e-12 there.
_SMALL = 1e-2


@dataclass(frozen=True)
class Relative:
    """Coordinates e (n_t, n), m and rad, and their rates (n_t, n), in the order of ``names``."""

    value: np.ndarray
    rate: np.ndarray
    names: tuple[str, ...]


@dataclass(frozen=True)
class _Marker:
    """A frame fixed in a body along a motion: position (n_t, 3), axes (n_t, 3, 3), velocity and angular velocity (n_t, 3), world."""

    p: np.ndarray
    R: np.ndarray
    v: np.ndarray
    w: np.ndarray


def _marker(traj: Any, body: int, point: np.ndarray, frame: np.ndarray) -> _Marker:
    n = len(traj.t)
    if body < 0:
        still = np.zeros((n, 3))
        return _Marker(np.broadcast_to(point, (n, 3)), np.broadcast_to(frame, (n, 3, 3)), still, still)
    x = traj.snapshot.tables["x"][int(traj.snapshot.tables["body_x"][body]) :]
    drawn = quaternion_matrix(x[BODY.block.slice("orientation")])
    name = traj.bodies[body]
    R, w = traj.rotation(name), traj.angular_velocity(name)
    arm = R @ (drawn.T @ (point - x[BODY.block.slice("at")]))
    return _Marker(traj.position(name) + arm, R @ (drawn.T @ frame), traj.velocity(name) + np.cross(w, arm), w)


def axis_frame(axis: np.ndarray) -> np.ndarray:
    """(3, 3) the drawn joint frame of a direction, columns x, y, z."""
    z = axis / np.linalg.norm(axis)
    e = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = e - (e @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _translation(a: _Marker, b: _Marker) -> tuple[np.ndarray, np.ndarray]:
    """u = A^T (p_B - p_A), and its rate."""
    d = b.p - a.p
    rate = b.v - a.v - np.cross(a.w, d)
    return np.einsum("tji,tj->ti", a.R, d), np.einsum("tji,tj->ti", a.R, rate)


def _angle(a: _Marker, b: _Marker, y: tuple[int, int], x: tuple[int, int]) -> tuple[Any, Any]:
    """atan2(B_i . A_j, B_k . A_l) for (i, j) = y and (k, l) = x, continuous from output to output, and its rate."""

    def dot(i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
        one, other = b.R[:, :, i], a.R[:, :, j]
        rate = np.cross(b.w, one), np.cross(a.w, other)
        return np.sum(one * other, axis=1), np.sum(rate[0] * other + one * rate[1], axis=1)

    (p, dp), (q, dq) = dot(*y), dot(*x)
    return np.unwrap(np.arctan2(p, q)), (q * dp - p * dq) / (p * p + q * q)


def _rotation(a: _Marker, b: _Marker) -> tuple[np.ndarray, np.ndarray]:
    """log(A^T B) and its rate J_l^-1 A^T (w_B - w_A)."""
    R = np.einsum("tji,tjk->tik", a.R, b.R)
    half = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    theta = np.array([_logarithm(one, h) for one, h in zip(R, half, strict=True)]).reshape(-1, 3)
    w = np.einsum("tji,tj->ti", a.R, b.w - a.w)
    angle = np.linalg.norm(theta, axis=1)[:, None]
    safe = np.where(angle > _SMALL, angle, 1.0)
    g = np.where(angle > _SMALL, (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2, 1.0 / 12.0 + angle**2 / 720.0)
    turned = np.cross(theta, w)
    return theta, w - 0.5 * turned + g * np.cross(theta, turned)


def _logarithm(R: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Rotation vector of at most half a turn."""
    sine, cosine = float(np.linalg.norm(half)), 0.5 * (float(np.trace(R)) - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if sine > 1e-6:
        return half * (angle / sine)
    if cosine > 0.0:
        return half
    axis = np.linalg.svd(R - np.eye(3))[2][-1]
    return angle * axis * (1.0 if half @ axis >= 0.0 else -1.0)


def _index(names: Any, name: Any, what: str) -> int:
    key = getattr(name, "name", name)
    if key not in names:
        guess = nearest(str(key), names)
        raise NameNotFoundError(f"there is no {what} {key!r}" + (f"; did you mean {guess!r}?" if guess else ""))
    return list(names).index(key)


def _ends(traj: Any, stem: str, i: int, at: tuple[np.ndarray, np.ndarray], frame: Any) -> tuple[_Marker, _Marker]:
    t: Mapping[str, Any] = traj.snapshot.tables
    frames = frame if isinstance(frame, tuple) else (frame, frame)
    a, b = (_marker(traj, int(t[f"{stem}_{end}"][i]), at[k], frames[k]) for k, end in enumerate("ab"))
    return a, b


def element(traj: Any, name: Any) -> tuple[Relative, np.ndarray | None]:
    """Deformation of an element, and the length (n_t,) of a spring-damper."""
    t = traj.snapshot.tables
    i = _index(t["element_name"], name, "spring, bushing or torsion spring")
    kind, n = _ELEMENTS[int(t["element_type"][i])], t["x"][int(t["element_x"][i]) :]
    block = kind.block

    def field(key: str) -> np.ndarray:
        return np.asarray(n[block.slice(key)])

    if kind.type == "torsion":
        at = field("at")
        a, b = _ends(traj, "element", i, (at, at), axis_frame(field("axis")))
        angle, rate = _angle(a, b, (0, 1), (0, 0))
        return Relative((angle - field("angle"))[:, None], rate[:, None], kind.coordinates), None
    ends = (field("at_a"), field("at_b"))
    if kind.type == "spring_damper":
        a, b = _ends(traj, "element", i, ends, np.eye(3))
        d, v = b.p - a.p, b.v - a.v
        length = np.linalg.norm(d, axis=1)
        given = bool(int(t["element_flags"][i]) & block.fields["length"].bit)
        natural = float(field("length")[0]) + (0.0 if given else float(np.linalg.norm(ends[1] - ends[0])))
        speed = np.divide(np.sum(d * v, axis=1), length, out=np.zeros_like(length), where=length > 0.0)
        return Relative((length - natural)[:, None], speed[:, None], kind.coordinates), length
    a, b = _ends(traj, "element", i, ends, quaternion_matrix(field("orientation")))
    (u, du), (r, dr) = _translation(a, b), _rotation(a, b)
    return Relative(np.hstack([u, r]), np.hstack([du, dr]), kind.coordinates), None


def element_force(traj: Any, name: Any) -> np.ndarray:
    """(n_t, n) preload + k e + c e' + law(e, e') of an element.

    Raises
    ------
    ModelError
        A law with an internal state, whose force the deformation alone does not tell.
    """
    t = traj.snapshot.tables
    moved, _ = element(traj, name)
    i = _index(t["element_name"], name, "element")
    kind, n = _ELEMENTS[int(t["element_type"][i])], t["x"][int(t["element_x"][i]) :]
    size = len(kind.coordinates)
    k, c, preload = (np.asarray(n[kind.block.slice(key)], dtype=float) for key in ("k", "c", "preload"))
    damped = 0.0 if "damping" in traj.without else 1.0
    if size == 1:
        out = preload + moved.value * k + damped * moved.rate * c
    else:
        out = preload + moved.value @ k.reshape(size, size).T + damped * moved.rate @ c.reshape(size, size).T
    for j in range(len(t["law_type"])):
        if t["law_owner_kind"][j] or t["law_owner"][j] != i:
            continue
        code, component, start = int(t["law_type"][j]), int(t["law_component"][j]), int(t["law_x"][j])
        law = LAW_OF_CODE.get(code)
        if law is None or law.state or law.phase:
            raise ModelError(
                f"the force of {name!r} depends on the state of a law, which its deformation does not tell"
            )
        values = np.asarray(t["x"][start : start + int(t["law_n"][j])], dtype=float).tolist()
        u, v = (np.ascontiguousarray(part[:, component]) for part in (moved.value, moved.rate))
        out[:, component] += _core.law_force(code, values, u, v)
    return out


def joint(traj: Any, name: Any) -> Relative:
    """Free coordinates of a joint and their rates."""
    t = traj.snapshot.tables
    i = _index(t["joint_name"], name, "joint")
    kind, n = _JOINTS[int(t["joint_type"][i])], t["x"][int(t["joint_x"][i]) :]
    block = kind.block
    if not kind.free:
        raise ModelError(f"joint {t['joint_name'][i]!r} has no free coordinates")
    if int(t["joint_flags"][i]) & block.fields["orientation"].bit:
        frame = quaternion_matrix(n[block.slice("orientation")])
    elif kind.type == "universal":
        z, second = n[block.slice("axis")], n[block.slice("axis2")]
        z = z / np.linalg.norm(z)
        x = second - (second @ z) * z
        x /= np.linalg.norm(x)
        frame = np.column_stack([x, np.cross(z, x), z])
    else:
        frame = axis_frame(n[block.slice("axis")])
    a, b = _ends(traj, "joint", i, (n[block.slice("at_a")], n[block.slice("at_b")]), frame)
    u, du = _translation(a, b)
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    if kind.type in ("prismatic", "cylindrical"):
        parts.append((u[:, 2:], du[:, 2:]))
    elif kind.type == "planar":
        parts.append((u[:, :2], du[:, :2]))
    elif kind.type == "free":
        parts.append((u, du))
    if kind.type in ("revolute", "cylindrical", "planar", "universal"):
        angle, rate = _angle(a, b, (0, 1), (0, 0))
        parts.append((angle[:, None], rate[:, None]))
    if kind.type == "universal":
        angle, rate = _angle(a, b, (1, 2), (2, 2))
        parts.append((angle[:, None], rate[:, None]))
    if kind.type in ("spherical", "free"):
        parts.append(_rotation(a, b))
    value, speed = (np.hstack([part[k] for part in parts]) for k in (0, 1))
    return Relative(value, speed, kind.coordinates)
