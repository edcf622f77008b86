"""Matrix Market files (https://math.nist.gov/MatrixMarket/formats.html): one matrix each, written by SciPy.

Several matrices ``plate.mtx`` are the files ``plate.M.mtx``, ``plate.K.mtx``, ... side by side. The reader is our own: SciPy's, in C++,
ends the process on some damaged files.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.files import write_atomic
from .._lib.formats import Format, open_file, register
from .._lib.matrix_files import MatrixSet
from ..errors import ModelError
from ._matrices import LARGEST_DENSE, LARGEST_SIDE, guarded, tidy

# Numbers of an entry by field, beside its two indices.
_FIELDS = {"real": 1, "double": 1, "integer": 1, "complex": 2, "pattern": 0}
_SYMMETRIES = {"general": 0.0, "symmetric": 1.0, "skew-symmetric": -1.0, "hermitian": 1.0}


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
    data = open_file(path)
    head, _, rest = data.partition(b"\n")
    words = head.decode("latin-1").lower().split()
    if len(words) != 5 or words[:2] != ["%%matrixmarket", "matrix"]:
        raise ModelError(f"{path.name} is not Matrix Market: it does not begin with %%MatrixMarket matrix")
    layout, field, symmetry = words[2:]
    if layout not in ("coordinate", "array") or field not in _FIELDS or symmetry not in _SYMMETRIES:
        raise ModelError(f"{path.name}: the header {' '.join(words[2:])[:60]!r} is not of Matrix Market")
    return guarded(path, "Matrix Market", lambda: _matrix(path, rest, layout, field, _SYMMETRIES[symmetry]))


def _matrix(path: Path, text: bytes, layout: str, field: str, sign: float) -> Any:
    """The matrix of the entries behind the header; ``sign`` is that of the other triangle, 0 where both are there."""
    body = b"\n".join(line for line in text.split(b"\n") if not line.lstrip().startswith(b"%"))
    first, _, rest = body.lstrip().partition(b"\n")
    sides = [int(word) for word in first.split()]
    sparse = layout == "coordinate"
    if len(sides) != 2 + sparse or min(sides) < 0 or max(sides[:2]) > LARGEST_SIDE or (sign and sides[0] != sides[1]):
        raise ModelError(f"{path.name}: its sizes {first[:60].decode('latin-1')!r} are not those of such a matrix")
    rows, columns = sides[:2]
    stored = rows * columns
    if not sparse and sign:
        stored = rows * (rows + 1) // 2 if sign > 0.0 else rows * (rows - 1) // 2
    count, width = (sides[2], 2 + _FIELDS[field]) if sparse else (stored, _FIELDS[field])
    # an entry takes two bytes at least
    if 2 * count * width > len(rest) + 2 or (not sparse and rows * columns > 8 * LARGEST_DENSE):
        raise ModelError(
            f"{path.name}: it has fewer numbers than its sizes {first[:60].decode('latin-1')!r} say, or too many"
        )
    numbers = np.array(rest.split(), dtype=np.bytes_).astype(float) if count else np.zeros(0)
    if numbers.size != count * width:
        raise ModelError(f"{path.name}: it has {numbers.size} numbers in place of {count * width}")
    table = numbers.reshape(count, width)
    if sparse:
        return tidy(path, path.stem, _coordinates(path, table, (rows, columns), sign))
    return tidy(path, path.stem, _filled(_values(table), rows, columns, sign))


def _values(table: np.ndarray) -> np.ndarray:
    if table.shape[1] == 2:
        return np.asarray(table[:, 0] + 1j * table[:, 1])
    return table[:, 0] if table.shape[1] else np.ones(len(table))


def _coordinates(path: Path, table: np.ndarray, shape: tuple[int, int], sign: float) -> Any:
    import scipy.sparse as sp

    i, j = (table[:, k].astype(np.int64) - 1 for k in (0, 1))
    if (
        np.any(i != table[:, 0] - 1)
        or np.any(j != table[:, 1] - 1)
        or np.any((i < 0) | (i >= shape[0]) | (j < 0) | (j >= shape[1]))
    ):
        raise ModelError(f"{path.name}: an index is outside of the matrix")
    value = _values(table[:, 2:])
    if sign:
        off = i != j
        i, j, value = (
            np.concatenate([i, j[off]]),
            np.concatenate([j, i[off]]),
            np.concatenate([value, sign * np.conj(value[off])]),
        )
    return sp.coo_matrix((value, (i, j)), shape=shape).tocsc()


def _filled(value: np.ndarray, rows: int, columns: int, sign: float) -> np.ndarray:
    """Column by column; of a symmetric matrix the lower triangle, of a skew one without its diagonal."""
    if not sign:
        return value.reshape(columns, rows).T
    out = np.zeros((rows, columns), dtype=value.dtype)
    j, i = np.triu_indices(rows, 0 if sign > 0.0 else 1)
    out[j, i] = sign * np.conj(value)
    out[i, j] = value
    return out


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
