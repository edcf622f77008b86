"""Limit cycles: van der Pol's periods (docs/theory.md (23.10)), shooting, and relaxation oscillations that must not look
resolved."""

import pickle

import numpy as np
import pytest
from mbrs.errors import ConvergenceError, ModelError
from mbrs.examples import van_der_pol
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic, Gap, Jenkins, Polynomial1D, VanDerPol
from mbrs.nonlinear import cycle_start
from mbrs.nonlinear.limit_cycle import limit_cycle
from mbrs.reference import hbm_shooting

PERIODS = {1: 6.66328686, 5: 11.61223067, 20: 34.68232331}  # docs/theory.md (23.10)


@pytest.mark.some(1)
@pytest.mark.parametrize(("mu", "harmonics"), [(1, 31), (5, 159)])
def test_period_by_harmonic_balance(mu, harmonics):
    found = limit_cycle(van_der_pol(float(mu)), harmonics=harmonics)
    state = np.array([found.displacement(0.0)[0, 0], found.velocity(0.0)[0, 0]])
    _, period, _ = hbm_shooting.cycle(van_der_pol(float(mu)), {}, state, found.period)
    print(f"mu = {mu}, H = {harmonics}: period differs from shooting by {found.period - period:.1e}")
    assert found.period == pytest.approx(PERIODS[mu], abs=6e-9)
    assert found.period == pytest.approx(period, rel=1e-10)
    assert found.status == "converged" and found.error < 1e-7
    assert found.stable and np.min(np.abs(found.exponents)) < 1e-6
    other = found.exponents[np.argmax(np.abs(found.exponents))]
    # Liouville: the mean trace of the variational equation
    x = found.displacement(np.linspace(0, found.period, 4000, endpoint=False))[0]
    assert other.real == pytest.approx(np.mean(mu * (1 - x**2)), rel=1e-6)


def test_relaxation_oscillation_does_not_look_resolved():
    # with H = 15 the equations of mu = 20 converge cleanly to a period that is 58 % wrong
    found = limit_cycle(van_der_pol(20), harmonics=15)
    assert abs(found.period / PERIODS[20] - 1) > 0.5
    assert found.status == "unresolved" and found.error > 0.1


def test_relaxation_oscillation_by_collocation():
    found = limit_cycle(van_der_pol(20), method="collocation")
    print("mu = 20 by collocation: period off by", found.period - PERIODS[20], "estimated", found.error)
    assert found.period == pytest.approx(PERIODS[20], abs=1e-6) and found.status == "converged"
    assert found.stats.route == "collocation" and abs(found.displacement(0.0)).max() < 2.1


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "period"), [(50, 82.5083338932324), (100, 162.837071092372), (200, 323.916041832336)])
def test_relaxation_oscillations_that_shooting_knows(mu, period):
    # periods: x' = mu (y - x^3/3 + x), y' = -x/mu by SciPy's Radau with rtol 1e-11 and 1e-12, which differ in the 14th digit
    found = limit_cycle(van_der_pol(float(mu)), method="collocation", harmonics=63)
    assert found.period == pytest.approx(period, rel=5e-9) and found.status == "converged"


def test_more_harmonics_until_resolved():
    found = limit_cycle(van_der_pol(2), harmonics="auto", tol=1e-8)
    assert found.error <= 1e-8 and found.status == "converged"
    assert found.verify() < 1e-6


def test_flutter_with_a_cubic_spring():
    system = MechanicalSystem(
        np.eye(2),
        0.02 * np.eye(2),
        [[1.0, 0.0], [0.0, 1.2]],
        N=[[0.0, 0.3], [-0.3, 0.0]],
        elements=[Cubic(0.5, w=[1.0, 0.0]), Cubic(0.2, w=[0.0, 1.0]), VanDerPol(0.1, w=[1.0, 0.0])],
    )
    found = limit_cycle(system, harmonics=15)
    state = np.concatenate([found.displacement(0.0)[:, 0], found.velocity(0.0)[:, 0]])
    _, period, phi = hbm_shooting.cycle(system, {}, state, found.period)
    assert found.period == pytest.approx(period, rel=1e-9) and found.error < 1e-7
    multipliers = np.sort(np.abs(np.exp(found.exponents * found.period)))
    assert multipliers == pytest.approx(np.sort(np.abs(np.linalg.eigvals(phi))), abs=1e-5)


@pytest.mark.some(4)
@pytest.mark.parametrize("law", ["spring", "damper", "friction"])
@pytest.mark.parametrize("seed", range(6))
def test_flutter_needs_no_motion_in_time(seed, law, monkeypatch):
    """Two to four freedoms in coordinates of mixed units: one harmonic of a mode that bends with its amplitude is near enough."""
    evaluations = []

    def counted(rate):
        evaluations.append(rate)
        raise AssertionError("a motion in time was begun")

    monkeypatch.setattr(cycle_start, "Bounded", counted)
    rng = np.random.default_rng(seed)
    n = 2 + seed % 3
    S, directions = np.diag(np.exp(rng.uniform(-3, 3, n))), rng.normal(size=(n, n))
    K = np.diag(rng.uniform(1.0, 1.2, n))
    N = 0.3 * np.triu(np.ones((n, n)), 1) * rng.choice([-1, 1])
    made = {
        "spring": lambda w: Cubic(1.0, w=w),
        "damper": lambda w: VanDerPol(0.4, w=w),
        "friction": lambda w: Polynomial1D([0.0, 0.0, 0.0, 0.1], [0.0, 0.0, 0.0, 0.3], w=w),
    }[law]
    elements = [made(S @ w) for w in directions]
    system = MechanicalSystem(S @ S, 0.02 * S @ S, S @ K @ S, N=S @ (N - N.T) @ S, elements=elements)
    found = limit_cycle(system, harmonics=9)
    print(f"{law} {seed}: {found.status}, {found.stats.counts}, error {found.error:.1e}, stable {found.stable}")
    assert found.status == "converged" and not evaluations
    assert found.stats.counts["evaluations"] <= 12
    state = np.concatenate([found.displacement(0.0)[:, 0], found.velocity(0.0)[:, 0]])
    _, period, _ = hbm_shooting.cycle(system, {}, state, found.period)
    assert found.period == pytest.approx(period, rel=max(1e-9, 10 * found.error))


def test_static_load_shifts_the_cycle():
    found = limit_cycle(van_der_pol(0.5), force={0: [0.3]}, harmonics=15)
    assert found.status == "converged" and abs(found.X[0, 0]) > 0.05
    assert found.verify() < 1e-5


def test_given_start():
    found = limit_cycle(van_der_pol(1), x0=[[0.0, 2.0, 0.0]], omega=1.0, harmonics=31)
    assert found.period == pytest.approx(PERIODS[1], abs=6e-9)
    again = limit_cycle(van_der_pol(1), x0=found, omega=found.omega, harmonics=31)
    assert again.period == pytest.approx(found.period, rel=1e-12)


def test_reads_and_pickles():
    found = limit_cycle(van_der_pol(1))
    assert "LimitCycle: converged" in str(found)
    assert pickle.loads(pickle.dumps(found)).period == found.period


def test_no_cycle_is_an_error():
    with pytest.raises(ConvergenceError, match="no limit cycle"):
        limit_cycle(MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[Cubic(1.0, w=[1.0])]))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (dict(force={1: [1.0]}), "static forces alone"),
        (dict(harmonics=0), "at least 1"),
        (dict(harmonics="all"), '"auto"'),
        (dict(method="magic"), "no method"),
        (dict(x0=[[0.0, 2.0, 0.0]]), "omega"),
        (dict(tol=-1.0), "tol must be"),
    ],
)
def test_bad_input(changes, text):
    with pytest.raises(ModelError, match=text):
        limit_cycle(van_der_pol(1), **changes)


def test_stop_limits_an_unstable_oscillator():
    # negative damping between two stops with losses: a nonsmooth cycle found by integration or by energy balance
    system = MechanicalSystem(
        [[1.0]],
        [[-0.05]],
        [[1.0]],
        elements=[Gap(5.0, 1.0, smoothing=0.05, bilateral=True, w=[1.0]), VanDerPol(0.05, w=[1.0])],
    )
    found = limit_cycle(system, harmonics=31)
    assert found.status == "converged" and found.verify() < 1e-3


def test_a_slider_limits_an_unstable_oscillator():
    # a law with memory: the slider takes out what the negative damping puts in
    system = MechanicalSystem([[1.0]], [[-0.1]], [[1.0]], elements=[Jenkins(0.5, 0.2, w=[1.0])])
    found = limit_cycle(system, harmonics=5)
    off = found.verify()
    print(f"Jenkins cycle: period {found.period:.8f}, estimated {found.error:.1e}, integrated {off.balanced:.1e}")
    assert found.status == "converged" and 0.01 < off.balanced / found.error < 100 and found.error < 1e-3
