"""Nastran OUTPUT4 files, binary and text, dense and sparse, by pyyeti (https://pyyeti.readthedocs.io)."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.files import write_atomic
from .._lib.formats import Format, open_file, register
from .._lib.matrix_files import MatrixSet
from ..errors import ModelError
from ._matrices import LARGEST_SIDE, guarded, tidy

# Characters of a matrix name in the format.
_LONGEST_NAME = 8


def library() -> Any:
    """pyyeti's module of OUTPUT4 files."""
    try:
        with np.printoptions():  # the package sets print options of its own
            from pyyeti.nastran import op4
    except ImportError:
        raise ModelError("OP4 needs pyyeti, which is not installed: pip install 'mbrs-dynamics[nastran]'") from None
    return op4


def read(path: Path, whole_nodes: bool = False) -> MatrixSet:
    """All matrices of a file by name; large ones in sparse columns."""
    data = open_file(path)
    op4 = library()
    _check_records(path, data)

    def load() -> dict[str, Any]:
        names, sizes, _, _ = _careful(op4).dir(str(path), verbose=False)
        if len(set(names)) != len(names):
            raise ModelError(f"{path.name} has two matrices of one name: {', '.join(names)}")
        if any(not 0 < side <= LARGEST_SIDE for size in sizes for side in size):
            raise ModelError(f"{path.name} has a matrix with more than {LARGEST_SIDE} rows or columns")
        return {
            name: tidy(path, name, a)
            for name, a in _careful(op4).load(str(path), into="dct", justmatrix=True, sparse=True).items()
        }

    found = guarded(path, "OP4", load)
    if not found:
        raise ModelError(f"{path.name} has no matrices, so it is not a file of OP4")
    return MatrixSet(found)


def _check_records(path: Path, data: bytes) -> None:
    """A binary file is a row of records [length, bytes, length], which the reader follows without looking back."""
    if len(data) < 16:
        raise ModelError(f"{path.name} is too short for OP4")
    if all(32 <= b < 127 or b in (9, 10, 13) for b in data[:80]):
        return
    for form in ("<i", ">i"):
        place = 0
        while place + 8 <= len(data):
            (size,) = struct.unpack_from(form, data, place)
            if size < 0 or place + size + 8 > len(data) or struct.unpack_from(form, data, place + 4 + size) != (size,):
                break
            place += size + 8
        if place == len(data):
            return
    raise ModelError(f"{path.name} is not OP4: its records do not follow each other")


def _careful(op4: Any) -> Any:
    """pyyeti's reader, which gives up behind the end of a text file: it believes counts of lines, and damaged ones are large."""

    class Careful(op4.OP4):  # type: ignore[misc]
        def _op4open_read(self, filename: str) -> Any:
            opened = super()._op4open_read(filename)
            if self._ascii:
                self._fileh: Any = _Lines(self._fileh)
            return opened

    return Careful()


class _Lines:
    """A text file that can be read to its end, and not on and on."""

    def __init__(self, file: Any) -> None:
        self._file, self._left = file, 10

    def readline(self) -> str:
        """The next line; "" at the end, where a reader stops."""
        line: str = self._file.readline()
        if not line:
            self._left -= 1
            if self._left < 0:
                raise EOFError("it ends before its matrices do")
        return line

    def __iter__(self) -> _Lines:
        return self

    def __next__(self) -> str:
        line = self.readline()
        if not line:
            raise StopIteration
        return line

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def write(matrices: Mapping[str, Any], path: Path) -> Path:
    """Write matrices in double precision, binary."""
    op4 = library()
    for name in matrices:
        if not name.isidentifier() or len(name) > _LONGEST_NAME:
            raise ModelError(f"a matrix of OP4 has a name of at most {_LONGEST_NAME} letters and digits, got {name!r}")
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.op4"
        op4.write(str(made), dict(matrices))
        return write_atomic(path, made.read_bytes())


register(Format(".op4", "matrices", "OP4", read, write))
