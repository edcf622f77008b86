"""Rotors in time: lags against a general integrator, the steady ends, wind from the side."""

from __future__ import annotations

import doctest

import matplotlib.pyplot as plt
import mbrs as mb
import mbrs.aero.dynamic_inflow
import numpy as np
import pytest
from mbrs.aero.dynamic_inflow import lagging, time_constants
from mbrs.errors import ModelError
from scipy.integrate import solve_ivp

RNG = np.random.default_rng(77)


def turbine(**more):
    a = np.radians(np.arange(-20.0, 20.5, 1.0))
    section = mb.aero.polar(a, 2 * np.pi * np.sin(a), 0.008 + 0.01 * a**2).extend(aspect_ratio=17.0)
    x = np.linspace(0.15, 1.0, 12) * 37.3
    phi = 2 / 3 * np.arctan(37.3 / (7.0 * x))
    return mb.aero.rotor(mb.aero.blade(x, 0.9 + 40 / (x + 10), phi - 0.08, section), 3, **more)


def test_the_lags_are_those_of_the_equations():
    for _ in range(3):
        first, second, w = RNG.uniform(1.0, 4.0), RNG.uniform(0.2, 1.0), RNG.uniform(0.4, 1.5)
        truth = solve_ivp(
            lambda x, y, f=first, s=second, w=w: [
                (np.sin(w * x) + 0.6 * f * w * np.cos(w * x) - y[0]) / f,
                (y[0] - y[1]) / s,
            ],
            (0.0, 9.0),
            [0.0, 0.0],
            rtol=1e-10,
            atol=1e-12,
        ).y[1, -1]
        errors = []
        for n in (80, 160, 320):
            t = np.linspace(0.0, 9.0, n + 1)
            smooth = np.sin(w * t)[:, None]
            found = lagging(t, smooth, np.full_like(smooth, first), np.full_like(smooth, second))
            errors.append(abs(found[-1, 0] - truth))
        assert errors[2] < 1e-3 and errors[0] / errors[2] > 14, errors


def test_the_lags_are_oeyes():
    first, second = time_constants(np.array([0.0, 1 / 3, 2.0]), np.array([0.0, 0.7, 1.0]), np.array(5.0))
    assert first == pytest.approx([5.5, 5.5 / (1 - 1.3 / 3), 5.5 / 0.35])
    assert second == pytest.approx(first * [0.39, 0.39 - 0.26 * 0.49, 0.13])


@pytest.mark.some(1)
@pytest.mark.parametrize("inflow", ["bem", "dynamic-inflow"])
def test_steady_ends_are_those_of_the_performance(inflow):
    rotor = turbine(precone=0.1)
    t = np.linspace(0.0, 300.0, 1201)
    pitch = np.where(t < 50.0, 0.0, 0.04)
    found = mb.aero.rotor_response(rotor, t, 8.3, 1.5, pitch=pitch, inflow=inflow, elements=40)
    ratio = 1.5 * rotor.radius / 8.3
    for i, p in ((0, 0.0), (-1, 0.04)):
        steady = mb.aero.performance(rotor, ratio, pitch=p, elements=40)
        assert found.thrust[i] == pytest.approx(steady.thrust(8.3)[0], rel=1e-6)
        assert found.power[i] == pytest.approx(steady.power(8.3)[0], rel=1e-6)
    just = np.searchsorted(t, 50.0)
    if inflow == "bem":
        assert found.thrust[just] == pytest.approx(found.thrust[-1], rel=1e-9)
    else:  # less pitch, less lift, and the wake of more lift is still there
        assert found.thrust[just] < found.thrust[-1] - 0.2 * (found.thrust[0] - found.thrust[-1])
        assert np.all(np.diff(found.thrust[just + 4 : just + 200]) > 0)
    assert found.error < 0.1 and found.status == "converged"
    made = found.plot()
    assert made.axes[0].lines
    plt.close(made)


def test_wind_from_either_side_gives_the_same_and_less():
    rotor = turbine()
    t = np.linspace(0.0, 2 * np.pi / 1.5 * 4, 193)
    last = t > t[-1] * 0.5
    straight = mb.aero.rotor_response(rotor, t, 8.3, 1.5)
    both = [mb.aero.rotor_response(rotor, t, 8.3, 1.5, yaw=s * 0.4) for s in (1, -1)]
    up = mb.aero.rotor_response(rotor, t, 8.3, 1.5, tilt=0.4)
    powers = [np.mean(r.power[last][:-1]) for r in (*both, up)]
    assert powers[0] == pytest.approx(powers[1], rel=1e-6) and powers[2] == pytest.approx(powers[0], rel=1e-6)
    ratio = powers[0] / np.mean(straight.power[last])
    assert np.cos(0.4) ** 3.2 < ratio < np.cos(0.4) ** 1.5
    # each blade feels it once a turn: blade 1 at the top and at the bottom
    angle = both[0].angle_of_attack[:, 25]
    assert np.ptp(angle[last]) > 0.01 and np.ptp(straight.angle_of_attack[last, 25]) < 1e-9


@pytest.mark.parametrize(
    "change, message",
    [
        ({"t": [0.0, 1.0]}, "at least 3 times"),
        ({"t": [0.0, 2.0, 1.0]}, "increase"),
        ({"wind": -3.0}, "wind must be positive"),
        ({"wind": [1.0, 2.0]}, "each of 3 times"),
        ({"speed": np.nan}, "NaN"),
        ({"yaw": 1.2}, "60 degrees"),
        ({"inflow": "wake"}, "dynamic-inflow"),
        ({"elements": 9}, "even"),
    ],
)
def test_input_that_cannot_be(change, message):
    good = dict(t=[0.0, 1.0, 2.0], wind=8.0, speed=1.5)
    with pytest.raises(ModelError, match=message):
        mb.aero.rotor_response(turbine(), **(good | change))


def test_examples_of_docstrings():
    found = doctest.testmod(mbrs.aero.dynamic_inflow)
    assert found.attempted > 0 and found.failed == 0
