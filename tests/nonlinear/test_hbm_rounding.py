"""Finely divided structures, of which rounding leaves little after condensation: right, or refused."""

import mbrs as mb
import mpmath as mp
import numpy as np
import pytest
import scipy.sparse as sp
from mbrs import _core
from mbrs.errors import SingularError
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic
from mbrs.nonlinear import balance
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.periodic import harmonic_balance
from problems import hinged_beam

DAMPING = 0.02
slow = pytest.mark.slow


def beam(elements, law=1e-9):
    """Euler beam on hinges, length pi, bending stiffness and mass per length 1, a spring and a force at its middle."""
    problem = hinged_beam(elements, np.pi / elements)
    (M, K), middle = problem.model, problem.notes["middle"]
    w, force = np.zeros(K.shape[0]), np.zeros(K.shape[0])
    w[middle], force[middle] = 1.0, 0.02
    return MechanicalSystem(M, DAMPING * M, K, elements=[Cubic(law, w=w)]), force, middle


def exactly(omega):
    """Motion of the middle of the continuous beam, by all its modes sqrt(2/pi) sin(j x)."""
    j = np.arange(1, 4001, 2)
    return 0.02 * np.sum(2 / np.pi / (j**4 - omega**2 + 1j * DAMPING * omega))


@pytest.mark.parametrize("elements", [100, 500, 1500, 5000])
def test_a_hinged_beam_is_that_of_the_closed_form(elements):
    system, force, middle = beam(elements)
    off = []
    for omega in (0.9, 1.05, 3.0):
        one = harmonic_balance(system, force=force, omega=omega, harmonics=1)
        off.append(abs(one.coefficient(middle) / exactly(omega) - 1))
    print(f"beam of {elements} elements ({one.stats.route}): error {max(off):.1e}")
    assert max(off) < 30 / elements**2 + 2e-7  # elements of lumped mass: second order


def by_elements(elements, omega):
    """The same of the divided beam: displacements A sin(j x) and slopes B cos(j x) of its nodes solve two equations for each j."""
    h = np.pi / elements
    j = np.arange(1, elements, 2)
    inertia = -(omega**2) + 1j * DAMPING * omega
    own = 48 * np.sin(j * h / 2) ** 2 / h**3 + inertia * h
    slope = (8 + 4 * np.cos(j * h)) / h + inertia * h**3 / 12
    return 0.02 * np.sum(2 / elements / (own - (12 * np.sin(j * h) / h**2) ** 2 / slope))


@pytest.mark.parametrize("elements", [500, 1500])
def test_rounding_of_a_divided_beam_leaves_six_digits(elements):
    system, force, middle = beam(elements)
    off = []
    for omega in (0.9, 1.05, 3.0):
        one = harmonic_balance(system, force=force, omega=omega, harmonics=1)
        off.append(abs(one.coefficient(middle) / by_elements(elements, omega) - 1))
    print(f"beam of {elements} elements: error {max(off):.1e}")
    assert max(off) < 1e-6


def of_the_given_numbers(system, force, place, omega):
    """One coordinate of (K - w^2 M + i w C) x = f by elimination in 50 digits; the band is three wide."""
    mp.mp.dps = 50
    w, band = mp.mpf(omega), range(1, 4)
    M, C, K = (a.tolil() for a in (system.M, system.C, system.K))
    n = len(force)
    z = lambda i, j: mp.mpf(K[i, j]) - w * w * mp.mpf(M[i, j]) + 1j * w * mp.mpf(C[i, j])  # noqa: E731
    rows = [{j: z(i, j) for j in range(max(0, i - 3), min(n, i + 4))} for i in range(n)]
    right = [mp.mpf(f) for f in force]
    for k in range(n):
        for i in (k + d for d in band if k + d < n):
            part = rows[i][k] / rows[k][k]
            for j in (k + d for d in band if k + d < n):
                rows[i][j] = rows[i].get(j, 0) - part * rows[k][j]
            right[i] -= part * right[k]
    x = [mp.mpc(0)] * n
    for i in reversed(range(n)):
        x[i] = (right[i] - sum(rows[i][i + d] * x[i + d] for d in band if i + d < n)) / rows[i][i]
    return complex(x[place])


@pytest.mark.parametrize("elements", [10, 20, 40, 100, pytest.param(300, marks=slow), pytest.param(1500, marks=slow)])
def test_the_stated_error_holds_what_rounding_leaves(elements):
    """By all routes: all coordinates (10), modes (20, 40), bands, bands that are refined (1500)."""
    system, force, middle = beam(elements, law=1e-30)
    ratios = []
    for omega in (0.9, 1.05, 3.0):
        one = harmonic_balance(system, force=force, omega=omega, harmonics=1)
        true = abs(one.coefficient(middle) / of_the_given_numbers(system, force, middle, omega) - 1)
        ratios.append(max(true, 1e-16) / one.error)
    print(
        f"beam of {elements} elements ({one.stats.route}): true over stated error {min(ratios):.1e} to {max(ratios):.1e}"
    )
    assert min(ratios) > 1e-3 and max(ratios) < 3


@slow
def test_transfer_functions_of_a_sparse_beam_keep_all_digits():
    """800 coordinates, of whose stiffness 1e-13 resists at the middle: 3e-6 were lost, 4e-7 were stated."""
    system, force, middle = beam(400, law=1e-30)
    omega = np.array([0.9, 1.05, 3.0])
    h = mb.frf(mb.MechanicalSystem(system.M, system.C, system.K), middle, middle, omega=omega)
    known = [of_the_given_numbers(system, force, middle, w) / force[middle] for w in omega]
    off = np.abs(h.value[0, 0] / known - 1).max()
    print(f"{h.stats.route}: error {off:.1e}, stated {h.error:.1e}")
    assert h.stats.route == "sparse direct" and off < 4e-16 and h.error < 1e-15


def row_of_masses(n):
    """Masses of 1 between walls, the lowest natural frequency 1, damping .01 of both kinds, a spring and a force at the middle."""
    stiffness = 1.0 / (4 * np.sin(np.pi / (2 * (n + 1))) ** 2)
    K = stiffness * sp.diags([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1], format="csc")
    M, w = sp.identity(n, format="csc"), np.zeros(n)
    w[n // 2] = 1.0
    stiff = (n + 1) / 2
    return MechanicalSystem(M, 0.01 * (M + K), K, elements=[Cubic(2e-4 * stiff, w=w)]), 0.02 * stiff * w


def condensed(n, omega):
    """Dynamic stiffness that the middle of the row feels, in closed form (hyperbolic sines of the wave number)."""
    mp.mp.dps = 40
    spring = mp.mpf(float(1.0 / (4 * np.sin(np.pi / (2 * (n + 1))) ** 2))) * (1 + 0.01j * mp.mpf(omega))
    own = 2 * spring - mp.mpf(omega) ** 2 + 0.01j * mp.mpf(omega)
    number = mp.acosh(own / (2 * spring))
    part = lambda m: mp.sinh((m + 1) * number) / mp.sinh(number)  # noqa: E731
    return complex(spring * part(n) / (part(n // 2) * part(n - n // 2 - 1)))


@slow
def test_a_row_of_which_rounding_leaves_six_digits_is_followed():
    """Its curve stopped after four points: steps of Newton's method stay at 1e-7, which is what rounding makes of the equations."""
    n = 100_000
    system, force = row_of_masses(n)
    branch = mb.Branch(system, force=force, omega=(0.8, 1.3), harmonics=1, stability=False)
    assert branch.run(12) == 12
    curve = branch.curve()
    for i, omega in enumerate(curve.omega):
        x = curve.point(i).coefficient(n // 2)
        push = 0.75 * 2e-4 * (n + 1) / 2 * abs(x) ** 2 * x
        miss = abs(condensed(n, omega) * x + push - force[n // 2]) / force[n // 2]
        print(f"{omega:.5f} rad/s: residual in the closed form {miss:.1e}, stated error {curve.error[i]:.1e}")
        assert miss < 3 * curve.error[i] and curve.error[i] < 1e-5


@slow
def test_a_fine_beam_is_followed_without_stalling():
    few, force, middle = beam(100, law=0.2)
    many, fine_force, fine_middle = beam(5000, law=0.2)
    a = frequency_response(few, force=force, omega=(0.8, 1.3), harmonics=3, stability=False)
    b = frequency_response(many, force=fine_force, omega=(0.8, 1.3), harmonics=3, stability=False)
    assert a.status == b.status == "converged"
    at_the_end = abs(b.point(-1).coefficient(fine_middle) / a.point(-1).coefficient(middle) - 1)
    each = b.stats.counts["corrections"] / len(b)
    print(f"5000 against 100 elements: {at_the_end:.1e}; {each:.1f} corrections per point")
    assert at_the_end < 1e-3 and each < 6


@slow
def test_a_beam_divided_too_finely_is_refused():
    system, force, _ = beam(60_000)
    with pytest.raises(SingularError, match="too finely"):
        harmonic_balance(system, force=force, omega=1.05, harmonics=1)


def test_the_core_refuses_what_would_not_fit_into_memory():
    linear = _core.HbmLinear.full(mb.MechanicalSystem([[1.0]], [[1.0]], [[1.0]]).core, np.zeros((2, 1), complex))
    elements = balance.core_elements([Cubic(1.0, w=[1.0])], [np.array([1.0])])
    for dims, indices, text in (
        ([10**6, 10**6], [[1, 0]], "fewer samples"),
        ([2**40], [[1]], "fewer samples"),
        ([2**17], [[h] for h in range(1, 40_000)], "fewer harmonics"),
    ):
        omega = [1.0] * len(dims)
        with pytest.raises(_core.CoreModelError, match=text):
            _core.HbmProblem(linear, elements, indices, 1, omega, dims, [], dims)
