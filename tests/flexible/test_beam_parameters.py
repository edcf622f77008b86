"""Beams of parameters: derivatives against closed forms and against beams that are built again."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest

VALUES = {"E": 2.1e11, "rho": 7800.0, "I": 1.7e-9, "A": 2e-4, "zeta": 0.013}


def cantilever():
    m = mb.Model("cantilever")
    E, rho, inertia, A, zeta = (m.parameter(name, value) for name, value in VALUES.items())
    beam = mb.flexible.beam(
        1.3,
        mass=rho * A,
        EI_flap=E * inertia,
        EI_edge=4.0 * E * inertia,
        inertia_flap=0.0,
        inertia_edge=0.0,
        modes=3,
        elements=24,
        damping=zeta,
    )
    s = m.flexible_body("beam", beam)
    m.fixed("clamp", m.ground, s.node("root"))
    return m


def test_closed_form_of_a_cantilever():
    # f = (1.875104^2, ...)/(2 pi L^2) sqrt(E I/(rho A)), zeta as given
    m = cantilever()
    modes = mb.modes(m)
    exact = 1.8751040687**2 / (2 * np.pi * 1.3**2) * np.sqrt(2.1e11 * 1.7e-9 / (7800.0 * 2e-4)) * np.array([1.0, 2.0])
    assert modes.frequency[:2] == pytest.approx(exact, rel=1e-6)
    s = mb.sensitivity(modes, list(VALUES))
    relative = s.frequency * np.array(list(VALUES.values())) / modes.frequency[:, None]
    assert relative[:, :4] == pytest.approx(np.tile([0.5, -0.5, 0.5, -0.5], (3, 1)), abs=1e-9)
    assert np.abs(relative[:, 4]).max() < 1e-12
    assert s.damping[:, 4] == pytest.approx(np.ones(3), abs=1e-9)
    lin = mb.sensitivity(mb.linearize(m), ["E", "rho", "zeta"])
    assert np.abs(lin.M[..., 1]).max() > 0.0 and np.abs(lin.C[..., 2]).max() > 0.0 and np.abs(lin.K[..., 0]).max() > 0.0
    # values that are set far away: uniform factors leave the shapes as they are
    before = modes.frequency
    m.set({"E": 9 * 2.1e11, "rho": 7800.0 / 4})
    assert mb.modes(m).frequency == pytest.approx(6.0 * before, rel=1e-9)


def blade(scale=1.0, parametric=None):
    """A twisted, tapered blade on an oblique root, with a spring and a mass at its tip; ``scale`` of EI and mass at a station."""
    m = mb.Model("blade")
    stations = np.array([0.0, 0.6, 1.5])
    EI, mass = np.array([900.0, 500.0, 200.0]), np.array([3.0, 2.0, 1.2])
    p = m.parameter("p", scale) if parametric else scale
    EI = np.array([EI[0], EI[1] * p, EI[2]], dtype=object if parametric else float)
    mass = np.array([mass[0], mass[1], mass[2] * p * p], dtype=object if parametric else float)
    beam = mb.flexible.beam(
        stations,
        mass=mass,
        EI_flap=EI,
        EI_edge=[4000.0, 2500.0, 900.0],
        twist=[0.3, 0.1, -0.1],
        modes=8,
        elements=6,
        attach=["tip"],
        damping=0.01,
    )
    s = m.flexible_body("blade", beam, orientation=mb.rotation((0.3, 1.0, 0.2), 0.7))
    m.fixed("root", m.ground, s.node("root"))
    tip = s.node("tip")
    end = m.body("end", mass=0.4, inertia=(1e-3, 2e-3, 1.5e-3), at=tip.at)
    m.fixed("bolt", tip, end, at=tip.at)
    m.spring_damper("stay", m.ground, end, at=(tip.at + [0.3, 0.9, -0.4], tip.at), k=300.0, c=1.0)
    return m


def test_blades_built_again():
    m = blade(parametric=True)
    modes = mb.modes(m)
    rebuilt = mb.modes(blade())
    assert modes.frequency == pytest.approx(rebuilt.frequency, rel=1e-10)
    s = mb.sensitivity(modes, ["p"])
    h = 1e-4
    upper, lower = (mb.modes(blade(1.0 + e)) for e in (h, -h))
    differences = (upper.frequency - lower.frequency) / (2 * h)
    low = slice(0, 4)
    assert s.frequency[low, 0] == pytest.approx(differences[low], rel=1e-3, abs=1e-4 * modes.frequency[3])
    damping = (upper.damping - lower.damping) / (2 * h)
    assert s.damping[low, 0] == pytest.approx(damping[low], abs=2e-3 * np.abs(damping[low]).max())
    # what is set far away moves on the kept shapes, near the beam built again
    m.set({"p": 1.2})
    moved, again = mb.modes(m).frequency[low], mb.modes(blade(1.2)).frequency[low]
    assert moved == pytest.approx(again, rel=1e-4)


def test_the_mass_follows_in_motion():
    m = blade(parametric=True)
    m.set({"p": 1.1})
    ends = []
    for x in (m, blade(1.1)):
        x.force("push", "end", value=(10.0, -30.0, 20.0))
        end = mb.simulate(x, t=0.05, rtol=1e-7).position("end")
        ends.append(end[-1] - end[0])
    assert np.linalg.norm(ends[0]) > 1e-3 and ends[0] == pytest.approx(ends[1], abs=2e-3 * np.linalg.norm(ends[1]))


def boom(length, parametric=False, **options):
    """A boom with everything that a beam can have, a tip mass on its node, a middle node on a spring, turning if ``rate`` says so."""
    rate = options.pop("rate", 0.0)
    m = mb.Model("boom", gravity=(0.0, -2.0, -9.0))
    L = m.parameter("L", length) if parametric else length
    section = {"E": 7e10, "G": 2.6e10, "rho": 2700.0, "area": 2e-4, "I_flap": 3e-9, "I_edge": 8e-9, "J": 5e-9}
    # places are typed for a boom of 1.2 m and keep their share of the length
    beam = mb.flexible.beam(
        L,
        **section,
        twist=0.4,
        modes=8,
        elements=8,
        attach=["tip"],
        nodes={"middle": 0.5 * length},
        damping=0.01,
        **options,
    )
    s = m.flexible_body("boom", beam, at=(0.1, 0.2, 0.3), angular_velocity=(0.0, 0.0, rate))
    m.fixed("root", m.ground, s.node("root")) if not rate else m.revolute(
        "root", m.ground, s.node("root"), axis=(0, 0, 1)
    )
    if rate:
        m.drive("turning", "root", mb.Ramp(rate))
    end = m.body(
        "end",
        mass=0.3,
        inertia=(2e-4, 3e-4, 4e-4),
        at=(0.1 + L, 0.2, 0.3),
        angular_velocity=(0, 0, rate),
        velocity=(0, rate * L, 0),
    )
    m.fixed("bolt", s.node("tip"), end)
    if not rate:
        m.spring_damper(
            "stay",
            m.ground,
            s.node("middle"),
            at=((0.1 + 0.5 * L, 1.2, 0.3), (0.1 + 0.5 * L, 0.2, 0.3)),
            k=900.0,
            c=2.0,
        )
    return m


def test_length_of_a_cantilever():
    """f goes with L^-2, its damping ratio stays."""
    m = mb.Model("cantilever")
    L = m.parameter("L", 1.3)
    beam = mb.flexible.beam(L, mass=1.6, EI_flap=350.0, EI_edge=1400.0, modes=3, elements=6, damping=0.02)
    m.fixed("clamp", m.ground, m.flexible_body("beam", beam).node("root"))
    modes = mb.modes(m)
    s = mb.sensitivity(modes, ["L"])
    assert 1.3 * s.frequency[:, 0] / modes.frequency == pytest.approx(-2.0 * np.ones(3), abs=1e-9)
    assert np.abs(s.damping).max() < 1e-12
    before = modes.frequency
    m.set({"L": 2.6})
    assert mb.modes(m).frequency == pytest.approx(before / 4, rel=1e-9)


def with_a_camera(length, parametric):
    """A leaning boom with a mass drawn at the place of its tip."""
    m = mb.Model("boom", gravity=(0.0, -2.0, -9.0))
    L = m.parameter("L", length) if parametric else length
    beam = mb.flexible.beam(L, mass=0.9, EI_flap=450.0, EI_edge=700.0, modes=4, elements=8, attach=["tip"])
    boom = m.flexible_body("boom", beam, at=(0.3, -0.2, 0.7), orientation=mb.rotation((0.3, 1.0, -0.4), 0.8))
    m.fixed("clamp", m.ground, boom.node("root"))
    tip = boom.node("tip")
    camera = m.body("camera", mass=0.8, inertia=(2e-3, 2e-3, 1e-3), at=tip.at)
    m.fixed("mount", tip, camera, at=tip.at)
    return m


def test_what_is_drawn_at_a_node_follows_the_length():
    """The place of a node is an expression of the length: a mass at the tip moves with it, as in booms built again."""
    h = 1e-4
    m = with_a_camera(3.4, True)
    modes = mb.modes(m)
    lower, upper = (mb.modes(with_a_camera(3.4 + e, False)).frequency for e in (-h, h))
    assert mb.sensitivity(modes, ["L"]).frequency[:2, 0] == pytest.approx((upper - lower)[:2] / (2 * h), rel=1e-5)
    m.set({"L": 3.4 + h})
    assert mb.modes(m).frequency[:2] == pytest.approx(upper[:2], rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("rate", [0.0, 6.0])
def test_length_of_a_boom_built_again(theory, rate):
    """Derivatives by the length against booms built again, at rest and turning (stiffened, with nodes that move along)."""
    h = 1e-4
    m = boom(1.2, parametric=True, theory=theory, rate=rate)
    upper, lower, same = (boom(1.2 + e, theory=theory, rate=rate) for e in (h, -h, 0.0))

    def found(model):
        at = mb.steady_motion(model, without=["gravity"]) if rate else mb.equilibrium(model)
        return mb.modes(model, at=at, without=["gravity"] if rate else ())

    modes = found(m)
    assert modes.frequency == pytest.approx(found(same).frequency, rel=1e-9)
    differences = (found(upper).frequency - found(lower).frequency) / (2 * h)
    # the shapes are kept: high modes are off by the change of theirs
    low = slice(0, 4)
    if not rate:
        s = mb.sensitivity(modes, ["L"]).frequency[low, 0]
        assert s == pytest.approx(differences[low], rel=2e-3)
    m.set({"L": 1.2 + h})
    moved = (found(m).frequency - modes.frequency) / h
    assert moved[low] == pytest.approx(differences[low], rel=4e-3)
    if not rate:
        tip = [getattr(v, "value", v) for v in m["boom"].node("tip").at]
        assert tip == pytest.approx([1.3 + h, 0.2, 0.3], abs=1e-12)


@pytest.mark.some(1)
@pytest.mark.parametrize("way", ["pickle", "toml"])
def test_models_of_such_beams_are_kept(way, tmp_path):
    m = cantilever()
    m = pickle.loads(pickle.dumps(m)) if way == "pickle" else mb.Model.load(m.save(tmp_path / "beam.toml"))
    before = mb.modes(m).frequency
    m.set({"E": 4 * 2.1e11})
    assert mb.modes(m).frequency == pytest.approx(2 * before, rel=1e-9)


def test_what_changes_the_mesh_is_refused():
    m = mb.Model("x")
    L = m.parameter("L", 1.0)
    with pytest.raises(mb.ModelError, match=r"stations are numbers.*build the beam again"):
        mb.flexible.beam([0.0, 0.5, L], mass=1.0, EI_flap=1.0, EI_edge=1.0)
    with pytest.raises(mb.ModelError, match=r"twist is a number.*build the beam again"):
        mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=1.0, twist=L)
    long = m.flexible_body("long", mb.flexible.beam(L, mass=1.0, EI_flap=1.0, EI_edge=1.0, elements=6, modes=2))
    with pytest.raises(mb.ModelError, match="does not follow the length"):
        m.section_load(long, [0.0, 1.0], [[0, 0, 1.0], [0, 0, 1.0]])
    with pytest.raises(mb.ModelError, match="stiffening=False"):
        mb.flexible.beam([0.0, 0.5, 1.0], mass=np.array([1.0, 1.0, 2.0 * L]), EI_flap=1.0, EI_edge=1.0, fixed=None)
    beam = mb.flexible.beam(1.0, mass=L, EI_flap=1.0, EI_edge=1.0, elements=6, modes=2)
    with pytest.raises(mb.ModelError, match="one ratio for all modes"):
        mb.flexible.beam(1.0, mass=L, EI_flap=1.0, EI_edge=1.0, elements=6, modes=2, damping=[0.01, 0.02])
    with pytest.raises(mb.ModelError, match="depends on parameters"):
        beam.save("beam")
