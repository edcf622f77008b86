"""Shapes of bodies: what pictures show of them. They have no mass and change no result."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from .aliases import Axis, Rotation, Scalar, Vector3
from .expressions import Expression
from .names import nearest, problem, shown
from .numbers import Number, axis, numbers, scalar, shape_of, vector
from .rotations import quaternion

_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
# Files of surfaces that `mbrs.view.meshes` reads.
MESH_ENDINGS = (".stl", ".obj", ".ply", ".off", ".vtk", ".vtu", ".msh")


@dataclass(frozen=True, eq=False)
class Shape:
    """Base of shapes: where a shape lies on its body, and its colour.

    Parameters
    ----------
    at
        (3,), m: its centre, from the body's origin, body axes.
    orientation
        Of its axes in body axes: quaternion (4,), scalar first, or matrix (3, 3); body axes by default.
    colour
        "#rrggbb"; chosen by the picture by default.
    """

    at: Vector3 = (0.0, 0.0, 0.0)
    orientation: Rotation | None = None
    colour: str = ""

    name: ClassVar[str]

    def own(self, where: str) -> dict[str, Any]:
        """Numbers of the shape itself, checked."""
        raise AssertionError("every shape has numbers")

    def described(self, where: str) -> dict[str, Any]:
        """Checked numbers and texts, as a file has them; expressions stay."""
        if not isinstance(self.colour, str) or (self.colour and not _COLOUR.fullmatch(self.colour)):
            raise problem(f"{where}.colour", f"must be '#rrggbb', got {shown(self.colour)}")
        table = {"type": self.name, **self.own(where)}
        at = vector(self.at, f"{where}.at")
        if any(isinstance(v, Expression) or v != 0.0 for v in at):
            table["at"] = at
        if self.orientation is not None:
            table["orientation"] = quaternion(self.orientation, f"{where}.orientation")
        return {**table, "colour": self.colour} if self.colour else table


@dataclass(frozen=True, eq=False)
class Box(Shape):
    """A box with edges ``size`` (3,), m, along its axes.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("table")
    >>> top = m.body("top", mass=20.0, inertia=(1, 1, 1), at=(0, 0, 0.7), shape=mb.Box((1.2, 0.8, 0.03)))
    """

    size: Vector3 = (1.0, 1.0, 1.0)
    name: ClassVar[str] = "box"

    def __init__(
        self, size: Vector3, *, at: Vector3 = (0.0, 0.0, 0.0), orientation: Rotation | None = None, colour: str = ""
    ) -> None:
        _set(self, size=size, at=at, orientation=orientation, colour=colour)

    def own(self, where: str) -> dict[str, Any]:
        return {"size": [_positive(v, f"{where}.size") for v in vector(self.size, f"{where}.size")]}


@dataclass(frozen=True, eq=False)
class Cylinder(Shape):
    """A cylinder of ``radius`` and ``length``, m, along ``axis``: "x", "y", "z" or a vector (3,), body axes."""

    radius: Scalar = 1.0
    length: Scalar = 1.0
    axis: Axis = "z"
    name: ClassVar[str] = "cylinder"

    def __init__(
        self,
        radius: Scalar,
        length: Scalar,
        axis: Axis = "z",
        *,
        at: Vector3 = (0.0, 0.0, 0.0),
        orientation: Rotation | None = None,
        colour: str = "",
    ) -> None:
        _set(self, radius=radius, length=length, axis=axis, at=at, orientation=orientation, colour=colour)

    def own(self, where: str) -> dict[str, Any]:
        made: dict[str, Any] = {
            key: _positive(scalar(getattr(self, key), f"{where}.{key}"), f"{where}.{key}")
            for key in ("radius", "length")
        }
        along = axis(self.axis, f"{where}.axis")
        return made if along == [0.0, 0.0, 1.0] else {**made, "axis": along}


@dataclass(frozen=True, eq=False)
class Sphere(Shape):
    """A sphere of ``radius``, m, or an ellipsoid with three half axes (3,)."""

    radius: Scalar | Vector3 = 1.0
    name: ClassVar[str] = "sphere"

    def __init__(
        self,
        radius: Scalar | Vector3,
        *,
        at: Vector3 = (0.0, 0.0, 0.0),
        orientation: Rotation | None = None,
        colour: str = "",
    ) -> None:
        _set(self, radius=radius, at=at, orientation=orientation, colour=colour)

    def own(self, where: str) -> dict[str, Any]:
        where += ".radius"
        if shape_of(self.radius) == (3,):
            return {"radius": [_positive(v, where) for v in vector(self.radius, where)]}
        return {"radius": _positive(scalar(self.radius, where), where)}


@dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """A surface from a file, read when a picture is made (``pip install mbrs-dynamics[meshes]``: trimesh, or meshio).

    Parameters
    ----------
    file
        .stl, .obj, .ply, .off, .vtk, .vtu or .msh.
    scale
        One number, or one for each axis (3,): 1e-3 for a file in millimetres.
    """

    file: str | Path = ""
    scale: Scalar | Vector3 = 1.0
    name: ClassVar[str] = "mesh"

    def __init__(
        self,
        file: str | Path,
        scale: Scalar | Vector3 = 1.0,
        *,
        at: Vector3 = (0.0, 0.0, 0.0),
        orientation: Rotation | None = None,
        colour: str = "",
    ) -> None:
        _set(self, file=file, scale=scale, at=at, orientation=orientation, colour=colour)

    def own(self, where: str) -> dict[str, Any]:
        if not isinstance(self.file, str | Path) or Path(self.file).suffix.lower() not in MESH_ENDINGS:
            raise problem(
                f"{where}.file", f"must be a file that ends in {', '.join(MESH_ENDINGS)}, got {shown(self.file)}"
            )
        made: dict[str, Any] = {"file": str(self.file)}
        where += ".scale"
        if shape_of(self.scale) == (3,):
            return {**made, "scale": vector(self.scale, where)}
        scale = scalar(self.scale, where)
        return made if not isinstance(scale, Expression) and scale == 1.0 else {**made, "scale": scale}


SHAPES: Mapping[str, type[Shape]] = {kind.name: kind for kind in (Box, Cylinder, Sphere, Mesh)}
ShapeLike = Shape | Sequence[Shape]


def _set(shape: Shape, **given: Any) -> None:
    for name, value in given.items():
        object.__setattr__(shape, name, value)


def _positive(value: Number, where: str) -> Number:
    now = value.value if isinstance(value, Expression) else value
    if not (math.isfinite(now) and now > 0.0):
        raise problem(where, f"must be positive, got {now:g}")
    return value


def shapes(given: ShapeLike | None, where: str) -> list[dict[str, Any]]:
    """The tables of one shape, several or none."""
    if given is None:
        return []
    several: list[Any] = list(given) if isinstance(given, list | tuple) else [given]
    for one in several:
        if not isinstance(one, Shape):
            raise problem(
                where, f"must be mb.Box, mb.Cylinder, mb.Sphere or mb.Mesh, or a list of them, got {shown(one)}"
            )
    return [one.described(where if len(several) == 1 else f"{where}[{i}]") for i, one in enumerate(several)]


def shape_of_table(table: Any, read: Any) -> Shape:
    """A shape from the table of a file; ``read`` makes numbers and expressions of an entry."""
    given = dict(table) if isinstance(table, dict) else {}
    kind = given.pop("type", None)
    if not isinstance(kind, str) or kind not in SHAPES:
        guess = nearest(kind, SHAPES) if isinstance(kind, str) else None
        hint = f"did you mean {guess!r}?" if guess else "known: " + ", ".join(SHAPES)
        raise problem("shape", f"has no type {shown(kind)}; {hint}")
    texts = ("file", "colour")
    made = {k: v if k in texts or (k == "axis" and isinstance(v, str)) else read(v) for k, v in given.items()}
    try:
        return SHAPES[kind](**made)
    except TypeError:
        raise problem("shape", f"of type {kind} cannot have the entries {shown(list(given))}") from None


def plain(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table with expressions as the numbers that they are now."""

    def now(value: Any) -> Any:
        if isinstance(value, list):
            return numbers(value)
        return value.value if isinstance(value, Expression) else value

    return {key: now(value) for key, value in table.items()}
