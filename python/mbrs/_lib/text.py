"""Tables as readable text and as HTML for notebooks. Functions of columns and rows; nothing here knows an analysis."""

from __future__ import annotations

import html
import math
import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ModelError

__all__ = ["Block", "counted", "html_table", "number", "si", "table", "without_rounding"]

# Part of the scale of a table below which a number is rounding: some dozen operations. Larger, small answers print as 0;
# smaller, rounding prints as numbers (tests/view/test_report.py).
ROUNDING = 64 * float(np.finfo(float).eps)

_ABSENT = "-"
_GAP = 2
_NUMBER = re.compile(r"[+-]?\d+\.?\d*(e[+-]?\d+)?")
_MIN_TEXT = 8
_PREFIXES = {-5: "f", -4: "p", -3: "n", -2: "u", -1: "m", 0: "", 1: "k", 2: "M", 3: "G", 4: "T", 5: "P"}


def number(value: Any, digits: int = 6) -> str:
    """One value as text: about ``digits`` significant digits, nan and None as ``-``, complex as ``a + bi``.

    Parameters
    ----------
    value
        Anything; numbers are formatted, the rest goes through ``str``. Arrays become ``[a, b, ...]``.
    digits
        Significant digits of a float; trailing zeros are dropped.

    Examples
    --------
    >>> number(15.915494309), number(float("nan")), number(1 - 2.5j), number(True)
    ('15.9155', '-', '1 - 2.5i', 'yes')
    """
    if value is None:
        return _ABSENT
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return _real(float(value), digits)
    if isinstance(value, complex | np.complexfloating):
        return _complex(complex(value), digits)
    if isinstance(value, np.ndarray):
        return _array(value, digits)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(number(one, digits) for one in value) + "]"
    return str(value)


def _real(value: float, digits: int) -> str:
    if math.isnan(value):
        return _ABSENT
    return f"{value + 0.0:.{digits}g}"  # + 0.0 turns -0 into 0


def _complex(value: complex, digits: int) -> str:
    if math.isnan(value.real) or math.isnan(value.imag):
        return _ABSENT
    sign = "-" if value.imag < 0 else "+"
    return f"{_real(value.real, digits)} {sign} {_real(abs(value.imag), digits)}i"


def _array(value: np.ndarray, digits: int) -> str:
    if value.ndim == 0:
        return number(value.item(), digits)
    if value.size > 8:
        return f"array {' x '.join(str(n) for n in value.shape)}"
    return "[" + ", ".join(number(one, digits) for one in value.tolist()) + "]"


def counted(n: int, what: str) -> str:
    """A number of things: ``counted(1, "mode")`` is ``1 mode``.

    Examples
    --------
    >>> counted(1, "body"), counted(3, "body"), counted(0, "spring or damper")
    ('1 body', '3 bodies', '0 springs or dampers')
    """
    if n == 1:
        return f"1 {what}"
    first, *rest = what.split(" or ")
    ends = [
        one.removesuffix("y") + "ies" if one.endswith("ody") or one.endswith("ency") else f"{one}s"
        for one in (first, *rest)
    ]
    return f"{n} {' or '.join(ends)}"


def si(value: float, unit: str, digits: int = 4) -> str:
    """A value with an engineering prefix: ``si(1.5e5, "N/m")`` is ``150 kN/m``.

    Parameters
    ----------
    value
        Real number in the plain unit.
    unit
        Unit symbol. Units that start with a power or with "1/" get an exponent instead of a prefix, since a prefix
        would be ambiguous there; so does an empty unit, and ``kg``, which has a prefix of its own.
    digits
        Significant digits.

    Examples
    --------
    >>> si(1.5e5, "N/m"), si(0.0021, "s"), si(float("nan"), "Hz"), si(0.15, "kg m^2")
    ('150 kN/m', '2.1 ms', '-', '0.15 kg m^2')
    """
    value = float(value)
    if math.isnan(value):
        return _ABSENT
    if not unit:
        return _real(value, digits)
    plain = unit.startswith(("1/", "kg", "%")) or "^" in unit.split("/")[0].split(" ")[0]
    if plain or value == 0.0 or math.isinf(value):
        return f"{_real(value, digits)} {unit}"
    rounded = float(f"{abs(value):.{digits - 1}e}")  # 999.97 m is 1 km, not 1000 m
    group = math.floor(math.log10(rounded) / 3.0 + 1e-12)
    group = min(max(group, min(_PREFIXES)), max(_PREFIXES))
    return f"{_real(value / 1000.0**group, digits)} {_PREFIXES[group]}{unit}"


def without_rounding(values: Any, scale: Any = None, error: float = 0.0) -> np.ndarray:
    """Numbers of one unit as tables show them: 0 where they are rounding.

    Parameters
    ----------
    values
        Array of numbers that have one unit.
    scale
        Size of what was added up in them, a number or an array that broadcasts; the largest finite entry by default.
    error
        Stated relative error, where it is more than rounding.

    Examples
    --------
    >>> without_rounding([8e-5, -5.6e-21]).tolist()
    [8e-05, 0.0]
    """
    array = np.asarray(values)
    size = np.abs(array)
    if scale is None:
        scale = np.max(size, where=np.isfinite(size), initial=0.0)
    limit = max(ROUNDING, error if math.isfinite(error) else 0.0)
    return np.asarray(np.where(size <= limit * np.asarray(scale), np.zeros_like(array), array))


@dataclass(frozen=True)
class Block:
    """One table of a result: columns, rows, a line above and lines below, as text and as HTML. Without columns: only text."""

    columns: Sequence[str] = ()
    rows: Sequence[Sequence[Any]] = ()
    title: str | None = None
    footer: str | None = None
    digits: int = 6

    def text(self) -> str:
        """For a terminal."""
        if not self.columns or not self.rows:
            return "\n".join(filter(None, [self.title, self.footer]))
        return table(self.columns, self.rows, self.title, self.footer, digits=self.digits)

    def html(self) -> str:
        """For a notebook or a page."""
        if not self.columns or not self.rows:
            lines = filter(None, [self.title, self.footer])
            return "".join(f"<p>{html.escape(line)}</p>".replace("\n", "<br>") for line in lines)
        return html_table(self.columns, self.rows, self.title, self.footer, digits=self.digits)


@dataclass(frozen=True)
class _Column:
    head: str
    cells: list[str]
    right: bool

    def width(self) -> int:
        return max([len(self.head), *(len(cell) for cell in self.cells)])


def table(
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    title: str | None = None,
    footer: str | None = None,
    *,
    digits: int = 6,
    width: int | None = None,
    max_rows: int | None = 60,
) -> str:
    """Columns and rows as plain text.

    A column of numbers is right-aligned with one number of decimals, so that magnitudes can be compared by eye; where
    its values span too many decades it falls back to scientific notation. nan and None print as ``-``. A table wider
    than the terminal has its long texts shortened, then is folded into blocks that repeat the first column.

    Parameters
    ----------
    columns
        Headings, (n_columns,); put the unit there: ``"f [Hz]"``.
    rows
        Iterable of sequences of n_columns values: str, int, float, complex, bool, None, arrays.
    title, footer
        A line above, lines below.
    digits
        Significant digits of the largest value of a column.
    width
        Characters per line; None takes the terminal's, or 120 where there is none.
    max_rows
        Longer tables show their first and last rows and say how many there are; None shows all.

    Raises
    ------
    ModelError
        A row whose length differs from the number of columns.

    Examples
    --------
    >>> print(table(["mode", "f [Hz]", "zeta"], [[1, 15.9155, 0.015], [2, 36.7553, float("nan")]]))
    mode   f [Hz]   zeta
    --------------------
       1  15.9155  0.015
       2  36.7553      -
    """
    shown, cut = _limited(_checked_rows(columns, rows), max_rows)
    if width is None:
        width = shutil.get_terminal_size((120, 24)).columns
    parts = [] if title is None else [title]
    parts += [_block(one) for one in _folded(_shortened(_columns(columns, shown, digits, cut), width), width)]
    if cut:
        parts.append(f"({cut[1]} rows, {cut[2]} of them not shown)")
    if footer:
        parts.append(footer)
    return "\n".join(parts)


def html_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    title: str | None = None,
    footer: str | None = None,
    *,
    digits: int = 6,
    max_rows: int | None = 200,
) -> str:
    """The same table as an HTML fragment (for ``_repr_html_`` and pages). Arguments as in `table`; text is escaped.

    Examples
    --------
    >>> html_table(["f [Hz]"], [[15.9155]]).startswith('<table class="mbrs">')
    True
    """
    shown, cut = _limited(_checked_rows(columns, rows), max_rows)
    built = _columns(columns, shown, digits, cut)
    style = ["text-align:right;font-variant-numeric:tabular-nums" if c.right else "text-align:left" for c in built]
    head = "".join(f'<th style="{s}">{html.escape(c.head)}</th>' for s, c in zip(style, built, strict=True))
    lines = [
        "<tr>"
        + "".join(f'<td style="{s}">{html.escape(c.cells[i])}</td>' for s, c in zip(style, built, strict=True))
        + "</tr>"
        for i in range(len(built[0].cells) if built else 0)
    ]
    caption = "" if title is None else f"<caption>{html.escape(title)}</caption>"
    note = f"({cut[1]} rows, {cut[2]} of them not shown) " if cut else ""
    below = note + (footer or "")
    foot = f'<p class="mbrs-note">{html.escape(below).replace(chr(10), "<br>")}</p>' if below else ""
    return f'<table class="mbrs">{caption}<thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table>{foot}'


def _checked_rows(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> list[list[Any]]:
    out = [list(row) for row in rows]
    for i, row in enumerate(out):
        if len(row) != len(columns):
            raise ModelError(f"row {i} of the table has {len(row)} values, but there are {len(columns)} columns")
    return out


def _limited(rows: list[list[Any]], max_rows: int | None) -> tuple[list[list[Any]], tuple[int, int, int] | None]:
    """The rows to show, and where the gap is: (its place, number of rows, number of rows left out)."""
    if max_rows is None or len(rows) <= max_rows:
        return rows, None
    first = max(1, (2 * max_rows) // 3)
    last = max(0, max_rows - first)
    return rows[:first] + rows[len(rows) - last :], (first, len(rows), len(rows) - first - last)


def _columns(
    heads: Sequence[str], rows: list[list[Any]], digits: int, cut: tuple[int, int, int] | None
) -> list[_Column]:
    out = []
    for j, head in enumerate(heads):
        values = [row[j] for row in rows]
        cells = _cells(values, digits)
        if cut:
            cells.insert(cut[0], "...")
        out.append(_Column(str(head), cells, _is_numeric(values)))
    return out


def _is_numeric(values: list[Any]) -> bool:
    """True where every value is a number, reads like one, or is absent."""
    return all(_like_number(v) for v in values)


def _like_number(value: Any) -> bool:
    if isinstance(value, str):
        return value in ("", _ABSENT) or _NUMBER.fullmatch(value) is not None
    return value is None or (isinstance(value, int | float | complex | np.number) and not isinstance(value, bool))


def _cells(values: list[Any], digits: int) -> list[str]:
    reals = [v for v in values if isinstance(v, float | np.floating)]
    if not reals:
        return [number(v, digits) for v in values]
    decimals = _decimals([abs(float(v)) for v in reals], digits)
    if decimals is None:
        return [number(v, digits) for v in values]
    return [_fixed(v, decimals) if isinstance(v, float | np.floating) else number(v, digits) for v in values]


def _decimals(sizes: list[float], digits: int) -> int | None:
    """Number of decimals that suits all of these, or None if there is no such number."""
    used = [s for s in sizes if s > 0.0 and math.isfinite(s)]
    if not used:
        return 0
    high, low = math.floor(math.log10(max(used))), math.floor(math.log10(min(used)))
    if high > 6 or low < -4 or high - low > 4:
        return None
    decimals = max(digits - 1 - high, 3 - low, 0)
    texts = [f"{s:.{decimals}f}" for s in used]
    if decimals == 0:
        return 0
    spare = min(len(t) - len(t.rstrip("0")) for t in texts)
    return decimals - min(spare, decimals)


def _fixed(value: Any, decimals: int) -> str:
    value = float(value)
    if not math.isfinite(value):
        return _real(value, 3)
    return "0" if value == 0.0 else f"{value:.{decimals}f}"


def _shortened(columns: list[_Column], width: int) -> list[_Column]:
    """Cut the longest texts while the table is wider than the line; numbers are never cut."""
    limits = [c.width() for c in columns]
    least = sum(limit if c.right else min(limit, _MIN_TEXT) for c, limit in zip(columns, limits, strict=True))
    if least + _GAP * (len(limits) - 1) > width:
        # it has to be folded anyway, so the texts may stay readable
        limits = [
            limit if c.right else min(limit, max(width // 3, _MIN_TEXT))
            for c, limit in zip(columns, limits, strict=True)
        ]
        return [_clipped(c, limit) for c, limit in zip(columns, limits, strict=True)]
    while sum(limits) + _GAP * (len(limits) - 1) > width:
        texts = [j for j, c in enumerate(columns) if not c.right and limits[j] > _MIN_TEXT]
        if not texts:
            break
        limits[max(texts, key=lambda j: limits[j])] -= 1
    return [_clipped(c, limit) for c, limit in zip(columns, limits, strict=True)]


def _clipped(column: _Column, limit: int) -> _Column:
    def clip(text: str) -> str:
        return text if len(text) <= limit else text[: max(limit - 3, 1)] + "..."

    return _Column(clip(column.head), [clip(cell) for cell in column.cells], column.right)


def _folded(columns: list[_Column], width: int) -> list[list[_Column]]:
    """Blocks of columns that fit the line, each beginning with the first column."""
    if not columns:
        return []
    blocks, block = [], [columns[0]]
    for column in columns[1:]:
        used = sum(c.width() + _GAP for c in block)
        if used + column.width() > width and len(block) > 1:
            blocks.append(block)
            block = [columns[0]]
        block.append(column)
    return [*blocks, block]


def _block(columns: list[_Column]) -> str:
    widths = [c.width() for c in columns]

    def line(texts: Iterable[str]) -> str:
        cells = (t.rjust(w) if c.right else t.ljust(w) for t, w, c in zip(texts, widths, columns, strict=True))
        return (" " * _GAP).join(cells).rstrip()

    rule = "-" * (sum(widths) + _GAP * (len(widths) - 1))
    body = [line(c.cells[i] for c in columns) for i in range(len(columns[0].cells))]
    return "\n".join([line(c.head for c in columns), rule, *body])


def unit_note(labels: Sequence[str], units: Sequence[str]) -> str | None:
    """A line for below a table: which parameters have no unit; None where all have one."""
    blank = [label for label, unit in zip(labels, units, strict=True) if not unit]
    if not blank:
        return None
    named = ", ".join(blank[:4]) + (f" and {len(blank) - 4} more" if len(blank) > 4 else "")
    return f"no unit was given for {named}; pass unit= to m.parameter"
