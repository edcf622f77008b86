"""VTK files for ParaView: motions as a series (.pvd), modes in one file (.vtu), in the plain XML form. They are only written.

https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from .._lib.files import write_atomic
from .._lib.formats import Format, register
from ..errors import ModelError

if TYPE_CHECKING:
    from ..view.scene import SceneGeometry

# Numbers of cell types in VTK.
_VERTEX, _LINE = 1, 3


class _Mesh:
    """Points and lines of a scene: the origin of each body, what is attached to it, springs.

    ``body`` is the index of each point's body (-1: ground), ``lines`` are pairs of points.
    """

    def __init__(self, scene: SceneGeometry) -> None:
        self.names = [b.name for b in scene.bodies]
        index = {name: i for i, name in enumerate(self.names)}
        self.body: list[int] = list(range(len(scene.bodies)))
        self.lines: list[tuple[int, int]] = []
        for i, body in enumerate(scene.bodies):
            for _ in body.points:
                self.lines.append((i, len(self.body)))
                self.body.append(i)
        for link in scene.links:
            self.lines.append((len(self.body), len(self.body) + 1))
            self.body += [-1 if end is None else index[end] for end in (link.a, link.b)]

    def points(self, scene: SceneGeometry) -> np.ndarray:
        """(n, 3) where the points are in a scene of the same bodies."""
        rows = [b.origin for b in scene.bodies] + [p for b in scene.bodies for p in np.reshape(b.points, (-1, 3))]
        rows += [at for link in scene.links for at in (link.at_a, link.at_b)]
        return np.array(rows, dtype=float).reshape(-1, 3)

    def carried(
        self, points: np.ndarray, origins: np.ndarray, translation: np.ndarray, rotation: np.ndarray
    ) -> np.ndarray:
        """(n, 3) u + w x (p - origin) of each point, from the u and w (n_body, 3) of its body; zero on ground."""
        body = np.array(self.body)
        on = body >= 0
        out = np.zeros(points.shape, dtype=np.result_type(translation, rotation))
        b = body[on]
        out[on] = translation[b] + np.cross(rotation[b], points[on] - origins[b])
        return out

    def document(self, points: np.ndarray, vectors: Mapping[str, np.ndarray]) -> bytes:
        """A file of one mesh; ``vectors`` (n, 3) by name."""
        root = ElementTree.Element("VTKFile", type="UnstructuredGrid", version="0.1", byte_order="LittleEndian")
        cells = [(i,) for i in range(len(self.names))] + self.lines
        grid = ElementTree.SubElement(root, "UnstructuredGrid")
        piece = ElementTree.SubElement(grid, "Piece", NumberOfPoints=str(len(points)), NumberOfCells=str(len(cells)))
        _array(ElementTree.SubElement(piece, "Points"), "Points", points)
        made = ElementTree.SubElement(piece, "Cells")
        _array(made, "connectivity", np.array([p for cell in cells for p in cell], dtype=int))
        _array(made, "offsets", np.cumsum([len(cell) for cell in cells], dtype=int))
        _array(made, "types", np.array([_VERTEX if len(cell) == 1 else _LINE for cell in cells], dtype=int), "UInt8")
        data = ElementTree.SubElement(piece, "PointData")
        _array(data, "body", np.array(self.body, dtype=int))
        for name, values in vectors.items():
            _array(data, name, values)
        return b'<?xml version="1.0"?>\n' + ElementTree.tostring(root) + b"\n"


def _array(parent: ElementTree.Element, name: str, values: np.ndarray, kind: str = "") -> None:
    given = {"type": kind or ("Float64" if values.dtype.kind == "f" else "Int64"), "Name": name, "format": "ascii"}
    if values.ndim == 2:
        given["NumberOfComponents"] = str(values.shape[1])
    node = ElementTree.SubElement(parent, "DataArray", given)
    node.text = " ".join(map(repr, np.ravel(values).tolist()))


def write_modes(thing: Any, path: Path) -> Path:
    """Write modes as vectors "mode 1" of each point, of complex shapes also "mode 1 imaginary", largest 1.

    Raises
    ------
    ModelError
        Another result, or modes of plain matrices.
    """
    from ..linear.modal_result import ModalResult
    from ..motion.trajectory import Trajectory

    if not isinstance(thing, ModalResult):
        hint = "; save a motion as .pvd" if isinstance(thing, Trajectory) else ""
        raise ModelError(f"a .vtu file holds modes, not a {type(thing).__name__}{hint}")
    scene = thing.geometry
    if scene is None:
        raise ModelError("these are modes of plain matrices, which have no geometry; save them as .nc or .json")
    mesh = _Mesh(scene)
    points = mesh.points(scene)
    origins = points[: len(mesh.names)]
    shapes = np.array([thing.body_shape(name) for name in mesh.names])
    vectors: dict[str, np.ndarray] = {}
    for k in range(thing.n):
        moved = mesh.carried(points, origins, shapes[:, :3, k], shapes[:, 3:, k])
        moved = moved / (np.abs(moved).max(initial=0.0) or 1.0)
        vectors[f"mode {k + 1}"] = moved.real
        if np.any(moved.imag):
            vectors[f"mode {k + 1} imaginary"] = moved.imag
    return write_atomic(path, mesh.document(points, vectors))


def write_motion(thing: Any, path: Path) -> Path:
    """Write a motion as a series: ``motion.pvd`` and a file for each output in the folder ``motion``, with displacement and velocity.

    Raises
    ------
    ModelError
        Another result.
    """
    from ..linear.modal_result import ModalResult
    from ..motion.trajectory import Trajectory
    from ..system.scene import scene_from_tables

    if not isinstance(thing, Trajectory):
        hint = "; save modes as .vtu" if isinstance(thing, ModalResult) else ""
        raise ModelError(f"a .pvd file holds a motion, not a {type(thing).__name__}{hint}")
    drawn = scene_from_tables(thing.snapshot.tables)
    mesh = _Mesh(drawn)
    position, rotation, velocity, turning = (
        _stacked([read(name) for name in mesh.names])
        for read in (thing.position, thing.rotation, thing.velocity, thing.angular_velocity)
    )
    folder = path.parent / path.stem
    folder.mkdir(exist_ok=True)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    series = ElementTree.SubElement(root, "Collection")
    start: np.ndarray | None = None
    for i, t in enumerate(thing.t):
        points = mesh.points(drawn.moved(position[i], rotation[i]))
        start = points if start is None else start
        vectors = {
            "displacement": points - start,
            "velocity": mesh.carried(points, position[i], velocity[i], turning[i]),
        }
        name = f"{path.stem}_{i:06d}.vtu"
        write_atomic(folder / name, mesh.document(points, vectors))
        ElementTree.SubElement(series, "DataSet", timestep=repr(float(t)), part="0", file=f"{folder.name}/{name}")
    return write_atomic(path, b'<?xml version="1.0"?>\n' + ElementTree.tostring(root) + b"\n")


def _stacked(parts: Sequence[np.ndarray]) -> np.ndarray:
    """(n_t, n_body, ...) of a list of (n_t, ...)."""
    return np.stack(parts, axis=1)


register(Format(".vtu", "result", "VTK", None, write_modes))
register(Format(".pvd", "result", "ParaView series", None, write_motion))
