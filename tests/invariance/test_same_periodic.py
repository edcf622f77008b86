"""Periodic response of a nonlinear model about its equilibrium: angles of hinges after a change."""

import mbrs as mb
import numpy as np
import pytest
import zoo

OMEGA = 2.1
SPAN = (2.0, 2.8)
FORCE = 0.5 * np.array([0.36, -0.48, 0.8])


def model():
    """A chain of hinges, two of them hardening."""
    m = mb.Model("chain", gravity=(0, -9.81, 0))
    before, rng = m.ground, np.random.default_rng(3)
    for i in range(3):
        b = m.body(f"link{i}", mass=1.0 + i / 3, inertia=(0.02, 0.03, 0.04), at=(0.2, -0.7 * i - 0.35, 0.1 * i))
        law = {"law": mb.Cubic(6.0)} if i != 1 else {}
        m.revolute(
            f"hinge{i}", before, b, at=(0, -0.7 * i, 0), axis=tuple(rng.normal(size=3)), k=3.0 + i, c=0.15, **law
        )
        before = b
    return zoo.changes.turned(np.random.default_rng(20))(m)


def asked(m, change):
    """Force on the last link, in the axes and units of the changed model."""
    ports = [m[change.rename("link2")].force(axis) for axis in "xyz"]
    amplitude = (change.R @ FORCE * change.unit(1, 1, -2)).tolist()
    return {"inputs": ports, "amplitude": amplitude, "at": zoo.at_rest(m)}


def places(m, change):
    names = list(mb.System(m).coordinates)
    return [names.index(change.rename(f"hinge{i}")) for i in range(3)]


def changed(name):
    change = zoo.CHANGES[name](np.random.default_rng([22, len(name)]))
    return change, change(model())


@pytest.mark.some(8)
@pytest.mark.parametrize("change", zoo.CHANGES)
def test_harmonic_balance(change):
    def solve(m, change):
        found = mb.harmonic_balance(m, omega=OMEGA / change.time, harmonics=5, **asked(m, change))
        return np.array([found.amplitude(i) for i in places(m, change)])

    expected = solve(model(), zoo.changes.nothing())
    change, m = changed(change)
    zoo.close(solve(m, change), expected, zoo.allowed(change, 1e-7, 1e3))


@pytest.mark.some(5)
@pytest.mark.parametrize("change", zoo.CHANGES)
def test_frequency_response(change):
    """The largest amplitude of each hinge, to the density of points, and every point by itself."""

    def solve(m, change):
        span = tuple(w / change.time for w in SPAN)
        return mb.frequency_response(m, omega=span, harmonics=3, stability=False, **asked(m, change))

    first = solve(model(), zoo.changes.nothing())
    expected = [max(first.amplitude(dof=i, harmonic=1)) for i in range(3)]
    change, m = changed(change)
    curve = solve(m, change)
    found = [max(curve.amplitude(dof=i, harmonic=1)) for i in places(m, change)]
    assert found == pytest.approx(expected, rel=max(5e-3, 1e3 * change.error))
    at = len(curve.omega) // 2
    again = mb.harmonic_balance(m, omega=curve.omega[at], harmonics=3, x0=curve.X[at], **asked(m, change))
    assert curve.point(at).amplitude(places(m, change)[0]) == pytest.approx(
        again.amplitude(places(m, change)[0]), rel=1e-5
    )
