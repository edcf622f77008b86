"""The largest point of a curve: at folds, of condensed coordinates, of motions of a model."""

import numpy as np
import pytest
from mbrs import flexible
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic, Gap
from mbrs.model.model import Model
from mbrs.nonlinear.frequency_response import frequency_response


@pytest.mark.parametrize("seed", range(3))
def test_the_peak_of_a_lightly_damped_duffing_is_its_fold(seed):
    rng = np.random.default_rng(11 + seed)
    k, m = np.exp(rng.uniform(-2, 2, 2))
    w0, k3 = np.sqrt(k / m), np.exp(rng.uniform(-1, 1)) * k
    c, force = 1e-3 * m * w0, 0.05 * k
    system = MechanicalSystem([[m]], [[c]], [[k]], elements=[Cubic(k3, w=[1.0])])
    curve = frequency_response(system, force=[force], omega=(0.5 * w0, 40 * w0), harmonics=[1, 3, 5, 7, 9])
    peak = curve.peak()
    # at phase resonance the damper takes what the force gives: sum of h^2 |X_h|^2 c W = F |b_1|
    size = np.array([peak.amplitude(0, h) for h in range(1, 10)])
    power = c * peak.omega * float(np.sum((np.arange(1, 10) * size) ** 2))
    assert np.isclose(power, -force * peak.coefficient(0, 1).imag, rtol=1e-8)
    assert np.isclose(-peak.coefficient(0, 1).imag, size[0], rtol=1e-5)
    assert peak.amplitude() >= np.max(curve.amplitude()) * (1 - 1e-10)


@pytest.mark.parametrize("condense", [False, "modal", "sparse"])
def test_a_condensed_coordinate_has_its_peak(condense):
    rng = np.random.default_rng(29)
    n = 9
    k = rng.uniform(0.6, 1.7, n + 1)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    M = np.diag(rng.uniform(0.7, 1.4, n))
    w = np.eye(n)[2]
    force = 0.1 * np.eye(n)[5]
    law = Cubic(1e-14, w=w)  # present, and too small to be seen
    system = MechanicalSystem(M, 0.03 * M, K, elements=[law])
    first = float(np.sqrt(np.min(np.linalg.eigvals(np.linalg.solve(M, K)).real)))
    curve = frequency_response(
        system, force=force, omega=(0.7 * first, 1.3 * first), harmonics=[1, 3], condense=condense
    )

    def size(omega):
        return abs(np.linalg.solve(K - omega**2 * M + 0.03j * omega * M, force)[7])

    from scipy.optimize import minimize_scalar

    right = minimize_scalar(
        lambda x: -size(x), bounds=(0.8 * first, 1.2 * first), options={"xatol": 1e-12}, method="bounded"
    )
    peak = curve.peak(7)
    assert np.isclose(peak.omega, right.x, rtol=1e-6)
    assert np.isclose(peak.amplitude(7), -right.fun, rtol=1e-9)


def beam():
    given = dict(rho=7800.0, area=2e-4, I_flap=1.6667e-9, I_edge=6.667e-9)
    body = flexible.beam(1.0, E=2.1e11, modes=8, attach=["tip"], damping=0.01, **given)
    m = Model("b")
    s = m.flexible_body("beam", body)
    m.fixed("clamp", m.ground, s.node("root"))
    tip = s.node("tip")
    m.bushing("stop", m.ground, tip, at=(1, 0, 0), law={"z": Gap(5e3, 1e-3)})
    return m, tip


def test_a_motion_of_a_model_has_its_peak_and_is_verified():
    m, tip = beam()
    curve = frequency_response(m, inputs=tip.force("z"), amplitude=0.02, frequency=(7.0, 9.5), harmonics=3)
    z = tip.motion("z")
    peak = curve.peak(z)
    assert peak.amplitude(z) >= np.max(curve.amplitude(z)) * (1 - 1e-9)
    assert peak.amplitude(z) <= 1.01 * np.max(curve.amplitude(z))
    distance = peak.verify()
    assert "changed" not in distance.why
    assert distance.full is not None or distance.why
