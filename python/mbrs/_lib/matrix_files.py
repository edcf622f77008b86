"""Files of matrices: which of the matrices in a file is the mass, the stiffness, the damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ModelError, NameNotFoundError
from .formats import find

__all__ = ["MatrixSet", "choose", "read_matrices", "write_matrices"]

# What programs call them, lower case: MAA and the like are Nastran's sets.
_NAMES: Mapping[str, tuple[str, ...]] = {
    "M": ("m", "mass", "maa", "mgg", "mff", "mxx", "mhh"),
    "K": ("k", "stiffness", "stiff", "kaa", "kgg", "kff", "kxx", "khh"),
    "C": ("c", "damping", "damp", "baa", "bgg", "bff", "bxx", "bhh"),
    "G": ("g", "gyroscopic", "gyro"),
    "N": ("n", "circulatory"),
}


@dataclass(frozen=True)
class MatrixSet:
    """The matrices of a file.

    Attributes
    ----------
    matrices
        By the name in the file; arrays, or `scipy.sparse` where they are large.
    rows
        (node, component 1 to 6 or 0) of the rows, or None where the format does not tell.
    """

    matrices: Mapping[str, Any]
    rows: tuple[tuple[int, int], ...] | None = None


def read_matrices(path: str | Path | Mapping[str, str | Path], whole_nodes: bool = False) -> MatrixSet:
    """The matrices of a file (``.op4``, ``.pch``, ``.mtx``, ``.mat``), or of a file for each ``{"M": path, "K": path}``.

    ``whole_nodes``: rows for all six components of a node, zero where the file has none.
    """
    if not isinstance(path, Mapping):
        read = find(path, "matrices", "read").read
        found: MatrixSet = read(Path(path), whole_nodes=whole_nodes)  # type: ignore[misc]
        return found
    together: dict[str, Any] = {}
    for name, one in path.items():
        inner = read_matrices(one, whole_nodes).matrices
        if len(inner) != 1:
            raise ModelError(
                f"{Path(one).name} has {len(inner)} matrices ({', '.join(inner)}); a file for {name} must have one"
            )
        together[name] = next(iter(inner.values()))
    return MatrixSet(together)


def choose(
    found: MatrixSet, wanted: Sequence[str], names: Mapping[str, str] | None, source: Any, needed: str = "MK"
) -> dict[str, Any]:
    """The matrices by the letters that mbrs uses.

    Parameters
    ----------
    found
        Of `read_matrices`.
    wanted
        Letters of "M", "C", "K", "G", "N".
    names
        {"M": name in the file}; what is not in it is found by the usual names (M, MASS, MAA, ...).
    source
        For messages.
    needed
        Letters that must be there.

    Raises
    ------
    NameNotFoundError
        No matrix, or several, for a letter; the message lists the names in the file.
    """
    name = Path(source).name if isinstance(source, str | Path) else "the files"
    by_name = {key.lower(): key for key in found.matrices}
    listed = ", ".join(found.matrices) or "none"
    out = {}
    for letter in wanted:
        if names is not None and letter in names:
            if names[letter].lower() not in by_name:
                raise NameNotFoundError(f"{name} has no matrix {names[letter]!r}; it has {listed}")
            out[letter] = found.matrices[by_name[names[letter].lower()]]
            continue
        fitting = [by_name[n] for n in _NAMES[letter] if n in by_name]
        if len(fitting) > 1 or (not fitting and letter in needed):
            problem = "several" if fitting else "no"
            raise NameNotFoundError(
                f'{name} has {problem} matrices that may be {letter}: it has {listed}; give names={{"{letter}": name}}'
            )
        if fitting:
            out[letter] = found.matrices[fitting[0]]
    unknown = set(names or ()) - set(wanted)
    if unknown:
        raise ModelError(f"names= has {', '.join(sorted(unknown))}; known are {', '.join(wanted)}")
    return out


def write_matrices(matrices: Mapping[str, Any], path: str | Path) -> Path:
    """Write matrices by name; the ending decides."""
    write = find(path, "matrices", "write").write
    return write(matrices, Path(path))  # type: ignore[misc]
