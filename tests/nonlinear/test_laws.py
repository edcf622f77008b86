"""Force laws: values of the core against the plain NumPy reference, and what wrong numbers say."""

import copy
import pickle

import numpy as np
import pytest
from mbrs._lib.border import core_errors
from mbrs.errors import ModelError
from mbrs.model import laws
from mbrs.nonlinear import balance
from mbrs.reference import hbm_balance

MEMORYLESS = [
    laws.Cubic(0.7),
    laws.Polynomial1D([0.1, 2.0, -0.3, 0.5]),
    laws.Polynomial1D([0.0, 1.0], [0.0, 0.3, 0.4, 0.1]),
    laws.Gap(5.0, 0.2),
    laws.Gap(5.0, 0.2, smoothing=0.05),
    laws.Gap(5.0, 0.2, smoothing=0.01, bilateral=True),
    laws.CoulombTanh(2.0, 0.1),
    laws.Hertz(3.0, 1.5, 0.1),
    laws.TableLaw([-1.0, -0.4, 0.0, 0.5, 1.0], [-3.0, -1.0, 0.0, 0.4, 0.3]),
    laws.VanDerPol(1.3),
]


@pytest.mark.parametrize("law", MEMORYLESS, ids=repr)
def test_memoryless_laws_equal_the_reference(law):
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-1.5, 1.5, 200), rng.uniform(-1.5, 1.5, 200)
    expected, f_u, f_v = hbm_balance.sampled(law, u, v, np.zeros(200))
    assert np.max(np.abs(law.force(u, v) - expected)) < 1e-13
    h = 1e-6  # and the reference's own slopes against differences, away from kinks
    for slope, (du, dv) in ((f_u, (h, 0)), (f_v, (0, h))):
        difference = (law.force(u + du, v + dv) - law.force(u - du, v - dv)) / (2 * h)
        assert np.max(np.abs(slope - difference)) < 1e-7


@pytest.mark.parametrize("law", MEMORYLESS, ids=repr)
def test_slopes_equal_the_reference(law):
    rng = np.random.default_rng(2)
    u, v = rng.uniform(-1.5, 1.5, 20), rng.uniform(-1.5, 1.5, 20)
    core = balance.core_elements([law], [np.ones(1)])
    found = np.array([np.concatenate(core.slopes(0, 0.0, [x], [y])) for x, y in zip(u, v, strict=True)]).T
    assert np.allclose(found, hbm_balance.sampled(law, u, v, np.zeros(20)), rtol=1e-12, atol=1e-12)
    with pytest.raises(ModelError, match="element 1"), core_errors():
        core.slopes(1, 0.0, [0.0], [0.0])


def test_slopes_follow_the_phase():
    law = laws.VaryingStiffness(2.0, 3, 0.4)
    core = balance.core_elements([law], [np.ones(1)])
    k = 2.0 * np.cos(3 * 0.7 + 0.4)
    assert np.allclose(np.concatenate(core.slopes(0, 0.7, [0.3], [9.0])), [0.3 * k, k, 0.0], rtol=1e-14)


@pytest.mark.parametrize("law", [laws.Jenkins(2.0, 0.4), laws.Iwan([2.0, 1.0, 0.5], [0.4, 1.2, 0.1])], ids=repr)
def test_laws_with_memory_equal_the_reference(law):
    u = 0.9 * np.cos(np.linspace(0, 2 * np.pi, 100, endpoint=False)) + 0.2
    expected, _ = hbm_balance.march(law, u, np.zeros((100, 1)))
    assert np.max(np.abs(law.force(np.concatenate([u, u]))[100:] - expected)) < 1e-14


def test_jenkins_loop_area():
    # four corners: the dissipated energy of a full cycle is 4 f (X - f/k)
    k, f, X = 2.0, 0.4, 0.9
    u = X * np.cos(np.linspace(0, 4 * np.pi, 200001))
    force = laws.Jenkins(k, f).force(u)
    area = np.trapezoid(force[100000:], u[100000:])
    assert area == pytest.approx(4 * f * (X - f / k), rel=1e-8)


def test_full_stick_is_the_spring():
    u = np.cos(np.linspace(0, 10, 50))
    assert np.array_equal(laws.Jenkins(2.0, 1e3).force(u), 2.0 * u)


@pytest.mark.parametrize("law", [*MEMORYLESS, laws.Jenkins(1.0, 2.0), laws.VaryingStiffness(1.0, 2, 0.1)], ids=repr)
def test_pickle_and_copy(law):
    for twin in (pickle.loads(pickle.dumps(law)), copy.deepcopy(law)):
        assert (twin.code, twin.values, repr(twin)) == (law.code, law.values, repr(law))


def sinh(t, u, v):
    return np.sinh(u) + 0.1 * v


def test_function_law():
    law = laws.FunctionLaw(sinh)
    u, v = np.linspace(-2, 2, 11), np.linspace(1, 3, 11)
    assert np.array_equal(law.force(u, v), np.sinh(u) + 0.1 * v)
    assert pickle.loads(pickle.dumps(law)).force(1.0) == np.sinh(1.0)
    exact = laws.FunctionLaw(sinh, lambda t, u, v: (np.cosh(u), 0.1), w=[1.0])
    assert np.array_equal(exact.sampled(u, v)[1], np.cosh(u)) and repr(exact) == "FunctionLaw(sinh, w=[1.])"
    with pytest.raises(ModelError, match="callable"):
        laws.FunctionLaw(3.0)
    with pytest.raises(ModelError, match="returned the shape"):
        laws.FunctionLaw(lambda t, u, v: np.zeros(3), sinh).sampled(u, v)
    with pytest.raises(ModelError, match="must return"):
        laws.FunctionLaw(sinh, lambda t, u, v: u).sampled(u, v)


def test_direction_and_repr():
    law = laws.Cubic(0.1, w=[1, -1])
    assert repr(law) == "Cubic(0.1, w=[ 1., -1.])"
    assert law.w.dtype == float and not law.w.flags.writeable


def test_far_beyond_its_reference_rate_friction_saturates():
    assert laws.CoulombTanh(2.0, 1e-8).force(0.0, np.array([1e9, -1e9])).tolist() == [2.0, -2.0]


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: laws.Cubic(np.nan), "k3 must be a finite number"),
        (lambda: laws.Cubic("1"), "k3 must be a number"),
        (lambda: laws.Cubic([1.0]), "k3 must be a number"),
        (lambda: laws.Cubic(None), "k3 must be a number"),
        (lambda: laws.Cubic(True), "k3 must be a number"),
        (lambda: laws.Cubic(1.0, w=[0.0, 0.0]), "w is zero"),
        (lambda: laws.Cubic(1.0, w=[np.inf]), "w contains"),
        (lambda: laws.Cubic(1.0, w=[[1.0]]), r"w must have the shape \(n,\)"),
        (lambda: laws.Cubic(1.0, w=[]), r"w must have the shape \(n,\)"),
        (lambda: laws.Cubic(1.0, w="x"), "w must hold numbers"),
        (lambda: laws.Polynomial1D([]), "must be a sequence"),
        (lambda: laws.Polynomial1D(3.0), "must be a sequence"),
        (lambda: laws.Gap(1.0, 0.1, smoothing=-1.0), "smoothing must not be negative"),
        (lambda: laws.Gap(1.0, -0.1, bilateral=True), "two-sided gap"),
        (lambda: laws.CoulombTanh(1.0, 0.0), "v_ref must be positive"),
        (lambda: laws.Hertz(1.0, 1.0), "exponent must exceed 1"),
        (lambda: laws.TableLaw([0.0, 0.0], [1.0, 2.0]), "ascend strictly"),
        (lambda: laws.TableLaw([0.0], [1.0]), "at least 2"),
        (lambda: laws.Jenkins(-1.0, 1.0), "k must be positive"),
        (lambda: laws.Iwan([1.0], [1.0, 2.0]), "1 stiffnesses but 2"),
        (lambda: laws.VaryingStiffness(1.0, order=0.5), "order must be an integer from 1"),
    ],
)
def test_wrong_numbers_say_so(make, text):
    with pytest.raises(ModelError, match=text):
        make()
