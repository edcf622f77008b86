"""Cases of the verification manual: nonlinear vibration."""

from __future__ import annotations

import mbrs as mb
import mpmath
import numpy as np
from mbrs.examples import duffing, two_tone_duffing
from scipy.integrate import solve_ivp


def test_duffing_against_nlvib(case):
    known = [0.23850991, 0.47487205, 0.75793394, 1.30534547, 0.14391972]
    found = [mb.harmonic_balance(duffing(), force=[0.18], omega=w, harmonics=7) for w in (0.5, 0.8, 0.9, 1.0, 1.5)]
    case(
        "Duffing's oscillator, seven harmonics: amplitude at five frequencies",
        topic="nonlinear",
        kind="other program",
        ours=[one.amplitude() for one in found],
        known=known,
        within=1e-8,
        uncertainty=5e-9,
        source="NLvib, example 01 (Krack and Gross, Springer 2019), computed anew by tests/truth/test_reference_problems.py",
        estimate=[one.error for one in found],
    )


def test_folds_of_duffing(case):
    curve = mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), harmonics=15)
    case(
        "Duffing's oscillator: both folds",
        topic="nonlinear",
        kind="independent script",
        ours=[e.omega for e in curve.events],
        known=[1.26960, 1.11570],
        within=1e-5,
        uncertainty=5e-6,
        source="docs/theory.md (23.5), by shooting with the multiplier one",
        estimate=np.nanmax(curve.error),
        unit="rad/s",
    )


def test_folds_of_the_hard_duffing(case):
    curve = mb.frequency_response(duffing(1.0), force=[0.3], omega=(0.8, 3.0), harmonics=31)
    case(
        "hard Duffing's oscillator: both folds",
        topic="nonlinear",
        kind="independent script",
        ours=[e.omega for e in curve.events],
        known=[2.3996492588, 1.3291743525],
        within=1e-8,
        uncertainty=1e-10,
        source="docs/theory.md (23.6), by shooting",
        estimate=np.nanmax(curve.error),
        unit="rad/s",
    )
    peak = curve.peak(harmonic=None)
    case(
        "hard Duffing's oscillator: largest displacement",
        topic="nonlinear",
        kind="independent script",
        ours=peak.largest(),
        known=2.5645599332,
        within=1e-7,
        uncertainty=1e-10,
        source="docs/theory.md (23.6), by shooting",
        estimate=peak.error,
    )


def test_free_vibration_of_the_undamped_duffing(case):
    """x" + x + x^3 = 0 with the amplitude A: period 4 K(k) / sqrt(1 + A^2), k^2 = A^2 / (2 + 2 A^2)."""
    amplitude = 1.3
    with mpmath.workdps(50):
        a = mpmath.mpf("1.3") ** 2
        period = float(4 * mpmath.ellipk(a / (2 * (1 + a))) / mpmath.sqrt(1 + a))
    speed = np.sqrt(amplitude**2 + amplitude**4 / 2)
    m = mb.Model("hardening")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), velocity=(speed, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=1.0, law=mb.Cubic(1.0))
    traj = mb.simulate(m, t=np.array([0, period / 4, period / 2, period]), rtol=1e-11)
    case(
        "undamped hardening spring: place after parts of its period",
        topic="motion",
        kind="high precision",
        ours=traj.joint("rail"),
        known=[0, amplitude, 0, 0],
        within=1e-7,
        uncertainty=1e-15,
        estimate=traj.error,
        source="period 4 K(k) / sqrt(1 + A^2), k^2 = A^2/(2 + 2 A^2)",
    )


def test_van_der_pol(case):
    for mu, known, options in (
        (1.0, 6.66328686, dict(harmonics=31)),
        (5.0, 11.61223067, dict(harmonics=159)),
        (20.0, 34.68232331, dict(method="collocation")),
    ):
        system = mb.MechanicalSystem([[1.0]], [[-mu]], [[1.0]], elements=[mb.VanDerPol(mu, w=[1.0])])
        found = mb.limit_cycle(system, **options)
        case(
            f"van der Pol's oscillator, mu = {mu:g}: period",
            topic="nonlinear",
            kind="independent script",
            ours=found.period,
            known=known,
            within=3e-8,
            uncertainty=1e-9,
            source="docs/theory.md (23.10), by integration with 13 digits",
            estimate=found.error,
            unit="s",
        )


def test_two_tones(case):
    system = two_tone_duffing()[0]
    known = {
        (1, 0): (-0.0055712601, -0.0832608775),
        (0, 1): (-0.0014475824, -0.0357439837),
        (2, -1): (-0.0003014939, -0.0006886006),
    }
    forces = [dict(force=[-0.25j], omega=2.0), dict(force=[-0.25j], omega=2.0 * np.sqrt(2))]
    found = mb.quasi_periodic(system, forces=forces, harmonics=7)
    ours = [found.coefficient(0, k) for k in known]
    case(
        "Duffing's oscillator under two frequencies: three coefficients",
        topic="nonlinear",
        kind="independent script",
        ours=[[c.real, -c.imag] for c in ours],
        known=list(known.values()),
        within=3e-9,
        uncertainty=1e-9,
        estimate=found.error,
        source="docs/theory.md (23.9), data of the case duffing_ap_qp of CoSTAR",
    )


def test_a_jenkins_element_in_resonance(case):
    """Work of the slider over a cycle, 4 f (X - f/k), against the law itself."""
    k, f, amplitude = 2.3, 0.41, 0.97
    system = mb.MechanicalSystem([[1.0]], [[0.0]], [[1e7]], elements=[mb.Jenkins(k, f, w=[1.0])])
    omega = 0.01
    one = mb.harmonic_balance(system, force=[1e7 * amplitude], omega=omega, harmonics=1, n_samples=8192)
    t = np.linspace(0, 2 * np.pi / omega, 20001)
    x = one.displacement(t)[0]
    force = mb.Jenkins(k, f).force(np.r_[x[:-1], x])[x.size - 1 :]
    work = np.trapezoid(force, x)
    size = np.max(np.abs(x))
    case(
        "spring and slider: energy lost in a cycle",
        topic="nonlinear",
        ours=work,
        known=4 * f * (size - f / k),
        within=1e-5,
        uncertainty=1e-12,
        source="4 f (X - f/k): the hysteresis is a parallelogram",
        unit="J",
    )


def test_parametric_resonance_of_mathieu(case):
    """The strip of order one of x" + 2 z x' + (1 + e cos W t) x = 0, both borders by Floquet's theory with SciPy."""
    depth, zeta = 0.3, 0.02

    def growth(W):
        end = [
            solve_ivp(
                lambda t, s: [s[1], -2 * zeta * s[1] - (1 + depth * np.cos(W * t)) * s[0]],
                (0, 2 * np.pi / W),
                s,
                rtol=1e-12,
                atol=1e-14,
                method="DOP853",
            ).y[:, -1]
            for s in ((1, 0), (0, 1))
        ]
        return np.max(np.abs(np.linalg.eigvals(np.array(end).T))) - 1

    borders = []
    for a, b in ((1.6, 2.0), (2.4, 2.0)):
        for _ in range(34):
            middle = (a + b) / 2
            a, b = (a, middle) if growth(middle) > 0 else (middle, b)
        borders.append(b)
    system = mb.MechanicalSystem([[1.0]], [[2 * zeta]], [[1.0]], elements=[mb.VaryingStiffness(depth, w=[1.0])])
    curve = mb.frequency_response(system, force=[0.0], omega=(1.5, 2.5), harmonics=5, max_step=0.07)
    case(
        "damped Mathieu equation: borders of parametric resonance",
        topic="nonlinear",
        kind="independent script",
        ours=sorted(e.omega for e in curve.events),
        known=borders,
        within=1e-5,
        uncertainty=1e-9,
        source="Floquet multipliers by DOP853",
        unit="rad/s",
    )


def test_a_linear_system_is_balanced_exactly(case):
    rng = np.random.default_rng(4)
    A = rng.normal(size=(4, 4))
    M, K = A @ A.T + 4 * np.eye(4), 50 * np.eye(4) + (A + A.T) * 3
    C = 0.1 * K + 0.02 * M
    f = rng.normal(size=4)
    one = mb.harmonic_balance(mb.MechanicalSystem(M, C, K), force=f, omega=2.7, harmonics=3)
    known = np.linalg.solve(K - 2.7**2 * M + 2.7j * C, f)
    case(
        "linear system of four coordinates by harmonic balance",
        topic="nonlinear",
        ours=one.X[:, 1] - 1j * one.X[:, 2],
        known=known,
        within=1e-10,
        uncertainty=1e-14,
        source="(K - w^2 M + i w C)^-1 f",
        estimate=one.error,
    )
