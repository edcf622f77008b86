"""Objectives that read modal coordinates, and beams whose properties are the parameters."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest


def crane():
    """A boom of parameters on a driven, leaning hinge with a mass at its tip."""
    m = mb.Model("crane", gravity=(0.0, 1.0, -9.7))
    E, rho = m.parameter("E", 7e10), m.parameter("rho", 2700.0)
    beam = mb.flexible.beam(
        2.0,
        mass=rho * 6e-4,
        EI_flap=E * 2e-8,
        EI_edge=E * 5e-8,
        modes=3,
        elements=6,
        attach=["tip"],
        damping=0.02,
    )
    boom = m.flexible_body("boom", beam, orientation=mb.rotation((0.1, 1.0, 0.2), 0.4))
    j = m.revolute("slew", m.ground, boom.node("root"), axis=(0.2, 0.1, 1.0))
    m.drive("swing", j, mb.Polynomial([0.0, 0.0, 2.0]))
    tip = boom.node("tip")
    load = m.body("load", mass=1.5, inertia=(0.01, 0.02, 0.03), at=tip.at)
    m.fixed("hook", tip, load, at=tip.at)
    return m


def bending(s):
    q, v, a = s.modal("boom"), s.modal_rate("boom"), s.modal_acceleration("boom")
    return q[0] ** 2 + 0.3 * q[2] * v[1] + 1e-4 * a[0] * q[1] + 1e-2 * np.sum(v**2)


@pytest.mark.some(1)
@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_gradients_by_what_a_beam_is_made_of(scheme):
    options = dict(t=0.2, step=5e-3, scheme=scheme)
    psi = mb.Integral(bending)
    m = crane()
    found = mb.gradient(m, psi, ["E", "rho"], method="direct", **options)
    adjoint = mb.gradient(m, psi, ["E", "rho"], method="adjoint", **options)
    assert adjoint.gradient == pytest.approx(found.gradient, rel=1e-8)
    for k, (name, value) in enumerate({"E": 7e10, "rho": 2700.0}.items()):
        # of the shapes that are kept
        ends = []
        for factor in (1 + 1e-4, 1 - 1e-4):
            m.set({name: value * factor})
            ends.append(mb.gradient(m, psi, ["E"], method="direct", **options).value)
            m.set({name: value})
        assert found.gradient[k] == pytest.approx((ends[0] - ends[1]) / (2e-4 * value), rel=1e-5)


def test_they_are_those_of_the_motion():
    m = crane()
    traj = mb.simulate(m, t=0.1, step=5e-3, method="ali3p", parameters=["rho"])
    last = mb.gradient(m, mb.Final(lambda s: s.modal_rate("boom")[1]), ["rho"], t=0.1, step=5e-3)
    assert last.value == pytest.approx(traj.modal_rate("boom")[-1, 1], rel=1e-12)
    derivative = traj.sensitivity("boom.modal_rate")
    assert derivative.shape == (*traj.modal_rate("boom").shape, 1)
    assert derivative[-1, 1, 0] == pytest.approx(last.gradient[0], rel=1e-9)
    with pytest.raises(mb.ModelError, match="'load' has no modal coordinates: it is rigid"):
        traj.sensitivity("load.modal")
