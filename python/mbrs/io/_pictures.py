"""Shapes of the visual elements of robot formats. They are pictures: what cannot be read is named and left out."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.rotations import matrix_to_quaternion
from ..errors import ModelError
from ..model.shapes import MESH_ENDINGS, Box, Cylinder, Mesh, Shape, Sphere
from ._accuracy import Accuracy
from ._poses import Frame
from ._xml import Node, Source, clipped

# How many folders above a robot's own may be the package that it names. Pinned by tests/io/test_pictures.py.
_ABOVE = 3
# Largest entry of a rotation less the unit matrix that is rounding. Larger: pictures lose a small turn. Smaller: an orientation is written
# of pictures that have none.
_TURNED = 1e-12


@dataclass
class Picture:
    """A shape on a link, its frame in the drawn world: "box" (edges), "sphere" (one or three half axes), "cylinder" and "capsule"
    (radius, length along z), "mesh" (file, scale).
    """

    link: int
    frame: Frame
    kind: str
    size: tuple[float, ...]
    file: str = ""
    colour: str = ""

    def shapes(self, body: Frame) -> list[Shape]:
        """The shapes on a body that is drawn in this frame."""
        own = self.frame.within(body)
        if not (np.all(np.isfinite(own.R)) and np.all(np.isfinite(own.p))):
            raise ModelError("a picture lies at no finite place")
        turned = not np.allclose(own.R, np.eye(3), rtol=0.0, atol=_TURNED)
        given: dict[str, Any] = {"at": _tidy(own.p), "colour": self.colour}
        if turned:
            given["orientation"] = _tidy(matrix_to_quaternion(own.R))
        if self.kind == "box":
            return [Box(self.size, **given)]
        if self.kind == "sphere":
            return [Sphere(self.size[0] if len(set(self.size)) == 1 else self.size, **given)]
        if self.kind == "mesh":
            return [Mesh(self.file, self.size[0] if len(set(self.size)) == 1 else self.size, **given)]
        radius, length = self.size
        made: list[Shape] = [Cylinder(radius, length, **given)]
        if self.kind == "capsule":
            ends = (own.point((0.0, 0.0, side * 0.5 * length)) for side in (-1.0, 1.0))
            made += [Sphere(radius, at=_tidy(end), colour=self.colour) for end in ends]
        return made


def _tidy(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(v) + 0.0 for v in values)


@contextmanager
def _unmeasured(source: Source) -> Any:
    """The digits of a picture do not tell how accurately a mechanism is drawn."""
    kept, source.accuracy = source.accuracy, Accuracy()
    try:
        yield
    finally:
        source.accuracy = kept


def picture(source: Source, what: str, read: Callable[[], Picture | None]) -> Picture | None:
    """The picture that ``read`` returns; where it raises, the picture is named as omitted."""
    try:
        with _unmeasured(source):
            made = read()
            if made is not None:
                for one in made.shapes(made.frame):
                    one.described("its")
            return made
    except ModelError:
        source.omit(what, "picture")
        return None


def colour_of(values: list[float]) -> str:
    """ "#rrggbb" of red, green, blue from 0 to 1."""
    return "#" + "".join(f"{round(255 * min(max(v, 0.0), 1.0)):02x}" for v in values[:3])


def urdf_geometry(visual: Node, link: int, frame: Frame, colours: dict[str, str]) -> Picture | None:
    """The picture of a <visual>; ``colours`` are those of the materials of the robot by name."""
    geometry = visual.child("geometry")
    if geometry is None:
        raise visual.error("lacks its <geometry>")
    colour = ""
    material = visual.child("material")
    if material is not None:
        named, own = material.text("name") or "", material.child("color")
        colour = colours.get(named, "") if own is None else colour_of(own.numbers("rgba", 4))
    for shape in geometry.children("box", "cylinder", "sphere", "mesh"):
        if shape.tag == "box":
            return Picture(link, frame, "box", tuple(shape.numbers("size", 3)), colour=colour)
        if shape.tag == "sphere":
            return Picture(link, frame, "sphere", (shape.number("radius"),), colour=colour)
        if shape.tag == "cylinder":
            size = (shape.number("radius"), shape.number("length"))
            return Picture(link, frame, "cylinder", size, colour=colour)
        scale = tuple(shape.numbers("scale", 3, (1.0, 1.0, 1.0)))
        return Picture(link, frame, "mesh", scale, mesh_path(shape, "filename"), colour)
    raise geometry.error("has no box, cylinder, sphere or mesh")


def mesh_path(node: Node, key: str, folder: str = "") -> str:
    """The file that an attribute names: within the folder of the robot, or of the package around it that the name begins with."""
    name = node.required(key)
    home = Path(node.source.path).resolve().parent
    scheme, found, rest = name.partition("://")
    if found and scheme == "package":
        package, _, rest = rest.partition("/")
        above = [home, *home.parents][: _ABOVE + 1]
        home = next((one for one in above if one.name == package), home)
    elif found and scheme != "file":
        raise node.error(f"names {clipped(name)!r}, which is not a file")
    elif not found:
        rest = name
    try:
        path = (home / folder / rest).resolve()
        good = path.is_relative_to(home) and path.suffix.lower() in MESH_ENDINGS and path.is_file()
    except (OSError, ValueError, RuntimeError):
        good = False
    if not good:
        raise node.error(f"names {clipped(name)!r}, which is not a mesh within the folder of the robot")
    return str(path)
