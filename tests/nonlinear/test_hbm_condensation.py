"""Exact condensation onto the coordinates that elements touch: every route against the full equations and the
reference."""

import numpy as np
import pytest
import scipy.sparse as sp
from mbrs.errors import ModelError
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic, Jenkins, VanDerPol
from mbrs.nonlinear import balance
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.options import Fourier
from mbrs.nonlinear.periodic import harmonic_balance
from oracles import hbm_condensation


def unit(n, *entries):
    w = np.zeros(n)
    for i, value in entries:
        w[i] = value
    return w


def chain_matrices(n, free=False):
    K = sp.diags([np.full(n, 2.0), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]).tolil()
    K[n - 1, n - 1] = 1.0
    if free:
        K[0, 0] = 1.0
    return sp.identity(n, format="csc"), K.tocsc()


def chain(n, elements, *, kind="proportional", free=False):
    M, K = chain_matrices(n, free)
    C = 0.01 * K + (0 if free else 0.002) * M
    G = None
    if kind == "dashpot":  # not diagonalised by the modes
        C = C + sp.csc_matrix(([0.3], ([n // 4], [n // 4])), shape=(n, n))
    if kind == "gyroscopic":
        G = sp.csc_matrix(([0.2, -0.2], ([1, 2], [2, 1])), shape=(n, n))
    return MechanicalSystem(M, C, K, G=G, elements=elements)


def force(n):
    f = np.zeros(n, complex)
    f[0], f[n // 2] = 0.3, 0.1 - 0.05j
    return {0: unit(n, (2, 0.02)), 1: f, 2: unit(n, (3, 0.05))}


N = 30
ELEMENTS = (Cubic(0.5, w=unit(N, (N - 1, 1.0))), VanDerPol(0.1, w=unit(N, (9, 1.0), (10, -1.0))))
DENSE = tuple(Cubic(0.5, w=np.cos(np.arange(N) + i)) for i in range(2))


@pytest.mark.parametrize(
    ("kind", "elements", "condense", "route"),
    [
        ("proportional", ELEMENTS, "modal", "condensed, modal"),
        ("proportional", ELEMENTS, True, "condensed, banded"),
        ("dashpot", ELEMENTS, True, "condensed, banded"),
        ("gyroscopic", ELEMENTS, True, "condensed, banded"),
        ("dashpot", DENSE, True, "condensed, turned"),
        ("gyroscopic", DENSE, True, "condensed, turned"),
    ],
)
def test_condensed_equals_full(kind, elements, condense, route):
    system = chain(N, elements, kind=kind)
    given = dict(force=force(N), omega=0.31, harmonics=5)
    a = harmonic_balance(system, condense=condense, **given)
    b = harmonic_balance(system, condense=False, **given)
    assert a.stats.route == route and b.stats.route == "full"
    print(route, kind, "difference", np.max(np.abs(a.X - b.X)))
    assert np.max(np.abs(a.X - b.X)) < 1e-10 * np.max(np.abs(b.X))
    # both estimates are relative to the largest coefficient of what is solved for
    assert 1e-12 < b.error / 10 < a.error < 10 * b.error


def test_condensed_equals_reference():
    system = chain(N, ELEMENTS, kind="dashpot")
    one = harmonic_balance(system, force=force(N), omega=0.31, harmonics=5, condense=True)
    kept = np.array([9, 10, N - 1])
    reference = hbm_condensation.solve(system, force(N), 0.31, range(1, 6), one.n_samples, kept, one.X[kept] + 1e-4)
    assert np.max(np.abs(one.X[kept] - reference)) < 1e-10


@pytest.mark.parametrize(
    ("kind", "elements", "condense"),
    [
        ("proportional", ELEMENTS, "modal"),
        ("dashpot", ELEMENTS, True),
        ("gyroscopic", ELEMENTS, True),
        ("gyroscopic", DENSE, True),
    ],
)
def test_slope_by_frequency(kind, elements, condense):
    setup = balance.prepare(chain(N, elements, kind=kind), force(N), Fourier(3, condense=condense))
    y = np.sin(np.arange(float(setup.core.size)))
    h = 1e-6
    high, low = (setup.core.residual(y, [0.4 + d])["residual"] for d in (h, -h))
    slope = setup.core.residual(y, [0.4])["slope"]
    assert np.max(np.abs(slope - (high - low) / (2 * h))) < 1e-6 * np.max(np.abs(slope))


def test_free_free_structure_keeps_its_rigid_motion():
    # two elements hold the chain at one end in the nonlinear terms only: K is singular, and so is K without the last
    # coordinate's row
    n = 20
    M, K = chain_matrices(n, free=True)
    K2, M2 = sp.block_diag([K, K]).tocsc(), sp.block_diag([M, M]).tocsc()
    ground = [Cubic(1.0, w=unit(2 * n, (0, 1.0))), Cubic(2.0, w=unit(2 * n, (0, 1.0), (2 * n - 1, -1.0)))]
    system = MechanicalSystem(M2, 0.02 * K2 + 0.01 * M2, K2, elements=ground)
    f = {0: unit(2 * n, (n + 3, 0.01)), 1: unit(2 * n, (4, 0.2), (n, 0.1))}
    guess = 0.3 * np.cos(np.arange(6.0 * n)).reshape(2 * n, 3)  # the default, at rest, is singular
    b = harmonic_balance(system, force=f, omega=0.15, harmonics=5, x0=guess, condense=False)
    a = harmonic_balance(system, force=f, omega=0.15, harmonics=5, x0=b, condense=True)
    assert np.max(np.abs(a.X - b.X)) < 1e-9 * np.max(np.abs(b.X))
    # the second chain is touched at one end only; with both left free it still has a rigid motion to keep
    loose = MechanicalSystem(
        M2, 0.02 * K2 + 0.01 * M2, K2 + 0.05 * sp.diags(unit(2 * n, (n, 1.0))), elements=ground[:1]
    )
    sparse = balance.prepare(loose, {1: f[1]}, Fourier(3, condense=True))
    assert sparse.route.startswith("condensed") and sparse.linear.core.size == 1
    free = MechanicalSystem(M2, 0.02 * K2 + 0.01 * M2, K2, elements=ground[:1])
    kept = balance.prepare(free, {1: f[1]}, Fourier(3, condense=True))
    assert kept.linear.core.size == 2  # one coordinate of the second, free chain joined the one that is touched


def test_sparse_route_keeps_free_coordinates_too():
    n = 20
    M, K = chain_matrices(n, free=True)
    K2, M2 = sp.block_diag([K, K]).tocsc(), sp.block_diag([M, M]).tocsc()
    C2 = 0.02 * K2 + sp.diags(unit(2 * n, (5, 0.1)))
    system = MechanicalSystem(M2, C2, K2, elements=[Cubic(1.0, w=unit(2 * n, (0, 1.0)))])
    setup = balance.prepare(system, {1: unit(2 * n, (3, 0.1))}, Fourier(3, condense=True))
    assert setup.route == "condensed, banded" and setup.linear.core.size == 2


def test_frequency_response_of_a_condensed_chain():
    n = 10
    system = chain(n, [Cubic(0.5, w=unit(n, (n - 1, 1.0)))])
    given = dict(force={1: unit(n, (0, 0.002))}, omega=(0.1, 0.25), harmonics=3, stability=False)
    a = frequency_response(system, condense=True, **given)
    b = frequency_response(system, condense=False, **given)
    assert a.status == b.status == "converged" and a.stats.route == "condensed, modal"
    assert a.X.shape[1:] == (n, 7)
    folds = [event.omega for event in b.events]
    assert len(folds) >= 2 and [event.omega for event in a.events] == pytest.approx(folds, abs=1e-9)
    assert a.peak(n - 1).amplitude(n - 1) == pytest.approx(b.peak(n - 1).amplitude(n - 1), rel=1e-9)
    point = a.point(len(a) // 2)
    assert point.verify() < 1e-2
    assert a.stats.counts["factorisations"] > 0


def test_stability_of_a_condensed_chain_equals_that_of_the_full_one():
    n = 8
    system = chain(n, [Cubic(0.5, w=unit(n, (n - 1, 1.0))), VanDerPol(-0.2, w=unit(n, (3, 1.0)))], kind="dashpot")
    given = dict(force={1: unit(n, (0, 0.02))}, omega=[0.15, 0.17], harmonics=3)
    a = frequency_response(system, condense=True, **given)
    b = frequency_response(system, condense=False, **given)
    assert a.stats.route == "condensed, banded" and a.exponents.shape == (2, 2 * n)
    for i in range(2):
        period = 2 * np.pi / a.omega[i]
        mu = [np.sort_complex(np.round(np.exp(c.exponents[i] * period), 9)) for c in (a, b)]
        assert np.max(np.abs(mu[0] - mu[1])) < 1e-7


def test_work_does_not_depend_on_the_number_of_harmonics_that_stay():
    # one solution at one frequency: H + 1 dynamic stiffnesses, whatever the number of iterations
    one = harmonic_balance(chain(N, ELEMENTS), force=force(N), omega=0.31, harmonics=5, condense=True)
    assert one.stats.counts["iterations"] > 2 and one.stats.counts["factorisations"] == 6


@pytest.mark.parametrize("law", [Cubic(0.5), Jenkins(0.5, 0.01)], ids=repr)
def test_a_thousand_masses(law):
    n = 1000
    element = type(law)(*law.values, w=unit(n, (n - 1, 1.0)))
    system = chain(n, [element])
    response = frequency_response(
        system, force=unit(n, (0, 0.01)), omega=(0.0012, 0.003), harmonics=7, stability=False, events=False
    )
    assert response.status == "converged" and response.stats.route == "condensed, banded"
    print(
        f"{n} masses, {law!r}: {response.stats.wall_time / len(response) * 1e3:.2f} ms per point", response.stats.counts
    )


@pytest.mark.slow
def test_a_hundred_thousand_masses():
    n = 100_000
    system = chain(n, [Cubic(0.5, w=unit(n, (n - 1, 1.0)))])
    one = harmonic_balance(system, force=unit(n, (n - 50, 0.1)), omega=0.3, harmonics=3)
    assert one.status == "converged" and one.stats.route == "condensed, banded" and one.X.shape == (n, 7)
    M, C, K = system.M, system.C, system.K
    x = one.X[:, 1] - 1j * one.X[:, 2]
    cubic = 0.5 * one.displacement(np.linspace(0, one.period, 64, endpoint=False))[-1] ** 3
    f = unit(n, (n - 50, 0.1)).astype(complex)
    f[-1] -= 2 * np.mean(cubic * np.exp(-1j * 2 * np.pi * np.arange(64) / 64))
    residual = K @ x - 0.09 * (M @ x) + 0.3j * (C @ x) - f
    assert np.max(np.abs(residual)) < 1e-10


@pytest.mark.parametrize(
    ("changes", "text"),
    [(dict(condense="yes"), "True, False"), (dict(condense=False), "unknowns in dense matrices")],
)
def test_bad_input(changes, text):
    n = 1000
    with pytest.raises(ModelError, match=text):
        harmonic_balance(chain(n, [Cubic(0.5, w=unit(n, (0, 1.0)))]), force=np.zeros(n), omega=1.0, **changes)


def test_routes_can_be_chosen_and_agree():
    system = chain(N, ELEMENTS)
    given = dict(force=force(N), omega=0.31, harmonics=5)
    modal, sparse, full = (harmonic_balance(system, condense=c, **given) for c in ("modal", "sparse", False))
    assert [a.stats.route for a in (modal, sparse, full)] == ["condensed, modal", "condensed, banded", "full"]
    size = np.max(np.abs(full.X))
    assert max(np.max(np.abs(a.X - full.X)) for a in (modal, sparse)) < 1e-10 * size
    with pytest.raises(ModelError, match="does not couple"):
        harmonic_balance(chain(N, ELEMENTS, kind="gyroscopic"), condense="modal", **given)


def grid(side):
    """Masses on a square, each coupled with its neighbours, a spring at the middle: a wide band, sparse factors."""
    line = sp.diags([np.full(side, 2.0), -np.ones(side - 1), -np.ones(side - 1)], [0, 1, -1])
    K = (sp.kron(line, sp.identity(side)) + sp.kron(sp.identity(side), line)).tocsc()
    n = side**2
    M = sp.identity(n, format="csc")
    return MechanicalSystem(M, 0.01 * K, K, elements=[Cubic(0.5, w=unit(n, (n // 2 + side // 2, 1.0)))])


@pytest.mark.parametrize(
    ("system", "route"),
    [
        (chain(50, [Cubic(0.5, w=unit(50, (49, 1.0)))]), "condensed, modal"),
        (chain(300, [Cubic(0.5, w=unit(300, (299, 1.0)))]), "condensed, banded"),
        (chain(50, [Cubic(0.5, w=unit(50, (49, 1.0)))], kind="gyroscopic"), "condensed, banded"),
        (grid(14), "condensed, modal"),
        (grid(40), "condensed, sparse"),
    ],
)
def test_the_route_is_chosen_by_its_whole_cost(system, route):
    """Modes of a short chain or a small grid pay, of a long chain they do not, and those of a large grid would not fit."""
    setup = balance.prepare(system, {1: 0.01 * np.ones(system.n)}, Fourier(5))
    assert setup.route == route


def long_chain(n, law):
    """Grounded at one end, its first mode near 1 rad/s, a law at the free end."""
    k = (2 * n / np.pi) ** 2
    K = sp.diags([np.r_[2 * np.ones(n - 1), 1.0] * k, -k * np.ones(n - 1), -k * np.ones(n - 1)], [0, 1, -1]).tocsc()
    M = sp.identity(n, format="csc")
    w = np.eye(n)[-1]
    return MechanicalSystem(M, 0.05 * M + 0.01 * K, K, elements=[law(w)]), 0.05 * n * w


def test_stability_of_a_large_system_by_a_reduced_model():
    system, force = long_chain(30, lambda w: Cubic(1.5, w=w))
    curve = frequency_response(system, force=force, omega=(0.9, 1.2), harmonics=5)
    kinds = [event.kind for event in curve.events]
    assert curve.exponents.shape[1] < 60 and kinds == ["fold", "fold"]  # 60 would be the whole system
    off = 0.0
    for i in range(0, len(curve), 8):
        whole = balance.prepare(system, force, Fourier(5, condense=False), float(curve.omega[i]))
        exact = whole.core.floquet(whole.start(curve.X[i]), [float(curve.omega[i])])["exponents"]
        slowest = np.sort(exact.real)[-2:]
        own = np.sort(curve.exponents[i].real[np.isfinite(curve.exponents[i].real)])[-2:]
        off = max(off, float(np.max(np.abs(slowest - own))))
        assert bool(curve.stable[i]) == bool(np.all(exact.real <= 0))
    print(f"slowest two exponents of the reduced model: largest difference {off:.1e}")
    assert off < 1e-6


def test_a_reduced_model_whose_stiffness_is_off_by_a_thousandth_tells_nothing():
    """The whole chain with a spring too much at the coordinate of the law, over the dynamic stiffness there: it tells the stability
    by its own exponents, or not at all."""
    omega = 1.05
    system, force = long_chain(30, lambda w: Cubic(1.5, w=w))
    one = balance.prepare(system, force, Fourier(1, condense=True))
    (at,) = one.linear.core.retained
    order = np.r_[at, np.delete(np.arange(30), at)]
    M, C, K = (np.ascontiguousarray(A.toarray()[np.ix_(order, order)]) for A in (system.M, system.C, system.K))
    halves = [half * omega / 2 for half in range(5)]
    least = min(abs(1.0 / np.linalg.inv(K - w * w * M + 1j * w * C)[0, 0]) for w in halves)

    def slowest(part):
        spring = np.zeros_like(K)
        spring[0, 0] = part * least
        found = one.core.floquet(np.zeros(one.core.size), [omega], model=(M, C, K + spring))["exponents"]
        assert len(found) == 60
        return found[np.argsort(np.abs(found))][:2].imag.max()

    assert abs(slowest(3e-3) / slowest(0.0) - 1) < 1e-9 < 1e-6 < abs(slowest(3e-4) / slowest(0.0) - 1)


def test_stability_of_a_thousand_masses_is_told():
    system, force = long_chain(1000, lambda w: Cubic(50.0, w=w))
    curve = frequency_response(system, force=force, omega=(1.0, 1.15), harmonics=5, max_step=0.2)
    assert [event.kind for event in curve.events] == ["fold", "fold"] and curve.status == "converged"
    stable = np.asarray(curve.stable, bool)
    between = slice(curve.events[0].index, curve.events[1].index)
    assert not stable[between].any() and stable[: between.start].all() and stable[between.stop :].all()


def test_stability_is_not_claimed_without_a_model():
    # every coordinate of 100 carries a law: nothing to condense and no model of fewer coordinates
    n = 100
    system, force = long_chain(n, lambda w: Cubic(1.0, w=w))
    laws = [Cubic(0.01, w=row) for row in np.eye(n)[:97]]
    many = MechanicalSystem(system.M, system.C, system.K, elements=laws)
    one = balance.prepare(many, force, Fourier(1, condense=True))
    assert one.model(1.0) is None and one.exponents(np.zeros(one.core.size), 1.0, 0.0) == (None, True)


@pytest.mark.some(1)
@pytest.mark.parametrize("law", [lambda w: Cubic(5.0, w=w), lambda w: Jenkins(10.0, 5.0, w=w)])
def test_large_systems_are_verified_in_time(law):
    system, force = long_chain(100, law)
    one = harmonic_balance(system, force=force, omega=1.1, harmonics=7)
    off = one.verify()
    print(f"chain of 100: estimated {one.error:.1e}, integrated {off:.1e}")
    assert 0.1 < off / one.error < 10
