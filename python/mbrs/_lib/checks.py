"""Checks of plain arguments: each returns the value as what it should be, or raises an error that names the argument."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ModelError

# what Python and NumPy raise for values that cannot be numbers of the wanted kind
UNFIT = (TypeError, ValueError, OverflowError)
LARGEST = 1e150  # its square is still a number
_LARGE = 1_000_000  # numbers of an array that asks for its memory first


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
    made = _one(name, value)
    if made is None or made <= 0.0:
        raise ModelError(f"{name} must be a positive number, it is {shown(value)}")
    return made


def real_number(name: str, value: Any, least: float = -np.inf, most: float = np.inf, give: str = "") -> float:
    """A finite number within limits that belong to it."""
    made = _one(name, value)
    if made is None or not least <= made <= most:
        limits = (
            "" if least == -np.inf else f" of at least {least:g}" if most == np.inf else f" from {least:g} to {most:g}"
        )
        raise ModelError(f"{name} must be a finite number{limits}, it is {shown(value)}{_after(give)}")
    return made


def _one(name: str, value: Any) -> float | None:
    """A finite number, or None."""
    try:
        return None if isinstance(value, bool | np.bool_) else float(real_array(name, value, ()))
    except ModelError:
        return None


def path(name: str, value: Any) -> Path:
    """The path of a file."""
    try:
        made = Path(value)
        if "\0" in str(made):
            raise ValueError("a null byte")
    except UNFIT:
        raise ModelError(f"{name} must be the path of a file, text or pathlib.Path, it is {shown(value)}") from None
    return made


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


def members(value: Any) -> list[Any]:
    """Members of a list; none of a text, or of what is not a list."""
    return list(value) if is_list(value) and not isinstance(value, str) else []


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


def real_array(name: str, value: Any, shape: Sequence[int | str] | None = None, give: str = "") -> np.ndarray:
    """A new array of finite real numbers, of any shape or of one of which words stand for lengths that are not known.

    ``give``: what to give instead, for the end of a message ("give 3 coordinates in m"). Sparse matrices come out dense.
    """
    return _fitting(name, _numbers(name, value, float, give), shape, give)


def rising(name: str, value: Any, least: int = 3, things: str = "times in s") -> np.ndarray:
    """At least so many times (or other things), one after the other."""
    row = f"a row of {'one or more' if least == 1 else f'at least {least}'} {things} that increase"
    array = real_array(name, value, None, f"give {row}")
    if array.ndim != 1 or len(array) < least or np.any(np.diff(array) <= 0.0):
        raise ModelError(f"{name} must be {row}, it is {shown(value)}")
    return array


def two_ends(name: str, value: Any, of: str = "numbers") -> tuple[float, float]:
    """The two different ends of a range."""
    low, high = real_array(name, value, (2,), f"give a range of two different {of}")
    if low == high:
        raise ModelError(f"{name} must be a range of two different {of}, it is {shown(value)}")
    return float(low), float(high)


def sized_array(
    name: str, value: Any, shape: Sequence[int | str] | None = None, largest: float = 1e60, give: str = ""
) -> np.ndarray:
    """An array of real numbers of sizes whose products can still be computed with."""
    array = real_array(name, value, shape, give)
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


def complex_array(name: str, value: Any, shape: Sequence[int | str] | None = None, give: str = "") -> np.ndarray:
    """An array of finite numbers, real or complex, as `real_array`."""
    return _fitting(name, _numbers(name, value, complex, give), shape, give)


def _numbers(name: str, value: Any, kind: type, give: str) -> np.ndarray:
    """A new array of the kind, from what holds numbers: no text, no times, no rows of different lengths."""
    array = _read(value)
    is_complex = array.dtype.kind == "c" and kind is float
    if array.size > _LARGE:
        from .border import require_memory  # the core; drawing a model does without it

        require_memory(2.0 * array.size * np.dtype(kind).itemsize, f"{name} of {array.size} numbers", "give fewer")
    if array.dtype.kind in "biufcO" and not is_complex:
        try:
            return array.astype(kind)
        except UNFIT:
            pass
    what = "real numbers and is complex" if is_complex else "numbers"
    raise ModelError(f"{name} must hold {what}, got {shown(value)}{_after(give)}")


def _read(value: Any) -> np.ndarray:
    """The array that NumPy makes of it; text where it can make none."""
    try:
        return np.asarray(value.toarray() if hasattr(value, "toarray") else value)
    except UNFIT:
        return np.asarray("")


def _fitting(name: str, array: np.ndarray, shape: Sequence[int | str] | None, give: str) -> np.ndarray:
    """The array, if it has the shape and finite entries."""
    if shape is not None and (
        array.ndim != len(shape)
        or any(n < 1 if isinstance(want, str) else n != want for n, want in zip(array.shape, shape, strict=True))
    ):
        wanted = (
            f"have the shape ({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
            if shape
            else "be one number"
        )
        raise ModelError(f"{name} must {wanted}, its shape is {array.shape}{_after(give)}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        place = f" at [{', '.join(map(str, bad[0]))}]" if array.ndim else ""
        first = array[tuple(bad[0])]
        first = first if first.imag else first.real
        raise ModelError(f"{name} contains NaN or infinite entries, {first}{place}{_after(give)}")
    return array


def _after(give: str) -> str:
    return f"; {give}" if give else ""
