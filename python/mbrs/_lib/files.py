"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from ..errors import FileError
from . import checks

__all__ = ["write_atomic"]


def write_atomic(path: str | Path, data: bytes | Callable[[BinaryIO], None]) -> Path:
    """Write a file so that at every instant the old one or the whole new one is there.

    The bytes, or what a function writes that should not be in memory twice, go to a temporary file in the same folder, are flushed to
    the disk, and take the name at once. A link of that name is replaced by the file; what it pointed to stays as it is. Permissions of
    an old file are kept. Raises `FileError`.
    """
    path = checks.path("path", path)
    try:
        return _written(path, data)
    except OSError as reason:
        raise FileError(reason.errno, reason.strerror or str(reason), str(path)) from reason


def _written(path: Path, data: bytes | Callable[[BinaryIO], None]) -> Path:
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name[:100]}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            if callable(data):
                data(file)
            else:
                file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, _mode_of(path))
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    _flush_folder(path.parent)
    return path


def _mode_of(path: Path) -> int:
    if path.is_file() and not path.is_symlink():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _flush_folder(folder: Path) -> None:
    """The new name to the disk as well; systems that cannot open folders do it by themselves."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError:
        pass
    finally:
        os.close(descriptor)
