"""MATLAB files of version 5 to 7.2, written by SciPy. Files of version 7.3 are HDF5 and are refused.

The reader is our own: SciPy's, in C, ends the process on some damaged files. Format: MathWorks, MAT-File Format, 2019.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.checks import shown
from .._lib.files import write_atomic
from .._lib.formats import Format, open_file, register
from .._lib.matrix_files import MatrixSet
from ..errors import ModelError
from ._matrices import LARGEST_SIDE, guarded, tidy

# Bytes that the variables of a compressed file may have together. Too small: large sparse matrices are refused. Too large: small files
# fill the memory. Pinned by tests/io/test_hostile.py.
LARGEST_UNPACKED = 1024**3
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
# NumPy types of data elements.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
# Classes of arrays: 5 sparse, 6 to 15 numbers; the others are texts, cells, structures, objects.
_SPARSE, _NUMBERS = 5, range(6, 16)
_COMPLEX = 0x0800


class _Damage(ValueError):
    """The structure of the file does not hold together."""


def read(path: Path, whole_nodes: bool = False) -> MatrixSet:
    """All real matrices of a file by name; structures, cells and texts are passed over."""
    data = open_file(path)
    if data[:8] == b"\x89HDF\r\n\x1a\n" or b"MATLAB 7.3" in data[:_HEADER]:
        raise ModelError(f"{path.name} is of MATLAB 7.3 (HDF5), which is not read; save it with -v7")
    mark = data[124:_HEADER]
    order = {b"\x00\x01IM": "<", b"\x01\x00MI": ">"}.get(mark)
    if order is None:
        raise ModelError(f"{path.name} is not a MATLAB file of version 5 to 7.2")

    def load() -> MatrixSet:
        budget = [LARGEST_UNPACKED]
        found = {}
        for element in _matrices(memoryview(data)[_HEADER:], order, budget):
            made = _array(element, order)
            if made is not None:
                found[made[0]] = tidy(path, made[0], made[1])
        return MatrixSet(found)

    made: MatrixSet = guarded(path, "a MATLAB file", load)
    if not made.matrices:
        raise ModelError(f"{path.name} has no matrices")
    return made


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """(type, bytes) of the data elements in a row."""
    place = 0
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, place)
        if kind >> 16:  # small: length and type in one word, at most four bytes behind it
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise _Damage("a short element is longer than four bytes")
            yield kind, data[place + 4 : place + 4 + size]
            place += 8
            continue
        if size > len(data) - place - 8:
            raise _Damage("an element is longer than the file")
        yield kind, data[place + 8 : place + 8 + size]
        place += 8 + size + (0 if kind == _COMPRESSED else -size % 8)


def _matrices(data: memoryview, order: str, budget: list[int]) -> Iterator[memoryview]:
    """The arrays of a file, unpacked."""
    for kind, body in _elements(data, order):
        if kind == _MATRIX:
            yield body
        elif kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            whole = unpacker.decompress(body, budget[0] + 1)
            budget[0] -= len(whole)
            if budget[0] < 0:
                raise _Damage(f"it unpacks to more than {LARGEST_UNPACKED // 1024**2} MiB, the most that is read")
            yield from (inner for k, inner in _elements(memoryview(whole), order) if k == _MATRIX)


def _array(body: memoryview, order: str) -> tuple[str, Any] | None:
    """Name and matrix of an array, or None where it is something else."""
    parts = _elements(body, order)
    flags = _numbers(next(parts), order)
    dims = _numbers(next(parts), order)
    name = bytes(next(parts)[1]).decode("latin-1")
    if len(flags) < 1 or len(dims) != 2:
        return None
    kind, is_complex = int(flags[0]) & 0xFF, bool(int(flags[0]) & _COMPLEX)
    rows, columns = (int(n) for n in dims)
    if kind != _SPARSE and kind not in _NUMBERS:
        return None
    if not (0 <= rows <= LARGEST_SIDE and 0 <= columns <= LARGEST_SIDE):
        raise _Damage(f"matrix {name[:40]!r} has the shape ({rows}, {columns})")
    if kind != _SPARSE:
        real = _numbers(next(parts), order).astype(float)
        value = real + 1j * _numbers(next(parts), order) if is_complex else real
        return name, value.reshape(columns, rows).T
    return name, _sparse(parts, order, (rows, columns), is_complex)


def _sparse(parts: Iterator[tuple[int, memoryview]], order: str, shape: tuple[int, int], is_complex: bool) -> Any:
    import scipy.sparse as sp

    row, start = (_numbers(next(parts), order).astype(np.int64) for _ in range(2))
    if len(start) != shape[1] + 1 or start[0] != 0 or np.any(np.diff(start) < 0) or start[-1] > len(row):
        raise _Damage("the columns of a sparse matrix do not follow each other")
    count = int(start[-1])
    row = row[:count]
    if np.any((row < 0) | (row >= shape[0])):
        raise _Damage("a row of a sparse matrix is outside of it")
    real = _numbers(next(parts), order).astype(float)[:count]
    value = real + 1j * _numbers(next(parts), order)[:count] if is_complex else real
    if len(value) != count:
        raise _Damage("a sparse matrix has fewer numbers than indices")
    return sp.coo_matrix((value, (row, np.repeat(np.arange(shape[1]), np.diff(start)))), shape=shape).tocsc()


def _numbers(element: tuple[int, memoryview], order: str) -> np.ndarray:
    kind, data = element
    if kind not in _TYPES:
        raise _Damage(f"an element of type {kind} is found where numbers should be")
    dtype = np.dtype(order + _TYPES[kind])
    return np.frombuffer(data, dtype, count=math.floor(len(data) / dtype.itemsize))


def write(matrices: Mapping[str, Any], path: Path) -> Path:
    """Write matrices as version 5, not compressed."""
    from scipy.io import savemat

    for name in matrices:
        if not (name.isascii() and name.isidentifier() and len(name) <= 31 and not name.startswith("_")):
            raise ModelError(f"a variable of a MATLAB file has a name of letters and digits, got {shown(name)}")
    buffer = io.BytesIO()
    savemat(buffer, dict(matrices))
    return write_atomic(path, buffer.getvalue())


register(Format(".mat", "matrices", "MATLAB", read, write))
