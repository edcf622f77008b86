"""Gradients of motions in wind: both methods against differences, and what is refused."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from air_models import rotor, vane


def swing(s):
    """A number of the vane that all its parameters move."""
    return s.angular_velocity("arm") @ [1.0, 0.3, -0.4] + s.position("arm") @ [0.2, 0.1, 0.7]


def spin(s):
    """A number of the rotor, whose hub is free to turn."""
    return s.angular_velocity("hub")[0] + s.position("blade2")[1]


def free_rotor(inflow="bem", **more):
    """A rotor that wind turns, in shear across its axis: loads differ over the disc."""
    m, _ = rotor(inflow, sections=4, shear=0.2, **more)
    m.set({"air.direction": [1.0, 0.2, 0.1]})
    return m


AIR = ["air.speed", "air.density", "air.pitch", "air.shear", "air.reference_height", "air.ground"]
SHEARED = {"shear": 0.21, "reference_height": 7.0, "ground": -9.0}
CASES = {
    "flexible, no induction": (lambda: vane(**SHEARED), swing, [*AIR, "hinge.k"], ()),
    "rigid, momentum": (lambda: vane(flexible=False, inflow="bem", **SHEARED), swing, [*AIR, "arm.com[0]", "arm.mass"], ()),
    "flexible, momentum": (lambda: vane(inflow="bem", **SHEARED), swing, [*AIR, "hinge.c"], ()),
    "rotor that runs free": (free_rotor, spin, ["air.speed", "air.pitch", "air.shear", "hub.inertia[0,0]"], ("drives",)),
    "rotor with states": (lambda: free_rotor("dynamic-inflow", attached=True, stall=3.7), spin,
                          ["air.speed", "air.pitch", "air.stall", "hub.inertia[0,0]"], ("drives",)),
}  # fmt: skip


# the modes of the flexible vane are too stiff for explicit steps of this length
SCHEMES = [(name, scheme) for name in CASES for scheme in ("ali3p", "generalized-alpha")] + [
    ("rigid, momentum", "explicit")
]


@pytest.mark.some(3)
@pytest.mark.parametrize("name, scheme", SCHEMES)
def test_gradients_in_wind_are_exact(name, scheme):
    make, what, parameters, without = CASES[name]
    given = {"t": 0.1, "step": 0.01, "scheme": scheme, "without": without}
    m = make()
    found = [mb.gradient(m, mb.Final(what), parameters, method=method, **given) for method in ("direct", "adjoint")]
    assert found[1].value == pytest.approx(found[0].value, rel=1e-12)
    direct, adjoint = (one.gradient for one in found)
    sizes = np.array([max(abs(m.value(p)), 0.1) for p in parameters])
    largest = np.max(np.abs(direct * sizes))
    assert np.max(np.abs(direct - adjoint) * sizes) < 1e-9 * largest
    for p, size, d in zip(parameters, sizes, direct, strict=True):
        ends = []
        for side in (1.0, -1.0):
            moved = m.copy()
            moved.set({p: m.value(p) + side * 1e-5 * size})
            ends.append(mb.gradient(moved, mb.Final(what), parameters[:1], method="direct", **given).value)
        difference = (ends[0] - ends[1]) / (2e-5 * size)
        assert abs(d - difference) * size < 1e-6 * largest, p
        assert abs(d) * size > 1e-6 * largest, p


@pytest.mark.parametrize("inflow", ["prescribed-wake", "free-wake"])
def test_inflow_with_steps_of_its_own_is_refused_by_name(inflow):
    m, _ = rotor(inflow, sections=4)
    with pytest.raises(
        mb.NotDifferentiableError, match=rf"'air' \(inflow '{inflow}'\) has no gradients.*'aerodynamics'"
    ):
        mb.gradient(m, mb.Final(spin), ["hub.mass"], t=0.1)
