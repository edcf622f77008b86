"""Parameters and expressions: values, exact derivatives, text."""

from __future__ import annotations

import copy
import math
import pickle

import mpmath
import numpy as np
import pytest
from mbrs.errors import ModelError, NotDifferentiableError
from mbrs.model.expressions import Expression, Program
from mbrs.model.grammar import GrammarError, parse
from mbrs.model.model import Model
from mbrs.model.operations import OPS

# A point inside the domain of each operation, and the same function at 50 digits.
MP = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negative": lambda a: -a,
    "power": lambda a, b: a**b,
    "abs": abs,
    "square": lambda a: a * a,
    "reciprocal": lambda a: 1 / a,
    "cbrt": mpmath.cbrt,
    "log2": lambda a: mpmath.log(a, 2),
    "arcsin": mpmath.asin,
    "arccos": mpmath.acos,
    "arctan": mpmath.atan,
    "arctan2": mpmath.atan2,
    "maximum": max,
    "minimum": min,
    "arcsinh": mpmath.asinh,
    "arccosh": mpmath.acosh,
    "arctanh": mpmath.atanh,
    "less": lambda a, b: float(a < b),
    "less_equal": lambda a, b: float(a <= b),
    "equal": lambda a, b: float(a == b),
    "logical_and": lambda a, b: float(bool(a) and bool(b)),
    "logical_or": lambda a, b: float(bool(a) or bool(b)),
    "logical_not": lambda a: float(not a),
    "where": lambda a, b, c: b if a else c,
}


@pytest.fixture
def m():
    return Model("parameters")


def gradient(expression):
    program = Program([expression])
    space = expression.space
    return program.gradient(program.roots[0], program.evaluate(space.values))


@pytest.mark.parametrize("name", OPS)
def test_every_operation_against_fifty_digits(m, name):
    op = OPS[name]
    points = (0.3, 0.7, 0.6)[: op.arity] if name != "arccosh" else (1.7,)
    symbols = [m.parameter(f"p{i}", v) for i, v in enumerate(points)]
    expression = op_of(name)(*symbols)
    exact = MP.get(name) or getattr(mpmath, name)
    with mpmath.workdps(50):
        at = [mpmath.mpf(v) for v in points]
        value = float(exact(*at))
        slopes = [float(partial(exact, at, i)) for i in range(len(at))]
    assert expression.value == pytest.approx(value, rel=1e-15)
    got = gradient(expression)
    for i, slope in enumerate(slopes):
        assert got.get(i, 0.0) == pytest.approx(slope, rel=1e-14, abs=1e-15)


def partial(function, at, i):
    h = mpmath.mpf(10) ** -20
    up, down = list(at), list(at)
    up[i], down[i] = at[i] + h, at[i] - h
    return (function(*up) - function(*down)) / (2 * h)


def op_of(name):
    return getattr(np, name)


def test_shared_parts_and_chain_rule(m):
    x, y = m.parameter("x", 0.4), m.parameter("y", 1.7)
    shared = np.sin(x * y)
    z = shared * shared + shared / y - 3.0
    s, c = math.sin(0.4 * 1.7), math.cos(0.4 * 1.7)
    assert z.value == pytest.approx(s * s + s / 1.7 - 3.0, rel=1e-15)
    assert gradient(z)[0] == pytest.approx(2 * s * c * 1.7 + c, rel=1e-14)
    assert gradient(z)[1] == pytest.approx(2 * s * c * 0.4 + c * 0.4 / 1.7 - s / 1.7**2, rel=1e-14)


def test_arrays_lists_and_numpy_functions(m):
    V = m.parameter("V", np.arange(6.0).reshape(2, 3))
    assert V.shape == (2, 3) and V[1, 2].value == 5.0 and len(V) == 2
    assert [e.value for e in V[0]] == [0.0, 1.0, 2.0]
    assert np.array([[e.value for e in row] for row in 2 * V + 1]).tolist() == [[1, 3, 5], [7, 9, 11]]
    assert [e.value for e in np.sum(V, axis=0)] == [3.0, 5.0, 7.0]
    assert [e.value for e in V @ np.array([1.0, 0.0, 2.0])] == [4.0, 13.0]
    assert np.sqrt(V)[1, 1].value == 2.0
    row = np.array([0.0, V[0, 1] / 2, 1.0])
    assert row.dtype == object and row[1].value == 0.5
    assert (np.float64(2.0) * V[0, 2]).value == 4.0
    assert [e.value for e in np.array([1.0, 2.0]) * V[0, 2]] == [2.0, 4.0]
    assert [e.value for e in np.sin(V[0])] == [math.sin(v) for v in (0.0, 1.0, 2.0)]


def test_values_follow_the_parameter(m):
    k = m.parameter("k", 2.0)
    twice = k * 2 + np.exp(k)
    m.set({"k": 3.0})
    assert twice.value == 6.0 + math.exp(3.0)


def test_a_long_sum_needs_no_recursion(m):
    V = m.parameter("V", np.ones(5_000))
    total = sum(list(V), 0.0)
    assert total.value == 5_000.0
    assert len(gradient(total)) == 5_000
    assert isinstance(pickle.loads(pickle.dumps(total)), Expression)
    m.set({"V": np.full(5_000, 2.0)})
    assert total.value == 10_000.0


def test_copies_keep_their_own_parameters(m):
    k = m.parameter("k", 2.0)
    other, double = copy.deepcopy((m, k * 2))
    other.set({"k": 5.0})
    assert double.value == 10.0 and (k * 2).value == 4.0


@pytest.mark.parametrize(
    "make",
    [
        lambda k, q, V: 2 * k + 1,
        lambda k, q, V: k - (q - (k - 1)),
        lambda k, q, V: -(k**2) + (-k) ** 2 - (-2.0) ** (q * 0 + 3),
        lambda k, q, V: k / (q / k) / (q * k) * (k / q),
        lambda k, q, V: (k**q) ** k + k ** (q**k),
        lambda k, q, V: np.negative(-k) - -3.5e-7 * q + 1e300 * k / 1e299,
        lambda k, q, V: np.arctan2(-k, q) + np.hypot(V[1, 0], V[0, 1] * 0.1),
        lambda k, q, V: -(k * q) + (-k) * q - (k + q) * (k - q) + 0.1,
        lambda k, q, V: abs(q - k) ** -0.5,
    ],
)
def test_text_reads_back_to_the_same_graph(m, make):
    k, q = m.parameter("k leg-1", 1.3), m.parameter("lambda", 0.7)
    V = m.parameter("V", [[1.0, 2.0], [3.0, 4.0]])
    expression = make(k, q, V)
    again = parse(str(expression), m.space)
    assert Program([again]).nodes == Program([expression]).nodes
    assert again.value == expression.value


def test_grammar_reads_what_people_type(m):
    m.parameter("k", 3.0)
    m.parameter("V", [1.0, 2.0])
    assert parse(" 2*k + 1", m.space).value == 7.0
    assert parse("cos(pi)*2", m.space) == -2.0
    assert parse("V", m.space).shape == (2,)
    assert parse("V[1]**2", m.space).value == 4.0
    assert parse("1e3", m.space) == 1000.0


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("2*kk", 3, "did you mean 'k'"),
        ("__import__('os')", 1, "unknown function"),
        ("sine(k)", 1, "did you mean 'sin'"),
        ("k.real", 1, "only numbers"),
        ("k if k else k", 1, "only numbers"),
        ("[k]", 1, "only numbers"),
        ("V[2]", 1, "shape (2,)"),
        ("V[k]", 1, "whole numbers"),
        ("k[0]", 1, "array parameter"),
        ("1 + True", 5, "not a real number"),
        ("2j*k", 1, "not a real number"),
        ("sin(k, k)", 1, "takes 1 argument"),
        ("log(-k)", 1, "not a finite real number"),
        ("1 +", 4, "cannot read"),
        ("", 1, "cannot read"),
        ("9" * 400, 1, "too large"),
    ],
)
def test_grammar_errors_say_where(m, text, column, words):
    m.parameter("k", 3.0)
    m.parameter("V", [1.0, 2.0])
    with pytest.raises(GrammarError) as caught:
        parse(text, m.space)
    assert words in str(caught.value)
    assert caught.value.column == column


def test_text_with_a_null_byte_is_an_error(m):
    m.parameter("k", 3.0)
    with pytest.raises(GrammarError, match="cannot read"):
        parse("k\0", m.space)


def test_deep_nesting_is_an_error_and_no_crash(m):
    m.parameter("k", 3.0)
    with pytest.raises(ModelError):
        parse("(" * 5000 + "k" + ")" * 5000, m.space)
    with pytest.raises(ModelError):
        parse("-" * 50_000 + "k", m.space)


def test_what_has_no_derivative_says_so(m):
    m.parameter("zero", 0.0)
    m.body("b", mass=1.0 + abs(m["zero"]), inertia=(1, 1, 1))
    assert m.value("b.mass") == 1.0
    from mbrs.model.directions import directions

    with pytest.raises(NotDifferentiableError, match="abs"):
        directions(m, "zero")
    with pytest.raises(NotDifferentiableError, match="sqrt"):
        gradient(np.sqrt(m["zero"]))
    assert gradient(m["zero"] ** 2) == {0: 0.0}
    assert gradient(m["zero"] ** 1) == {0: 1.0}


def test_misuse_is_refused(m):
    k = m.parameter("k", 2.0)
    other = Model("other").parameter("k", 2.0)
    with pytest.raises(TypeError, match=r"np\.sin instead|not math\.sin"):
        math.sin(k)
    with pytest.raises(TypeError, match="truth value"):
        bool(k + 1)
    with pytest.raises(TypeError, match="no derivative rule"):
        np.rint(k)
    with pytest.raises(TypeError):
        k + "a"
    with pytest.raises(TypeError):
        k + True
    with pytest.raises(ModelError, match="two models"):
        k + other
    with pytest.raises(ModelError, match="not a finite"):
        k / 0.0
    with pytest.raises(ModelError, match="not a finite"):
        np.log(k - 2.0)
    with pytest.raises(ModelError, match="finite"):
        k * math.nan
    with pytest.raises(ModelError, match="not a finite"):
        (-k) ** 0.5
    with pytest.raises(ModelError, match="shape"):
        m.parameter("V", [1.0])[1]
    with pytest.raises(TypeError, match="value"):
        np.asarray(m["V"], dtype=float)


@pytest.mark.parametrize("value", [math.nan, [1.0, math.inf], "2", None, 1j, [], [[1.0], [1.0, 2.0]], {"a": 1}, True])
def test_parameter_values_are_checked(m, value):
    with pytest.raises(ModelError, match="k "):
        m.parameter("k", value)
    assert "k" not in m
