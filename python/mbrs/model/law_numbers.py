"""Checks of the numbers and directions of laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._lib.checks import is_list, real_array, real_number, shown
from ..errors import ModelError


def is_plain(value: Any) -> bool:
    """True for a number that is not a parameter."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def number(value: Any) -> float:
    """The number now."""
    return float(value) if is_plain(value) else float(getattr(value, "value", value))


def scalar(law: str, name: str, value: Any) -> Any:
    """A finite number or a parameter."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if is_plain(value):
        return real_number(f"{law}: {name}", value)
    if not isinstance(getattr(value, "value", None), float):
        raise ModelError(f"{law}: {name} must be a number or a parameter, it is {shown(value)}")
    return value


def positive(law: str, name: str, value: Any) -> Any:
    """A positive finite number or a parameter."""
    value = scalar(law, name, value)
    if is_plain(value) and value <= 0:
        raise ModelError(f"{law}: {name} must be positive, it is {value}")
    return value


def sequence(law: str, name: str, values: Any) -> list[Any]:
    """Numbers or parameters in a sequence."""
    listed = is_list(values) and isinstance(values, Sequence | np.ndarray) and not isinstance(values, str | bytes)
    if not listed or len(values) == 0:
        raise ModelError(f"{law}: {name} must be a sequence of numbers, it is {shown(values)}")
    return [scalar(law, f"{name}[{i}]", value) for i, value in enumerate(values)]


def direction(law: str, w: Any) -> np.ndarray:
    """A direction (n,) that is not zero, read only."""
    w = w.toarray().ravel() if hasattr(w, "toarray") else w
    made = real_array(f"{law}: w", w, ("n",), "give one number for each coordinate")
    if not made.any():
        raise ModelError(f"{law}: w is zero: the element would act on nothing; name the coordinate it works on")
    made.setflags(write=False)
    return made


def directions(law: str, w: Any) -> np.ndarray:
    """Directions (m, n) of m coordinates, none of which is zero, read only."""
    w = w.toarray() if hasattr(w, "toarray") else w
    made = real_array(f"{law}: w", w, ("m", "n"), "give one row for each coordinate of the law")
    for row in made:
        direction(law, row)
    made.setflags(write=False)
    return made
