"""What the nonlinear examples print at the end: found values beside reference values."""

from collections.abc import Iterable
from typing import Any

from mbrs._lib.text import table


def error_table(rows: Iterable[tuple[Any, ...]]) -> str:
    """Rows of (quantity, found, reference, where the reference is from[, scale]) with errors relative to the reference,
    to ``scale`` where it is given; a reference of zero leaves them as they are."""
    cells = []
    for what, found, known, source, *scale in rows:
        error = abs(found - known) / (scale[0] if scale else abs(known) or 1.0)
        cells.append([what, f"{found:.10g}", f"{known:.10g}", f"{error:.1e}", source])
    return "\n" + table(["quantity", "found", "reference", "relative error", "reference from"], cells, width=140)
