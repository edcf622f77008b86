"""Design parameters: named numbers or arrays of them, flattened in the order of definition to one vector V."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from .._lib.checks import UNFIT
from ..errors import ModelError
from .expressions import Expression, Symbol, apply_ufunc
from .names import problem, shown


class ParameterSpace:
    """All parameters of one model. ``values`` is the flat V; ``version`` rises whenever a value changes."""

    traced = False

    def __init__(self) -> None:
        self.names: dict[str, tuple[int, tuple[int, ...]]] = {}
        self.units: dict[str, str] = {}
        self.values: list[float] = []
        self.symbols: list[Symbol] = []
        self.version = 0

    def __getstate__(self) -> dict[str, Any]:
        return {"names": self.names, "units": self.units, "values": self.values, "version": self.version}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.symbols = []
        for name, (_, shape) in self.names.items():
            self._add_symbols(name, shape)

    def add(self, name: str, value: Any, unit: str = "") -> Symbol | ArrayParameter:
        """A new parameter; the caller has checked the name."""
        array = checked(name, value, None)
        self.units[name] = unit
        self.names[name] = (len(self.values), array.shape)
        self.values.extend(array.ravel().tolist())
        self._add_symbols(name, array.shape)
        return self.handle(name)

    def _add_symbols(self, name: str, shape: tuple[int, ...]) -> None:
        for label in labels(name, shape):
            self.symbols.append(Symbol(self, len(self.symbols), label))

    def unit_of(self, place: int) -> str:
        """The label that a place in V was given."""
        return self.units[self.symbols[place].label.partition("[")[0]]

    def handle(self, name: str) -> Symbol | ArrayParameter:
        """The value that `Model.parameter` returned."""
        start, shape = self.names[name]
        return self.symbols[start] if shape == () else ArrayParameter(self, name, start, shape)

    def captured(self, expression: Expression) -> Symbol:
        """Only a traced function takes expressions of another space."""
        raise ModelError(f"the expression {expression} belongs to another model")

    def assign(self, start: int, values: Sequence[float]) -> None:
        """Overwrite part of V."""
        self.values[start : start + len(values)] = values
        self.version += 1


def labels(name: str, shape: tuple[int, ...]) -> list[str]:
    """``name`` or ``name[i,j]`` for every entry, in C order."""
    if shape == ():
        return [name]
    return [f"{name}[{','.join(map(str, index))}]" for index in np.ndindex(shape)]


def checked(name: str, value: Any, shape: tuple[int, ...] | None) -> np.ndarray:
    """A finite float array of the given shape (any shape, but not empty, for None)."""
    if type(value) is float and shape in (None, ()) and math.isfinite(value):
        return np.array(value)
    if isinstance(value, (Expression, ArrayParameter)):
        raise problem(name, "is a parameter: its value must be plain numbers, not an expression of other parameters")
    try:
        array = np.asarray(value)
        numeric = array.dtype.kind in "fiu"
        array = array.astype(float) if numeric else array
    except UNFIT:
        numeric = False
    if not numeric:
        raise problem(name, f"must be a real number or an array of real numbers, got {shown(value)}")
    if shape is not None and array.shape != shape:
        raise problem(name, f"has the shape {shape}, got a value of shape {array.shape}")
    if array.size == 0:
        raise problem(name, "must not be an empty array")
    if not np.all(np.isfinite(array)):
        raise problem(name, f"must be finite, got {shown(value)}")
    return array


class ArrayParameter(np.lib.mixins.NDArrayOperatorsMixin):
    """An array-valued parameter. Entries and arithmetic give (arrays of) expressions; derivatives keep its shape."""

    __slots__ = ("name", "shape", "space", "start")

    def __init__(self, space: ParameterSpace, name: str, start: int, shape: tuple[int, ...]) -> None:
        self.space, self.name, self.start, self.shape = space, name, start, shape

    @property
    def size(self) -> int:
        """Number of entries."""
        return math.prod(self.shape)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def value(self) -> np.ndarray:
        """The numbers now, a copy."""
        return np.array(self.space.values[self.start : self.start + self.size]).reshape(self.shape)

    @property
    def symbols(self) -> np.ndarray:
        """The entries as an object array of expressions, a copy."""
        out = np.empty(self.size, dtype=object)
        out[:] = self.space.symbols[self.start : self.start + self.size]
        return out.reshape(self.shape)

    @property
    def T(self) -> np.ndarray:
        """The transposed array of expressions."""
        return self.symbols.T

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if dtype is not None and np.dtype(dtype) != np.dtype(object):
            raise TypeError(
                f"the parameter {shown(self.name)} cannot become an array of {np.dtype(dtype)}; take its .value"
            )
        return self.symbols

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [a.symbols if isinstance(a, ArrayParameter) else a for a in inputs]
        return apply_ufunc(ufunc, method, plain, options)

    def __getitem__(self, index: Any) -> Any:
        try:
            return self.symbols[index]
        except IndexError as reason:
            raise ModelError(f"the parameter {shown(self.name)} has the shape {self.shape}: {reason}") from None

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.symbols)

    def __repr__(self) -> str:
        return f"<parameter {self.name}, shape {self.shape}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _handle, (self.space, self.name)


def _handle(space: ParameterSpace, name: str) -> Any:
    return space.handle(name)
