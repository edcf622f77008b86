"""The rules of matrix calculus against central differences, entry by entry (docs/theory.md (10.1) to (10.6))."""

import mbrs as mb
import numpy as np
import pytest
from mbrs import matrix_calculus as mc

SHAPES = [((2, 3), (3, 2), (2, 2)), ((3, 3), (3, 4), (1, 3)), ((1, 2), (2, 1), (3, 1)), ((4, 1), (1, 2), (2, 3))]


def smooth(shape, of, seed):
    """A smooth matrix of a matrix: sin of a random linear map plus a product of entries."""
    rng = np.random.default_rng(seed)
    L, M = rng.normal(size=(*shape, *of)), rng.normal(size=(*shape, *of))
    return lambda b: np.sin(np.tensordot(L, b, 2)) + np.tensordot(M, b * b, 2)


def differences(f, b, h=1e-5):
    """dA/dB in block layout, written out by its definition (eq. 6)."""

    def one(i, j):
        e = np.zeros_like(b)
        e[i, j] = h
        # five points: error h^4
        return (8 * (f(b + e) - f(b - e)) - (f(b + 2 * e) - f(b - 2 * e))) / (12 * h)

    return np.block([[one(i, j) for j in range(b.shape[1])] for i in range(b.shape[0])])


def close(a, b, what):
    error = np.abs(a - b).max() / max(1.0, np.abs(b).max())
    print(f"{what}: {error:.1e}")
    assert a.shape == b.shape
    assert error < 1e-9


def test_permutation_is_the_sum_of_units():
    for p, q in [(1, 4), (2, 3), (3, 3)]:
        whole = sum(mc.kron(mc.unit(i, k, p, q), mc.unit(k, i, q, p)) for i in range(p) for k in range(q))
        assert np.array_equal(mc.permutation(p, q), whole)


def test_permutation_exchanges_factors():
    rng = np.random.default_rng(0)
    A, C = rng.normal(size=(2, 3)), rng.normal(size=(4, 5))
    U, W = mc.permutation(2, 4), mc.permutation(5, 3)
    assert np.allclose(mc.kron(A, C), U @ mc.kron(C, A) @ W, atol=1e-15)


def test_strings():
    A = np.arange(6.0).reshape(2, 3)
    assert np.array_equal(mc.cs(A)[:, 0], [0, 3, 1, 4, 2, 5])
    assert np.array_equal(mc.rs(A)[0], [0, 1, 2, 3, 4, 5])


@pytest.mark.parametrize(("a", "d", "of"), SHAPES)
def test_rules(a, d, of):
    rng = np.random.default_rng(1)
    B = rng.normal(size=of)
    A, D = smooth(a, of, 2), smooth(d, of, 3)
    dA, dD = mc.derivative(A, B), mc.derivative(D, B)
    close(dA, differences(A, B), "complex step")
    close(mc.product_rule(A(B), dA, D(B), dD, of), differences(lambda b: A(b) @ D(b), B), "product")
    close(mc.kron_rule(A(B), dA, D(B), dD, of), differences(lambda b: np.kron(A(b), D(b)), B), "Kronecker")
    outer = smooth(a, d, 4)
    dF = mc.derivative(outer, D(B))
    whole = differences(lambda b: outer(D(b)), B)
    close(mc.chain_rule(dF, dD, a, d, of), whole, "chain, rows")
    close(mc.chain_rule_columns(dF, dD, a, d, of), whole, "chain, columns")


def test_inverse_rule():
    B = np.random.default_rng(5).normal(size=(2, 3))
    base = smooth((3, 3), (2, 3), 6)
    A = lambda b: base(b) + 8 * np.eye(3)  # noqa: E731
    close(mc.inverse_rule(A(B), mc.derivative(A, B), (2, 3)), differences(lambda b: np.linalg.inv(A(b)), B), "inverse")


def test_vetter_and_back():
    d = np.random.default_rng(7).normal(size=(4, 5, 2, 3))
    block = mc.vetter(d, (2, 3))
    assert block.shape == (8, 15)
    assert np.array_equal(block[4:8, 10:15], d[:, :, 1, 2])
    assert np.array_equal(mc.entries(block, (2, 3)), d)
    in_time = mc.Derivative.of(np.stack([d, 2 * d]), (2, 3), 2)
    assert np.array_equal(in_time.vetter(), np.stack([block, 2 * block]))
    import pickle

    assert np.array_equal(pickle.loads(pickle.dumps(in_time)).vetter(), in_time.vetter())


def test_bad_input():
    with pytest.raises(mb.errors.ModelError, match="does not end in the parameter's shape"):
        mc.vetter(np.zeros((3, 2)), (3, 3))
    with pytest.raises(mb.errors.ModelError, match="block layout"):
        mc.product_rule(np.eye(2), np.zeros((2, 2)), np.eye(2), np.zeros((4, 4)), (2, 2))
    with pytest.raises(mb.errors.ModelError, match="singular"):
        mc.inverse_rule(np.zeros((2, 2)), np.zeros((4, 4)), (2, 2))
    with pytest.raises(mb.errors.ModelError, match="equal blocks"):
        mc.entries(np.zeros((3, 4)), (2, 2))


A = np.arange(6.0).reshape(2, 3)


@pytest.mark.parametrize("f", [np.abs, lambda b: np.abs(b).sum(), lambda b: b.real, lambda b: [np.linalg.norm(b)]])
def test_functions_without_slopes_that_change_are_refused(f):
    with pytest.raises(mb.errors.NotDifferentiableError, match="not analytic"):
        mb.matrix_calculus.derivative(f, A + 1.0)


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1.0, 1e6, 1e12])
def test_whether_a_function_is_analytic_does_not_depend_on_units(size):
    """Entries and values in any unit: what changes without a slope is refused, what has an extremum is not."""
    b = size * np.array([[1.3, -0.4], [0.0, 2.0]])
    for value in (1e-15, 1.0, 1e15):
        with pytest.raises(mb.errors.NotDifferentiableError, match="not analytic"):
            mc.derivative(lambda x, value=value: value * np.abs(x) / size, b)
        d = mc.derivative(lambda x, value=value: value * (x / size - 1.3) ** 2 / (x / size + 3.0), b[:1, :1])
        assert np.abs(d) <= 1e-12 * value / size
        steep = mc.derivative(lambda x, value=value: value * (x / size) ** 9 * (1 + x / size), b[1:, :1])
        assert np.abs(steep).max() < 1e-100
        assert not np.any(mc.derivative(lambda x, value=value: value * np.eye(2) + 0 * x, b))


def test_entries_without_effect_are_zero():
    d = mb.matrix_calculus.derivative(lambda b: [[b[0, 0] ** 2, 3.0]], A)
    assert not d.any()
    d = mb.matrix_calculus.derivative(lambda b: [[b[1, 2] ** 2, 3.0]], A)
    assert d.ravel().tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 10, 0]


BAD = [
    lambda mc: mc.unit(5, 0, 2, 2),
    lambda mc: mc.unit(-1, 0, 2, 2),
    lambda mc: mc.permutation(1.5, 2),
    lambda mc: mc.permutation("a", 2),
    lambda mc: mc.permutation(0, 2),
    lambda mc: mc.rs([[1, 2], [3]]),
    lambda mc: mc.vetter(A, 3),
    lambda mc: mc.entries(A, "x"),
    lambda mc: mc.derivative(3, A),
    lambda mc: mc.derivative(lambda b: b, "x"),
    lambda mc: mc.inverse_rule(np.ones((2, 3)), np.zeros((2, 3)), ()),
    lambda mc: mc.product_rule(A, A, A, A, ()),
    lambda mc: mc.chain_rule(A, A, (2, 3), (1, 1), (1, 1)),
]


@pytest.mark.parametrize("call", BAD, ids=range(len(BAD)))
def test_wrong_matrices_are_named(call):
    with pytest.raises(mb.errors.ModelError):
        call(mb.matrix_calculus)
