"""Motions beside inflow that advances with its own steps: steady ends, restart, coupling."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from air_models import rotor

STEP = 2 * np.pi / 2.1 / 24


def thrust(inflow, t, **more):
    m, blade = rotor(inflow=inflow, sections=6, options={"steps": 24, "tail_turns": 2.0}, **more)
    return m, blade, mb.simulate(m, t=np.asarray(t), rtol=1e-6)


@pytest.mark.slow
def test_a_motion_goes_on_with_its_wake():
    t = np.array([0.0, 1.0, 1.6, 2.3, 3.0]) * STEP
    m, _, whole = thrust("free-wake", t)
    first = mb.simulate(m, t=t[:3], rtol=1e-6)
    second = mb.simulate(m, t=t[3:], rtol=1e-6, at=first.state())
    assert second.thrust == pytest.approx(whole.thrust[3:], rel=1e-7)
    assert len(whole.wake.filaments) == 4 and np.ptp(whole.thrust) < 0.05 * whole.thrust[0]


@pytest.mark.slow
def test_a_prescribed_wake_gives_what_it_gives_a_rigid_rotor():
    _, blade, traj = thrust("prescribed-wake", [0.0, STEP])
    made = mb.aero.rotor(blade, 3, hub_radius=1.5, tip_radius=18.0)
    exact = mb.aero.rotor_wake(made, 2.1 * 18.0 / 9.0, inflow="prescribed-wake", strips=6, tail_turns=2.0)
    assert traj.thrust[-1] == pytest.approx(exact.thrust * 1.225 * np.pi * 18.0**2 * (2.1 * 18.0) ** 2, rel=0.03)


def test_loose_coupling_tends_to_tight_coupling():
    """One blade in sheared wind: its loads vary within a turn. Halved steps leave less than half of the difference."""

    def thrusts(coupling, steps):
        options = {"steps": steps}
        m, _ = rotor(inflow="prescribed-wake", sections=4, count=1, options=options, coupling=coupling, shear=0.9)
        return mb.simulate(m, t=np.array([2.0, 4.0, 6.0]) * STEP, rtol=1e-7)

    apart = []
    for steps in (12, 24):
        loose, tight = thrusts("loose", steps), thrusts("tight", steps)
        assert loose.stats.counts["wake rounds"] == loose.stats.counts["wake windows"] == steps // 4
        assert tight.stats.counts["wake rounds"] > steps // 4
        apart.append(np.max(np.abs(loose.thrust - tight.thrust)))
    assert 0.0 < apart[1] < 0.5 * apart[0] < 0.01 * np.max(np.abs(tight.thrust))


@pytest.mark.parametrize(
    ("options", "words"), [({"stps": 24}, "no option 'stps'; known: .*steps"), ({"steps": 3}, "steps")]
)
def test_options_that_are_unknown_or_wrong_are_named(options, words):
    m, _ = rotor(inflow="prescribed-wake", sections=4, options=options)
    with pytest.raises(mb.ModelError, match=words):
        mb.simulate(m, t=0.1)


def test_absolute_coordinates_have_no_steps_of_a_wake():
    m, _ = rotor(inflow="prescribed-wake", sections=4)
    with pytest.raises(mb.ModelError, match='"bem" or "dynamic-inflow", not \'prescribed-wake\''):
        mb.simulate(m, t=0.1, coordinates="absolute")


def test_a_rotor_that_stands_has_no_wake():
    m, _ = rotor(inflow="free-wake", sections=4, speed=0.0)
    with pytest.raises(mb.ModelError, match="turns about its axis"):
        mb.simulate(m, t=1.0)


def test_a_hub_on_the_ground_has_no_wind_and_says_so():
    m = mb.examples.wind_rotor(modes=2)
    wind = mb.aero.wind(speed=8.0, shear=0.2, reference_height=84.0, ground=91.0)
    m.aerodynamics("air", mb.examples.wind_rotor_blades(sections=4), wind=wind, inflow="free-wake")
    with pytest.raises(
        mb.ModelError, match=r"none at its hub, which is not above the ground: give mb\.aero\.wind\(ground="
    ):
        mb.simulate(m, t=0.1)


def test_simpler_inflows_stand_beside_the_models_own():
    """The rows of an effect study are the motions without air, with air that induces nothing, and with momentum theory."""
    m, _ = rotor(inflow="prescribed-wake", sections=4, count=1, options={"steps": 12}, shear=0.9)
    t = np.array([0.0, 2 * STEP])

    def apart(a, b):
        """largest difference of the thrust, relative"""
        return float(np.max(np.abs(thrust_of(a) - b.thrust)) / np.max(np.abs(b.thrust)))

    def thrust_of(traj):
        return np.zeros(len(traj.t)) if "aerodynamics" in traj.without else traj.thrust

    study = mb.effect_study(mb.simulate, m, repeat=1, t=t, rtol=1e-7, effects=["aerodynamics"], measure=apart)
    whole = mb.simulate(m, t=t, rtol=1e-7).thrust

    found = {row.effect: row.change for row in study.runs}
    known = {"aerodynamics": 1.0}
    for label, inflow in (("induced velocity", "none"), ("wake", "bem")):
        other, _ = rotor(inflow=inflow, sections=4, count=1, shear=0.9)
        known[label] = np.max(np.abs(mb.simulate(other, t=t, rtol=1e-7).thrust - whole)) / np.max(np.abs(whole))
    assert found == pytest.approx(known, rel=1e-6)
    assert 1.0 > known["induced velocity"] > known["wake"] > 0.0
    assert m.airs[0].inflow == "prescribed-wake" and m.airs[0].options == {"steps": 12}


@pytest.mark.slow
def test_the_steps_of_an_inflow_span_an_accuracy_study_of_motions():
    def moving(steps):
        m, _ = rotor(inflow="prescribed-wake", sections=4, count=1, options={"steps": steps}, shear=0.9)
        return mb.simulate(m, t=np.array([4.0, 6.0]) * STEP, rtol=1e-7)

    def apart(a, b):
        """largest difference of the thrust, relative"""
        return float(np.max(np.abs(a.thrust - b.thrust)) / np.max(np.abs(b.thrust)))

    coarse, middle, fine = mb.accuracy_study(moving, steps=[12, 24, 72], repeat=1, measure=apart).points
    assert fine.is_reference and 0.0 < middle.error < 0.5 * coarse.error < 3e-2


@pytest.mark.slow
def test_momentum_theory_stands_beside_a_wake():
    m, _ = rotor(inflow="free-wake", sections=4, options={"steps": 12, "tail_turns": 1.0}, wind=7.0)
    study = mb.effect_study(mb.simulate, m, repeat=1, t=2 * STEP, rtol=1e-5, effects=["aerodynamics"])
    assert {row.effect for row in study.runs} == {"aerodynamics", "induced velocity", "wake"}
    assert all(row.status == "finished" for row in study.runs)
