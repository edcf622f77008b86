"""Checks of plain arguments: each returns the value as what it should be, or raises an error that names the argument."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from types import FrameType
from typing import Any

import numpy as np

from ..errors import ModelError

# what Python and NumPy raise for values that cannot be numbers of the wanted kind
UNFIT = (TypeError, ValueError, OverflowError)
LARGEST = 1e150  # its square is still a number


def shown(value: Any, most: int = 80) -> str:
    """A value in a message, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a repr of the user's own may fail, and must not hide the error
        text = f"a {type(value).__name__}"
    return text if len(text) <= most else text[: most - 3] + "..."


def count(name: str, value: Any, most: int, least: int = 1) -> int:
    """An integer from ``least`` to ``most``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise ModelError(f"{name} must be an integer from {least} to {most}, it is {shown(value)}")
    return int(value)


def positive(name: str, value: Any) -> float:
    """A positive finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0 < value < np.inf:
        raise ModelError(f"{name} must be a positive number, it is {shown(value)}")
    return float(value)


def flag(name: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, bool | np.bool_):
        raise ModelError(f"{name} must be True or False, it is {shown(value)}")
    return bool(value)


def is_word(value: Any, known: Iterable[str]) -> bool:
    """True for one of some words; the value may be anything."""
    return isinstance(value, str) and value in known


def is_list(value: Any) -> bool:
    """True for what can be gone through; the value may be anything, and arrays without dimensions cannot."""
    return isinstance(value, Iterable) and getattr(value, "ndim", 1) != 0


def choice(name: str, value: Any, known: Sequence[str]) -> str:
    """One of some words."""
    if not is_word(value, known):
        words = ", ".join(f'"{word}"' for word in known)
        raise ModelError(f"there is no {name} {shown(value)}; known are {words}")
    return value


def names(name: str, value: Any) -> tuple[str, ...]:
    """A sequence of names."""
    if isinstance(value, np.ndarray):
        value = value.ravel().tolist()
    if isinstance(value, str) or not isinstance(value, Iterable) or not all(isinstance(v, str) for v in list(value)):
        raise ModelError(f'{name} must be a list of names, such as ["gravity"], it is {shown(value)}')
    return tuple(value)


def one_or_names(name: str, value: Any) -> tuple[str, ...]:
    """A name, or a sequence of names."""
    return (value,) if isinstance(value, str) else names(name, value)


def real_array(name: str, value: Any) -> np.ndarray:
    """An array of finite real numbers, of any shape."""
    array = complex_array(name, value)
    if np.iscomplexobj(np.asarray(value)):
        raise ModelError(f"{name} must hold real numbers, it is {shown(value)}")
    return array.real.copy()


def rising_times(name: str, value: Any, least: int = 3) -> np.ndarray:
    """At least so many times, one after the other."""
    array = real_array(name, value)
    if array.ndim != 1 or len(array) < least or np.any(np.diff(array) <= 0.0):
        raise ModelError(f"{name} must be at least {least} times that increase, it is {shown(value)}")
    return array


def sized_array(name: str, value: Any, largest: float = 1e60) -> np.ndarray:
    """An array of real numbers of sizes whose products can still be computed with."""
    array = real_array(name, value)
    if np.max(np.abs(array), initial=0.0) > largest:
        raise ModelError(f"{name} must not exceed {largest:g}; check the units")
    return array


def each(name: str, value: Any, n: int, things: str) -> np.ndarray:
    """One real number for each of ``n`` things, of which a single number is the same for all."""
    array = real_array(name, value)
    if array.ndim == 0:
        return np.full(n, float(array))
    if array.shape != (n,):
        raise ModelError(f"{name} must be one number or one for each of {n} {things}, its shape is {array.shape}")
    return array


def complex_array(name: str, value: Any) -> np.ndarray:
    """An array of finite numbers, real or complex, of any shape."""
    try:
        if np.asarray(value).dtype.kind in "USmM":
            raise TypeError  # NumPy would read numbers from text
        array = np.asarray(value, dtype=complex)
    except UNFIT:
        raise ModelError(f"{name} must hold numbers, it is {shown(value)}") from None
    if not np.all(np.isfinite(array)):
        raise ModelError(f"{name} contains NaN or infinite entries")
    return array


def user_level() -> int:
    """The ``stacklevel`` of a warning, given where this is called, that shows the user's own line."""
    frame: FrameType | None = sys._getframe(1)
    level = 1
    while frame is not None and str(frame.f_globals.get("__name__", "")).startswith("mbrs."):
        frame, level = frame.f_back, level + 1
    return level
