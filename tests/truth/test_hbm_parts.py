"""Stability of parts that nothing connects: each has the exponents that it has alone, whatever the other one does and measures in."""

import numpy as np
import pytest
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic, Gap, VaryingStiffness
from mbrs.nonlinear.frequency_response import frequency_response

# more harmonics than Hill's problem is made for: the monodromy matrix tells the exponents
MANY = 35


def exponents(k, c, depth, phase, omega, steps=4000):
    """Of x" + c x' + k (1 + depth cos(omega t + phase)) x = 0: the exact motion of each short step with the stiffness at its middle."""
    h, out = 2 * np.pi / omega / steps, np.eye(2)
    for i in range(steps):
        now = k * (1 + depth * np.cos(omega * (i + 0.5) * h + phase))
        w = np.sqrt(complex(now - c * c / 4))
        cosine, sine = np.cos(w * h), np.sin(w * h) / w
        step = np.array([[cosine + c / 2 * sine, sine], [-now * sine, cosine - c / 2 * sine]])
        out = step.real @ out  # without its decay, so that nothing overflows
    largest = np.log(np.abs(np.linalg.eigvals(out)).max()) * omega / (2 * np.pi) - c / 2
    return np.array([-c - largest, largest])  # their sum is the mean trace


@pytest.mark.parametrize("seed", range(4))
def test_a_part_that_grows_hides_no_other(seed):
    """Multipliers of 1e20 beside those of a lightly damped part, in units that differ by many orders."""
    rng = np.random.default_rng([31, seed])
    omega, depth, phase = 1.7, rng.uniform(0.1, 0.3, 2), rng.uniform(-3, 3, 2)
    k = omega**2 * rng.uniform([0.3, 4.5], [0.6, 6.0])
    # rates of the envelope: one grows by e^46 in a period, one decays slowly
    c = np.array([rng.uniform(0.005, 0.02), -2 * 46 * omega / (2 * np.pi) * rng.uniform(0.9, 1.1)])
    mass, unit = 10.0 ** rng.uniform(-3, 3, 2), 10.0 ** rng.uniform(-6, 6, 2)
    scale = mass * unit**2
    elements = [VaryingStiffness(depth[i] * k[i] * scale[i], phase=phase[i], w=np.eye(2)[i]) for i in range(2)]
    system = MechanicalSystem(np.diag(scale), np.diag(c * scale), np.diag(k * scale), elements=elements)
    curve = frequency_response(system, force=[0.0, 0.0], omega=(omega, 1.001 * omega), harmonics=MANY, max_points=2)
    found = np.sort(np.asarray(curve.exponents)[0].real)
    exact = np.sort(np.concatenate([exponents(k[i], c[i], depth[i], phase[i], omega) for i in range(2)]))
    print(found, exact)
    assert found == pytest.approx(exact, abs=1e-6 * omega, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_whether_a_contact_grazes_does_not_depend_on_units(seed):
    """A stop that the motion does not reach by a part of it, beside a coordinate whose numbers are larger or smaller by orders."""
    rng = np.random.default_rng([32, seed])
    w0, away = 1.3, rng.uniform(1.02, 1.2)
    omega = 0.6 * w0
    amplitude = 1.0 / abs(w0**2 - omega**2 + 0.06j * omega)
    verdicts = []
    for unit in (1.0, 10.0 ** rng.uniform(3, 9), 10.0 ** rng.uniform(-9, -3)):
        # x1 = unit X1: the other coordinate in another unit
        scale = np.array([1.0, 1.0 / unit])
        K = np.array([[w0**2 + 1e-3, -1e-3], [-1e-3, 5 * w0**2]]) * np.outer(scale, scale)
        M, C = np.diag(scale**2), 0.06 * np.diag(scale**2)
        stop = Gap(50 * w0**2, away * amplitude, w=[1.0, 0.0])
        # one harmonic leaves an error in the other coordinate, which is no error of this one
        bent = Cubic(0.05 * w0**2 / unit**4, w=[0.0, 1.0])
        system = MechanicalSystem(M, C, K, elements=[stop, bent])
        curve = frequency_response(
            system, force=np.array([1.0, 3.0]) * scale, omega=(omega, 1.001 * omega), harmonics=1, max_points=2
        )
        verdicts.append(np.asarray(curve.stable).tolist())
    print(verdicts)
    assert all(v == verdicts[0] for v in verdicts) and None not in verdicts[0]
