"""MATLAB files of versions 4 and 5 to 7.2, by SciPy. Files of version 7.3 are HDF5 and are refused."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ModelError
from ..files import write_atomic
from ..formats import Format, open_file, register
from ..matrix_files import MatrixSet
from ._matrices import guarded, tidy

# Bytes that the variables of a compressed file may have. Too small: large sparse matrices are refused. Too large: small files fill the
# memory. Pinned by tests/test_io_hostile.py.
LARGEST_UNPACKED = 1024**3
_HEADER, _COMPRESSED = 128, 15


def read(path: Path, whole_nodes: bool = False) -> MatrixSet:
    """All real matrices of a file by name; structures, cells and texts are passed over."""
    from scipy.io import loadmat
    from scipy.sparse import issparse

    data = open_file(path)
    if data[:8] == b"\x89HDF\r\n\x1a\n" or b"MATLAB 7.3" in data[:_HEADER]:
        raise ModelError(f"{path.name} is of MATLAB 7.3 (HDF5), which is not read; save it with -v7")
    _check_unpacked(path, data)
    found = guarded(path, "a MATLAB file", lambda: loadmat(io.BytesIO(data)))
    kept = {n: v for n, v in found.items() if not n.startswith("__") and (issparse(v) or _is_matrix(v))}
    if not kept:
        raise ModelError(f"{path.name} has no matrices")
    return MatrixSet({name: _tidy(path, name, value) for name, value in kept.items()})


def _tidy(path: Path, name: str, value: Any) -> Any:
    return guarded(path, "a MATLAB file", lambda: tidy(path, name, value))


def _is_matrix(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biufc" and value.ndim == 2


def _check_unpacked(path: Path, data: bytes) -> None:
    """Add up what the compressed variables of a version 5 file unpack to."""
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        return
    order = "<" if data[126:128] == b"IM" else ">"
    place, total = _HEADER, 0
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, place)
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            part = data[place + 8 : place + 8 + size]
            while part and total <= LARGEST_UNPACKED:
                try:
                    total += len(unpacker.decompress(part, 2**20))
                except zlib.error as reason:
                    raise ModelError(f"{path.name} cannot be read as a MATLAB file: {reason}") from None
                part = unpacker.unconsumed_tail
        if total > LARGEST_UNPACKED:
            raise ModelError(
                f"{path.name} unpacks to more than {LARGEST_UNPACKED // 1024**2} MiB, the most that is read"
            )
        place += 8 + size


def write(matrices: Mapping[str, Any], path: Path) -> Path:
    """Write matrices as version 5, not compressed."""
    from scipy.io import savemat

    for name in matrices:
        if not (name.isascii() and name.isidentifier() and len(name) <= 31 and not name.startswith("_")):
            raise ModelError(f"a variable of a MATLAB file has a name of letters and digits, got {name!r}")
    buffer = io.BytesIO()
    savemat(buffer, dict(matrices))
    return write_atomic(path, buffer.getvalue())


register(Format(".mat", "matrices", "MATLAB", read, write))
