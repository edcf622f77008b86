"""Modes of large damped models nearest to a frequency, against all roots of the state matrix by LAPACK."""

from __future__ import annotations

import time

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import RouteError
from mbrs.linear.sparse_modes import model_modes
from scipy.linalg import eigvals


def chain(n, k, c, mass):
    """Bodies on a straight line, each on a slider of the last one."""
    m = mb.Model("chain")
    last = m.ground
    for i in range(n):
        body = m.body(f"b{i}", mass=mass[i], inertia=(0.1, 0.1, 0.1), at=(float(i + 1), 0, 0))
        m.prismatic(f"j{i}", last, body, at=(i + 0.5, 0, 0), axis="x", k=k[i], c=c[i])
        last = body
    return m


def tridiagonal(v):
    return np.diag(v + np.append(v[1:], 0.0)) - np.diag(v[1:], 1) - np.diag(v[1:], -1)


def all_roots(k, c, mass):
    """Of two real roots of one mode the upper; |s| ascending."""
    n, inverse = len(k), 1.0 / np.asarray(mass)[:, None]
    K, C = tridiagonal(k), tridiagonal(c)
    s = eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-inverse * K, -inverse * C]]))
    return s[s.imag > 0.0]


def nearest(s, n, shift):
    order = np.argsort(np.abs(np.abs(s) ** 2 - (2 * np.pi * shift) ** 2))
    return np.sort(np.abs(s[order[:n]]))


def data(rng, n, damping):
    k = 100.0 * 10 ** rng.uniform(-0.5, 0.5, n)
    return k, damping * k * rng.uniform(0.3, 1.0, n), rng.uniform(0.5, 2.0, n)


def sparse(m, n, shift):
    return model_modes(m, None, n, (), time.perf_counter(), shift)


def small_chains():
    rng = np.random.default_rng(17)
    for _ in range(40):
        n, damping = int(rng.integers(30, 90)), 10 ** rng.uniform(-6, -2.3)
        k, c, mass = data(rng, n, damping)
        s = all_roots(k, c, mass)
        place = np.sort(np.abs(s))[int(rng.integers(0, len(s) // 2))]
        yield k, c, mass, s, int(rng.integers(1, 6)), place * rng.uniform(0.9, 1.1) / (2 * np.pi)


def test_modes_nearest_to_a_shift_are_those_of_the_state_matrix():
    proved = 0
    for k, c, mass, s, n, shift in small_chains():
        found = sparse(chain(len(k), k, c, mass), n, shift)
        # None: the damping is too strong for a proof, and the dense route has to answer
        if found is None:
            continue
        proved += 1
        assert found.status == "converged"
        np.testing.assert_allclose(np.abs(found.eigenvalue), nearest(s, n, shift), rtol=1e-8)
    assert proved >= 25


def test_what_cannot_be_proved_is_answered_by_the_dense_route():
    """Damping of the order of the critical one: `mb.modes` does not return what the sparse route found."""
    rng = np.random.default_rng(5)
    k, c, mass = data(rng, 150, 0.5)
    m = chain(150, k, c, mass)
    assert sparse(m, 3, 0.4) is None
    found = mb.modes(m, n=3, shift=0.4)
    alls = mb.modes(m)
    order = np.argsort(np.abs(np.abs(alls.eigenvalue) ** 2 - (2 * np.pi * 0.4) ** 2))[:3]
    np.testing.assert_allclose(np.abs(found.eigenvalue), np.sort(np.abs(alls.eigenvalue[order])), rtol=1e-9)


def test_too_large_for_the_dense_route_what_cannot_be_proved_is_refused(monkeypatch):
    monkeypatch.setattr("mbrs.linear.sparse_modes._DENSE_AT_MOST", 10)
    rng = np.random.default_rng(5)
    k, c, mass = data(rng, 150, 0.5)
    with pytest.raises(RouteError, match="shift="):
        sparse(chain(150, k, c, mass), 3, 0.4)


@pytest.mark.parametrize("shift", [0.02, 0.1, 1.5])
def test_a_damped_chain_of_450_coordinates(shift):
    n = 450
    k, c = np.full(n, 100.0), np.array([0.02 * (1 + i % 3) for i in range(n)])
    m = chain(n, k, c, np.ones(n))
    s = all_roots(k, c, np.ones(n))
    for count in (2, 5):
        found = mb.modes(m, n=count, shift=shift)
        assert found.status == "converged"
        np.testing.assert_allclose(np.abs(found.eigenvalue), nearest(s, count, shift), rtol=1e-8)
