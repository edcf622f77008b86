"""Pictures of the geoms of MJCF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from ._mjcf_parts import Angles, Defaults, placed
from ._pictures import Picture, colour_of, mesh_path
from ._poses import Frame
from ._xml import Node, clipped

# Geoms of higher groups are hidden by MuJoCo's own viewer: they collide and are not seen.
_SHOWN = 2


@dataclass
class Meshes:
    """The <mesh> elements of a file by name, and the folder of their files; an element counts as read when a geom needs it."""

    defaults: Defaults
    folder: str = ""
    elements: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, root: Node, defaults: Defaults) -> Meshes:
        """All meshes below the root of a file."""
        folder, found = "", {}
        for compiler in root.children("compiler"):
            for key in ("assetdir", "meshdir"):
                folder = compiler.text(key, folder) or folder
        for asset in root.children("asset"):
            for element in asset.element.iter("mesh"):
                name = element.get("name") or PurePath(element.get("file") or "").stem
                found[name] = element
        return cls(defaults, folder, found)

    def picture(self, node: Node, link: int, frame: Frame, colour: str) -> Picture:
        """The picture of a geom that shows a mesh."""
        name = node.required("mesh")
        if name not in self.elements:
            raise node.error(f"names the mesh {clipped(name)!r}, which does not exist")
        mesh = self.defaults.of(self.elements[name], "mesh", "main")
        mesh.text("name")
        scale = tuple(mesh.numbers("scale", 3, (1.0, 1.0, 1.0)))
        return Picture(link, frame, "mesh", scale, mesh_path(mesh, "file", self.folder), colour)


def geom_picture(node: Node, angles: Angles, link: int, outer: Frame, meshes: Meshes) -> Picture | None:
    """The picture of a <geom>; None of one that is hidden or transparent."""
    kind = node.text("type", "sphere") or ""
    rgba = node.numbers("rgba", 4) if "rgba" in node else [0.5, 0.5, 0.5, 1.0]
    if node.number("group", 0.0) > _SHOWN or rgba[3] == 0.0:
        return None
    colour = colour_of(rgba) if "rgba" in node else ""
    if kind == "mesh":
        return meshes.picture(node, link, outer @ angles.frame(node), colour)
    if kind not in _NEEDED:
        raise node.error(f"is a {clipped(kind)}, which is not drawn")
    own, size = placed(node, kind, angles)
    if len(size) < _NEEDED[kind]:
        raise node.error(f"needs {_NEEDED[kind]} numbers in 'size'")
    frame = outer @ own
    if kind == "box":
        return Picture(link, frame, "box", tuple(2.0 * s for s in size[:3]), colour=colour)
    if kind in ("sphere", "ellipsoid"):
        return Picture(link, frame, "sphere", tuple(size[:1] if kind == "sphere" else size[:3]), colour=colour)
    return Picture(link, frame, kind, (size[0], 2.0 * size[1]), colour=colour)


_NEEDED = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
