"""Expressions as text: "2*k_leg + 1", "V[0,1]*sin(angle)"; names that are not identifiers are quoted: "2*'leg k'".

Numbers, parameters, + - * / **, unary minus, parentheses and the NumPy functions of `mbrs.model.expressions`; nothing else is
read, and nothing is ever executed.
"""

from __future__ import annotations

import ast
import math
from typing import Any

from .._lib.checks import UNFIT
from ..errors import ModelError
from .expressions import combine
from .names import nearest, not_found, shown
from .operations import FUNCTIONS
from .parameters import ArrayParameter, ParameterSpace

_BINARY = {ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply", ast.Div: "divide", ast.Pow: "power"}
_CONSTANTS = {"pi": math.pi}


class GrammarError(ModelError):
    """A text that is not an expression. ``column`` counts from 1 within the text."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


def parse(text: str, space: ParameterSpace) -> Any:
    """A number, an expression or, for a whole array parameter, that parameter."""
    try:
        text = text.strip()
        tree = ast.parse(text, mode="eval")
        return _read(tree.body, text, space)
    except SyntaxError as reason:
        # Python reports offset 0 where the text ends too early.
        raise GrammarError(
            f"cannot read the expression {shown(text)}: {reason.msg}", reason.offset or len(text) + 1
        ) from None
    except (RecursionError, MemoryError):
        raise GrammarError("the expression is nested too deeply to be read; split it with parameters", 1) from None
    except ValueError as reason:
        if isinstance(reason, ModelError):
            raise
        raise GrammarError(f"cannot read the expression {shown(text)}: {reason}", 1) from None


def _read(node: ast.AST, text: str, space: ParameterSpace) -> Any:
    if isinstance(node, ast.Constant):
        return _constant(node, text, space)
    if isinstance(node, ast.Name):
        return _named(node.id, node, text, space)
    if isinstance(node, ast.Subscript):
        return _entry(node, text, space)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        inner = _read(node.operand, text, space)
        return inner if isinstance(node.op, ast.UAdd) else _apply("negative", [inner], node, text)
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        sides = [_read(side, text, space) for side in (node.left, node.right)]
        return _apply(_BINARY[type(node.op)], sides, node, text)
    if isinstance(node, ast.Call):
        return _call(node, text, space)
    raise _error("only numbers, parameters, + - * / ** and functions are allowed", node, text)


def _constant(node: ast.Constant, text: str, space: ParameterSpace) -> Any:
    if isinstance(node.value, str):
        return _named(node.value, node, text, space)
    if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
        raise _error(f"{shown(node.value)} is not a real number", node, text)
    try:
        return float(node.value)
    except OverflowError:
        raise _error("the number is too large", node, text) from None


def _named(name: str, node: ast.AST, text: str, space: ParameterSpace) -> Any:
    if name in space.names:
        return space.handle(name)
    if name in _CONSTANTS and isinstance(node, ast.Name):
        return _CONSTANTS[name]
    raise _error(str(not_found("no parameter", name, space.names)), node, text)


def _entry(node: ast.Subscript, text: str, space: ParameterSpace) -> Any:
    base = _read(node.value, text, space)
    if not isinstance(base, ArrayParameter):
        raise _error("only an array parameter has entries", node, text)
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    index = []
    for part in parts:
        if not isinstance(part, ast.Constant) or isinstance(part.value, bool) or not isinstance(part.value, int):
            raise _error("an index must be whole numbers such as [0,1]", node, text)
        index.append(part.value)
    if len(index) != base.ndim or any(not 0 <= i < n for i, n in zip(index, base.shape, strict=True)):
        raise _error(f"the index does not fit the shape {base.shape} of {shown(base.name)}", node, text)
    return base[tuple(index)]


def _call(node: ast.Call, text: str, space: ParameterSpace) -> Any:
    name = node.func.id if isinstance(node.func, ast.Name) else None
    if name not in FUNCTIONS or node.keywords:
        guess = nearest(name, FUNCTIONS) if name else None
        raise _error("unknown function" + (f"; did you mean {guess!r}?" if guess else ""), node, text)
    return _apply(name, [_read(a, text, space) for a in node.args], node, text)


def _apply(name: str, args: list[Any], node: ast.AST, text: str) -> Any:
    try:
        return combine(name, *args)
    except UNFIT as reason:
        raise _error(str(reason), node, text) from None


def _error(message: str, node: ast.AST, text: str) -> GrammarError:
    column = getattr(node, "col_offset", 0) + 1
    return GrammarError(f"in the expression {shown(text)}, column {column}: {message}", column)
