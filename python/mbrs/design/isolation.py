"""Designs in a child process: what ends it is found by halving, and the sweep lives on."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

from .chunk import KILLED, TIMEOUT, Chunk, Task, killed, run

# A design has ended its process when it did so this often: a single death may be that of a process that somebody else killed.
ATTEMPTS = 3
# Seconds that a child has beyond the limits of its designs, to start and to hand over.
GRACE = 30.0
_LOOK = 0.05


def examine(task: Task, context: Any = None) -> Iterator[Chunk]:
    """The chunks of a task of which some design may end its process, halved until that design is found."""
    limit = None if task.limit is None else GRACE + task.limit * len(task.values)
    for attempt in range(ATTEMPTS if len(task.values) == 1 else 1):
        start = time.perf_counter()
        found, ended = in_child(task, limit, context)
        if found is not None:
            yield found
            return
        if len(task.values) == 1 and attempt == ATTEMPTS - 1:
            status = TIMEOUT if ended == "hung" else KILLED
            text = f"the design {ended} its process, {ATTEMPTS} times" if ended != "hung" else (
                f"the design took longer than its limit of {task.limit:g} s and did not answer"
            )  # fmt: skip
            yield killed(task, time.perf_counter() - start, text, status)
            return
    half = len(task.values) // 2
    for part in (task.part(0, half), task.part(half, len(task.values))):
        yield from examine(part, context)


def in_child(task: Task, limit: float | None, context: Any = None) -> tuple[Chunk | None, str]:
    """Chunk that a child process makes of a task, or None, and how the child ended."""
    context = context or multiprocessing.get_context("fork" if sys.platform == "linux" else None)
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_work, args=(task, theirs, os.getpid()), daemon=True)
    child.start()
    theirs.close()
    try:
        deadline = None if limit is None else time.monotonic() + limit
        while not ours.poll(_LOOK):
            if deadline is not None and time.monotonic() > deadline:
                return None, "hung"
        return ours.recv(), ""
    except (EOFError, OSError):
        child.join(GRACE)
        return None, _ended(child.exitcode)
    finally:
        ours.close()
        if child.is_alive():
            child.kill()
        child.join()


def _ended(code: int | None) -> str:
    if code is not None and code < 0:
        return f"ended (signal {-code})"
    return f"ended (exit code {code})"


def _work(task: Task, answer: Connection, parent: int) -> None:
    leave_with(parent)
    answer.send(run(task))
    answer.close()


def leave_with(client: int) -> None:
    """End this process once the client of the sweep is gone: nobody would take its results."""
    first = os.getppid()

    def watch() -> None:
        while os.getppid() == first and _exists(client):
            time.sleep(0.5)
        os._exit(1)

    if sys.platform != "win32":
        threading.Thread(target=watch, daemon=True).start()


def _exists(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
