"""Running one analysis several times: what studies share."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Mapping
from typing import Any

from ..errors import MbrsError

__all__ = ["name_of", "short", "timed"]


def timed(
    fun: Callable[..., Any], args: Any, keywords: Mapping[str, Any], repeat: int
) -> tuple[Any, float, float, str]:
    """The last result, the best and the total wall time, and how it ended. Errors of mbrs are kept, others are bugs."""
    best, spent, result = math.inf, 0.0, None
    for _ in range(repeat):
        start = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # one warning per repeat and setting would hide the table
                result = fun(*args, **keywords)
        except MbrsError as problem:
            return None, time.perf_counter() - start, spent + time.perf_counter() - start, f"failed: {problem}"
        one = time.perf_counter() - start
        best, spent = min(best, one), spent + one
    return result, best, spent, str(getattr(result, "status", "done"))


def short(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1e}"


def name_of(measure: Callable[..., Any]) -> str:
    lines = (measure.__doc__ or "").strip().splitlines()
    return lines[0].rstrip(".") if lines else getattr(measure, "__name__", "given measure")
