"""Python functions traced into programs: called once with symbols in the place of numbers.

A program has the inputs t, u[0] ..., v[0] ..., p[0] ...; p are the expressions of a model's parameters that the function uses, so
that they stay parameters. As text it is a list of lines, "a0 = ..." for what is used more than once, the results last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._lib.checks import UNFIT
from ..errors import ModelError
from .expression_text import expression_texts
from .expressions import Expression, ExpressionArray, Program, Symbol
from .grammar import parse
from .names import problem, shown
from .parameters import ParameterSpace

REMEDY = (
    "use NumPy's functions, np.where(condition, a, b), np.maximum, np.minimum and np.sign in the place of `if`, max, min and math; or give "
    "derivatives=, and the function is called as it is"
)


class TraceSpace(ParameterSpace):
    """Symbols t, u, v of a law of ``m`` coordinates (numbers where ``m`` is 0), and those of captured expressions; without ``rates``
    no v."""

    traced = True

    def __init__(self, m: int, n: int = 0, rates: bool = True) -> None:
        super().__init__()
        self.numbers: list[Expression] = []
        self.lines: dict[str, Expression] = {}
        shape = (m,) if m else ()
        for name in ("t", "u", "v") if rates else ("t", "u"):
            self.add(name, np.zeros(() if name == "t" else shape))
        if n:
            self.add("p", np.zeros(n))

    def captured(self, expression: Expression) -> Symbol:
        """The input of an expression of parameters."""
        for symbol, known in zip(self.symbols[-len(self.numbers) :], self.numbers, strict=False):
            if known is expression:
                return symbol
        if self.numbers and self.numbers[0].space is not expression.space:
            raise ModelError("a function mixes parameters of two models; define them in the same one")
        self.symbols.append(Symbol(self, len(self.symbols), f"p[{len(self.numbers)}]"))
        self.numbers.append(expression)
        return self.symbols[-1]

    def handle(self, name: str) -> Any:
        """An input, or a line before."""
        return self.lines[name] if name in self.lines else super().handle(name)


def trace(function: Callable[..., Any], m: int, outputs: int, where: str) -> tuple[Program, list[Expression]]:
    """The program of ``function(t, u, v)`` and the expressions that it captured; ``m`` 0: u, v and the result are numbers.

    Raises
    ------
    ModelError
        A function that asks for the value of what it is given, returns another number of results or something that is not a number.
    """
    space = TraceSpace(m)
    made = _called(function, space, ("u", "v"), where)
    flat = np.asarray(made, dtype=object).ravel().tolist()
    if len(flat) != outputs:
        raise problem(
            where, f"has the function {described(function)}, which must return {outputs} numbers, got {shown(made)}"
        )
    return Program([_result(v, space, function, where) for v in flat]), space.numbers


def trace_rows(
    functions: Sequence[Callable[..., Any]], m: int, width: int, where: str, of_velocities: bool
) -> tuple[Program, list[Expression]]:
    """The program of rows of ``width`` numbers that ``functions[0](t, u)`` returns, of velocities with one more in each, which
    ``functions[1]`` returns or which is zero; and the expressions that they captured.
    """
    space = TraceSpace(m, rates=False)
    made = _called(functions[0], space, ("u",), where)
    flat = np.asarray(made, dtype=object)
    if flat.size == 0 or flat.ndim > 2 or flat.size % width or (width > 1 and flat.shape[-1] != width):
        raise problem(
            where,
            f"has the function {described(functions[0])}, which must return {_shape_of_rows(width)}, got {shown(made)}",
        )
    rows = flat.reshape(-1, width).tolist()
    if of_velocities:
        right = np.asarray(
            _called(functions[1], space, ("u",), where) if functions[1:] else [0.0] * len(rows), dtype=object
        )
        if right.size != len(rows):
            raise problem(where, f"has {len(rows)} rows, but d returns {right.size} numbers")
        rows = [[*row, last] for row, last in zip(rows, right.ravel().tolist(), strict=True)]
    return Program([_result(v, space, functions[0], where) for row in rows for v in row]), space.numbers


def _shape_of_rows(width: int) -> str:
    return (
        "a number or a list of numbers" if width == 1 else f"({width},) numbers, one for each motion, or rows of them"
    )


def _called(function: Callable[..., Any], space: TraceSpace, names: tuple[str, ...], where: str) -> Any:
    """The result of a function for symbols."""
    arguments = [space.symbols[0], *(_given(space, name) for name in names)]
    try:
        return function(*arguments)
    except (TypeError, AttributeError, ModelError, IndexError) as reason:
        raise problem(
            where, f"has the function {described(function)}, which cannot be traced: {reason}. {_remedy(reason, names)}"
        ) from reason
    except Exception as raised:
        raised.add_note(f"raised while the function {described(function)} of {where} was traced, called with symbols")
        raise


def _given(space: TraceSpace, name: str) -> Any:
    made = space.handle(name)
    if isinstance(made, Symbol):
        return made
    return made.symbols.view(ExpressionArray)


def _result(value: Any, space: TraceSpace, function: Any, where: str) -> Expression | float:
    if isinstance(value, Expression):
        return value if value.space is space else space.captured(value)
    try:
        number = float(value)
    except UNFIT:
        number = np.nan
    if not np.isfinite(number):
        raise problem(
            where,
            f"has the function {described(function)}, which returned {shown(value)}; it must return finite numbers",
        )
    return number


def _remedy(reason: Exception, names: Sequence[str]) -> str:
    return (
        f"The function takes ({', '.join(['t', *names])}); {REMEDY}"
        if "argument" in str(reason)
        else REMEDY[0].upper() + REMEDY[1:]
    )


def described(function: Any) -> str:
    """Name and place of a function."""
    name = getattr(function, "__qualname__", None) or repr(function)
    code = getattr(function, "__code__", None)
    return (
        f"{shown(name)}"
        if code is None
        else f"{shown(name)} ({code.co_filename.rpartition('/')[2]}, line {code.co_firstlineno})"
    )


def program_lines(nodes: Sequence[tuple[Any, Any]], roots: Sequence[int]) -> list[str]:
    """A program as text that `read_program` reads back."""
    lines, texts = expression_texts(nodes, roots)
    return [*lines, *texts]


def read_program(lines: Sequence[Any], m: int, n: int, where: str, rates: bool = True) -> Program:
    """A program of ``n`` captured numbers from its text; without ``rates`` that of rows, of any number of results."""
    space = TraceSpace(m, n, rates)
    roots: list[Expression | float] = []
    for line in lines:
        if not isinstance(line, str):
            raise problem(where, f"has a program whose lines must be texts, got {shown(line)}")
        name, equals, text = line.partition(" = ")
        made = parse(text if equals else line, space)
        if not isinstance(made, Expression | float):
            raise problem(where, f"has a program with the line {shown(line)}, which is not a number")
        if not equals:
            roots.append(made)
        elif not name.isidentifier() or name in space.names:
            raise problem(where, f"has a program with the line {shown(line)}; a line is a result or `name = ...`")
        elif isinstance(made, float):
            raise problem(where, f"has a program with the constant line {shown(line)}")
        else:
            space.lines[name] = made
            space.names[name] = (0, ())
    if rates and len(roots) != max(m, 1):
        raise problem(where, f"has a program of {len(roots)} results for {max(m, 1)} coordinates")
    return Program(roots)
