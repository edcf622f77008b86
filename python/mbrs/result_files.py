"""Files of results: written whole or not at all, read without running anything.

A file of mbrs ends in, or holds, the SHA-256 of its bytes, so that damage is found before anything is made of it. NetCDF files
hold the labelled data for every program, and in the group "mbrs" what makes the same object again; the checksum stands behind
the data, where other programs do not look.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .errors import MbrsError, ModelError
from .files import write_atomic
from .records import Decoder, Encoder
from .results import Result

# of the layout that `document` writes; a reader refuses newer ones
FORMAT = 2
_MARK = b"\nmbrs sha256 "
_TRAILER = len(_MARK) + 64 + 1
# what reading something else than a result can raise
_DAMAGE = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError)


def save(result: Result, path: str | Path) -> Path:
    """Write a result as its ending says, see `Result.save`."""
    path = Path(path)
    return write_atomic(path, writer(path)(result))


def writer(path: str | Path) -> Callable[[Any], bytes]:
    """What makes the bytes of a file with this ending; `ModelError` lists the known ones."""
    ending = Path(path).suffix.lower()
    if ending not in WRITERS:
        raise ModelError(
            f"cannot save {Path(path).name!r}: the ending {ending!r} is not known; known are {', '.join(WRITERS)}"
        )
    return WRITERS[ending]


def load(path: str | Path, *, functions: bool = False) -> Any:
    """A result as it was saved; it prints, draws, continues (``at=``) and has sensitivities as before.

    Parameters
    ----------
    path
        A ``.nc`` or ``.json`` file that ``result.save`` wrote.
    functions
        True imports the Python functions that the model of the result names, which runs their modules. Nothing else in a file
        is ever executed.

    Returns
    -------
    Result
        Of the class that was saved.

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
    path = Path(path)
    ending = path.suffix.lower()
    if ending == ".pkl":
        raise ModelError(f"{path.name}: a pickle can run any program; if you made it yourself, use pickle.load")
    if ending not in READERS:
        raise ModelError(f"cannot load {path.name!r}: results are loaded from {' and '.join(READERS)}")
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise ModelError(f"cannot read {path}: {reason.strerror or reason}") from None
    try:
        tree, arrays = READERS[ending](data)
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


def document(result: Result) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The tree that a file holds, and its arrays."""
    from . import __version__

    encoder = Encoder()
    tree = {"format": FORMAT, "version": __version__, "class": type(result).__name__, "result": encoder.encode(result)}
    return tree, encoder.arrays


def _json(result: Result) -> bytes:
    """Text: the declared quantities to read, then the tree and its arrays as they are."""
    from .jsonable import jsonable

    tree, arrays = document(result)
    quantities = {
        name: {"dims": dims, "unit": unit, "label": label, "value": jsonable(value)}
        for name, (dims, value, unit, label) in result.labelled().items()
    }
    body = {"mbrs": tree, "arrays": [_listed(a) for a in arrays], "quantities": quantities}
    text = json.dumps(body, allow_nan=False)
    checksum = hashlib.sha256(text.encode()).hexdigest()
    return f'{{"sha256": "{checksum}",\n"data": {text}}}\n'.encode()


def _listed(array: np.ndarray) -> dict[str, Any]:
    """An array as JSON, every bit of it: floats as their shortest text, nan and inf as words."""
    flat = np.ravel(array)
    if array.dtype.kind == "c":
        flat = flat.view(flat.real.dtype)
    numbers = flat.tolist()
    if array.dtype.kind in "fc" and not np.all(np.isfinite(flat)):
        numbers = [x if math.isfinite(x) else repr(x) for x in numbers]
    return {"dtype": array.dtype.str, "shape": list(array.shape), "of": numbers}


def _unlisted(given: Mapping[str, Any]) -> np.ndarray:
    dtype = _number_type(given["dtype"])
    plain = np.dtype(f"f{dtype.itemsize // 2}") if dtype.kind == "c" else dtype
    flat = np.array([float(x) if isinstance(x, str) else x for x in given["of"]], dtype=plain)
    return flat.view(dtype).reshape(given["shape"])


def _number_type(text: Any) -> np.dtype[Any]:
    dtype = np.dtype(str(text))
    if dtype.kind not in "biufc":
        raise ModelError(f"an array of the file has the type {text!r}, which is not one of numbers")
    return dtype


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


def _netcdf(result: Result) -> bytes:
    """NetCDF in memory: labelled data, and the tree with its arrays in the group "mbrs"; behind it the checksum."""
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    data = result.to_xarray()
    tree, arrays = document(result)
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        data.dump_to_store(H5NetCDFStore(file))
        group = file.create_group("mbrs")
        _put(group, "document", np.frombuffer(json.dumps(tree, allow_nan=False).encode(), np.uint8))
        for i, array in enumerate(arrays):
            _put(group, f"a{i}", np.ravel(array).view(np.uint8) if array.dtype.kind in "cb" else np.ravel(array))
            group.variables[f"a{i}"].attrs["layout"] = json.dumps([array.dtype.str, list(array.shape)])
    whole = buffer.getvalue()
    return whole + _MARK + hashlib.sha256(whole).hexdigest().encode() + b"\n"


def _put(group: Any, name: str, flat: np.ndarray) -> None:
    dimension = f"n{flat.size}"
    if dimension not in group.dimensions:
        group.dimensions[dimension] = flat.size
    group.create_variable(name, (dimension,), data=flat)


def _read_netcdf(data: bytes) -> tuple[Any, list[np.ndarray]]:
    import h5py

    whole, trailer = data[:-_TRAILER], data[-_TRAILER:]
    if not trailer.startswith(_MARK):
        raise ModelError("this is not a NetCDF file that mbrs saved, or it was cut or changed by another program")
    _checked(trailer != _MARK + hashlib.sha256(whole).hexdigest().encode() + b"\n")
    with h5py.File(io.BytesIO(whole), "r") as file:
        group = file["mbrs"]
        tree = json.loads(bytes(group["document"][()]))
        arrays: list[np.ndarray] = []
        while f"a{len(arrays)}" in group:
            stored = group[f"a{len(arrays)}"]
            name, shape = json.loads(stored.attrs["layout"])
            arrays.append(stored[()].view(_number_type(name)).reshape(shape))
    return tree, arrays


def _csv(result: Result) -> bytes:
    """The table of `Result.columns`: a heading with units, numbers to the last bit."""
    columns = result.columns()
    if not columns:
        raise ModelError(f"{type(result).__name__} has no table of numbers; save it as .nc or .json")
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(columns)
    lines.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return text.getvalue().encode()


WRITERS: Mapping[str, Callable[[Any], bytes]] = {".nc": _netcdf, ".json": _json, ".csv": _csv, ".pkl": pickle.dumps}
READERS: Mapping[str, Callable[[bytes], tuple[Any, list[np.ndarray]]]] = {".nc": _read_netcdf, ".json": _read_json}
