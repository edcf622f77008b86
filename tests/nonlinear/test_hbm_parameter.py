"""Branches in a parameter of the system: the same curve as by frequency, folds where both views agree."""

import pickle

import mbrs as mb
import numpy as np
import pytest
import scipy.sparse as sp
from mbrs.errors import ModelError
from mbrs.examples import duffing
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic
from mbrs.nonlinear.branch import Branch
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.parameter_response import parameter_response
from mbrs.nonlinear.periodic import harmonic_balance
from mbrs.reference import hbm_balance


def family(k3):
    return MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Cubic(k3, w=[1.0])])


def test_fold_in_the_cubic_stiffness_is_that_in_frequency():
    curve = frequency_response(family(0.1), force=[0.18], omega=(0.5, 1.6), harmonics=7, stability=False)
    fold = curve.events[1]  # the lower one: a jump up
    response = parameter_response(family, value=(0.02, 0.6), force=[0.18], omega=fold.omega, harmonics=7)
    assert response.status == "converged"
    assert np.min(np.abs(response.folds - 0.1)) < 1e-7


def test_points_are_solutions():
    response = parameter_response(family, value=(0.02, 0.3), force=[0.18], omega=0.9, harmonics=5)
    assert response.status == "converged" and response.value[-1] == 0.3 and len(response.folds) == 0
    for i in (0, len(response) // 2, len(response) - 1):
        one = harmonic_balance(family(response.value[i]), force=[0.18], omega=0.9, harmonics=5, x0=response.X[i])
        assert np.allclose(one.X, response.X[i], atol=1e-7)
    assert "ParameterResponse: converged" in str(response)


def test_damping_as_parameter_reaches_the_linear_limit():
    def damped(c):
        return duffing(c=c)

    response = parameter_response(damped, value=(0.5, 50.0), force=[0.18], omega=1.0, harmonics=3)
    assert response.amplitude()[-1] == pytest.approx(0.18 / 50, rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (dict(value=(0.1, 0.1)), "range"),
        (dict(value=0.1), "range"),
        (dict(value=(0.1, np.nan)), "range"),
        (dict(value=(0.1, 0.2), omega=(0.5, 1.0)), "one frequency"),
        (dict(value=(0.1, 0.2), step=0.0), "step"),
        (dict(value=(0.1, 0.2), max_points=0), "max_points"),
    ],
)
def test_bad_input(changes, text):
    with pytest.raises(ModelError, match=text):
        parameter_response(family, **(dict(force=[0.18], omega=1.0) | changes))


def test_every_point_equals_the_reference():
    response = parameter_response(family, value=(0.02, 0.3), force=[0.18], omega=0.9, harmonics=5)
    off = []
    for i in range(0, len(response), 5):
        system = family(float(response.value[i]))
        X = hbm_balance.harmonic_balance(system, [0.18], 0.9, range(1, 6), 32, response.X[i])
        off.append(np.max(np.abs(X - response.X[i])))
    print(f"branch in the cubic stiffness, largest difference from the reference {max(off):.1e}")
    assert max(off) < 1e-9


def spring_mount():
    m = mb.Model("mount")
    b = m.body("b", mass=10.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
    k = m.parameter("k", 1e5)
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=k, c=20.0, law=Cubic(1e9))
    return m, b


def test_parameter_of_a_model_by_its_address():
    m, b = spring_mount()
    given = dict(inputs=b.force("x"), amplitude=20.0, omega=115.0, harmonics=5)
    response = parameter_response(m, "k", value=(2e5, 5e4), **given)
    assert response.status == "converged" and m.value("k") == 1e5  # the model is as it was
    kinds = [event.kind for event in response.events]
    assert response.stable is not None and response.name == "k"
    i = len(response) // 2
    m.set({"k": float(response.value[i])})
    one = harmonic_balance(m, x0=response.X[i], **given)
    assert np.allclose(one.X, response.X[i], rtol=1e-8, atol=1e-15)
    # over k the same folds as over frequency, where they are met
    for event in response.events:
        m.set({"k": event.value})
        curve = frequency_response(m, inputs=b.force("x"), amplitude=20.0, omega=(90.0, 160.0), harmonics=5)
        assert min(abs(e.omega - 115.0) for e in curve.events if e.kind == event.kind) < 1e-5, kinds


def test_condensed_family_iterator_and_saving(tmp_path):
    n = 30
    K = sp.diags([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1]).tocsc()

    def chain(k3):
        return MechanicalSystem(
            sp.identity(n, format="csc"), 0.05 * sp.identity(n), K, elements=[Cubic(k3, w=np.eye(n)[-1])]
        )

    force = 0.05 * np.eye(n)[0]
    given = dict(value=(0.1, 2.0), force=force, omega=0.25, harmonics=5)
    part = parameter_response(chain, max_points=3, **given)
    assert part.status == "max-points" and part.stats.route.startswith("condensed")
    whole = part.resume()
    full = parameter_response(chain, condense=False, stability=False, **given)
    assert whole.status == "converged" and whole.stable is not None
    for i in (0, len(whole) // 2, len(whole) - 1):
        one = harmonic_balance(chain(float(whole.value[i])), force=force, omega=0.25, harmonics=5, x0=whole.X[i])
        assert np.allclose(one.X, whole.X[i], rtol=1e-8, atol=1e-12)
    assert np.allclose(full.X[-1], whole.X[-1], atol=1e-8)
    twin = pickle.loads(whole.save(tmp_path / "curve.pkl").read_bytes())
    assert np.array_equal(twin.value, whole.value) and np.allclose(twin.X, whole.X)
    assert whole.to_xarray().value.shape == (len(whole),)


def test_period_doubling_and_the_branch_that_leaves_there():
    # a buckled beam-like oscillator with two wells doubles its period; the branch that leaves has twice the period
    system = MechanicalSystem([[1.0]], [[0.15]], [[-0.5]], elements=[Cubic(0.5, w=[1.0])])
    branch = Branch(system, force=[0.3], omega=(1.3, 0.6), harmonics=9, x0=[[1.0, 0.3, 0.0]])
    branch.run(400)
    doubling = [event for event in branch.chunks.events if event.kind == "period-doubling"]
    assert doubling
    other = branch.switch(doubling[0])
    assert other.run(8) >= 8 and other.setup.subharmonic == 2
    point = other.point(7)
    odd = np.abs(point.X[0, 1::2] - 1j * point.X[0, 2::2])[0::2]
    assert odd.max() > 1e-3  # half harmonics have appeared
    one = harmonic_balance(system, force=[0.3], omega=point.omega, harmonics=9, subharmonic=2, x0=point.X)
    assert np.allclose(one.X, point.X, atol=1e-7)
    print(f"branch of twice the period: integrated over it {one.verify():.1e}, estimated {one.error:.1e}")
    assert one.verify() < 1e-2
