"""Steps of a wake that are too long are warned of, and bad blades, polars and winds are named."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from air_models import rotor, vane
from mbrs.errors import ModelError
from mbrs.motion.wake_steps import loaded_modes


def bending(steps, flap=4.0, **more):
    """A rotor with one blade, 17 m long, whose flapwise modes are those of a uniform clamped beam; body axes and wind as drawn."""
    speed, length, mass = 2.1, 17.0, 30.0
    m = mb.Model("bending")
    hub = m.body("hub", mass=100.0, inertia=(50.0, 50.0, 50.0), at=(0, 0, 0), angular_velocity=(speed, 0, 0))
    m.drive("turning", m.revolute("bearing", m.ground, hub, at=(0, 0, 0), axis="x"), mb.Ramp(speed))
    beam = mb.flexible.beam(length, mass=mass, EI_flap=2e6 * flap, EI_edge=9e8, modes=3, damping=[0.05] * 3)
    out, ahead = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    axes = np.stack([out, ahead, np.cross(out, ahead)], axis=1)
    body = m.flexible_body(
        "blade", beam, at=out, orientation=axes, velocity=speed * ahead, angular_velocity=(speed, 0, 0)
    )
    m.fixed("root", hub, body.node("root"))
    a = np.radians(np.arange(-180.0, 181.0, 7.5))
    section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.008 + 1.3 * np.sin(a) ** 4, name="thin")
    blade = mb.aero.blade([1.0, 18.0], [1.6, 0.7], np.radians([21.0, 0.5]), section, body="blade", root=1.0, sections=6)
    m.aerodynamics("air", [blade], wind=mb.aero.wind(9.0), inflow="prescribed-wake", options={"steps": steps}, **more)
    # Euler and Bernoulli: cos x cosh x = -1
    first = 1.8751040687**2 * np.sqrt(2e6 * flap / mass) / length**2 / (2 * np.pi)
    return m, first


def messages(m, **options):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        mb.simulate(m, **{"t": 0.02, "rtol": 1e-4, **options})
    return [str(w.message) for w in seen if "step of the inflow" in str(w.message)]


def test_a_step_longer_than_an_eighth_of_a_period_is_warned_of():
    _, frequency = bending(24)
    enough = 8.0 * frequency * 2 * np.pi / 2.1  # steps a turn
    fewer = 2 * int(0.5 * enough)  # wakes have even steps
    (text,) = messages(bending(fewer)[0])
    assert f"{1 / frequency:.3g}" in text and "mode 1 of 'blade'" in text and "1 times as many" in text
    assert not messages(bending(fewer + 2)[0])


def test_modes_that_the_load_does_not_bend_do_not_matter():
    beam = mb.flexible.beam(17.0, mass=30.0, EI_flap=2e6, EI_edge=9e6, modes=4)
    along = np.linspace(0.0, 17.0, 401)
    force = np.zeros((401, 3))
    force[:, 2] = 1.0
    frequency, share = loaded_modes(beam, along, force)
    # flapwise 1, edgewise 1, flapwise 2, edgewise 2: a uniform load bends a clamped beam by its first mode to 1 %
    assert share[0] == pytest.approx(1.0, abs=0.02) and share[2] < 0.02 and max(share[1], share[3]) < 1e-9
    assert frequency == pytest.approx(beam.frequencies(), rel=1e-12)
    # at the end of the second mode's own shape only that mode bends
    shape = np.asarray(beam.line_shape)[:, 2, np.argsort(frequency)[2]]
    line = np.linspace(0.0, 17.0, len(shape))
    other = np.zeros((401, 3))
    other[:, 2] = np.interp(along, np.linalg.norm(beam.line_position - beam.line_position[0], axis=1), shape)
    assert len(line) and np.argmax(loaded_modes(beam, along, other)[1]) in (2, 0)


def test_a_rotor_that_runs_away_is_warned_of():
    m, _ = rotor(inflow="prescribed-wake", sections=4, options={"steps": 12}, wind=12.0)
    assert not messages(m, t=0.6)
    (text,) = messages(m, t=0.6, without=("drives",))
    traj = mb.simulate(m, t=0.6, rtol=1e-4, without=("drives",))
    rate = np.degrees(np.max(np.abs(traj.joint_rate("bearing")[-1]))) * 2 * np.pi / 2.1 / 12
    assert 30.0 < float(text.split("turn by ")[1].split()[0]) <= rate * (1 + 1e-3)


# --- blades, polars and winds that cannot be -----


def plain(change):
    """A model from blades as plain data, as files hold them, with a change."""
    m = vane(sections=3, flexible=False)
    air = m.airs[0].described()
    made = vane(sections=3, flexible=False)
    blade = {**air["blades"][0], **change}
    made.aerodynamics("other", [blade], wind=air["wind"], polars=air["polars"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"chord": [0.4, 0.0, 0.2]}, "'arm' have the chord 0 m at section 2"),
        ({"width": [0.4, 0.5, -0.2]}, "'arm' have the width -0.2 m at section 3"),
        ({"place": [0.4, 1.5, 1.5]}, "'arm' have sections whose place does not increase: section 3"),
        ({"twist": [0.1, np.nan, 0.0]}, "not finite"),
    ],
)
def test_blades_of_a_file_are_checked_like_those_of_a_call(change, words):
    with pytest.raises(ModelError, match=words):
        plain(change)


@pytest.mark.some(1)
@pytest.mark.parametrize(
    "wind", [{"speed": np.nan}, {"speed": 3.0, "direction": (np.nan, 0, 1)}, {"speed": 3.0, "ground": np.inf}]
)
def test_a_wind_that_is_not_a_number_is_named(wind):
    with pytest.raises(ModelError, match=r"wind|finite|NaN"):
        vane(**wind)
    m = vane(sections=3, flexible=False)
    air = m.airs[0].described()
    with pytest.raises(ModelError, match=r"other\.wind"):
        m.aerodynamics("other", air["blades"], wind=wind, polars=air["polars"])


def test_a_body_that_does_not_reach_the_stations_is_named():
    beam = mb.flexible.beam(3.0, mass=1.0, EI_flap=900.0, EI_edge=900.0, modes=2)
    m = mb.Model("short")
    m.fixed("root", m.ground, m.flexible_body("wing", beam, at=(1, 2, 3)).node("root"))
    section = mb.aero.polar([-3.0, 3.0], [-1.0, 1.0], [0.1, 0.1])
    with pytest.raises(ModelError, match=r"'wing', whose line goes from 0 to 3 m"):
        m.aerodynamics("air", [mb.aero.blade([1.0, 4.0], 0.3, 0.0, section, body="wing")], wind=mb.aero.wind(4.0))


@pytest.mark.filterwarnings("ignore::mbrs.MbrsWarning")
@pytest.mark.parametrize("analysis", [mb.linearize, mb.modes, mb.equilibrium])
def test_linear_analyses_name_angles_that_no_polar_holds(analysis):
    m = mb.Model("wing")
    body = m.body("wing", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.revolute("hinge", m.ground, body, at=(0, 0, 0), axis="x", k=1e4)
    a = np.radians([-12.0, 0.0, 4.0])
    short = mb.aero.polar(a, 2 * np.pi * a, 0.01 + a**2, name="short")
    m.aerodynamics(
        "air", [mb.aero.blade([1.0, 2.0], 0.3, 0.0, short, body="wing", sections=3)], wind=mb.aero.wind(5.0, "z")
    )
    with pytest.raises(ModelError, match=r"'short' covers -12 to 4 degrees, .* section 1 of 3 of 'wing'"):
        analysis(m)
    assert len(mb.linearize(m, without=("aerodynamics",)).M) == 1
