"""Frequency responses of systems whose entries differ by many orders: every point solves the equations written down here."""

import numpy as np
import pytest
import scipy.sparse as sp
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.periodic import harmonic_balance


def graded(rng, n, decades):
    """M, C, K of n oscillators, coupled in pairs, whose stiffnesses spread over so many decades; all numbers invented."""
    size = 10.0 ** (decades * rng.random(n))
    M = np.diag(0.3 + rng.random(n))
    K = np.diag(size)
    for i in range(0, n - 1, 2):
        coupling = 0.3 * rng.random() * np.sqrt(size[i] * size[i + 1])
        K[i, i + 1] = K[i + 1, i] = coupling
    return M, 0.013 * M + 1.7e-3 * K, K


def exact(M, C, K, force, omega):
    return np.array([np.linalg.solve(K - w * w * M + 1j * w * C, force) for w in omega])


@pytest.mark.some(4)
@pytest.mark.parametrize("seed", range(12))
def test_a_linear_system_is_right_in_every_coordinate(seed):
    rng = np.random.default_rng(1700 + seed)
    n = int(rng.integers(1, 6))
    M, C, K = graded(rng, n, 12 * rng.random())
    force = rng.normal(size=n) * np.sqrt(np.diag(K))
    w0 = np.sqrt(K[0, 0] / M[0, 0])
    ends = w0 * np.exp(rng.uniform([-5.0, 0.1], [-0.7, 1.3]))
    for omega in (tuple(ends), tuple(ends[::-1])):
        curve = frequency_response(MechanicalSystem(M, C, K), force=force, omega=omega, harmonics=[1, 3])
        assert curve.status == "converged"
        own = np.array([curve.coefficient(i) for i in range(n)]).T
        right = exact(M, C, K, force, curve.omega)
        largest = np.max(np.abs(right), axis=0)
        # the estimate of rounding: eps times the ratio of the terms that cancel in S to S itself
        cancelled = max(np.linalg.cond(scaled(M, C, K, w)) for w in curve.omega)
        assert np.all(np.abs(own - right) <= (1e-9 + 1e-14 * cancelled) * largest)


def scaled(M, C, K, w):
    d = 1 / np.sqrt(np.abs(np.diag(K)))
    return d[:, None] * (K - w * w * M + 1j * w * C) * d[None, :]


def test_one_oscillator_far_below_its_resonance():
    rng = np.random.default_rng(41)
    for _ in range(6):
        k, m, zeta = np.exp(rng.uniform([-9, -4, -6], [16, 4, -2]))
        w0, c = np.sqrt(k / m), 2 * zeta * np.sqrt(k * m)
        curve = frequency_response(
            MechanicalSystem([[m]], [[c]], [[k]]), force=[0.7 * k], omega=(0.00113 * w0, 0.117 * w0), harmonics=3
        )
        right = 0.7 * k / (k - curve.omega**2 * m + 1j * curve.omega * c)
        assert np.max(np.abs(curve.coefficient(0) / right - 1)) < 1e-12


def balance(system, force, X, omega, n_t=512):
    """Residual (dof, 2H+1) of harmonic balance by sampling, and the sum of its absolute terms by row of the system."""
    h = np.arange((X.shape[1] - 1) // 2 + 1)
    c = X[:, 0::2].astype(complex)
    c[:, 1:] = X[:, 1::2] - 1j * X[:, 2::2]
    tau = 2 * np.pi * np.arange(n_t) / n_t
    x = (c @ np.exp(1j * np.outer(h, tau))).real
    f = sum(np.outer(law.w, np.asarray(law.force(law.w @ x, 0 * tau))) for law in system.elements)
    F = 2 * np.fft.rfft(f, axis=1)[:, : len(h)] / n_t
    F[:, 0] /= 2
    out, sizes = np.zeros_like(c), np.zeros_like(c, float)
    for j in h:
        s = system.K - (j * omega) ** 2 * system.M + 1j * j * omega * system.C
        load = force if j == 1 else 0 * force
        out[:, j] = s @ c[:, j] + F[:, j] - load
        sizes[:, j] = np.abs(s) @ np.abs(c[:, j]) + np.abs(F[:, j]) + np.abs(load)
    return np.abs(out), np.max(sizes, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_hard_spring_beside_stiff_coordinates(seed):
    rng = np.random.default_rng(523 + seed)
    n = 4
    M, C, K = graded(rng, n, 7.0)
    soft = int(np.argmin(np.diag(K)))
    k, m = K[soft, soft], M[soft, soft]
    w = rng.normal(size=n) * (np.arange(n) == soft)
    force = rng.normal(size=n) * 0.05 * np.sqrt(np.diag(K) * k)
    a = force[soft] / k
    system = MechanicalSystem(M, C, K, elements=[Cubic(3.1 * k / a**2 / w[soft] ** 4, w=w)])
    w0 = np.sqrt(k / m)
    for omega in ((0.31 * w0, 2.3 * w0), (2.3 * w0, 0.31 * w0)):
        curve = frequency_response(system, force=force, omega=omega, harmonics=5, condense=False)
        assert len(curve) > 9  # it may leave where it began; wherever it goes, its points are solutions
        for i in range(0, len(curve), 3):
            residual, size = balance(system, force, curve.point(i).X, curve.omega[i])
            assert np.all(residual <= 1e-8 * size[:, None]), (i, residual / size[:, None])


def two_chains(n, ratio):
    """Two uncoupled chains, one so many times stiffer, with a spring to ground in each."""
    one = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1])
    K = sp.block_diag([one, ratio * one]).tocsr()
    M = sp.block_diag([1.3 * sp.identity(n), 0.7 * sp.identity(n)]).tocsr()
    force = np.zeros(2 * n)
    force[n // 3], force[n + n // 2] = 0.011, 0.013 * ratio
    w = np.zeros((2, 2 * n))
    w[0, n // 3], w[1, n + n // 2] = 1.0, -1.0
    elements = [Cubic(1e-13, w=w[0]), Cubic(1e-13 * ratio, w=w[1])]  # present, and too small to be seen
    return MechanicalSystem(M, 0.02 * M + 1e-4 * K, K, elements=elements), force


@pytest.mark.some(1)
@pytest.mark.parametrize("condense", ["sparse", "modal"])
def test_condensed_chains_of_unlike_stiffness(condense):
    n = 17
    system, force = two_chains(n, 1.3e6)
    M, C, K = (A.toarray() for A in (system.M, system.C, system.K))
    for omega in ((0.05, 0.71), (0.71, 0.05)):
        curve = frequency_response(
            system, force=force, omega=omega, harmonics=[1, 3], condense=condense, stability=False
        )
        assert curve.status == "converged" and not curve.events
        right = exact(M, C, K, force, curve.omega)
        own = np.array([curve.coefficient(i) for i in range(2 * n)]).T
        assert np.max(np.abs(own - right) / np.max(np.abs(right), axis=0)) < 1e-8


def test_a_structure_that_is_free_at_rest_is_condensed():
    # one chain is held, the other only by its cubic spring: its condensed stiffness at rest is rounding
    n = 19
    system, force = two_chains(n, 3.7e4)
    K = system.K.tolil()
    K[n, n] -= 3.7e4
    K[2 * n - 1, 2 * n - 1] -= 3.7e4
    K = K.tocsr()
    laws = [system.elements[0], Cubic(0.9e4, w=system.elements[1].w)]
    free = MechanicalSystem(system.M, 0.05 * system.M, K, elements=laws)
    one = harmonic_balance(free, force=force, omega=0.37, harmonics=5, condense="sparse")
    dense = MechanicalSystem(*(A.toarray() for A in (free.M, free.C, free.K)), elements=laws)
    residual, size = balance(dense, force, one.X, 0.37)
    assert np.all(residual <= 1e-9 * size[:, None])


def test_a_list_of_points_on_a_condensed_chain():
    n = 57
    K = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1]).tocsr()
    M, w = sp.identity(n).tocsr(), np.zeros(n)
    w[n // 3] = 1.0
    system = MechanicalSystem(M, 0.03 * M, K, elements=[Cubic(1e-13, w=w)])
    omega = [0.13, 0.29, 0.61, 1.17, 1.71]
    curve = frequency_response(system, force=0.01 * w, omega=omega, harmonics=3)
    right = exact(M.toarray(), 0.03 * M.toarray(), K.toarray(), 0.01 * w, omega)
    assert np.allclose(curve.coefficient(n // 3), right[:, n // 3], rtol=1e-9)
    assert curve.exponents is None or np.nanmax(curve.exponents.real) < 0
