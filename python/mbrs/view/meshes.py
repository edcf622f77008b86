"""Surfaces from files, by trimesh or meshio, made light enough for a page."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.checks import shown
from ..errors import MbrsError, ModelError

__all__ = ["read"]

# Triangles of one picture of a mesh. Too large: pages that turn slowly; too small: coarse pictures. Pinned by tests/view/test_shapes.py.
MOST_TRIANGLES = 4000
_FINEST, _COARSEST = 256, 8  # cells along the longest edge that vertices are merged in


def read(file: str) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices (n, 3) and triangles of a file, at most about `MOST_TRIANGLES`.

    Raises
    ------
    ModelError
        A file that is absent or cannot be read; neither trimesh nor meshio is installed.
    """
    path = Path(file)
    try:
        changed = path.stat().st_mtime_ns
    except (OSError, ValueError) as reason:
        raise ModelError(f"cannot read the mesh {shown(file)}: {getattr(reason, 'strerror', reason)}") from None
    vertices, triangles = _read(str(path), changed)
    return vertices.copy(), triangles.tolist()


@lru_cache(maxsize=32)
def _read(file: str, changed: int) -> tuple[np.ndarray, np.ndarray]:
    try:
        vertices, triangles = _loaded(file)
    except MbrsError:
        raise
    except Exception as reason:  # readers of files raise anything
        raise ModelError(f"cannot read the mesh {shown(file)}: {shown(str(reason))}") from None
    vertices = np.asarray(vertices, dtype=float).reshape(-1, 3)
    triangles = np.asarray(triangles, dtype=int).reshape(-1, 3)
    good = len(triangles) and np.all(np.isfinite(vertices)) and 0 <= triangles.min() <= triangles.max() < len(vertices)
    if not good:
        raise ModelError(f"cannot read the mesh {shown(file)}: it holds no surface of triangles")
    return lighter(vertices, triangles, MOST_TRIANGLES)


def _loaded(file: str) -> tuple[np.ndarray, np.ndarray]:
    if Path(file).suffix.lower() in (".stl", ".obj", ".ply", ".off"):
        try:
            import trimesh
        except ImportError:
            pass
        else:
            mesh: Any = trimesh.load(file, force="mesh", process=False)
            return np.asarray(mesh.vertices), np.asarray(mesh.faces)
    try:
        import meshio
    except ImportError:
        raise ModelError("a mesh file needs trimesh or meshio: pip install 'mbrs-dynamics[meshes]'") from None
    mesh = meshio.read(file)
    parts = [block.data for block in mesh.cells if block.type == "triangle"]
    for block in mesh.cells:
        if block.type == "quad":
            parts += [block.data[:, [0, 1, 2]], block.data[:, [0, 2, 3]]]
    return np.asarray(mesh.points)[:, :3], np.concatenate(parts) if parts else np.zeros((0, 3), dtype=int)


def lighter(vertices: np.ndarray, triangles: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """The surface with near vertices merged until there are few enough triangles (Rossignac and Borrel, Multi-resolution 3D
    approximations for rendering complex scenes, 1993). Merging exact duplicates alone changes nothing to be seen.
    """
    low = vertices.min(axis=0)
    edge = float(np.ptp(vertices, axis=0).max()) or 1.0
    cells = 1 << 20
    while True:
        key = np.floor((vertices - low) / edge * cells + 0.5).astype(np.int64)
        _, first, merged = np.unique(key, axis=0, return_index=True, return_inverse=True)
        made = merged.reshape(-1)[triangles]
        kept = (made[:, 0] != made[:, 1]) & (made[:, 1] != made[:, 2]) & (made[:, 2] != made[:, 0])
        made = np.unique(_from_smallest(made[kept]), axis=0)
        if len(made) <= most or cells <= _COARSEST:
            return vertices[first], made
        cells = _FINEST if cells > _FINEST else int(cells / 1.3)


def _from_smallest(triangles: np.ndarray) -> np.ndarray:
    """Each triangle from its smallest index on, so that equal ones are equal."""
    start = np.argmin(triangles, axis=1)[:, None] if len(triangles) else np.zeros((0, 1), dtype=int)
    return np.take_along_axis(triangles, (start + np.arange(3)) % 3, axis=1)
