"""Quasi-periodic response: coefficients of docs/theory.md (23.9), the NumPy reference, integration in time, near-commensurable
input."""

import pickle
import warnings
from math import comb

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import MbrsWarning, ModelError
from mbrs.examples import duffing, two_tone_duffing
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import CoulombTanh, Cubic, Jenkins, VanDerPol
from mbrs.nonlinear.quasi_periodic import quasi_periodic
from mbrs.nonlinear.quasi_periodic_curves import quasi_periodic_response
from mbrs.nonlinear.torus import diamond
from mbrs.reference import hbm_balance


def pair(eta, f=0.25):
    return [dict(force=[-1j * f], omega=eta), dict(force=[-1j * f], omega=eta * np.sqrt(2))]


@pytest.mark.parametrize(("p", "m"), [(2, 3), (2, 5), (2, 7), (3, 4)])
def test_number_of_terms(p, m):
    # docs/theory.md (12.2): (sum_i 2^i C(p, i) C(m, i) - 1) / 2
    k = diamond(p, m)
    assert len(k) == (sum(2**i * comb(p, i) * comb(m, i) for i in range(p + 1)) - 1) // 2
    assert len(np.unique(np.vstack([k, -k]), axis=0)) == 2 * len(k)


# docs/theory.md (23.9), m = 7, (cos, sin) pairs with 10 decimals
PRINTED = {
    2.0: {
        (1, 0): (-0.0055712601, -0.0832608775),
        (0, 1): (-0.0014475824, -0.0357439837),
        (2, -1): (-0.0003014939, -0.0006886006),
    },
    1.5: {
        (1, 0): (-0.0261221620, -0.2067112787),
        (0, 1): (-0.0045260166, -0.0731946175),
        (2, -1): (-0.0006733389, 0.0102917316),
    },
}


@pytest.mark.parametrize("eta", PRINTED)
def test_printed_coefficients(eta):
    found = quasi_periodic(two_tone_duffing()[0], pair(eta), harmonics=7)
    assert found.X.shape == (1, 113) and found.indices.shape == (56, 2)
    for k, (cos, sin) in PRINTED[eta].items():
        c = found.coefficient(0, k)
        assert (c.real, -c.imag) == pytest.approx((cos, sin), abs=6e-11)
        minus = found.coefficient(0, (-k[0], -k[1]))
        assert minus == np.conj(c)


@pytest.mark.some(2)
@pytest.mark.parametrize(
    ("eta", "m", "printed"), [(2.0, 7, 4e-9), (1.5, 7, 2.5e-5), (1.5, 9, 8e-7), (1.5, 11, 1.1e-7), (1.5, 13, 1.4e-9)]
)
def test_truncation_error_is_estimated(eta, m, printed):
    # docs/theory.md (23.9) lists these truncation errors, relative to the largest displacement
    found = quasi_periodic(two_tone_duffing()[0], pair(eta), harmonics=m)
    fine = quasi_periodic(two_tone_duffing()[0], pair(eta), harmonics=m + 8, x0=found)
    t = np.linspace(0, 500, 5000)
    true = np.max(np.abs(found.displacement(t) - fine.displacement(t)))
    size = np.max(np.hypot(found.X[0, 1::2], found.X[0, 2::2]))
    print(f"eta = {eta}, m = {m}: error {true:.1e}, estimated {found.error * size:.1e}, printed {printed:.1e}")
    assert 0.2 < true / (found.error * size) < 2
    assert 0.5 < true / np.max(np.abs(fine.displacement(t))) / printed < 2


def test_integration_in_time():
    assert quasi_periodic(two_tone_duffing()[0], pair(2.0), harmonics=13).verify() < 2e-8
    assert 1e-7 < quasi_periodic(two_tone_duffing()[0], pair(1.5), harmonics=7).verify() < 1e-3


def two_masses():
    return MechanicalSystem(
        [[1.0, 0.1], [0.1, 2.0]],
        [[0.2, -0.02], [-0.02, 0.15]],
        [[2.0, -1.0], [-1.0, 3.0]],
        G=[[0.0, 0.3], [-0.3, 0.0]],
        elements=[Cubic(0.5, w=[1.0, -1.0]), VanDerPol(0.3, w=[0.0, 1.0])],
    )


@pytest.mark.parametrize("p", [2, 3])
def test_core_equals_reference(p):
    forces = [
        dict(force=[0.4, 0.1 - 0.2j], omega=1.3),
        dict(force=[0.0, 0.3], omega=0.5 * np.sqrt(3)),
        dict(force=[0.2j, 0.0], omega=np.pi),
    ][:p]
    found = quasi_periodic(two_masses(), forces, harmonics=3, static=[0.1, 0.0])
    terms = np.zeros((len(found.indices) + 1, 2), complex)
    terms[0] = [0.1, 0.0]
    for i, source in enumerate(forces):
        terms[1 + np.flatnonzero((found.indices == np.eye(p, dtype=int)[i]).all(axis=1))[0]] = source["force"]
    reference = hbm_balance.quasi_periodic(
        two_masses(), terms, found.omega, found.indices, found.n_samples, found.X + 1e-4
    )
    assert np.max(np.abs(found.X - reference)) < 1e-10


def test_condensed_equals_full():
    n = 12
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    w = np.zeros(n)
    w[5] = 1.0
    system = MechanicalSystem(np.eye(n), 0.05 * K, K, elements=[Cubic(1.0, w=w)])
    f = np.zeros(n)
    f[0] = 0.3
    forces = [dict(force=f, omega=0.6), dict(force=f, omega=0.6 * np.sqrt(2))]
    a = quasi_periodic(system, forces, harmonics=3, condense=True)
    b = quasi_periodic(system, forces, harmonics=3, condense=False)
    assert a.stats.route == "condensed, modal" and np.max(np.abs(a.X - b.X)) < 1e-10


def test_smooth_friction_is_sampled_finely():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[CoulombTanh(0.05, 0.1, w=[1.0])])
    found = quasi_periodic(system, pair(0.7, 0.3), harmonics=9)
    assert min(found.n_samples) >= 96 and found.verify() < 20 * found.error + 1e-6


def test_linear_response_is_superposition():
    system = MechanicalSystem([[1.0]], [[0.1]], [[1.0]])
    found = quasi_periodic(system, pair(2.0), harmonics=2)
    for k, w in (((1, 0), 2.0), ((0, 1), 2 * np.sqrt(2))):
        assert found.coefficient(0, k) == pytest.approx(-0.25j / (1 - w**2 + 0.1j * w), rel=1e-12)
    assert found.error < 1e-13


def test_branch_in_frequency_and_level():
    curve = quasi_periodic_response(two_tone_duffing()[0], pair(2.0), scale=(1.0, 0.75), harmonics=7)
    assert curve.status == "converged" and curve.scale[-1] == 0.75
    end = curve.point(len(curve) - 1)
    for k, (cos, sin) in PRINTED[1.5].items():
        c = end.coefficient(0, k)
        assert (c.real, -c.imag) == pytest.approx((cos, sin), abs=6e-11)
    assert end.verify() < 1e-3
    level = quasi_periodic_response(two_tone_duffing()[0], pair(1.5), level=(0.1, 1.0), harmonics=7)
    assert level.status == "converged" and np.allclose(level.X[-1], end.X, atol=1e-9)
    assert "QuasiPeriodicResponse: converged" in str(level)


def test_folds_of_a_branch():
    # through the resonance of the harder driven oscillator the branch turns twice
    system = duffing()
    forces = [dict(force=[0.18], omega=1.0), dict(force=[0.02], omega=np.sqrt(7))]
    curve = quasi_periodic_response(system, forces, scale=(0.6, 1.5), harmonics=5, tolerance=1e-10)
    assert curve.status == "converged" and len(curve.folds) >= 2
    for fold in curve.folds[:2]:
        i = np.argmin(np.abs(curve.scale - fold.omega[0]))
        assert abs(curve.scale[i] - fold.omega[0]) < 0.05
    # little of the second force: near the folds 1.26960 and 1.11570 of one frequency alone (docs/theory.md (23.5))
    assert [fold.omega[0] for fold in curve.folds[:2]] == pytest.approx([1.2696, 1.1157], abs=0.01)


def test_ratio_of_1_0001_is_told_and_estimated():
    forces = [dict(force=[0.1], omega=2.0), dict(force=[0.1], omega=2.0002)]
    with pytest.warns(MbrsWarning, match="almost commensurable"):
        found = quasi_periodic(two_tone_duffing()[0], forces, harmonics=7)
    # the envelope is so slow that the motion is a sequence of periodic ones with the amplitude of the sum
    integrated = found.verify(cycles=200)
    print(f"frequencies with the ratio 1.0001: estimated error {found.error:.1e}, integrated {integrated:.1e}")
    assert integrated < 1e-4


def test_reads_saves_and_plots(tmp_path):
    found = quasi_periodic(two_tone_duffing()[0], pair(2.0), harmonics=3)
    assert "k = (1, 0)" in str(found)
    assert np.array_equal(pickle.loads(found.save(tmp_path / "qp.pkl").read_bytes()).X, found.X)
    assert found.to_xarray().X.shape == (1, 12, 2)
    import matplotlib

    matplotlib.use("Agg")
    found.plot()


@pytest.mark.parametrize(
    ("forces", "changes", "text"),
    [
        ([dict(force=[1.0], omega=1.0), dict(force=[1.0], omega=1.5)], {}, "commensurable: 3"),
        ([dict(force=[1.0], omega=1.0), dict(force=[1.0], omega=1.0)], {}, "commensurable"),
        ([dict(force=[1.0], omega=1.0)], {}, "at least two"),
        (dict(force=[1.0], omega=1.0), {}, "at least two"),
        ([dict(force=[1.0], omega=1.0), dict(omega=2.0)], {}, "needs a start"),
        ([dict(force=[1.0], omega=1.0), dict(strength=[1.0], omega=2.0)], {}, r"forces\[1\] must be"),
        ([dict(force=[1.0], omega=1.0), dict(force=[1.0])], {}, "exactly one"),
        ([dict(force=[1.0], omega=1.0), dict(force=[np.nan], omega=2**0.5)], {}, "NaN"),
        ([dict(force=[1.0, 1.0], omega=1.0), dict(force=[1.0], omega=2**0.5)], {}, "shape"),
        (None, dict(harmonics=0), "harmonics"),
        (None, dict(indices=[[1, 0]]), r"lack the term of forces\[1\]"),
        (None, dict(indices=[[1, 0], [0, 1], [0, -1]]), "twice"),
        (None, dict(indices=[[0, 0]]), "zero vector"),
        (None, dict(indices=[[0.5, 0]]), "integers"),
        (None, dict(n_samples=8), "aliases"),
        (None, dict(n_samples=[32, 32, 32]), "one number or 2"),
        (None, dict(static=[1.0, 2.0]), "shape"),
        (None, dict(x0=[1.0]), "QuasiPeriodicSolution"),
        (None, dict(tol=0.0), "tol"),
    ],
)
def test_bad_input(forces, changes, text):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(ModelError, match=text):
            quasi_periodic(two_tone_duffing()[0], pair(2.0) if forces is None else forces, **changes)


def test_memory_has_no_quasi_periodic_form():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Jenkins(0.5, 0.1, w=[1.0])])
    with pytest.raises(ModelError, match="memory"):
        quasi_periodic(system, pair(2.0))


@pytest.mark.parametrize("changes", [{}, dict(scale=(1.0, 1.0)), dict(scale=(1.0, 2.0), level=(1.0, 2.0))])
def test_branch_needs_one_range(changes):
    with pytest.raises(ModelError, match="range"):
        quasi_periodic_response(two_tone_duffing()[0], pair(2.0), **changes)


def two_sines(second=1.5 * 2**0.5):
    return [dict(force=[-0.25j], omega=1.5), dict(force=[-0.25j], omega=second)]


def costar(k3=1.5):
    return MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[Cubic(k3, w=[1.0])])


def test_branch_in_one_of_the_frequencies():
    curve = quasi_periodic_response(costar(), two_sines((2.1, 2.9)), harmonics=7)
    assert curve.status in ("converged", "unresolved") and curve.parameter == "omega1"
    assert np.all(curve.omega[:, 0] == 1.5) and curve.omega[0, 1] == 2.1 and curve.omega[-1, 1] == 2.9
    for i in (0, len(curve) // 2, len(curve) - 1):
        again = quasi_periodic(costar(), two_sines(float(curve.omega[i, 1])), harmonics=7, x0=curve.point(i))
        assert np.allclose(again.X, curve.X[i], atol=1e-9)
    values, name = curve.axis()
    assert name == "omega[1]" and np.array_equal(values, curve.omega[:, 1])
    assert curve.to_xarray().X.shape[0] == len(curve)


def test_branch_in_a_parameter_of_the_system():
    curve = quasi_periodic_response(costar, two_sines(), value=(0.1, 1.5), harmonics=5)
    assert curve.value[0] == 0.1 and curve.value[-1] == 1.5
    for i in (0, len(curve) // 2, len(curve) - 1):
        again = quasi_periodic(costar(float(curve.value[i])), two_sines(), harmonics=5, x0=curve.point(i))
        assert np.allclose(again.X, curve.X[i], atol=1e-9)
    assert curve.point(3).system.elements[0].values[0] == curve.value[3]


def test_branch_with_automatic_terms_equals_the_reference():
    curve = quasi_periodic_response(costar(), two_sines(), level=(0.1, 1.0), harmonics="auto", tol=1e-5)
    assert curve.status == "converged" and np.max(curve.error) <= 1e-5
    i = len(curve) // 2
    terms = np.zeros((len(curve.indices) + 1, 1), complex)
    for j, k in enumerate(curve.indices.tolist()):
        if k in ([1, 0], [0, 1]):
            terms[1 + j] = -0.25j * curve.level[i]
    n_t = 4 * int(np.max(curve.indices)) + 2
    reference = hbm_balance.quasi_periodic(costar(), terms, curve.omega[i], curve.indices, [n_t, n_t], curve.X[i])
    off = np.max(np.abs(reference - curve.X[i]))
    print(f"branch in the level, {len(curve)} points, {len(curve.indices)} terms: from the reference {off:.1e}")
    assert off < 1e-10


@pytest.mark.parametrize(
    ("run", "text"),
    [
        (lambda: quasi_periodic_response(costar(), two_sines()), "give one range"),
        (lambda: quasi_periodic_response(costar(), two_sines((2.0, 2.5)), level=(0.1, 1.0)), "give one range"),
        (lambda: quasi_periodic_response(costar(), two_sines(), value=(0.1, 1.0)), "belong together"),
        (lambda: quasi_periodic_response(costar, two_sines(), level=(0.1, 1.0)), "belong together"),
        (lambda: quasi_periodic_response(costar(), two_sines((2.0, 2.0))), "two different"),
        (lambda: quasi_periodic_response(costar(), two_sines(), scale=(1.0, np.nan)), "two different"),
        (lambda: quasi_periodic(costar(), two_sines(), harmonics="many"), '"auto"'),
        (lambda: quasi_periodic(costar(), two_sines(), harmonics=2.5), "harmonics"),
    ],
)
def test_bad_ranges(run, text):
    with pytest.raises(ModelError, match=text):
        run()


def test_branches_of_models_are_those_of_their_matrices():
    axis = np.array([0.4, -0.2, 0.9]) / np.linalg.norm([0.4, -0.2, 0.9])
    m = mb.Model("slider")
    b = m.body("mass", mass=2.0, inertia=(0.1, 0.2, 0.3), at=(1.0, 2.0, 3.0))
    m.prismatic("rail", m.ground, b, at=(1.0, 2.0, 3.0), axis=axis, k=8.0, c=0.4, law=mb.Cubic(3.0))
    matrices = mb.MechanicalSystem([[2.0]], [[0.4]], [[8.0]], elements=[mb.Cubic(3.0, w=[1.0])])
    frequencies = (2.0, 2.0 * np.sqrt(2.0))
    ports = [dict(inputs="mass.force.z", amplitude=0.4 * (1 + 0.3j * k), omega=w) for k, w in enumerate(frequencies)]
    forces = [dict(force=[axis[2] * 0.4 * (1 + 0.3j * k)], omega=w) for k, w in enumerate(frequencies)]
    for range_ in (dict(scale=(1.0, 0.8)), dict(level=(0.1, 1.0))):
        one, other = (mb.quasi_periodic_response(*x, harmonics=3, **range_) for x in ((m, ports), (matrices, forces)))
        assert one.status == "converged" and one.omega == pytest.approx(other.omega, rel=1e-9)
        assert pytest.approx(other.X, abs=1e-9 * np.abs(other.X).max()) == one.X
    swept = mb.quasi_periodic_response(m, [ports[0], {**ports[1], "omega": (2.6, 3.0)}], harmonics=3)
    assert swept.status == "converged" and swept.omega[-1, 1] == pytest.approx(3.0)
    with pytest.raises(ModelError, match="this one returns a model"):
        mb.quasi_periodic_response(lambda value: m, ports, value=(1.0, 2.0))
    with pytest.raises(ModelError, match="at= and without= are for models"):
        mb.quasi_periodic_response(lambda value: matrices, forces, value=(1.0, 2.0), without=["damping"])
