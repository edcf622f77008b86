"""Forces given as functions of time in harmonic balance: against their series, closed forms and SciPy."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError
from mbrs.nonlinear.sampled_force import harmonics_of
from scipy.integrate import solve_ivp

M, C, K = np.diag([1.3, 0.7]), np.array([[0.21, -0.07], [-0.07, 0.13]]), np.array([[3.1, -1.2], [-1.2, 2.3]])


def system(k3=0.4):
    return mb.MechanicalSystem(M, C, K, elements=[mb.Cubic(k3, w=[1.0, -1.0])])


def test_the_series_of_a_function_is_its_closed_form():
    """exp(cos x) has the coefficients 2 I_h(1), and the mean I_0(1)."""
    from scipy.special import iv

    omega = 1.37
    found = harmonics_of(lambda t: [np.exp(np.cos(omega * t)), np.sin(3 * omega * t)], np.ones(2), omega)
    for h, f in found.items():
        assert abs(f[0] - (2 if h else 1) * iv(h, 1.0)) < 1e-14
        assert abs(f[1] - (-1j if h == 3 else 0)) < 1e-13
    assert max(found) >= 12


def test_a_function_is_its_harmonics():
    omega = 0.83
    series = {0: [0.1, 0.0], 1: [0.3 - 0.2j, 0.1], 3: [0.0, 0.05j]}

    def force(t):
        return sum(np.real(np.asarray(f) * np.exp(1j * h * omega * t)) for h, f in series.items())

    a = mb.harmonic_balance(system(), force=series, omega=omega, harmonics=9)
    b = mb.harmonic_balance(system(), force=force, omega=omega, harmonics=9)
    assert np.max(np.abs(a.X - b.X)) < 1e-10 and abs(a.error - b.error) < 1e-9 and b.verify() < 1e-5


@pytest.mark.slow
def test_a_square_wave_says_what_its_cut_costs():
    """The distance from the motion integrated by SciPy stays within the stated error, and shrinks with harmonics."""
    omega = 0.9
    period = 2 * np.pi / omega
    square = lambda t: np.array([0.5 * np.sign(np.sin(omega * t) + 1e-300), 0.0])  # noqa: E731

    def slope(t, y):
        u = y[0] - y[1]
        f = (
            np.array([0.5 if (t / period) % 1 < 0.5 else -0.5, 0.0])
            - C @ y[2:]
            - K @ y[:2]
            - 0.4 * u**3 * np.array([1, -1])
        )
        return [*y[2:], *(f / np.diag(M))]

    y = np.zeros(4)
    for j in range(160):
        y = solve_ivp(
            slope, (0.5 * j * period, 0.5 * (j + 1) * period), y, rtol=1e-9, atol=1e-11, max_step=period / 30
        ).y[:, -1]
    off = []
    for top in (3, 9, 21):
        one = mb.harmonic_balance(system(), force=square, omega=omega, harmonics=top)
        distance = np.max(np.abs(one.displacement(0.0)[:, 0] - y[:2])) / np.max(np.abs(one.X))
        assert distance < one.error + 1e-6
        off.append(one.error)
    assert off[2] < off[1] < off[0]
    fine = mb.harmonic_balance(system(), force=square, omega=omega, harmonics="auto", tol=3e-3)
    assert fine.status == "converged" and fine.error <= 3e-3


def test_ports_of_a_model_take_a_function():
    m = mb.Model("slider")
    b = m.body("b", mass=1.3, inertia=(1, 1, 1))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=(0.36, -0.48, 0.8), k=2.1, c=0.3, law=mb.Cubic(1.7))
    omega = 1.1
    wave = lambda t: 0.3 * np.cos(omega * t) + 0.1 * np.sin(2 * omega * t)  # noqa: E731
    a = mb.harmonic_balance(m, inputs="b.force.z", amplitude=wave, omega=omega, harmonics=9)
    given = {1: np.array([0.3 * 0.8]), 2: np.array([-0.1j * 0.8])}
    reference = mb.MechanicalSystem([[1.3]], [[0.3]], [[2.1]], elements=[mb.Cubic(1.7, w=[1.0])])
    b = mb.harmonic_balance(reference, force=given, omega=omega, harmonics=9)
    assert np.max(np.abs(np.abs(a.X) - np.abs(b.X))) < 1e-9


@pytest.mark.parametrize(
    ("force", "what"),
    [
        (lambda t: [np.sin(1.7 * t), 0.0], "does not repeat"),
        (lambda t: np.sin(t), "shape"),
        (lambda t: [np.nan, 0.0], "finite"),
        (lambda t: ["a", 0.0], "failed"),
    ],
)
def test_wrong_functions_are_named(force, what):
    with pytest.raises(ModelError, match=f"force.*{what}"):
        mb.harmonic_balance(system(), force=force, omega=1.0)
    with pytest.raises(ModelError, match="harmonic_balance"):
        mb.frequency_response(system(), force=force, omega=(0.5, 1.0))


@pytest.mark.parametrize("seed", range(3))
def test_units_of_coordinates_do_not_decide(seed):
    """x = S y with one coordinate in other units: the same error, the same number of harmonics, the same refusals."""
    rng = np.random.default_rng(seed)
    omega, wave = rng.uniform(0.4, 0.8), rng.uniform(5, 20)
    root = rng.normal(size=(2, 2))
    stiffness, mass = np.diag([2.0, 40.0]) + 0.02 * (root + root.T), np.diag(rng.uniform(0.5, 2.0, 2))
    phases = rng.uniform(0, 2 * np.pi, 9)

    def answers(S):
        law = mb.Cubic(0.3, w=S @ [1.0, 0.0])
        s = mb.MechanicalSystem(S @ mass @ S, 0.02 * S @ stiffness @ S, S @ stiffness @ S, elements=[law])
        tones = lambda t: wave * sum(np.cos(h * omega * t + p) / h for h, p in enumerate(phases, 1))  # noqa: E731
        force = lambda t: S @ [0.5 * np.cos(omega * t), tones(t)]  # noqa: E731
        one = mb.harmonic_balance(s, force=force, omega=omega, harmonics=4, tol=1e-3)
        fine = mb.harmonic_balance(s, force=force, omega=omega, harmonics="auto", tol=1e-3)
        with pytest.raises(ModelError, match="does not repeat"):
            mb.harmonic_balance(s, force=lambda t: S @ [0.5 * np.cos(omega * t), np.cos(1.3 * omega * t)], omega=omega)
        return one.error, fine.error, fine.harmonics[-1]

    given = answers(np.eye(2))
    for i, power in (
        (0, rng.uniform(4, 11)),
        (0, -rng.uniform(4, 11)),
        (1, rng.uniform(4, 11)),
        (1, -rng.uniform(4, 11)),
    ):
        S = np.eye(2)
        S[i, i] = 10.0**power
        error, fine, top = answers(S)
        assert top == given[2]
        assert error == pytest.approx(given[0], rel=1e-6) and fine == pytest.approx(given[1], rel=1e-6)
