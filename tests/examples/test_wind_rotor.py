"""The three-bladed rotor: core against reference, families of modes in both frames, motion against the modal method."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.examples._whole_rotor import air_on_the_rotor, rotor_body
from mbrs.examples._wind_rotor import AROUND, air_loads, blade_axes
from mbrs.model.tables import tables
from mbrs.reference.fixed_frame import Rotor
from oracles import schemes

BLADES = ("blade1", "blade2", "blade3")
SPEED = 17.2 * 2 * np.pi / 60


@pytest.fixture(scope="module")
def rotor():
    """The rotor without its drive, linearised by the reference."""
    m = mb.examples.wind_rotor(modes=4, air=3.0, drive=False)
    return Rotor(ref.System(tables(m)), "bearing", BLADES, "shaft end", SPEED)


def test_the_blade_is_the_published_one():
    """docs/theory.md (23.14): 1.230858, 3.674065 Hz flapwise, 1.877751, 6.374249 Hz edgewise."""
    found = mb.examples.wind_blade(modes=4).frequencies()
    assert found == pytest.approx([1.230858, 1.877751, 3.674065, 6.374249], rel=1e-5)


def test_core_and_reference_have_the_same_modes(rotor):
    """Turning, speed held by the drive: the core's modes against the roots of the reference's matrices."""
    m = mb.examples.wind_rotor(modes=4, gravity=None, air=None)
    found = mb.modes(m, at=mb.steady_motion(m))
    n = len(rotor.M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(rotor.M, np.hstack([rotor.S, rotor.D]))]])
    roots = np.linalg.eigvals(A)
    roots = roots[roots.imag > 0]
    roots = roots[np.argsort(np.abs(roots))]
    assert found.eigenvalue == pytest.approx(roots, rel=1e-7)


def families_in_fixed_axes(rotor):
    """Hz and the collective share of the blades' motion for every pair of roots of the reference in fixed axes."""
    fixed = rotor.fixed()
    pairs = [(s.imag, phi) for s, phi in zip(fixed.eigenvalue, fixed.shape.T, strict=True) if s.imag > 0]
    power = [np.abs(phi[rotor.blades]) ** 2 for _, phi in pairs]  # (modes of a blade, collective cosine sine)
    return [(w / (2 * np.pi), p[:, 0].sum() / p.sum()) for (w, _), p in zip(pairs, power, strict=True)]


def test_families_in_both_frames(rotor):
    """Frequencies that patterns of the turning frame have for a fixed observer are roots of the matrices in that frame, which
    do not depend on the azimuth; collective modes keep theirs, whirling ones move by the speed.
    """
    assert rotor.fixed().periodic < 1e-11
    m = mb.examples.wind_rotor(modes=4, gravity=None, air=None)
    families = mb.rotor_modes(mb.modes(m, at=mb.steady_motion(m)), BLADES, SPEED)
    fixed = families_in_fixed_axes(rotor)
    assert len(fixed) == len(families.family) == 18
    for f, kind in zip(families.fixed, families.family, strict=True):
        there = min(fixed, key=lambda row: abs(row[0] - f))
        assert there[0] == pytest.approx(f, rel=1e-6)
        assert (there[1] > 0.5) == (kind == "collective")
    assert sorted(families.family) == ["backward"] * 6 + ["collective"] * 6 + ["forward"] * 6
    # flap, edge, second flap: each as two antisymmetric and one symmetric mode, split by the flexible shaft
    for coordinate in (0, 1, 2):
        own = [kind for kind, k, f in zip(families.family, families.coordinate, families.frequency, strict=True)
               if k == coordinate and f < 5.0]  # fmt: skip
        assert {"collective", "forward", "backward"} <= set(own), coordinate


def test_a_rigid_hub_makes_the_families_coincide():
    """With a hub that is rigid and held, symmetric and antisymmetric modes are one blade's."""
    blade = mb.examples.wind_blade(modes=2)
    m = mb.Model("held hub")
    hub = m.body("hub", mass=1.0, inertia=(1, 1, 1))
    m.fixed("held", m.ground, hub, at=(0, 0, 0))
    for i in range(3):
        angle = 2 * np.pi * i / 3
        at = 1.75 * np.array([np.cos(angle), np.sin(angle), 0])
        one = m.flexible_body(f"blade{i + 1}", blade, at=at, orientation=mb.rotation("z", angle))
        m.fixed(f"root{i + 1}", hub, one.node("root"))
    found = mb.modes(m, at=None, without=("damping",))
    assert found.frequency == pytest.approx(np.repeat(blade.frequencies(), 3), rel=1e-9)


def test_motion_against_the_modal_method(rotor):
    """Weight and air loads from rest: the nonlinear motion against the superposition, small deflections of a large rotor."""
    m = mb.examples.wind_rotor(modes=4, air=3.0)
    t = np.linspace(0.0, 2.0, 81)
    traj = mb.simulate(m, t=t, rtol=1e-7)
    linear = rotor.superposed(t)
    for k, bound in ((0, 0.03), (1, 0.04)):
        found = np.stack([traj.modal(b)[:, k] for b in BLADES], axis=1)
        compared = linear[:, [rotor.names.index(f"{b}.q{k + 1}") for b in BLADES]]
        off = np.abs(found - compared).max() / np.abs(found).max()
        print(f"q{k + 1}: up to {np.abs(found).max():.3g}, off by {off:.2%}")
        assert off < bound
    # what is left is of second order: a tenth of the loads, a tenth of the difference
    assert np.abs(found).max() > 1.0


@pytest.mark.slow
def test_the_difference_to_the_modal_method_is_of_second_order():
    """A tenth of weight and no air: relative differences fall by about ten."""
    off = []
    for g in (9.81, 0.981):
        m = mb.examples.wind_rotor(modes=2, gravity=g, air=None)
        t = np.linspace(0.0, 1.0, 81)
        traj = mb.simulate(m, t=t, rtol=1e-9)
        free = mb.examples.wind_rotor(modes=2, gravity=g, air=None, drive=False)
        rotor = Rotor(ref.System(tables(free)), "bearing", BLADES, "shaft end", SPEED)
        found = traj.modal("blade2")
        compared = rotor.superposed(t)[:, [rotor.names.index(f"blade2.q{k + 1}") for k in range(2)]]
        off.append(np.abs(found - compared).max() / np.abs(found).max())
    print("relative differences for all and a tenth of the weight:", off)
    assert off[1] < off[0] / 5


@pytest.mark.slow
def test_step_by_step():
    """Generalised-alpha of core and reference, equal steps, on a smaller rotor."""
    m = mb.examples.wind_rotor(modes=2, air=1.0)
    h, n = 0.01, 4
    traj = mb.simulate(m, t=n * h, method="generalized-alpha", step=h)
    sys = ref.System(tables(m))
    history = schemes.simulate(sys, ref.drawn_state(sys), n * h, h)
    for frame, name in enumerate(traj.bodies[:6]):
        assert traj.position(name)[-1] == pytest.approx(history.positions(sys)[-1][frame], abs=1e-6), name
    q = sys.flexible[0].held(history.instants[-1].motion.state.r)
    assert traj.modal("blade1")[-1] == pytest.approx(q, rel=1e-5, abs=1e-6)


def test_campbell_of_the_free_rotor():
    """Its turning stays a rigid mode at every speed, although centrifugal terms cancel in its row to rounding only."""
    m = mb.examples.wind_rotor(modes=2, gravity=None, air=None, drive=False)
    for speed in (0.25, 1.8):
        found = mb.modes(m, at=mb.steady_motion(m, {"bearing": speed}))
        assert found.kind[0] == "rigid" and np.all(np.isfinite(found.shape))
    diagram = mb.campbell(m, "bearing", speed=np.linspace(0.0, 3.0, 4))
    assert np.all(np.isfinite(diagram.frequency)) and diagram.frequency.shape == (4, 12)
    assert {1, -1} <= set(diagram.whirl[-1].tolist())
    assert np.all(diagram.frequency[-1, :3] > diagram.frequency[0, :3]), "centrifugal stiffening"


def test_files_hold_the_models(tmp_path):
    """Flexible bodies, section loads and drives come back as they were."""
    from scenes import same_tables

    for m in (mb.examples.wind_rotor(modes=2, air=1.0), mb.examples.slider_crank(stiffness=15.0)):
        again = mb.Model.load(m.save(tmp_path / "model.toml"))
        assert same_tables(tables(again), tables(m)) == []


def test_auto_asks_how_fast_a_flexible_body_vibrates():
    """Without springs, dampers and laws a flexible body may still be stiff."""
    route = mb.simulate(mb.examples.slider_crank(stiffness=15.0), t=0.01).stats.route
    assert "fastest vibration" in route


def test_a_scaled_rotor_is_similar():
    """Same material: frequencies at rest over the scale, damping ratios as they were."""
    small, large = (mb.modes(mb.examples.wind_rotor(speed=0.0, gravity=None, scale=s)) for s in (1.0, 1.25))
    assert large.frequency == pytest.approx(small.frequency / 1.25, rel=1e-9)
    assert large.damping == pytest.approx(small.damping, rel=1e-7)


@pytest.mark.parametrize("speed", [0.0, SPEED])
def test_the_rotor_as_one_body_has_the_modes_of_the_rotor_of_bodies(speed):
    """Nine shapes of the rotor at rest, also for the turning one, with the second order of the hub's rotations."""
    several, one = mb.examples.wind_rotor(speed=speed, gravity=None), mb.examples.whole_rotor(speed, gravity=None)
    found, known = (mb.modes(m, at=mb.steady_motion(m) if speed else None).frequency[:9] for m in (one, several))
    assert found == pytest.approx(known, rel=4e-4)
    assert one["rotor"].modal.n_modes == 9


def test_air_on_the_rotor_as_one_body_is_that_on_its_blades():
    """The line of the body runs through one blade after the other, a curve with corners; between them there is no load."""
    body, blade = rotor_body(3, 1.2), mb.examples.wind_blade(4, 1.2)
    m = mb.Model("loads")
    whole = m.section_load(m.flexible_body("rotor", body), **air_on_the_rotor(body, SPEED, 1.0, 1.2))
    force, moment = np.zeros(3), np.zeros(3)
    for i, angle in enumerate(AROUND):
        R = blade_axes(angle)
        own = m.section_load(m.flexible_body(f"b{i}", blade), **air_loads(angle, SPEED, 1.0, 1.2))
        force += R @ own.force[2]
        moment += R @ own.moment[2] + np.cross(1.2 * 1.75 * R[:, 0], R @ own.force[2])
    assert whole.force[2] == pytest.approx(force, rel=1e-10, abs=1e-6)
    assert whole.moment[2] == pytest.approx(moment, rel=1e-6)
