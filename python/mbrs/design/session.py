"""State of one sweep: rows, chunks, the folder. `mb.sweep` and the methods of `Runs` go through it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.progress import Progress
from ..errors import DesignError, Interrupted, MbrsError, ModelError, StoreError
from . import pools
from .chunk import DONE, Chunk
from .client import Client, Keeper, Range
from .collect import Whole, collected
from .sources import describe, model_functions
from .store import Store, identity
from .table import Designs, fingerprint, table


@dataclass(frozen=True)
class Options:
    """Settings for the computation of a sweep; none of them changes its numbers."""

    executor: Any = None
    chunk: int | None = None
    time_limit: float | None = None
    on_error: str = "record"
    progress: bool | None = None


class Session:
    """A sweep that can go on: the designs of its table first, others that were told behind them."""

    def __init__(
        self,
        model: Any,
        designs: Designs,
        outputs: Callable[[Any], Mapping[str, Any]],
        folder: str | Path | None,
        options: Options,
    ) -> None:
        self.model, self.designs, self.outputs, self.options = model.copy(), designs, outputs, options
        self.rows = designs.values
        self.chunks: list[Chunk] = []
        self._whole = Whole(len(designs))
        self.asked: set[int] = set()
        self._places: dict[bytes, int] = {}
        self._indexed = 0
        self._lock = threading.RLock()
        self._store = None if folder is None else Store(folder, self._identity(), designs.values)

    def _identity(self) -> dict[str, Any]:
        from ..model.toml import dumps

        # the values that every design sets anew do not belong to it
        neutral = self.model.copy()
        for i in range(min(1, len(self.designs))):
            try:
                neutral.set(self.designs.point(i))
            except MbrsError:
                break
        try:
            text = dumps(neutral)
        except ModelError as reason:
            raise ModelError(f"a sweep with store= keeps its model as text, and {reason}") from None
        return identity(text + model_functions(text), describe(self.outputs), self.designs)

    @contextmanager
    def opened(self) -> Iterator[Store | None]:
        """The folder, locked, with what others have put into it since."""
        with self._lock:
            if self._store is None:
                yield None
                return
            with self._store.opened() as store:
                known = {(chunk.first, len(chunk)) for chunk in self.chunks}
                for first, n in store.ranges():
                    chunk = None if (first, n) in known else store.read(first, n)
                    if chunk is not None:
                        self._add(chunk)
                yield store

    def _add(self, chunk: Chunk) -> None:
        if chunk.first > len(self.rows):
            raise StoreError(f"the folder of the sweep lacks designs before number {chunk.first}; take another folder")
        # a chunk of told designs brings its rows along
        beyond = max(len(self.rows) - chunk.first, 0)
        if chunk.end > len(self.rows):
            self.rows = np.concatenate([self.rows, chunk.values[beyond:]])
        if fingerprint(self.rows[chunk.first : chunk.end]) != fingerprint(chunk.values):
            raise StoreError(
                f"the designs {chunk.first} to {chunk.end - 1} of the folder are others than those of the sweep"
            )
        self._whole.take(chunk)
        self.chunks.append(chunk)

    def missing(self) -> list[Range]:
        """Ranges ``(first, end)`` of designs without a result."""
        have = np.zeros(len(self.rows) + 1, dtype=bool)
        for chunk in self.chunks:
            have[chunk.first : chunk.end] = True
        edges = np.flatnonzero(np.diff(np.concatenate([[True], have[:-1], [True]]).astype(np.int8)))
        return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]

    def run(self, n: int | None = None) -> Any:
        """Compute what is missing, or the first ``n`` designs of that, and return all that is known.

        Raises
        ------
        Interrupted, DesignError, StoreError
            With the runs so far.
        """
        with self.opened() as store:
            try:
                self._compute(store, _first(self.missing(), n))
                return self.runs()
            except KeyboardInterrupt:
                done = sum(len(chunk) for chunk in self.chunks)
                text = f"the sweep was interrupted after {done} of {len(self.rows)} designs"
                raise Interrupted(text, self.runs("interrupted")) from None
            except (DesignError, StoreError) as reason:
                reason.result = self.runs("stopped")
                raise

    def _compute(self, store: Store | None, missing: Sequence[Range]) -> None:
        if not missing:
            return
        suspects = [] if store is None else [r for a, n in store.begun() for r in _common(missing, (a, a + n))]
        rest = [r for a, b in missing for r in _without((a, b), suspects)]
        pool = pools.pool(self.options.executor)
        total = sum(b - a for a, b in missing)
        try:
            with Progress("designs", total, always=self.options.progress) as progress:
                shown = _Shown(progress, pool)

                def keep(chunk: Chunk) -> None:
                    self.chunks.append(chunk)
                    self._whole.take(chunk)  # which frees its own arrays
                    if store is not None:
                        store.write(chunk)
                    shown.keep(chunk)

                keeper = Keeper(
                    keep, _nothing if store is None else store.begin, _nothing if store is None else store.end
                )
                scene = pool.scene(self.model, self.outputs)
                pool.prepare(scene, self.designs.names)
                client = Client(scene, self.designs.names, self.rows, pool, keeper, self.options)
                client.compute(rest, suspects)
        finally:
            pool.close()
        if store is not None:
            for first, n in store.begun():
                store.end(first, n)

    def find(self, values: np.ndarray) -> list[int]:
        """Index of each row among the designs, -1 where it is new; rows are equal when all their bits are."""
        for i in range(self._indexed, len(self.rows)):
            self._places.setdefault(self.rows[i].tobytes(), i)
        self._indexed = len(self.rows)
        return [self._places.get(row.tobytes(), -1) for row in values]

    def append(self, values: np.ndarray) -> None:
        """More designs behind those that are there."""
        self.rows = np.concatenate([self.rows, values])

    def evaluate(self, values: np.ndarray) -> list[int]:
        """Compute rows that have no result yet, and return the index of each."""
        with self.opened() as store:
            places = self.find(values)
            new = list(dict.fromkeys(values[i].tobytes() for i, place in enumerate(places) if place < 0))
            if new:
                self.append(np.frombuffer(b"".join(new)).reshape(len(new), -1))
                places = self.find(values)
            wanted = sorted(set(places))
            missing = [r for i in wanted for r in _common(self.missing(), (i, i + 1))]
            self._compute(store, _merged(missing))
        return places

    def record(self, values: np.ndarray, chunks: Sequence[Chunk]) -> None:
        """Keep the results of rows that were computed elsewhere, one chunk of one design for each."""
        with self.opened() as store:
            for row, chunk in zip(values, chunks, strict=True):
                place = self.find(row[None])[0]
                if place < 0:
                    place = len(self.rows)
                    self.append(row[None])
                elif not any(a <= place < b for a, b in self.missing()):
                    raise ModelError(f"design {place} has a result already")
                failures = [replace(failure, design=place) for failure in chunk.failures]
                placed = replace(chunk, first=place, values=row[None], failures=failures)
                self.chunks.append(placed)
                if store is not None:
                    store.write(placed)

    def runs(self, status: str = "computed", rows: Sequence[int] | None = None) -> Any:
        """All that is known, or the results of some rows."""
        designs = table(self.designs.names, self.rows, self.designs.units, self.designs.source, self.designs.about)
        return collected(designs, self.chunks, self.outputs, status, rows, self)


class _Shown:
    """Progress of a sweep: designs, rate, failures. Threads report each design, other pools each chunk."""

    def __init__(self, progress: Progress, pool: pools.Pool) -> None:
        self._progress, self._here, self._failed, self._lock = progress, pool.here, 0, threading.Lock()
        self._told = 0
        pool.tick = self.tick  # type: ignore[method-assign]

    def tick(self, n: int) -> None:
        with self._lock:
            self._told += n
            self._progress.advance(n, self._note())

    def keep(self, chunk: Chunk) -> None:
        with self._lock:
            self._failed += int(np.sum(chunk.status != DONE))
            already = min(self._told, len(chunk))
            self._told -= already
            self._progress.advance(len(chunk) - already, self._note())

    def _note(self) -> str:
        rate = self._progress.rate
        return f"{rate:.3g}/s" + (f", {self._failed} failed" if self._failed else "")


def _first(ranges: Sequence[Range], n: int | None) -> list[Range]:
    """The first ``n`` designs of some ranges."""
    if n is None:
        return list(ranges)
    found = []
    for a, b in ranges:
        found.append((a, min(b, a + n)))
        n -= found[-1][1] - a
    return [(a, b) for a, b in found if a < b]


def _nothing(first: int, n: int) -> None:
    pass


def _common(ranges: Sequence[Range], other: Range) -> list[Range]:
    found = ((max(a, other[0]), min(b, other[1])) for a, b in ranges)
    return [(a, b) for a, b in found if a < b]


def _without(whole: Range, holes: Sequence[Range]) -> list[Range]:
    first, found = whole[0], []
    for a, b in sorted(holes):
        if b > first and a < whole[1]:
            if a > first:
                found.append((first, a))
            first = max(first, b)
    return found + ([(first, whole[1])] if first < whole[1] else [])


def _merged(ranges: Sequence[Range]) -> list[Range]:
    found: list[Range] = []
    for a, b in sorted(ranges):
        if found and found[-1][1] == a:
            found[-1] = (found[-1][0], b)
        else:
            found.append((a, b))
    return found
