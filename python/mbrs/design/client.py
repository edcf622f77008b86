"""The client of a sweep: hands out chunks, keeps what comes back, finds designs that end their process, stops at Ctrl-C."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import DesignError, ModelError, RouteError
from . import isolation
from .chunk import DONE, Chunk, Scene, Task
from .pools import Pool, Restarted, WorkerLost

# Seconds that a chunk should take: longer, and a client that is killed loses more; shorter, and files and messages cost more than
# a percent (tests/design/test_sweep.py, on sizes of chunks).
CHUNK_SECONDS = 10.0
# Designs of the first chunks, which tell how long one takes.
PILOT = 4
# Designs of a chunk at most, whose rows and outputs are in memory twice.
LARGEST_CHUNK = 100_000
# Seconds that chunks of other processes have to come back after Ctrl-C.
_HAND_OVER = 1.0
# Seconds between two looks at processes with a limit.
_LOOK = 0.2

Range = tuple[int, int]


class Sizes:
    """Number of designs in a chunk: ``fixed``, or as many as take `CHUNK_SECONDS`, judged by those that are done."""

    def __init__(self, workers: int, fixed: int | None = None) -> None:
        self._workers, self._fixed = workers, fixed
        self._seconds, self._designs = 0.0, 0

    def learn(self, chunk: Chunk) -> None:
        self._seconds += float(chunk.seconds.sum())
        self._designs += len(chunk)

    def size(self, left: int) -> int:
        """Designs of the next chunk, of ``left`` that are not handed out: every worker gets a share."""
        if self._fixed is not None:
            return self._fixed
        if not self._designs:
            return PILOT
        one = self._seconds / self._designs
        most = LARGEST_CHUNK if one <= 0.0 else min(LARGEST_CHUNK, math.floor(CHUNK_SECONDS / one))
        share = left if self._workers == 1 else math.ceil(left / (2 * self._workers))
        return max(1, min(most, share))


@dataclass
class Keeper:
    """Actions for chunks: ``keep`` holds them in memory and, with a store, in its folder; ``begin`` and ``end`` mark designs
    that this process computes itself.
    """

    keep: Callable[[Chunk], None]
    begin: Callable[[int, int], None]
    end: Callable[[int, int], None]


class Client:
    """Computes ranges of rows in a pool."""

    def __init__(
        self, scene: Scene, names: tuple[str, ...], rows: np.ndarray, pool: Pool, keeper: Keeper, options: Any
    ) -> None:
        self._scene, self._names, self._rows, self._pool = scene, names, rows, pool
        self._keeper, self._options = keeper, options
        self._sizes = Sizes(pool.workers, options.chunk)
        self._waiting: deque[Range] = deque()
        self._suspects: list[Range] = []
        self._flight: dict[Any, Range] = {}
        self._since: dict[Any, float] = {}
        self._begun: set[Range] = set()

    def compute(self, ranges: Iterable[Range], suspects: Iterable[Range]) -> None:
        """All designs of some ``(first, end)``; those of ``suspects`` in a child process, since they may have ended one."""
        self._waiting.extend(ranges)
        self._suspects.extend(suspects)
        try:
            while self._waiting or self._flight or self._suspects:
                if not self._flight:
                    self._examine()
                self._hand_out()
                if self._flight:
                    for future in self._finished():
                        self._take(future)
        except BaseException:
            self._pool.stop()
            self._drain()
            raise

    def _examine(self) -> None:
        self._pool.revive()
        while self._suspects:
            first, end = self._suspects[0]
            for chunk in isolation.examine(self._task(first, end), self._pool.context):
                self._kept(chunk)
                if chunk.stopped:
                    raise KeyboardInterrupt
            self._suspects.pop(0)

    def _hand_out(self) -> None:
        # one more than there are workers, so that none waits for the client
        room = self._pool.workers + (0 if self._pool.here else 1)
        while self._waiting and not self._suspects and len(self._flight) < room:
            first, end = self._waiting.popleft()
            left = end - first + sum(b - a for a, b in self._waiting)
            stop = min(end, first + self._sizes.size(left))
            if stop < end:
                self._waiting.appendleft((stop, end))
            if self._pool.here:
                self._begin(first, stop)
            try:
                self._flight[self._pool.submit(self._task(first, stop))] = (first, stop)
            except WorkerLost:
                self._waiting.appendleft((first, stop))
                return

    def _begin(self, first: int, end: int) -> None:
        self._begun.add((first, end))
        self._keeper.begin(first, end - first)

    def _end(self, first: int, end: int) -> None:
        self._keeper.end(first, end - first)
        self._begun.discard((first, end))

    def _finished(self) -> list[Any]:
        """Tasks that are done. Processes that a design keeps beyond its limit, deaf to the timer that should cut it, are ended."""
        limit = self._options.time_limit
        if limit is None or not self._pool.ends_workers:
            return self._pool.finished(self._flight)
        done = self._pool.finished(self._flight, _LOOK)
        now = time.monotonic()
        for future, (first, end) in self._flight.items():
            # a pool takes one task more than it computes, which may wait for as long as another one
            last = self._since.setdefault(future, now) + isolation.GRACE + 2.0 * limit * (end - first)
            if future.running() and now > last:
                self._pool.end_workers()
                break
        return done

    def _task(self, first: int, end: int) -> Task:
        return Task(self._scene, self._names, first, self._rows[first:end], self._options.time_limit)

    def _take(self, future: Any) -> None:
        first, end = self._flight.pop(future)
        self._since.pop(future, None)
        try:
            chunk = self._pool.chunk(future)
        except WorkerLost:
            self._suspects.append((first, end))
            return
        except Restarted:
            self._waiting.appendleft((first, end))
            return
        except RouteError:  # of the cluster itself: a worker hands over what a design raises as a failure
            raise
        except Exception as reason:
            raise ModelError(f"the workers cannot compute the outputs: {reason}") from reason
        self._sizes.learn(chunk)
        if len(chunk):
            self._kept(chunk)
        if self._pool.here:
            self._end(first, end)
        if chunk.end < end:
            self._waiting.appendleft((chunk.end, end))
            if chunk.stopped and self._pool.here:
                raise KeyboardInterrupt

    def _kept(self, chunk: Chunk) -> None:
        self._keeper.keep(chunk)
        if self._options.on_error == "raise" and np.any(chunk.status != DONE):
            failure = chunk.failures[0]
            raise DesignError(f"design {failure.design}: {failure.error}: {failure.message}", failure.design)

    def _drain(self) -> None:
        """Keep what is finished, and what threads hand over when they are told to stop; the rest is computed another time."""
        for future in list(self._flight):
            if future.cancel():
                self._flight.pop(future)
        deadline = time.monotonic() + _HAND_OVER
        while self._flight and (self._pool.here or time.monotonic() < deadline):
            ready = [future for future in self._flight if future.done()]
            for future in ready:
                self._flight.pop(future)
                try:
                    chunk = self._pool.chunk(future)
                except Exception:  # what was lost is computed another time
                    continue
                if len(chunk):
                    self._keeper.keep(chunk)
            if not ready:
                time.sleep(0.01)
        # also of what was between its mark and its task, or between its task and its results, when the signal came
        for first, end in list(self._begun):
            self._end(first, end)
