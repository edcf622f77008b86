"""The operations that expressions are made of: names, symbols and arguments. The core computes them (``rust/src/expressions``)."""

from __future__ import annotations

from typing import NamedTuple


class Op(NamedTuple):
    """An operation: its NumPy name, how many arguments it takes, its symbol and precedence in text."""

    name: str
    arity: int
    symbol: str = ""
    precedence: int = 5


_SINGLE = (
    "abs sqrt cbrt square reciprocal exp expm1 log log1p log2 log10 sin cos tan arcsin arccos arctan sinh cosh tanh arcsinh "
    "arccosh arctanh radians degrees sign floor logical_not"
)
_DOUBLE = "arctan2 hypot maximum minimum less less_equal equal logical_and logical_or"
_OPS = (
    Op("add", 2, "+", 1),
    Op("subtract", 2, "-", 1),
    Op("multiply", 2, "*", 2),
    Op("divide", 2, "/", 2),
    Op("negative", 1, "-", 3),
    Op("power", 2, "**", 4),
    *(Op(name, 1) for name in _SINGLE.split()),
    *(Op(name, 2) for name in _DOUBLE.split()),
    Op("where", 3),
)
OPS: dict[str, Op] = {op.name: op for op in _OPS}
FUNCTIONS: dict[str, Op] = {op.name: op for op in _OPS if not op.symbol}
UFUNC_ALIAS = {
    "absolute": "abs",
    "fabs": "abs",
    "true_divide": "divide",
    "float_power": "power",
    "deg2rad": "radians",
    "rad2deg": "degrees",
    "fmax": "maximum",
    "fmin": "minimum",
    "bitwise_and": "logical_and",
    "bitwise_or": "logical_or",
    "invert": "logical_not",
}
