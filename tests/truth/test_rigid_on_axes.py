"""Springs that end on the axis of a hinge hold nothing: what rounding leaves of their levers is not a stiffness, in any pose and unit."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest


def on_its_axis(rng, kind):
    """A heavy body on an oblique hinge, held by elements that end on the axis of the hinge, and a chain of such bodies on it."""
    unit, mass, stiff = 10.0 ** rng.uniform(-6, 6, 3)
    m = mb.Model("door")
    place, before = unit * rng.normal(size=3), m.ground
    for i in range(int(rng.integers(1, 4))):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        b = m.body(f"b{i}", mass=mass, inertia=np.full(3, 0.1 * mass * unit**2), at=place + unit * rng.normal(size=3))
        m.revolute(f"h{i}", before, b, at=place, axis=axis)
        end = place + rng.uniform(-2, 2) * unit * axis
        if kind == "spring":
            m.spring_damper(f"s{i}", before, b, at=(end + unit * rng.normal(size=3), end), k=stiff)
        elif kind == "bushing":
            m.bushing(f"s{i}", before, b, at=end, k=(stiff, 2 * stiff, 3 * stiff, 0, 0, 0))
        else:
            m.spring_damper(f"s{i}", before, b, at=(end + unit * axis, end), k=stiff, law=mb.Cubic(stiff / unit**2))
        place, before = place + unit * rng.normal(size=3), b
    return m


@pytest.mark.exact
@pytest.mark.parametrize("kind", ["spring", "bushing", "law"])
@pytest.mark.parametrize("seed", [*range(8), *(pytest.param(s, marks=pytest.mark.slow) for s in range(8, 60))])
def test_what_a_spring_on_an_axis_leaves_is_rigid(kind, seed):
    rng = np.random.default_rng([seed, 12])
    found = mb.modes(on_its_axis(rng, kind))
    print(found.omega, found.kind)
    assert set(found.kind) == {"rigid"} and np.all(found.omega == 0.0)


@pytest.mark.exact
@pytest.mark.parametrize("seed", range(8))
def test_a_small_lever_is_a_stiffness(seed):
    """Beside the axis by 1e-4 of the size and more: k r^2 / (I + m a^2), in random units."""
    rng = np.random.default_rng([seed, 13])
    unit, mass, stiff = 10.0 ** rng.uniform(-6, 6, 3)
    axis, across = rng.normal(size=(2, 3))
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, across)
    across /= np.linalg.norm(across)
    place, lever = unit * rng.normal(size=3), unit * 10.0 ** rng.uniform(-4, -1)
    m = mb.Model("door")
    b = m.body("b", mass=mass, inertia=np.full(3, 0.1 * mass * unit**2), at=place)
    m.revolute("h", m.ground, b, at=place, axis=axis)
    m.bushing("s", m.ground, b, at=place + lever * across, k=(stiff,) * 3 + (0,) * 3)
    found = mb.modes(m)
    assert found.omega[0] == pytest.approx(np.sqrt(stiff / (0.1 * mass)) * lever / unit, rel=1e-9)
