"""A hexapod without symmetry whose legs have twelve parameters, for tests of updates."""

from __future__ import annotations

import mbrs as mb
import numpy as np

POINTS = ((0.1, 0.02, 0.15), (-0.06, 0.08, 0.13))


def hexapod(seed=5):
    """Model and the names of its parameters, k0, c0, ..., k5, c5."""
    rng = np.random.default_rng(seed)
    m = mb.Model("hexapod")
    inertia = ((0.16, 0.011, -0.02), (0.011, 0.19, 0.007), (-0.02, 0.007, 0.13))
    p = m.body(
        "payload", mass=18.7, inertia=inertia, at=(0.013, -0.007, 0.108), orientation=mb.rotation((0.3, -0.5, 0.8), 0.4)
    )
    names = []
    for i, (a, b) in enumerate(mb.examples.cubic_hexapod_points(edge=0.21, centre=(0.01, 0.0, 0.1))):
        k = m.parameter(f"k{i}", 1e5 * (0.6 + 0.8 * rng.random()), unit="N/m")
        c = m.parameter(f"c{i}", 60.0 * (0.6 + 0.8 * rng.random()), unit="N s/m")
        ends = tuple(np.array(x) + 0.01 * rng.standard_normal(3) for x in (a, b))
        m.spring_damper(f"leg{i}", m.ground, p, at=ends, k=k, c=c)
        names += [f"k{i}", f"c{i}"]
    return m, names


def transfer(m, n=80):
    """Accelerances of two points by an oblique force and another one."""
    p = m["payload"]
    outputs = [p.motion(axis, at=x) for x in POINTS for axis in ("x", "y", "z")]
    inputs = [p.force((0.3, 0.5, -0.81), at=POINTS[0]), p.force("y", at=POINTS[1])]
    return mb.frf(m, inputs, outputs, frequency=np.linspace(5.0, 60.0, n), kind="accelerance")


def noisy(h, seed, share=0.03):
    """Transfer functions with normal noise, a share of the mean of each function; and its standard deviations (n_out, n_in)."""
    rng = np.random.default_rng(seed)
    sd = share * np.abs(h.value).mean(axis=2)
    noise = rng.standard_normal(h.value.shape) + 1j * rng.standard_normal(h.value.shape)
    return h.replaced(value=h.value + sd[..., None] * noise), sd


def moved(m, names, seed, share=0.1):
    """Start an update away from the truth, and return the truth."""
    true = np.array([float(m.value(n)) for n in names])
    off = 1.0 + share * np.random.default_rng(seed).standard_normal(len(names))
    m.set(dict(zip(names, (true * off).tolist(), strict=True)))
    return true


def covered(repetitions, first=0):
    """How many of the 95 % intervals of all parameters hold the true value, of how many."""
    m, names = hexapod()
    h = transfer(m)
    true = np.array([float(m.value(n)) for n in names])
    hits = 0
    for k in range(first, first + repetitions):
        m.set(dict(zip(names, true.tolist(), strict=True)))
        test, _ = noisy(h, 1000 + k)
        moved(m, names, 50_000 + k)
        fit = mb.update(m, test, names)
        assert fit.status == "converged"
        low, high = fit.interval(0.95).T
        hits += int(np.sum((low <= true) & (true <= high)))
    return hits, repetitions * len(names)
