"""Moving pictures of results as one self-contained HTML file: no network, no library, a plain 2-D canvas."""

from __future__ import annotations

from .geometry import BodyGeometry, JointGeometry, LinkGeometry, SceneGeometry, scene_from_tables
from .viewer import Viewer, modes

__all__ = ["BodyGeometry", "JointGeometry", "LinkGeometry", "SceneGeometry", "Viewer", "modes", "scene_from_tables"]
