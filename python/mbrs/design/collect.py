"""From chunks to arrays: the same bits whatever the chunks were and in whichever order they came."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .chunk import DONE, FAILED, Chunk, Column, Failure
from .runs import WAITING, Runs
from .table import Designs, table


def collected(
    designs: Designs, chunks: Sequence[Chunk], outputs: Any, status: str, rows: Sequence[int] | None, session: Any
) -> Runs:
    """The runs of all designs, or of some ``rows`` in their order."""
    n = len(designs)
    codes, seconds = np.full(n, WAITING, np.int8), np.full(n, np.nan)
    failures: dict[int, Failure] = {}
    wanted = None if rows is None else np.unique(rows)
    ordered = sorted(chunks, key=lambda chunk: chunk.first)
    if wanted is not None:
        ordered = [part for chunk in ordered for part in _part(chunk, wanted)]
    for chunk in ordered:
        codes[chunk.first : chunk.end], seconds[chunk.first : chunk.end] = chunk.status, chunk.seconds
        failures |= {failure.design: failure for failure in chunk.failures}
    found: dict[str, list[tuple[int, Column]]] = {}
    for chunk in ordered:
        for key, column in chunk.columns.items():
            found.setdefault(key.partition(":")[2], []).append((chunk.first, column))
    arrays = {}
    for name in sorted(found):
        count = n if wanted is None else len(wanted)
        arrays[name], wrong = _array(name, n, count, found[name])
        for failure in wrong:
            failures[failure.design], codes[failure.design] = failure, FAILED
    if rows is not None:
        take = np.asarray(rows, dtype=int)
        designs = table(designs.names, designs.values[take], designs.units, designs.source)
        arrays = {name: array[take] for name, array in arrays.items()}
        codes, seconds = codes[take], seconds[take]
        failures = {
            j: Failure(j, f.error, f.object, f.message) for j, i in enumerate(take.tolist()) if (f := failures.get(i))
        }
    arrays = {name: _without(array, codes) for name, array in arrays.items()}
    for array in arrays.values():
        array.setflags(write=False)  # the session looks at them as well
    return _runs(designs, arrays, codes, seconds, failures, outputs, status, session)


def _runs(
    designs: Designs,
    arrays: Mapping[str, np.ndarray],
    codes: np.ndarray,
    seconds: np.ndarray,
    failures: Mapping[int, Failure],
    outputs: Any,
    status: str,
    session: Any,
) -> Runs:
    from ..results import Stats

    layout = getattr(outputs, "layout", {})
    dims, units = {}, {}
    for name, array in arrays.items():
        known = layout.get(name, ((), ""))
        fits = len(known[0]) == array.ndim - 1
        dims[name] = known[0] if fits else tuple(f"{name}_{j}" for j in range(array.ndim - 1))
        units[name] = known[1] if fits else ""
    sizes = {d: m for name, array in arrays.items() for d, m in zip(dims[name], array.shape[1:], strict=True)}
    labels = {} if session is None or not layout else outputs.labels(session.model)
    labels = {d: tuple(values) for d, values in labels.items() if sizes.get(d) == len(values)}
    counts = {"designs": int(np.sum(codes != WAITING)), "failed": len(failures)}
    listed = tuple(failures[i] for i in sorted(failures))
    return Runs(
        designs, dict(arrays), dims, units, labels, codes, seconds, listed, session,
        stats=Stats(float(np.nansum(seconds)), counts, (), "sweep"), status=status,
    )  # fmt: skip


def _part(chunk: Chunk, wanted: np.ndarray) -> list[Chunk]:
    """The chunk with outputs of some designs only; nothing where it has none of them."""
    inside = wanted[(wanted >= chunk.first) & (wanted < chunk.end)] - chunk.first
    if not len(inside):
        return []
    columns = {}
    for name, column in chunk.columns.items():
        keep = np.isin(column.rows, inside)
        if keep.any():
            columns[name] = Column(column.rows[keep], column.shapes[keep], column.flat[np.repeat(keep, column.sizes())])
    return [replace(chunk, columns=columns)]


def _array(name: str, n: int, count: int, columns: Sequence[tuple[int, Column]]) -> tuple[np.ndarray, list[Failure]]:
    """One output of all designs (n, ...), smaller arrays filled with nan, and the designs whose array has other dimensions than
    that of the first. Whole numbers stay so where all ``count`` designs have them.
    """
    earliest = min(columns, key=lambda one: one[0] + one[1].rows[0])[1]
    ndim = _dimensions(earliest.shapes[:1])[0]
    most = np.zeros(ndim, dtype=np.int64)
    wrong: list[Failure] = []
    filled = 0
    for first, column in columns:
        found = _dimensions(column.shapes)
        good = found == ndim
        if good.any() and ndim:
            most = np.maximum(most, column.shapes[good, :ndim].max(axis=0))
        filled += int(good.sum())
        text = f"the output {name!r} has {{}} dimensions here and {ndim} in the first design"
        wrong += [
            Failure(first + int(column.rows[i]), "ShapeError", name, text.format(found[i]))
            for i in np.flatnonzero(~good)
        ]
    kind = np.result_type(*(column.flat.dtype for _, column in columns))
    same = filled == count and all(np.all(column.shapes == most) for _, column in columns if ndim)
    if not same and kind.kind in "bi":
        kind = np.dtype(float)
    full = np.empty((n, *most), dtype=kind)
    known = np.zeros(n, dtype=bool)
    for first, column in columns:
        known[first + column.rows] = _fill(full, first, column, ndim)
    full[~known] = np.nan if kind.kind in "fc" else 0
    return full, wrong


def _dimensions(shapes: np.ndarray) -> np.ndarray:
    """Number of dimensions in each row of shapes, whose unused entries are -1."""
    return np.sum(shapes >= 0, axis=1)


def _fill(full: np.ndarray, first: int, column: Column, ndim: int) -> np.ndarray:
    """Put the rows of a column into the whole array; (rows,) bool tells of which there is something."""
    rows = first + column.rows
    if np.all(column.shapes == full.shape[1:]) and column.shapes.shape[1] == ndim:
        full[rows] = column.flat.reshape(len(rows), *full.shape[1:])
        _share(full, rows, column)
        return np.ones(len(rows), dtype=bool)
    sizes = column.sizes()
    ends = np.cumsum(sizes)
    fits = _dimensions(column.shapes) == ndim
    full[rows[fits]] = np.nan if full.dtype.kind in "fc" else 0
    for i in np.flatnonzero(fits).tolist():
        shape = column.shapes[i][column.shapes[i] >= 0]
        place: Any = (int(rows[i]), *(slice(0, int(m)) for m in shape))
        full[place] = column.flat[ends[i] - sizes[i] : ends[i]].reshape(shape)
    return fits


def _share(full: np.ndarray, rows: np.ndarray, column: Column) -> None:
    """Let a column look at its rows of the whole array, so that results of many designs are in memory once."""
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1 and full.dtype == column.flat.dtype:
        column.flat = full[rows[0] : rows[-1] + 1].reshape(-1)
        column.shapes = np.broadcast_to(column.shapes[0], column.shapes.shape)


def _without(array: np.ndarray, codes: np.ndarray) -> np.ndarray:
    """No outputs of designs that count as failed."""
    bad = codes != DONE
    if not bad.any():
        return array
    if array.dtype.kind in "bi":
        array = array.astype(float)
    array[bad] = np.nan
    return array
