"""The operations that expressions of parameters are made of: values and partial derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple


class Op(NamedTuple):
    """An operation: its NumPy name, its value, its partial derivatives, its symbol and precedence in text."""

    name: str
    value: Callable[..., float]
    partials: tuple[Callable[..., float], ...]  # each of (arguments..., value)
    symbol: str = ""
    precedence: int = 5


def _sign(a: float, _: float) -> float:
    if a == 0.0:
        raise ZeroDivisionError("the derivative of abs at 0")
    return math.copysign(1.0, a)


def _greater(a: float, b: float) -> float:
    if a == b:
        raise ZeroDivisionError("the derivative of maximum or minimum where both are equal")
    return 1.0 if a > b else 0.0


def _power(a: float, b: float) -> float:
    # math.pow, unlike **, never returns a complex number for a negative base.
    return math.pow(a, b)


def _power_by_base(a: float, b: float, _: float) -> float:
    return 0.0 if b == 0.0 else b * math.pow(a, b - 1.0)


def _power_by_exponent(a: float, b: float, v: float) -> float:
    return 0.0 if a == 0.0 and b > 0.0 else v * math.log(a)


_LN2, _LN10, _DEGREE = math.log(2.0), math.log(10.0), math.pi / 180.0

_OPS = (
    Op("add", lambda a, b: a + b, (lambda a, b, v: 1.0, lambda a, b, v: 1.0), "+", 1),
    Op("subtract", lambda a, b: a - b, (lambda a, b, v: 1.0, lambda a, b, v: -1.0), "-", 1),
    Op("multiply", lambda a, b: a * b, (lambda a, b, v: b, lambda a, b, v: a), "*", 2),
    Op("divide", lambda a, b: a / b, (lambda a, b, v: 1.0 / b, lambda a, b, v: -v / b), "/", 2),
    Op("negative", lambda a: -a, (lambda a, v: -1.0,), "-", 3),
    Op("power", _power, (_power_by_base, _power_by_exponent), "**", 4),
    Op("abs", abs, (_sign,)),
    Op("sqrt", math.sqrt, (lambda a, v: 0.5 / v,)),
    Op("cbrt", math.cbrt, (lambda a, v: 1.0 / (3.0 * v * v),)),
    Op("square", lambda a: a * a, (lambda a, v: 2.0 * a,)),
    Op("reciprocal", lambda a: 1.0 / a, (lambda a, v: -v * v,)),
    Op("exp", math.exp, (lambda a, v: v,)),
    Op("expm1", math.expm1, (lambda a, v: v + 1.0,)),
    Op("log", math.log, (lambda a, v: 1.0 / a,)),
    Op("log1p", math.log1p, (lambda a, v: 1.0 / (1.0 + a),)),
    Op("log2", math.log2, (lambda a, v: 1.0 / (a * _LN2),)),
    Op("log10", math.log10, (lambda a, v: 1.0 / (a * _LN10),)),
    Op("sin", math.sin, (lambda a, v: math.cos(a),)),
    Op("cos", math.cos, (lambda a, v: -math.sin(a),)),
    Op("tan", math.tan, (lambda a, v: 1.0 + v * v,)),
    Op("arcsin", math.asin, (lambda a, v: 1.0 / math.sqrt(1.0 - a * a),)),
    Op("arccos", math.acos, (lambda a, v: -1.0 / math.sqrt(1.0 - a * a),)),
    Op("arctan", math.atan, (lambda a, v: 1.0 / (1.0 + a * a),)),
    Op("sinh", math.sinh, (lambda a, v: math.cosh(a),)),
    Op("cosh", math.cosh, (lambda a, v: math.sinh(a),)),
    Op("tanh", math.tanh, (lambda a, v: 1.0 - v * v,)),
    Op("radians", math.radians, (lambda a, v: _DEGREE,)),
    Op("degrees", math.degrees, (lambda a, v: 1.0 / _DEGREE,)),
    Op("arctan2", math.atan2, (lambda a, b, v: b / (a * a + b * b), lambda a, b, v: -a / (a * a + b * b))),
    Op("hypot", math.hypot, (lambda a, b, v: a / v, lambda a, b, v: b / v)),
    Op("maximum", max, (lambda a, b, v: _greater(a, b), lambda a, b, v: _greater(b, a))),
    Op("minimum", min, (lambda a, b, v: _greater(b, a), lambda a, b, v: _greater(a, b))),
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
}
