"""Tables of numbers as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any


def cell(value: Any) -> str:
    if isinstance(value, float):
        if math.isnan(value):
            return "-"
        small = abs(value) < 1e-6
        return "0" if value == 0.0 else f"{value:.1e}" if small else f"{value:.6g}"
    return str(value)


def table(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    cells = [list(columns), *([cell(c) for c in row] for row in rows)]
    widths = [max(len(row[j]) for row in cells) for j in range(len(columns))]
    return "\n".join("  ".join(c.rjust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in cells)
