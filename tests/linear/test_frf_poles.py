"""Poles of damped chains without their modes, against eigenvalues of the state matrix and Newton's step in 40 digits, and the missed
resonances that they tell.
"""

from __future__ import annotations

import pickle
import re
import warnings

import mbrs as mb
import mpmath
import numpy as np
import pytest
from mbrs.errors import MbrsWarning

EPS = np.finfo(float).eps


def row(rng, n, half, low=0.5, high=2.0):
    """Springs of random stiffness between neighbours up to `half` apart, and to the ground at both ends."""
    A = np.diag(np.r_[1.0, np.zeros(n - 2), 1.0])
    for i in range(n):
        for j in range(i + 1, min(n, i + half + 1)):
            A[np.ix_([i, j], [i, j])] += rng.uniform(low, high) * np.array([[1, -1], [-1, 1]])
    return A


def dampers(rng, kind, n, half):
    if kind == "grounded":
        return np.diag(rng.uniform(0.5, 2.0, n))
    if kind == "light":
        return 1e-5 * np.diag(rng.uniform(0.5, 2.0, n))
    if kind == "links":
        return 0.3 * row(rng, n, half, 0.0, 1.0)
    if kind == "driven":
        return np.diag(rng.uniform(-0.5, 2.0, n))
    return np.diag(np.eye(n)[n // 2]) * 20.0


def shuffled(rng, *parts):
    """The same system, of M, C, K, G, N, in coordinates of another order and of units that are powers of two."""
    n = len(parts[0])
    order, unit = rng.permutation(n), 2.0 ** rng.integers(-12, 12, n)
    given = [None if A is None else (unit[:, None] * A * unit)[np.ix_(order, order)] for A in parts]
    return mb.MechanicalSystem(*given[:3], **dict(zip("GN", given[3:], strict=False)))


def eigenvalues(M, C, K):
    L = np.linalg.cholesky(M)
    inner = [np.linalg.solve(L, np.linalg.solve(L, A).T) for A in (C, K)]
    n = len(M)
    return np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-inner[1], -inner[0]]]))


def newton_step(M, C, K, half, s):
    """|det Z / (det Z)'| in 40 digits, by elimination inside the band."""
    n = len(M)
    with mpmath.workdps(40):
        s = mpmath.mpc(s)
        inside = [(i, j) for i in range(n) for j in range(max(0, i - half), min(n, i + half + 1))]
        z = {(i, j): mpmath.mpf(K[i, j]) + s * mpmath.mpf(C[i, j]) + s * s * mpmath.mpf(M[i, j]) for i, j in inside}
        slope = {(i, j): mpmath.mpf(C[i, j]) + 2 * s * mpmath.mpf(M[i, j]) for i, j in inside}
        total = 0
        for k in range(n):
            total += slope[k, k] / z[k, k]
            for i in range(k + 1, min(n, k + half + 1)):
                factor = z[i, k] / z[k, k]
                change = (slope[i, k] - factor * slope[k, k]) / z[k, k]
                for j in range(k + 1, min(n, k + half + 1)):
                    z[i, j] -= factor * z[k, j]
                    slope[i, j] -= change * z[k, j] + factor * slope[k, j]
        return float(abs(1 / total))


def quietly(*arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MbrsWarning)
        return mb.frf(*arguments, **options)


def distance(found, expected):
    """Largest distance of a root to the nearest of the others, both ways."""
    apart = np.abs(found[:, None] - expected[None, :])
    return max(apart.min(0).max(), apart.min(1).max())


@pytest.mark.some(6)
@pytest.mark.parametrize("kind", ["grounded", "light", "links", "driven", "one"])
@pytest.mark.parametrize("n, half", [(16, 1), (40, 1), (40, 2), (60, 3)])
def test_poles_of_damped_chains_are_those_of_their_matrices(n, half, kind):
    rng = np.random.default_rng([n, half, len(kind)])
    M = np.diag(rng.uniform(1, 2, n)) + (0.1 * row(rng, n, half) if half > 1 else 0.0)
    C, K = 10.0 * dampers(rng, kind, n, half), 1e4 * row(rng, n, half)
    found = quietly(shuffled(rng, M, C, K), 0, 0, omega=np.linspace(1.0, 9.0, 12))
    assert found.stats.counts["determinants"] <= 12 * n and "general eigensolutions" not in found.stats.counts
    poles, fastest = found.poles, np.abs(found.poles).max()
    assert (
        len(poles) == 2 * n and np.array_equal(poles[1::2], poles[::2].conj()) and np.all(np.diff(np.abs(poles)) >= 0)
    )
    gap = distance(poles, eigenvalues(M, C, K))
    own = rng.choice(n, 8, replace=False)
    worst = max(newton_step(M, C, K, half, poles[2 * k]) * abs(poles[2 * k]) / fastest**2 for k in own)
    print(
        f"{gap / fastest:.1e} from eigenvalues, steps of {worst:.1e} left, {found.stats.counts['determinants'] / n:.1f} steps each"
    )
    assert gap < 1e-12 * fastest and worst < 4 * EPS


def test_poles_that_lie_on_each_other_are_all_there():
    """Two equal chains side by side: each root twice, or twice within the noise of one of them."""
    rng, n = np.random.default_rng(8), 24
    M, C, K = np.eye(n), np.diag(rng.uniform(0.5, 2.0, n)), 1e4 * row(rng, n, 1)
    twice = np.eye(2)
    for noise in (0.0, 1e-13, 1e-9):
        both = [np.kron(twice, A) + noise * np.kron(np.diag([0.0, 1.0]), A) for A in (M, C, K)]
        found = quietly(shuffled(rng, *both), 0, 0, omega=np.linspace(1.0, 9.0, 12))
        one = eigenvalues(M, C, K)
        near = np.abs(found.poles[:, None] - one[None, :]) < 1e-7 * np.abs(one).max()
        assert np.all(near.sum(0) == 2) and np.all(near.sum(1) == 1), noise
        print(noise, found.stats.counts)


def test_poles_that_parts_of_a_chain_share_with_it():
    """One damper in the middle of equal masses and springs: every second mode stands still there and has no damping."""
    n = 41
    M, C, K = np.eye(n), np.diag(np.eye(n)[20]) * 30.0, 1e4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    still = 200.0 * np.sin(0.5 * np.pi * np.arange(2, n + 1, 2) / (n + 1))
    for system in (mb.MechanicalSystem(M, C, K), shuffled(np.random.default_rng(13), M, C, K)):
        found = quietly(system, 0, 0, omega=np.linspace(1.0, 9.0, 12))
        assert found.stats.counts["determinants"] <= 12 * n
        assert distance(found.poles, eigenvalues(M, C, K)) < 1e-12 * 200.0
        assert np.abs(found.poles[:, None] - 1j * still).min(0).max() < 1e-13 * 200.0


def refused():
    """Chains whose poles are those of modes: what is real, at rest, uncoupled or not symmetric."""
    rng, n = np.random.default_rng(9), 24
    M, C, K = np.diag(rng.uniform(1, 2, n)), np.diag(rng.uniform(0.5, 2.0, n)), 1e4 * row(rng, n, 1)
    free = K - 1e4 * np.diag(np.r_[1.0, np.zeros(n - 2), 1.0])
    skew = np.diag(rng.normal(size=n - 1), 1)
    return {
        "undamped": (M, None, K),
        "proportional": (M, 1e-4 * K + 0.1 * M, K),
        "overdamped": (M, C + 5e3 * np.diag(np.eye(n)[3]), K),
        "free": (M, C, free),
        "unstable": (M, C, K - 2e3 * np.eye(n)),
        "gyroscopic": (M, C, K, skew - skew.T),
        "circulatory": (M, C, K, None, 100.0 * (skew - skew.T)),
        "all neighbours": (M, C, K + 100.0 * row(rng, n, n)),
    }


@pytest.mark.parametrize("kind", refused())
def test_other_poles_are_those_of_modes(kind):
    system = shuffled(np.random.default_rng(10), *refused()[kind])
    found = quietly(system, 0, 0, omega=np.linspace(1.0, 9.0, 12))
    assert "determinants" not in found.stats.counts
    assert sum(n for name, n in found.stats.counts.items() if name.endswith("eigensolutions")) >= 1
    roots = np.sort_complex(mb.modes(system).roots)
    assert np.allclose(np.sort_complex(found.poles), roots, rtol=1e-9, atol=1e-9 * np.abs(roots).max())


def missed(M, C, K, port, omega):
    """Resonances in rad/s that points miss, as their definition says, from eigenvalues and inverses."""
    poles = eigenvalues(M, C, K)
    poles = poles[(poles.imag > np.abs(poles.real)) & (omega[0] <= poles.imag) & (poles.imag <= omega[-1])]

    def size(w):
        return abs(np.linalg.inv(K - w * w * M + 1j * w * C)[port, port])

    found = []
    for p in poles[np.argsort(poles.imag)]:
        k = np.searchsorted(omega, p.imag)
        sides = omega[max(k - 1, 0) : k + 1]
        if np.all(np.abs(sides - p.imag) > abs(p.real)) and size(p.imag) > 1.05 * max(map(size, sides)):
            found.append(p.imag)
    return np.array(found)


def test_missed_resonances_are_told_from_such_poles():
    told = []
    for seed in range(12):
        rng = np.random.default_rng([11, seed])
        n, port = 20, int(rng.integers(20))
        M, K = np.diag(rng.uniform(1, 2, n)), 1e4 * row(rng, n, 1)
        C = 10.0 ** rng.uniform(-3, 1) * np.diag(rng.uniform(0.5, 2.0, n))
        omega = np.linspace(*np.sort(rng.uniform(5.0, 250.0, 2)), int(rng.integers(10, 120)))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = mb.frf(mb.MechanicalSystem(M, C, K), port, port, omega=omega)
        assert found.stats.counts["determinants"] > 0 and found.stats.route != "complex modes"
        texts = [str(w.message) for w in caught if "miss" in str(w.message)]
        expected = missed(M, C, K, port, omega)
        assert len(texts) == (len(expected) > 0)
        told.append(len(expected))
        if texts:
            number, shown = re.search(r"miss (\d+) resonances? at (.*) Hz", texts[0]).groups()
            assert int(number) == len(expected)
            first = [float(f) for f in shown.removesuffix(", ...").split(", ")]
            np.testing.assert_allclose(first, expected[:8] / (2 * np.pi), rtol=1e-5)
    print(told)
    assert min(told) == 0 and max(told) > 4


def test_results_with_such_poles_are_kept_as_others(tmp_path):
    rng, n = np.random.default_rng(12), 20
    system = mb.MechanicalSystem(np.eye(n), np.diag(rng.uniform(0.5, 2.0, n)), 1e4 * row(rng, n, 1))
    h = quietly(system, 0, [0, 1], frequency=(1.0, 30.0))
    assert h.stats.counts["determinants"] > 0
    after = quietly(system, 0, [0, 1], frequency=(1.0, 30.0))
    mb.modes(system)
    last = quietly(system, 0, [0, 1], frequency=(1.0, 30.0))
    assert "determinants" not in after.stats.counts
    kept = [mb.load(h.save(tmp_path / f"h.{ending}")) for ending in ("nc", "json")]
    for other in (*kept, pickle.loads(pickle.dumps(h)), after, last):
        assert np.array_equal(other.poles, h.poles) and np.array_equal(other.value, h.value)
    # a range reaches every peak: half a width beside each pole
    for p in h.poles[(h.poles.imag > 2 * np.pi) & (h.poles.imag < 60 * np.pi)]:
        assert np.min(np.abs(h.omega - p.imag)) < 0.3 * abs(p.real)
