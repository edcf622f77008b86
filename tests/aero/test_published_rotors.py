"""Rotors and wakes whose answers others published: the NREL 5 MW and WindPACT 1.5 MW turbines, OpenFAST's wing and helix."""

from __future__ import annotations

import mbrs as mb
import nrel_5mw as nrel
import numpy as np
import pytest
from scipy.special import iv, kvp

REPORT = (
    "FAST with AeroDyn: J. Jonkman, S. Butterfield, W. Musial, G. Scott, NREL/TP-500-38060 (2009), figure 9-1; numbers as in "
    "github.com/WISDEM/CCBlade, test/test_ccblade.py"
)
R_TEST = "github.com/OpenFAST/r-test"
STEADY_TEST = f"{R_TEST}, 5MW_Land_Linear_Aero_CalcSteady.1.lin"
# The steady rotor of STEADY_TEST in wind along its axis: m/s, rad/s, rad.
STEADY = {"wind": 8.0, "speed": 0.9982, "pitch": np.radians(0.0121)}


@pytest.mark.parametrize("wind, speed, power, thrust", [(8.0, 9.156, 1876.2, 478.0), (11.0, 11.89, 4833.2, 790.6)])
def test_the_nrel_5mw_rotor(case, wind, speed, power, thrust):
    """The report's blades are elastic and tilted, ours are neither; its thrust is the force in the tilted shaft, weight included."""
    rotor = nrel.rotor()
    p = mb.aero.performance(rotor, speed * np.pi / 30.0 * rotor.radius / wind)
    weight = nrel.MASS * 9.81 * np.sin(nrel.TILT)
    case(f"NREL 5 MW rotor in {wind:g} m/s: power", topic="aero", kind="other program", ours=p.power(wind)[0] / 1e3, known=power,
         within=0.025, uncertainty=1e-3, estimate=p.error, unit="kW", source=REPORT)  # fmt: skip
    case(f"NREL 5 MW rotor in {wind:g} m/s: force in the shaft with the weight of 110 t along it", topic="aero", kind="other program",
         ours=(p.thrust(wind)[0] + weight) / 1e3, known=thrust, within=0.015, uncertainty=1e-3, estimate=p.error, unit="kN",
         source=REPORT)  # fmt: skip


def test_induction_along_the_nrel_blade(case):
    """OpenFAST's induction leaves drag out and its blades are elastic."""
    r = np.array([11.75, 15.85, 19.95, 24.05, 28.15, 32.25, 36.35, 40.45, 44.55, 48.65, 52.75, 56.1667, 58.9, 61.6333])
    known = [
        2.0115,
        2.1763,
        1.9969,
        1.9830,
        2.2180,
        2.2918,
        2.5732,
        2.7743,
        2.6310,
        2.7468,
        2.9101,
        3.1709,
        3.4873,
        3.6354,
    ]
    rotor = nrel.rotor()
    ratio = STEADY["speed"] * rotor.radius / STEADY["wind"]
    p = mb.aero.performance(rotor, ratio, pitch=STEADY["pitch"], elements=160)
    ours = np.interp(r, p.place, p.axial_induction[0]) * STEADY["wind"]
    case("NREL 5 MW rotor in 8 m/s: axial induced velocity from 11.8 to 61.6 m", topic="aero", kind="other program", ours=ours,
         known=known, within=0.015, uncertainty=1e-3, unit="m/s",
         source=f"OpenFAST, AeroDyn: {STEADY_TEST}")  # fmt: skip


def test_spanwise_loads_of_the_nrel_rotor(case):
    """A blade that points up, in shear, tilted and coned.

    The wind at three quarters of the chord is less on a coned blade that turns, by half the chord times the speed times the cone: 1 %.
    """
    speed = 10.0 * 7.55 / (nrel.TIP * np.cos(nrel.PRECONE))
    wind = mb.aero.wind(10.0, "x", 0.2, 90.0, ground=-90.0)
    m = nrel.model(speed, wind, tilt=nrel.TILT, flexible=False, sections=60)
    loads = mb.simulate(m, t=[0.0, 1e-3], rtol=1e-4).aero("blade1")
    normal = [1.7001, 2.0716, 2.5120, 3.1336, 3.6917, 4.3887, 5.0689, 5.4652, 6.0351, 6.5391, 6.8314, 6.6927, 4.8516]
    along = [0.6226, 0.6323, 0.6474, 0.6825, 0.7000, 0.7219, 0.7366, 0.7494, 0.7529, 0.7392, 0.6981, 0.6145, 0.4035]
    for name, force, known, within in (
        ("normal", loads.normal_force, normal, 0.025),
        ("tangential", loads.tangential_force, along, 0.04),
    ):
        ours = np.interp(nrel.STATIONS[4:], loads.place, force[0]) / 1e3
        case(f"NREL 5 MW rotor in 10 m/s, tip speed ratio 7.55: {name} force per length from 15.9 to 61.6 m", topic="aero",
             kind="other program", ours=ours, known=known, within=within, uncertainty=1e-3, unit="kN/m",
             source="CCBlade (S. A. Ning): github.com/byuflowlab/CCBlade.jl, test/runtests.jl")  # fmt: skip


def test_flapwise_deflection_of_the_nrel_blade(case):
    """The mean of OpenFAST's three blades leaves out what weight and the tower do; both flapwise coordinates are deflections of the tip."""
    m = nrel.model(STEADY["speed"], mb.aero.wind(STEADY["wind"]), sections=12, pitch=STEADY["pitch"])
    steady = mb.steady_motion(m)
    blade = nrel.structure()
    tip = (
        mb.simulate(m, t=[0.0, 1e-4], at=steady.state, rtol=1e-4).modal("blade1")[0]
        @ blade.node_shape[blade.node("tip"), 2]
    )
    first, second = np.mean([3.1712, 3.3474, 3.0457]), np.mean([0.0558, -0.0088, 0.0848])
    case("NREL 5 MW rotor in 8 m/s: flapwise deflection of the tip", topic="aero", kind="other program", ours=tip,
         known=first + second, within=0.03, uncertainty=0.01, unit="m",
         source=f"OpenFAST, ElastoDyn: {STEADY_TEST}")  # fmt: skip


def test_blade_modes_of_the_windpact_turbine(case):
    """OpenFAST's shapes are given polynomials: each of its modes is a little stiffer than the lowest that the blade can have.

    Its state matrix is that of the whole turbine. Rows of the tower and the shaft were eliminated as held, A_bb - A_br A_rr^-1 A_rb,
    which is exact where the stiffness of blades and of the rest are not coupled; means of the pairs of modes in which the three blades
    move against each other.
    """
    data = mb.examples.windpact_blade()
    blade = mb.flexible.beam(
        data.station, mass=data.mass, EI_flap=data.EI_flap, EI_edge=data.EI_edge, twist=-data.twist, modes=3
    )
    case("WindPACT 1.5 MW blade: frequencies of first flap, first edge, second flap", topic="aero", kind="other program",
         ours=blade.frequencies(), known=[1.2280, 1.8579, 3.7501], within=0.02, uncertainty=5e-3, unit="Hz",
         source=f"OpenFAST, ElastoDyn: {R_TEST}, WP_Stationary_Linear.1.lin")  # fmt: skip


def test_openfasts_elliptic_wing(case):
    """5 m of span, root chord 1 m, slope 2 pi, wind (1, 0.1): lift coefficients of sections by 40 panels of a vortex method."""
    y = -2.5 * np.cos(np.linspace(0.0, np.pi, 2001))
    plate = mb.aero.polar([-1.0, 1.0], [-2 * np.pi, 2 * np.pi], [0.0, 0.0])
    wing = mb.aero.blade(y, np.sqrt(np.maximum(1.0 - (y / 2.5) ** 2, 0.0)), 0.0, plate)
    w = mb.aero.lifting_line(wing, np.arctan(0.1), strips=40)
    place = np.array([0.0483, 0.1394, 0.2328, 0.3417, 0.5, 0.6584, 0.8004, 0.9115])
    known = [0.476466, 0.476723, 0.476759, 0.476771, 0.476775, 0.476771, 0.476751, 0.476657]
    ours = np.interp(place, w.place / 5.0 + 0.5, 2 * np.pi * w.angle_of_attack[0])
    case("elliptic wing of OpenFAST's tests: lift coefficients of sections", topic="aero", kind="other program", ours=ours, known=known,
         within=2e-3, uncertainty=1e-3, estimate=w.error,
         source=f"A. van Garrel, ECN-C--03-079 (2003), p. 29; {R_TEST}, ad_EllipticalWingInf_OLAF/AnalyticalResults")  # fmt: skip


def test_openfasts_helical_wake(case):
    """Three helices behind a rotor of 100 m with constant circulation: axial induced velocity on the blades over the wind.

    Beyond half of the radius the published table is not that of these helices: what it adds to a third, .00498 at .7 R, is three times
    what Hardin's series adds for an infinite wake, of which this is the half.
    """
    radius, pitch, circulation, wind, turns = 100.0, 104.719757, 232.71056693325, 10.0, 300
    share = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.7])
    v = []
    for n in (90, 180):
        t = np.linspace(0.0, 2 * np.pi * turns, n * turns + 1)
        total = np.zeros(len(share))
        for k in range(3):
            psi = t + 2 * np.pi * k / 3
            p = np.stack([pitch * t / (2 * np.pi), radius * np.sin(psi), radius * np.cos(psi)], axis=1)
            on = np.stack([0 * share, 0 * share, radius * share], axis=1)
            total += mb.aero.induced_velocity(on, p[:-1], p[1:], circulation)[:, 0]
        v.append(np.abs(total) / wind)
    ours = (4 * v[1] - v[0]) / 3
    case("helical wake of OpenFAST's tests: axial induction of three helices from .1 to .5 R", topic="aero", kind="other program",
         ours=ours[:5], known=[0.33333335, 0.33333357, 0.33333555, 0.33335012, 0.33344971], within=5e-4, uncertainty=3e-4,
         estimate=np.max(np.abs(ours - v[1])),
         source=f"{R_TEST}, ad_HelicalWakeInf_OLAF/AnalyticalResults")  # fmt: skip
    m = 3.0 * np.arange(1, 30)
    ell = pitch / (2 * np.pi)
    inner, outer = m * share[5] * radius / ell, m * radius / ell
    added = np.sum(m * kvp(m, outer) * iv(m, inner))
    hardin = 3 * circulation / pitch * (0.5 - radius / ell * added) / wind
    assert ours[5] == pytest.approx(hardin, rel=2e-5)
