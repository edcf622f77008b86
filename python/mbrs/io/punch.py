"""Nastran punch files: DMIG entries, by pyyeti (https://pyyeti.readthedocs.io). They are read only: they hold ten digits."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.formats import Format, open_file, register
from .._lib.matrix_files import MatrixSet
from ..errors import ModelError
from ._matrices import guarded, tidy

# Rows and columns of all DMIG entries together. The library holds them as dense tables. Pinned by tests/io/test_hostile.py.
_LARGEST = 5_000


def read(path: Path, whole_nodes: bool = False) -> MatrixSet:
    """All square DMIG matrices, over the degrees of freedom that any of them names, nodes ascending.

    INCLUDE statements are not followed. Input matrices of columns (form 9) are refused.
    """
    text = open_file(path).decode("latin-1")
    try:
        with np.printoptions():  # the package sets print options of its own
            from pyyeti.nastran import bulk
    except ImportError:
        raise ModelError("DMIG needs pyyeti, which is not installed: pip install 'mbrs-dynamics[nastran]'") from None
    nodes = {
        line[24:40].strip() if line[4:5] == "*" else line[16:24].strip()
        for line in text.splitlines()
        if line[:4].upper() == "DMIG"
    }
    if len(nodes) > _LARGEST:
        raise ModelError(f"{path.name} names more than {_LARGEST} nodes; write such matrices as OP4")
    found = guarded(path, "DMIG", lambda: bulk.rddmig(io.StringIO(text), expanded=whole_nodes, square=True))
    if not found:
        raise ModelError(f"{path.name} has no DMIG entries")
    return guarded(path, "DMIG", lambda: _together(path, found))  # type: ignore[no-any-return]


def _together(path: Path, found: dict[str, Any]) -> MatrixSet:
    """The tables over one list of degrees of freedom."""
    used: set[tuple[int, int]] = set()
    for name, table in found.items():
        if table.columns.nlevels != 2 or list(table.index) != list(table.columns):
            raise ModelError(
                f"{path.name}: DMIG {name!r} is not square: only matrices over degrees of freedom are read"
            )
        used |= {(int(i), int(j)) for i, j in table.index}
    order = sorted(used)
    place = {freedom: i for i, freedom in enumerate(order)}
    out = {}
    for name, table in found.items():
        rows = [place[int(i), int(j)] for i, j in table.index]
        whole = np.zeros((len(order), len(order)), dtype=table.to_numpy().dtype)
        whole[np.ix_(rows, rows)] = table.to_numpy()
        out[name] = tidy(path, name, whole)
    return MatrixSet(out, tuple(order))


register(Format(".pch", "matrices", "Nastran punch", read))
