"""The turning itself is not a critical speed, however light the hub; soft modes beside stiff ones stay."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest


def rotor(hub, soft=1e6, axis=(0.31, -0.83, 0.46)):
    turn = np.asarray(axis) / np.linalg.norm(axis)
    x = np.cross(turn, [0.2, 0.9, -0.1])
    x /= np.linalg.norm(x)
    frame = np.column_stack([turn, x, np.cross(turn, x)])
    m = mb.Model("r")
    h = m.body("hub", mass=hub, inertia=(hub * 1e-4,) * 3, orientation=frame)
    d = m.body("disc", mass=10.0, inertia=(0.1, 0.05, 0.05), orientation=frame)
    m.revolute("spin", m.ground, h, at=(0, 0, 0), axis=turn)
    m.bushing("shaft", h, d, at=(0, 0, 0), orientation=frame, k=(1e8, soft, soft, 1e5, 1e4, 1e4))
    return m


@pytest.mark.some(4)
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0.31, -0.83, 0.46)])
@pytest.mark.parametrize("hub", [3e-7, 1e-5, 7e-3, 1.3])
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_a_light_hub_adds_no_critical_speed(hub, axis):
    found = mb.campbell(rotor(hub, axis=axis), "spin", speed=np.linspace(0, 800, 9)).critical
    assert [c.order for c in found] == [1.0] * len(found)
    assert min(c.speed for c in found) > 100.0
    # the disc on its springs: k = m W^2
    assert min(abs(c.speed - np.sqrt(1e6 / 10.0)) for c in found) < 1e-5 * found[0].speed


@pytest.mark.parametrize("soft", [3e-2, 7.0])
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_soft_modes_beside_stiff_ones_are_found(soft):
    found = mb.campbell(rotor(1.3, soft), "spin", speed=np.linspace(0, 50, 9)).critical
    assert min(abs(c.speed / np.sqrt(soft / 10.0) - 1) for c in found) < 1e-4
