"""A motion as a viewer that plays it: frames at equal times become data in a page that needs nothing else."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from .._lib.checks import shown
from .._lib.rotations import matrix_to_quaternion
from ..errors import ModelError
from .drawing import scene_data
from .modes import Viewer, line_points
from .scene import COINCIDE, SceneGeometry

__all__ = ["frames", "motion"]

_MOST_NUMBERS = 120_000  # bodies times frames: a page of about 5 MB
_FRAMES = (2, 1200)
_PER_SECOND = 60.0


class MotionPage(TypedDict, total=False):
    """Options of the page of a motion."""

    pace: float | None
    at: float | None
    paths: Sequence[Any] | None
    title: str | None
    follow: Any


def motion(
    traj: Any,
    path: str | Path | None = None,
    *,
    pace: float | None = None,
    at: float | None = None,
    paths: Sequence[Any] | None = None,
    title: str | None = None,
    follow: Any = None,
) -> Path | Viewer:
    """The motion of all bodies, with play, pause, speed and time to drag: bodies glow as fast as they move.

    Between outputs of the trajectory frames follow cubics that have its velocities; name output times (``t=[...]`` of
    `mb.simulate`) where a body turns by more than half a turn between two steps. Cost O(frames x bodies).

    Parameters
    ----------
    traj
        A `Trajectory`.
    path
        File to write; None returns the `Viewer` instead.
    pace
        Seconds of motion in a second of playing, at first; by default 1, or what makes the whole last 4 to 30 s.
    at
        s; start paused at this time. None plays from the beginning.
    paths
        Markers and bodies whose way is drawn; by default all markers, or the last body where there is none.
    title
        Title of the page.
    follow
        A body that the view follows; None keeps the view fixed on the whole path.

    Returns
    -------
    pathlib.Path or Viewer

    Raises
    ------
    ModelError
        A motion without outputs, ``pace`` that is not positive, ``at`` outside the motion, no such body to follow.
    """
    t = np.asarray(traj.t, dtype=float)
    if t.size == 0:
        raise ModelError("this motion has no outputs to draw")
    if pace is not None and not (math.isfinite(pace) and pace > 0.0):
        raise ModelError(f"pace= must be a positive number, got {shown(pace)}")
    if at is not None and not t[0] <= at <= t[-1]:
        raise ModelError(f"at={at!r} lies outside the motion, which lasts from {t[0]:.6g} to {t[-1]:.6g} s")
    title = title or f"Motion of {traj.model.name}"
    viewer = Viewer(title, _data(traj, pace, at, paths, title, follow))
    return viewer if path is None else viewer.write(path)


def _data(
    traj: Any, pace: float | None, at: float | None, paths: Any, title: str, follow: Any = None
) -> dict[str, Any]:
    drawn = traj.snapshot.scene
    span = float(traj.t[-1] - traj.t[0])
    pace = _pace(span) if pace is None else pace
    times = np.linspace(traj.t[0], traj.t[-1], _count(len(drawn.bodies), span / pace))
    position, quaternion, speed = frames(traj, times)
    origins = np.array([b.origin for b in drawn.bodies]).reshape(-1, 3)
    start = np.array([b.rotation for b in drawn.bodies]).reshape(-1, 3, 3)
    turned = _relative(quaternion, start)
    reach = [float(np.max(np.linalg.norm(b.rigid - b.origin, axis=1), initial=0.0)) for b in drawn.bodies]
    leader = _leader(drawn, follow)
    low, high = _box(drawn, *_seen(position, leader, np.array(reach)))
    elastic = [*_elastic(traj, drawn, times, position, quaternion), *_wake(traj, times)]
    if elastic and leader is None:
        points = np.concatenate([line.reshape(-1, 3) for _, line in elastic])
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    data = scene_data(drawn, low, high)
    data.update(
        title=title,
        pace=pace,
        at=at,
        decimals=max(2, 1 - math.floor(math.log10(span / 100.0))) if span > 0.0 else 2,
        follow=-1 if leader is None else leader,
        elastic=[[name, line.shape[1], _packed(line)] for name, line in elastic],
        paths=_paths(traj, drawn, position, turned, paths),
        motion={
            "from": float(times[0]),
            "step": span / (len(times) - 1) if span > 0.0 else 0.0,
            "count": len(times),
            "p": _packed(position - origins),
            "q": _packed(turned),
            "speed": _packed(speed / max(float(speed.max(initial=0.0)), 1e-300)),
        },
    )
    return data


def _elastic(
    traj: Any, scene: SceneGeometry, times: np.ndarray, position: np.ndarray, quaternion: np.ndarray
) -> list[tuple[str, np.ndarray]]:
    """Lines of the flexible bodies as they bend, (n, k, 3) world; modal coordinates by cubics between outputs."""
    out = []
    for name in traj.flexible:
        modal = traj.model.bodies[traj.bodies.index(name)].modal
        pick = line_points(modal)
        if len(pick) < 2:
            continue
        local = modal.places(_modal_frames(traj, name, times), pick)
        q = quaternion[:, scene.index[name]][:, None]
        arm = np.concatenate([np.zeros((*local.shape[:2], 1)), local], axis=-1)
        turned = _product(_product(np.broadcast_to(q, arm.shape), arm), _conjugate(q))[..., 1:]
        out.append((name, position[:, scene.index[name]][:, None] + turned))
    return out


def _modal_frames(traj: Any, name: str, times: np.ndarray) -> np.ndarray:
    t, q, rate = np.asarray(traj.t, dtype=float), traj.modal(name), traj.modal_rate(name)
    if t.size == 1:
        return np.repeat(q, len(times), axis=0)
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, t.size - 2)
    h = (t[i + 1] - t[i])[:, None]
    return _cubic((times - t[i])[:, None] / h, h, q[i], q[i + 1], rate[i], rate[i + 1])


def _wake(traj: Any, times: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """The filaments of a wake that roll up outboard of each blade, (n, k, 3) world, straight between the steps of the wake."""
    wake = getattr(traj, "wake", None)
    if wake is None or not wake.filaments:
        return []
    filaments = np.array([step[:, 0] for step in wake.filaments])
    at = np.clip(np.interp(times, wake.times, np.arange(len(wake.times))), 0, len(wake.times) - 1)
    k = np.minimum(at.astype(int), max(len(wake.times) - 2, 0))
    share = (at - k)[:, None, None]
    after = filaments[np.minimum(k + 1, len(filaments) - 1)]
    return [(f"wake {b + 1}", (1.0 - share) * filaments[k, b] + share * after[:, b]) for b in range(filaments.shape[1])]


def _leader(scene: SceneGeometry, follow: Any) -> int | None:
    """Index of the body that the view follows."""
    if follow is None:
        return None
    name = str(getattr(follow, "name", follow))
    if name not in scene.index:
        raise ModelError(f"follow=: there is no body called {name!r}")
    return scene.index[name]


def _seen(position: np.ndarray, leader: int | None, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ways that the view should hold, and the reaches of their bodies: beside a leader, of those that travel with it."""
    if leader is None:
        return position, reach
    own = position[:, leader : leader + 1]
    beside = position - own + own[:1]
    strays = np.linalg.norm(np.ptp(beside, axis=0), axis=1)
    kept = strays <= 0.5 * np.linalg.norm(np.ptp(own, axis=0)) + 1e-12
    return beside[:, kept], reach[kept]


def _pace(span: float) -> float:
    """Real time where that lasts neither too short nor too long to watch."""
    if span <= 0.0 or 4.0 <= span <= 30.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(span / 10.0))
    return min((k * power for k in (1.0, 2.0, 5.0, 10.0)), key=lambda p: abs(math.log(span / p / 10.0)))


def _count(bodies: int, seconds: float) -> int:
    most = max(_FRAMES[0], min(_FRAMES[1], _MOST_NUMBERS // max(bodies, 1)))
    return int(min(most, max(_FRAMES[0], math.ceil(_PER_SECOND * seconds) + 1)))


def frames(traj: Any, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (n, n_b, 3), quaternions (n, n_b, 4) and speeds (n, n_b) at times within the motion.

    Cubics between outputs: of the origins from positions and velocities, of the rotations from rotation vectors seen
    from the earlier output and their rates, the turn being the one that the angular velocities suggest.
    """
    q = traj.poses
    t = np.asarray(traj.t, dtype=float)
    if t.size == 1:
        still = [np.repeat(q[k], len(times), axis=0) for k in ("position", "orientation")]
        return still[0], still[1], np.zeros(still[0].shape[:2])
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, t.size - 2)
    h = (t[i + 1] - t[i])[:, None, None]
    s = ((times - t[i]) / (t[i + 1] - t[i]))[:, None, None]
    position = _cubic(s, h, q["position"][i], q["position"][i + 1], q["velocity"][i], q["velocity"][i + 1])
    before, after = q["orientation"][i], q["orientation"][i + 1]
    spin0, spin1 = (
        _into_body(o, w[k]) for o, w, k in ((before, q["angular_velocity"], i), (after, q["angular_velocity"], i + 1))
    )
    theta = _unwound(_vector(_product(_conjugate(before), after)), 0.5 * h * (spin0 + spin1))
    rate1 = _vector_rate(theta, spin1)
    vector = _cubic(s, h, np.zeros_like(theta), theta, spin0, rate1)
    speed = np.linalg.norm((1 - s) * q["velocity"][i] + s * q["velocity"][i + 1], axis=-1)
    return position, _product(before, _quaternion(vector)), speed


def _cubic(s: Any, h: Any, y0: Any, y1: Any, v0: Any, v1: Any) -> np.ndarray:
    """Hermite's cubic at the part s of a step h."""
    d: np.ndarray = y0 * (1 + 2 * s) * (1 - s) ** 2 + y1 * s**2 * (3 - 2 * s)
    return d + h * s * (1 - s) * (v0 * (1 - s) - v1 * s)


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Quaternions multiplied, scalar first."""
    (a, u), (b, v) = (p[..., :1], p[..., 1:]), (q[..., :1], q[..., 1:])
    scalar = a * b - np.sum(u * v, axis=-1, keepdims=True)
    return np.concatenate([scalar, a * v + b * u + np.cross(u, v)], axis=-1)


def _conjugate(q: np.ndarray) -> np.ndarray:
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def _into_body(q: np.ndarray, w: np.ndarray) -> np.ndarray:
    """World vectors in the axes of the bodies."""
    pure = np.concatenate([np.zeros((*w.shape[:-1], 1)), w], axis=-1)
    return _product(_product(_conjugate(q), pure), q)[..., 1:]


def _vector(q: np.ndarray) -> np.ndarray:
    """Rotation vector of at most half a turn."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    factor = np.where(sine > 1e-9, 2.0 * np.arctan2(sine, q[..., :1]) / np.where(sine > 1e-9, sine, 1.0), 2.0)
    return factor * q[..., 1:]


def _quaternion(vector: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2 * np.pi)) * vector], axis=-1)


def _unwound(vector: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """The rotation vector of the same rotation that is nearest to the expected one: whole turns are invisible in a pose."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    axis = vector / np.where(angle > 0.0, angle, 1.0)
    wanted = np.sum(axis * expected, axis=-1, keepdims=True)
    return vector + axis * 2.0 * np.pi * np.round((wanted - angle) / (2.0 * np.pi))


def _vector_rate(theta: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Rate of the rotation vector for an angular velocity in body axes, J_r^-1; the rate itself near whole turns, where
    that has a pole.
    """
    square = np.sum(theta * theta, axis=-1, keepdims=True)
    angle = np.sqrt(square)
    half = 0.5 * angle
    safe = np.where(np.abs(np.sin(half)) > 1e-2, np.tan(np.where(half > 0.0, half, 1.0)), np.inf)
    g = np.where(angle > 1e-3, (1.0 - half / safe) / np.where(square > 0.0, square, 1.0), 1.0 / 12.0)
    near_whole = (angle > 1.0) & (np.abs(np.sin(half)) <= 1e-2)
    turned = np.cross(theta, spin)
    return np.where(near_whole, spin, spin + 0.5 * turned + g * np.cross(theta, turned))


def _relative(quaternion: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Turns from the drawn rotations (n_b, 3, 3), signs continuous in time."""
    drawn = np.array([matrix_to_quaternion(R) for R in start]).reshape(-1, 4)
    q = _product(quaternion, _conjugate(drawn)[None])
    flips = np.cumsum(np.sum(q[1:] * q[:-1], axis=-1) < 0.0, axis=0) % 2
    sign = np.concatenate([np.ones((1, q.shape[1])), np.where(flips, -1.0, 1.0)])
    return q * sign[:, :, None]


def _box(scene: SceneGeometry, position: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around the motion: of the scene as drawn, and of where bodies go."""
    low, high = scene.points.min(axis=0), scene.points.max(axis=0)
    flat = np.ptp(scene.points, axis=0) == 0.0
    if position.size:
        moving = np.ptp(position.reshape(-1, 3), axis=0) > COINCIDE * np.max(high - low)
        room = np.where(flat & ~moving, 0.0, reach[:, None])
        low = np.minimum(low, (position.min(axis=0) - room).min(axis=0))
        high = np.maximum(high, (position.max(axis=0) + room).max(axis=0))
    return low, high


def _paths(traj: Any, scene: SceneGeometry, position: np.ndarray, turned: np.ndarray, wanted: Any) -> list[list[Any]]:
    """Name, body and ways (n, 3) of points."""
    index, markers = scene.index, scene.markers
    names = [str(getattr(one, "name", one)) for one in wanted] if wanted is not None else list(markers) or _last(scene)
    out = []
    for name in names:
        if name in markers and markers[name][0] is not None:
            body, point = index[markers[name][0]], markers[name][1]
        elif name in index:
            body, point = index[name], scene.bodies[index[name]].origin
        else:
            raise ModelError(f"paths=: there is no marker on a body and no body called {name!r}")
        arm = np.concatenate([[0.0], point - scene.bodies[body].origin])
        q = turned[:, body]
        way = position[:, body] + _product(_product(q, np.broadcast_to(arm, q.shape)), _conjugate(q))[:, 1:]
        out.append([name, body, _packed(way)])
    return out


def _last(scene: SceneGeometry) -> list[str]:
    return [scene.bodies[-1].name] if scene.bodies else []


def _packed(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")
