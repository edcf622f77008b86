"""What cannot be had is said, and what is had is kept."""

import re
from time import perf_counter

import numpy as np
import pytest
from mbrs.errors import ConvergenceError, ModelError, SingularError
from mbrs.examples import van_der_pol
from mbrs.linear.matrices import MechanicalSystem
from mbrs.linear.response import response
from mbrs.model.laws import CoulombTanh, Cubic, Gap, VanDerPol, VaryingStiffness
from mbrs.nonlinear import balance
from mbrs.nonlinear.branch import Branch
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.limit_cycle import limit_cycle
from mbrs.nonlinear.periodic import harmonic_balance


@pytest.mark.parametrize("law", [Gap(1.0, 1.0, w=[1.0, 0.0]), Cubic(0.7, w=[0.3, -1.0])])
def test_a_conservative_system_has_no_limit_cycle(law):
    system = MechanicalSystem(np.diag([1.3, 0.8]), None, [[2.0, -1], [-1, 2]], elements=[law])
    with pytest.raises(ConvergenceError, match="families"):
        limit_cycle(system)


@pytest.mark.parametrize("law", [Gap(1.0, 1.0, w=[1.0, 0.0]), Cubic(0.7, w=[0.3, -1.0])])
@pytest.mark.parametrize("harmonics", [7, "auto"])
def test_a_free_vibration_that_goes_to_rest_is_refused(law, harmonics):
    system = MechanicalSystem(np.diag([1.3, 0.8]), None, [[2.0, -1], [-1, 2]], elements=[law])
    guess = np.zeros((2, 15))
    guess[:, 1] = 1.7, 0.9
    with pytest.raises(ConvergenceError, match=r"went to rest.*backbone") as caught:
        harmonic_balance(system, force=[0.0, 0.0], omega=1.37, harmonics=harmonics, x0=guess)
    assert caught.value.result.status == "stopped" and np.abs(caught.value.result.X).max() < 1e-6
    # a force, damping, or rest from rest are no free vibration
    assert harmonic_balance(system, force=[0.1, 0.0], omega=1.37, x0=guess).status == "converged"
    damped = MechanicalSystem(system.M, 0.1 * np.eye(2), system.K, elements=[law])
    assert harmonic_balance(damped, force=[0.0, 0.0], omega=1.37, x0=guess).status == "converged"
    assert harmonic_balance(system, force=[0.0, 0.0], omega=1.37).status == "converged"


@pytest.mark.slow
def test_a_first_point_among_hard_stops_is_found_or_refused():
    """Between two stops a thousand times as stiff as the spring the motion at low frequencies is no few harmonics, or chaos."""
    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[Gap(1e3, 1.0, bilateral=True, w=[1.0])])
    found = {}
    for omega in (0.2, 0.3, 0.5, 0.8):
        try:
            found[omega] = harmonic_balance(system, force=[2.0], omega=omega, harmonics=list(range(1, 32, 2)))
        except ConvergenceError as reason:
            # the remedy is a number of harmonics where the motion in time repeats itself
            assert re.search(r"take harmonics=\d+|start nearer \(x0=\)", str(reason))
            assert reason.result.status == "stopped"
    assert 0.5 in found and 0.8 in found
    for omega, one in found.items():
        # what is called converged is: the largest displacement is that of the motion in time, within the estimate
        assert one.verify() < 10 * max(one.error, 1e-3), omega


def test_a_cycle_is_kept_when_only_its_stability_fails(monkeypatch):
    def fails(self, y, omega, error, free):
        raise SingularError("the eigenvalues for stability did not converge")

    monkeypatch.setattr(balance.Setup, "exponents", fails)
    cycle = limit_cycle(van_der_pol(), harmonics=21)
    assert cycle.exponents is None and cycle.stable is None
    assert abs(cycle.period - 6.6632868593) < 1e-6


def test_a_failed_collocation_is_no_result(monkeypatch):
    import scipy.integrate

    solve = scipy.integrate.solve_bvp

    def fails(*args, **kwargs):
        out = solve(*args, **kwargs)
        out.success, out.message = False, "the mesh is full"
        return out

    monkeypatch.setattr(scipy.integrate, "solve_bvp", fails)
    with pytest.raises(ConvergenceError, match="the mesh is full"):
        limit_cycle(van_der_pol(), method="collocation")


def test_a_linear_response_refuses_nonlinear_elements():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Cubic(100.0, w=[1.0])])
    with pytest.raises(ModelError, match="harmonic_balance"):
        response(system, np.linspace(0, 10, 11), {0: np.cos}, 0)


def test_a_solution_has_its_multipliers():
    # Meissner-like: Hill's equation by the product of small exact steps
    k, depth, c, omega = 1.7, 0.5, 0.06, 2.2
    system = MechanicalSystem([[1.0]], [[c]], [[k]], elements=[VaryingStiffness(depth, w=[1.0])])
    one = harmonic_balance(system, force=[0.1], omega=omega, harmonics=7)
    from scipy.linalg import expm

    n = 4000
    h, phi = 2 * np.pi / omega / n, np.eye(2)
    for i in range(n):
        phi = expm(h * np.array([[0, 1], [-k - depth * np.cos(omega * (i + 0.5) * h), -c]])) @ phi
    right = np.sort_complex(np.linalg.eigvals(phi))
    assert np.allclose(np.sort_complex(one.multipliers), right, atol=1e-6)


def test_a_switched_branch_makes_a_curve():
    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[VaryingStiffness(0.4, w=[1.0]), Cubic(0.3, w=[1.0])])
    branch = Branch(system, force=[0.0], omega=(1.5, 2.6), harmonics=3)
    branch.run(400)
    doublings = [e for e in branch.events if e.kind == "period-doubling"]
    assert len(doublings) == 2
    other = branch.switch(doublings[0])
    other.run(12)
    curve = other.curve()
    assert len(curve) == 12 and np.max(curve.amplitude(0, 1)) > 1e-3
    assert curve.events == other.events
    assert all(e.kind for e in curve.events)


def test_the_largest_displacement_by_many_harmonics():
    rng = np.random.default_rng(5)
    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]])
    one = harmonic_balance(system, force=[1.0], omega=0.7, harmonics=3)
    H = 150
    X = rng.normal(size=(1, 2 * H + 1)) / (1 + np.arange(2 * H + 1)) ** 1.1
    object.__setattr__(one, "X", X)
    t = np.linspace(0, one.period, 9001)
    dense = np.max(np.abs(one.displacement(t)))
    assert dense <= one.largest(0) * (1 + 1e-12) and one.largest(0) < 1.003 * dense


def test_the_work_of_the_largest_displacement_grows_like_the_harmonics(monkeypatch):
    """Numbers that are transformed and exponentials that are formed, counted: linear in the harmonics but for the logarithm."""
    one = harmonic_balance(MechanicalSystem([[1.0]], [[0.1]], [[1.0]]), force=[1.0], omega=0.7, harmonics=3)
    work = []
    exp, irfft = np.exp, np.fft.irfft
    monkeypatch.setattr(np, "exp", lambda x, *a, **k: work.append(np.size(x)) or exp(x, *a, **k))
    monkeypatch.setattr(np.fft, "irfft", lambda x, n, *a, **k: work.append(n) or irfft(x, n, *a, **k))
    found = []
    for H in (353, 1411):
        work.clear()
        object.__setattr__(one, "X", np.random.default_rng(H).normal(size=(1, 2 * H + 1)) / (1 + np.arange(2 * H + 1)))
        one.largest(0)
        found.append(sum(work))
    print(found)
    assert found[0] > 0 and found[1] < 4.1 * found[0] and found[1] < 50 * 1411


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(2))
def test_searches_among_friction_and_self_excitation_end(seed):
    """Five coordinates, smoothed friction and a van der Pol element in random directions: seconds, not minutes."""
    rng = np.random.default_rng(seed)
    n = 5
    M, K = np.diag(rng.uniform(0.5, 2, n)), np.diag(rng.uniform(5, 40, n))
    K -= np.diag(rng.uniform(1, 2, n - 1), 1)
    K = np.triu(K) + np.triu(K, 1).T
    friction = CoulombTanh(rng.uniform(0.1, 1), rng.uniform(1e-3, 1e-2), w=rng.normal(size=n))
    elements = [friction, VanDerPol(rng.uniform(0.1, 1), w=rng.normal(size=n))]
    begin = perf_counter()
    system = MechanicalSystem(M, 0.02 * M + 1e-3 * K, K, elements=elements)
    curve = frequency_response(system, force=rng.normal(size=n), omega=(1, 8), max_points=5)
    assert curve.status == "max-points" and len(curve) == 5
    cycle = limit_cycle(MechanicalSystem(M, 1e-3 * K - 0.48 * M, K, elements=elements))
    assert cycle.status in ("converged", "unresolved") and perf_counter() - begin < 30
