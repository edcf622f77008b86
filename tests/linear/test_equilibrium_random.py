"""Equilibria of random models far from their drawn state. All data are invented; of every model the energy is bounded below, so
that a stable equilibrium exists.
"""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest

COUNT = 200


def positive(rng, scales):
    """A full symmetric positive definite stiffness with these sizes."""
    a = rng.normal(size=(6, 6)) * np.sqrt(scales)[:, None] * 0.3
    return np.diag(scales) + a @ a.T


def bushings(rng, force=40.0, turned=0.0):
    """A chain on coupled bushings that a dead force bends by up to a right angle and more."""
    n = int(rng.integers(4, 26))
    m = mb.Model("bushings")
    last, p = m.ground, np.zeros(3)
    scales = np.array([1e5, 2e5, 3e5, 2e2, 1e2, 3e2]) * 10 ** rng.uniform(-1, 1, 6)
    for i in range(n):
        body = m.body(f"b{i}", mass=1.0, inertia=(0.02, 0.03, 0.025), at=p + [0.05, 0, 0])
        m.bushing(f"e{i}", last, body, at=p, k=positive(rng, scales))
        last, p = body, p + np.array([0.1, 0.02 * rng.normal(), 0.02 * rng.normal()])
    m.force("tip", last, at=p, value=force * rng.normal(size=3))
    if turned:
        m.torque("twist", f"b{n // 2}", value=turned * rng.normal(size=3))
    return m


def tree(rng):
    """Heavy bodies on hinges, ball joints and universal joints with weak springs, gravity from anywhere."""
    m = mb.Model("tree", gravity=tuple(9.81 * rng.normal(size=3)))
    bodies, ends = [m.ground], [np.zeros(3)]
    for i in range(int(rng.integers(3, 20))):
        j = int(rng.integers(max(0, len(bodies) - 3), len(bodies)))
        arm, k = 0.2 * rng.normal(size=3), 10 ** rng.uniform(-1, 2)
        body = m.body(f"b{i}", mass=rng.uniform(0.2, 3), inertia=(0.02, 0.03, 0.025), at=ends[j] + arm / 2)
        axis = rng.normal(size=3)
        kind = rng.integers(3)
        if kind == 0:
            m.revolute(f"j{i}", bodies[j], body, at=ends[j], axis=axis, k=k)
        elif kind == 1:
            m.spherical(f"j{i}", bodies[j], body, at=ends[j], k=[k, k, k])
        else:
            across = np.cross(axis, rng.normal(size=3))
            m.universal(f"j{i}", bodies[j], body, at=ends[j], axis=axis, axis2=across, k=[k, 2 * k])
        bodies.append(body)
        ends.append(ends[j] + arm)
    return m


def net(rng):
    """Bodies between springs that are far from their natural lengths, weakly held by bushings to ground."""
    n = int(rng.integers(3, 12))
    m = mb.Model("net", gravity=(0, 0, -9.81))
    points = rng.normal(size=(n, 3))
    bodies = [m.body(f"b{i}", mass=rng.uniform(0.2, 5), inertia=(0.05,) * 3, at=points[i]) for i in range(n)]
    for i in range(n):
        m.bushing(f"g{i}", m.ground, bodies[i], at=points[i], k=(20,) * 3 + (3.0,) * 3)
        for s in range(4):
            j, k = int(rng.integers(n)), 10 ** rng.uniform(1.5, 3.5)
            own = points[i] + 0.2 * rng.normal(size=3)
            if s == 0 or j == i:
                m.spring_damper(f"s{i}_{s}", m.ground, bodies[i], at=(points[i] + rng.normal(size=3), own), k=k)
            else:
                other = points[j] + 0.2 * rng.normal(size=3)
                m.spring_damper(f"s{i}_{s}", bodies[j], bodies[i], at=(other, own), k=k, length=rng.uniform(0.3, 2.0))
    return m


def ladder(rng):
    """Loops of redundant hinges with springs, gravity from anywhere in their plane."""
    n, angle = int(rng.integers(1, 7)), rng.uniform(0, 2 * np.pi)
    m = mb.Model("ladder", gravity=(9.81 * np.cos(angle), 0, 9.81 * np.sin(angle)))
    rails = []
    for side in (0, 1):
        last, links = m.ground, []
        for i in range(n):
            z = -0.4 * i
            body = m.body(f"l{side}_{i}", mass=rng.uniform(0.3, 2), inertia=(0.02, 0.02, 0.01), at=(side, 0, z - 0.2))
            m.revolute(f"j{side}_{i}", last, body, at=(side, 0, z), axis="y", k=10 ** rng.uniform(-0.5, 1.5))
            last = body
            links.append(body)
        rails.append(links)
    for i in range(n):
        z = -0.4 * i - 0.3
        rung = m.body(f"r{i}", mass=0.5, inertia=(0.01, 0.05, 0.05), at=(0.5, 0, z))
        m.revolute(f"p{i}", rails[0][i], rung, at=(0, 0, z), axis="y", k=1.0)
        m.revolute(f"q{i}", rung, rails[1][i], at=(1, 0, z), axis="y", k=1.0)
    return m


def laws(rng):
    """Hinges and slides with stiffening laws and gaps; some travel a hundred lengths of the model."""
    m = mb.Model("laws", gravity=tuple(9.81 * rng.normal(size=3)))
    last, p = m.ground, np.zeros(3)
    for i in range(int(rng.integers(2, 10))):
        arm = 0.2 * rng.normal(size=3)
        body = m.body(f"b{i}", mass=rng.uniform(0.2, 3), inertia=(0.02, 0.03, 0.025), at=p + arm / 2)
        law = mb.Cubic(10 ** rng.uniform(0, 4)) if rng.random() < 0.5 else mb.Gap(10 ** rng.uniform(2, 5), 0.05)
        kind, k = ("revolute", 1.0) if rng.random() < 0.5 else ("prismatic", 10.0)
        getattr(m, kind)(f"j{i}", last, body, at=p, axis=rng.normal(size=3), k=k * 10 ** rng.uniform(-1, 2), law=law)
        last, p = body, p + arm
    return m


KINDS = {
    "bushings": bushings,
    "bushings and a torque": lambda rng: bushings(rng, turned=2.0),
    "tree": tree,
    "net": net,
    "ladder": ladder,
    "laws": laws,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(KINDS))
def test_random_models_find_a_stable_equilibrium(name):
    """At every one the forces balance and no stiffness is negative; before the descent in energy most of these failed."""
    iterations, failed, models = [], {}, -(-COUNT // len(KINDS))
    for seed in range(models):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mb.MbrsWarning)
                eq = mb.equilibrium(KINDS[name](np.random.default_rng(seed)))
        except mb.MbrsError as trouble:
            failed[seed] = str(trouble)[:80]
            continue
        iterations.append(eq.iterations)
        assert eq.stable and eq.residual < 1e-9
    print(
        f"{name}: {len(failed)} of {models} fail; iterations median {np.median(iterations):.0f}, most {max(iterations)}"
    )
    assert not failed
    assert max(iterations) < 200


def test_easy_models_need_no_descent():
    """A sagging bushing, and a link that falls from the level: Newton's method as before, without a look at energies."""
    sagging = mb.Model("sagging", gravity=(0, 0, -9.81))
    body = sagging.body("b", mass=1.0, inertia=(0.1,) * 3, at=(0, 0, 0))
    sagging.bushing("mount", sagging.ground, body, at=(0.1, 0, 0), k=(1e4,) * 3 + (50.0,) * 3)
    falling = mb.Model("falling", gravity=(0, -9.81, 0))
    rod = falling.body("rod", mass=1.0, inertia=(1e-3, 1 / 12, 1 / 12), at=(0.5, 0, 0))
    falling.revolute("hinge", falling.ground, rod, at=(0, 0, 0), axis="z")
    for m, most in ((sagging, 8), (falling, 20)):
        counts = mb.equilibrium(m).stats.counts
        print(m.name, counts)
        assert "descent steps" not in counts and counts["equilibrium iterations"] <= most
