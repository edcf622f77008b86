"""Elastic bodies from the files of finite-element programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.matrix_files import choose, read_matrices
from ..errors import ModelError, NameNotFoundError
from .component_modes import craig_bampton
from .modal_body import ModalBody

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike

__all__ = ["from_file"]


def from_file(
    path: str | Path | Mapping[str, str | Path],
    nodes: Mapping[str, int],
    *,
    positions: ArrayLike | Mapping[int, ArrayLike],
    names: Mapping[str, str] | None = None,
    modes: int = 6,
    fixed: str | None = None,
    damping: ArrayLike | None = None,
) -> ModalBody:
    """A Craig-Bampton body from a file of matrices; see `craig_bampton` for the equations.

    Parameters
    ----------
    path
        ``.op4``, ``.pch`` (DMIG), ``.mtx`` or ``.mat``, or ``{"M": path, "K": path}`` where each file has one matrix.
    nodes
        Name to node of the attachments: grid numbers in a ``.pch`` file, which has them, else indices from 0.
    positions
        (n, 3) m of all nodes in the order of the file, grids ascending; of a ``.pch`` file also {grid: (x, y, z)}.
    names
        ``{"M": name, "K": name}`` in the file; the usual ones by default (MAA, KAA, ...).
    modes, fixed, damping
        As in `craig_bampton`.

    Returns
    -------
    ModalBody

    Raises
    ------
    ModelError
        As `craig_bampton`; a file or a matrix that is not there.

    Examples
    --------
    >>> import tempfile, numpy as np, mbrs as mb
    >>> k, m = 1e4 * np.eye(6), np.diag([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    >>> plate = mb.MechanicalSystem(M=np.kron(np.eye(2), m), K=np.block([[k, -k], [-k, k]]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     body = mb.flexible.from_file(plate.save(folder + "/p.mat"), {"a": 0, "b": 1}, positions=np.zeros((2, 3)), modes=0)
    >>> body.nodes
    ('a', 'b')
    """
    found = read_matrices(path, whole_nodes=True)
    chosen = choose(found, "MK", names, path)
    if found.rows is not None:
        nodes, places = _by_grid(found.rows, nodes, positions)
    else:
        places = positions
    return craig_bampton(chosen["M"], chosen["K"], nodes, positions=places, modes=modes, fixed=fixed, damping=damping)


def _by_grid(rows: tuple[tuple[int, int], ...], nodes: Mapping[str, int], positions: Any) -> tuple[dict[str, int], Any]:
    """Indices of nodes and the order of positions, from the grid numbers of the file."""
    grids = [node for node, component in rows if component == 1]
    if len(rows) != 6 * len(grids):
        scalar = next(node for node, component in rows if component == 0)
        raise ModelError(
            f"from_file: point {scalar} of the file is a scalar point; a body has nodes with six degrees of freedom"
        )
    place = {grid: i for i, grid in enumerate(grids)}
    asked = [*nodes.values(), *(positions if isinstance(positions, Mapping) else ())]
    lost = [grid for grid in asked if grid not in place]
    if lost:
        raise NameNotFoundError(
            f"from_file: there is no grid {lost[0]} in the file; it has {', '.join(map(str, grids[:8]))}, ..."
        )
    if isinstance(positions, Mapping):
        absent = [grid for grid in grids if grid not in positions]
        if absent:
            raise ModelError(f"from_file: positions has no entry for grid {absent[0]}")
        positions = np.array([positions[grid] for grid in grids], dtype=float)
    return {name: place[grid] for name, grid in nodes.items()}, positions
