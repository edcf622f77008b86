"""Undamped modes where stiffnesses and masses differ by many orders, against 50 digits: right, or an error that says so."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from mpmath import mp

EPS = np.finfo(float).eps


def true_roots(M: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Square roots of the eigenvalues of the numbers stored, 60 digits; negative where K is indefinite."""
    with mp.workdps(60):
        lower = mp.cholesky(mp.matrix(M.tolist()))
        inverse = lower**-1
        values = mp.eigsy(inverse * mp.matrix(K.tolist()) * inverse.T, eigvals_only=True)
        roots = [mp.sign(v) * mp.sqrt(abs(v)) for v in values]
        return np.array([float(r) for r in sorted(roots)])


def roots_of_factor(M: np.ndarray, F: np.ndarray) -> np.ndarray:
    """The same for K = F^T F of the numbers in F."""
    with mp.workdps(60):
        f = mp.matrix(F.tolist())
        inverse = mp.cholesky(mp.matrix(M.tolist())) ** -1
        values = mp.eigsy(inverse * (f.T * f) * inverse.T, eigvals_only=True)
        return np.array([float(mp.sqrt(abs(v))) for v in sorted(values)])


def chain(rng: np.random.Generator, n: int, springs: float, masses: float) -> tuple[np.ndarray, np.ndarray]:
    """Factor and masses of a chain between two walls, sizes over so many decades."""
    rows = np.zeros((n + 1, n))
    for i in range(n + 1):
        if i < n:
            rows[i, i] = 1.0
        if i > 0:
            rows[i, i - 1] = -1.0
    stiffness = 10.0 ** rng.uniform(-springs / 2, springs / 2, n + 1)
    return np.sqrt(stiffness)[:, None] * rows, np.diag(10.0 ** rng.uniform(-masses / 2, masses / 2, n))


def full(rng: np.random.Generator, n: int, springs: float, masses: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows in all directions, 2 n of them, and a full graded mass matrix."""
    rows = rng.standard_normal((2 * n, n))
    stiffness = 10.0 ** rng.uniform(-springs / 2, springs / 2, 2 * n)
    d = 10.0 ** rng.uniform(-masses / 4, masses / 4, n)
    a = rng.standard_normal((n, n)) / np.sqrt(n)
    return np.sqrt(stiffness)[:, None] * rows, d[:, None] * (a @ a.T + 0.2 * np.eye(n)) * d


KINDS = {
    "springs": (chain, 14, 0),
    "masses": (chain, 0, 16),
    "both": (chain, 12, 12),
    "full": (full, 8, 8),
    "mild": (chain, 4, 4),
}


def shuffled(rng: np.random.Generator, F: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Another order of coordinates and other units of each."""
    n = len(M)
    order, unit = rng.permutation(n), 10.0 ** rng.uniform(-5, 5, n)
    return F[:, order] * unit, M[np.ix_(order, order)] * np.outer(unit, unit)


@pytest.mark.some(10)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_roots_of_matrices_are_right_to_their_error(kind, seed):
    make, springs, masses = KINDS[kind]
    rng = np.random.default_rng(100 + seed)
    F, M = shuffled(rng, *make(rng, int(rng.integers(4, 11)), springs, masses))
    K = F.T @ F
    K = (K + K.T) / 2
    r = mb.modes(mb.MechanicalSystem(M, K=K))
    exact = true_roots(M, K)
    held = r.kind == "vibration"
    error = np.abs(r.omega[held] - exact[held]) / np.abs(exact[held])
    print(f"{kind} {seed}: true {error}, estimated {r.error}, {r.status}, {r.stats.counts}")
    assert np.all(error <= r.error[held] + 2 * EPS)
    assert np.all(np.abs(exact[~held]) <= r.error[~held] + 1e-6 * np.abs(exact[~held]))  # the noise as a frequency
    if kind in ("masses", "mild"):
        assert held.all() and error.max() < 1e-11 and r.status == "converged"
    # the algorithm alone, against the numbers stored, is far better than what the data allow
    clear = r.error[held] < 1e-3
    assert np.all(error[clear] <= np.maximum(1e-12, 0.5 * r.error[held][clear]))


@pytest.mark.some(10)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_roots_of_factors_are_right(kind, seed):
    make, springs, masses = KINDS[kind]
    rng = np.random.default_rng(200 + seed)
    F, M = shuffled(rng, *make(rng, int(rng.integers(4, 11)), springs, masses))
    r = mb.modes(mb.MechanicalSystem(M, K=F.T @ F), stiffness_factor=F)
    error = np.abs(r.omega / roots_of_factor(M, F) - 1)
    print(f"{kind} {seed}: true {error.max():.1e}, estimated {r.error.max():.1e}")
    assert np.all(r.kind == "vibration") and error.max() < 1e-9
    assert np.all(error <= r.error + 2 * EPS)


@pytest.mark.parametrize("seed", range(4))
def test_assembled_roots_are_within_the_error_of_their_data(seed):
    """Rounding made before the solver saw K is part of the error: the roots of the factor lie within it."""
    rng = np.random.default_rng(300 + seed)
    F, M = chain(rng, 8, 14, 0)
    r = mb.modes(mb.MechanicalSystem(M, K=F.T @ F))
    exact = roots_of_factor(M, F)
    held = r.kind == "vibration"
    assert np.all(np.abs(r.omega - exact)[held] <= r.error[held] * exact[held] * 1.01 + 4 * EPS * exact[held])
    assert np.all(exact[~held] <= r.error[~held])


def on_rails(springs, masses, seed: int = 0, gravity=None) -> mb.Model:
    """Masses on rails along an arbitrary axis, springs from ground through the row; the last end is free."""
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    m = mb.Model("row on rails", gravity=gravity)
    order = rng.permutation(len(masses))
    bodies = {}
    for i in order:
        at = axis * (i + 1) * 0.37
        bodies[i] = m.body(f"b{i}", mass=masses[i], inertia=(0.1, 0.2, 0.15), at=at)
        m.prismatic(f"rail{i}", m.ground, bodies[i], at=at, axis=axis)
    for i in rng.permutation(len(springs)):
        if springs[i] == 0.0:
            continue
        a, at = (m.ground, np.zeros(3)) if i == 0 else (bodies[i - 1], axis * i * 0.37)
        m.spring_damper(f"s{i}", a, bodies[i], at=(at, axis * (i + 1) * 0.37), k=springs[i])
    return m


@pytest.mark.parametrize("ratio", [1e10, 1e14, 1e17])
@pytest.mark.parametrize("seed", range(3))
def test_a_model_finds_soft_modes_under_stiff_springs(ratio, seed):
    rng = np.random.default_rng(400 + seed)
    springs = np.array([1.3, ratio, 0.8 * ratio]) * 10.0 ** rng.uniform(-0.2, 0.2, 3)
    masses = rng.uniform(0.5, 2.0, 3)
    r = mb.modes(on_rails(springs, masses, seed))
    rows = np.array([[1.0, 0, 0], [-1, 1, 0], [0, -1, 1]])
    exact = roots_of_factor(np.diag(masses), np.sqrt(springs)[:, None] * rows)
    print(f"{ratio:.0e}: {r.omega / exact - 1}, {r.error}, {r.stats.counts}")
    assert list(r.kind) == ["vibration"] * 3 and r.status == "converged"
    # omega goes like (k/m)^(1/2), so that noise on all numbers changes it by no more than the noise
    assert np.all(np.abs(r.omega / exact - 1) <= r.error + 2 * EPS + jitter.level()) and r.error.max() < 1e-10


@pytest.mark.parametrize("seed", range(3))
def test_a_model_without_the_soft_spring_is_rigid(seed):
    rng = np.random.default_rng(500 + seed)
    springs = np.array([0.0, 1.0, 1e15]) * 10.0 ** rng.uniform(-0.2, 0.2, 3)
    r = mb.modes(on_rails(springs, rng.uniform(0.5, 2.0, 3), seed))
    assert list(r.kind) == ["rigid", "vibration", "vibration"]
    assert 0.0 < r.error[0] < 0.1 * r.omega[1]


def test_a_soft_mode_of_matrices_alone_is_doubtful():
    K = np.array([[1 + 1e14, -1e14, 0], [-1e14, 2e14, -1e14], [0, -1e14, 1e14]])
    r = mb.modes(mb.MechanicalSystem(np.eye(3), K=K))
    assert r.kind[0] == "vibration" and r.status == "unresolved" and r.error[0] > 0.01
    assert abs(r.omega[0] - 3**-0.5) < 1e-7
    K[0, 0] = 1e17 + 1
    K[1:, :] *= 1e3
    K[0, 1] *= 1e3
    r = mb.modes(mb.MechanicalSystem(np.eye(3), K=K))
    assert r.kind[0] == "rigid" and r.error[0] > 3**-0.5  # the rounding of these entries hides what was there


@pytest.mark.parametrize("r", [1e4, 1e6, 1e8, 1e10])
def test_light_and_heavy_masses(r):
    M = np.diag([1 / r, r, 1 / r, r, 1.0])
    K = np.diag([2.0, 2, 2, 2, 1]) - np.eye(5, k=1) - np.eye(5, k=-1)
    found = mb.modes(mb.MechanicalSystem(M, K=K))
    error = np.abs(found.omega / true_roots(M, K) - 1)
    print(f"ratio {r * r:.0e}: {error}, {found.error}, {found.stats.counts}")
    assert error.max() < 1e-12 and np.all(error <= found.error + 2 * EPS) and found.status == "converged"


@pytest.mark.parametrize("decades", [4, 8, 12])
@pytest.mark.parametrize("seed", range(4))
def test_free_trusses_have_six_rigid_motions(decades, seed):
    rng = np.random.default_rng(600 + seed)
    nodes, n_bars = rng.uniform(-1, 1, (5, 3)), 10
    pairs = [(i, j) for i in range(5) for j in range(i)]
    rows = np.zeros((n_bars, 15))
    for row, (i, j) in zip(rows, pairs, strict=True):
        e = (nodes[i] - nodes[j]) / np.linalg.norm(nodes[i] - nodes[j])
        row[3 * i : 3 * i + 3], row[3 * j : 3 * j + 3] = e, -e
    k = 10.0 ** rng.uniform(-decades / 2, decades / 2, n_bars)
    r = mb.modes(
        mb.MechanicalSystem(np.diag(np.repeat(10.0 ** rng.uniform(-2, 2, 5), 3)), K=rows.T @ (k[:, None] * rows))
    )
    print(r.omega, r.error)
    assert np.count_nonzero(r.kind == "rigid") == 6 and np.all(r.error[:6] > 0.0)


def test_repeated_soft_modes_in_stiff_surroundings():
    """Three equal soft oscillators and a stiff chain, mixed by a random rotation of nothing but names."""
    rng = np.random.default_rng(7)
    K = np.diag([2.0, 2.0, 2.0, 0.0, 0.0, 0.0])
    K[3:, 3:] = 1e9 * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    K[:3, 3:] = -1e-3
    K[3:, :3] = -1e-3
    order = rng.permutation(6)
    K, M = K[np.ix_(order, order)], np.diag(np.array([1, 1, 1, 1e-6, 1e6, 1.0])[order])
    r = mb.modes(mb.MechanicalSystem(M, K=K))
    error = np.abs(r.omega / true_roots(M, K) - 1)
    assert error.max() < 1e-12 and np.all(error <= r.error + 2 * EPS)


def test_weak_coupling_of_damping_is_not_dropped():
    """Soft modes with a damper between them beside stiff, heavily damped ones: their damping is coupled, however small."""
    K, C = np.diag([1.0, 2.0, 1e10]), np.zeros((3, 3))
    C[:2, :2] = [[0.01, 0.004], [0.004, 0.02]]
    C[2, 2] = 1e14
    r = mb.modes(mb.MechanicalSystem(np.eye(3), C, K))
    small = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, -0.01, -0.004], [0, -2, -0.004, -0.02]])
    exact = np.linalg.eigvals(small)
    vibrating = r.eigenvalue[r.kind == "vibration"]
    assert len(vibrating) == 2
    assert all(np.abs(exact - s).min() < 1e-11 for s in vibrating)
