"""First points of contacts with many harmonics: found from few harmonics, with the work of all attempts, and right."""

import mbrs as mb
import numpy as np
import pytest


@pytest.mark.some(1)
@pytest.mark.parametrize(
    "mass, damping, spring, stop, gap, force, omega",
    [(1.3, 0.12, 1.1, 1130.0, 0.87, 0.53, 0.94), (1.1, 0.07, 0.9, 1200.0, 0.93, 0.55, 0.97)],
)
def test_a_first_point_with_many_harmonics_comes_from_few(mass, damping, spring, stop, gap, force, omega):
    """Each step of a ramp of the forces solves for all unknowns at once: with many harmonics the cube of their number."""
    system = mb.MechanicalSystem(
        [[mass]], [[damping]], [[spring]], elements=[mb.Gap(stop, gap, bilateral=True, w=[1.0])]
    )
    fine, coarse = (mb.harmonic_balance(system, force=[force], omega=omega, harmonics=H) for H in (151, 75))
    print(fine.stats.counts, fine.error, coarse.error)
    assert fine.status == coarse.status == "converged"
    # blocks of 151 harmonics and the mean once an attempt, and those of the fewer harmonics before
    assert fine.stats.counts["factorisations"] > 152
    apart = np.max(np.abs(fine.X[0, : coarse.X.shape[1]] - coarse.X[0])) / np.max(np.abs(fine.X))
    assert apart < 10 * (coarse.error + fine.error)
    # the residual of the motion in time, where the stop is not smoothed
    t = np.linspace(0, 2 * np.pi / omega, 40_001)[:-1]
    orders = np.arange(1, 152)[:, None]
    a, b = fine.X[0, 1::2], fine.X[0, 2::2]
    c, s = np.cos(orders * omega * t), np.sin(orders * omega * t)
    x, v = fine.X[0, 0] + a @ c + b @ s, (orders[:, 0] * omega) * b @ c - (orders[:, 0] * omega) * a @ s
    w2 = (orders[:, 0] * omega) ** 2
    pushed = stop * (np.maximum(x - gap, 0) + np.minimum(x + gap, 0))
    left = mass * (-(w2 * a) @ c - (w2 * b) @ s) + damping * v + spring * x + pushed - force * np.cos(omega * t)
    kept = np.concatenate([left @ c.T, left @ s.T]) * 2 / len(t)
    assert np.max(np.abs(kept)) < 1e-3 * force
