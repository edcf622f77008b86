"""Matrix Market files (https://math.nist.gov/MatrixMarket/formats.html), by SciPy: one matrix each.

Several matrices ``plate.mtx`` are the files ``plate.M.mtx``, ``plate.K.mtx``, ... side by side.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import ModelError
from ..files import write_atomic
from ..formats import Format, open_file, register
from ..matrix_files import MatrixSet
from ._matrices import LARGEST_SIDE, guarded, tidy


def read(path: Path, whole_nodes: bool = False) -> MatrixSet:
    """The matrix of a file under the name "A", or those of a family of files under theirs."""
    if not path.exists():
        family = sorted(path.parent.glob(f"{_literal(path.stem)}.*{path.suffix}")) if path.parent.is_dir() else []
        if family:
            return MatrixSet({p.name[len(path.stem) + 1 : -len(path.suffix)]: _one(p) for p in family})
    return MatrixSet({"A": _one(path)})


def _literal(text: str) -> str:
    return "".join(f"[{ch}]" if ch in "*?[" else ch for ch in text)


def _one(path: Path) -> Any:
    from scipy.io import mmread

    data = open_file(path)
    head, _, rest = data.partition(b"\n")
    if not head.lower().startswith(b"%%matrixmarket"):
        raise ModelError(f"{path.name} is not Matrix Market: it does not begin with %%MatrixMarket")
    size = next((line for line in rest.split(b"\n") if line.strip() and not line.startswith(b"%")), b"")

    def load() -> Any:
        sides = [int(word) for word in size.split()]
        # an entry takes two bytes at least
        entries = sides[2] if len(sides) > 2 else sides[0] * sides[1]
        if not 2 <= len(sides) <= 3 or min(sides) < 0 or max(sides[:2]) > LARGEST_SIDE or entries > len(data):
            raise ModelError(f"{path.name}: its sizes {size[:60].decode('latin-1')!r} do not fit the file")
        return tidy(path, path.stem, mmread(io.BytesIO(data)))

    return guarded(path, "Matrix Market", load)


def write(matrices: Mapping[str, Any], path: Path) -> Path:
    """Write one matrix, or a family of files for several; numbers to the last bit."""
    from scipy.io import mmwrite

    for name, matrix in matrices.items():
        to = path if len(matrices) == 1 else path.with_name(f"{path.stem}.{name}{path.suffix}")
        buffer = io.BytesIO()
        mmwrite(buffer, matrix, precision=17)
        write_atomic(to, buffer.getvalue())
    return path


register(Format(".mtx", "matrices", "Matrix Market", read, write))
