"""Oeye's dynamic stall: the closed form of a step, pitching sections against a general integrator, rotors in time."""

from __future__ import annotations

import doctest

import matplotlib.pyplot as plt
import mbrs as mb
import mbrs.aero.separation
import numpy as np
import pytest
from mbrs.aero.separation import Separation
from mbrs.errors import ModelError
from scipy.integrate import solve_ivp

SLOPE, ZERO = 6.1, np.radians(-2.3)


def attached_part(a):
    """A part f(alpha) that is chosen, smooth, one up to about 9 degrees from the angle of no lift and zero from 25 on."""
    x = np.clip((np.abs(a - ZERO) - np.radians(9.0)) / np.radians(16.0), 0.0, 1.0)
    return (1.0 - x**2 * (3.0 - 2.0 * x)) ** 2


def section(**more):
    """The polar of Kirchhoff's flow for that f."""
    a = np.radians(np.arange(-60.0, 60.01, 0.1))
    lift = SLOPE * (a - ZERO) * ((1.0 + np.sqrt(attached_part(a))) / 2.0) ** 2
    return mb.aero.polar(a, lift, 0.01 + a**2, name="kirchhoff", **more)


def static(a):
    return SLOPE * (a - ZERO) * ((1.0 + np.sqrt(attached_part(a))) / 2.0) ** 2


def lift_at(a, f):
    """cl of angle and f, with the separated lift of its definition."""
    own = attached_part(a)
    separated = (static(a) - own * SLOPE * (a - ZERO)) / (1.0 - own)
    return f * SLOPE * (a - ZERO) + (1.0 - f) * separated


def test_the_static_lift_gives_its_part_back():
    made = Separation.of(lambda x: section().clip_values(x)[..., 0], 1)
    assert made.slope[0] == pytest.approx(SLOPE, rel=1e-5) and made.zero[0] == pytest.approx(ZERO, abs=1e-6)
    a = np.radians(np.linspace(-30.0, 40.0, 141))[:, None]
    f, attached, separated = made.parts(a)
    assert f == pytest.approx(attached_part(a), abs=2e-3)
    assert f * attached + (1 - f) * separated == pytest.approx(static(a), abs=1e-4)
    # where the flow is attached the separated lift is half of it, where it is separated it is all
    assert separated[70] == pytest.approx(0.5 * attached[70], rel=2e-2) and separated[-1] == pytest.approx(
        static(a[-1]), abs=1e-4
    )


def test_a_step_of_the_angle_is_its_closed_form(case):
    low, high, speed, chord = np.radians(11.0), np.radians(19.0), 43.0, 0.7
    t = np.concatenate([[0.0, 0.1 - 1e-9], np.linspace(0.1, 0.5, 41)])
    r = mb.aero.dynamic_stall(section(), t, np.where(t < 0.1 - 1e-10, low, high), speed, chord)
    tau = 4.0 * chord / speed
    f = attached_part(high) + (attached_part(low) - attached_part(high)) * np.exp(-(t[2:] - 0.1) / tau)
    case("Oeye's dynamic stall, a step from 11 to 19 degrees: lift coefficient over time", topic="aero", ours=r.lift[2:],
         known=lift_at(high, f), within=1e-3, source="f = f1 + (f0 - f1) exp(-t |u| / (4 c)), S. Oeye (1991)")  # fmt: skip
    assert r.attached[2:] == pytest.approx(f, abs=1e-3)
    assert r.lift[0] == pytest.approx(static(low), rel=1e-4) and r.static_lift[-1] == pytest.approx(
        static(high), rel=1e-4
    )
    # the lift overshoots the static one until the separation has come
    assert r.lift[2] > 1.1 * static(high) and abs(r.lift[-1] / static(high) - 1) < 5e-3


def pitching(n, reduced=0.06, turns=3):
    """A section that pitches about 14 degrees by 7, at the reduced frequency omega c / (2 U)."""
    speed, chord = 31.0, 1.3
    omega = 2.0 * reduced * speed / chord
    t = np.linspace(0.0, turns * 2 * np.pi / omega, turns * n + 1)
    angle = np.radians(14.0) + np.radians(7.0) * np.sin(omega * t)
    return t, angle, speed, chord, omega


def test_a_pitching_section_runs_through_a_loop():
    t, _, speed, chord, omega = pitching(400)

    def angle_at(x):
        return np.radians(14.0) + np.radians(7.0) * np.sin(omega * x)

    tau = 4.0 * chord / speed
    truth = solve_ivp(
        lambda x, f: (attached_part(angle_at(x)) - f) / tau, (0.0, t[-1]), [attached_part(angle_at(0.0))],
        rtol=1e-10, atol=1e-12, t_eval=t,
    ).y[0]  # fmt: skip
    errors = []
    for n in (50, 100, 200, 400):
        t, angle, *_ = pitching(n)
        r = mb.aero.dynamic_stall(section(), t, angle, speed, chord)
        errors.append(np.max(np.abs(r.attached - truth[:: 400 // n])))
        assert errors[-1] < 6e-3 and r.error < 0.05
    assert errors[0] > 8.0 * errors[2]
    # the last turn: more lift while the angle grows than while it falls, and the area is that of the integral
    last = slice(-401, None)
    rising = np.gradient(angle[last]) > 0
    mean = angle[last] > np.radians(14.0)
    assert np.mean(r.lift[last][rising & mean]) > 1.2 * np.mean(r.lift[last][~rising & mean])
    area = np.trapezoid(r.lift[last], angle[last])
    assert area == pytest.approx(np.trapezoid(lift_at(angle[last], truth[last]), angle[last]), rel=1e-2)
    # ever slower, ever nearer to steady flow
    areas = []
    for reduced in (0.02, 0.005):
        slow, alpha, speed, chord, _ = pitching(400, reduced)
        q = mb.aero.dynamic_stall(section(), slow, alpha, speed, chord)
        areas.append(abs(np.trapezoid(q.lift[last], alpha[last])))
    assert areas[1] < 0.4 * areas[0] < 0.4 * abs(area) * 1.5


def test_a_section_without_stall_follows_its_table():
    a = np.radians(np.arange(-40.0, 41.0))
    straight = mb.aero.polar(a, 5.9 * a, 0 * a)
    t, angle, speed, chord, _ = pitching(40)
    r = mb.aero.dynamic_stall(straight, t, angle, speed, chord)
    assert r.lift == pytest.approx(5.9 * angle, rel=1e-9) and r.attached == pytest.approx(1.0, abs=1e-9)
    cylinder = mb.aero.polar(a, 0 * a, 0 * a + 0.5)
    assert not mb.aero.dynamic_stall(cylinder, t, angle, speed, chord).lift.any()


def test_a_rotor_in_yaw_stalls_later_and_steady_wind_changes_nothing():
    blade = mb.aero.blade(
        [6.0, 20.0, 37.0], [2.9, 2.1, 0.9], np.radians([6.0, 1.0, -2.0]), section().extend(aspect_ratio=15.0)
    )
    rotor = mb.aero.rotor(blade, 3)
    t = np.linspace(0.0, 12.0, 241)
    given = dict(wind=15.0, speed=1.5, elements=12)
    steady = [mb.aero.rotor_response(rotor, t, stall=s, **given).thrust for s in (0.0, 4.0)]
    assert steady[1] == pytest.approx(steady[0], rel=1e-9)
    yawed = [mb.aero.rotor_response(rotor, t, stall=s, yaw=0.5, **given) for s in (0.0, 1e-3, 4.0)]
    assert yawed[1].thrust == pytest.approx(yawed[0].thrust, rel=1e-3)
    apart = np.abs(yawed[2].thrust - yawed[0].thrust)[80:]
    assert 1e-3 < apart.max() / yawed[0].thrust.max() < 0.2
    assert yawed[2].angle_of_attack == pytest.approx(yawed[0].angle_of_attack, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"polar": "naca"}, "mb.aero.polar"),
        ({"t": [0.0, 1.0]}, "at least 3 times"),
        ({"angle": [0.1, 0.2]}, "each of 3 times"),
        ({"angle": np.nan}, "NaN"),
        ({"speed": 0.0}, "positive"),
        ({"chord": -1.0}, "positive"),
        ({"lag": 0.0}, "positive"),
        ({"angle": 1.2}, "'kirchhoff' covers -60 to 60 degrees, .* 68.75 degrees"),
    ],
)
def test_input_that_cannot_be(change, message):
    good = dict(polar=section(), t=[0.0, 1.0, 2.0], angle=0.1, speed=20.0, chord=1.0)
    mb.aero.dynamic_stall(**good)
    with pytest.raises(ModelError, match=message):
        mb.aero.dynamic_stall(**{**good, **change})
    rotor = mb.aero.rotor(mb.aero.blade([1.0, 5.0], 0.3, 0.0, section()), 3)
    with pytest.raises(ModelError, match="stall must not be negative"):
        mb.aero.rotor_response(rotor, [0.0, 1.0, 2.0], 8.0, 2.0, stall=-1.0)


def test_the_result_prints_and_draws():
    t, angle, speed, chord, _ = pitching(60)
    r = mb.aero.dynamic_stall(section(), t, angle, speed, chord)
    assert "dynamic stall over" in str(r) and len(r.plot().axes[0].lines) == 2
    plt.close("all")
    found = doctest.testmod(mbrs.aero.separation)
    assert found.attempted > 0 and found.failed == 0
