"""Places where chunks are computed: here, in threads, in any executor of `concurrent.futures`, on the workers of a Dask client."""

from __future__ import annotations

import contextlib
import hashlib
import math
import multiprocessing
import os
import pickle
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from .._lib.checks import count, shown
from ..errors import ModelError, RouteError
from .chunk import Chunk, KeptScene, LocalScene, PackedScene, Scene, Task, run
from .isolation import leave_with

_MOST_THREADS = 1024
# Seconds between two looks at the workers of a cluster, and seconds without any after which a sweep gives up. Too small: workers that a
# queue starts late are not waited for. Too large: a sweep seems to hang. Pinned by tests/design/test_sweep_dask.py.
_ASK = 5.0
_ALONE = 300.0


class WorkerLost(Exception):
    """The worker of a chunk died, and one of its designs may be the reason."""


class Pool:
    """Takes tasks and gives chunks back. ``here``: designs run in this process, which one of them may end."""

    here = False
    workers = 1
    # of the core, for a chunk that it computes by itself
    threads = 1
    context: Any = None

    def tick(self, n: int) -> None:
        """Called after ``n`` more designs were computed in this process; a sweep puts its progress here."""

    def prepare(self, scene: Scene, names: tuple[str, ...]) -> None:
        """Know the scene before any task of it."""

    def scene(self, model: Any, outputs: Callable[..., Any]) -> Scene:
        """Data that the workers need: the model and the function of outputs."""
        return PackedScene(pickle.dumps(model), self.dumps(outputs))

    def dumps(self, function: Any) -> bytes:
        """A function as bytes that a worker reads."""
        try:
            return pickle.dumps(function)
        except Exception as reason:
            name = getattr(function, "__qualname__", function)
            raise ModelError(
                f"outputs= cannot go to another process ({reason}); define {name!r} at the top of a module"
            ) from None

    def submit(self, task: Task) -> Any:
        raise NotImplementedError

    def finished(self, futures: Iterable[Any], timeout: float | None = None) -> list[Any]:
        """Futures that are done; waits until one is, for at most ``timeout`` seconds."""
        return list(wait(list(futures), timeout, FIRST_COMPLETED)[0])

    @property
    def ends_workers(self) -> bool:
        """True where `end_workers` can kill the workers."""
        return False

    def end_workers(self) -> None:
        """Kill the workers; their tasks are lost."""

    def chunk(self, future: Any) -> Chunk:
        """Chunk computed by a task; raises `WorkerLost` where its worker died."""
        return future.result()

    def revive(self) -> None:
        """Make the pool take tasks again after workers were lost."""

    def stop(self) -> None:
        """Let running chunks end early and take no more."""

    def close(self) -> None:
        """Give back what the pool made itself."""


class Here(Pool):
    """One chunk after the other, in this thread."""

    here = True

    def scene(self, model: Any, outputs: Callable[..., Any]) -> Scene:
        return local_scene(model, outputs)

    def submit(self, task: Task) -> Future[Chunk]:
        future: Future[Chunk] = Future()
        future.set_result(run(task, tick=self.tick))
        return future


class Threads(Here):
    """Threads of this process: so many of its own, each with one BLAS thread, or those of the user."""

    def __init__(self, executor: int | Executor) -> None:
        self._stop = threading.Event()
        self._own = isinstance(executor, int)
        self._limits = one_blas_thread() if self._own else contextlib.nullcontext()
        self._limits.__enter__()
        self._executor = ThreadPoolExecutor(executor, "mbrs-sweep") if isinstance(executor, int) else executor
        self.workers = int(getattr(self._executor, "_max_workers", 1))

    def prepare(self, scene: Scene, names: tuple[str, ...]) -> None:
        """Give all threads to one chunk at a time if the core computes whole chunks."""
        fast = scene.fast(names) if self._own else None
        if fast is not None and fast.decides:
            self.workers, self.threads = 1, self.workers

    def submit(self, task: Task) -> Future[Chunk]:
        return self._executor.submit(run, replace(task, threads=self.threads), self._stop.is_set, self.tick)

    def stop(self) -> None:
        self._stop.set()

    def close(self) -> None:
        if self._own:
            self._executor.shutdown(wait=True, cancel_futures=True)
        self._limits.__exit__(None, None, None)


class Futures(Pool):
    """An executor of the user, which stays his own; one whose processes a design has ended is replaced by one like it."""

    def __init__(self, executor: Executor) -> None:
        self._executor, self._own = executor, False
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self.workers = int(getattr(executor, "_max_workers", None) or os.cpu_count() or 1)
        self.context = getattr(executor, "_mp_context", None)

    def scene(self, model: Any, outputs: Callable[..., Any]) -> Scene:
        """In a file if all workers are processes of this machine, so that each of them takes it once."""
        packed = super().scene(model, outputs)
        if not isinstance(packed, PackedScene) or not isinstance(self._executor, ProcessPoolExecutor):
            return packed
        self._folder = tempfile.TemporaryDirectory(prefix="mbrs-sweep-")
        return KeptScene.of(packed, self._folder.name)

    def submit(self, task: Task) -> Future[Chunk]:
        work = work_for if isinstance(self._executor, ProcessPoolExecutor) else run
        try:
            return self._executor.submit(work, task)
        except BrokenExecutor as reason:
            raise WorkerLost(str(reason)) from None

    def chunk(self, future: Future[Chunk]) -> Chunk:
        try:
            return future.result()
        except (BrokenExecutor, CancelledError) as reason:
            raise WorkerLost(str(reason)) from None

    @property
    def ends_workers(self) -> bool:
        return isinstance(self._executor, ProcessPoolExecutor)

    def end_workers(self) -> None:
        for process in list((getattr(self._executor, "_processes", None) or {}).values()):
            process.kill()

    def revive(self) -> None:
        if getattr(self._executor, "_broken", False):
            self._shut_down()
            self._executor, self._own = ProcessPoolExecutor(self.workers, mp_context=self.context), True

    def _shut_down(self) -> None:
        if self._own:
            self._executor.shutdown(wait=True, cancel_futures=True)

    def close(self) -> None:
        self._shut_down()
        if self._folder is not None:
            self._folder.cleanup()


def work_for(task: Task) -> Chunk:
    """`run` in a process of a pool, which ends with the process that made it."""
    _leave_with_parent()
    return run(task)


@lru_cache(maxsize=1)
def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None and parent.pid is not None:
        leave_with(parent.pid)


class Cluster(Pool):
    """The workers of a `dask.distributed.Client`."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self.workers = max(1, sum(client.nthreads().values()))
        self._kept: Any = None
        self._token, self._times = uuid.uuid4().hex[:8], 0

    def dumps(self, function: Any) -> bytes:
        """Functions of a script go by value: the workers have not run it."""
        import cloudpickle

        return cloudpickle.dumps(function)

    def submit(self, task: Task) -> Any:
        rows = (list(task.names), task.first, task.values, task.limit)
        return self._client.submit(_run_with, self._shared(task.scene), *rows, pure=False)

    def _shared(self, scene: Scene) -> Any:
        """The scene as a task of its own by its hash: a worker takes its result once, and Dask makes it anew where it was lost."""
        if self._kept is None or self._kept.status not in ("pending", "finished"):
            self._kept, self._times = None, self._times + 1
            key = f"mbrs-scene-{hashlib.sha256(pickle.dumps(scene)).hexdigest()}-{self._token}-{self._times}"
            self._kept = self._client.submit(_same, scene, key=key)
        return self._kept

    def finished(self, futures: Iterable[Any], timeout: float | None = None) -> list[Any]:
        from distributed import wait as wait_for

        listed, last = list(futures), time.monotonic()
        end = math.inf if timeout is None else last + timeout
        while True:
            now = time.monotonic()
            with contextlib.suppress(CancelledError, TimeoutError):
                wait_for(listed, timeout=max(0.0, min(_ASK, end - now)), return_when="FIRST_COMPLETED")
            done = [future for future in listed if future.done()]
            if done or time.monotonic() >= end:
                return done
            if self._client.nthreads():
                last = time.monotonic()
            elif time.monotonic() - last > _ALONE:
                raise RouteError(
                    f"the cluster of Dask has had no worker for {_ALONE:.0f} s; start workers and repeat the call, which goes on with what "
                    "its store= holds"
                )

    def chunk(self, future: Any) -> Chunk:
        from distributed import KilledWorker

        patience = _ASK
        while True:
            try:
                return future.result(patience)
            except KilledWorker as reason:
                raise WorkerLost(str(reason)) from None
            except CancelledError:
                raise Restarted from None
            except TimeoutError:  # it is large, or was lost with its worker, so that Dask computes it anew
                self.finished([future])
                patience *= 2


def _same(scene: Scene) -> Scene:
    return scene


def _run_with(scene: Scene, names: list[str], first: int, values: np.ndarray, limit: float | None) -> Chunk:
    return run(Task(scene, tuple(names), first, values, limit))


class HasSubmit(Protocol):
    """A client of a cluster, such as `dask.distributed.Client`."""

    def submit(self, func: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        """Begin a call, and return its future."""


class Restarted(Exception):
    """The workers were restarted and forgot a task that did nothing wrong."""


def pool(executor: Any) -> Pool:
    """The pool of ``executor=``."""
    if executor is None:
        return Here()
    if isinstance(executor, int) and not isinstance(executor, bool):
        return Threads(count("executor", executor, _MOST_THREADS))
    if isinstance(executor, ThreadPoolExecutor):
        return Threads(executor)
    if isinstance(executor, Executor):
        return Futures(executor)
    if type(executor).__module__.partition(".")[0] == "distributed" and hasattr(executor, "submit"):
        return Cluster(executor)
    raise ModelError(
        "executor= must be None, a number of threads, an executor of concurrent.futures or a dask.distributed.Client, it is "
        + shown(executor)
    )


def local_scene(model: Any, outputs: Callable[..., Any]) -> Scene:
    """A fresh model for every design from bytes, or as a copy where its functions cannot be named."""
    try:
        data = pickle.dumps(model)
        pickle.loads(data)
    except Exception:  # whatever a user's function raises when it is pickled
        return LocalScene(model.copy().copy, outputs)
    return LocalScene(_Reader(data), outputs)


class _Reader:
    """Makes a model of its bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def __call__(self) -> Any:
        return pickle.loads(self._data)


def one_blas_thread() -> Any:
    """A context in which BLAS uses one thread (needs ``threadpoolctl`` of the extra ``sweep``; else nothing changes)."""
    try:
        import threadpoolctl
    except ImportError:
        return contextlib.nullcontext()
    return threadpoolctl.threadpool_limits(limits=1, user_api="blas")
