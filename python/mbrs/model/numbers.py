"""From what a user types to lists of numbers and expressions, with errors that name the argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .expressions import Expression
from .names import problem, shown

Number = float | Expression
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def scalar(value: Any, where: str) -> Number:
    """A finite float, or an expression."""
    if type(value) is float or type(value) is int:
        try:
            made = float(value)
        except OverflowError:
            made = math.inf
    elif isinstance(value, Expression):
        return value
    elif isinstance(value, (np.floating, np.integer)):
        made = float(value)
    elif isinstance(value, np.ndarray) and value.ndim == 0:
        return scalar(value.item(), where)
    else:
        raise problem(where, f"must be a real number, got {shown(value)}")
    if not math.isfinite(made):
        raise problem(where, f"must be a finite number, got {shown(value)}")
    return made


def shape_of(value: Any) -> tuple[int, ...]:
    """The shape of numbers, nested sequences, arrays and array parameters; () for anything else."""
    if hasattr(value, "shape"):
        return tuple(value.shape)
    if isinstance(value, (list, tuple)):
        inner = {shape_of(v) for v in value}
        if len(inner) == 1:
            return (len(value), *inner.pop())
        return (len(value),) if not inner else (len(value), -1)
    return ()


def array(value: Any, shape: tuple[int, ...], where: str) -> list[Number]:
    """The numbers of an array argument of the given shape, in C order."""
    # The common case, a tuple of floats, before anything general.
    if len(shape) == 1 and type(value) in (tuple, list) and len(value) == shape[0]:
        return [v if type(v) is float and math.isfinite(v) else scalar(v, where) for v in value]
    got = shape_of(value)
    if got != shape:
        need = " x ".join(map(str, shape))
        have = f"shape {got}" if -1 not in got else "ragged rows"
        what = f"{shown(value)}" if got == () else have
        raise problem(where, f"must be {need} numbers, got {what}")
    flat = np.asarray(value, dtype=object).ravel().tolist()
    return [scalar(v, where) for v in flat]


def vector(value: Any, where: str) -> list[Number]:
    """Three numbers."""
    return array(value, (3,), where)


def axis(value: Any, where: str) -> list[Number]:
    """A direction: "x", "y", "z" (with a sign), or three numbers; its length does not matter but must not be zero."""
    if isinstance(value, str):
        sign = -1.0 if value.startswith("-") else 1.0
        if value.lstrip("+-") not in AXES or len(value) > 2:
            raise problem(
                where, f"must be 'x', 'y', 'z', one of these with a minus, or three numbers, got {shown(value)}"
            )
        return [sign * c if c else 0.0 for c in AXES[value[-1]]]
    made = vector(value, where)
    if not any(isinstance(v, Expression) or v != 0.0 for v in made):
        raise problem(where, "must not be a zero vector: give a direction")
    return made


def is_pair(at: Any) -> bool:
    """True for two points, False for one (or for what is neither)."""
    if type(at) in (tuple, list):
        return len(at) == 2
    shape = shape_of(at)
    return len(shape) == 2 and shape[0] == 2


def point_pair(at: Any, where: str) -> tuple[list[Number], list[Number]]:
    """Two points (P_a, P_b)."""
    if not is_pair(at):
        raise problem(where, "must be two points (P_a, P_b), one on each body")
    return vector(at[0], where + "_a"), vector(at[1], where + "_b")


def numbers(values: Sequence[Number]) -> list[float]:
    """Plain numbers now."""
    return [v if type(v) is float else v.value for v in values]  # type: ignore[union-attr]
