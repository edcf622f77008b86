"""The folder of a sweep: what is computed, the designs, one file for each chunk, and a lock.

Only the process that called the sweep writes. Files of results take their name when they are complete, so that a folder is whole
whenever the process ends.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import json
import os
import platform
import re
import socket
import sys
import threading
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from .._lib.checks import shown
from .._lib.files import write_atomic
from .._lib.warning import warn_user
from ..errors import ModelError, StoreError
from .chunk import Chunk, pack, unpacked
from .sources import digest
from .table import Designs, fingerprint

FORMAT = 1
_CHUNK = re.compile(r"chunk-(\d{10})-(\d{8})\.npz")
_BEGUN = re.compile(r"begun-(\d{10})-(\d{8})")
# What must be the same for a sweep to go on.
_IDENTITY = ("model", "outputs", "names", "units", "designs")
_held: set[str] = set()
_holding = threading.Lock()


def identity(model_text: str, outputs: Mapping[str, Any], designs: Designs) -> dict[str, Any]:
    """Description of what a sweep computes, as its folder keeps it."""
    from .._lib.version import __version__

    return {
        "format": FORMAT,
        "model": model_text,
        "outputs": dict(outputs),
        "names": list(designs.names),
        "units": list(designs.units),
        "designs": {"n": len(designs), "sha256": fingerprint(designs.values)},
        "hash": digest([model_text, outputs, designs.names, designs.units, fingerprint(designs.values)]),
        "versions": {"mbrs": __version__, "python": platform.python_version(), "numpy": np.__version__},
    }


class Store:
    """A folder of results, locked while it is open."""

    def __init__(self, folder: str | Path, wanted: Mapping[str, Any], values: np.ndarray) -> None:
        self.folder = Path(folder)
        self._wanted, self._values = wanted, values

    @contextlib.contextmanager
    def opened(self) -> Iterator[Store]:
        """Lock the folder and make sure that it belongs to this sweep."""
        with contextlib.ExitStack() as stack:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                stack.enter_context(_locked(self.folder))
                for left in self.folder.glob(".*.tmp"):
                    left.unlink(missing_ok=True)
                self._begin()
            except OSError as reason:
                raise StoreError(f"cannot use the folder {self.folder}: {reason.strerror or reason}") from reason
            yield self

    def _begin(self) -> None:
        path = self.folder / "sweep.json"
        if path.exists():
            self._compare(path)
            return
        if any(_CHUNK.fullmatch(one.name) for one in self.folder.iterdir()):
            raise StoreError(
                f"{self.folder} holds results and no sweep.json, so nobody knows of what; take another folder"
            )
        buffer = io.BytesIO()
        np.save(buffer, self._values)
        write_atomic(self.folder / "designs.npy", buffer.getvalue())
        write_atomic(path, (json.dumps(self._wanted, indent=1) + "\n").encode())

    def _compare(self, path: Path) -> None:
        try:
            kept = json.loads(path.read_text(encoding="utf-8"))
            found = kept["format"], [kept[name] for name in _IDENTITY], kept["versions"]
        except (ValueError, KeyError, TypeError) as reason:
            raise StoreError(f"{path} is damaged ({reason}); take another folder") from None
        if found[0] != FORMAT:
            raise StoreError(
                f"{path} has the format {shown(found[0])}, this version of mbrs writes {FORMAT}; take another folder"
            )
        changed = [name for name in _IDENTITY if kept[name] != json.loads(json.dumps(self._wanted[name]))]
        if "names" in changed or "designs" in changed:
            # the text of the model has the numbers of the first design
            changed = [name for name in changed if name != "model"]
        if changed:
            lines = [line for name in changed for line in _difference(name, kept[name], self._wanted[name])]
            raise StoreError(
                f"{self.folder} holds a sweep with another {' and other '.join(changed)}; take another folder, or remove this "
                "one. What differs (- there, + now):\n" + "\n".join(lines[:20])
            )
        if found[2] != self._wanted["versions"]:
            warn_user(
                f"the sweep in {self.folder} was begun with {found[2]}, it goes on with {self._wanted['versions']}; the last bits "
                "of its results may differ between these"
            )

    def ranges(self) -> list[tuple[int, int]]:
        """First design and number of designs of every chunk that is there."""
        found = (_CHUNK.fullmatch(one.name) for one in self.folder.iterdir())
        return sorted((int(m[1]), int(m[2])) for m in found if m)

    def read(self, first: int, n: int) -> Chunk | None:
        """A chunk; None, with a warning, where its file is damaged, so that it is computed again."""
        path = self.folder / _name(first, n)
        try:
            with path.open("rb") as file:
                chunk = unpacked(file)
            if (chunk.first, len(chunk)) != (first, n) or chunk.values.shape != (n, self._values.shape[1]):
                raise ModelError("the file of a chunk holds other designs than its name says")
            return chunk
        except ModelError as reason:
            warn_user(f"{path}: {reason}; its designs are computed again")
            path.unlink()
            return None

    def write(self, chunk: Chunk) -> None:
        """Keep a chunk: the file is there, whole, when this returns."""
        try:
            write_atomic(self.folder / _name(chunk.first, len(chunk)), partial(pack, chunk))
        except OSError as reason:
            raise StoreError(
                f"cannot write designs {chunk.first} to {chunk.end - 1} into {self.folder}: {reason.strerror or reason}; the "
                "same call goes on when there is room again"
            ) from reason

    def begin(self, first: int, n: int) -> None:
        """Mark designs that this process is about to compute itself: if one of them ends it, the next call knows."""
        (self.folder / _mark(first, n)).touch()

    def end(self, first: int, n: int) -> None:
        """Take a mark away."""
        (self.folder / _mark(first, n)).unlink(missing_ok=True)

    def begun(self) -> list[tuple[int, int]]:
        """Marks that a process left when it ended."""
        found = (_BEGUN.fullmatch(one.name) for one in self.folder.iterdir())
        return sorted((int(m[1]), int(m[2])) for m in found if m)


def _name(first: int, n: int) -> str:
    return f"chunk-{first:010d}-{n:08d}.npz"


def _mark(first: int, n: int) -> str:
    return f"begun-{first:010d}-{n:08d}"


def _difference(name: str, there: Any, now: Any) -> list[str]:
    if name == "designs":
        same = there["n"] == now["n"]
        return [f"- {there['n']} designs", f"+ {now['n']} designs" + (" of other values" if same else "")]
    before, after = (_lines(value) for value in (there, now))
    return [
        line[:200]
        for line in difflib.unified_diff(before, after, n=0, lineterm="")
        if line[:2] not in ("--", "++", "@@") and line.strip("+- ")
    ]


def _lines(value: Any) -> list[str]:
    if isinstance(value, str):
        return value.splitlines()
    if isinstance(value, Mapping):
        return [f"{key}: {line}" for key, one in sorted(value.items()) for line in _lines(one)]
    return [json.dumps(value)]


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, which the system takes away when the process ends, however it ends."""
    path = folder / "lock"
    key = str(path.resolve())
    with _holding:
        if key in _held:
            raise StoreError(
                f"{folder} is in use by another sweep of this process; wait for it, or take another folder"
            )
        _held.add(key)
    try:
        with path.open("a+", encoding="utf-8") as file:
            if not _lock(file):
                file.seek(0)
                holder = file.read(200).strip() or "another process"
                raise StoreError(f"{folder} is in use by {holder}; wait for it, or take another folder")
            file.truncate(0)
            file.write(f"process {os.getpid()} on {socket.gethostname()}")
            file.flush()
            yield
    finally:
        with _holding:
            _held.discard(key)


def _lock(file: TextIO) -> bool:
    """Lock a file for this process alone, not for its children; False where another one has it."""
    if sys.platform == "win32":
        import msvcrt

        try:
            file.seek(1 << 30)  # beyond the text, which stays readable
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    return True
