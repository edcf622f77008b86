"""Branches in a parameter of the system: the same curve as by frequency, folds where both views agree."""

import numpy as np
import pytest
from mbrs.errors import ModelError
from mbrs.frequency_response import frequency_response
from mbrs.harmonic_balance import harmonic_balance
from mbrs.laws import Cubic
from mbrs.parameter_response import parameter_response
from mbrs.second_order import MechanicalSystem


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
        return MechanicalSystem([[1.0]], [[c]], [[1.0]], elements=[Cubic(0.1, w=[1.0])])

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
