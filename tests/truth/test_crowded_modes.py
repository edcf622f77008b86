"""Lowest modes of large systems whose frequencies lie close together, far from zero; massless coordinates; cut groups."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp
from mpmath import mp


def on_foundation(n: int, ground: float, order: np.ndarray | None = None) -> mb.MechanicalSystem:
    """A row of unit masses and springs, each mass on a spring of its own: lambda_j = ground + 4 sin^2(j pi/(2 n + 2))."""
    K = sp.diags([(2 + ground) * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]).tocsr()
    if order is not None:
        K = K[order][:, order]
    return mb.MechanicalSystem(sp.identity(n).tocsr(), K=K)


def row(n: int, ground: float) -> np.ndarray:
    return np.sqrt(ground + 4 * np.sin(np.arange(1, n + 1) * np.pi / (2 * n + 2)) ** 2)


@pytest.mark.some(2)
@pytest.mark.parametrize(("n", "ground"), [(2000, 0.5), (5000, 0.47), (10000, 0.053), (3000, 0.0051), (3000, 37.0)])
def test_crowded_lowest_modes(n, ground):
    order = np.random.default_rng(n).permutation(n)
    r = mb.modes(on_foundation(n, ground, order), n=5)
    error = np.abs(r.omega / row(n, ground)[:5] - 1)
    print(f"n {n}, ground {ground}: {error}, {r.error}, {r.stats.counts}, {r.stats.route}")
    assert error.max() < 1e-12 and np.all(error <= 10 * r.error) and r.status == "converged"
    assert "inertia" in r.stats.route


@pytest.mark.parametrize(("n", "factors"), [(400, 5), (1500, 6)])
def test_a_free_chain_of_springs_of_all_sizes(n, factors):
    """Of K = B^T B the roots are singular values of B, which is bidiagonal: LAPACK finds all of their digits."""
    k = np.exp(np.random.default_rng(0).uniform(-8, 8, n - 1))
    K = sp.diags([np.r_[k, 0] + np.r_[0, k], -k, -k], [0, 1, -1]).tocsr()
    r = mb.modes(mb.MechanicalSystem(sp.identity(n).tocsr(), K=K), n=8)
    print(f"{n}: {r.error}, {r.stats.counts}, {r.stats.route}")
    assert r.omega[0] == 0 and r.error[1:].max() < 1e-5 and r.stats.counts["factorisations"] < factors
    if n == 400:
        B = np.diag(np.sqrt(k), 1)[:-1]
        B[np.arange(n - 1), np.arange(n - 1)] = -np.sqrt(k)
        exact = np.sort(sl.svd(B, compute_uv=False, lapack_driver="gesvd"))[:7]
        assert np.all(np.abs(r.omega[1:] / exact - 1) <= r.error[1:])


def test_ordinary_lowest_modes_move_no_shift():
    r = mb.modes(on_foundation(2000, 0.0), n=5)
    assert np.abs(r.omega / row(2000, 0.0)[:5] - 1).max() < 1e-10 and "moved shifts" not in r.stats.counts


@pytest.mark.parametrize("where", [0.12, 0.2071, 0.333])
def test_modes_near_a_frequency(where):
    """0.333 Hz lies above all: the highest ones."""
    n = 1500
    exact = row(n, 0.47) / (2 * np.pi)
    nearest = np.sort(exact[np.argsort(np.abs(exact**2 - where**2))[:6]])
    r = mb.modes(on_foundation(n, 0.47), n=6, shift=where)
    assert np.allclose(r.frequency, nearest, rtol=1e-11) and "inertia" in r.stats.route
    dense = on_foundation(40, 0.47)
    small = mb.MechanicalSystem(np.eye(40), K=dense.K.toarray())
    exact = row(40, 0.47) / (2 * np.pi)
    r = mb.modes(small, n=3, shift=where)
    assert np.allclose(r.frequency, np.sort(exact[np.argsort(np.abs(exact**2 - where**2))[:3]]), rtol=1e-12)
    K = small.K
    for f, x in zip(r.frequency, r.shape.T, strict=True):
        assert np.linalg.norm(K @ x - (2 * np.pi * f) ** 2 * x) < 1e-12


def test_a_shift_must_make_sense():
    s = on_foundation(20, 0.5)
    for options in ({"shift": 1.0}, {"shift": -1.0, "n": 2}, {"shift": float("nan"), "n": 2}, {"shift": "low", "n": 2}):
        with pytest.raises(mb.ModelError, match="shift"):
            mb.modes(s, **options)
    dashpot = sp.csr_matrix(([0.1], ([3], [3])), shape=s.M.shape)
    damped = mb.MechanicalSystem(s.M, 0.1 * s.M + dashpot, s.K)
    with pytest.raises(mb.ModelError, match="shift"):
        mb.modes(damped, n=2, shift=0.1)


@pytest.mark.parametrize("n", [1, 10, 30])
def test_a_group_that_n_cuts_is_named(n):
    """600 oscillators, 400 of them equal: which of their shapes come back is arbitrary."""
    rng = np.random.default_rng(3)
    k = np.r_[np.full(400, 1.37), rng.uniform(3, 9, 200)][rng.permutation(600)]
    r = mb.modes(mb.MechanicalSystem(sp.identity(600).tocsr(), K=sp.diags(k).tocsr()), n=n)
    assert r.cut_group == tuple(range(n))
    split = mb.modes(mb.MechanicalSystem(sp.identity(600).tocsr(), K=sp.diags(np.linspace(1, 9, 600)).tocsr()), n=n)
    assert split.cut_group == ()


@pytest.mark.parametrize("kind", ["points", "rods"])
def test_chains_of_bodies_without_inertia(kind):
    """A hanging chain of point masses, or of rods without inertia about their own axes: sparse and dense agree."""
    n = 450
    m = mb.Model(kind, gravity=(0, 0, -9.81))
    before, length = m.ground, 0.11
    for i in range(n):
        inertia = (0, 0, 0) if kind == "points" else (length**2 / 12, length**2 / 12, 0)
        mass = 1.0 + 0.3 * np.sin(i)
        depth = (i + 1) * length if kind == "points" else (i + 0.5) * length
        b = m.body(f"b{i}", mass=mass, inertia=np.array(inertia) * mass, at=(0, 0, -depth))
        m.revolute(f"j{i}", before, b, at=(0, 0, -i * length), axis=(0.6, 0.8, 0.0))
        before = b
    few = mb.modes(m, n=5)
    lin = mb.linearize(m)
    exact = np.sqrt(sl.eigh(lin.K, lin.M, eigvals_only=True, subset_by_index=[0, 4]))
    print(few.omega / exact - 1, few.error, few.stats.route)
    assert few.stats.route.startswith("sparse") and np.allclose(few.omega, exact, rtol=1e-8)


@pytest.mark.slow
def test_crowded_damped_roots_of_a_long_row():
    """Masses on an elastic foundation with C = a M + b K: s^2 + (a + b l) s + l = 0, l = 2.5 - 2 cos(k pi/(n + 1)).

    No real shift parts them: the dense route does.
    """
    n, a, b = 1000, 0.01, 0.003
    one = sp.identity(n, format="csr")
    K = sp.diags([2.5 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]).tocsr()
    r = mb.modes(mb.MechanicalSystem(one, C=(a * one + b * K).tocsr(), K=K), n=5)
    lam = 2.5 - 2 * np.cos(np.pi * np.arange(1, 6) / (n + 1))
    half = (a + b * lam) / 2
    known = -half + 1j * np.sqrt(lam - half**2)
    error = np.abs(r.eigenvalue / known - 1).max()
    print(f"{r.stats.route}: error {error:.1e}, estimate {r.error.max():.1e}")
    assert error < 4 * r.error.max() < 1e-12 and r.status == "converged"


def foundation(n: int) -> sp.csr_matrix:
    return sp.diags([np.full(n - 1, -1.0), np.full(n, 2.5), np.full(n - 1, -1.0)], [-1, 0, 1]).tocsr()


def skew(n: int) -> sp.csr_matrix:
    return sp.diags([np.ones(n - 1), -np.ones(n - 1)], [1, -1]).tocsr()


def dashpots(n: int, c: dict[int, float]) -> sp.csr_matrix:
    return sp.csr_matrix((list(c.values()), (list(c), list(c))), shape=(n, n))


def general_row(kind: str, n: int) -> mb.MechanicalSystem:
    one, K = sp.identity(n).tocsr(), foundation(n)
    rng = np.random.default_rng(n)
    if kind == "one dashpot":
        return mb.MechanicalSystem(one, dashpots(n, {n // 3: 0.02}), K)
    if kind == "dashpots":
        return mb.MechanicalSystem(
            one, dashpots(n, dict(zip(rng.permutation(n)[:5], rng.uniform(0.01, 3, 5), strict=True))), K
        )
    if kind == "heavy dashpot":
        return mb.MechanicalSystem(one, 0.013 * one + dashpots(n, {n // 7: 40.0}), K)
    if kind == "damping everywhere":
        return mb.MechanicalSystem(one, sp.diags(rng.uniform(0, 0.1, n)).tocsr(), K)
    if kind == "gyroscopic":
        return mb.MechanicalSystem(one, K=K, G=1e-3 * skew(n))
    if kind == "circulatory":
        return mb.MechanicalSystem(one, K=K, N=1e-3 * skew(n))
    return mb.MechanicalSystem(one, dashpots(n, {n // 3: 0.02}), K, G=3e-3 * skew(n), N=1e-3 * skew(n))


KINDS = ("one dashpot", "dashpots", "gyroscopic", "circulatory", "all")


@pytest.mark.some(1)
@pytest.mark.parametrize("n", [450, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", KINDS)
def test_crowded_general_roots_are_those_of_the_state_matrix(kind, n):
    system = general_row(kind, n)
    found = mb.modes(system, n=8)
    D = sum((x for x in (system.C, system.G) if x is not None), 0 * system.M).toarray()
    S = (system.K if system.N is None else system.K + system.N).toarray()
    all_roots = sl.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-S, -D]]))
    every = np.sort_complex(all_roots[all_roots.imag > -1e-12])
    every = every[np.argsort(np.abs(every), kind="stable")][:8]
    error = np.array([np.abs(every - s).min() for s in found.eigenvalue]) / np.abs(found.eigenvalue)
    print(f"{kind} {n}: {error.max():.1e}, {found.error.max():.1e}, {found.stats.route}, {found.stats.counts}")
    assert found.status == "converged" and "argument principle" in found.stats.route
    assert np.abs(np.abs(found.eigenvalue) - np.abs(every)).max() < 1e-9 and error.max() < 1e-8
    assert len(np.unique(np.round(found.eigenvalue, 11))) == 8


@pytest.mark.some(6)
@pytest.mark.parametrize("wanted", [1, 2, 4, 5, 7, 9])
@pytest.mark.parametrize("kind", ["gyroscopic", "circulatory", "all"])
def test_any_number_of_crowded_roots(kind, wanted):
    """No root that is none, and none missing, also where the search about a shift ends before all that it looks for have converged."""
    n = 2000
    system = general_row(kind, n)
    found, more = mb.modes(system, n=wanted), mb.modes(system, n=12)
    print(f"{kind} {wanted}: {found.status}, {found.error.max():.1e}, {found.stats.counts}")
    assert found.status == more.status == "converged" and "argument principle" in found.stats.route
    assert np.abs(found.eigenvalue - more.eigenvalue[:wanted]).max() < 1e-13
    if kind == "circulatory":
        exact = np.sqrt(2.5 - 2 * np.sqrt(1 - 1e-6) * np.cos(np.pi * np.arange(1, wanted + 1) / (n + 1)))
        assert np.abs(found.eigenvalue / (1j * exact) - 1).max() < 1e-9


def twin_row(n: int, c: tuple[float, float], g: float, nu: float) -> tuple[mb.MechanicalSystem, np.ndarray]:
    """Two coordinates at each site, each damped its own way or coupled by g and nu; and the roots with Im s >= 0.

    Sine shapes part it into s^2 + c s + l = 0, or into s^2 - i g s + l - i nu = 0 for x + i y and its conjugate.
    """
    lam = 2.5 - 2 * np.cos(np.pi * np.arange(1, n + 1) / (n + 1))
    one, J = sp.identity(n), np.array([[0.0, -1.0], [1.0, 0.0]])
    M, K = sp.identity(2 * n).tocsr(), sp.kron(foundation(n), np.eye(2)).tocsr()
    C = sp.kron(one, np.diag(c)).tocsr() if any(c) else None
    G = sp.kron(one, g * J).tocsr() if g else None
    N = sp.kron(one, nu * J).tocsr() if nu else None
    if C is not None:
        assert not g and not nu
        roots = np.concatenate([-x / 2 + 1j * np.sqrt(lam - x * x / 4) for x in c])
    else:
        one_way = [np.sqrt(-(g**2) / 4 - lam + 1j * nu + 0j), -np.sqrt(-(g**2) / 4 - lam + 1j * nu + 0j)]
        roots = np.concatenate([0.5j * g + r for r in one_way])
        roots = np.where(roots.imag >= 0, roots, roots.conj())
    return mb.MechanicalSystem(M, C, K, G=G, N=N), roots[np.argsort(np.abs(roots))]


@pytest.mark.some(1)
@pytest.mark.parametrize("n", [1000, pytest.param(5000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("c", "g", "nu"), [((0, 0), 0.3, 0), ((0, 0), 0.01, 0.004)])
def test_crowded_general_roots_of_a_twin_row(n, c, g, nu):
    system, exact = twin_row(n, c, g, nu)
    found = mb.modes(system, n=6)
    error = np.array([np.abs(exact[:40] - s).min() for s in found.eigenvalue]) / np.abs(found.eigenvalue)
    print(f"{n} {c} {g} {nu}: {error}, {found.error}, {found.stats.route}, {found.stats.counts}")
    assert found.status == "converged" and np.all(error <= 10 * found.error + 1e-15) and found.error.max() < 1e-9
    assert np.allclose(np.abs(found.eigenvalue), np.abs(exact[:6]), rtol=1e-12)


@pytest.mark.parametrize("n", [3000, pytest.param(10000, marks=pytest.mark.slow)])
def test_circulatory_row(n):
    """tridiag(-1 - e, 2.5, -1 + e) has the eigenvalues 2.5 - 2 sqrt(1 - e^2) cos(k pi/(n + 1))."""
    e = 1e-3
    found = mb.modes(mb.MechanicalSystem(sp.identity(n).tocsr(), K=foundation(n), N=e * skew(n)), n=10)
    exact = np.sqrt(2.5 - 2 * np.sqrt(1 - e * e) * np.cos(np.pi * np.arange(1, 11) / (n + 1)))
    error = np.abs(found.eigenvalue / (1j * exact) - 1)
    print(f"{n}: {error}, {found.error}, {found.stats.route}, {found.stats.counts}")
    assert found.status == "converged" and "argument principle" in found.stats.route
    assert np.all(error <= 10 * found.error) and error.max() < 1e-9


def row_with_a_dashpot(s: np.ndarray, n: int, at: int, c: float) -> tuple[np.ndarray, np.ndarray]:
    """det(s^2 + s c e e^T + K) as a number and the argument of what it is to be multiplied by: 2 cos p = 2.5 + s^2.

    sin((n + 1) p)/sin p + s c sin(a p) sin((n + 1 - a) p)/sin^2 p, a counted from 1, without exp(-i (n + 1) p).
    """
    p = np.arccos((2.5 + s * s) / 2 + 0j)
    p = np.where(p.imag >= 0, p, -p)
    rest = lambda m: 0.5j * (1 - np.exp(2j * m * p))  # noqa: E731
    value = rest(n + 1) / np.sin(p) + s * c * rest(at) * rest(n + 1 - at) / np.sin(p) ** 2
    return value, -(n + 1) * p.real


@pytest.mark.parametrize(
    "n", [2000, pytest.param(3000, marks=pytest.mark.slow), pytest.param(10000, marks=pytest.mark.slow)]
)
def test_a_long_row_with_one_dashpot(n):
    """The determinant in closed form is zero at the roots found, and its argument counts as many in the disc."""
    at, c = n // 3, 0.02
    found = mb.modes(mb.MechanicalSystem(sp.identity(n).tocsr(), dashpots(n, {at - 1: c}), foundation(n)), n=10)
    print(f"{n}: {found.error.max():.1e}, {found.stats.route}, {found.stats.counts}")
    assert found.status == "converged" and "argument principle" in found.stats.route and found.error.max() < 1e-11
    s = found.eigenvalue
    gap = np.diff(np.abs(s)).max() * 1e-3
    with mp.workdps(50):
        for root in s:

            def f(z):
                p = mp.acos((mp.mpf("2.5") + z * z) / 2)
                return (
                    mp.sin((n + 1) * p) / mp.sin(p)
                    + z * mp.mpf(c) * mp.sin(at * p) * mp.sin((n + 1 - at) * p) / mp.sin(p) ** 2
                )

            true = mp.mpc(complex(root))
            for _ in range(4):
                true -= f(true) / mp.diff(f, true)
            assert abs(f(true) / mp.diff(f, true)) < mp.mpf(10) ** -25
            assert abs(true - mp.mpc(complex(root))) <= 1e-12 * abs(true)
    radius = 0.5 * (np.abs(s[8]) + np.abs(s[9]))
    near = np.r_[0.0, np.geomspace(gap * 1e-2, np.pi / 2, 400_000)]
    theta = np.r_[np.pi / 2 - near[::-1], np.pi / 2 + near[1:]]
    value, turn = row_with_a_dashpot(radius * np.exp(1j * theta), n, at, c)
    steps = np.diff(np.angle(value) + turn)
    steps -= 2 * np.pi * np.round(steps / (2 * np.pi))
    assert np.abs(steps).max() < 2 and round(steps.sum() / np.pi) == 2 * 9


@pytest.mark.some(4)
@pytest.mark.parametrize(("a", "b"), [(0.013, 0.0), (0.0, 0.0021), (0.17, 0.0031), (4.1, 0.7), (-0.02, 0.003)])
@pytest.mark.parametrize("shift", [None, 0.19])
def test_proportional_damping_of_a_crowded_row_of_any_length(a, b, shift):
    """s^2 + (a + b w^2) s + w^2 = 0 with the w of the row without damping, by LAPACK's tridiagonal solver."""
    n, rng = 2300, np.random.default_rng(7)
    k, m = rng.uniform(0.8, 1.2, n + 1), rng.uniform(0.7, 1.4, n)
    diagonal, beside = k[1:] + k[:-1] + 0.53, -k[1:-1]
    K, M = sp.diags([beside, diagonal, beside], [-1, 0, 1]).tocsr(), sp.diags(m).tocsr()
    found = mb.modes(mb.MechanicalSystem(M, (a * M + b * K).tocsr(), K), n=6, shift=shift)
    wanted = 0.46 if shift is None else (2 * np.pi * shift) ** 2
    square = sl.eigh_tridiagonal(
        diagonal / m, beside / np.sqrt(m[1:] * m[:-1]), eigvals_only=True, lapack_driver="stebz", select="v",
        select_range=(0.0 if shift is None else wanted - 0.05, wanted + 0.05),
    )  # fmt: skip
    square = square[:6] if shift is None else square[np.sort(np.argsort(np.abs(square - wanted))[:6])]
    assert len(square) == 6
    exact = np.array([np.roots([1.0, a + b * w2, w2]) for w2 in square])
    best = np.array([min(abs(s - exact.ravel())) for s in found.roots])
    assert found.status == "converged" and "proportional" in found.stats.route and found.n == 6
    assert np.all(best <= 1e-12 * np.abs(found.roots)) and np.all(
        best[::2] <= 10 * found.error * np.abs(found.eigenvalue)
    )
    assert np.all(found.error < 1e-11) and len(np.unique(np.round(found.roots, 9))) == 12
    assert np.all((found.eigenvalue.imag > 0) | (found.eigenvalue.imag == 0))


def test_damping_that_is_nearly_proportional_takes_the_general_route():
    n = 500
    K = sp.diags([np.full(n - 1, -1.0), np.full(n, 2.07), np.full(n - 1, -1.0)], [-1, 0, 1]).tocsr()
    M = sp.identity(n).tocsr()
    for size, proportional in ((1e-15, True), (1e-9, False)):
        off = sp.csr_matrix(([size], ([3], [3])), shape=(n, n))
        found = mb.modes(mb.MechanicalSystem(M, 0.01 * M + 0.003 * K + off, K), n=2)
        assert ("proportional" in found.stats.route) == proportional, found.stats.route
