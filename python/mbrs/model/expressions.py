"""Scalar expressions of design parameters: a graph that is evaluated and differentiated exactly.

A node is an operation on nodes and numbers, or a symbol: one entry of the flat vector V of parameter values. `Program`
lists the nodes of many expressions once, children first, so that new values cost one pass without recursion.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np

from ..errors import ModelError, NotDifferentiableError
from .names import shown
from .operations import FUNCTIONS, OPS, UFUNC_ALIAS, Op


class ParameterSpace(Protocol):
    """The parameters of a model as expressions use them: the flat V, and a number that rises when a value changes."""

    values: list[float]
    version: int
    symbols: list[Symbol]


class Expression:
    """A number that depends on parameters. Arithmetic and NumPy functions of it give expressions; ``.value`` is its
    number now.
    """

    __slots__ = ("_value", "_version", "args", "op", "space")
    # Identity, not value: two equal expressions may differ after the next m.set.
    __hash__ = object.__hash__

    def __init__(self, space: ParameterSpace, op: Op, args: tuple[Expression | float, ...]) -> None:
        self.space, self.op, self.args = space, op, args
        self._value = _evaluated(op, [number(a) for a in args], self)
        self._version = space.version

    @property
    def value(self) -> float:
        """The number at the current values of the parameters."""
        if self._version != self.space.version:
            self._value = Program([self]).evaluate(self.space.values)[-1]
            self._version = self.space.version
        return self._value

    def __float__(self) -> float:
        raise TypeError(
            f"float() would cut the expression {self} off from its parameters: use np.sin, not math.sin, or .value"
        )

    def __bool__(self) -> bool:
        raise TypeError(f"the expression {self} has no truth value; compare its .value")

    def __str__(self) -> str:
        return Program([self]).text()[-1]

    def __repr__(self) -> str:
        return f"<{self} = {self.value:.12g}>"

    def __reduce__(self) -> tuple[Any, ...]:
        # Flat, because pickling a graph node by node recurses once for every level of it.
        return rebuild, (self.space, Program([self]).nodes)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return apply_ufunc(ufunc, method, inputs, options)

    def __add__(self, other: Any) -> Any:
        return combine("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return combine("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return combine("subtract", self, other)

    def __rsub__(self, other: Any) -> Any:
        return combine("subtract", other, self)

    def __mul__(self, other: Any) -> Any:
        return combine("multiply", self, other)

    def __rmul__(self, other: Any) -> Any:
        return combine("multiply", other, self)

    def __truediv__(self, other: Any) -> Any:
        return combine("divide", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return combine("divide", other, self)

    def __pow__(self, other: Any) -> Any:
        return combine("power", self, other)

    def __rpow__(self, other: Any) -> Any:
        return combine("power", other, self)

    def __neg__(self) -> Any:
        return combine("negative", self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return combine("abs", self)

    def __getattr__(self, name: str) -> Any:
        # NumPy's loops over object arrays call np.sin as element.sin().
        if name in FUNCTIONS:
            return lambda *others: combine(name, self, *others)
        raise AttributeError(f"an expression has no attribute {name!r}")


class Symbol(Expression):
    """One number of a parameter: entry ``index`` of the flat vector of all parameter values."""

    __slots__ = ("index", "label")

    def __init__(self, space: ParameterSpace, index: int, label: str) -> None:
        self.space, self.index, self.label = space, index, label
        self.args = ()

    @property
    def value(self) -> float:
        """The number now."""
        return self.space.values[self.index]


def number(a: Expression | float) -> float:
    """The number now of an expression or of a plain number."""
    return a.value if isinstance(a, Expression) else a


def combine(name: str, *args: Any) -> Any:
    """The operation on scalars, or entry by entry where an argument is an array, a list or an array parameter."""
    op = OPS[name]
    if len(args) != len(op.partials):
        raise TypeError(f"{name} takes {len(op.partials)} arguments, got {len(args)}")
    scalars = [_scalar(a) for a in args]
    if None not in scalars:
        return _node(op, scalars)
    arrays = np.broadcast_arrays(*(np.asarray(a, dtype=object) for a in args))
    out = np.empty(arrays[0].shape, dtype=object)
    for index in np.ndindex(out.shape):
        out[index] = combine(name, *(a[index] for a in arrays))
    return out


def _scalar(a: Any) -> Expression | float | None:
    if isinstance(a, (Expression, float)):
        return a
    if isinstance(a, (int, np.integer, np.floating)) and not isinstance(a, bool):
        return float(a)
    if isinstance(a, np.ndarray) and a.ndim == 0:
        return _scalar(a.item())
    if hasattr(a, "__len__") and not isinstance(a, (str, bytes, dict)):
        return None
    raise TypeError(f"an expression takes real numbers and expressions, got {shown(a)} ({type(a).__name__})")


def _node(op: Op, args: list[Any]) -> Expression | float:
    space = None
    for a in args:
        if isinstance(a, Expression):
            if space is not None and a.space is not space:
                raise ModelError("an expression mixes parameters of two models; define them in the same one")
            space = a.space
        elif not math.isfinite(a):
            raise ModelError(f"an expression contains the number {a}; only finite numbers are allowed")
    if space is None:
        return _evaluated(op, args, None)
    return Expression(space, op, tuple(args))


def _evaluated(op: Op, values: Sequence[float], owner: Expression | None) -> float:
    try:
        result = float(op.value(*values))
    except (ValueError, ArithmeticError) as reason:
        raise _not_finite(op, values, owner) from reason
    if not math.isfinite(result):
        raise _not_finite(op, values, owner)
    return result


def _not_finite(op: Op, values: Sequence[float], owner: Expression | None) -> ModelError:
    numbers = ", ".join(f"{v:.6g}" for v in values)
    where = f" in the expression {owner}" if owner is not None else ""
    return ModelError(
        f"{op.name}({numbers}) is not a finite real number{where}; change the parameters or the expression"
    )


def apply_ufunc(ufunc: np.ufunc, method: str, inputs: Sequence[Any], options: dict[str, Any]) -> Any:
    """A NumPy function of expressions. Sums and matrix products go through NumPy's own loops over objects."""
    name = UFUNC_ALIAS.get(ufunc.__name__, ufunc.__name__)
    if options.get("out") is not None:
        raise TypeError("out= is not supported for expressions of parameters")
    if method == "__call__" and name == "positive":
        return inputs[0]
    if method == "__call__" and name in OPS:
        return combine(name, *inputs)
    if name in ("add", "multiply", "matmul"):
        return getattr(ufunc, method)(*(np.asarray(a, dtype=object) for a in inputs), **options)
    known = ", ".join(sorted(FUNCTIONS))
    raise TypeError(f"np.{ufunc.__name__} has no derivative rule for expressions of parameters; known are {known}")


class Program:
    """The nodes of some expressions, each once and children first.

    ``nodes[i]`` is ``(None, number)`` for a constant, ``(index, label)`` for a symbol and ``(name, children)`` for an
    operation.
    """

    def __init__(self, roots: Iterable[Expression]) -> None:
        self.nodes: list[tuple[Any, Any]] = []
        self._place: dict[int, int] = {}
        self._keep: list[Expression] = []  # ids stay valid only while the nodes live
        self.roots = [self._add(root) for root in roots]
        self._template = [arg if op is None else 0.0 for op, arg in self.nodes]
        self._symbols = [(i, op) for i, (op, _) in enumerate(self.nodes) if isinstance(op, int)]
        self._steps = [(i, OPS[op].value, arg) for i, (op, arg) in enumerate(self.nodes) if isinstance(op, str)]

    def _add(self, root: Expression) -> int:
        place, stack = self._place, [root]
        while stack:
            node = stack[-1]
            if id(node) in place:
                stack.pop()
                continue
            waiting = [a for a in node.args if isinstance(a, Expression) and id(a) not in place]
            if waiting:
                stack.extend(waiting)
                continue
            if isinstance(node, Symbol):
                entry: tuple[Any, Any] = (node.index, node.label)
            else:
                entry = (node.op.name, tuple(self._child(a) for a in node.args))
            place[id(node)] = len(self.nodes)
            self.nodes.append(entry)
            self._keep.append(node)
            stack.pop()
        return place[id(root)]

    def place_of(self, root: Expression) -> int:
        """Index in ``nodes`` of an expression that the program was made of."""
        return self._place[id(root)]

    def _child(self, a: Expression | float) -> int:
        if isinstance(a, Expression):
            return self._place[id(a)]
        self.nodes.append((None, a))
        return len(self.nodes) - 1

    def evaluate(self, values: Sequence[float]) -> list[float]:
        """The number of every node at the flat parameter values."""
        w = self._template.copy()
        for i, index in self._symbols:
            w[i] = values[index]
        i = -1
        try:
            for i, function, args in self._steps:
                w[i] = function(*[w[a] for a in args])
        except (ValueError, ArithmeticError) as reason:
            raise self._failure(i, w) from reason
        if not all(map(math.isfinite, w)):
            raise self._failure(next(i for i, v in enumerate(w) if not math.isfinite(v)), w)
        return w

    def _failure(self, i: int, w: list[float]) -> ModelError:
        name, args = self.nodes[i]
        if not isinstance(name, str):
            return ModelError(f"the parameter {args} is not a finite number")
        numbers = ", ".join(f"{w[a]:.6g}" for a in args)
        return ModelError(
            f"{self.text()[i]} is {name}({numbers}), not a finite real number; change the parameters or the expression"
        )

    def gradient(self, root: int, w: Sequence[float]) -> dict[int, float]:
        """d nodes[root] / d V as {index in V: derivative}, by the reverse mode; ``w`` comes from `evaluate`."""
        adjoint = {root: 1.0}
        out: dict[int, float] = {}
        order = self._below(root)
        for i in order:
            seed = adjoint.pop(i, 0.0)
            name, _ = self.nodes[i]
            if isinstance(name, int):
                out[name] = out.get(name, 0.0) + seed
            elif name is not None:
                self._push(i, seed, w, adjoint)
        return out

    def _below(self, root: int) -> list[int]:
        seen, stack = {root}, [root]
        while stack:
            name, args = self.nodes[stack.pop()]
            if isinstance(name, str):
                for a in args:
                    if a not in seen:
                        seen.add(a)
                        stack.append(a)
        return sorted(seen, reverse=True)

    def _push(self, i: int, seed: float, w: Sequence[float], adjoint: dict[int, float]) -> None:
        name, args = self.nodes[i]
        numbers = [w[a] for a in args]
        for a, partial in zip(args, OPS[name].partials, strict=True):
            if self.nodes[a][0] is None:
                continue
            try:
                slope = partial(*numbers, w[i])
            except (ValueError, ArithmeticError) as reason:
                raise NotDifferentiableError(
                    f"{self.text()[i]} has no derivative at the present values of its parameters; move them off it"
                ) from reason
            adjoint[a] = adjoint.get(a, 0.0) + seed * slope

    def text(self) -> list[str]:
        """Every node in the grammar of `mbrs.model.grammar`, which reads back to the same graph."""
        written: list[tuple[str, int]] = []
        for name, arg in self.nodes:
            if name is None:
                written.append((number_text(arg), 3 if math.copysign(1.0, arg) < 0 else 6))
            elif isinstance(name, int):
                written.append((symbol_text(arg), 6))
            else:
                written.append(_joined(OPS[name], [written[a] for a in arg]))
        return [text for text, _ in written]


def _joined(op: Op, parts: list[tuple[str, int]]) -> tuple[str, int]:
    if not op.symbol:
        return f"{op.name}({', '.join(text for text, _ in parts)})", 6
    if len(parts) == 1:
        text, level = parts[0]
        # Python reads -2 as a negative number, so the minus of a number keeps its own parentheses.
        return f"-{text}" if level >= 4 and not text[0].isdigit() else f"-({text})", op.precedence
    (left, level_left), (right, level_right) = parts
    # Equal precedence: all operators but ** group to the left.
    strict_left = op.name == "power"
    if level_left < op.precedence + strict_left:
        left = f"({left})"
    if level_right < op.precedence + (not strict_left):
        right = f"({right})"
    gap = " " if op.precedence == 1 else ""
    return f"{left}{gap}{op.symbol}{gap}{right}", op.precedence


def number_text(value: float) -> str:
    """The shortest text that reads back to the same double."""
    text = repr(float(value))
    return text[:-2] if text.endswith(".0") and text != "-0.0" else text


def symbol_text(label: str) -> str:
    """A parameter's label as text of an expression: quoted if it is not a plain identifier."""
    name, bracket, index = label.partition("[")
    plain = name.isascii() and name.isidentifier() and name not in FUNCTIONS and not _is_keyword(name)
    return (name if plain else repr(name)) + bracket + index


def _is_keyword(name: str) -> bool:
    import keyword

    return keyword.iskeyword(name)


def rebuild(space: ParameterSpace, nodes: Sequence[tuple[Any, Any]]) -> Expression:
    """The last node of a program as an expression again."""
    return rebuild_all(space, nodes, [len(nodes) - 1])[0]


def rebuild_all(space: ParameterSpace, nodes: Sequence[tuple[Any, Any]], roots: Sequence[int]) -> list[Any]:
    """Expressions from the nodes of a program, shared parts staying shared."""
    made: list[Any] = []
    for name, arg in nodes:
        if name is None:
            made.append(arg)
        elif isinstance(name, int):
            made.append(space.symbols[name])
        else:
            made.append(Expression(space, OPS[name], tuple(made[a] for a in arg)))
    return [made[root] for root in roots]
