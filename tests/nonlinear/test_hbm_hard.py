"""Hard cases of nonlinear vibration; each prints the error that was measured (pytest -s)."""

import warnings

import numpy as np
import pytest
import scipy.sparse as sp
from mbrs.errors import ConvergenceError, MbrsWarning, ModelError
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.function_law import FunctionLaw
from mbrs.model.laws import Cubic, Gap, Jenkins
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.periodic import harmonic_balance
from mbrs.nonlinear.quasi_periodic import quasi_periodic
from mbrs.reference import hbm_balance, hbm_shooting


def oscillator(*elements, m=1.0, c=0.05, k=1.0):
    return MechanicalSystem([[m]], [[c]], [[k]], elements=elements)


def tell(what, **errors):
    print(f"{what}: " + ", ".join(f"{name.replace('_', ' ')} {value:.1e}" for name, value in errors.items()))


def by_reference(system, force, omega, X, n_samples=64):
    """The reference's solution from that of the core."""
    terms = range(1, (X.shape[1] - 1) // 2 + 1)
    return hbm_balance.harmonic_balance(system, force, omega, terms, n_samples, X)


def test_damping_ratio_of_a_millionth():
    system = oscillator(Cubic(1e-3, w=[1.0]), c=2e-6)
    curve = frequency_response(system, force=[2e-7], omega=(0.9999, 1.0001), harmonics=3)
    assert curve.status == "converged" and [e.kind for e in curve.events] == ["fold", "fold"]
    peak = curve.peak()
    # energy: c omega a = F at resonance; backbone: omega^2 = 1 + 3/4 k3 a^2 at first order
    off = peak.amplitude() * 2e-6 * peak.omega / 2e-7 - 1
    backbone = peak.omega - np.sqrt(1 + 0.75e-3 * peak.amplitude() ** 2)
    reference = np.max(np.abs(by_reference(system, [2e-7], peak.omega, peak.X) - peak.X)) / peak.amplitude()
    tell("damping ratio 1e-6", amplitude=abs(off), backbone=abs(backbone), reference=reference)
    assert abs(off) < 1e-5 and abs(backbone) < 1e-9 and reference < 1e-5


def test_contact_ten_thousand_times_stiffer():
    system = oscillator(Gap(1e4, 1.0, w=[1.0]))
    one = harmonic_balance(system, force=[0.5], omega=0.9, harmonics=40)
    fine = harmonic_balance(system, force=[0.5], omega=0.9, harmonics=160, n_samples=16384, x0=one)
    t = np.linspace(0, one.period, 2000)
    off = np.max(np.abs(one.displacement(t) - fine.displacement(t))) / np.max(np.abs(one.X))
    tell("contact of 1e4 times the stiffness, H = 40", true=off, estimated=one.error, integrated_with_160=fine.verify())
    assert np.max(one.displacement(t)) > 1.0  # it does touch
    assert one.n_samples > 512  # that many would hold two instants of the contact
    # the motion is unstable, which makes of its error fifty times as much within a period
    assert 0.01 < off / one.error < 10 and fine.error < one.error / 5 and fine.verify() < 100 * fine.error


@pytest.mark.parametrize(
    ("ratio", "bilateral", "force", "span"),
    [
        (100.0, True, 0.1, (0.3, 2.0)),
        (100.0, False, 0.1, (2.0, 0.3)),
        (1000.0, True, 0.5, (0.3, 2.0)),
        (1000.0, True, 0.045, (2.0, 0.3)),
    ],
)
def test_grazing_contact_is_passed(ratio, bilateral, force, span):
    # at 512 samples the equations have corners where single samples come into contact, and branches stalled there
    system = oscillator(Gap(ratio, 1.0, bilateral=bilateral, w=[1.0]), c=0.04)
    curve = frequency_response(system, force=[force], omega=span, harmonics=7, stability=False)
    grazing = int(np.argmax(curve.amplitude() > 0.99))
    free = np.abs(force / (1 - curve.omega[:grazing] ** 2 + 0.04j * curve.omega[:grazing]))
    off = np.max(np.abs(curve.amplitude()[:grazing] / free - 1))
    one = curve.point(-1)
    tell(f"stop {ratio:g} times stiffer, {len(curve)} points, {curve.status}", before_contact=off, at_the_end=one.error)
    assert curve.status in ("converged", "left-at-start", "unresolved") and grazing > 3 and off < 1e-9
    assert len(curve) < 300


@pytest.mark.slow
def test_stick_slip_through_full_stick():
    system = oscillator(Jenkins(0.5, 0.2, w=[1.0]), c=0.02)
    curve = frequency_response(system, force=[0.05], omega=(0.6, 1.6), harmonics=5)
    assert curve.status == "converged"
    stuck = 0.05 / np.abs(1.5 - curve.omega**2 + 0.02j * curve.omega)
    slipping = curve.amplitude(harmonic=None) > 0.999 * 0.2 / 0.5
    assert slipping.any() and not slipping[0] and not slipping[-1]
    linear = np.max(np.abs(curve.amplitude()[~slipping] / stuck[~slipping] - 1))
    top = curve.point(int(np.argmax(curve.amplitude())))
    off = top.verify()
    tell("stick-slip through full stick", stuck=linear, slipping_integrated=off, slipping_estimated=top.error)
    assert linear < 1e-9 and 0.01 < off / top.error < 10


def test_imperfect_pitchfork():
    # the symmetric motion of a hardening spring with one well loses its symmetry; an imperfection of 1e-6 of the force unfolds it
    def follow(imperfection):
        system = oscillator(Cubic(1.0, w=[1.0]), c=0.1, k=-0.2)
        force = {0: [imperfection], 1: [1.0]}
        return frequency_response(
            system, force=force, omega=2.0, level=(3.0, 0.5), harmonics=5, stability=False, max_step=0.05
        )

    plus, minus = follow(1e-6), follow(-1e-6)
    assert plus.status in ("converged", "left-at-start")
    assert not [event for event in plus.events if event.kind == "branch-point"]
    bent = np.max(np.abs(plus.X[:, 0, 0]))
    assert bent > 0.1  # it follows the bend and does not jump over it
    # the mirror image x(t + T/2) -> -x of one is a solution of the other
    i = int(np.argmax(np.abs(plus.X[:, 0, 0])))
    mirrored = -plus.X[i] * np.array([1, -1, -1, 1, 1, -1, -1, 1, 1, -1, -1])
    force = {0: [-1e-6], 1: [plus.level[i]]}
    system = oscillator(Cubic(1.0, w=[1.0]), c=0.1, k=-0.2)
    R, _, _ = hbm_balance.residual(system, mirrored.T.ravel(), force, 2.0, range(1, 6), 32)
    tell("imperfect pitchfork, imperfection 1e-6", mirrored_residual=np.max(np.abs(R)))
    assert np.max(np.abs(R)) < 1e-8 and len(minus) > 10


def test_255_harmonics():
    system = oscillator(Cubic(0.1, w=[1.0]))
    many = harmonic_balance(system, force=[0.18], omega=0.9, harmonics=255)
    few = harmonic_balance(system, force=[0.18], omega=0.9, harmonics=31)
    off = np.max(np.abs(many.X[:, :63] - few.X)) + np.max(np.abs(many.X[:, 63:]))
    # docs/theory.md (23.5): 0.75793394
    tell("H = 255", difference_from_31=off, integrated=many.verify(rtol=1e-12))
    assert off < 1e-12 and many.amplitude() == pytest.approx(0.75793394, abs=5e-9)


def internal_resonance():
    """Modes at 1 and 3.05 rad/s that a cubic spring couples; invented numbers."""
    shapes = np.array([[0.8, -0.6], [0.6, 0.8]])
    K = shapes @ np.diag([1.0, 3.05**2]) @ shapes.T
    return MechanicalSystem(np.eye(2), 0.01 * np.eye(2), K, elements=[Cubic(1.0, w=[1.0, 0.0])])


def test_internal_resonance_with_neimark_sacker_pair():
    system, force = internal_resonance(), [0.1, 0.0]
    curve = frequency_response(system, force=force, omega=(0.9, 1.3), harmonics=11)
    pair = [event for event in curve.events if event.kind == "neimark-sacker"]
    assert curve.status == "converged" and len(pair) == 2
    off = []
    for event in pair:
        one = harmonic_balance(system, force=force, omega=event.omega, harmonics=21, x0=event.X)
        state = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
        _, phi = hbm_shooting.shoot(system, force, event.omega, state)
        mu = np.linalg.eigvals(phi)
        crossing = mu[np.argmin(np.abs(mu - np.exp(event.exponent * one.period)))]
        off.append(abs(abs(crossing) - 1))
        assert abs(crossing.imag) > 1e-3
    tell("1:3 resonance, Neimark-Sacker pair", multipliers_by_shooting=max(off))
    assert max(off) < 1e-5
    between = (curve.omega > pair[0].omega) & (curve.omega < pair[1].omega)
    assert not np.any(np.asarray(curve.stable, bool)[between])


@pytest.mark.some(1)
@pytest.mark.parametrize("detuning", [0.1, 0.2])
def test_close_events_do_not_hide_each_other(detuning):
    # steps that contain a fold and a Neimark-Sacker point find what small steps find one by one
    shapes = np.array([[0.8, -0.6], [0.6, 0.8]])
    K = shapes @ np.diag([1.0, (3 + detuning) ** 2]) @ shapes.T
    system = MechanicalSystem(np.eye(2), 0.01 * np.eye(2), K, elements=[Cubic(1.0, w=[1.0, 0.0])])
    given = dict(force=[0.1, 0.0], omega=(1.03, 1.16), harmonics=5)
    coarse, fine = (frequency_response(system, max_step=s, **given) for s in (0.1, 0.02))
    found = [sorted((e.kind, e.omega) for e in curve.events) for curve in (coarse, fine)]
    assert [kind for kind, _ in found[0]] == [kind for kind, _ in found[1]], found
    off = max(abs(a - b) for (_, a), (_, b) in zip(*found, strict=True))
    tell(f"detuning {detuning}, {len(coarse)} and {len(fine)} points, {len(found[0])} events", difference=off)
    assert off < 1e-8 and sum(kind == "neimark-sacker" for kind, _ in found[0]) == 2


def test_zero_force():
    one = harmonic_balance(oscillator(Cubic(0.1, w=[1.0])), force=[0.0], omega=1.0, harmonics="auto")
    assert not one.X.any() and one.error == 0 and one.status == "converged"
    curve = frequency_response(oscillator(Cubic(0.1, w=[1.0])), force=[0.0], omega=(0.5, 1.5))
    tell("zero force", amplitude=np.max(np.abs(curve.X)))
    assert curve.status == "converged" and not curve.X.any() and not curve.events and curve.stable.all()


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9])
def test_forces_in_scaled_units(scale):
    # x = scale z is the same motion in another unit of force and length
    curve = frequency_response(oscillator(Cubic(0.1 / scale**2, w=[1.0])), force=[0.18 * scale], omega=(0.5, 1.6))
    plain = frequency_response(oscillator(Cubic(0.1, w=[1.0])), force=[0.18], omega=(0.5, 1.6))
    folds = [[e.omega for e in c.events] for c in (curve, plain)]
    off = np.max(np.abs(np.subtract(*folds)))
    peak = abs(curve.peak().amplitude() / scale / plain.peak().amplitude() - 1)
    tell(f"force of {0.18 * scale:.0e}", folds=off, peak=peak)
    assert off < 1e-9 and peak < 1e-9 and len(curve) == len(plain)


def not_a_number(t, u, v):
    return np.where(np.abs(u) > 0.5, np.nan, 0.1 * u**3)


def test_law_that_returns_nan():
    system = oscillator(FunctionLaw(not_a_number, lambda t, u, v: (0.3 * u**2, 0 * u), w=[1.0]))
    with pytest.raises(ConvergenceError, match=r"elements\[0\].*not finite"):
        harmonic_balance(system, force=[0.18], omega=0.9)
    # a branch that runs into it ends there with what it has
    curve = frequency_response(system, force=[0.18], omega=(0.5, 1.6), n_samples=32, stability=False)
    largest = np.max(np.abs(curve.amplitude(harmonic=None)))
    tell("law that returns nan", distance_to_the_edge=0.5 - largest)
    assert "elements[0]" in curve.reason and "not finite" in str(curve)
    assert curve.status == "stopped" and 0.45 < largest < 0.51 and np.all(np.isfinite(curve.X))


def test_two_frequencies_of_ratio_1_0001():
    system = oscillator(Cubic(0.5, w=[1.0]), c=0.3)
    forces = [dict(force=[0.1], omega=1.6), dict(force=[0.1], omega=1.6 * 1.0001)]
    with pytest.warns(MbrsWarning, match="almost commensurable"):
        one = quasi_periodic(system, forces, harmonics=11)
    # over one slow beat the motion is a periodic one with a slowly changing force: compare at instants of the beat
    off = []
    for slow in np.linspace(0, 2 * np.pi, 9):
        t = slow / (1.6e-4)
        force = [0.1 + 0.1 * np.exp(1j * slow)]
        now = harmonic_balance(system, force=force, omega=1.6, harmonics=11)
        phase = 1.6 * t
        series = now.displacement(phase / 1.6 + np.linspace(0, now.period, 50))
        off.append(np.max(np.abs(one.displacement(t + np.linspace(0, now.period, 50)) - series)))
    size = np.max(np.abs(one.X))
    tell("frequencies of ratio 1.0001", against_slow_beat=max(off) / size, estimated=one.error)
    assert one.status == "converged" and max(off) / size < max(10 * one.error, 1e-3)
    with pytest.raises(ModelError, match="commensurable"):
        quasi_periodic(system, [dict(force=[0.1], omega=1.6), dict(force=[0.1], omega=3.2)], harmonics=5)


def test_free_free_structure_condensed():
    n = 40
    K = sp.diags([np.r_[1.0, 2 * np.ones(n - 2), 1.0], -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]).tocsc()
    M = sp.identity(n, format="csc")
    C = 0.02 * M + 0.01 * K
    w = np.zeros(n)
    w[0], w[-1] = 1.0, -1.0
    force = np.zeros(n)
    force[5] = 0.3
    off = []
    for element in (Cubic(0.5, w=w), Cubic(0.5, w=np.eye(n)[3] - np.eye(n)[4])):
        free = MechanicalSystem(M, C, K, elements=[element])
        loads = {0: np.eye(n)[7] - np.eye(n)[20], 1: force}  # in balance
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # rest position is free: one grounded spring far softer than everything fixes it for both
            held = MechanicalSystem(M, C, K + sp.csc_matrix(([1e-3], ([0], [0])), (n, n)), elements=[element])
            whole, part = (
                harmonic_balance(held, force=loads, omega=0.3, harmonics=5, condense=c) for c in (False, True)
            )
        off.append(np.max(np.abs(whole.X - part.X)) / np.max(np.abs(whole.X)))
        moving = [harmonic_balance(free, force={1: force}, omega=0.3, harmonics=[1, 3, 5], condense=True)]
        assert np.all(np.isfinite(moving[0].X))
    tell("free-free chain, condensed with its rigid motion", against_full=max(off))
    assert max(off) < 1e-10
