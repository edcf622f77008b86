"""Modes, transfer functions and responses of the reference: residuals, normalisation, ordering, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from mbrs.errors import SingularError
from mbrs.reference import frf, modes, response


def random_system(rng, n, kind):
    A, B, C = (rng.normal(size=(n, n)) for _ in range(3))
    M, K = A @ A.T + n * np.eye(n), 40 * (B @ B.T + np.eye(n))
    damping = {
        "undamped": 0,
        "proportional": 0.02 * M + 0.003 * K,
        "general": 0.2 * C @ C.T,
        "gyroscopic": 0,
        "full": 0.2 * C @ C.T,
    }
    G = 3 * (C - C.T) if kind in ("gyroscopic", "full") else None
    N = 0.5 * (B - B.T) if kind == "full" else None
    return M, damping[kind] * np.ones((n, n)) if np.isscalar(damping[kind]) else damping[kind], G, K, N


@pytest.mark.parametrize("kind", ["undamped", "proportional", "general", "gyroscopic", "full"])
def test_pairs_and_normalisation(kind):
    rng = np.random.default_rng(len(kind))
    M, C, G, K, N = random_system(rng, 6, kind)
    m = modes(M, C, G, K, N)
    D, S = C + (0 if G is None else G), K + (0 if N is None else N)
    assert len(m.roots) == 12 and m.shape.shape == (6, 6)
    assert np.all(np.diff(m.frequency) >= 0)
    for s, phi, psi in zip(m.eigenvalue, m.shape.T, m.left.T, strict=True):
        P = s * s * M + s * D + S
        size = abs(s) ** 2 * np.linalg.norm(M) + np.linalg.norm(S)
        assert np.linalg.norm(P @ phi) < 1e-13 * size * np.linalg.norm(phi)
        assert np.linalg.norm(psi @ P) < 1e-12 * size * np.linalg.norm(psi)
        assert psi @ (2 * s * M + D) @ phi == pytest.approx(2j * s.imag, rel=1e-9)
        if m.symmetric:
            np.testing.assert_allclose(psi, phi)
        else:
            assert (phi.conj() @ M @ phi).real == pytest.approx(1.0)
        assert phi[np.argmax(np.abs(phi))].real > 0
    reconstructed = np.sort_complex(np.concatenate([m.eigenvalue, m.eigenvalue.conj()]))
    np.testing.assert_allclose(reconstructed, np.sort_complex(m.roots), atol=1e-9)


def test_damped_shapes_go_over_into_mass_normalised_ones():
    M, _, _, K, _ = random_system(np.random.default_rng(0), 5, "undamped")
    C = np.diag([1.0, 0, 2, 0, 1])
    still, damped = modes(M, None, None, K), modes(M, 1e-7 * C, None, K)
    np.testing.assert_allclose(still.shape.T @ M @ still.shape, np.eye(5), atol=1e-12)
    np.testing.assert_allclose(damped.shape, still.shape, atol=1e-7)


def test_roots_of_every_sort():
    """Rigid (free and braked), overdamped, unstable and oscillating coordinates, uncoupled, then mixed by a
    congruence.
    """
    M, C, K = np.eye(5), np.diag([0, 2.0, 10, 0, 0.4]), np.diag([0, 0, 9.0, -4, 100])
    X = np.random.default_rng(3).normal(size=(5, 5))
    m = modes(*(X.T @ A @ X if A is not None else None for A in (M, C, None, K, None)))
    expected = np.array([0, 0, -1, 2, -0.2 + 1j * np.sqrt(100 - 0.04)])
    np.testing.assert_allclose(m.eigenvalue, expected, atol=1e-9)
    np.testing.assert_allclose(np.sort(m.roots.real), np.sort([0, 0, 0, -2, -1, -9, 2, -2, -0.2, -0.2]), atol=1e-8)
    assert m.frequency[0] == 0 and np.isnan(m.damping[:2]).all()
    np.testing.assert_allclose(m.damping[2:], [1, -1, 0.02], atol=1e-9)
    for s, phi in zip(m.eigenvalue, m.shape.T, strict=True):
        P = s * s * X.T @ X + s * X.T @ C @ X + X.T @ K @ X
        assert np.linalg.norm(P @ phi) < 1e-9


def test_critical_damping_is_flagged():
    m = modes([[1.0]], [[2.0 * 3.0]], None, [[9.0]])
    assert m.defective[0] and np.all(np.isfinite(m.shape))
    assert m.eigenvalue[0] == pytest.approx(-3, abs=1e-6)


def test_repeated_damped_group_is_orthogonal():
    M, K = np.diag([1.0, 2, 3]), np.diag([4.0, 8, 27])
    X = np.random.default_rng(4).normal(size=(3, 3))
    M, K = X.T @ M @ X, X.T @ K @ X
    C = 0.05 * K
    m = modes(M, C, None, K)
    assert m.groups == [[0, 1]]
    s = m.eigenvalue[0]
    gram = m.shape[:, :2].T @ (2 * s * M + C) @ m.shape[:, :2]
    np.testing.assert_allclose(gram, 2j * s.imag * np.eye(2), atol=1e-10)


def test_massless_coordinate_is_refused():
    with pytest.raises(SingularError):
        modes(np.diag([1.0, 0.0]), None, None, np.eye(2))


def test_frf_is_the_modal_sum():
    """H = sum_r phi phi^T / (a_r (i omega - s_r)) + conjugate, a_r = phi^T (2 s M + C) phi = 2i Im s."""
    M, C, _, K, _ = random_system(np.random.default_rng(6), 5, "general")
    m, omega = modes(M, C, None, K), np.linspace(0.5, 12, 7)
    H = frf(M, C, K, np.eye(5), np.eye(5), omega)
    expected = np.zeros_like(H)
    for s, phi in zip(m.eigenvalue, m.shape.T, strict=True):
        residue = np.outer(phi, phi) / (2j * s.imag)
        expected += residue[..., None] / (1j * omega - s) + residue.conj()[..., None] / (1j * omega - s.conj())
    np.testing.assert_allclose(H, expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(frf(M, C, K, np.eye(5), np.eye(5), omega, "accelerance"), -(omega**2) * H)


def test_response_to_a_ramp_and_to_an_initial_state():
    """m y" + c y' + k y = t from rest (exact for linear loads on any grid), and free decay."""
    m, c, k = 2.0, 0.6, 50.0
    t = np.array([0, 0.3, 0.35, 1.7, 4.0])
    y, v = response([[m]], [[c]], [[k]], np.eye(1), t, t)
    a, w = c / (2 * m), np.sqrt(k / m - (c / (2 * m)) ** 2)
    y0, v0 = c / k**2, -1 / k
    free = np.exp(-a * t) * (y0 * np.cos(w * t) + (v0 + a * y0) / w * np.sin(w * t))
    np.testing.assert_allclose(y[:, 0], t / k - c / k**2 + free, atol=1e-14)
    y, _ = response([[m]], [[c]], [[k]], np.eye(1), t, 0 * t, y0=[y0], v0=[v0])
    np.testing.assert_allclose(y[:, 0], free, atol=1e-14)
    assert v[0, 0] == 0
