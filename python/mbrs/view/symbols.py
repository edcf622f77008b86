"""Symbols of joints, loads and ground as small solids and lines, and of springs as line drawings. Pages and figures draw the same."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .scene import COINCIDE, JointGeometry, LinkGeometry, LoadGeometry, SceneGeometry
from .shapes import box, cone, cylinder, frame, sphere

__all__ = ["GLYPHS", "Link", "Mark", "links", "marks"]

# Longest arrow of a load, and the shortest beside it, in sizes of the scene.
_LONGEST, _SHORTEST = 0.17, 0.09
_ARC = 1.5 * math.pi  # of the arrow of a torque

Polyline = list[tuple[float, float]]
# Symbols of what acts along a line: points (part of the length, part of the half width). "rod" and "open" belong to joints.
GLYPHS: Mapping[str, Sequence[Polyline]] = {
    "spring": [
        [(0.0, 0.0), (0.12, 0.0)]
        + [(0.12 + 0.76 * (i + 0.5) / 9, (1.0, -1.0)[i % 2]) for i in range(9)]
        + [(0.88, 0.0), (1.0, 0.0)]
    ],
    "damper": [
        [(0.0, 0.0), (0.32, 0.0)],
        [(0.62, 0.9), (0.32, 0.9), (0.32, -0.9), (0.62, -0.9)],
        [(0.5, 0.7), (0.5, -0.7)],
        [(0.5, 0.0), (1.0, 0.0)],
    ],
    "gap": [
        [(0.0, 0.0), (0.44, 0.0)],
        [(0.44, 0.9), (0.44, -0.9)],
        [(0.56, 0.9), (0.56, -0.9)],
        [(0.56, 0.0), (1.0, 0.0)],
    ],
    "law": [
        [(0.0, 0.0), (0.36, 0.0)],
        [(0.36, 0.8), (0.64, 0.8), (0.64, -0.8), (0.36, -0.8), (0.36, 0.8)],
        [(0.4, -0.5), (0.46, -0.3), (0.54, 0.3), (0.6, 0.5)],
        [(0.64, 0.0), (1.0, 0.0)],
    ],
    "rod": [[(0.0, 0.0), (1.0, 0.0)]],
    "open": [[(i / 9, 0.0), ((i + 0.6) / 9, 0.0)] for i in range(9)],
}


@dataclass(frozen=True, eq=False)
class Mark:
    """A symbol that moves with ``body`` (None: ground) at ``at`` (3,), world.

    ``solids`` (vertices from ``at``, faces) and ``lines`` (k, 3) from ``at``; ``group``: "joint", "spring" or "load". ``stays``: its
    direction does not turn with the body. ``filled``: a joint within the mechanism, rather than on ground.
    """

    group: str
    label: str
    name: str
    body: str | None
    at: np.ndarray
    solids: list[tuple[np.ndarray, list[list[int]]]] = field(default_factory=list)
    lines: list[np.ndarray] = field(default_factory=list)
    stays: bool = False
    filled: bool = True


@dataclass(frozen=True, eq=False)
class Link:
    """A drawing that stretches between two points: ``parts`` of `GLYPHS` beside each other, from ``at_a`` (3,) to ``at_b`` (3,)."""

    group: str
    label: str
    name: str
    a: str | None
    b: str | None
    at_a: np.ndarray
    at_b: np.ndarray
    parts: tuple[str, ...]


def links(scene: SceneGeometry) -> Iterator[Link]:
    """Springs and dampers, distance joints as rods, and the ways that assembly closes."""
    for one in scene.links:
        if one.kind != "torsion":
            parts = ("bushing", *one.parts) if one.kind == "bushing" else one.parts
            yield Link("spring", _label(one.kind, one), one.name, one.a, one.b, one.at_a, one.at_b, parts)
    for joint in scene.joints:
        if joint.kind == "distance":
            parts = ("rod",)
        elif joint.kind == "rolling_disc" or np.linalg.norm(joint.at - joint.at_b) <= COINCIDE * scene.size:
            continue
        else:
            parts = ("open",)
        yield Link("joint", _label(joint.kind, joint), joint.name, joint.a, joint.b, joint.at, joint.at_b, parts)


def marks(scene: SceneGeometry, grain: float) -> Iterator[Mark]:
    """Symbols of joints, of ground under joints and springs, of torsion springs and of loads; ``grain`` (m) is half the thickness of
    a link.
    """
    down = _down(scene)
    for joint in scene.joints:
        yield _joint(joint, grain)
        if joint.a is None or joint.b is None:
            at = joint.at if joint.a is None else joint.at_b
            if joint.kind not in ("free", "rolling_disc", "knife_edge"):
                label = _label(joint.kind, joint)
                yield _ground("joint", label, joint.name, at, down, joint.axis, 3.6 * grain, 1.0 * grain)
    for link in scene.links:
        if link.kind == "torsion":
            yield _spiral(link, grain)
            continue
        for body, here, there in ((link.a, link.at_a, link.at_b), (link.b, link.at_b, link.at_a)):
            if body is None:
                along = here - there
                away = along if np.linalg.norm(along) > COINCIDE * scene.size else down
                yield _ground("spring", _label(link.kind, link), link.name, here, away, None, 0.0, 1.0 * grain)
    yield from _loads(scene, grain)


def _label(kind: str, one: Any) -> str:
    ends = " - ".join("ground" if body is None else body for body in (one.a, one.b))
    return f"{one.name} ({kind.replace('_', ' ')}): {ends}"


def _down(scene: SceneGeometry) -> np.ndarray:
    if scene.gravity is not None and np.any(scene.gravity):
        return np.asarray(scene.gravity, dtype=float) / np.linalg.norm(scene.gravity)
    flat = np.ptp(scene.points, axis=0)
    return np.array([0.0, -1.0, 0.0]) if flat[2] < 0.05 * scene.size <= flat[1] else np.array([0.0, 0.0, -1.0])


def _joint(joint: JointGeometry, g: float) -> Mark:
    axis = np.array([0.0, 0.0, 1.0]) if joint.axis is None else joint.axis / np.linalg.norm(joint.axis)
    turn = frame(axis)
    solids: list[tuple[np.ndarray, list[list[int]]]] = []
    lines: list[np.ndarray] = []

    def add(surface: tuple[np.ndarray, list[list[int]]], own: np.ndarray = turn) -> None:
        solids.append((surface[0] @ own.T, surface[1]))

    kind = joint.kind
    if kind == "revolute":
        add(cylinder(1.7 * g, 3.4 * g, 14))
        lines.append(np.outer([-5.0 * g, 5.0 * g], axis))
    elif kind in ("prismatic", "cylindrical"):
        add(box((2.8 * g, 2.8 * g, 5.0 * g)) if kind == "prismatic" else cylinder(1.5 * g, 5.0 * g, 14))
        lines.append(np.outer([-7.0 * g, 7.0 * g], axis))
        for sign in (-1.0, 1.0):
            tip = cone(0.8 * g, 1.8 * g, 6)
            add((tip[0] + [0.0, 0.0, 6.0 * g], tip[1]), frame(sign * axis))
    elif kind == "universal":
        second = axis if joint.axis2 is None else joint.axis2 / np.linalg.norm(joint.axis2)
        for one in (axis, second):
            add(cylinder(0.8 * g, 4.8 * g, 10), frame(one))
            lines.append(np.outer([-4.6 * g, 4.6 * g], one))
    elif kind == "spherical":
        add(sphere(1.9 * g, 10))
    elif kind == "planar":
        add(box((5.0 * g, 5.0 * g, 0.7 * g)))
        lines.append(np.outer([-3.0 * g, 3.0 * g], axis))
    elif kind == "fixed":
        add(box((2.4 * g, 2.4 * g, 2.4 * g)), np.eye(3))
    elif kind == "knife_edge":
        edge = turn @ np.array([[0.0, -3.0 * g, 0.0], [0.0, 3.0 * g, 0.0]]).T
        lines += [edge.T, np.outer([-2.0 * g, 2.0 * g], axis)]
        add(box((0.8 * g, 6.0 * g, 0.5 * g)))
    elif kind == "rolling_disc":
        spin = axis if joint.axis2 is None else joint.axis2 / np.linalg.norm(joint.axis2)
        add(cylinder(0.6 * g, 2.4 * g, 10), frame(spin))
        lines.append(np.outer([-3.0 * g, 3.0 * g], spin))
    elif kind == "free":
        lines += [2.2 * g * np.outer([-1.0, 1.0], e) for e in np.eye(3)]
    if joint.parts and kind in ("revolute", "cylindrical", "universal", "spherical", "planar", "free"):
        lines.append(_coil(turn, 2.2 * g, 3.4 * g, 2.0))
    elif joint.parts:
        s = np.linspace(-1.0, 1.0, 60)
        helix = np.column_stack([2.3 * g * np.cos(9 * np.pi * s), 2.3 * g * np.sin(9 * np.pi * s), 4.0 * g * s])
        lines.append(helix @ turn.T)
    inside = joint.a is not None and joint.b is not None
    return Mark("joint", _label(kind, joint), joint.name, joint.leader, joint.place, solids, lines, filled=inside)


def _coil(turn: np.ndarray, inner: float, outer: float, rounds: float) -> np.ndarray:
    """A spiral in the plane normal to the last column of ``turn``."""
    s = np.linspace(0.0, 1.0, 48)
    r, angle = inner + (outer - inner) * s, 2.0 * np.pi * rounds * s
    flat = np.column_stack([r * np.cos(angle), r * np.sin(angle), np.zeros_like(s)])
    return flat @ turn.T


def _spiral(link: LinkGeometry, g: float) -> Mark:
    turn = frame((0.0, 0.0, 1.0) if link.axis is None else link.axis)
    body, at = (link.b, link.at_b) if link.b is not None else (link.a, link.at_a)
    lines = [_coil(turn, 0.6 * g, 4.0 * g, 3.0), np.outer([-3.0 * g, 3.0 * g], turn[:, 2])]
    return Mark("spring", _label(link.kind, link), link.name, body, at, [], lines)


def _ground(
    group: str, label: str, name: str, at: np.ndarray, down: np.ndarray, axis: Any, drop: float, g: float
) -> Mark:
    """A hatched plate below ``at``, with a stand of height ``drop``; it lies along the axis of a hinge."""
    d = down / np.linalg.norm(down)
    if axis is not None:
        n = axis / np.linalg.norm(axis)
        across = d - (d @ n) * n
        d = across / np.linalg.norm(across) if np.linalg.norm(across) > 0.2 else d
        along = n if abs(d @ n) < 0.9 else frame(d)[:, 0]
    else:
        along = frame(d)[:, 0]
    w = np.cross(d, along)
    w /= np.linalg.norm(w)
    along = np.cross(w, d)
    turn = np.column_stack([w, along, d])
    plate, faces = box((7.0 * g, 5.0 * g, 0.5 * g))
    solids = [((plate + [0.0, 0.0, drop + 0.25 * g]) @ turn.T, faces)]
    local: list[Any] = []
    if drop > 0.0:
        for side in (-1.7 * g, 1.7 * g):
            local.append([[-2.2 * g, side, drop], [0.0, side, 0.0], [2.2 * g, side, drop]])
    for side in (-2.5 * g, 2.5 * g):
        for i in range(6):
            x = (-3.5 + 7.0 * (i + 0.9) / 6) * g
            local.append([[x, side, drop + 0.5 * g], [x - 1.1 * g, side, drop + 1.7 * g]])
    lines = [np.array(line) @ turn.T for line in local]
    return Mark(group, label, name, None, at, solids, lines, filled=False)


def _loads(scene: SceneGeometry, g: float) -> Iterator[Mark]:
    largest: dict[str, float] = {}
    for load in scene.loads:
        largest[load.kind] = max(
            largest.get(load.kind, 0.0), float(np.linalg.norm(load.value)) if not load.varies else 0.0
        )
    for load in scene.loads:
        size = float(np.linalg.norm(load.value))
        share = size / largest[load.kind] if largest[load.kind] > 0.0 and not load.varies else 1.0
        length = scene.size * (_SHORTEST + (_LONGEST - _SHORTEST) * min(share, 1.0))
        yield _load(load, length, max(g, 0.01 * scene.size))


def _load(load: LoadGeometry, length: float, g: float) -> Mark:
    unit = {"force": "N", "torque": "N m"}[load.kind]
    size = float(np.linalg.norm(load.value))
    told = "varies in time" if load.varies else f"{size:.4g} {unit}"
    mark = Mark(
        "load",
        f"{load.name} ({load.kind}): {told}, on {load.body}",
        load.name,
        load.body,
        load.at,
        stays=not load.follows,
    )
    if size == 0.0:
        if load.varies:
            solid, faces = sphere(1.2 * g, 8)
            mark.solids.append((solid, faces))
        return mark
    direction = load.value / size
    turn = frame(direction)
    if load.kind == "force":
        tip = cone(1.1 * g, 2.8 * g)
        mark.lines.append(np.outer([0.0, length - 2.8 * g], direction))
        mark.solids.append(((tip[0] + [0.0, 0.0, length - 2.8 * g]) @ turn.T, tip[1]))
        return mark
    radius = 0.45 * length
    angle = np.linspace(0.0, _ARC, 40)
    arc = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    mark.lines.extend([arc @ turn.T, np.outer([-0.3 * length, 0.5 * length], direction)])
    end = np.array([math.cos(_ARC), math.sin(_ARC), 0.0])
    tangent = np.array([-math.sin(_ARC), math.cos(_ARC), 0.0])
    tip = cone(1.0 * g, 2.6 * g)
    mark.solids.append(((tip[0] @ frame(tangent).T + radius * end) @ turn.T, tip[1]))
    return mark
