"""Estimates of periodic responses whatever the unit of a coordinate: a deflection in metres, millimetres or kilometres beside an angle.

A small coordinate in a small unit is neither the largest number nor lost: errors are compared by the roots of energies.
"""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest

M = np.array([[1.2, 0.05], [0.05, 0.004]])
C = np.array([[0.8, 0.01], [0.01, 0.003]])
K = np.array([[900.0, 6.0], [6.0, 2.5]])


def system(unit: float, coupled: bool) -> tuple[mb.MechanicalSystem, np.ndarray]:
    """A mass with a rotor on it; the second coordinate in ``unit`` radians."""
    D = np.diag([1.0, unit])
    first = [1.0, 0.3 * unit] if coupled else [1.0, 0.0]
    laws = [mb.Cubic(3e6, w=first), mb.Cubic(40.0, w=[0.0, unit])]
    return mb.MechanicalSystem(D @ M @ D, C=D @ C @ D, K=D @ K @ D, elements=laws), np.array([3.0, 0.02 * unit])


@pytest.mark.parametrize("coupled", [False, True], ids=["apart", "coupled"])
@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e3, 1e6])
def test_a_periodic_response(unit, coupled):
    found = {}
    for u in (1.0, unit):
        m, force = system(u, coupled)
        r = mb.harmonic_balance(m, force=force, omega=20.0, harmonics=5)
        found[u] = (r.X * np.array([[1.0], [u]]), r.error, r.status)
    (X, error, status), (other, error_there, status_there) = found.values()
    print(f"{unit:.0e}: estimates {error:.4e}, {error_there:.4e}, {status}, {status_there}")
    assert np.allclose(X, other, rtol=1e-9, atol=1e-9 * np.abs(X).max())
    assert error_there == pytest.approx(error, rel=1e-6) and status_there == status


@pytest.mark.some(2)
@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e3, 1e6])
def test_a_curve(unit):
    """Steps and estimates of a continuation."""
    found = []
    for u in (1.0, unit):
        m, force = system(u, coupled=False)
        c = mb.frequency_response(m, force=force, omega=(15.0, 40.0), harmonics=5)
        found.append((len(c.omega), np.nanmax(c.error)))
    print(f"{unit:.0e}: points and largest estimate {found}")
    assert found[1][0] == found[0][0] and found[1][1] == pytest.approx(found[0][1], rel=1e-4)


def test_estimate_against_truth():
    """The estimate is the distance to the solution with many harmonics, by the roots of energies."""
    m, force = system(1e3, coupled=True)
    r = mb.harmonic_balance(m, force=force, omega=24.0, harmonics=5)
    fine = mb.harmonic_balance(m, force=force, omega=24.0, harmonics=41, x0=r)
    phase = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)

    def motion(solution, dof, top):
        terms = (solution.coefficient(dof, h) * np.exp(1j * h * phase) for h in range(top + 1))
        return np.sum([term.real for term in terms], axis=0)

    ours = np.array([motion(r, dof, 5) for dof in (0, 1)])
    true = np.array([motion(fine, dof, 41) for dof in (0, 1)])
    weight = np.sqrt([900.0, 2.5e6])
    error = (np.abs(ours - true).max(axis=1) * weight).max() / (np.abs(true).max(axis=1) * weight).max()
    print(f"error {error:.1e}, estimate {r.error:.1e}")
    assert error < r.error < 30 * error
