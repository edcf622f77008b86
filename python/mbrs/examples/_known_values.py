"""A table of found values beside known ones, with which examples end."""

from collections.abc import Iterable
from typing import Any

from .._lib.text import table


def error_table(rows: Iterable[tuple[Any, ...]]) -> str:
    """A table of values that were found beside known ones, with errors relative to the known ones.

    Parameters
    ----------
    rows
        (quantity, found, known, where the known value is from[, scale]). Errors are relative to ``scale`` where it is given; a known
        value of zero leaves them as they are.

    Returns
    -------
    str

    Examples
    --------
    >>> import mbrs as mb
    >>> print(mb.examples.error_table([("pi", 22 / 7, 3.141592653589793, "closed form")]))
    <BLANKLINE>
    quantity        found    reference  relative error  reference from
    ------------------------------------------------------------------
    pi        3.142857143  3.141592654         4.0e-04  closed form
    """
    cells = []
    for what, found, known, source, *scale in rows:
        error = abs(found - known) / (scale[0] if scale else abs(known) or 1.0)
        cells.append([what, f"{found:.10g}", f"{known:.10g}", f"{error:.1e}", source])
    return "\n" + table(["quantity", "found", "reference", "relative error", "reference from"], cells, width=140)
