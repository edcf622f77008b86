"""Aerodynamic damping of rotors in axial wind: flapping blades against the Lock number and against momentum theory in NumPy."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.aero.momentum import inflow

R, CHORD, MASS, SLOPE, DENSITY, SPEED = 5.0, 0.2, 10.0, 5.73, 1.2, 20.0
INERTIA = MASS * R**2 / 3.0
LOCK = DENSITY * SLOPE * CHORD * R**4 / INERTIA
AXIS = np.array([0.48, -0.64, 0.6])


def flapper(
    wind=0.0, model="none", root=1e-6, direction=AXIS, twist=0.0, blades=3, angle=0.0, sections=40, laws=None, **more
):
    """Rigid blades, uniform rods hinged in the axis, that flap about their chord; the axis leans."""
    m = mb.Model("flapper")
    side = np.cross(AXIS, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    hub = m.body("hub", mass=50.0, inertia=(5, 5, 5), at=(1, 2, 3), angular_velocity=SPEED * AXIS)
    m.drive("turning", m.revolute("shaft", m.ground, hub, at=(1, 2, 3), axis=AXIS), mb.Ramp(SPEED))
    a = np.linspace(-np.pi, np.pi, 721)
    section = mb.aero.polar(a, SLOPE * np.sin(a) * np.cos(a), 0.0 * a)
    given = []
    for i in range(blades):
        psi = 2 * np.pi * i / blades + angle
        out = np.cos(psi) * side + np.sin(psi) * np.cross(AXIS, side)
        axes = np.stack([out, np.cross(AXIS, out), AXIS], axis=1)
        body = m.body(
            f"blade{i + 1}", mass=MASS, inertia=(1e-3, INERTIA / 4, INERTIA / 4), com=(R / 2, 0, 0), at=(1, 2, 3),
            orientation=axes, angular_velocity=SPEED * AXIS,
        )  # fmt: skip
        m.revolute(f"flap{i + 1}", hub, body, at=(1, 2, 3), axis=axes[:, 1])
        given.append(mb.aero.blade([root, R], CHORD, twist, section, body=f"blade{i + 1}", sections=sections))
    m.aerodynamics("air", given, wind=mb.aero.wind(wind, direction, **more), density=DENSITY, inflow=model, axis=AXIS,
                   **(laws or {}))  # fmt: skip
    return m


def flap_modes(m):
    return mb.modes(m, at=mb.steady_motion(m)).eigenvalue


def test_a_hovering_blade_is_damped_by_a_sixteenth_of_the_lock_number(case):
    """beta'' + (gamma / 8) Omega beta' + Omega^2 (1 - gamma c / (12 R)) beta = 0 for a uniform rod hinged in the axis, without induction.

    A coned blade turns at Omega beta about its span: three quarters of the chord see this as a wind of c Omega beta / 2.
    """
    s = flap_modes(flapper())
    known = SPEED * np.roots([1.0, LOCK / 8.0, 1.0 - LOCK * CHORD / (12.0 * R)])[0]
    case("flapping rigid blade in hover: eigenvalue, decay gamma/16", topic="aero", ours=s, known=np.full(3, known), within=1e-3,
         source="beta'' + gamma/8 Omega beta' + Omega^2 (1 - gamma c/(12 R)) beta = 0 (J. G. Leishman, Principles of Helicopter "
         "Aerodynamics, 4.5, with the wind at three quarters of the chord)",
         unit="rad/s")  # fmt: skip
    assert -s.real / SPEED == pytest.approx(LOCK / 16.0, rel=1e-3)


def flap_slopes(wind, model):
    """Slopes of the flap moment by the flap rate at no deflection, N m s, from mbrs.aero.momentum or without induction."""
    one = mb.aero.rotor(mb.aero.blade([0.05 * R, R], CHORD, 0.0, SECTION), 3, hub_radius=0.05 * R, tip_radius=R)
    r, width = one.elements(400)
    moments = []
    for rate in (0.01, -0.01):
        # a blade that moves down the wind meets less of it
        axial, around = wind - rate * r, SPEED * r
        if model == "bem":
            flow = inflow(one.annuli(r), axial, around)
            force = 0.5 * DENSITY * CHORD * flow.speed**2 * flow.normal
        else:
            phi = np.arctan2(axial, around)
            force = 0.5 * DENSITY * CHORD * (axial**2 + around**2) * SLOPE * np.sin(phi) * np.cos(phi) ** 2
        moments.append(np.sum(force * width * r))
    return (moments[0] - moments[1]) / 0.02


ANGLES = np.linspace(-np.pi, np.pi, 721)
SECTION = mb.aero.polar(ANGLES, SLOPE * np.sin(ANGLES) * np.cos(ANGLES), 0.0 * ANGLES)


@pytest.mark.parametrize("model", ["none", "bem"])
def test_damping_over_wind_speed_is_that_of_the_slope_of_the_flap_moment(model):
    """All blades together: at small deflections the decay is half of the moment's slope over the inertia."""
    decay = []
    for wind in (0.5, 1.0, 4.0):
        m = flapper(wind, model, root=0.05 * R)
        steady = mb.steady_motion(m)
        assert steady.frame in ("rotating", "fixed", "joint", "multiblade") and steady.error < 1e-8
        s = mb.modes(m, at=steady).eigenvalue
        known = 0.5 * flap_slopes(wind, model) / INERTIA
        assert s.real == pytest.approx(np.full(3, known), rel=0.02)
        decay.append(-known / SPEED)
    # momentum theory lets the wake answer at once, which takes from the damping most where the wind is slow
    assert np.all(np.diff(decay) > 0.0) == (model == "bem")
    assert (decay[0] < 0.5 * LOCK / 16) == (model == "bem")


def test_wind_across_the_axis_is_refused_by_name():
    m = flapper(3.0, direction=AXIS + [0.0, 0.3, 0.0])
    with pytest.raises(mb.ModelError, match=r"changes over a turn"):
        mb.steady_motion(m)


def test_a_free_wake_has_no_gradient():
    m = flapper(3.0, "free-wake", root=0.05 * R)
    with pytest.raises(mb.MbrsError, match=r"'air' \(inflow 'free-wake'\) has no gradients of motions.*leave it out"):
        mb.gradient(m, mb.AtTimes([0.1], lambda s: s["blade1.position"][0]), ["hub.mass"], t=0.1)
