"""Bands without stability that lie between two points of a curve: found in both directions, also where steps reach over them."""

from itertools import pairwise

import mbrs as mb
import numpy as np
import pytest
from scipy.linalg import expm

ROOTS = np.array([1.8751040687, 4.6940911330, 7.8547574382, 10.995540735])


def cantilever_with_a_stop(rng):
    """Four modes of a cantilever of steel, mass 1.56 kg, whose tip meets a stop 1 mm away; the matrices, the stop, its rows."""
    w = np.sqrt(350.0 / 1.56) * ROOTS**2
    damping = 0.01 * np.exp(rng.uniform(-0.15, 0.15))
    stiffness = 5e3 * np.exp(rng.uniform(-0.15, 0.15))
    tip = 2 / np.sqrt(1.56) * np.array([1.0, -1.0, 1.0, -1.0])
    force = 0.3 * np.exp(rng.uniform(-0.1, 0.1)) * tip
    return np.diag(2 * damping * w), np.diag(w**2), tip, stiffness, 1e-3, force


def largest_multiplier(C, K, tip, stiffness, gap, X, omega, samples=20000):
    """Of the motion with the coefficients X, by the exact flows between the instants at which the stop is met or left."""
    period = 2 * np.pi / omega
    t = (np.arange(samples) + 0.5) * period / samples
    u = tip @ X
    z = sum(
        (u[2 * k - 1] * np.cos(k * omega * t) + u[2 * k] * np.sin(k * omega * t) for k in range(1, (len(u) + 1) // 2)),
        np.full(samples, u[0]),
    )
    closed = z > gap
    ends = [0, *(np.flatnonzero(np.diff(closed)) + 1), samples]
    n = len(C)
    phi = np.eye(2 * n)
    for first, last in pairwise(ends):
        stiff = K + closed[first] * stiffness * np.outer(tip, tip)
        flow = np.block([[np.zeros((n, n)), np.eye(n)], [-stiff, -C]])
        phi = expm(flow * period * (last - first) / samples) @ phi
    return float(np.max(np.abs(np.linalg.eigvals(phi))))


def borders(curve):
    return sorted((e for e in curve.events if e.kind == "neimark-sacker"), key=lambda e: e.omega)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4, 7, 9])
def test_both_directions_find_the_borders(seed):
    C, K, tip, stiffness, gap, force = cantilever_with_a_stop(np.random.default_rng(seed))
    system = mb.MechanicalSystem(np.eye(4), C, K, elements=[mb.Gap(stiffness, gap, w=tip)])
    common = dict(force=force, harmonics=9)
    fine = mb.frequency_response(system, frequency=(8.5, 9.5), step=0.01, max_step=0.02, **common)
    expected = [e.omega for e in borders(fine)]
    for step in (0.1, 0.17):
        up = mb.frequency_response(system, frequency=(8.5, 9.5), max_step=step, step=step, **common)
        start = fine.point(-1).X
        down = mb.frequency_response(system, frequency=(9.5, 8.5), max_step=step, step=step, x0=start, **common)
        for curve in (up, down):
            found = [e.omega for e in borders(curve)]
            assert len(found) == len(expected) and np.allclose(found, expected, rtol=1e-7)
    model = (C, K, tip, stiffness, gap)
    for event in borders(fine):
        assert abs(largest_multiplier(*model, event.X, event.omega) - 1) < 2e-3
