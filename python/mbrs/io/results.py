"""Results as mbrs saves them (`mbrs._lib.result_files`).

Reading runs nothing: only classes of `HOMES` and functions of `FUNCTIONS` are ever made.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import io
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._lib import checks
from .._lib.formats import Format, find, register
from .._lib.records import FUNCTIONS, HOMES
from .._lib.result_files import FORMAT, MARK, WRITERS, write_file
from .._lib.vetter import Derivative
from ..errors import MbrsError, ModelError
from ..model.model import Model
from ..model.toml import loads
from ..results import Result

_TRAILER = len(MARK) + 64 + 1
# how deeply values may be nested before a file counts as damaged
_DEEPEST = 200


def member(table: Mapping[str, str], name: Any) -> Any:
    """The class or function of a table."""
    if name not in table:
        raise ModelError(f"the file holds a {name!r}, which this version of mbrs does not know")
    return getattr(importlib.import_module(f"mbrs.{table[name]}"), name)


def _text_type(name: Any) -> np.dtype[Any]:
    """Texts of a width that a name can have, or objects."""
    dtype = np.dtype(str(name))
    if dtype.kind not in "UO" or dtype.itemsize > 1 << 16:
        raise ModelError(f"an array of the file has the type {name!r}, which is not one of texts")
    return dtype


class Decoder:
    """The values of a tree; ``functions``: whether models that call Python functions are read, which imports these."""

    def __init__(self, arrays: list[np.ndarray], functions: bool = False) -> None:
        self.arrays, self.functions = arrays, functions
        self._made: dict[int, Any] = {}
        self._depth = 0

    def decode(self, tree: Any) -> Any:
        """One value."""
        if isinstance(tree, list):
            return [self.decode(one) for one in tree]
        if not isinstance(tree, dict):
            return tree
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ModelError("the file is nested too deeply")
        value = self._value(tree)
        self._depth -= 1
        return value

    def _value(self, tree: dict[str, Any]) -> Any:
        kind = tree["~"]
        if kind == "float":
            return {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}[tree["is"]]
        if kind == "complex":
            return complex(self.decode(tree["re"]), self.decode(tree["im"]))
        if kind == "tuple":
            return tuple(self.decode(tree["of"]))
        if kind == "dict":
            return {self.decode(k): self.decode(v) for k, v in tree["of"]}
        if kind == "array":
            return self.arrays[tree["at"]]
        if kind == "texts":
            made = np.empty(len(tree["of"]), dtype=_text_type(tree["dtype"]))
            made[:] = self.decode(tree["of"])
            return made.reshape(tree["shape"])
        if kind == "again":
            return self._made[tree["at"]]
        if kind == "record":
            return self._record(tree)
        value = self._made[tree["at"]] = self._other(kind, tree)
        return value

    def _record(self, tree: dict[str, Any]) -> Any:
        cls = member(HOMES, tree["class"])
        value = self._made[tree["at"]] = cls.__new__(cls)
        state = self.decode(tree["state"])
        if hasattr(value, "__setstate__"):
            value.__setstate__(state)
        else:
            value.__dict__.update(state)
        return value

    def _other(self, kind: str, tree: dict[str, Any]) -> Any:
        if kind == "model":
            return _model_of(tree["toml"], self.functions)
        if kind == "tuple of":
            return member(HOMES, tree["class"])(self.decode(tree["of"]))
        if kind == "partial":
            args, keywords = self.decode(tree["given"])
            return functools.partial(member(FUNCTIONS, tree["function"]), *args, **keywords)
        if kind == "made":
            return member(FUNCTIONS, tree["function"])(*self.decode(tree["given"]))
        if kind == "derivative":
            return Derivative.of(self.decode(tree["of"]), *tree["more"])
        if kind in ("sparse csc", "sparse csr"):
            import scipy.sparse

            made = scipy.sparse.csc_array if kind.endswith("csc") else scipy.sparse.csr_array
            parts = (self.decode(tree["data"]), self.decode(tree["indices"]), self.decode(tree["indptr"]))
            return made(parts, shape=tuple(tree["shape"]))
        raise ModelError(f"the file holds a value of the unknown kind {kind!r}")


def _model_of(text: str, functions: bool) -> Any:

    return loads(text, Model, "the model of the result", functions)


def _number_type(text: Any) -> np.dtype[Any]:
    dtype = np.dtype(str(text))
    if dtype.kind not in "biufc":
        raise ModelError(f"an array of the file has the type {text!r}, which is not one of numbers")
    return dtype


def load(path: str | Path, *, functions: bool = False) -> Any:
    """A result as it was saved; it prints, draws, continues (``at=``) and has sensitivities as before. Or a measurement.

    Parameters
    ----------
    path
        A ``.nc`` or ``.json`` file that ``result.save`` wrote, or a universal file (``.uff``, ``.unv``: docs/files.md).
    functions
        True imports the Python functions that the model of the result names, which runs their modules. Nothing else in a file
        is ever executed.

    Returns
    -------
    Result
        Of the class that was saved; a `Measurement` from a universal file.

    Raises
    ------
    ModelError
        No file of mbrs, one that was changed or damaged, one of a newer format; a pickle or a table of numbers (``.csv``), from
        which no result can be made safely.

    Examples
    --------
    >>> import tempfile, mbrs as mb
    >>> modes = mb.modes(mb.examples.cubic_hexapod())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     again = mb.load(modes.save(folder + "/modes.json"))
    >>> bool((again.frequency == modes.frequency).all())
    True
    """
    path = checks.path("path", path)
    ending = path.suffix.lower()
    if ending == ".pkl":
        raise ModelError(f"{path.name}: a pickle can run any program; if you made it yourself, use pickle.load")
    read = find(path, "result", "read").read
    return read(path, functions=functions)  # type: ignore[misc]


def read_file(path: Path, functions: bool = False) -> Result:
    """A file that `write_file` made."""
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise ModelError(f"cannot read {path}: {reason.strerror or reason}") from None
    try:
        tree, arrays = READERS[path.suffix.lower()](data)
        return _result_of(tree, arrays, functions)
    except MbrsError as reason:
        raise type(reason)(f"{path.name}: {reason}") from None
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        MemoryError,
        OSError,
        RecursionError,
        RuntimeError,
        TypeError,
        ValueError,
    ) as reason:
        raise ModelError(f"{path.name} cannot be read: it does not hold what a result needs ({reason})") from None


def _result_of(tree: Any, arrays: list[np.ndarray], functions: bool) -> Result:
    if not isinstance(tree, dict) or "format" not in tree:
        raise ModelError("this is not a result of mbrs")
    if tree["format"] != FORMAT:
        raise ModelError(
            f"the file has the format {tree['format']} (mbrs {tree.get('version')}); this version reads {FORMAT}"
        )
    found = Decoder(arrays, functions).decode(tree["result"])
    if not isinstance(found, Result):
        raise ModelError("this is not a result of mbrs")
    return found


def _unlisted(given: Mapping[str, Any]) -> np.ndarray:
    dtype = _number_type(given["dtype"])
    plain = np.dtype(f"f{dtype.itemsize // 2}") if dtype.kind == "c" else dtype
    flat = np.array([float(x) if isinstance(x, str) else x for x in given["of"]], dtype=plain)
    return flat.view(dtype).reshape(given["shape"])


def _read_json(data: bytes) -> tuple[Any, list[np.ndarray]]:
    start, end = data.find(b'"data": '), data.rfind(b"}\n")
    head = data[:start]
    if start < 0 or end < 0 or not head.startswith(b'{"sha256": "'):
        raise ModelError("this is not a result of mbrs, or was written anew by another program")
    body = data[start + len(b'"data": ') : end]
    _checked(head != f'{{"sha256": "{hashlib.sha256(body).hexdigest()}",\n'.encode() or data[end:] != b"}\n")
    found = json.loads(body)
    return found["mbrs"], [_unlisted(one) for one in found["arrays"]]


def _checked(damaged: bool) -> None:
    if damaged:
        raise ModelError("the file was changed or damaged after it was saved (its checksum differs)")


def _read_netcdf(data: bytes) -> tuple[Any, list[np.ndarray]]:
    import h5py

    whole, trailer = data[:-_TRAILER], data[-_TRAILER:]
    if not trailer.startswith(MARK):
        raise ModelError("this is not a NetCDF file that mbrs saved, or it was cut or changed by another program")
    _checked(trailer != MARK + hashlib.sha256(whole).hexdigest().encode() + b"\n")
    with h5py.File(io.BytesIO(whole), "r") as file:
        group = file["mbrs"]
        tree = json.loads(bytes(group["document"][()]))
        arrays: list[np.ndarray] = []
        while f"a{len(arrays)}" in group:
            stored = group[f"a{len(arrays)}"]
            name, shape = json.loads(stored.attrs["layout"])
            arrays.append(stored[()].view(_number_type(name)).reshape(shape))
    return tree, arrays


READERS: Mapping[str, Callable[[bytes], tuple[Any, list[np.ndarray]]]] = {".nc": _read_netcdf, ".json": _read_json}
for _ending in WRITERS:
    register(Format(_ending, "result", f"{_ending} of mbrs", read_file if _ending in READERS else None, write_file))
