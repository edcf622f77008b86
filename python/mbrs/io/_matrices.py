"""The common part of readers of matrices: sizes that cannot be, complex numbers without imaginary part, dense where it is small."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MbrsError, ModelError
from ._xml import clipped

# Rows or columns of the largest matrix that is read. Too small: large meshes are refused. Too large: a header with a wrong number fills
# the memory with pointers of columns. Pinned by tests/io/test_hostile.py.
LARGEST_SIDE = 5_000_000
# Entries up to which a matrix becomes a dense array (32 MB). Too small: small systems take the sparse routes. Too large: memory.
LARGEST_DENSE = 4_000_000


def guarded(path: Path, title: str, action: Callable[[], Any]) -> Any:
    """The value that a foreign library makes of a file; whatever it raises becomes a `ModelError` with the file's name."""
    import warnings

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return action()
    except MbrsError:
        raise
    except Exception as reason:
        text = clipped(" ".join(str(reason).split())) or type(reason).__name__
        raise ModelError(f"{path.name} cannot be read as {title}: {text}") from None


def tidy(path: Path, name: str, matrix: Any) -> Any:
    """A real matrix, dense where it is small, else in sparse columns."""
    import scipy.sparse as sp

    if max(matrix.shape, default=0) > LARGEST_SIDE:
        raise ModelError(
            f"{path.name}: matrix {clipped(name)!r} has shape {matrix.shape}; at most {LARGEST_SIDE} rows are read"
        )
    data = matrix.data if sp.issparse(matrix) else matrix
    if np.iscomplexobj(data):
        if np.any(np.imag(data)):
            raise ModelError(f"{path.name}: matrix {clipped(name)!r} is complex; real matrices are read")
        matrix = matrix.real
    if not np.all(np.isfinite(matrix.data if sp.issparse(matrix) else matrix)):
        raise ModelError(f"{path.name}: matrix {clipped(name)!r} has entries that are not finite")
    if not sp.issparse(matrix):
        return np.ascontiguousarray(matrix, dtype=float)
    if matrix.shape[0] * matrix.shape[1] <= LARGEST_DENSE:
        return np.asarray(matrix.toarray(), dtype=float)
    return sp.csc_matrix(matrix, dtype=float)
