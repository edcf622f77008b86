"""Readers of polars: AeroDyn's airfoil files, old and new, and plain columns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .._lib.checks import count
from ..errors import ModelError
from .polars import Polar, polar

__all__ = ["read_polar"]

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")


def read_polar(
    path: str | Path,
    *,
    table: int = 1,
    thickness: float | None = None,
    name: str | None = None,
    interpolation: str = "pchip",
) -> Polar:
    """Read a polar from a file: angles in degrees become radians, a line that repeats the one before it is left out.

    Parameters
    ----------
    path
        An airfoil file of AeroDyn 15 ("NumTabs", "NumAlf"), one of AeroDyn 12 to 14 ("Number of airfoil tables"), or columns
        angle, lift, drag and, where given, moment, separated by commas, semicolons or blanks. Of columns, lines that begin with
        # or ! are comments; one heading is allowed, and the angles are in degrees unless it has [rad].
    table
        Which table of an AeroDyn file, from 1 (they differ in Reynolds number or control setting).
    thickness, interpolation
        As for `polar`.
    name
        The name of the file without its ending by default.

    Raises
    ------
    ModelError
        A file that cannot be read, a table that it does not hold, lines that are not numbers; the message names file and line.

    Notes
    -----
    J. M. Jonkman et al., "AeroDyn v15 user's guide and theory manual", NREL; D. J. Laino and A. C. Hansen, "User's guide to the
    wind turbine aerodynamics computer software AeroDyn", NREL/SR (2002).

    Examples
    --------
    >>> import pathlib, tempfile, mbrs as mb
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "plate.csv"
    >>> _ = file.write_text("angle [deg],lift,drag\\n-8,-0.8,0.02\\n0,0,0.01\\n8,0.8,0.02\\n")
    >>> mb.aero.read_polar(file)
    Polar('plate', 3 angles from -8 to 8 degrees, pchip)
    """
    file = Path(path)
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as problem:
        raise ModelError(f"cannot read the polar {file.name!r}: {problem.strerror or problem}") from None
    count(f"{file.name}: table", table, 1000)
    if any(_keyword(line) == "NumAlf" for line in lines):
        rows, degrees = _aerodyn15(file.name, lines, table), True
    elif any("number of airfoil tables" in line.lower() for line in lines):
        rows, degrees = _aerodyn12(file.name, lines, table), True
    else:
        if table != 1:
            raise ModelError(f"{file.name}: a file of columns holds one table, not {table}")
        rows, degrees = _columns(file.name, lines)
    rows = rows[np.r_[True, np.any(np.diff(rows, axis=0) != 0.0, axis=1)]]  # published tables repeat lines
    angle = np.radians(rows[:, 0]) if degrees else rows[:, 0]
    moment = rows[:, 3] if rows.shape[1] > 3 else None
    known = file.stem if name is None else name
    return polar(angle, rows[:, 1], rows[:, 2], moment, thickness=thickness, name=known, interpolation=interpolation)


def _keyword(line: str) -> str:
    """The second word of a line of AeroDyn 15, which says what the first means."""
    words = line.split(None, 2)
    return words[1] if len(words) > 1 and not line.lstrip().startswith("!") else ""


def _numbers(line: str) -> list[float] | None:
    """All words of a line as numbers, or None."""
    words = line.replace(",", " ").replace(";", " ").split()
    if not words or not all(_NUMBER.fullmatch(word) for word in words):
        return None
    return [float(re.sub("[dD]", "e", word)) for word in words]


def _leading_count(name: str, number: int, line: str) -> int:
    """The count that a line begins with."""
    word = line.split(None, 1)[0] if line.split() else ""
    if not word.isdigit() or not 0 < int(word) <= 100000:
        raise ModelError(f"{name}, line {number}: a count was expected, the line begins with {word[:40]!r}")
    return int(word)


def _aerodyn15(name: str, lines: list[str], table: int) -> np.ndarray:
    places = [i for i, line in enumerate(lines) if _keyword(line) == "NumAlf"]
    if table > len(places):
        raise ModelError(f"{name} holds {len(places)} tables, not {table}")
    begin = places[table - 1]
    n = _leading_count(name, begin + 1, lines[begin])
    body = ((i + 1, line) for i, line in enumerate(lines) if i > begin and line.strip() and line.lstrip()[0] != "!")
    return _rows(name, body, n, (3, 4, 5))


def _aerodyn12(name: str, lines: list[str], table: int) -> np.ndarray:
    head = next(i for i, line in enumerate(lines) if "number of airfoil tables" in line.lower())
    n = _leading_count(name, head + 1, lines[head])
    if table > n:
        raise ModelError(f"{name} holds {n} tables, not {table}")
    widths = (1 + 2 * n, 1 + 3 * n)

    def is_row(line: str) -> bool:
        values = _numbers(line)
        return values is not None and len(values) in widths

    first = next((i for i in range(head + 1, len(lines)) if is_row(lines[i])), None)
    if first is None:
        raise ModelError(f"{name}: no line has an angle and the coefficients of {n} tables")
    last = next(
        (i for i in range(first, len(lines)) if not lines[i].strip() or lines[i].split()[0] == "EOT"), len(lines)
    )
    rows = _rows(name, ((i + 1, lines[i]) for i in range(first, last)), last - first, widths)
    step = (rows.shape[1] - 1) // n
    return rows[:, [0, *range(1 + (table - 1) * step, 1 + table * step)]]


def _columns(name: str, lines: list[str]) -> tuple[np.ndarray, bool]:
    body = [(i + 1, line) for i, line in enumerate(lines) if line.strip() and line.lstrip()[0] not in "#!"]
    if not body:
        raise ModelError(f"{name}: the file holds no numbers")
    degrees = True
    if _numbers(body[0][1]) is None:
        degrees = "rad" not in body[0][1].lower()
        body = body[1:]
    return _rows(name, iter(body), len(body), (3, 4)), degrees


def _rows(name: str, body: Iterator[tuple[int, str]], n: int, widths: tuple[int, ...]) -> np.ndarray:
    """(n, k) numbers of the next n lines, all of one of these widths."""
    rows: list[list[float]] = []
    for number, line in body:
        if len(rows) == n:
            break
        values = _numbers(line)
        if values is None or len(values) not in widths or (rows and len(values) != len(rows[0])):
            wanted = len(rows[0]) if rows else " or ".join(map(str, widths))
            raise ModelError(f"{name}, line {number}: {wanted} numbers were expected: {line.strip()[:60]!r}")
        rows.append(values)
    if len(rows) < n or not rows:
        raise ModelError(f"{name}: the table ends after {len(rows)} of {n} lines")
    return np.array(rows)
