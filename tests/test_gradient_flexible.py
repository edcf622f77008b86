"""Gradients of motions with flexible bodies: both schemes, direct and adjoint, against each other and against differences."""

import mbrs as mb
import numpy as np
import pytest
from flexible_models import MECHANISMS
from motion_models import silent
from test_gradient import differences, worst
from test_gradient_hand import against_direct

NAMES = {
    "cantilever": ["rod.K[0,0]", "gravity[2]"],
    "tumbling": ["rod.K[0,0]", "rod.velocity[1]", "rod.angular_velocity[0]"],
    "pendulum": ["rod.K[1,1]", "guy.k", "ball.mass", "cardan.at[0]", "push.value[1]"],
    "by the tip": ["rod.K[0,0]", "ball.mass", "slide.k[0]"],
    "four-bar": ["coupler.K[2,2]", "A.k", "crank.mass", "rocker.com[0]"],
}


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
@pytest.mark.parametrize("name", [n for n in MECHANISMS if n != "cantilever"])
def test_gradients_with_flexible_bodies(name, scheme):
    m = silent(lambda: MECHANISMS[name](damping=1e-3))
    body, joint = m.bodies[-1].name, m.joints[0].name
    psi = mb.Integral(
        lambda s: (
            np.sum(s.position(body) * [1.0, 2.0, 3.0])
            + 0.1 * np.sum(s.velocity(body) ** 2)
            + 0.01 * np.sum(s.acceleration(body))
            + 0.02 * np.sum(s.reaction(joint))
        )
    )
    options = {"t": 0.05, "step": 0.01, "scheme": scheme}
    direct = mb.gradient(m, psi, NAMES[name], method="direct", **options)
    adjoint = mb.gradient(m, psi, NAMES[name], method="adjoint", **options)
    agreement = worst(adjoint.gradient, direct.gradient)
    error = worst(direct.gradient, differences(m, psi, NAMES[name], part=1e-4, **options))
    print(f"{name}, {scheme}: adjoint - direct {agreement:.1e}, direct - differences {error:.1e}")
    assert agreement < 1e-9
    assert error < 1e-6


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
@pytest.mark.parametrize("name", ["pendulum", "four-bar"])
def test_adjoint_by_all_numbers_without_damping(name, scheme):
    """Dampings of the modes are zero here, and still numbers that the motion depends on."""
    m = silent(lambda: MECHANISMS[name](damping=0.0))
    error = against_direct(m, scheme)
    print(f"{name}, {scheme}: adjoint - direct {error:.1e}")
    assert error < 1e-9
