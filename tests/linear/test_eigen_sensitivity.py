"""Derivatives of modes against 50-digit differences, closed forms, repeated and defective roots, bad input."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from mbrs.errors import ModelError
from mbrs.linear.eigen_sensitivity import EigenSensitivity, eigen_sensitivity
from mbrs.linear.matrices import MechanicalSystem
from mbrs.linear.modes import modes
from mpmath import mp
from oracles.precise import companion
from problems import hexapod_matrices

DIGITS = 50
STEP = "1e-16"  # central differences: truncation 1e-32, rounding 1e-34


def spd(rng: np.random.Generator, n: int, floor: float = 0.3) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a @ a.T + floor * np.eye(n)


def symmetric(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a + a.T


def skew(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a - a.T


class Exact:
    """Roots and normalised shapes of (s^2 M + s D + S) x = 0 with 50 digits."""

    def __init__(self, m, d, k) -> None:
        self.m, self.d, self.k = m, d, k
        n = m.rows
        self.roots, vectors = mp.eig(companion(m, d, k))
        self.vectors = [mp.matrix([vectors[i, j] for i in range(n)]) for j in range(2 * n)]

    def near(self, s: complex) -> int:
        return min(range(len(self.roots)), key=lambda j: abs(self.roots[j] - mp.mpc(complex(s))))

    def shape(self, s: complex, like: np.ndarray, kind: str):
        """The shape at the root nearest to s, normalised as the library says, with the sign of `like`."""
        j = self.near(s)
        x, root = self.vectors[j], self.roots[j]
        if kind == "modal":
            slope = (x.T * (2 * root * self.m + self.d) * x)[0]
            x = x * mp.sqrt(2j * root.imag / slope)
            inner = sum(mp.conj(mp.mpc(complex(b))) * a for a, b in zip(x, like, strict=True))
            return x if inner.real > 0 else -x
        x = x / mp.sqrt((x.H * self.m * x)[0].real)
        size = np.abs(like)
        k = int(np.argmax(size >= (1 - 1e-6) * size.max()))
        return x * (mp.conj(x[k]) / abs(x[k]))


def exact_pair(system, changes, p):
    """The system at +h and -h along parameter p, and 2 h."""
    h = mp.mpf(STEP)
    zero = np.zeros((system.n, system.n))
    d = (zero if system.C is None else system.C) + (zero if system.G is None else system.G)
    base = [mp.matrix(a.tolist()) for a in (system.M, d, system.K + (zero if system.N is None else system.N))]
    step = [mp.matrix((zero if a is None else a[:, :, p]).tolist()) for a in changes]
    made = [Exact(*(b + sign * h * s for b, s in zip(base, step, strict=True))) for sign in (1, -1)]
    return made[0], made[1], 2 * h


def differences(system, changes, r, p):
    """ds/dp and dphi/dp of all modes."""
    with mp.workdps(DIGITS):
        up, down, h = exact_pair(system, changes, p)
        ds, dx = [], []
        for i, s in enumerate(r.eigenvalue):
            ds.append(complex((up.roots[up.near(s)] - down.roots[down.near(s)]) / h))
            kind = "modal" if r.left is None and s.imag > 0 else "unit"
            a, b = (e.shape(s, r.shape[:, i], kind) for e in (up, down))
            dx.append([complex(v / h) for v in a - b])
    return np.array(ds), np.array(dx).T


def case(name: str, n: int, n_p: int, seed: int):
    rng = np.random.default_rng(seed)
    M, K = spd(rng, n), 5 * spd(rng, n)
    C = 0.1 * spd(rng, n) if "C" in name else 8 * spd(rng, n) if "O" in name else None
    G = skew(rng, n) if "G" in name else None
    N = skew(rng, n) if "N" in name else None
    dM = np.stack([0.1 * symmetric(rng, n) for _ in range(n_p)], axis=-1)
    dD = np.stack([0.1 * symmetric(rng, n) + ("G" in name) * skew(rng, n) for _ in range(n_p)], axis=-1)
    dK = np.stack([symmetric(rng, n) + ("N" in name) * skew(rng, n) for _ in range(n_p)], axis=-1)
    system = MechanicalSystem(M, C, K, G=G, N=N)
    # an undamped system may still be given damping by a parameter
    return system, (dM, dD, dK)


@pytest.mark.some(3)
@pytest.mark.parametrize("name", ["", "C", "G", "CG", "N", "CGN", "O"])
def test_derivatives_against_50_digit_differences(name):
    system, changes = case(name, 3, 2, 11)
    r = modes(system)
    s = eigen_sensitivity(r, *changes)
    assert s.status == "converged"
    worst = {"eigenvalue": 0.0, "shape": 0.0}
    for p in range(2):
        ds, dx = differences(system, changes, r, p)
        worst["eigenvalue"] = max(worst["eigenvalue"], np.max(np.abs(s.eigenvalue[:, p] - ds) / np.abs(ds)))
        size = np.abs(dx).max(axis=0)
        worst["shape"] = max(worst["shape"], np.max(np.abs(s.shape[:, :, p] - dx).max(axis=0) / size))
        e = r.eigenvalue
        omega = (e.conj() * ds).real / np.abs(e)
        assert np.allclose(s.omega[:, p], omega, rtol=1e-9, atol=1e-12)
        assert np.allclose(s.frequency[:, p], omega / 2 / np.pi, rtol=1e-9, atol=1e-12)
        zeta = -ds.real / np.abs(e) + e.real * omega / np.abs(e) ** 2
        assert np.allclose(s.damping[:, p], zeta, rtol=1e-8, atol=1e-11)
    print(f"{name or 'undamped'} ({r.stats.route}): {worst}, estimated {s.error.max():.1e}")
    assert worst["eigenvalue"] < 1e-10 and worst["shape"] < 1e-8


def triple() -> tuple[MechanicalSystem, np.ndarray]:
    """Six coordinates, one triple frequency, hidden by a rotation."""
    q = np.linalg.qr(np.random.default_rng(4).standard_normal((6, 6)))[0]
    K = q @ np.diag([4.0, 4.0, 4.0, 7.0, 9.0, 11.0]) @ q.T
    return MechanicalSystem(np.eye(6), None, (K + K.T) / 2), q


def test_triple_eigenvalue_against_50_digit_differences():
    """The group is split exactly: differences start from the exactly triple matrix Q diag Q^T with Q of 50 digits."""
    system, q = triple()
    rng = np.random.default_rng(9)
    dK = np.stack([symmetric(rng, 6), symmetric(rng, 6), np.outer(q[:, 0], q[:, 0])], axis=-1)
    dM = np.stack([0.2 * symmetric(rng, 6), np.zeros((6, 6)), np.zeros((6, 6))], axis=-1)
    r = modes(system)
    assert r.groups == ((0, 1, 2),)
    s = eigen_sensitivity(r, dM, None, dK)
    group = s.group(0)
    assert group.matrices.shape == (3, 3, 3)
    worst = 0.0
    directions = [*np.eye(3), np.array([0.3, -1.2, 2.0])]
    with mp.workdps(DIGITS):
        basis, _ = mp.qr(mp.matrix(q.tolist()))  # orthogonal to 50 digits
        base = basis * mp.diag([4, 4, 4, 7, 9, 11]) * basis.T
        for dp in directions:
            change_k, change_m = (mp.matrix((a @ dp).tolist()) for a in (dK, dM))
            h = mp.mpf("1e-20")
            values = []
            for sign in (1, -1):
                m = mp.eye(6) + sign * h * change_m
                lower = mp.cholesky(m)
                inverse = lower**-1
                k = inverse * (base + sign * h * change_k) * inverse.T
                w = sorted(mp.eigsy((k + k.T) / 2, eigvals_only=True))[:3]
                values.append([mp.sqrt(v) for v in w])
            # ascending along +h is descending along -h
            exact = np.array([float((a - b) / (2 * h)) for a, b in zip(values[0], reversed(values[1]), strict=True)])
            got = group.directional(dp)
            worst = max(worst, np.max(np.abs(got.imag - exact)) / np.abs(exact).max())
            assert np.allclose(s.directional(dp).omega[:3], exact, rtol=1e-8, atol=1e-10)
    print(f"triple eigenvalue: relative error of its derivatives {worst:.1e}")
    assert worst < 1e-8
    for p in range(3):
        assert np.allclose(s.eigenvalue[:3, p], group.directional(np.eye(3)[p]), atol=1e-12)
    assert np.all(np.isnan(s.shape[:, :3])) and np.all(np.isfinite(s.shape[:, 3:]))
    assert not np.allclose(s.directional([1, 1, 0]).omega[:3], s.omega[:3, :2].sum(axis=1))  # splits do not add up


def test_hexapod_closed_form():
    k, mass = 1e5, 20.0
    isolator = hexapod_matrices(k=k, mass=mass).model
    dK = isolator.K[:, :, None] / k
    r = modes(isolator)
    zero = np.zeros((6, 6, 1))
    dM = np.diag([1.0, 1, 1, 0, 0, 0])[:, :, None]
    s = eigen_sensitivity(
        r,
        np.concatenate([zero, zero, dM], 2),
        np.concatenate([zero, dK, zero], 2),
        np.concatenate([dK, zero, zero], 2),
        parameters=["k_leg", "c_leg", "payload.mass"],
        units=["N/m", "N s/m", "kg"],
    )
    f = r.frequency
    assert np.allclose(s.frequency[:, 0], f / k / 2, rtol=1e-11)
    assert np.allclose(s.frequency[:, 1], 0, atol=1e-12)
    assert np.allclose(s.frequency[:, 2], np.where(np.arange(6) < 3, -f / mass / 2, 0), rtol=1e-11, atol=1e-12)
    # zeta = c sqrt(c_k / k) ...: proportional to c, to 1/sqrt(k)
    assert np.allclose(s.damping[:, 1], r.damping / (3e-4 * k), rtol=1e-11)
    assert np.allclose(s.damping[:, 0], -r.damping / k / 2, rtol=1e-9)
    assert s.group(0).matrices.shape == (3, 3, 3) and s.group(1).matrices.shape == (3, 2, 2)
    text = str(s)
    assert "k_leg" in text and "N/m" in text and "do not add up" in text


def test_rigid_modes():
    k = np.array([[1.0, -1.0], [-1.0, 1.0]])
    between, ground = k[:, :, None], np.diag([1.0, 0.0])[:, :, None]
    dK = np.concatenate([between, ground], axis=2)
    dM = np.concatenate([np.diag([1.0, 0.0])[:, :, None], np.zeros((2, 2, 1))], axis=2)
    # free: an inner spring and a mass keep the mode rigid, a spring to ground lifts it like a square root
    r = modes(MechanicalSystem(np.eye(2), None, k))
    s = eigen_sensitivity(r, dM, None, dK)
    assert s.status == "partly undefined"
    assert s.frequency[0, 0] == 0 and np.isnan(s.frequency[0, 1])
    # M = diag(1 + p, 1): dphi/dp = -1/4 phi keeps phi^T M phi = 1
    assert np.allclose(s.shape[:, 0, 0], -0.25 * r.shape[:, 0], atol=1e-14)
    assert np.all(np.isfinite(s.shape[:, 1]))
    # with a damper to ground the zero root is simple and moves by -z^T dK z / z^T C z, z = (1, 1)
    r = modes(MechanicalSystem(np.eye(2), np.diag([0.5, 0.0]), k))
    s = eigen_sensitivity(r, dM, None, dK)
    assert np.allclose(s.eigenvalue[0], [0.0, -2.0], rtol=1e-12) and np.isnan(s.frequency[0, 1])
    # two rigid modes at once
    two = MechanicalSystem(np.eye(4), None, np.kron(np.eye(2), k))
    s = eigen_sensitivity(modes(two), None, None, np.kron(np.eye(2), k)[:, :, None])
    assert np.all(s.frequency[:2] == 0)


def test_near_defective_modes_have_no_derivative():
    r = modes(MechanicalSystem(np.eye(2), np.diag([2.0, 0.1]), np.diag([1.0, 3.0])))
    s = eigen_sensitivity(r, None, None, np.eye(2)[:, :, None])
    assert r.near_defective.tolist() == [True, False]
    assert s.status == "partly undefined" and np.isnan(s.frequency[0, 0]) and np.isfinite(s.frequency[1, 0])
    assert np.all(np.isnan(s.shape[:, 0])) and np.all(np.isfinite(s.shape[:, 1]))
    assert "no derivative exists" in str(s)


def test_array_parameters_keep_their_shape():
    system, (dM, dD, dK) = case("C", 3, 6, 2)
    r = modes(system)
    s = eigen_sensitivity(r, dM, dD, dK, parameters=["V"], shapes=[(2, 3)])
    assert s.frequency.shape == (3, 2, 3) and s.shape.shape == (3, 3, 2, 3) and s.labels[4] == "V[1,1]"
    flat = eigen_sensitivity(r, dM, dD, dK)
    assert np.array_equal(s.frequency.reshape(3, 6), flat.frequency)
    mixed = eigen_sensitivity(r, dM, dD, dK, parameters=["a", "V", "b"], shapes=[(), (2, 2), ()])
    assert mixed.frequency.shape == (3, 6)
    part = mixed.of("V")
    assert part.frequency.shape == (3, 2, 2) and np.array_equal(
        part.eigenvalue.ravel(), flat.eigenvalue[:, 1:5].ravel()
    )
    assert np.allclose(part.shape, flat.shape[..., 1:5].reshape(3, 3, 2, 2), rtol=1e-12)
    assert flat.to_xarray()["frequency"].shape == (3, 6)
    dp = np.arange(6.0)
    assert np.allclose(flat.directional(dp).eigenvalue, flat.eigenvalue @ dp, rtol=1e-12)


def test_sparse_derivatives_cost_only_their_entries():
    system, (dM, dD, dK) = case("CG", 4, 3, 6)
    r = modes(system)
    dense = eigen_sensitivity(r, dM, dD, dK)
    lists = [[sp.csr_array(a[:, :, p]) for p in range(3)] for a in (dM, dD, dK)]
    sparse = eigen_sensitivity(r, *lists)
    assert np.allclose(sparse.eigenvalue, dense.eigenvalue, rtol=1e-14)
    assert eigen_sensitivity(r, None, None, [a.toarray() for a in lists[2]]).flat.shape == (4, 3)
    assert dense.stats.counts["eigensolutions"] == 0


def test_group_that_was_cut_has_no_derivative():
    system, _ = triple()
    r = modes(system, n=2)
    s = eigen_sensitivity(r, None, None, np.eye(6)[:, :, None])
    assert np.all(np.isnan(s.frequency)) and s.groups == ()


def test_wrong_input_is_refused():
    system, (dM, _, dK) = case("", 3, 2, 2)
    r = modes(system)
    with pytest.raises(ModelError, match=r"result of mbrs\.modes"):
        eigen_sensitivity(system, dM)
    with pytest.raises(ModelError, match=r"array \(3, 3, n_p\)"):
        eigen_sensitivity(r, dM[:2])
    with pytest.raises(ModelError, match="NaN"):
        eigen_sensitivity(r, dM * np.nan)
    with pytest.raises(ModelError, match="different numbers of parameters"):
        eigen_sensitivity(r, dM, None, dK[:, :, :1])
    with pytest.raises(ModelError, match="3 entries but the derivatives 2"):
        eigen_sensitivity(r, dM, parameters=["V"], shapes=[(3,)])
    with pytest.raises(ModelError, match="do not fit together"):
        eigen_sensitivity(r, dM, parameters=["a", "b"], units=["m"])
    s = eigen_sensitivity(r, dM, None, dK)
    with pytest.raises(ModelError, match="no group 0"):
        s.group(0)
    with pytest.raises(ModelError, match="2 parameters"):
        s.directional([1.0])
    with pytest.raises(ModelError, match="not among"):
        s.of("x")
    empty = eigen_sensitivity(r)
    assert isinstance(empty, EigenSensitivity) and empty.frequency.shape == (3, 0)


def test_roots_that_rounding_has_parted_are_one_group():
    """Two equal oscillators, 3e-13 apart: their shapes are arbitrary, the derivatives are those of the repeated root."""
    turned = np.array([[0.6, -0.8], [0.8, 0.6]])
    K = turned @ np.diag([4.0, 4.0 * (1 + 6e-13)]) @ turned.T
    modal = modes(MechanicalSystem(np.eye(2), None, K))
    assert modal.groups == () and modal.clusters == ((0, 1),)
    s = eigen_sensitivity(modal, dK=[np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])
    np.testing.assert_allclose(s.omega, [[0.0, 0.0], [0.25, 0.25]], atol=1e-9)
    np.testing.assert_allclose(s.group(0).directional([1.0, 1.0]).imag, [0.25, 0.25], atol=1e-9)
    assert s.error.max() < 1e-10


@pytest.mark.parametrize("gap", [1e-6, 1e-10])
def test_roots_that_differ_are_no_group(gap):
    """A gap far beyond rounding: each mode has a derivative of its own."""
    modal = modes(MechanicalSystem(np.eye(2), None, np.diag([4.0, 4.0 * (1 + 2 * gap)])))
    assert modal.clusters == ()
    s = eigen_sensitivity(modal, dK=[np.diag([1.0, 0.0])])
    np.testing.assert_allclose(s.omega[:, 0], [0.25, 0.0], atol=1e-9)


@pytest.mark.parametrize("share, rigid", [(1e-11, True), (1e-9, False)])
def test_a_rigid_mode_stays_rigid_under_rounding_only(share, rigid):
    """The spring between two free masses changes, and one to the ground by rounding or not: then the root starts like a root."""
    modal = modes(MechanicalSystem(np.eye(2), None, [[1.0, -1.0], [-1.0, 1.0]]))
    found = eigen_sensitivity(modal, dK=[np.array([[1.0 + share, -1.0], [-1.0, 1.0]])]).eigenvalue[0, 0]
    assert found == 0.0 if rigid else np.isnan(found)
