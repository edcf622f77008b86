"""`mb.root`: iterate by iterate against the reference, counts of a program written separately, all problems, reuse, bad input."""

from __future__ import annotations

import os
import signal
import threading
import time

import mbrs as mb
import numpy as np
import pytest
import root_problems
from oracles.root import difference_jacobian, updated
from oracles.root import root as reference_root
from scipy import sparse

BARE = {"fallback": False, "restarts": 0, "patience": 10**6, "invariant": False}


def iterates(p, **options):
    """Of the core: (result, iterates from x0 on)."""
    met = [np.array(p.x0, dtype=float)]
    found = mb.root(p.fun, p.x0, callback=lambda x, f: met.append(x.copy()), **options)
    return found, met


@pytest.mark.parametrize("method", ["inverse-bfgs", "broyden"])
@pytest.mark.parametrize("jac0", ["identity", "fd"])
@pytest.mark.parametrize("name", list(root_problems.TABLE))
def test_iterates_are_those_of_the_reference(name, jac0, method):
    """Two programs that add in different orders drift apart by rounding, which a quasi-Newton iteration far from the
    solution multiplies: ten iterations are compared, at 1e-6 of the size of the iterates.
    """
    p = root_problems.problem(name)
    if p.n > 100:
        p = root_problems.problem(name, 64)
    found, met = iterates(p, method=method, jac0=jac0, tol=1e-8, maxiter=10, **BARE)
    other = reference_root(p.fun, p.x0, method, jac0, tol=1e-8, maxiter=10, **BARE)
    assert len(met) == len(other.iterates) > 1
    worst = max(np.abs(a - b).max() / max(1.0, np.abs(b).max()) for a, b in zip(met, other.iterates, strict=True))
    print(f"{name}, {method} from {jac0}: {len(met) - 1} iterations, largest difference {worst:.1e}")
    assert worst < 1e-6
    assert found.n_backtracks == other.backtracks
    assert found.nfev == other.evaluations


@pytest.mark.parametrize("name", ["Rosenbrock", "Chebyquad", "trigonometric", "helical valley"])
def test_the_driver_is_that_of_the_reference(name):
    """Restart and fallback happen at the same iterations of the first phase, and both end at a solution."""
    p = root_problems.problem(name)
    found = mb.root(p.fun, p.x0, tol=1e-8)
    other = reference_root(p.fun, p.x0, tol=1e-8)
    print(f"{name}: core {found.nit} iterations, fallback {found.fallback}; reference {len(other.norms) - 1}")
    assert found.success and other.reason == "converged"
    assert found.norms[1:10] == pytest.approx(other.norms[1:10], rel=1e-5)
    assert (found.fallback is None) == (other.fallback is None)


# Iterations to 1e-8 of the bare method, docs/theory.md (19.1) to (19.4), by a program written separately; None: fails.
IDENTITY = {
    "boundary value": 17,
    "integral": 6,
    "Brown almost-linear": 13,
    "exponential": 10,
    "tridiagonal cubic": 15,
    "Broyden tridiagonal": None,
    "trigonometric": None,
    "Rosenbrock": None,
    "Powell singular": None,
}
DIFFERENCES = {
    "Broyden tridiagonal": 11,
    "boundary value": 3,
    "integral": 4,
    "Freudenstein-Roth": 22,
    "Brown almost-linear": 23,
    "exponential": 44,
    "trigonometric": None,
    "Rosenbrock": None,
    "Powell singular": None,
}
BROYDEN = {"trigonometric": 19, "Rosenbrock": 10, "Powell singular": 22}


@pytest.mark.parametrize(
    ("name", "method", "jac0", "expected"),
    [(n, "inverse-bfgs", "identity", k) for n, k in IDENTITY.items()]
    + [(n, "inverse-bfgs", "fd", k) for n, k in DIFFERENCES.items()]
    + [(n, "broyden", "fd", k) for n, k in BROYDEN.items()],
)
def test_iteration_counts_of_the_bare_method(name, method, jac0, expected):
    p = root_problems.problem(name)
    found = mb.root(p.fun, p.x0, method=method, jac0=jac0, tol=1e-8, maxiter=200, **BARE)
    print(f"{name}, {method} from {jac0}: {found.nit if found.success else 'fails'} (expected: {expected or 'fails'})")
    if expected is None:
        assert not found.success and found.reason == "max-iterations"
    else:
        assert found.success and found.nit == expected


def test_freudenstein_roth_fails_from_the_standard_start():
    """MGH 2 from (0.5, -2), where inverse BFGS from the identity fails too."""
    p = root_problems.problem("Freudenstein-Roth")
    found = mb.root(p.fun, np.tile([0.5, -2.0], 5), jac0="identity", tol=1e-8, maxiter=200, **BARE)
    assert not found.success


@pytest.mark.parametrize("n", [None, "large"])
@pytest.mark.parametrize("name", list(root_problems.TABLE))
def test_every_problem_is_solved_by_the_defaults(name, n):
    p = root_problems.problem(name)
    if n == "large":
        if p.band is None or name == "exponential":
            pytest.skip("full Jacobian, or defined for its size only")
        size = 1000 if name != "Bratu" else 900
        p = root_problems.problem(name, size)
    options = {} if p.band is None else {"sparsity": p.sparsity(), "memory": None if p.n < 100 else 40}
    found = mb.root(p.fun, p.x0, tol=1e-8, **options)
    print(f"{name} ({p.n}): {found.nit} iterations, {found.nfev} evaluations, norm {found.norm:.1e}, {found.message}")
    assert found.success, found.message
    assert np.linalg.norm(p.fun(found.x)) <= 1e-8
    assert found.fun == pytest.approx(p.fun(found.x), abs=1e-12)


@pytest.mark.parametrize(
    "name", [name for name in root_problems.TABLE if root_problems.problem(name).answer is not None]
)
def test_known_roots_are_met(name):
    """Powell's singular function is a square at its root: residuals of 1e-12 leave 1e-6 of the unknowns."""
    p = root_problems.problem(name)
    assert np.abs(p.fun(p.answer)).max() < 1e-11
    if name not in root_problems.SEVERAL_ROOTS:
        near = 1e-5 if name == "Powell singular" else 1e-9
        assert mb.root(p.fun, p.x0, tol=1e-12).x == pytest.approx(p.answer, abs=near)


def test_a_stall_is_met_by_the_fallback_and_said():
    p = root_problems.problem("Rosenbrock")
    found = mb.root(p.fun, p.x0)
    assert found.success and found.method == "broyden" and found.fallback > 0 and found.n_restarts == 1
    assert "Broyden's update took over" in found.message
    assert found.x == pytest.approx(np.ones(10), abs=1e-8)


def test_reuse_of_the_inverse_saves_the_differences():
    p = root_problems.problem("Broyden tridiagonal")
    first = mb.root(p.fun, p.x0)
    near = mb.root(lambda x: p.fun(x) - 0.01, first.x, inverse0=first.inverse)
    cold = mb.root(lambda x: p.fun(x) - 0.01, first.x)
    print(f"evaluations with H handed in {near.nfev}, without {cold.nfev}")
    assert near.success and near.nfev < cold.nfev
    q = root_problems.problem("boundary value", 50)
    one = mb.root(q.fun, q.x0)
    again, anew = (mb.root(lambda x: q.fun(x) - 1e-5, one.x, inverse0=h) for h in (one.inverse, None))
    print(f"of a symmetric problem: {again.nfev} and {anew.nfev}")
    assert again.success and again.nfev <= anew.nfev - q.n + 1
    limited = mb.root(p.fun, p.x0, memory=20, sparsity=p.sparsity())
    again = mb.root(p.fun, first.x + 0.01, memory=20, inverse0=limited.inverse)
    assert again.success and again.nfev < 15
    assert limited.inverse.matrix() is None and limited.inverse.apply(np.ones(10)).shape == (10,)


def test_limited_memory_that_keeps_all_pairs_is_the_whole_matrix():
    p = root_problems.problem("Broyden banded")
    for method in ("inverse-bfgs", "broyden"):
        whole, a = iterates(p, method=method, sparsity=p.sparsity(), memory=None, **BARE)
        few, b = iterates(p, method=method, sparsity=p.sparsity(), memory=100, **BARE)
        worst = max(np.abs(x - y).max() for x, y in zip(a, b, strict=True))
        print(f"{method}: {whole.nit} iterations, largest difference {worst:.1e}")
        assert worst < 1e-8
        # the core keeps pairs instead of H only here
        assert few.inverse is not None and not isinstance(few.inverse, np.ndarray)


def test_sparsity_needs_as_many_evaluations_as_the_band_is_wide():
    p = root_problems.problem("Broyden tridiagonal", 1000)
    found = mb.root(p.fun, p.x0, sparsity=p.sparsity(), memory=50)
    assert found.success and found.nfev == 1 + 3 + found.nit + found.n_backtracks


def test_scales_make_the_iteration_independent_of_units():
    p = root_problems.problem("Broyden tridiagonal")
    units = 10.0 ** np.linspace(-6, 6, p.n)
    rows = 10.0 ** np.linspace(5, -5, p.n)
    plain = mb.root(p.fun, p.x0)
    scaled = mb.root(lambda x: rows * p.fun(x / units), p.x0 * units, x_scale=units, f_scale=rows)
    assert scaled.success and scaled.nit == plain.nit
    assert scaled.x / units == pytest.approx(plain.x, rel=1e-6)
    by_rows = mb.root(lambda x: rows * p.fun(x), p.x0, f_scale="jac")
    assert by_rows.success and by_rows.x == pytest.approx(plain.x, rel=1e-8)


def test_jac0_as_an_array():
    p = root_problems.problem("Broyden tridiagonal")
    jacobian = difference_jacobian(p.fun, p.x0, p.fun(p.x0))
    given, a = iterates(p, jac0=jacobian)
    made, b = iterates(p)
    assert given.nfev == made.nfev - p.n
    assert np.abs(a[-1] - b[-1]).max() < 1e-9


def test_determinant_ratio_is_the_one_of_the_determinants():
    """The safeguard's ratio -lambda s.F/(y.s) against determinants, for a nonsymmetric H (docs/theory.md (19.4))."""
    rng = np.random.default_rng(3)
    H, f, y = rng.normal(size=(5, 5)), rng.normal(size=5), rng.normal(size=5)
    lam = 0.25
    s = -lam * H @ f
    new = updated(H, s, y, f, lam, "inverse-bfgs")
    assert np.linalg.det(new) / np.linalg.det(H) == pytest.approx(-lam * (s @ f) / (y @ s), rel=1e-9)


def test_guard_leaves_updates_out():
    found = mb.root(root_problems.rosenbrock, [-1.2, 1.0], curvature=0.5, maxiter=30, **BARE)
    assert found.n_skipped > 0


def test_one_unknown_and_scalars():
    found = mb.root(lambda x: x**3 - 2, 1.0)
    assert found.success and found.x == pytest.approx([2 ** (1 / 3)], rel=1e-12)
    assert mb.root(lambda x, a: [x[0] - a], [0.0], args=(3.0,)).x == pytest.approx([3.0])
    solved = mb.root(lambda x: x - 1, np.ones(3))
    assert solved.success and solved.nit == 0 and solved.nfev == 1


def test_no_solution_ends_with_the_best_point():
    found = mb.root(lambda x: [x[0] ** 2 + 1.0], [3.0])
    assert not found.success and found.reason in ("stalled", "line-search") and "start elsewhere" in found.message
    assert abs(found.x[0]) < 0.1


def test_singular_start_is_said_and_survived():
    """Both columns of the first row vanish where x[0] < 0."""
    found = mb.root(lambda x: [max(x[0], 0.0) ** 2 - 1, x[1] - x[0]], [-0.5, 5.0], maxiter=5)
    assert "singular" in found.message and np.isfinite(found.x).all()


def test_nan_away_from_the_start_shortens_the_step():
    with np.errstate(invalid="ignore"):
        found = mb.root(lambda x: np.log(x) + 3, [2.0], jac0="identity")
    assert found.success and found.x == pytest.approx([np.exp(-3)], rel=1e-8)


def test_limits():
    p = root_problems.problem("Powell singular")
    assert mb.root(p.fun, p.x0, maxiter=3).reason == "max-iterations"
    found = mb.root(p.fun, p.x0, maxfev=8)
    assert found.reason == "max-evaluations" and found.nfev < 80
    assert mb.root(p.fun, p.x0, callback=lambda x, f: True).reason == "stopped"


def raises_zero_division(x):
    return [1 / 0]


@pytest.mark.parametrize(
    ("fun", "x0", "options", "text"),
    [
        (lambda x: x, [np.nan], {}, r"x0 contains .*, nan at \[0\]"),
        (lambda x: x, [np.inf, 1], {}, r"x0 contains .*, inf at \[0\]"),
        (lambda x: x, [], {}, "at least one unknown"),
        (lambda x: x, [[1.0, 2.0]], {}, "one-dimensional"),
        (lambda x: x, [1j], {}, "complex"),
        (lambda x: x, ["a"], {}, "one-dimensional array"),
        (lambda x: x, [[1], [2, 3]], {}, "one-dimensional array"),
        (lambda x: x * 1j, [1.0], {}, "complex"),
        (lambda x: [1.0, 2.0], [1.0], {}, "one residual for each unknown"),
        (lambda x: "text", [1.0], {}, "real numbers"),
        (lambda x: None, [1.0], {}, "real numbers"),
        (lambda x: [np.nan, 1.0], [1.0, 2.0], {}, r"fun\(x0\)\[0\] is nan"),
        ("no function", [1.0], {}, "give a function"),
        (lambda x: x, [1.0], {"method": "newton"}, "inverse-bfgs"),
        (lambda x: x, [1.0], {"jac0": "exact"}, "jac0"),
        (lambda x: x, [1.0], {"jac0": np.eye(2)}, r"jac0 must have the shape \(1, 1\), its shape is \(2, 2\)"),
        (lambda x: x, [1.0], {"jac0": [[0.0]]}, "singular"),
        (lambda x: x, [1.0], {"inverse0": [[np.nan]]}, "inverse0"),
        (lambda x: x, [1.0], {"tol": 0.0}, "tol"),
        (lambda x: x, [1.0], {"tol": np.nan}, "tol"),
        (lambda x: x, [1.0], {"maxiter": -1}, "maxiter"),
        (lambda x: x, [1.0], {"maxfev": 1.5}, "maxfev"),
        (lambda x: x, [1.0], {"rho": 1.0}, "rho"),
        (lambda x: x, [1.0], {"x_scale": 0.0}, "x_scale"),
        (lambda x: x, [1.0], {"f_scale": [1.0, 2.0]}, "f_scale"),
        (lambda x: x, [1.0], {"f_scale": "auto"}, "f_scale"),
        (lambda x: x, [1.0], {"memory": 0}, "memory"),
        (lambda x: x, [1.0], {"memory": "some"}, "memory"),
        (lambda x: x, [1.0], {"sparsity": np.eye(2)}, "sparsity"),
        (lambda x: x, [1.0], {"determinant": (2.0, 1.0)}, "determinant"),
        (lambda x: x, [1.0], {"determinant": 3}, "determinant"),
        (lambda x: x, [1.0], {"curvature": np.nan}, "curvature"),
        (lambda x: x, [1.0], {"callback": 3}, "callback"),
    ],
)
def test_bad_input_names_itself(fun, x0, options, text):
    with pytest.raises(mb.ModelError, match=text):
        mb.root(fun, x0, **options)


def test_what_fun_raises_comes_through():
    class OwnError(Exception):
        pass

    marker = OwnError("mine")

    def later(x):
        if x[0] < 1.9:
            raise marker
        return [x[0] - 1]

    with pytest.raises(OwnError) as caught:
        mb.root(later, [2.0])
    assert caught.value is marker
    with pytest.raises(ZeroDivisionError):
        mb.root(raises_zero_division, [1.0])
    with pytest.raises(ZeroDivisionError):
        mb.root(lambda x: x - 1, [3.0], callback=lambda x, f: 1 / 0)


def test_wrong_shape_in_the_middle():
    calls = []

    def changes(x):
        calls.append(1)
        return x - 1 if len(calls) < 3 else np.ones(3)

    with pytest.raises(mb.ModelError, match="one residual for each unknown"):
        mb.root(changes, [5.0, 6.0])


def test_ctrl_c():
    def slow(x):
        time.sleep(0.01)
        return x**2 + 1

    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    began = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        mb.root(slow, np.ones(40), maxiter=10**6, patience=10**6)
    assert time.perf_counter() - began < 5


def test_counts_without_end_are_no_error():
    many = 10**30
    sol = mb.root(lambda x: x**2 - 2, [1.0], maxiter=many, maxfev=many, patience=many, max_backtracks=many)
    assert sol.success


def test_an_inverse_of_another_size_is_refused():
    """Also one of limited memory, which has no matrix whose shape could be asked."""
    band = sparse.diags([np.ones(2999), np.ones(3000), np.ones(2999)], [-1, 0, 1])
    kept = mb.root(root_problems.broyden_tridiagonal, -np.ones(3000), sparsity=band).inverse
    assert kept.n == 3000
    for n in (2, 3001):
        with pytest.raises(mb.ModelError, match="of 3000 unknowns"):
            mb.root(root_problems.broyden_tridiagonal, -np.ones(n), inverse0=kept)


def algorithm_1(fun, x, tol, most):
    """The source's iteration in its words, from the identity: backtracking, step, inverse BFGS, test of the determinant."""
    H, f, norms, backs = np.eye(len(x)), fun(x), [], 0
    while np.linalg.norm(f) > tol and len(norms) < most:
        norms.append(np.linalg.norm(f))
        k, d = len(norms) - 1, -H @ f
        lam, size = 1.0, np.linalg.norm
        if not size(fun(x + d)) <= 0.9 * size(f) - 1e-3 * d @ d:
            while not size(fun(x + lam * d)) <= (1 + 1 / (k + 1) ** 2) * size(f) - 1e-3 * lam**2 * d @ d:
                lam, backs = 0.5 * lam, backs + 1
        s = lam * d
        y = fun(x + s) - f
        V = np.eye(len(x)) - np.outer(s, y) / (y @ s)
        new = V @ H @ V.T + np.outer(s, s) / (y @ s)
        if 1e-10 <= abs(np.linalg.det(new) / np.linalg.det(H)) <= 1e10:
            H = new
        x, f = x + s, f + y
    return x, len(norms), backs, np.linalg.norm(f) <= tol


@pytest.mark.parametrize("seed", range(6))
def test_plain_is_the_algorithm_of_the_source(seed):
    """Gradients of random convex functions: the same iterations and backtracking steps as a script of twenty lines."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    A, b, x0 = Q @ np.diag(rng.uniform(0.5, 3.0, n)) @ Q.T, rng.normal(size=n), rng.normal(size=n)

    def fun(x):
        return A @ x + 0.3 * x**3 - b

    x, iterations, backs, solved = algorithm_1(fun, x0, 1e-9, 200)
    found = mb.root(fun, x0, plain=True, tol=1e-9)
    assert solved and found.success and (found.nit, found.n_backtracks) == (iterations, backs)
    assert found.x == pytest.approx(x, abs=1e-9)
    assert found.nfev == 1 + iterations + backs and found.method == "inverse-bfgs"


def test_plain_adds_nothing():
    """It fails where the words alone fail, and refuses what they do not hold."""
    p = root_problems.problem("Broyden tridiagonal")
    found = mb.root(p.fun, p.x0, plain=True, tol=1e-8)
    assert not found.success and found.fallback is None and found.n_restarts == 0
    assert mb.root(p.fun, p.x0, plain=True, jac0="fd", tol=1e-8).nit == DIFFERENCES["Broyden tridiagonal"]
    for given in ({"restarts": 2}, {"memory": 5}, {"patience": 7}, {"sparsity": np.eye(10)}):
        with pytest.raises(mb.ModelError, match=f"without {next(iter(given))}="):
            mb.root(p.fun, p.x0, plain=True, **given)
