"""Solids that stand for bodies: the hull of what is attached to them, thickened so that links and plates show."""

from __future__ import annotations

import numpy as np

__all__ = ["body_solid"]

_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def body_solid(
    origin: np.ndarray, rotation: np.ndarray, points: np.ndarray, thickness: float, detailed: bool = True
) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices relative to the origin, world axes, (n, 3), and faces as loops of vertex indices seen from outside.

    A body with nothing attached away from its origin is a cube in its own axes; two points make a slender box, points
    in a plane a plate, others their convex hull. ``detailed=False`` always takes the box along principal axes: cheap
    for large scenes.
    """
    local = np.vstack([np.zeros(3), np.reshape(points, (-1, 3)) - origin])
    local = np.unique(np.round(local / thickness, 6), axis=0) * thickness
    centre = local.mean(axis=0)
    _, extents, axes = np.linalg.svd(local - centre, full_matrices=True)
    extents = np.concatenate([extents, np.zeros(3)])[:3]
    if extents[0] < 0.5 * thickness:
        return _box(np.zeros(3), rotation, np.full(3, 2.0 * thickness))
    if extents[1] < 0.1 * thickness or not detailed:
        along = (local - centre) @ axes.T
        low, high = along.min(axis=0), along.max(axis=0)
        return _box(centre + 0.5 * (low + high) @ axes, axes.T, 0.5 * (high - low) + thickness)
    return _hull(local, axes, thickness)


def _box(centre: np.ndarray, axes: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, list[list[int]]]:
    vertices = centre + (_CORNERS * half) @ axes.T
    # a left-handed set of axes turns every face inside out
    flip = np.linalg.det(axes) < 0.0
    return vertices, [loop[::-1] if flip else list(loop) for loop in _QUADS]


def _hull(local: np.ndarray, axes: np.ndarray, thickness: float) -> tuple[np.ndarray, list[list[int]]]:
    """Convex hull of the points, each grown to a small box along the principal axes so that plates get a thickness."""
    from scipy.spatial import ConvexHull

    grown = (local[:, None, :] + thickness * (_CORNERS @ axes)[None, :, :]).reshape(-1, 3)
    hull = ConvexHull(grown, qhull_options="Qt")
    keys = np.round(np.column_stack([hull.equations[:, :3], hull.equations[:, 3] / thickness]), 5) + 0.0
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    used = np.unique(hull.simplices)
    renumber = {int(old): new for new, old in enumerate(used)}
    faces = []
    for one in range(int(group.max()) + 1):
        members = np.flatnonzero(group == one)
        loop = _ordered(grown, np.unique(hull.simplices[members]), hull.equations[members[0], :3])
        faces.append([renumber[i] for i in loop])
    return grown[used], faces


def _ordered(points: np.ndarray, corners: np.ndarray, normal: np.ndarray) -> list[int]:
    """Corners of one flat convex face, counter-clockwise seen from outside."""
    spokes = points[corners] - points[corners].mean(axis=0)
    first = spokes[int(np.argmax(np.einsum("ij,ij->i", spokes, spokes)))]
    first = first / np.linalg.norm(first)
    angle = np.arctan2(spokes @ np.cross(normal, first), spokes @ first)
    return [int(i) for i in corners[np.argsort(angle)]]
