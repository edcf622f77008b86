"""Damped modes of chains whose damping is light, or not: against Newton's method on three-term recurrences with 50 digits."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mpmath import mp, mpc, mpf

EPS = np.finfo(float).eps


def chain(rng, n, damping, spread):
    """Masses in a row on springs of very different sizes, dampers on some of them; diagonals and couplings of M, C, K."""
    mass = rng.uniform(0.3, 3.0, n) * spread ** rng.uniform(-0.5, 0.5, n)
    springs = rng.uniform(0.3, 3.0, n + 1) * 731.0 * spread ** rng.uniform(-0.5, 0.5, n + 1)
    dampers = np.where(rng.random(n + 1) < 0.4, damping * rng.uniform(0.2, 1.0, n + 1), 0.0)

    def rows(a):
        return a[:-1] + a[1:], -a[1:-1]

    return mass, rows(dampers), rows(springs)


def matrices(diagonal, beside):
    return np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1)


def determinant(s, mass, c, k):
    """det (s^2 M + s C + K) and its derivative, in the working precision of mpmath."""
    before, now, slope_before, slope = mpf(0), mpf(1), mpf(0), mpf(0)
    for i, m in enumerate(mass):
        a, da = s * s * mpf(m) + s * mpf(c[0][i]) + mpf(k[0][i]), 2 * s * mpf(m) + mpf(c[0][i])
        b, db = (s * mpf(c[1][i - 1]) + mpf(k[1][i - 1]), mpf(c[1][i - 1])) if i else (mpf(0), mpf(0))
        after = a * now - b * b * before
        slope_after = da * now + a * slope - 2 * b * db * before - b * b * slope_before
        before, now, slope_before, slope = now, after, slope, slope_after
    return now, slope


def polished(s, *parts):
    """The exact root next to s; Newton's method divides by the others where it starts too far away."""
    s = mpc(s)
    for _ in range(60):
        value, slope = determinant(s, *parts)
        step = value / slope
        s -= step
        if abs(step) < mpf(10) ** -35 * abs(s):
            return s
    raise AssertionError("no root near the computed one")


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
@pytest.mark.parametrize(("damping", "spread"), [(0.03, 1.0), (0.3, 1.0), (0.1, 1e3), (4.0, 1.0)])
def test_roots_are_right_to_their_error(damping, spread, seed):
    rng = np.random.default_rng([seed, int(100 * damping), int(spread)])
    n = int(rng.integers(41, 52))
    mass, c, k = chain(rng, n, damping, spread)
    unit, order = 2.0 ** rng.integers(-6, 7, n), rng.permutation(n)
    M, C, K = ((np.outer(unit, unit) * x)[np.ix_(order, order)] for x in (np.diag(mass), matrices(*c), matrices(*k)))
    r = mb.modes(mb.MechanicalSystem(M, C, K))
    assert r.status == "converged" and len(r.eigenvalue) == n
    upper = r.roots[r.roots.imag >= 0.0]  # the others are their conjugates
    with mp.workdps(50):
        exact = [polished(s, mass, c, k) for s in upper]
        apart = min(abs(a - b) for i, a in enumerate(exact) for b in exact[:i])
        own = [exact[int(np.argmin(np.abs(upper - s)))] for s in r.eigenvalue]
        error = np.array([float(abs(s - complex(e)) / abs(e)) for s, e in zip(r.eigenvalue, own, strict=True)])
    light = "general eigensolutions" not in r.stats.counts
    print(f"{damping} {spread} {seed}: light {light}, largest error {error.max():.1e} of {r.error[error.argmax()]:.1e}")
    assert apart > 1e-20 * max(abs(s) for s in exact)
    assert np.all(error <= 10 * r.error + 4 * EPS)
    assert light or damping > 0.1 or spread > 1.0
