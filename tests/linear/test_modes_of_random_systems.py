"""Modes of random systems: residuals as LAPACK's testers measure them, roots against SciPy, errors against 40 digits."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
from matrix_systems import EPS, lapack_ratio, parts, skew, spd, state_matrix, system
from mbrs.linear.matrices import MechanicalSystem
from mbrs.linear.modal_result import KINDS
from mbrs.linear.modes import modes
from mpmath import mp
from oracles.precise import companion, exact_roots, relative_errors


def random_system(rng: np.random.Generator, i: int) -> MechanicalSystem:
    n = int(rng.integers(1, 8))
    M = spd(rng, n) if i % 3 else np.diag(10.0 ** rng.uniform(-3, 3, n))
    K = spd(rng, n)
    C = G = N = None
    match i % 12:
        case 1:
            C = 0.1 * M + 0.01 * K
        case 2:
            C = spd(rng, n, 0.0)
        case 3:
            G = skew(rng, n)
        case 4:
            C, G = spd(rng, n, 0.0), skew(rng, n)
        case 5:
            C, N = 0.3 * spd(rng, n), skew(rng, n)
        case 6:
            row = rng.standard_normal((int(rng.integers(0, n + 1)), n))
            K = row.T @ row  # singular: rigid modes
        case 7:
            row = rng.standard_normal((max(n - 2, 0), n))
            K, C = row.T @ row, np.outer(rng.standard_normal(n), np.ones(n))
            C = C @ C.T
        case 8:
            C = 10.0 ** rng.uniform(0, 4) * spd(rng, n, 0.0)
        case 9:
            K = rng.integers(-3, 4, (n, n)).astype(float)
            K, C = K + K.T, np.diag(rng.integers(0, 3, n)).astype(float)  # indefinite, often singular or repeated
        case 10:
            M, K, C = (
                np.eye(n),
                np.diag(rng.integers(0, 3, n)).astype(float),
                np.diag(rng.integers(0, 4, n)).astype(float),
            )
        case 11:
            K = np.diag(10.0 ** rng.uniform(-6, 6, n))
            N = skew(rng, n)
    return system(M, C, K, G=G, N=N)


@pytest.mark.slow
def test_ten_thousand_random_systems():
    rng = np.random.default_rng(20)
    worst, routes = 0.0, set()
    for i in range(10_000):
        s = random_system(rng, i)
        r = modes(s)
        assert r.n == s.n and r.roots.shape == (2 * s.n,) and set(r.kind) <= set(KINDS)
        assert np.all(np.isfinite(r.roots)) and np.all(np.isfinite(r.shape))
        assert np.all(np.diff(r.omega) >= -1e-7 * r.omega[1:])
        m, d, _ = parts(s)
        total = -np.trace(np.linalg.solve(m, d))
        assert abs(r.roots.sum() - total) <= 1e-7 * (np.abs(r.roots).sum() + abs(total)), (i, r.roots, total)
        ratio = lapack_ratio(r, s)
        assert ratio < 30, (i, ratio, r)
        worst = max(worst, ratio)
        routes.add(r.stats.route)
    print(f"largest LAPACK-style ratio {worst:.2f} over {sorted(routes)}")
    assert routes == {
        "undamped", "proportional", "general damping", "gyroscopic", "gyroscopic conservative", "circulatory",
    }  # fmt: skip


@pytest.mark.parametrize("n", [2, 5, 40])
@pytest.mark.parametrize("present", ["", "C", "G", "CG", "CGN", "N"])
def test_against_scipy(n, present):
    rng = np.random.default_rng(n)
    make = {"C": lambda: spd(rng, n), "G": lambda: skew(rng, n), "N": lambda: skew(rng, n)}
    s = system(spd(rng, n), K=spd(rng, n), **{name: make[name]() for name in present})
    r = modes(s)
    expected = sl.eig(state_matrix(s), right=False)
    distance = np.abs(expected[:, None] - r.roots[None, :])
    assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 1e-10 * np.abs(expected).max()
    m, d, _ = parts(s)
    for i, e in enumerate(r.eigenvalue):
        psi = r.shape[:, i] if r.left is None else r.left[:, i]
        slope = psi @ (2 * e * m + d) @ r.shape[:, i]
        if e.imag > 0:
            assert np.isclose(slope, 2j * e.imag, rtol=1e-9)
        else:
            assert np.isclose(r.shape[:, i].conj() @ m @ r.shape[:, i], 1.0, rtol=1e-10)


@pytest.mark.slow
def test_error_estimate_is_within_its_band():
    """Error of the algorithm and of one more rounding of the entries over the estimate: never above 10, in [.001, 10] in 95 %.

    The estimate holds four roundings of every term that all add up, so that the true error is a few per cent of it.
    """
    rng = np.random.default_rng(7)
    ratios = []
    for i in range(200):
        n = 3
        C = 0.2 * spd(rng, n, 0.0) if i % 2 else None
        s = system(spd(rng, n), C, 10.0 ** rng.uniform(0, 4) * spd(rng, n, 0.01))
        r = modes(s)
        k = int(rng.integers(n))
        stored = relative_errors(r.eigenvalue[k : k + 1], exact_roots(*parts(s), 30))[0]
        with mp.workdps(40):
            exact = [system_roots(s), system_roots(s, rng)]
            nearest = [min(roots, key=lambda z: abs(z - mp.mpc(complex(r.eigenvalue[k])))) for roots in exact]
            data = float(abs(nearest[1] - nearest[0]) / abs(nearest[0]))
        ratios.append((stored + data) / r.error[k])
    ratios = np.array(ratios)
    inside = np.mean((ratios >= 0.001) & (ratios <= 10))
    print(f"true/estimated: median {np.median(ratios):.2f}, in band {100 * inside:.1f} %, largest {ratios.max():.1f}")
    assert inside >= 0.95 and ratios.max() <= 10


def system_roots(s: MechanicalSystem, rng: np.random.Generator | None = None) -> list:
    """Exact roots of a system, or of one whose entries are moved by less than their rounding, in 40 digits."""
    made = [None if a is None else mp.matrix(a.tolist()) for a in (s.M, s.C, s.K)]
    if rng is not None:
        for a in made:
            for i in range(s.n):
                for j in range(i + 1):
                    if a is not None:
                        a[i, j] = a[j, i] = a[i, j] * (1 + mp.mpf(rng.uniform(-1.0, 1.0)) * EPS / 2)
    m, d, k = made[0], made[1] if made[1] is not None else mp.zeros(s.n), made[2]
    return list(mp.eig(companion(m, d, k), left=False, right=False))
