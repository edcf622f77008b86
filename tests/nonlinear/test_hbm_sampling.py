"""Samples of friction and contact: as many as the tolerance needs."""

import numpy as np
import pytest
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Jenkins
from mbrs.nonlinear.frequency_response import frequency_response


def curve(tol=None, n_samples=None):
    system = MechanicalSystem([[1.3]], [[0.05]], [[0.9]], elements=[Jenkins(0.6, 0.17, w=[1.0])])
    return frequency_response(
        system, force=[0.23], omega=(0.4, 2.1), harmonics=list(range(1, 16, 2)), tol=tol, n_samples=n_samples
    )


def on(other, omega):
    order = np.argsort(other.omega)
    return np.interp(omega, other.omega[order], other.amplitude()[order])


@pytest.mark.slow
def test_a_loose_tolerance_takes_few_samples():
    exact, used = curve(n_samples=3072), {}
    for tol in (0.1, 1e-5):
        found = curve(tol=tol)
        used[tol] = max(part.setup.n_samples for part in found.parts)
        # the error of drawing straight lines between points comes on top
        assert np.max(np.abs(found.amplitude() / on(exact, found.omega) - 1)) < 0.02
        assert found.status in ("converged", "unresolved")
    assert used[0.1] <= 1024 < used[1e-5]
