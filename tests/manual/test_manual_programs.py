"""Cases of the verification manual: values that other programs printed, and systems in many digits."""

from __future__ import annotations

import mbrs as mb
import numpy as np
from mpmath import mp

# ROSS 2.3.0: the rotor of docs/coming/ross.md, rotor.run_modal(speed=300.0, num_modes=16).wn / (2 pi)
ROSS = [26.84692554, 27.12223182, 139.99531944, 182.42162262, 303.49304804, 331.82318418]
# Exudyn 1.13.6: the end of docs/coming/exudyn.md, 20000 steps of the trapezoidal rule
EXUDYN = [0.74642838, 0.0, -0.53739482]


def test_a_rotor_of_ross(case):
    d, at, k = 0.03, 0.4, 2e7
    area, second = np.pi * d**2 / 4, np.pi * d**4 / 64
    bending, inertia = 2.1e11 * second, 7850 * second
    section = dict(mass=7850 * area, EI_flap=bending, EI_edge=bending, inertia_flap=inertia, inertia_edge=inertia)
    beam = mb.flexible.beam(
        1.0, **section, modes=16, fixed=None, elements=20, nodes={"disc": at}, attach=["root", "disc", "tip"]
    )
    m = mb.Model("rotor")
    shaft = m.flexible_body("shaft", beam, at=(0, 0, 0))
    m.free("spin", m.ground, shaft.node("root"), at=(0, 0, 0))
    disc = m.body("disc", mass=12.0, inertia=(0.11, 0.06, 0.06), at=(at, 0, 0))
    m.fixed("fit", shaft.node("disc"), disc, at=(at, 0, 0))
    m.bushing("left", m.ground, shaft.node("root"), at=(0, 0, 0), k=(k, k, k, 0, 0, 0))
    m.bushing("right", m.ground, shaft.node("tip"), at=(1, 0, 0), k=(0, k, k, 0, 0, 0))
    found = mb.modes(m, at=mb.steady_motion(m, {"spin.rx": 300.0}))
    f = found.frequency
    case(
        "shaft with a disc at 300 rad/s: six frequencies of bending",
        topic="rotors",
        kind="other program",
        ours=[f[np.argmin(np.abs(f - one))] for one in ROSS],
        known=ROSS,
        within=3e-5,
        uncertainty=2e-5,
        source="ROSS 2.3.0, 20 elements; docs/coming/ross.md has both scripts",
        estimate=found.error,
        unit="Hz",
    )


def test_a_double_pendulum_of_exudyn(case):
    length = 0.8
    m = mb.Model("double pendulum", gravity=(0, 0, -9.81))
    slender = 1.5 / 12 * np.array([2 * 0.04**2, length**2 + 0.04**2, length**2 + 0.04**2])
    a = m.body("a", mass=1.5, inertia=slender, at=(length / 2, 0, 0))
    b = m.body("b", mass=1.5, inertia=slender, at=(3 * length / 2, 0, 0))
    m.revolute("upper", m.ground, a, at=(0, 0, 0), axis="y")
    m.revolute("lower", a, b, at=(length, 0, 0), axis="y")
    traj = mb.simulate(m, t=2.0, rtol=1e-10)
    case(
        "double pendulum let go level: place of the second rod after 2 s",
        topic="motion",
        kind="other program",
        ours=traj.position("b")[-1],
        known=EXUDYN,
        within=3e-6,
        uncertainty=2e-6,
        source="Exudyn 1.13.6, 20000 steps of order two; docs/coming/exudyn.md has both scripts",
        estimate=traj.error,
        unit="m",
    )


def test_soft_and_stiff_in_many_digits(case):
    """K = F^T F with stiffnesses from 1e-6 to 1e8, from its factor; the roots with 60 digits."""
    rng = np.random.default_rng(12)
    n = 8
    F = rng.normal(size=(n, n)) * np.sqrt(10.0 ** rng.uniform(-6, 8, n))[:, None]
    M = np.diag(rng.uniform(0.5, 3, n))
    found = mb.modes(mb.MechanicalSystem(M, K=F.T @ F), stiffness_factor=F)
    with mp.workdps(60):
        f = mp.matrix(F.tolist()) * mp.diag([1 / mp.sqrt(x) for x in np.diag(M)])
        known = np.array([float(mp.sqrt(v)) for v in sorted(mp.eigsy(f.T * f, eigvals_only=True))])
    case(
        "eight springs from 1e-6 to 1e8 N/m, by their factor: each frequency over its own size",
        topic="modes",
        kind="high precision",
        ours=found.omega / known,
        known=np.ones(n),
        within=1e-9,
        uncertainty=1e-15,
        source="eigenvalues with 60 digits (mpmath)",
        estimate=found.error,
    )


def test_the_swing(case):
    m = mb.examples.swing()
    traj = mb.simulate(m, t=np.array([0.5, 1, 2, 3, 5]), rtol=1e-11)
    known = [-0.835430375, -2.363025261, -2.081860121, -0.818461015, -0.393332826]
    case(
        "two-body swing, one rod driven: angle of the other at five times",
        topic="motion",
        kind="independent script",
        ours=traj.joint("m") + traj.joint("n"),
        known=known,
        within=1e-8,
        uncertainty=1e-9,
        estimate=traj.error,
        source="docs/theory.md (23.11), by integration with 13 digits",
        unit="rad",
    )


def test_the_gradient_of_the_five_bar(case):
    m, goal = mb.examples.five_bar(), np.array([0.5, -2.0, 0.0])
    objective = mb.Integral(lambda s: np.sum((s.point("P2") - goal) ** 2))
    found = mb.gradient(m, objective, ["spring1.length", "spring2.length"], t=1.0, step=1e-3)
    case(
        "five-bar with two springs: gradient of an integral over 1 s",
        topic="gradients",
        kind="independent script",
        ours=found.gradient,
        known=[-0.62560973, 0.47715465],
        within=1e-5,
        uncertainty=1e-8,
        source="docs/theory.md (23.12)",
    )
