"""Models as descriptions, and what a change does to answers.

A model becomes a `Description` (the dict of its file, with parameters put in), a change makes another description of it, and
that becomes a model again: all through `Model.save` and `Model.load`. A `Change` also says what becomes of points, vectors,
times, masses and names, so that a test can turn an answer of the changed model back.
"""

from __future__ import annotations

import copy
import json
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import mbrs as mb
import numpy as np

TEXT = {"name", "type", "kind", "a", "b", "body", "frame", "joint", "first", "second", "nodes", "on"}
TEXT |= {"coordinate", "first_coordinate", "second_coordinate"}
TABLES = ("body", "joint", "drive", "coupler", "element", "load", "marker")


@dataclass
class Description:
    """What a model file holds, with numbers in the place of expressions."""

    data: dict

    @classmethod
    def of(cls, model) -> Description:
        with tempfile.TemporaryDirectory() as folder:
            data = tomllib.loads(model.save(Path(folder) / "model.toml").read_text(encoding="utf-8"))
        known = {name: _parameter(given) for name, given in data.pop("parameters", {}).items()}
        return cls(_plain(data, "", known))

    def model(self) -> mb.Model:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.toml"
            path.write_text(_text(self.data), encoding="utf-8")
            return mb.Model.load(path)

    def __getitem__(self, kind) -> list[dict]:
        return self.data.get(kind, [])

    def copy(self) -> Description:
        return Description(copy.deepcopy(self.data))

    def put(self, kind, **entry) -> None:
        """Add an object."""
        self.data.setdefault(kind, []).append(entry)


def _parameter(given):
    """The value of a parameter, a number or an array or a table of it and its unit."""
    return np.array(given["value"] if isinstance(given, dict) else given)


def _plain(value, key, known):
    if isinstance(value, dict):
        return {k: _plain(v, k, known) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(v, key, known) for v in value]
    if isinstance(value, str) and key not in TEXT:
        return float(eval(value.replace("^", "**"), {"__builtins__": {}}, {**vars(np), **known}))
    return value


def _text(data) -> str:
    lines = []
    for heading, content in data.items():
        for table in content if isinstance(content, list) else [content]:
            lines.append(f"[[{heading}]]" if isinstance(content, list) else f"[{heading}]")
            lines += [f"{json.dumps(key)} = {_value(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _value(value) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, bool):
        return str(value).lower()
    return repr(int(value)) if isinstance(value, (int, np.integer)) else repr(float(value))


@dataclass(frozen=True)
class Change:
    """A change and how answers follow: points p -> length (R p + shift); times, masses and names likewise."""

    name: str
    apply: Callable[[Description], Description]
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0
    rename: Callable[[str], str] = lambda name: name
    error: float = 0.0  # relative change of the data that the change itself makes

    def __call__(self, model) -> mb.Model:
        return self.apply(Description.of(model)).model()

    def points_back(self, p):
        """Points (..., 3) of the changed model where those of the first one are."""
        return (np.asarray(p) / self.length - self.shift) @ self.R

    def vectors_back(self, v, length=1, mass=0, time=0):
        """Vectors (..., 3) of a dimension."""
        return np.asarray(v) @ self.R / self.unit(length, mass, time)

    def unit(self, length=0, mass=0, time=0):
        """Size of a unit of the first model in that of the changed one."""
        return self.length**length * self.mass**mass * self.time**time
