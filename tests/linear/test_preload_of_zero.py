"""A preload of zero does not hide what nothing holds: rigid motions come from the strains of elements, as without it."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.linalg import eigh


def chain(seed, n):
    """Bodies on sprung ball joints, the last one on a ball joint without spring, the first one on a spring with a preload of zero."""
    rng = np.random.default_rng(seed)
    m, last, p = mb.Model("chain"), None, np.zeros(3)
    for i in range(n):
        q = p + np.array([0.5, 0, 0]) + 0.3 * rng.normal(size=3)
        body = m.body(
            f"b{i}",
            mass=1.5,
            inertia=(0.1, 0.12, 0.15),
            at=q,
            orientation=mb.rotation(tuple(rng.normal(size=3)), 1.0),
        )
        spring = {"k": tuple(1e3 * (1 + rng.random(3)))} if i < n - 1 else {}
        turned = mb.rotation(tuple(rng.normal(size=3)), 0.7)
        m.spherical(f"j{i}", m.ground if last is None else last, body, at=(p + q) / 2, orientation=turned, **spring)
        if i == 0:
            m.spring_damper("s", m.ground, body, at=(q + rng.normal(size=3), q), k=20.0, preload=0.0)
        last, p = body, q
    return m


@pytest.mark.parametrize("state", ["drawn", "equilibrium"])
@pytest.mark.parametrize("n", [3, 6])
def test_three_rotations_of_the_last_body_are_rigid(n, state):
    for seed in range(10):
        m = chain(seed, n)
        at = mb.equilibrium(m) if state == "equilibrium" else None
        found, linear = mb.modes(m, at=at), mb.linearize(m, at=at)
        assert found.status == "converged"
        assert list(found.kind[:4]) == ["rigid"] * 3 + ["vibration"]
        assert np.max(found.error[3:]) < 1e-9
        exact = np.sqrt(eigh(linear.K, linear.M, eigvals_only=True)[3:])
        np.testing.assert_allclose(found.omega[3:], exact, rtol=1e-9)


def test_sweeps_compute_the_same():
    m = chain(2, 5)
    masses = np.array([1.0, 1.5, 2.0])
    runs = mb.sweep(m, mb.design.from_table({"b1.mass": masses}), mb.outputs.modes(n=6))
    for mass, frequency in zip(masses, np.asarray(runs["frequency"]), strict=True):
        m.set({"b1.mass": mass})
        np.testing.assert_allclose(frequency, mb.modes(m).frequency[:6], rtol=1e-9, atol=1e-9)
        assert np.all(frequency[:3] == 0.0)
