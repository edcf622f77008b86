"""Wakes of vortex filaments: closed lines, the law of Kutta and Joukowski, convection, momentum theory, hover against experiment."""

from __future__ import annotations

import doctest
from dataclasses import replace

import matplotlib.pyplot as plt
import mbrs as mb
import mbrs.aero.circulation
import mbrs.aero.rotor_wakes
import numpy as np
import pytest
from mbrs.aero.lines import rigid_lines
from mbrs.aero.rotor_wakes import _Case
from mbrs.aero.wake_options import wake_options
from mbrs.errors import Interrupted, ModelError
from scipy.linalg import expm

RNG = np.random.default_rng(41)
SMALL = dict(strips=6, steps=12, tail_turns=1.0, free_turns=1.0, mean_turns=1.5)


def thin_section(slope=2 * np.pi):
    a = np.radians(np.arange(-20.0, 20.5, 1.0))
    return mb.aero.polar(a, slope * np.sin(a), 0.008 + 0.01 * a**2).extend(aspect_ratio=17.0)


def wind_turbine(count=3, load=1.0, **more):
    """Glauert's chord for a tip speed ratio of 7, times a load."""
    radius = 37.3
    x = np.linspace(0.15, 1.0, 18) * radius
    phi = 2 / 3 * np.arctan(radius / (7.0 * x))
    alpha = np.radians(5.0)
    chord = 8 * np.pi * x * (1 - np.cos(phi)) / (count * 2 * np.pi * np.sin(alpha)) * load
    return mb.aero.rotor(mb.aero.blade(x, chord, phi - alpha, thin_section()), count, **more)


def random_wake():
    rotor = wind_turbine(int(RNG.integers(1, 5)), precone=RNG.uniform(-0.2, 0.2), pitch=RNG.uniform(-0.1, 0.1))
    case = _Case.checked(rotor, RNG.uniform(3, 12), 0.0, 0.2, -0.1, wake_options(rotor.radius, **SMALL))
    o = case.options
    gamma = np.sort(RNG.uniform(0.1, 1.0, (rotor.count, o.strips)))
    wake = case.wake(gamma, case.path(1e-3))
    return case, wake


def test_vortex_lines_end_nowhere_but_behind_the_tail():
    for _ in range(5):
        case, wake = random_wake()
        # strengths that differ from panel to panel, and end as the far filaments go on
        strength = wake.strength.copy()
        strength[..., :-1] += RNG.normal(size=strength[..., :-1].shape)
        wake = replace(wake, strength=strength)
        start, end, circulation, _ = wake.filaments()
        points, place = np.unique(np.concatenate([start, end]), axis=0, return_inverse=True)
        flux = np.zeros(len(points))
        np.add.at(flux, place[: len(start)], circulation)
        np.add.at(flux, place[len(start) :], -circulation)
        open_ends = {tuple(p) for p in wake.tail[:, :, -1].reshape(-1, 3)}
        inner = np.array([tuple(p) not in open_ends for p in points])
        assert np.abs(flux[inner]).max() < 1e-12 * np.abs(circulation).max()
        assert np.sum(~inner) == 2 * case.rotor.count and np.abs(flux[~inner]).min() > 0.05


def test_the_lift_of_every_strip_is_that_of_its_circulation():
    for _ in range(5):
        case, wake = random_wake()
        lines = case.lines
        found = case.balance(wake, lines)
        assert found.residual <= mbrs.aero.circulation.BALANCED
        # afresh: the wind of all filaments at three quarters of the chord, less that of an infinite bound vortex
        full = wake.with_circulation(found.circulation)
        d = np.linalg.norm(lines.rear - lines.points, axis=-1)
        wind = full.induced(lines.rear) + case.wind - lines.rear_velocity
        wind = wind + lines.suction * (found.circulation / (2 * np.pi * d))[..., None]
        normal, along = np.sum(wind * lines.suction, -1), -np.sum(wind * lines.forward, -1)
        lift = case.rotor.blade.coefficients(case.sections.places, np.arctan2(normal, along))[..., 0]
        truth = 0.5 * np.hypot(normal, along) * case.sections.chord * lift
        assert np.abs(found.circulation - truth).max() < 1e-8 * np.abs(truth).max()


def test_sections_of_rigid_rotors_stand_as_momentum_theory_has_them():
    rotor = wind_turbine(precone=0.13, pitch=-0.07)
    lines = rigid_lines(rotor, 7, 0.9)
    wind = np.array([5.3, 0.0, 0.0]) - lines.velocity
    angle, speed, _ = lines.angles(wind)
    places = np.linalg.norm(lines.points, axis=-1)
    axial, around = 5.3 * np.cos(0.13), 0.9 * places * np.cos(0.13)
    twist = rotor.blade.twists(places) - 0.07
    assert angle == pytest.approx(np.arctan2(axial, around) - twist, abs=1e-12)
    assert speed == pytest.approx(np.hypot(axial, around), rel=1e-12)
    chord = np.linalg.norm(lines.edges - lines.trailing, axis=-1) / 0.75
    assert chord == pytest.approx(rotor.blade.chords(np.linalg.norm(lines.edges, axis=-1)), rel=1e-9)
    # driving and normal force of a wind that only lifts
    force = lines.forces(wind, np.ones(angle.shape), np.zeros(angle.shape))
    assert np.sum(force * wind, axis=-1) == pytest.approx(0.0, abs=1e-12 * np.abs(force).max() * 50)
    assert np.all(force[..., 0] > 0) and np.all(np.cross(lines.points, force)[..., 0] > 0)


def marched(case, wind, steps):
    """Without circulation."""
    case = replace(case)
    object.__setattr__(case, "air", wind)
    motion = case.marching(case.wake(np.zeros((case.rotor.count, case.options.strips)), case.path(0.0)), 0.0)
    for step in range(1, steps + 1):
        frame = case.frame(step)
        lines = case.lines.rotate(frame.rotation)
        motion.accept(motion.correct(motion.predict(lines, frame), lines, frame), frame)
    return motion


@pytest.mark.slow
def test_a_wake_without_circulation_goes_with_the_wind():
    for yaw, tilt in ((0.0, 0.0), (0.4, -0.2)):
        rotor = wind_turbine()
        case = _Case.checked(rotor, 7.0, 0.0, yaw, tilt, wake_options(rotor.radius, **SMALL))
        o = case.options
        motion = marched(case, case.air, 120)
        near = motion.wake.near
        for age in range(near.shape[2]):
            left = case.lines.rotate(case.frame(120 - age).rotation).trailing
            assert near[:, :, age] == pytest.approx(left + age * o.turn * case.wind, abs=1e-7 * rotor.radius)
        blade = motion.wake.roll_up()[0] - o.lattice * o.turn * case.wind
        for age in range(motion.wake.far.shape[2]):
            then = blade @ case.frame(-age).rotation.T
            drift = (age + o.lattice) * o.turn * case.wind
            assert motion.wake.far[:, :, age] == pytest.approx(then + drift, abs=1e-7 * rotor.radius)


@pytest.mark.slow
def test_convection_is_of_second_order():
    # a wind that shears and turns: v = A x + b; a particle goes with the matrix exponential
    rotor = wind_turbine()
    a = np.array([[0.03, 0.05, -0.02], [0.01, -0.04, 0.06], [0.02, -0.03, 0.01]])
    b = np.array([5.0, 0.4, -0.3])
    errors = []
    for steps in (12, 24):
        options = wake_options(
            rotor.radius, strips=4, steps=steps, lattice=np.pi / 2, free_turns=0.5, mean_turns=1.5, tail_turns=0.5
        )
        case = _Case.checked(rotor, 7.0, 0.0, 0.0, 0.0, options)
        total = 4 * steps
        motion = marched(case, lambda x: x @ a.T + b, total)
        age = steps // 4
        left = case.lines.rotate(case.frame(total - age).rotation).trailing
        flow = expm(np.block([[a, b[:, None]], [np.zeros((1, 4))]]) * age * case.options.turn)
        truth = left @ flow[:3, :3].T + flow[:3, 3]
        errors.append(np.abs(motion.wake.near[:, :, age] - truth).max())
    assert 3.5 < errors[0] / errors[1] < 5.0, errors


@pytest.mark.slow
def test_a_lightly_loaded_rotor_is_that_of_momentum_theory():
    radius = 37.3
    x = np.linspace(0.15, 1.0, 18) * radius
    for chord in (0.3, 0.6):
        rotor = mb.aero.rotor(mb.aero.blade(x, chord, np.arctan(radius / (7 * x)) - 0.05, thin_section()), 3)
        bem = mb.aero.performance(rotor, 7.0)
        few, more = (mb.aero.performance(rotor, 7.0, inflow="prescribed-wake", strips=n) for n in (8, 16))
        assert more.status == "computed" and more.stats.route == "prescribed wake" and bem.status == "converged"
        assert more.error is None and "no estimate" in str(more) and more.torque_coefficient[0] > 0
        assert more.thrust_coefficient == pytest.approx(bem.thrust_coefficient, rel=0.02)
        assert more.power_coefficient == pytest.approx(bem.power_coefficient, rel=0.035)
        assert few.thrust_coefficient == pytest.approx(more.thrust_coefficient, rel=0.01)


@pytest.mark.slow
@pytest.mark.exact
def test_bits_of_a_free_wake_do_not_depend_on_threads():
    rotor = wind_turbine()
    one, other = (mb.aero.rotor_wake(rotor, 7.0, turns=4, threads=n, **SMALL) for n in (1, 3))
    assert np.array_equal(one.thrust_coefficient, other.thrust_coefficient)
    assert np.array_equal(one.wake.far, other.wake.far) and one.status == "unsteady wake"
    made = one.plot()
    assert made.axes[0].get_xlabel()
    plt.close(made)


def test_ctrl_c_keeps_the_turns_so_far(monkeypatch):
    rotor = wind_turbine()

    class Stops(mbrs.aero.rotor_wakes.Progress):
        def advance(self, steps=1, note=""):
            super().advance(steps, note)
            if self.done == 17:
                raise KeyboardInterrupt

    monkeypatch.setattr(mbrs.aero.rotor_wakes, "Progress", Stops)
    with pytest.raises(Interrupted, match=r"1\.42 turns") as cut:
        mb.aero.rotor_wake(rotor, 7.0, turns=4, **SMALL)
    found = cut.value.result
    assert found.status == "interrupted" and len(found.turn) == 17 and np.all(found.thrust_coefficient > 0)
    with pytest.raises(Interrupted, match="0 of 2 tip speed ratios") as cut:
        mb.aero.performance(rotor, [6.0, 7.0], inflow="free-wake", turns=4, **SMALL)
    assert cut.value.result is None


@pytest.mark.slow
def test_a_free_wake_in_wind_settles_near_momentum_theory():
    rotor = wind_turbine(load=0.8)
    bem = mb.aero.performance(rotor, 7.0)
    free = mb.aero.performance(rotor, 7.0, inflow="free-wake", turns=10)
    assert free.status == "unsteady wake" and free.error[0] < 0.01
    assert free.thrust_coefficient == pytest.approx(bem.thrust_coefficient, rel=0.03)
    assert free.power_coefficient == pytest.approx(bem.power_coefficient, rel=0.04)
    assert free.axial_induction.mean() == pytest.approx(bem.axial_induction.mean(), abs=0.05)


def hovering_rotor():
    """F. X. Caradonna and C. Tung, NASA TM 81232 (1981): two untwisted blades of NACA 0012, aspect ratio 6, at 1250 r/min.

    Lift of 0.1 per degree, larger by Prandtl and Glauert's factor of the speed of rotation at each station.
    """
    radius, chord = 1.143, 0.1905
    a = np.radians(np.arange(-12.0, 12.1, 1.0))
    x = np.linspace(0.2 * radius, radius, 9)
    mach = 1250 * 2 * np.pi / 60 * x / 340.0
    polars = [
        mb.aero.polar(a, 5.73 / np.sqrt(1 - m**2) * a, 0.0085 + 0.3 * a**2, name=f"M={m:.2f}").extend(aspect_ratio=6.0)
        for m in mach
    ]
    return mb.aero.rotor(mb.aero.blade(x, chord, 0.0, polars), 2)


@pytest.mark.slow
@pytest.mark.parametrize("degrees, thrust", [(8.0, 0.00459), (12.0, 0.00796)])
def test_hover_is_that_of_caradonna_and_tung(case, degrees, thrust):
    found = mb.aero.rotor_wake(hovering_rotor(), np.inf, pitch=-np.radians(degrees), turns=12)
    assert found.status == "unsteady wake"
    source = "F. X. Caradonna and C. Tung, NASA TM 81232 (1981): experiment, three printed digits"
    case(f"hover of Caradonna and Tung's rotor at {degrees:g} degrees, 1250 r/min: thrust coefficient", topic="aero", kind="publication",
         ours=found.thrust, known=thrust, within=0.07, uncertainty=3e-3, estimate=found.spread[0], source=source)  # fmt: skip
    assert found.spread[0] < 0.15
    if degrees == 8.0:
        lift = np.interp([0.50, 0.68, 0.80, 0.89, 0.96], found.place / found.radius, found.lift)
        known = np.array([0.2343, 0.2815, 0.2886, 0.3143, 0.2883])
        case("the same at 8 degrees: lift coefficients at r/R = .50, .68, .80, .89, .96 over the measured ones", topic="aero",
             kind="publication", ours=lift / known, known=np.ones(5), within=0.15, uncertainty=3e-3, source=source)  # fmt: skip


@pytest.mark.parametrize(
    "change, message",
    [
        ({"tip_speed_ratio": -1.0}, "tip_speed_ratio"),
        ({"tip_speed_ratio": np.nan}, "tip_speed_ratio must be a finite number"),
        ({"inflow": "vpm"}, "free-wake"),
        ({"steps": 13}, "even"),
        ({"free_turns": 0.1}, "free_turns"),
        ({"core_radius": 0.0}, "core_radius"),
        ({"core": "gauss"}, "core of filaments"),
        ({"turns": 3}, "turns"),
        ({"tip_speed_ratio": np.inf, "turns": 9}, "10"),
        ({"pitch": [0.0, 1.0]}, "pitch"),
    ],
)
def test_input_that_cannot_be(change, message):
    good = dict(tip_speed_ratio=7.0, turns=4) | SMALL
    with pytest.raises(ModelError, match=message):
        mb.aero.rotor_wake(wind_turbine(), **(good | change))
    with pytest.raises(ModelError, match="rotor must be"):
        mb.aero.rotor_wake(3.0)
    with pytest.raises(ModelError, match="options of a wake"):
        mb.aero.performance(wind_turbine(), 7.0, strips=10)


def test_examples_of_docstrings():
    found = doctest.testmod(mbrs.aero.rotor_wakes)
    assert found.attempted > 0 and found.failed == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"), [("steps", [12, 24, 48]), ("tail_turns", [2.0, 4.0, 12.0]), ("strips", [6, 12, 24])]
)
def test_finer_wakes_have_less_error(name, values):
    """An accuracy study of one option: the error is that of thrust or power against the finest wake."""
    given = {**SMALL, "steps": 24, "strips": 8, "tail_turns": 8.0, "inflow": "prescribed-wake", name: values}
    study = mb.accuracy_study(mb.aero.rotor_wake, wind_turbine(), 7.0, repeat=1, **given)
    assert "thrust or the power" in study.measure and study.points[-1].is_reference
    first, second = (p.error for p in study.points[:2])
    assert 0.0 < second < first < 0.1
    one, fine = (mb.aero.rotor_wake(wind_turbine(), 7.0, **{**given, name: v}) for v in (values[0], values[-1]))
    known = max(abs(one.thrust / fine.thrust - 1), abs(one.power / fine.power - 1))
    assert first == pytest.approx(known, rel=1e-9)


@pytest.mark.slow
def test_the_thinnest_core_is_the_finest():
    given = {**SMALL, "inflow": "prescribed-wake", "core_radius": [0.5, 1.0, 2.0]}
    study = mb.accuracy_study(mb.aero.rotor_wake, wind_turbine(), 7.0, repeat=1, **given)
    thin, middle, thick = study.points
    assert thin.is_reference and 0.0 < middle.error < thick.error
