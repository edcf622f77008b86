"""A model as readable tables: one for each kind of object, with what was given to its constructor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.text import Block, counted, number, without_rounding
from .book import Book
from .describe import describe
from .expressions import Expression
from .motions import UserFunction
from .names import shown
from .schema import UNITS

__all__ = ["blocks"]

# Rows of one table; a larger model tells how many more there are.
MOST_ROWS = 40
_MOST_NUMBERS = 8
_DIGITS = 4

_TITLES = {
    "[[body]]": "bodies",
    "[[joint]]": "joints",
    "[[drive]]": "drives",
    "[[coupler]]": "couplers",
    "[[constraint]]": "constraints",
    "[[velocity_constraint]]": "velocity constraints",
    "[[element]]": "springs and dampers",
    "[[load]]": "loads",
    "[[marker]]": "markers",
    "[[aerodynamics]]": "aerodynamics",
}
# Units of arguments that have one whatever the object; those of k and c depend on the coordinate.
_UNITS = {"mass": "mass", "inertia": "inertia", "at": "point", "axis": "", "length": "length"}


def blocks(book: Book) -> list[Block]:
    """Tables of a model: a line of counts, its parameters, then its objects in the order of definition."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for heading, row in describe(book, {}):
        groups.setdefault(heading, []).append(row)
    made = [Block(title=_summary(book)), *_parameters(book, groups.pop("[parameters]", []))]
    return made + [_block(title, groups[heading]) for heading, title in _TITLES.items() if heading in groups]


def _summary(book: Book) -> str:
    counts = {
        "body": len(book.bodies), "joint": len(book.joints), "spring or damper": len(book.elements), "load": len(book.loads),
        "drive": len(book.drives), "constraint": len(book.constraints), "parameter": len(book.space.names),
    }  # fmt: skip
    parts = [counted(n, what) for what, n in counts.items() if n]
    if book.gravity_item is not None:
        parts.append(f"gravity {_text(book.gravity_item.values())} m/s2")
    return f"model {shown(book.name)}: {', '.join(parts) or 'empty'}"


def _parameters(book: Book, found: Sequence[Mapping[str, Any]]) -> list[Block]:
    rows = [
        [name, value["value"] if isinstance(value, dict) else value, book.space.units[name]]
        for table in found
        for name, value in table.items()
    ]
    return [_cut("parameters", ["name", "value", "unit"], [[a, _text(b), c] for a, b, c in rows])] if rows else []


def _block(title: str, rows: Sequence[Mapping[str, Any]]) -> Block:
    keys = list(dict.fromkeys(key for row in rows for key in row if key not in ("a", "b", "modal_body")))
    keys.sort(key=lambda key: key == "shape")  # the last
    between = any("a" in row for row in rows)
    columns = [_head(key) for key in keys]
    cells = [[_cell(key, row[key]) if key in row else "" for key in keys] for row in rows]
    if between:
        place = 1 + keys.index("name")
        columns.insert(place, "between")
        for cell, row in zip(cells, rows, strict=True):
            cell.insert(place, f"{row['a']} - {row['b']}")
    if "name" in keys:  # first, so that a folded table repeats it
        at = columns.index("name")
        for line in (columns, *cells):
            line.insert(0, line.pop(at))
    return _cut(title, columns, cells)


def _cell(key: str, value: Any) -> Any:
    """A shape by its type alone: the numbers of a picture change no result."""
    if key == "shape":
        return " + ".join(one["type"] for one in (value if isinstance(value, list) else [value]))
    return _text(value)


def _cut(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> Block:
    more = len(rows) - MOST_ROWS
    return Block(columns, rows[:MOST_ROWS], title, f"... and {more} more" if more > 0 else None)


def _head(key: str) -> str:
    unit = UNITS.get(_UNITS.get(key, ""), "")
    return f"{key} [{unit}]" if unit else key


def _text(value: Any) -> Any:
    """Numbers short, an expression with its value, a law or a motion by its type."""
    if isinstance(value, Expression):
        return f"{value} = {number(value.value, _DIGITS)}"
    if isinstance(value, UserFunction):
        return str(value)
    if isinstance(value, Mapping):
        kind = value.get("type", "")
        rest = ", ".join(f"{k} {_text(v)}" for k, v in value.items() if k != "type")
        return f"{kind}({rest})" if kind else rest
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Iterable) and not isinstance(value, str):
        return _listed(list(value))
    return value if isinstance(value, str) else number(value, _DIGITS)


def _listed(parts: list[Any]) -> str:
    if len(parts) > _MOST_NUMBERS:
        return f"[{len(parts)} values]"
    if parts and all(isinstance(v, float | int) for v in parts):
        parts = without_rounding(parts).tolist()
    return "[" + ", ".join(str(_text(v)) for v in parts) + "]"
