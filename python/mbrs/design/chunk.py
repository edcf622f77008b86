"""A chunk of designs and what came of it: the unit of work of a sweep, a pure function of the model and of rows of numbers."""

from __future__ import annotations

import hashlib
import json
import pickle
import re
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np

from ..errors import ModelError
from ..model.addresses import adopt, target
from ..model.model import Model
from .fast import Block, FastPlan, fast_plan
from .limit import OutOfTime, time_limit
from .outputs import Analysis

DONE, FAILED, TIMEOUT, KILLED = range(4)
STATUS = ("done", "failed", "timeout", "killed")
# Characters of a message that are kept: a design that fails must not fill the disk.
MOST_TEXT = 1000
_QUOTED = re.compile(r"'([^']{1,200})'")


class Scene(Protocol):
    """Data that a worker needs beside the rows: a fresh model for each design, and the function of it. A worker that cannot have
    them fails in ``prepare``, before any design.
    """

    def prepare(self) -> None: ...
    def model(self) -> Any: ...
    def outputs(self, model: Any) -> Mapping[str, Any]: ...
    def fast(self, names: tuple[str, ...]) -> FastPlan | None: ...


@dataclass(frozen=True)
class LocalScene:
    """The model and its function in the process that holds them."""

    make: Callable[[], Any]
    function: Callable[[Any], Mapping[str, Any]]

    def prepare(self) -> None:
        """Everything is here."""

    def model(self) -> Any:
        return self.make()

    def outputs(self, model: Any) -> Mapping[str, Any]:
        return self.function(model)

    def fast(self, names: tuple[str, ...]) -> FastPlan | None:
        return _fast(self, names) if isinstance(self.function, Analysis) else None


@dataclass(frozen=True)
class PackedScene:
    """The model and its function as bytes for another process, which unpacks the function once."""

    packed_model: bytes
    packed_function: bytes

    def prepare(self) -> None:
        self.model()
        _unpacked(self.packed_function)

    def model(self) -> Any:
        return pickle.loads(self.packed_model)

    def outputs(self, model: Any) -> Mapping[str, Any]:
        return _unpacked(self.packed_function)(model)

    def fast(self, names: tuple[str, ...]) -> FastPlan | None:
        return _fast(self, names) if isinstance(_unpacked(self.packed_function), Analysis) else None


@dataclass(frozen=True)
class KeptScene:
    """A scene that lies in a file of the client: each process of a pool reads it once, and knows it by its hash."""

    digest: str
    path: str

    @classmethod
    def of(cls, scene: PackedScene, folder: str) -> KeptScene:
        """Write the file."""
        data = pickle.dumps(scene)
        digest = hashlib.sha256(data).hexdigest()
        path = Path(folder) / digest
        path.write_bytes(data)
        return cls(digest, str(path))

    def _read(self) -> PackedScene:
        return _kept(self.digest, self.path)

    def prepare(self) -> None:
        self._read().prepare()

    def model(self) -> Any:
        return self._read().model()

    def outputs(self, model: Any) -> Mapping[str, Any]:
        return self._read().outputs(model)

    def fast(self, names: tuple[str, ...]) -> FastPlan | None:
        return self._read().fast(names)


@lru_cache(maxsize=4)
def _kept(digest: str, path: str) -> PackedScene:
    data = Path(path).read_bytes()
    if hashlib.sha256(data).hexdigest() != digest:
        raise ModelError("the file of the model of a sweep has changed")
    scene: PackedScene = pickle.loads(data)
    return scene


@lru_cache(maxsize=4)
def _unpacked(data: bytes) -> Any:
    return pickle.loads(data)


@lru_cache(maxsize=4)
def _fast(scene: LocalScene | PackedScene, names: tuple[str, ...]) -> FastPlan | None:
    """The fast path of a scene, made once for all its chunks."""
    function = scene.function if isinstance(scene, LocalScene) else _unpacked(scene.packed_function)
    return fast_plan(scene.model, names, function)


@dataclass(frozen=True)
class Task:
    """Rows of designs for a worker: ``first`` is the index of the first, ``limit`` seconds for each (or None), ``threads`` of the core
    for those that it computes by itself.
    """

    scene: Scene
    names: tuple[str, ...]
    first: int
    values: np.ndarray
    limit: float | None = None
    threads: int = 1

    def part(self, start: int, stop: int) -> Task:
        """Some of its rows."""
        return replace(self, first=self.first + start, values=self.values[start:stop])


@dataclass(frozen=True)
class Failure:
    """Reason for a design without outputs: the error, the object that it names, and its message."""

    design: int
    error: str
    object: str
    message: str


@dataclass
class Column:
    """One output of a chunk, of one kind of number ("f:name"): its rows in the chunk, their shapes, and all entries one behind the
    other.
    """

    rows: np.ndarray
    shapes: np.ndarray
    flat: np.ndarray

    def sizes(self) -> np.ndarray:
        """Number of entries of each row."""
        return np.asarray(np.prod(np.where(self.shapes < 0, 1, self.shapes), axis=1, dtype=np.int64))


@dataclass
class Chunk:
    """Outputs and failures of the designs ``first`` to ``first + len - 1``; fewer than asked for where it was stopped."""

    first: int
    values: np.ndarray
    status: np.ndarray
    seconds: np.ndarray
    failures: list[Failure] = field(default_factory=list)
    columns: dict[str, Column] = field(default_factory=dict)
    stopped: bool = False

    def __len__(self) -> int:
        return len(self.status)

    @property
    def end(self) -> int:
        return self.first + len(self)


def _never() -> bool:
    return False


def _nothing(n: int) -> None:
    pass


def run(task: Task, stop: Callable[[], bool] = _never, tick: Callable[[int], None] = _nothing) -> Chunk:
    """Compute the designs of a task one after the other, and ``tick`` how many were finished. What a design raises is its failure;
    Ctrl-C or ``stop`` end the chunk early, with the designs that are finished.
    """
    task.scene.prepare()
    made = _Results(task, tick)
    fast = task.scene.fast(task.names)
    stopped = False
    while len(made.status) < len(task.values) and not stopped:
        try:
            if stop():
                stopped = True
            elif fast is None:
                made.single()
            else:
                made.block(fast)
        except KeyboardInterrupt:
            stopped = True
    n = len(made.status)
    status, seconds = np.array(made.status, np.int8), np.array(made.seconds)
    return Chunk(task.first, task.values[:n], status, seconds, made.failures, made.columns(), stopped)


class _Filling:
    """A column that grows by blocks of rows, in an array for all ``most`` rows: what is not filled takes no memory yet."""

    def __init__(self, most: int) -> None:
        self._most, self._used, self._count = most, 0, 0
        self._flat = np.empty(0)
        self._rows: list[np.ndarray] = []
        self._shapes: list[np.ndarray] = []

    def add(self, rows: np.ndarray, shapes: np.ndarray, flat: np.ndarray) -> None:
        end, count = self._used + len(flat), self._count + len(rows)
        if end > len(self._flat):
            room = np.empty(max(end, -(-end * self._most // count)), dtype=flat.dtype)
            room[: self._used] = self._flat[: self._used]
            self._flat = room
        self._flat[self._used : end] = flat
        self._used, self._count = end, count
        self._rows.append(rows)
        self._shapes.append(shapes)

    def column(self) -> Column:
        return Column(np.concatenate(self._rows), np.concatenate(self._shapes), self._flat[: self._used])


class _Results:
    """Results of the first designs of a task, as they come."""

    def __init__(self, task: Task, tick: Callable[[int], None]) -> None:
        self._task, self._tick = task, tick
        self.status: list[int] = []
        self.seconds: list[float] = []
        self.failures: list[Failure] = []
        # outputs by Python, design by design, and by the core
        self._rows: list[tuple[int, dict[str, np.ndarray]]] = []
        self._blocks: dict[str, _Filling] = {}
        self._pattern = _pattern(task)
        # None until the first remark: is it an error (by a filter of warnings)?
        self._remark_fails: bool | None = None

    def columns(self) -> dict[str, Column]:
        """All outputs, each by its rows."""
        found = {name: [column] for name, column in columns_of(self._rows).items()}
        for name in list(self._blocks):
            found.setdefault(name, []).append(self._blocks.pop(name).column())
        return {name: _joined(found.pop(name)) for name in list(found)}

    def single(self) -> None:
        """The next design, by Python."""
        i, start = len(self.status), time.perf_counter()
        found = _one(self._task, self._task.values[i], self._pattern)
        seconds = time.perf_counter() - start
        if isinstance(found, Failure):
            self.failures.append(Failure(self._task.first + i, found.error, found.object, found.message))
            self._finish([TIMEOUT if found.error == OutOfTime.__name__ else FAILED], [seconds])
        else:
            self._rows.append((i, found))
            self._finish([DONE], [seconds])

    def _finish(self, status: list[int], seconds: list[float]) -> None:
        self.status += status
        self.seconds += seconds
        self._tick(len(status))

    def block(self, fast: FastPlan) -> None:
        """Some designs, by the core where it can."""
        first, limit = len(self.status), self._task.limit
        made = fast.compute(self._task.values[first:], self._task.threads)
        left = ~made.computed
        if limit is not None:
            left |= made.seconds > limit
        for j in np.flatnonzero(made.remark & ~left).tolist():
            left[j] = self._fails(first + j)
        at = 0
        for j in [*np.flatnonzero(left).tolist(), len(left)]:
            self._keep(made, at, j)
            if j < len(left):
                self.single()
            at = j + 1

    def _keep(self, made: Block, start: int, end: int) -> None:
        """Designs of a block that the core has computed, from ``start`` to before ``end``."""
        if start == end:
            return
        rows = np.arange(len(self.status), len(self.status) + end - start)
        for output, shapes, flat in made.part(start, end):
            key = f"{'c' if output.is_complex else 'f'}:{output.name}"
            self._blocks.setdefault(key, _Filling(len(self._task.values))).add(rows, shapes, flat)
        self._finish([DONE] * (end - start), made.seconds[start:end].tolist())

    def _fails(self, i: int) -> bool:
        """Let Python say what there is to say of a design, once; whether it makes the design fail."""
        if self._remark_fails is None:
            self._remark_fails = isinstance(_one(self._task, self._task.values[i], self._pattern), Failure)
        return self._remark_fails


def _pattern(task: Task) -> Model | None:
    """A model that knows the names of the designs, for its copies to take over; None where that is left to each of them."""
    try:
        model = task.scene.model()
        if isinstance(model, Model):
            for name in task.names:
                target(model, name)
            return model
    except Exception:  # a failure of each design
        pass
    return None


def _one(task: Task, row: np.ndarray, pattern: Model | None) -> dict[str, np.ndarray] | Failure:
    try:
        with time_limit(task.limit):
            model = task.scene.model()
            if pattern is not None:
                adopt(model, pattern)
            model.set(dict(zip(task.names, row.tolist(), strict=True)))
            return checked(task.scene.outputs(model))
    except OutOfTime:
        return Failure(0, OutOfTime.__name__, "", f"the design took longer than its limit of {task.limit:g} s")
    except (Exception, SystemExit) as problem:
        return Failure(0, type(problem).__name__, _object(problem), _text(problem))


def _text(problem: BaseException) -> str:
    try:
        return str(problem)[:MOST_TEXT]
    except Exception:  # an error of the user's own whose text cannot be made
        return ""


def _object(problem: BaseException) -> str:
    """The object of the model that an error is about: what it carries, or the first name that its message quotes."""
    own = getattr(problem, "object", None)
    if isinstance(own, str):
        return own[:200]
    quoted = _QUOTED.search(_text(problem))
    return quoted.group(1) if quoted else ""


def checked(given: Any) -> dict[str, np.ndarray]:
    """The outputs of one design as arrays of numbers."""
    if not isinstance(given, Mapping):
        raise ModelError(f"the outputs of a design must be numbers and arrays by name, not a {type(given).__name__}")
    found: dict[str, np.ndarray] = {}
    for name, value in given.items():
        if not isinstance(name, str) or not name or "[" in name:
            raise ModelError(f"the name {name!r} of an output must be text without '['")
        array = np.asarray(value)
        if array.dtype.kind not in "biufc":
            raise ModelError(
                f"the output {name!r} must be a number or an array of numbers, it is a {type(value).__name__}"
            )
        wide = {"b": np.bool_, "c": np.complex128, "f": np.float64}.get(array.dtype.kind, np.int64)
        found[name] = array.astype(wide, order="C")
    return found


def columns_of(rows: list[tuple[int, dict[str, np.ndarray]]]) -> dict[str, Column]:
    by_name: dict[str, list[tuple[int, np.ndarray]]] = {}
    for i, outputs in rows:
        for name, value in outputs.items():
            by_name.setdefault(f"{value.dtype.kind}:{name}", []).append((i, value))
    return {name: _column(found) for name, found in by_name.items()}


def _column(found: list[tuple[int, np.ndarray]]) -> Column:
    """Shapes have as many columns as the largest number of dimensions, filled with -1."""
    most = max(value.ndim for _, value in found)
    shapes = np.full((len(found), most), -1, dtype=np.int64)
    for i, (_, value) in enumerate(found):
        shapes[i, : value.ndim] = value.shape
    flat = np.concatenate([value.ravel() for _, value in found])
    return Column(np.array([i for i, _ in found], dtype=np.int64), shapes, flat)


def _joined(parts: list[Column]) -> Column:
    """One column of several, in the order of their rows."""
    if len(parts) == 1:
        return parts[0]
    parts = sorted(parts, key=lambda part: int(part.rows[0]))
    most = max(part.shapes.shape[1] for part in parts)
    shapes = [np.pad(p.shapes, ((0, 0), (0, most - p.shapes.shape[1])), constant_values=-1) for p in parts]
    whole = Column(*(np.concatenate(a) for a in ([p.rows for p in parts], shapes, [p.flat for p in parts])))
    order = np.argsort(whole.rows, kind="stable")
    if np.array_equal(order, np.arange(len(order))):
        return whole
    ends = np.cumsum(whole.sizes())
    starts = ends - whole.sizes()
    flat = np.concatenate([whole.flat[starts[i] : ends[i]] for i in order.tolist()])
    return Column(whole.rows[order], whole.shapes[order], flat)


def pack(chunk: Chunk, file: BinaryIO) -> None:
    """Write the chunk as a NumPy archive without objects."""
    names = list(chunk.columns)
    head = {
        "first": chunk.first,
        "names": names,
        "failures": [[f.design, f.error, f.object, f.message] for f in chunk.failures],
    }
    arrays: dict[str, Any] = {"values": chunk.values, "status": chunk.status, "seconds": chunk.seconds}
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    for j, column in enumerate(chunk.columns.values()):
        arrays |= {f"rows{j}": column.rows, f"shapes{j}": column.shapes, f"flat{j}": column.flat}
    np.savez(file, **arrays)


def unpacked(file: BinaryIO) -> Chunk:
    """The chunk of an archive; `ModelError` where it is damaged."""
    try:
        with np.load(file, allow_pickle=False) as arrays:
            head = json.loads(bytes(arrays["head"]))
            columns = {
                name: Column(arrays[f"rows{j}"], arrays[f"shapes{j}"], arrays[f"flat{j}"])
                for j, name in enumerate(head["names"])
            }
            failures = [Failure(int(i), str(e), str(o), str(m)) for i, e, o, m in head["failures"]]
            chunk = Chunk(int(head["first"]), arrays["values"], arrays["status"], arrays["seconds"], failures, columns)
    except (KeyError, OSError, TypeError, ValueError, EOFError, zipfile.BadZipFile, NotImplementedError) as reason:
        raise ModelError(f"the file of a chunk is damaged ({reason})") from None
    return chunk


def killed(task: Task, seconds: float, message: str, status: int = KILLED) -> Chunk:
    """The chunk of one design that ended its process."""
    word = STATUS[status]
    failure = Failure(task.first, "ProcessKilled" if word == "killed" else OutOfTime.__name__, "", message)
    return Chunk(task.first, task.values, np.array([status], np.int8), np.array([seconds]), [failure])
