"""Arrays of NumPy archives from anywhere: nothing is executed, and a damaged file is an error of ours with its reason."""

from __future__ import annotations

import math
import tokenize
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..errors import ModelError

__all__ = ["read_arrays"]

# What zipfile and NumPy raise when bytes are damaged: lengths, checksums, headers, codecs. MemoryError: headers are parsed as
# Python literals, and the parser raises it for nested ones; what is allocated here is never larger than the file.
_DAMAGED = (
    ValueError,
    EOFError,
    KeyError,
    MemoryError,
    IndexError,
    TypeError,
    OverflowError,
    NotImplementedError,
    RuntimeError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
)
# Least and most of an array's file in bytes over its numbers: what a file claims more than it holds was damaged.
_HEADER = 1 << 16


def read_arrays(path: str | Path, names: Iterable[str], what: str) -> dict[str, np.ndarray]:
    """The arrays of an ``.npz`` file that are called so; those that the file lacks are left out.

    What is read is never longer than the file: entries must be stored without compression, as `numpy.savez` does, and the header
    of each array has to claim what its entry holds.

    Raises
    ------
    ModelError
        The file is not an archive of arrays, or is damaged.
    OSError
        The file cannot be opened.
    """
    with open(path, "rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                held = {entry.filename: entry for entry in archive.infolist()}
                wanted = {name: held[f"{name}.npy"] for name in names if f"{name}.npy" in held}
                return {name: _array(archive, entry) for name, entry in wanted.items()}
        except ModelError as reason:
            raise type(reason)(f"{path}: {reason}") from None
        except (*_DAMAGED, OSError) as reason:
            text = " ".join(str(reason).split())[:200] or type(reason).__name__
            raise ModelError(f"{path} is not a file of {what}, or it is damaged: {text}") from None


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    if entry.compress_type != zipfile.ZIP_STORED:
        raise ModelError(f"{entry.filename} is compressed")
    with archive.open(entry) as data:
        version = np.lib.format.read_magic(data)
        if version not in ((1, 0), (2, 0)):
            raise ModelError(f"{entry.filename} has the version {version} of the format, which is not known here")
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(data)
        if dtype.kind not in "fiuU" or dtype.hasobject:
            raise ModelError(f"{entry.filename} holds {dtype}, not numbers or text")
        size = math.prod(shape) * dtype.itemsize
        if min(shape, default=0) < 0 or not entry.file_size - _HEADER <= size <= entry.file_size:
            raise ModelError(f"{entry.filename} claims {size} bytes in its header, but has {entry.file_size}")
        content = data.read(size)
        if len(content) != size or data.read(1):  # reading to the end also compares the checksum
            raise ModelError(f"{entry.filename} does not have as many numbers as its header says")
    flat = np.frombuffer(content, dtype=dtype)
    return flat.reshape(shape, order="F" if fortran else "C").copy()
