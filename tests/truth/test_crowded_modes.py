"""Lowest modes of large systems whose frequencies lie close together, far from zero; massless coordinates; cut groups."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp


def on_foundation(n: int, ground: float, order: np.ndarray | None = None) -> mb.MechanicalSystem:
    """A row of unit masses and springs, each mass on a spring of its own: lambda_j = ground + 4 sin^2(j pi/(2 n + 2))."""
    K = sp.diags([(2 + ground) * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]).tocsr()
    if order is not None:
        K = K[order][:, order]
    return mb.MechanicalSystem(sp.identity(n).tocsr(), K=K)


def row(n: int, ground: float) -> np.ndarray:
    return np.sqrt(ground + 4 * np.sin(np.arange(1, n + 1) * np.pi / (2 * n + 2)) ** 2)


@pytest.mark.parametrize(("n", "ground"), [(2000, 0.5), (5000, 0.47), (10000, 0.053), (3000, 0.0051), (3000, 37.0)])
def test_crowded_lowest_modes(n, ground):
    order = np.random.default_rng(n).permutation(n)
    r = mb.modes(on_foundation(n, ground, order), n=5)
    error = np.abs(r.omega / row(n, ground)[:5] - 1)
    print(f"n {n}, ground {ground}: {error}, {r.error}, {r.stats.counts}, {r.stats.route}")
    assert error.max() < 1e-12 and np.all(error <= 10 * r.error) and r.status == "converged"
    assert "inertia" in r.stats.route


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


def test_crowded_roots_of_a_large_damped_row_are_refused_with_a_remedy_that_works():
    n = 1600
    K = sp.diags([np.full(n - 1, -1.0), np.full(n, 2.53), np.full(n - 1, -1.0)], [-1, 0, 1]).tocsr()
    dashpot = sp.csr_matrix(([0.02], ([731], [731])), shape=(n, n))
    system = mb.MechanicalSystem(sp.identity(n).tocsr(), 0.013 * sp.identity(n).tocsr() + dashpot, K)
    with pytest.raises(mb.ConvergenceError, match=r"1600 coordinates: .*reduce the matrices") as problem:
        mb.modes(system, n=6)
    assert "shift" not in str(problem.value)


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
