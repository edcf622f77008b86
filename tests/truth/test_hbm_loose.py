"""What nothing restrains is named; what is not a number is no result."""

import numpy as np
import pytest
from mbrs.errors import ConvergenceError, SingularError
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.periodic import harmonic_balance


@pytest.mark.parametrize("condense", [False, True, "sparse", "modal"])
@pytest.mark.parametrize("seed", range(3))
def test_a_loose_coordinate_without_load_is_named(seed, condense):
    rng = np.random.default_rng(60 + seed)
    n = 5
    B = np.eye(n)
    loose = int(rng.integers(1, n))
    for i in range(n):
        if i != loose and i != 0:
            B[i, 0] = rng.uniform(-0.4, 0.4)
    size = 10.0 ** (rng.uniform(-1, 1, n) if condense == "modal" else rng.uniform(-4, 6, n))
    K = B @ np.diag(size) @ B.T
    K = 0.5 * (K + K.T)
    K[loose] = K[:, loose] = 0.0
    M = np.diag(rng.uniform(0.3, 3, n) * size)
    C = 0.03 * K + 0.02 * M if condense == "modal" else 0.03 * M
    names = [f"part{i}" for i in range(n)]
    w = np.eye(n)[0]
    system = MechanicalSystem(M, C, K, elements=[Cubic(size[0], w=w)], coordinates=names)
    with pytest.raises((ConvergenceError, SingularError), match=f"part{loose}"):
        harmonic_balance(system, force=0.3 * size[0] * w, omega=0.7, harmonics=3, condense=condense)
    with pytest.raises((ConvergenceError, SingularError)):
        frequency_response(system, force=0.3 * size[0] * w, omega=(0.7, 0.9), harmonics=3, condense=condense)
