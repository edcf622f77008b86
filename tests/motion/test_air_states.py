"""States of the air in motions: two lags of the inflow against their closed form, stall against SciPy, every time scheme."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from air_models import rotor
from scipy.integrate import solve_ivp


def induced(traj):
    """(n_t, n, 2) velocities that the annuli of blade 1 of the rotor induce, along its axis and against its turning."""
    n = traj._flow.shape[1] // 3
    flow = traj._flow[:, :n]
    v, out = flow[..., -3:], traj.aero("blade1").point.copy()
    out[..., 0] = 0.0
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    return np.stack([v[..., 0], np.sum(v * np.cross([1.0, 0.0, 0.0], out), axis=-1)], axis=-1)


def stepped(changes, **options):
    """A rotor that turned steadily in wind, after its air changed; the velocities that balance before and after."""
    m, _ = rotor(inflow="dynamic-inflow", sections=5)
    balance, _ = rotor(inflow="bem", sections=5)
    first = mb.simulate(m, t=[0.0, 0.4], rtol=1e-9)
    before = induced(mb.simulate(balance, t=[0.0], rtol=1e-9))[0]
    for model in (m, balance):
        model.set(changes)
    t = np.array([0.4, 0.7, 1.9, 4.3])
    after = induced(mb.simulate(balance, t=[0.0], rtol=1e-9))[0]
    return m, mb.simulate(m, t=t, at=first.state(), **{"rtol": 1e-9, **options}), before, after, t - 0.4


def two_lags(before, after, t, wind, share, radius):
    """V(t) of t1 Y' = .4 W - Y, t2 V' = Y + .6 W - V after a step of W; (n_t, n, 2)."""
    a = np.clip(-after[:, 0] / wind, 0.0, 0.5)
    t1 = 1.1 / (1.0 - 1.3 * a) * radius / wind
    t2 = (0.39 - 0.26 * share**2) * t1
    t, t1, t2 = t[:, None, None], t1[:, None], t2[:, None]
    slow = 0.4 * t1 / (t1 - t2)  # partial fractions of (1 + .6 t1 s) / ((1 + t1 s) (1 + t2 s))
    return after + (before - after) * (slow * np.exp(-t / t1) + (1.0 - slow) * np.exp(-t / t2))


@pytest.mark.parametrize("changes, wind", [({"air.speed": 10.3}, 10.3), ({"air.pitch": -0.03}, 9.0)])
def test_induced_velocities_follow_a_step_by_two_lags(case, changes, wind):
    m, traj, before, after, t = stepped(changes)
    share = np.array(m.airs[0].blades[0]["place"]) / 18.0
    known = two_lags(before, after, t, wind, share, 18.0)
    ours = induced(traj)
    assert np.max(np.abs(before - after)) > 0.1
    (name,) = changes
    case(f"dynamic inflow of a rotor in motion after a step of {name}", topic="aero", ours=ours.ravel(), known=known.ravel(),
         within=1e-7, source="closed form of the two lags")  # fmt: skip


def test_dynamic_inflow_of_a_steady_rotor_is_that_of_momentum():
    m, _ = rotor(inflow="dynamic-inflow", sections=6)
    traj = mb.simulate(m, t=[0.0, 0.3, 0.8], rtol=1e-9)
    exact, _ = rotor(inflow="bem", sections=6)
    assert traj.thrust == pytest.approx(mb.simulate(exact, t=[0.0], rtol=1e-9).thrust[0], rel=1e-11)


SCHEMES = ["bdf", "bdf-bfgs", "radau", "explicit", "ali3p", "generalized-alpha"]


@pytest.mark.some(3)
@pytest.mark.parametrize("method", SCHEMES)
def test_every_scheme_carries_the_states(method):
    _, traj, before, after, t = stepped({"air.speed": 10.3}, method=method, rtol=1e-7)
    m, _ = rotor(inflow="dynamic-inflow", sections=5)
    known = two_lags(before, after, t, 10.3, np.array(m.airs[0].blades[0]["place"]) / 18.0, 18.0)
    assert np.max(np.abs(induced(traj) - known)) < 2e-5 * 10.3


# --- a section that is held, or pitches as it is driven -----


def pitching(law, twist=0.0, **more):
    """A blade whose x axis is turned by ``law`` in wind across it; its polar stalls."""
    m = mb.Model("pitching")
    at = (0.4, 0.1, -0.2)
    body = m.body("wing", mass=3.0, inertia=(1.0, 2.0, 2.0), at=at)
    m.drive("pitch", m.revolute("bearing", m.ground, body, at=at, axis="x"), law)
    made = mb.aero.blade([0.0, 2.0], 0.9, twist, stalling(), body="wing", line=0.75, sections=2)
    m.aerodynamics("air", [made], wind=mb.aero.wind(SPEED, (0.0, -1.0, 0.0)), **more)
    return m


SPEED, CHORD, SLOPE = 31.0, 0.9, 5.9


def part(a):
    """A part of the chord that is attached, one up to 9 degrees and zero from 25 on."""
    x = np.clip((np.abs(a) - np.radians(9.0)) / np.radians(16.0), 0.0, 1.0)
    return (1.0 - x**2 * (3.0 - 2.0 * x)) ** 2


def stalling():
    a = np.radians(np.arange(-60.0, 60.01, 0.1))
    return mb.aero.polar(a, SLOPE * a * ((1.0 + np.sqrt(part(a))) / 2.0) ** 2, 0.0 * a, name="stalling")


def test_a_pitching_section_stalls_as_oeye_says(case):
    """Three quarters of the chord lie on the axis: the angle of attack is the driven one."""
    mean, swing, omega = np.radians(16.0), np.radians(6.0), 2 * 0.06 * SPEED / CHORD * 2
    m = pitching(mb.Sine(swing, frequency=omega / (2 * np.pi)), twist=-mean, stall=3.7)
    t = np.linspace(0.0, 2.3, 60)
    traj = mb.simulate(m, t=t, rtol=1e-9)
    angle = traj.aero("wing").angle_of_attack[:, 0]
    sense = np.sign(angle[1] - angle[0])
    given = mean + sense * swing * np.sin(omega * t)
    assert angle == pytest.approx(given, abs=1e-9)

    def rate(s, f):
        return (part(mean + sense * swing * np.sin(omega * s)) - f) * SPEED / (3.7 * CHORD)

    f = solve_ivp(rate, (0.0, t[-1]), [part(mean)], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.01).y[0]
    own, line = part(given), SLOPE * given
    static = line * ((1.0 + np.sqrt(own)) / 2.0) ** 2
    separated = (static - own * line) / (1.0 - own)
    ours = 2.0 * traj.aero("wing").circulation[:, 0] / (CHORD * SPEED)
    known = f * line + (1.0 - f) * separated
    assert np.max(np.abs(known - static)) > 0.1
    case("Oeye's dynamic stall of a section of a model that pitches: lift coefficient", topic="aero", ours=ours, known=known, within=2e-4,
         kind="independent script", source="f' = (f_st - f) |u| / (lag c), SciPy")  # fmt: skip


def test_lift_after_a_step_of_pitch_follows_wagner(case):
    m = pitching(mb.Ramp(0.0), attached=True)
    first = mb.simulate(m, t=[0.0, 0.1], rtol=1e-9)
    m.set({"air.pitch": -1e-3})
    s = np.array([1e-9, 0.7, 1.9, 5.3, 17.0])  # half chords
    traj = mb.simulate(m, t=0.1 + s * CHORD / 2.0 / SPEED, rtol=1e-9, at=first.state())
    ours = 2.0 * traj.aero("wing").circulation[:, 0] / (CHORD * SPEED) / (SLOPE * 1e-3)
    case("lift after a step of pitch of a section of a model, over the steady one", topic="aero", ours=ours,
         known=mb.aero.indicial().response(s), within=1e-5, source="R. T. Jones (1940), 1 - sum A exp(-b s)")  # fmt: skip
    assert np.max(np.abs(ours - mb.aero.wagner(s))) < 0.01


# --- what cannot be -----


def test_what_cannot_be_is_refused_by_name():
    for given, words in (
        ({"attached": True, "inflow": "free-wake"}, "air.attached"),
        ({"attached": 1}, "air.attached"),
        ({"stall": -1.0}, "stall"),
        ({"inflow": "dynamic-inflow", "axis": (1, 0, 0)}, "outwards from the axis"),
        ({"options": {"steps": 24}}, "options"),
    ):
        with pytest.raises(mb.ModelError, match=words):
            pitching(mb.Ramp(0.0), **given)


def test_a_file_holds_the_laws_of_the_air(tmp_path):
    m = pitching(mb.Ramp(0.0), attached=True, stall=3.1)
    again = mb.Model.load(m.save(tmp_path / "air.toml"))
    assert again.airs[0].described() == m.airs[0].described() and again.value("air.stall") == 3.1
