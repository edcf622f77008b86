"""Damped modes that are hard: rounding beside damping, mass ratios, defects, against 50 digits."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from oracles.precise import exact_roots, relative_errors

EPS = np.finfo(float).eps


@pytest.mark.some(5)
@pytest.mark.parametrize("seed", range(40))
def test_rounding_beside_damping_leaves_rigid_modes_rigid(seed):
    """An unheld direction with an entry of rounding in its row, beside a damped chain, coordinates in any order and units."""
    rng = np.random.default_rng(seed)
    free = int(rng.integers(1, 3))
    n = free + 3
    K, C = np.zeros((n, n)), np.zeros((n, n))
    a = rng.standard_normal((3, 3))
    K[free:, free:] = np.diag(rng.uniform(2, 8, 3)) + 0.1 * (a + a.T)
    C[free + 1 :, free + 1 :] = 0.1 * np.array([[1.0, -0.5], [-0.5, 0.5]]) * rng.uniform(0.5, 2)
    for i in range(free):
        noise = rng.choice([0.0, 1.0], 3) * rng.standard_normal(3) * 10.0 ** rng.uniform(-31, -16, 3)
        K[i, free:] = K[free:, i] = noise
    unit, order = 10.0 ** rng.uniform(-3, 3, n), rng.permutation(n)
    M = np.diag(rng.uniform(0.5, 2.0, n)) * np.outer(unit, unit)
    K, C = K * np.outer(unit, unit), C * np.outer(unit, unit)
    M, C, K = (x[np.ix_(order, order)] for x in (M, C, K))
    r = mb.modes(mb.MechanicalSystem(M, C, K))
    assert np.all(np.isfinite(r.shape)) and r.status == "converged"
    assert np.count_nonzero(r.kind == "rigid") == free and "overdamped" not in r.kind and "divergence" not in r.kind
    held = np.abs(np.array([complex(s) for s in exact_roots(M, C, K, 60)]))
    assert np.allclose(np.sort(r.omega[free:]), np.sort(held)[2 * free :: 2], rtol=1e-10)


@pytest.mark.parametrize("seed", range(20))
def test_a_body_on_a_cylindrical_joint_beside_a_damped_chain(seed):
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    m = mb.Model("loose", gravity=tuple(rng.standard_normal(3)))
    here = rng.standard_normal(3)
    b = m.body("b", mass=1.3, inertia=(0.2, 0.3, 0.4), at=here)
    axis -= (axis @ m.gravity) * m.gravity / (m.gravity @ m.gravity)  # it can slide without work
    m.cylindrical("sleeve", m.ground, b, at=here - 0.3 * m.gravity, axis=axis)
    before = m.ground
    for i in range(2):
        at = here + (i + 1) * rng.standard_normal(3)
        c = m.body(f"c{i}", mass=1.0 + i, inertia=(0.1, 0.1, 0.1), at=at)
        m.prismatic(f"p{i}", m.ground, c, at=at, axis=rng.standard_normal(3), k=3.0 + i, c=0.1 * i)
        m.bushing(f"s{i}", before, c, at=at, k=(2.0,) * 3 + (0.0,) * 3, c=(0.1,) * 3 + (0.0,) * 3)
        before = c
    with pytest.warns(mb.MbrsWarning):
        r = mb.modes(m)
    assert np.all(np.isfinite(r.shape)) and r.status == "converged"
    assert np.count_nonzero(r.kind == "rigid") == 1 and "overdamped" not in r.kind


@pytest.mark.some(6)
@pytest.mark.parametrize("ratio", [1e6, 1e10, 1e15])
@pytest.mark.parametrize("seed", range(6))
def test_mass_ratios_are_right_or_honest(ratio, seed):
    rng = np.random.default_rng([int(np.log10(ratio)), seed])
    n = int(rng.integers(3, 6))
    rows = np.eye(n) - np.eye(n, k=-1)
    k, c = rng.uniform(0.5, 2, n), rng.uniform(0.001, 0.05, n)
    masses = ratio ** rng.uniform(-0.5, 0.5, n)
    masses[0], masses[-1] = ratio**0.5, ratio**-0.5
    order = rng.permutation(n)
    M, C, K = np.diag(masses), rows.T @ np.diag(c) @ rows, rows.T @ np.diag(k) @ rows
    M, C, K = (x[np.ix_(order, order)] for x in (M, C, K))
    r = mb.modes(mb.MechanicalSystem(M, C, K))
    error = relative_errors(r.eigenvalue, exact_roots(M, C, K, 60))
    print(f"{ratio:.0e} {seed}: true {error}, estimated {r.error}, {r.status}, {r.stats.route} {r.stats.counts}")
    assert np.all(error <= 10 * r.error + 4 * EPS) or r.status == "unresolved"
    if r.status == "converged":
        assert error.max() < 1e-3


@pytest.mark.some(6)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("order", [2, 3, 4])
def test_estimates_at_defects(order, seed):
    """Pairs that are defective to rounding, in random coordinates and units of time: the estimate bounds the error."""
    rng = np.random.default_rng([order, seed])
    if order == 4:
        c = (1 / 18) ** 0.5
        M, C, K = np.eye(2), np.array([[8 / 3, c], [c, 4 / 3]]), np.diag([2.0, 0.5])
    elif order == 3:
        # (s^2 + c1 s + k1)(s^2 + c2 s + k2) - d^2 s^2 = (s + 1)^3 (s + a)
        a, k1 = rng.uniform(0.4, 0.6), rng.uniform(0.08, 0.12)
        k2 = a / k1
        c1 = (1 + 3 * a - (3 + a) * k1) / (k2 - k1)
        c2 = 3 + a - c1
        d = (c1 * c2 + k1 + k2 - 3 - 3 * a) ** 0.5
        M, C, K = np.eye(2), np.array([[c1, d], [d, c2]]), np.diag([k1, k2])
    else:
        M, C, K = np.eye(2), np.array([[2.0, 0.0], [0.0, 0.3]]), np.array([[1.0, 0.0], [0.0, 4.0]])
    rate = np.exp(rng.uniform(-3, 3))
    mix = np.linalg.qr(rng.normal(size=(2, 2)))[0] * np.exp(rng.uniform(-1, 1, 2))
    M, C, K = (mix.T @ x @ mix for x in (M, rate * C, rate**2 * K))
    M, C, K = (0.5 * (x + x.T) for x in (M, C, K))
    r = mb.modes(mb.MechanicalSystem(M, C, K))
    error = relative_errors(r.eigenvalue, exact_roots(M, C, K, 80))
    print(f"order {order}: true {error}, estimated {r.error}, condition {r.condition}")
    assert r.near_defective.any()
    assert np.all(error <= 1.1 * r.error + 4 * EPS)
    assert np.all(r.error <= 1e3 * np.maximum(EPS ** (1 / order), error))


def test_nan_never_passes():
    from mbrs.linear.modal_result import _status

    good = {
        "kind": ["rigid", "vibration"],
        "backward_error": np.array([0.0, 1e-16]),
        "error": np.array([3.0, 1e-15]),
        "shape": np.eye(2),
    }
    assert _status(good, 2) == "converged"
    for name, value in (("backward_error", np.nan), ("error", np.nan), ("error", 0.5), ("shape", np.nan)):
        bad = {**good, name: np.array(good[name], dtype=float)}
        bad[name].flat[-1] = value
        assert _status(bad, 2) == "unresolved"
        assert _status(bad, 1) == "converged" or name == "shape"
