"""A model as it was drawn, on a page: to turn and zoom, with names under the pointer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .drawing import scene_data
from .modes import Viewer
from .scene import SceneGeometry

if TYPE_CHECKING:
    from .modes import Viewer

__all__ = ["still"]


def still(scene: SceneGeometry, path: str | Path | None = None, *, title: str = "Model") -> Path | Viewer:
    """A page of a scene that does not move: joints by their kind, springs, ground, loads, each with its name under the pointer.

    Parameters
    ----------
    scene
        What to draw.
    path
        File to write; None returns the `Viewer` instead.
    title
        Title of the page.

    Returns
    -------
    pathlib.Path or Viewer
    """
    points = scene.points
    viewer = Viewer(title, {**scene_data(scene, points.min(axis=0), points.max(axis=0)), "title": title})
    return viewer if path is None else viewer.write(path)
