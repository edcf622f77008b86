"""Scalar expressions of design parameters, and of what a traced function is given: a graph that is evaluated and differentiated exactly.

A node is an operation on nodes and numbers, or a symbol: one entry of the flat vector V of a space of values. `Program` lists the
nodes of many expressions once, children first; the core evaluates it (``rust/src/expressions``), so that parameters and users'
functions share one evaluator.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from ..errors import ModelError, NotDifferentiableError
from .expression_text import node_text
from .names import shown
from .operations import FUNCTIONS, OPS, UFUNC_ALIAS, Op


class ParameterSpace(Protocol):
    """The parameters of a model as expressions use them: the flat V, and a number that rises when a value changes.

    A space that is ``traced`` has no values: its symbols are what a function is called with.
    """

    values: list[float]
    version: int
    symbols: list[Symbol]
    traced: bool

    def captured(self, expression: Expression) -> Symbol:
        """The symbol, in a traced space, of an expression of another space that a function uses."""


class Expression:
    """A number that depends on parameters. Arithmetic and NumPy functions of it give expressions; ``.value`` is its
    number now.
    """

    __slots__ = ("_value", "_version", "args", "op", "space")
    # Identity, not value: two equal expressions may differ after the next m.set.
    __hash__ = object.__hash__

    def __init__(self, space: ParameterSpace, op: Op, args: tuple[Expression | float, ...]) -> None:
        self.space, self.op, self.args = space, op, args
        self._value = math.nan if space.traced else _evaluated(op, [number(a) for a in args], self)
        self._version = space.version

    @property
    def value(self) -> float:
        """The number at the current values of the parameters."""
        if self._version != self.space.version:
            self._value = Program([self]).evaluate(self.space.values)[-1]
            self._version = self.space.version
        return self._value

    def __float__(self) -> float:
        raise _cut_off(self, "float()", "use NumPy's functions (np.sin, not math.sin)")

    def __int__(self) -> int:
        raise _cut_off(self, "int()", "use np.floor")

    def __index__(self) -> int:
        raise _cut_off(self, "its use as an index", "use np.where")

    def __round__(self, digits: int | None = None) -> int:
        raise _cut_off(self, "round()", "use np.floor")

    def __bool__(self) -> bool:
        if self.space.traced:
            raise TypeError(
                f"{self} is neither true nor false while the function is traced: in the place of `if`, `and`, `or`, `not`, max and min "
                "use np.where, &, |, ~, np.maximum and np.minimum"
            )
        raise TypeError(f"the expression {self} has no truth value; compare its .value, or use np.where")

    def __str__(self) -> str:
        return Program([self]).text()[-1]

    def __repr__(self) -> str:
        return f"<{self} = {self.value:.12g}>"

    def __reduce__(self) -> tuple[Any, ...]:
        # Flat, because pickling a graph node by node recurses once for every level of it.
        return rebuild, (self.space, Program([self]).nodes)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return apply_ufunc(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return apply_function(function, args, options)

    def __eq__(self, other: object) -> Any:
        # Expressions of parameters are equal where they are the same object.
        return combine("equal", self, other) if self.space.traced and self is not other else self is other

    def __ne__(self, other: object) -> Any:
        return combine("logical_not", self == other) if self.space.traced and self is not other else self is not other

    def __lt__(self, other: Any) -> Any:
        return combine("less", self, other)

    def __le__(self, other: Any) -> Any:
        return combine("less_equal", self, other)

    def __gt__(self, other: Any) -> Any:
        return combine("less", other, self)

    def __ge__(self, other: Any) -> Any:
        return combine("less_equal", other, self)

    def __and__(self, other: Any) -> Any:
        return combine("logical_and", self, other)

    def __rand__(self, other: Any) -> Any:
        return combine("logical_and", other, self)

    def __or__(self, other: Any) -> Any:
        return combine("logical_or", self, other)

    def __ror__(self, other: Any) -> Any:
        return combine("logical_or", other, self)

    def __invert__(self) -> Any:
        return combine("logical_not", self)

    def __mod__(self, other: Any) -> Any:
        return _remainder(self, other)

    def __rmod__(self, other: Any) -> Any:
        return _remainder(other, self)

    def __floordiv__(self, other: Any) -> Any:
        return combine("floor", combine("divide", self, other))

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
        if name == "conjugate":
            return lambda: self
        raise AttributeError(f"an expression has no attribute {shown(name)}")


def _cut_off(expression: Expression, what: str, remedy: str) -> TypeError:
    whole = "what the function was given" if expression.space.traced else "its parameters"
    value = "" if expression.space.traced else ", or .value"
    return TypeError(f"{what} would cut the expression {expression} off from {whole}: {remedy}{value}")


class Symbol(Expression):
    """One number of a parameter: entry ``index`` of the flat vector of all parameter values."""

    __slots__ = ("index", "label")

    def __init__(self, space: ParameterSpace, index: int, label: str) -> None:
        self.space, self.index, self.label = space, index, label
        self.args = ()

    @property
    def value(self) -> float:
        """The number now."""
        return math.nan if self.space.traced else self.space.values[self.index]


def number(a: Expression | float) -> float:
    """The number now of an expression or of a plain number."""
    return a.value if isinstance(a, Expression) else a


# Operations that take True and False.
_LOGICAL = ("where", "logical_and", "logical_or", "logical_not", "equal")


def combine(name: str, *args: Any) -> Any:
    """The operation on scalars, or entry by entry where an argument is an array, a list or an array parameter."""
    op = OPS[name]
    if len(args) != op.arity:
        raise TypeError(f"{name} takes {op.arity} arguments, got {len(args)}")
    scalars = [_scalar(a, name in _LOGICAL) for a in args]
    if not any(a is None for a in scalars):
        return _node(op, scalars)
    arrays = np.broadcast_arrays(*(np.asarray(a, dtype=object) for a in args))
    out = np.empty(arrays[0].shape, dtype=object)
    for index in np.ndindex(out.shape):
        out[index] = combine(name, *(a[index] for a in arrays))
    return out.view(ExpressionArray)


def _remainder(a: Any, b: Any) -> Any:
    return combine("subtract", a, combine("multiply", b, combine("floor", combine("divide", a, b))))


def _scalar(a: Any, flags: bool = False) -> Expression | float | None:
    if isinstance(a, (Expression, float)):
        return a
    if isinstance(a, (int, np.integer, np.floating)) and not isinstance(a, bool):
        return float(a)
    if flags and isinstance(a, (bool, np.bool_)):
        return float(a)
    if isinstance(a, np.ndarray) and a.ndim == 0:
        return _scalar(a.item(), flags)
    if hasattr(a, "__len__") and not isinstance(a, (str, bytes, dict)):
        return None
    raise TypeError(f"an expression takes real numbers and expressions, got {shown(a)} ({type(a).__name__})")


def _node(op: Op, args: list[Any]) -> Expression | float:
    space = None
    for a in args:
        if not isinstance(a, Expression):
            if not math.isfinite(a):
                raise ModelError(f"an expression contains the number {a}; only finite numbers are allowed")
        elif space is None or space is a.space or (a.space.traced and not space.traced):
            space = a.space
        elif not space.traced or a.space.traced:
            raise ModelError("an expression mixes parameters of two models; define them in the same one")
    if space is None:
        return _evaluated(op, args, None)
    if space.traced:
        args = [space.captured(a) if isinstance(a, Expression) and a.space is not space else a for a in args]
        return _folded(space, op, args)
    return Expression(space, op, tuple(args))


# The constant in `a op constant` with which the operation changes nothing.
_IDLE = {("multiply", 1.0), ("divide", 1.0), ("add", 0.0), ("subtract", 0.0), ("power", 1.0)}


def _folded(space: ParameterSpace, op: Op, args: list[Any]) -> Expression:
    """The node of a traced function, less what sums from zero and products from one begin with."""
    if len(args) == 2:
        a, b = args
        if isinstance(a, Expression) and not isinstance(b, Expression) and (op.name, b) in _IDLE:
            return a
        if isinstance(b, Expression) and op.name in ("multiply", "add") and (op.name, a) in _IDLE:
            return b
    return Expression(space, op, tuple(args))


def _evaluated(op: Op, values: Sequence[float], owner: Expression | None) -> float:
    from .. import _core

    result: float = _core.operation(op.name, list(values))
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
        raise TypeError("out= is not supported for expressions")
    if method == "__call__" and (made := _called(name, inputs)) is not None:
        return made
    if name in ("add", "multiply", "matmul", "maximum", "minimum", "vecdot", "matvec", "vecmat"):
        made = getattr(ufunc, method)(*(np.asarray(a, dtype=object) for a in inputs), **options)
        return made.view(ExpressionArray) if isinstance(made, np.ndarray) else made
    raise TypeError(_unknown(ufunc.__name__))


def _called(name: str, inputs: Sequence[Any]) -> Any:
    match name:
        case "positive" | "conjugate":
            return inputs[0]
        case "greater":
            return combine("less", inputs[1], inputs[0])
        case "greater_equal":
            return combine("less_equal", inputs[1], inputs[0])
        case "not_equal":
            return combine("logical_not", combine("equal", *inputs))
        case "remainder":
            return _remainder(*inputs)
        case "floor_divide":
            return combine("floor", combine("divide", *inputs))
        case "clip":
            return combine("minimum", combine("maximum", inputs[0], inputs[1]), inputs[2])
        case "exp2":
            return combine("power", 2.0, inputs[0])
        case "heaviside":
            x, middle = inputs
            above = combine("where", combine("less", 0.0, x), 1.0, middle)
            return combine("where", combine("less", x, 0.0), 0.0, above)
        case _ if name in OPS:
            return combine(name, *inputs)
    return None


def _unknown(name: str) -> str:
    known = ", ".join(sorted(FUNCTIONS))
    return f"np.{name} has no derivative rule for expressions; known are {known}"


def _norm(x: Any) -> Any:
    entries = np.asarray(x, dtype=object).ravel()
    total = entries[0] if len(entries) else 0.0
    for entry in entries[1:]:
        total = combine("hypot", total, entry)
    return combine("abs", total) if len(entries) == 1 else total


def _cross(a: Any, b: Any) -> Any:
    (a0, a1, a2), (b0, b1, b2) = (np.asarray(v, dtype=object).ravel().tolist() for v in (a, b))
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], dtype=object).view(ExpressionArray)


def _clip(x: Any, low: Any = None, high: Any = None) -> Any:
    x = x if low is None else combine("maximum", x, low)
    return x if high is None else combine("minimum", x, high)


# NumPy's functions that are not ufuncs and that its own loops over objects do not do.
_ARRAY_FUNCTIONS: dict[str, Any] = {
    "where": lambda condition, a, b: combine("where", condition, a, b),
    "norm": _norm,
    "cross": _cross,
    "clip": _clip,
}


def apply_function(function: Any, args: Sequence[Any], options: dict[str, Any]) -> Any:
    """A NumPy function that is not a ufunc: `np.where`, `np.linalg.norm` of a vector, `np.cross`, `np.clip`, and those that NumPy's
    loops over objects do.
    """
    own = _ARRAY_FUNCTIONS.get(function.__name__)
    if own is not None and not options:
        return own(*args)
    if own is not None:
        raise TypeError(f"np.{function.__name__} takes no keywords for expressions")
    made = function(*(_plain(a) for a in args), **{k: _plain(v) for k, v in options.items()})
    return made.view(ExpressionArray) if isinstance(made, np.ndarray) and made.dtype == object else made


def _plain(a: Any) -> Any:
    """Arguments that NumPy takes for arrays of objects."""
    if isinstance(a, ExpressionArray):
        return a.view(np.ndarray)
    if isinstance(a, Expression):
        out = np.empty((), dtype=object)
        out[()] = a
        return out
    return type(a)(_plain(v) for v in a) if type(a) in (list, tuple) else a


class ExpressionArray(np.ndarray):
    """An array of expressions, on which NumPy's functions work entry by entry."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [a.view(np.ndarray) if isinstance(a, ExpressionArray) else a for a in inputs]
        return apply_ufunc(ufunc, method, plain, options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return apply_function(function, args, options)


class Program:
    """The nodes of some expressions, each once and children first.

    ``nodes[i]`` is ``(None, number)`` for a constant, ``(index, label)`` for a symbol and ``(name, children)`` for an
    operation.
    """

    def __init__(self, roots: Iterable[Expression | float]) -> None:
        self.nodes: list[tuple[Any, Any]] = []
        self._place: dict[int, int] = {}
        self._keep: list[Expression] = []  # ids stay valid only while the nodes live
        self._known: dict[tuple[Any, Any], int] = {}
        self.roots = [self._add(root) if isinstance(root, Expression) else self._child(root) for root in roots]

    @cached_property
    def core(self) -> Any:
        """The program in the core."""
        from .. import _core

        return _core.Program(self.nodes, self.roots)

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
            place[id(node)] = self._number(entry)
            self._keep.append(node)
            stack.pop()
        return place[id(root)]

    def _child(self, a: Expression | float) -> int:
        if isinstance(a, Expression):
            return self._place[id(a)]
        return self._number((None, a))

    def _number(self, entry: tuple[Any, Any]) -> int:
        """The place of a node; equal ones are one, and -0.0 is not 0.0."""
        key = (None, a.hex()) if entry[0] is None and isinstance(a := entry[1], float) else entry
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append(entry)
        return self._known[key]

    def evaluate(self, values: Sequence[float]) -> list[float]:
        """The number of every node at the flat parameter values."""
        w: list[float] = self.core.values(list(values))
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
        slopes, kink = self.core.gradient(root, list(w))
        if kink is not None:
            raise NotDifferentiableError(
                f"{self.text()[kink]} has no derivative at the present values of its parameters; move them off it"
            )
        return dict(slopes)

    def text(self) -> list[str]:
        """Every node in the grammar of `mbrs.model.grammar`, which reads back to the same graph."""
        written: list[tuple[str, int]] = []
        for node in self.nodes:
            written.append(node_text(node, written))
        return [text for text, _ in written]


def rebuild(space: ParameterSpace, nodes: Sequence[tuple[Any, Any]]) -> Expression:
    """The last node of a program as an expression again."""
    last: Expression = rebuild_all(space, nodes, [len(nodes) - 1])[0]
    return last


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
