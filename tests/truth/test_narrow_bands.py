"""Bands without stability between two points of a curve where growths are equal: exponents meet inside the band and part like a root. What
default steps tell is what small steps tell, and the multipliers of shooting in the middle of the band."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.reference import hbm_shooting


def doubling(vary):
    """One coordinate with u^2 and u^3 on its branch of large motions."""
    spring = mb.Polynomial1D([0, 0, 0.7, 0.5], w=[0.5537])
    system = mb.MechanicalSystem([[vary(1.875)]], [[vary(0.02253)]], [[vary(0.3776)]], elements=[spring])
    return system, [0.1381], (1.12, 0.314), "period-doubling", 9


def symmetry(vary):
    """Two coordinates and a cubic spring, whose motion loses its symmetry."""
    M, K = np.array([[1.817, -1.028], [-1.028, 2.315]]), np.array([[0.654, -1.055], [-1.055, 6.647]])
    spring = mb.Cubic(vary(0.3738), w=[1.702, -0.7487])
    system = mb.MechanicalSystem(M, vary(0.01) * (K + M), K, elements=[spring])
    return system, [-0.0577 - 0.1595j, 0.2132 + 0.0342j], (0.3, 0.45), "branch-point", 7


def torus(vary):
    """Two coordinates and a stop."""
    M, K, w = np.array([[1.0, 0.2], [0.2, 1.5]]), np.array([[2.0, -0.7], [-0.7, 3.0]]), [1.0, 0.3]
    system = mb.MechanicalSystem(M, vary(0.01) * K, K, elements=[mb.Gap(vary(3.0), 0.1, w=w)])
    return system, [0.15, 0.05], (0.9, 1.9), "neimark-sacker", 9


@pytest.mark.parametrize("make", [doubling, symmetry, torus])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
def test_both_borders_are_found_with_default_steps(make, seed):
    rng = np.random.default_rng([51, seed])
    system, force, span, kind, top = make(lambda x: x * np.exp(rng.uniform(-0.03, 0.03) * (seed > 0)))
    common = dict(force=force, harmonics=top)
    fine = mb.frequency_response(system, omega=span, max_step=0.01, **common)
    expected = sorted(e.omega for e in fine.events if e.kind == kind)
    assert len(expected) == 2
    # where the determinant vanishes and where an exponent does differ by the truncation
    allowed = max(1e-7, fine.error.max()) if kind == "branch-point" else 1e-7
    for ends in (span, span[::-1]):
        curve = mb.frequency_response(system, omega=ends, **common)
        found = sorted(e.omega for e in curve.events if e.kind == kind)
        assert found == pytest.approx(expected, rel=allowed), (ends, curve.events)
    event = next(e for e in fine.events if e.kind == kind)
    middle = mb.harmonic_balance(system, omega=float(np.mean(expected)), x0=event.X, **common)
    state = np.concatenate([middle.displacement(np.zeros(1))[:, 0], middle.velocity(np.zeros(1))[:, 0]])
    _, phi = hbm_shooting.shoot(system, {1: np.asarray(force)}, middle.omega, state)
    assert np.abs(np.linalg.eigvals(phi)).max() > 1 + 1e-4


def test_the_search_for_bands_takes_few_solutions():
    """Curves without bands: beside the same without events."""
    for damping in (0.002, 0.02, 0.1):
        system = mb.MechanicalSystem([[1.0]], [[2 * damping]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
        work = [
            mb.frequency_response(
                system, force=[3 * damping], omega=(0.2, 3.0), harmonics=7, events=events
            ).stats.counts["corrections"]
            for events in (False, True)
        ]
        print(work)
        assert work[1] <= 1.5 * work[0]
