"""Gradients of motions with constraints given as functions: direct against adjoint, and both against differences."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from constraint_models import GRAVITY, pendulum


def scene():
    """Two bodies of which a moving, curved function of three motions holds the first and a row of velocities the second."""
    m = mb.Model("scene", gravity=tuple(GRAVITY))
    w, a, b = m.parameter("w", 2.3), m.parameter("a", 0.4), m.parameter("b", 0.6)
    one = m.body("one", mass=1.3, inertia=(0.1, 0.2, 0.15), at=(0.3, 0.1, -0.2))
    two = m.body("two", mass=0.8, inertia=(0.05, 0.02, 0.04), at=(0.9, -0.2, 0.3), velocity=(0.0, 0.3, 0.1))
    hinge = m.revolute("hinge", m.ground, one, at=(0, 0, 0), axis=(0.3, 0.5, 0.81), k=2.0)
    m.marker("eye", two, at=(m.parameter("ahead", 0.8), -0.3, 0.2))
    m.bushing("soft", one, two, at=(0.6, 0.0, 0.1), k=(30, 40, 50, 3, 2, 4), c=(0.3, 0.2, 0.1, 0.01, 0.01, 0.02))
    motions = [hinge, "eye.motion.x", "eye.motion.ry"]
    m.constraint("cam", lambda t, u: u[0] + a * u[1] * (1 + u[0]) - 0.1 * np.sin(w * t) * (1 + u[2] ** 2), motions)
    m.velocity_constraint(
        "row",
        lambda t, u: [1.0, -b * (u[2] + 0.4), 0.3 * u[0]],
        ["eye.motion.y", "two.motion.z", "eye.motion.rx"],
        d=lambda t, u: 0.05 * t * u[1],
    )
    return m


@pytest.mark.some(1)
@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_gradients_by_everything(scheme):
    """By the numbers in the functions, points of motions, masses and stiffnesses."""
    names = ["w", "a", "b", "ahead", "hinge.at[1]", "one.mass", "soft.k[1]"]
    quantity = mb.Integral(lambda s: s.position("two") @ s.position("two"))
    options = {"t": 0.1, "step": 5e-3, "scheme": scheme}
    direct, adjoint = (
        mb.gradient(scene(), quantity, names, method=method, **options) for method in ("direct", "adjoint")
    )
    size = float(np.abs(direct.gradient).max())
    print(direct.gradient, adjoint.gradient - direct.gradient)
    assert np.abs(adjoint.gradient - direct.gradient).max() < 1e-9 * size
    for i, name in enumerate(names):
        value, psi = float(scene().value(name)), []
        for step in (1e-4, -1e-4):
            other = scene()
            other.set({name: value + step})
            psi.append(mb.gradient(other, quantity, ["one.mass"], method="direct", **options).value)
        slope = (psi[0] - psi[1]) / 2e-4
        assert direct.gradient[i] == pytest.approx(slope, rel=1e-4, abs=1e-6 * size), name


def test_given_derivatives_are_refused_by_name():
    quantity = mb.Integral(lambda s: s.position("bob")[0])
    with pytest.raises(mb.MbrsError, match=r"'rod'.*traced"):
        mb.gradient(pendulum("derivatives"), quantity, ["bob.mass"], t=0.1, step=1e-2)
