"""The sparse eigensolver in its mixed form where stiffnesses differ by many orders: soft modes beside rigid ones, stiff ones beside
constraints."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from mbrs import _core
from test_sparse_modes import arrays, augmented, chain_eigenvalues, springs


def held_by(k, n):
    """Eigenvalues of n unit masses on unit springs, the first tied to ground by k: the lowest from k K^-1 = 1 + k min(i, j)."""
    i, G = np.arange(n), springs(n, True).toarray()
    out = scipy.linalg.svdvals(np.sqrt(np.r_[k, np.ones(n - 1)])[:, None] * G)[::-1] ** 2
    out[0] = k / scipy.linalg.eigvalsh(1.0 + k * np.minimum(i[:, None], i[None, :]))[-1]
    return out


@pytest.mark.parametrize("n", [3, 30, 200])
def test_soft_modes_beside_rigid_ones(n):
    """A chain on a weak spring beside a free chain, in random units: every eigenvalue is right within its error, and what is told as
    rigid is not above its error."""
    rng = np.random.default_rng(n)
    for power in rng.uniform(-32, 0, size=12):
        k, mass, stiffness = 10.0**power, 10.0 ** rng.uniform(-6, 6), 10.0 ** rng.uniform(-6, 6)
        count = int(rng.integers(3, min(2 * n, 7)))
        G = sp.block_diag([springs(n, True), springs(n, False)])
        compliance = 1.0 / (np.r_[k, np.ones(2 * n - 2)] * stiffness)
        r = _core.mixed_modes(arrays(mass * sp.identity(2 * n)), arrays(augmented(G, compliance)), count)
        both = np.r_[held_by(k, n), chain_eigenvalues(n, min(n, count), False)]
        exact = np.sort(both)[:count] * stiffness / mass
        still, found, error = r["lambda"] == 0.0, r["lambda"], r["error"]
        off = np.abs(found[~still] / exact[~still] - 1.0)
        print(
            f"k {k:.0e}: {off.max():.1e}, errors {error[~still].max():.1e}, rigid {r['rigid']}, sigma {r['sigma']:.0e}, {r['counts']}"
        )
        assert r["rigid"] == np.count_nonzero(still) >= 1
        assert np.all(exact[still] <= error[still])
        assert np.all(off <= error[~still] + 1e-12)
        assert k < 1e-20 or (r["rigid"] == 1 and error[1:].max() < 1e-5)
        gram = mass * r["shape"].T @ r["shape"]
        assert np.abs(gram - np.eye(count)).max() < 1e-9


def exact_modes(G, k, held):
    """All eigenvalues with 50 digits of unit masses on springs k along rows G, the rows ``held`` kept at rest."""
    with mpmath.workdps(50):
        Z = scipy.linalg.null_space(held)
        # orthonormal to 50 digits, and exactly in the null space of integers
        rows = mpmath.matrix(held.tolist())
        Z = mpmath.matrix(Z.tolist())
        Z = Z - rows.T * (mpmath.inverse(rows * rows.T) * (rows * Z))
        Q, _ = mpmath.qr(Z, mode="skinny")
        B = mpmath.matrix(G.tolist()) * Q
        K = B.T * mpmath.diag([mpmath.mpf(float(v)) for v in k]) * B
        return np.sort(np.array([float(v) for v in mpmath.eigsy(K, eigvals_only=True)]))


@pytest.mark.parametrize("ratio", [1e6, 1e9, 1e12, 1e14, 1e16])
def test_stiff_modes_beside_constraints(ratio):
    """All modes of ten masses with random springs, some of them stiffer by up to the ratio, and two constraints."""
    rng = np.random.default_rng(int(np.log10(ratio)))
    n = 10
    for stiff in (1, 3):
        k = rng.uniform(1.0, 2.0, size=n)
        k[rng.choice(n, stiff, replace=False)] *= ratio ** np.linspace(1.0, 0.5, stiff)
        G = springs(n, True).toarray()
        held = np.zeros((2, n))
        held[0, [1, 4]], held[1, [5, 8]] = (1.0, -1.0), (1.0, 1.0)
        exact = exact_modes(G, k, held)
        A = arrays(augmented(sp.csc_matrix(np.vstack([G, held])), np.r_[1.0 / k, 0.0, 0.0]))
        r = _core.mixed_modes(arrays(sp.identity(n)), A, n - 2)
        off = np.abs(r["lambda"] / exact - 1.0)
        print(f"ratio {ratio:.0e}: {off.max():.1e}, errors {r['error'].max():.1e}, {r['counts']}")
        assert np.all(off <= r["error"] + 1e-12) and r["error"].max() < 1e-10
        with pytest.raises(_core.CoreModelError, match=f"leave {n - 2}"):
            _core.mixed_modes(arrays(sp.identity(n)), A, n - 1)


@pytest.mark.parametrize("damping", [0.0, 0.03])
def test_a_chain_on_a_soft_spring_beside_a_free_one(damping):
    """Assembled, in random units: whatever the spring, the rigid motion and the soft one are told, the damped roots by C = d K."""
    rng = np.random.default_rng(4)
    for power in np.r_[rng.uniform(-11, -3, size=24), np.log10([3e-8, 1e-8, 3e-9, 1e-9])]:
        n, k, mass, stiffness = (
            int(rng.integers(25, 90)),
            10.0**power,
            10.0 ** rng.uniform(-6, 6),
            10.0 ** rng.uniform(-6, 6),
        )
        G, free = springs(n, True), springs(n, False)
        K = stiffness * sp.block_diag([G.T @ sp.diags(np.r_[k, np.ones(n - 1)]) @ G, free.T @ free])
        M, unit = mass * sp.identity(2 * n), np.sqrt(stiffness / mass)
        exact = np.sort(np.r_[held_by(k, n), chain_eigenvalues(n, 5, False)])[:5]
        if damping:
            r = _core.sparse_modes(arrays(M), arrays(damping / unit * K), arrays(K), 4)
            found = r["eigenvalue"] / unit
            wanted = -0.5 * damping * exact + 1j * np.sqrt(exact - (0.5 * damping * exact) ** 2)
        else:
            r = _core.sparse_modes(arrays(M), None, arrays(K), 4)
            found, wanted = r["lambda"] / unit**2, exact
        off = np.abs(found[1:] / wanted[1:4] - 1.0)
        print(
            f"n {n}, k {k:.1e}: {off.max():.1e}, errors {r['error'][1:].max():.1e}, rigid {r['rigid']}, {r['counts']}"
        )
        assert r["rigid"] == 1 and found[0] == 0.0
        assert np.all(off <= 10 * r["error"][1:] + 1e-10)
        assert off[1:].max() < 1e-6
