"""Steady rotation: the same roots after a change; what cannot be steady is refused, or its number means something."""

import re
import warnings

import changes
import mbrs as mb
import numpy as np
import pytest
import units
import zoo


def rotor():
    """A disc on a shaft, in two crossed hinges with springs, spinning."""
    m = mb.Model("top")
    g = m.body("gimbal", mass=1.0, inertia=(1e-3, 1.2e-3, 1.1e-3), at=(0, 0, 0))
    d = m.body("disc", mass=1.0, inertia=(0.012, 0.012, 0.02), at=(0, 0, 0))
    m.universal("support", m.ground, g, at=(0, 0, 0), axis="x", axis2="y", k=(40.0, 30.0))
    m.revolute("shaft", g, d, at=(0, 0, 0), axis="z")
    return changes.turned(np.random.default_rng(4))(m)


CHANGES = {k: v for k, v in zoo.CHANGES.items() if k not in ("repeated",)}


def roots(model, rate, name="shaft"):
    modes = mb.modes(model, at=mb.steady_motion(model, {name: rate}))
    return np.sort(np.abs(modes.roots))


@pytest.mark.some(8)
@pytest.mark.parametrize("change", CHANGES)
def test_roots(change):
    expected = roots(rotor(), 130.0)
    made = CHANGES[change](np.random.default_rng(6))
    found = roots(made(rotor()), 130.0 / made.time, made.rename("shaft")) * made.time
    if change in zoo.PARTS:
        expected = np.sort(np.concatenate([expected, [zoo.PARTS[change]] * 2]))
    assert found[2:] == pytest.approx(expected[2:], rel=max(1e-9, 100 * made.error), abs=1e-6)


def disc(k_axial, k_tilt=2e3, length=1.0):
    """A disc on a bushing that does not resist its spin but, by its rotation vector, its tilt."""
    m = mb.Model("disc")
    d = m.body("disc", mass=10.0, inertia=(0.1, 0.05, 0.05), at=(0, 0, 0))
    m.bushing("support", m.ground, d, at=(0, 0, 0), k=(k_axial, 1e6, 1e6, 0, k_tilt, k_tilt))
    return units.in_units(length)(m) if length != 1.0 else m


def change_over_a_turn(m):
    """What the result says, as a fraction; a refusal that names the object is as good."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        try:
            return mb.steady_motion(m, {"disc.rx": 200.0}).error
        except mb.MbrsError as reason:
            assert re.search("support|disc", str(reason))
            return None


@pytest.mark.parametrize("k_axial", [1e6, 1e7, 1e9, 1e12])
def test_the_change_over_a_turn_is_measured_by_row(k_axial):
    """Its tilting stiffness changes by more than its own size within half a turn, whatever the others are."""
    found = change_over_a_turn(disc(k_axial))
    assert found is None or found > 0.1


def test_the_change_over_a_turn_has_no_units():
    found = [change_over_a_turn(disc(1e6, length=length)) for length in (1.0, 1e3, 1e-3)]
    assert found[0] is None or found == pytest.approx([found[0]] * 3, rel=1e-6)
