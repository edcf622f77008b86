"""Steps backwards by hand against the direct way: every scene with generalised-alpha, other metrics, effects left out."""

import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from gradient_scenes import SCENES
from mbrs import _core
from mbrs.linearize import Snapshot
from mbrs.tables import directions
from motion_models import silent
from test_gradient_pairs import asked_of, run_of


def against_direct(m, scheme, without=(), weight="tangent"):
    """Largest difference of adjoint and direct over the largest derivative by any number, of random weights at all steps."""
    x = np.array(Snapshot.of(m).tables["x"], dtype=float)
    along, asked, run = directions(m, all_addresses(m)), asked_of(m), run_of(m, x, scheme)
    run.weight, run.without = weight, tuple(without)
    made = run.direct(asked, along)
    seeds = np.random.default_rng(3).normal(size=made["values"].shape)
    forward = _core.MotionForward(
        run.snapshot.system, run.state.relative, run.state.rate, list(without), run.options(asked, along)
    )
    back = forward.gradient(seeds)[0]
    exact = np.einsum("tc,tcp->p", seeds, made["derivatives"])
    return np.abs(back - exact).max() / np.abs(exact).max()


@pytest.mark.parametrize("name", SCENES)
def test_generalized_alpha_of_every_scene(name):
    error = against_direct(silent(SCENES[name]), "generalized-alpha")
    print(f"{name}: adjoint - direct {error:.1e}")
    assert error < 1e-9


@pytest.mark.parametrize("name", ["ring", "knife", "loop_revolute", "loop_spherical"])
def test_projections_by_the_mass(name):
    error = against_direct(silent(SCENES[name]), "ali3p", weight="mass")
    print(f"{name}: adjoint - direct {error:.1e}")
    assert error < 1e-9


# Both ways take the tangent of a linearisation for the derivative of the step: wrong where an effect that is left out of the motion
# stays in it (gyroscopic terms without centrifugal ones) or the other way round (slopes of laws by rates without damping).
TANGENT = pytest.mark.xfail(strict=True, reason="the tangent of a step is not the derivative of its forces here")
LEFT_OUT = [
    ("loop_spherical", "gravity"),
    pytest.param("loop_spherical", "centrifugal", marks=TANGENT),
    ("ring", "damping"),
    ("knife", "nonholonomic"),
    pytest.param("loads", "centrifugal", marks=TANGENT),
    ("driven_loop", "drives"),
    ("law_friction", "friction"),
    ("law_iwan", "friction"),
    ("law_gap_smooth", "contact"),
    ("coupled", "gravity"),
]


@pytest.mark.parametrize(("name", "effect"), LEFT_OUT)
def test_effects_left_out(name, effect):
    error = against_direct(silent(SCENES[name]), "ali3p", without=(effect,))
    print(f"{name} without {effect}: adjoint - direct {error:.1e}")
    assert error < 1e-9


@TANGENT
def test_a_law_that_feels_rates_without_damping():
    """Slopes by rates are not made there, though the force has one."""
    m = mb.Model("rubbed", gravity=(0, -9.81, 0))
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0, 0))
    m.revolute("J", m.ground, b, at=(0, 0, 0), axis="z", k=3.0, law=mb.CoulombTanh(0.4, 0.1))
    error = against_direct(m, "ali3p", without=("damping",))
    print(f"adjoint - direct {error:.1e}")
    assert error < 1e-9
