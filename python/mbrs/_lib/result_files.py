"""Files of results, written whole or not at all; `mbrs.io.results` reads them.

A file of mbrs ends in, or holds, the SHA-256 of its bytes, so that damage is found before anything is made of it. NetCDF files
hold the labelled data for every program, and in the group "mbrs" what makes the same object again; the checksum follows
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

from ..errors import ModelError
from .files import write_atomic
from .formats import find
from .jsonable import jsonable
from .records import Encoder
from .version import __version__

# of the layout that `document` writes; a reader refuses newer ones
FORMAT = 3
MARK = b"\nmbrs sha256 "


def save(result: Any, path: str | Path) -> Path:
    """Write a result as its ending says, see `Result.save`."""
    write = find(path, "result", "write").write
    return write(result, Path(path))  # type: ignore[misc]


def write_file(result: Any, path: Path) -> Path:
    """Write a file of one of the formats below, whole or not at all."""
    return write_atomic(path, WRITERS[path.suffix.lower()](result))


def document(result: Any) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The tree that a file holds, and its arrays."""
    encoder = Encoder()
    tree = {"format": FORMAT, "version": __version__, "class": type(result).__name__, "result": encoder.encode(result)}
    return tree, encoder.arrays


def _json(result: Any) -> bytes:
    """Text: the declared quantities to read, then the tree and its arrays as they are."""
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


def _netcdf(result: Any) -> bytes:
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
    return whole + MARK + hashlib.sha256(whole).hexdigest().encode() + b"\n"


def _put(group: Any, name: str, flat: np.ndarray) -> None:
    dimension = f"n{flat.size}"
    if dimension not in group.dimensions:
        group.dimensions[dimension] = flat.size
    group.create_variable(name, (dimension,), data=flat)


def _csv(result: Any) -> bytes:
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
