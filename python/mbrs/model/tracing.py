"""Python functions traced into programs: called once with symbols in the place of numbers.

A program has the inputs t, u[0] ..., v[0] ..., p[0] ...; p are the expressions of a model's parameters that the function uses, so
that they stay parameters. As text it is a list of lines, "a0 = ..." for what is used more than once, the results last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import ModelError
from .expressions import Expression, ExpressionArray, Program, Symbol, expression_texts
from .grammar import parse
from .names import problem, shown
from .parameters import ParameterSpace

REMEDY = (
    "use NumPy's functions, np.where(condition, a, b), np.maximum, np.minimum and np.sign in the place of `if`, max, min and math; or give "
    "derivatives=, and the function is called as it is"
)


class TraceSpace(ParameterSpace):
    """Symbols t, u, v of a law of ``m`` coordinates (numbers where ``m`` is 0), and those of captured expressions."""

    traced = True

    def __init__(self, m: int, n: int = 0) -> None:
        super().__init__()
        self.numbers: list[Expression] = []
        self.lines: dict[str, Expression] = {}
        shape = (m,) if m else ()
        for name in ("t", "u", "v"):
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
    arguments = [space.symbols[0], *(_given(space, name) for name in ("u", "v"))]
    try:
        made = function(*arguments)
    except (TypeError, AttributeError, ModelError) as reason:
        raise problem(
            where, f"has the function {described(function)}, which cannot be traced: {reason}. {_remedy(reason)}"
        ) from reason
    except Exception as raised:
        raised.add_note(f"raised while the function {described(function)} of {where} was traced, called with symbols")
        raise
    flat = np.asarray(made, dtype=object).ravel().tolist()
    if len(flat) != outputs:
        raise problem(
            where, f"has the function {described(function)}, which must return {outputs} numbers, got {shown(made)}"
        )
    return Program([_result(v, space, function, where) for v in flat]), space.numbers


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
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise problem(
            where,
            f"has the function {described(function)}, which returned {shown(value)}; it must return finite numbers",
        )
    return number


def _remedy(reason: Exception) -> str:
    return f"The function takes (t, u, v); {REMEDY}" if "argument" in str(reason) else REMEDY[0].upper() + REMEDY[1:]


def described(function: Any) -> str:
    """Name and place of a function."""
    name = getattr(function, "__qualname__", None) or repr(function)
    code = getattr(function, "__code__", None)
    return (
        f"{name!r}" if code is None else f"{name!r} ({code.co_filename.rpartition('/')[2]}, line {code.co_firstlineno})"
    )


def program_lines(nodes: Sequence[tuple[Any, Any]], roots: Sequence[int]) -> list[str]:
    """A program as text that `read_program` reads back."""
    lines, texts = expression_texts(nodes, roots)
    return [*lines, *texts]


def read_program(lines: Sequence[Any], m: int, n: int, where: str) -> Program:
    """A program of ``n`` captured numbers from its text."""
    space = TraceSpace(m, n)
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
    if len(roots) != max(m, 1):
        raise problem(where, f"has a program of {len(roots)} results for {max(m, 1)} coordinates")
    return Program(roots)
