"""Surfaces of simple shapes: vertices and faces, loops seen from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix
from .scene import Solid

__all__ = ["box", "cone", "cylinder", "sphere", "surface", "tube"]

Surface = tuple[np.ndarray, list[list[int]]]
_ROUND = 20  # corners of a circle


def box(size: Any) -> Surface:
    """A box with edges ``size`` (3,) about the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners * np.asarray(size, dtype=float), faces


def cylinder(radius: float, length: float, n: int = _ROUND) -> Surface:
    """A cylinder along z about the origin."""
    rim = _rim(radius, n)
    low, high = rim - [0.0, 0.0, 0.5 * length], rim + [0.0, 0.0, 0.5 * length]
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    return np.vstack([low, high]), [*sides, list(range(n))[::-1], list(range(n, 2 * n))]


def cone(radius: float, length: float, n: int = 8) -> Surface:
    """A cone along z: its base at the origin, its tip at ``length``."""
    vertices = np.vstack([_rim(radius, n), [[0.0, 0.0, length]]])
    return vertices, [*([i, (i + 1) % n, n] for i in range(n)), list(range(n))[::-1]]


def sphere(half_axes: Any, n: int = _ROUND) -> Surface:
    """A sphere or an ellipsoid about the origin, in rings."""
    rings = n // 2
    polar = np.pi * np.arange(1, rings) / rings
    rows = [np.column_stack([np.sin(p) * _rim(1.0, n)[:, :2], np.full(n, -np.cos(p))]) for p in polar]
    vertices = np.vstack([[[0.0, 0.0, -1.0]], *rows, [[0.0, 0.0, 1.0]]])
    last = len(vertices) - 1
    faces = [[0, 1 + (i + 1) % n, 1 + i] for i in range(n)]
    for ring in range(rings - 2):
        a, b = 1 + ring * n, 1 + (ring + 1) * n
        faces += [[a + i, a + (i + 1) % n, b + (i + 1) % n, b + i] for i in range(n)]
    top = 1 + (rings - 2) * n
    faces += [[top + i, top + (i + 1) % n, last] for i in range(n)]
    return vertices * np.broadcast_to(np.asarray(half_axes, dtype=float), (3,)), faces


def tube(start: Any, end: Any, radius: float, n: int = 8) -> Surface:
    """A cylinder from one point to another."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    vertices, faces = cylinder(radius, float(np.linalg.norm(end - start)), n)
    return vertices @ frame(end - start).T + 0.5 * (start + end), faces


def frame(direction: Any) -> np.ndarray:
    """(3, 3) a right-handed frame, its third column along a direction."""
    z = np.asarray(direction, dtype=float)
    z = z / (np.linalg.norm(z) or 1.0)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x) or 1.0
    return np.column_stack([x, np.cross(z, x), z])


def surface(table: Mapping[str, Any], origin: np.ndarray, rotation: np.ndarray) -> Solid:
    """The solid of a shape as Tables hold it, on a body with this origin (3,) and rotation (3, 3)."""
    kind = table["type"]
    if kind == "box":
        vertices, faces = box(table["size"])
    elif kind == "cylinder":
        vertices, faces = cylinder(table["radius"], table["length"])
        vertices = vertices @ frame(table.get("axis", (0.0, 0.0, 1.0))).T
    elif kind == "sphere":
        vertices, faces = sphere(table["radius"])
    else:
        from .meshes import read

        vertices, faces = read(table["file"])
        vertices = vertices * np.asarray(table.get("scale", 1.0), dtype=float)
        if np.prod(np.broadcast_to(table.get("scale", 1.0), (3,))) < 0.0:
            faces = [face[::-1] for face in faces]  # a mirror turns faces inside out
    own = quaternion_matrix(table.get("orientation", (1.0, 0.0, 0.0, 0.0)))
    local = vertices @ own.T + np.asarray(table.get("at", (0.0, 0.0, 0.0)), dtype=float)
    return Solid(origin + local @ rotation.T, faces, table.get("colour", ""))


def _rim(radius: float, n: int) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)])
