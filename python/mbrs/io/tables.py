"""Tables and labelled arrays for other programs: Parquet (by pyarrow) and Zarr (by xarray), which are only written.

https://parquet.apache.org/docs/file-format/ and https://zarr-specs.readthedocs.io
"""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._lib.files import write_atomic
from .._lib.formats import Format, register
from ..errors import ModelError

if TYPE_CHECKING:
    from ..results import Result


def write_parquet(thing: Result, path: Path) -> Path:
    """Write the table of `Result.to_frame`: columns with units in their headings, attributes as metadata of the file.

    Raises
    ------
    ModelError
        pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise _missing("Parquet", "pyarrow") from None
    # bytes with their metadata: pandas reads columns, others also what they are of
    about = {f"mbrs {name}": str(value) for name, value in thing.attributes().items()}
    made = pyarrow.table({name: pyarrow.array(column) for name, column in thing.columns().items()})
    buffer = io.BytesIO()
    parquet.write_table(made.replace_schema_metadata(about), buffer)
    return write_atomic(path, buffer.getvalue())


def write_zarr(thing: Result, path: Path) -> Path:
    """Write the labelled data of `Result.to_xarray` as a folder; an old folder of that name stays until the new one is complete.

    Raises
    ------
    ModelError
        xarray or zarr is not installed, or the name belongs to something that is not a Zarr folder.
    """
    try:
        import xarray
        import zarr  # noqa: F401 - xarray needs it
    except ImportError:
        raise _missing("Zarr", "xarray and zarr") from None
    path = Path(path)
    if path.exists() and not (path / "zarr.json").is_file() and not (path / ".zgroup").is_file():
        raise ModelError(f"{path} is there and is not a Zarr folder; choose another name")
    data: Any = thing.to_xarray()
    # texts of one width have no place in the specification, texts of any width do
    texts = {name: values.astype(object) for name, values in data.variables.items() if values.dtype.kind == "U"}
    data = data.assign({n: v for n, v in texts.items() if n in data.data_vars}).assign_coords(
        {n: v for n, v in texts.items() if n in data.coords}
    )
    assert isinstance(data, xarray.Dataset)
    with tempfile.TemporaryDirectory(dir=path.absolute().parent, prefix=f".{path.name}.") as folder:
        made, old = Path(folder) / "new", Path(folder) / "old"
        data.to_zarr(made, mode="w", consolidated=False)
        if path.exists():
            os.replace(path, old)
        os.replace(made, path)
        shutil.rmtree(old, ignore_errors=True)
    return path


def _missing(what: str, library: str) -> ModelError:
    return ModelError(f"{what} needs {library}, which is not installed: pip install 'mbrs-dynamics[tables]'")


register(Format(".parquet", "result", "Parquet", None, write_parquet))
register(Format(".zarr", "result", "Zarr", None, write_zarr))
