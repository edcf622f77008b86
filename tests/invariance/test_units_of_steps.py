"""Steps of motions whatever the units: the same method is chosen, as many are made, and bodies are turned alike between them."""

from __future__ import annotations

import descriptions
import mbrs as mb
import numpy as np
import pytest
from units import in_units


def braked(c):
    """A pendulum whose bob is held by a damper to a light slider."""
    m = mb.Model("braked", gravity=(0, 0, -9.81))
    bob = m.body(
        "bob",
        mass=1.0,
        inertia=(0.01, 0.01, 0.01),
        at=(0.5, 0, 0),
        velocity=(0, 0, -0.15),
        angular_velocity=(0, 0.3, 0),
    )
    m.revolute("hinge", m.ground, bob, at=(0, 0, 0), axis="y", k=2.0)
    light = m.body("light", mass=0.01, inertia=(1e-4, 1e-4, 1e-4), at=(0.5, 0, -0.3))
    m.prismatic("rail", m.ground, light, at=(0.5, 0, -0.3), axis="z", k=1.0)
    m.spring_damper("brake", bob, light, at=((0.5, 0, 0), (0.5, 0, -0.3)), k=3.0, c=c)
    return m


@pytest.mark.parametrize("units", [(1.0, 1.0, 1e-9), (1.0, 1.0, 1e9), (1e-6, 1e3, 1e-12), (1e4, 1e-3, 1e6)])
@pytest.mark.parametrize("c", [1e-3, 3e3])
def test_the_method(c, units):
    def chosen(*u):
        m = in_units(*u).apply(descriptions.Description.of(braked(c))).model()
        return mb.simulate(m, t=np.linspace(0.0, 0.5, 3) * u[2])

    here, there = chosen(1.0, 1.0, 1.0), chosen(*units)
    print(c, here.method, there.method, here.stats.counts["steps"], there.stats.counts["steps"])
    assert there.method == here.method
    assert abs(there.stats.counts["steps"] - here.stats.counts["steps"]) <= 1


def thrown():
    """A tumbling body that drags another one along."""
    m = mb.Model("thrown", gravity=(0, 0, -9.81))
    spin, inertia = np.array([1.0, 2.0, 3.0]), (0.02, 0.03, 0.04)
    for name, x in (("b", 0.3), ("c", 1.3)):
        at = np.array([x, 0.1, 0.0])
        v = np.array([2.0, 1.0, 5.0]) + np.cross(spin, at)
        m.body(name, mass=1.0, inertia=inertia, at=at, velocity=v, angular_velocity=spin)
    m.spherical("s", "b", "c", at=(1.0, 0.1, 0.0))
    return m


@pytest.mark.parametrize("units", [(1e9, 1.0, 1.0), (1e6, 1e-3, 1e3), (1e-9, 1.0, 1e-6)])
@pytest.mark.parametrize("method", ["radau", "generalized-alpha"])
def test_between_steps(method, units):
    def turned(*u):
        m = in_units(*u).apply(descriptions.Description.of(thrown())).model()
        return mb.simulate(m, t=np.linspace(0.0, 0.3, 31) * u[2], method=method, step=0.1 * u[2]).poses["orientation"]

    worst = np.abs(turned(*units) - turned(1.0, 1.0, 1.0)).max()
    print(f"{method}, {units}: {worst:.1e}")
    assert worst < 1e-10
