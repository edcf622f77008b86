"""Cases of the verification manual: flexible bodies and loops."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from manual.record import in_size_of
from scipy import linalg, optimize

G = 9.80665
R = linalg.expm(np.cross(np.eye(3), [0.22, 0.58, -0.47]))
X, Y, Z = R.T


def roots(cosh_times_cos, n):
    """cos x cosh x = +-1."""
    guess = (np.arange(1, n + 1) + (0.5 if cosh_times_cos > 0 else -0.5)) * np.pi
    return [
        optimize.brentq(lambda x: np.cos(x) - cosh_times_cos / np.cosh(x), g - 0.31, g + 0.31, xtol=1e-14)
        for g in guess
    ]


def test_a_clamped_beam_has_eulers_frequencies(case):
    length, mass, flap = 2.0, 3.0, 700.0
    b = mb.flexible.beam(length, mass=mass, EI_flap=flap, EI_edge=10 * flap, modes=6)
    known = (np.array(roots(-1, 2)) / length) ** 2 * np.sqrt(flap / mass) / (2 * np.pi)
    f = b.frequencies()
    case(
        "clamped beam: two frequencies of bending",
        topic="flexible",
        ours=[f[np.argmin(np.abs(f - one))] for one in known],
        known=known,
        within=1e-5,
        uncertainty=1e-13,
        source="cos x cosh x = -1 (Euler, Bernoulli)",
        unit="Hz",
    )


def test_a_free_beam_has_eulers_frequencies(case):
    b = mb.flexible.beam(2.0, mass=3.0, EI_flap=700.0, EI_edge=2000.0, modes=4, fixed=None)
    known = np.sort([(x / 2) ** 2 * np.sqrt(s / 3) / (2 * np.pi) for s in (700.0, 2000.0) for x in roots(1, 2)])[:4]
    case(
        "free beam: four frequencies of bending",
        topic="flexible",
        ours=b.frequencies(),
        known=known,
        within=1e-6,
        uncertainty=1e-13,
        source="cos x cosh x = 1 (Euler, Bernoulli)",
        unit="Hz",
    )


def test_the_windpact_blade(case):
    data = mb.examples.windpact_blade()
    b = mb.flexible.beam(data.station, mass=data.mass, EI_flap=data.EI_flap, EI_edge=data.EI_edge, modes=6)
    case(
        "blade of the WindPACT 1.5 MW turbine: four frequencies",
        topic="flexible",
        kind="independent script",
        ours=b.frequencies()[:4],
        known=[1.230858, 1.877751, 3.674065, 6.374249],
        within=1e-5,
        uncertainty=5e-7,
        source="docs/theory.md (23.14): integral equation, published distributions",
        unit="Hz",
    )


def test_a_beam_in_a_model_sags(case):
    """A clamped beam with a load at its end: F L^3 / (3 EI); static shapes make it exact."""
    length, EI = 1.7, 830.0
    b = mb.flexible.beam(length, mass=2.1, EI_flap=EI, EI_edge=9 * EI, modes=8, attach=["tip"])
    m = mb.Model("beam")
    f = m.flexible_body("beam", b, at=(0, 0, 0), orientation=R)
    m.fixed("root", m.ground, f.node("root"))
    h = mb.frf(m, f.node("tip").force(Z), f.node("tip").motion(Z), frequency=np.array([0.0]))
    case(
        "clamped beam in a model: static receptance at its end",
        topic="flexible",
        ours=h.value.ravel()[0],
        known=length**3 / (3 * EI),
        within=1e-12,
        source="L^3 / (3 E I)",
        estimate=h.error,
        unit="m/N",
    )


# --- loops -----


def square(gravity=None, turn=0.0, redundant=True):
    """A parallelogram of four-bar shape: cranks of length 0.8 on hinges 1.1 apart, a coupler that only translates."""
    r, d = 0.8, 1.1
    up = np.cos(turn) * Z + np.sin(turn) * X
    m = mb.Model("parallelogram", gravity=gravity)
    inertia = R @ np.diag([0.06, 0.05, 0.02]) @ R.T
    a = m.body("left", mass=1.2, inertia=inertia, at=0.5 * r * up)
    b = m.body("right", mass=1.2, inertia=inertia, at=0.5 * r * up + d * X)
    c = m.body("coupler", mass=2.7, inertia=inertia, at=r * up + 0.5 * d * X)
    for name, one, other, at, kind in (
        ("A", m.ground, a, 0 * X, "revolute"),
        ("D", m.ground, b, d * X, "revolute"),
        ("B", a, c, r * up, "revolute"),
        ("C", c, b, r * up + d * X, "revolute"),
    ):
        getattr(m, kind)(name, one, other, at=at, axis=Y)
    return m, r


@pytest.mark.parametrize("turn", [np.pi, 2.2])
def test_a_hanging_parallelogram(case, turn):
    """J = 2 (I + m r^2/4) + mc r^2, weight moment (2 m r/2 + mc r) g cos of the hang angle: a pendulum."""
    m, r = square(gravity=tuple(-G * Z), turn=turn)
    eq = mb.equilibrium(m)
    found = mb.modes(m, at=eq)
    J = 2 * (0.05 + 1.2 * r * r / 4) + 2.7 * r * r
    known = np.sqrt((1.2 + 2.7) * G * r / J) / (2 * np.pi)
    assert mb.System(m).dof == 1
    case(
        f"hanging parallelogram, drawn at {np.degrees(turn):.0f} degrees, three redundant rows: frequency",
        topic="loops",
        ours=found.frequency[-1],
        known=known,
        within=1e-7,
        source="w^2 = (m + m_c) g r / (2 I + m r^2/2 + m_c r^2)",
        estimate=found.error,
        unit="Hz",
    )


def test_slider_crank_at_speed(case):
    """Driven crank: place and acceleration of the slider from x = r cos a + sqrt(l^2 - r^2 sin^2 a)."""
    r, rod_length, W = 0.13, 0.41, 21.0
    m = mb.Model("slider-crank")
    crank = m.body("crank", mass=1.0, inertia=(0.01, 0.02, 0.02), at=r / 2 * X, orientation=R)
    rod = m.body("rod", mass=0.8, inertia=(0.01, 0.02, 0.02), at=(r + rod_length / 2) * X, orientation=R)
    piston = m.body("piston", mass=1.4, inertia=(0.01, 0.01, 0.01), at=(r + rod_length) * X)
    m.revolute("main", m.ground, crank, at=(0, 0, 0), axis=Y)
    m.revolute("pin", crank, rod, at=r * X, axis=Y)
    m.revolute("wrist", rod, piston, at=(r + rod_length) * X, axis=Y)
    m.prismatic("bore", m.ground, piston, at=(r + rod_length) * X, axis=X)
    m.drive("turn", "main", mb.Ramp(W))
    t = np.linspace(0, 0.7, 50)
    traj = mb.simulate(m, t=t, rtol=1e-9)
    a = W * t
    root = np.sqrt(rod_length**2 - (r * np.sin(a)) ** 2)
    case(
        "slider-crank, driven: place of the piston over 2.3 turns",
        topic="loops",
        ours=traj.position("piston") @ X,
        known=r * np.cos(a) + root,
        within=1e-8,
        source="x = r cos a + sqrt(l^2 - r^2 sin^2 a)",
        estimate=in_size_of(traj, r * np.cos(a) + root),
        unit="m",
    )
    v = -r * W * np.sin(a) - r * r * W * np.sin(a) * np.cos(a) / root
    case(
        "slider-crank, driven: velocity of the piston",
        topic="loops",
        ours=traj.velocity("piston") @ X,
        known=v,
        within=1e-8,
        uncertainty=1e-14,
        source="its derivative by time",
        unit="m/s",
    )


def test_two_gears(case):
    """Two wheels on a coupler (ratio -n): the inertia seen from the first is I1 + n^2 I2."""
    n, k, one, other = 2.7, 57.0, 0.31, 0.043
    m = mb.Model("gears")
    a = m.body("a", mass=1.0, inertia=R @ np.diag([0.3, 0.3, one]) @ R.T)
    b = m.body("b", mass=1.0, inertia=R @ np.diag([0.03, 0.03, other]) @ R.T, at=X)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis=Z, k=k)
    m.revolute("B", m.ground, b, at=X, axis=Z)
    m.coupler("mesh", "A", "B", ratio=-n)
    found = mb.modes(m)
    case(
        "two gears: frequency",
        topic="loops",
        ours=found.frequency[-1],
        known=np.sqrt(k / (one + n * n * other)) / (2 * np.pi),
        within=1e-10,
        source="w^2 = k / (I1 + n^2 I2)",
        estimate=found.error,
        unit="Hz",
    )
