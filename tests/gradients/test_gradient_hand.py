"""Steps backwards by hand against the direct way: every scene with generalised-alpha, other metrics, effects left out."""

import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from gradient_scenes import SCENES
from mbrs import _core
from mbrs.model.directions import directions
from mbrs.system.snapshot import Snapshot
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
        run.snapshot.system, run.state.q, run.state.rate, list(without), run.options(asked, along)
    )
    back = forward.gradient(seeds)[0]
    exact = np.einsum("tc,tcp->p", seeds, made["derivatives"])
    return np.abs(back - exact).max() / np.abs(exact).max()


@pytest.mark.some(16)
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


LEFT_OUT = [
    ("loop_spherical", "gravity"),
    ("ring", "damping"),
    ("knife", "nonholonomic"),
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


def test_effects_whose_absence_the_tangents_do_not_follow_are_refused():
    m = mb.Model("rubbed", gravity=(0, -9.81, 0))
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0, 0))
    m.revolute("J", m.ground, b, at=(0, 0, 0), axis="z", k=3.0, law=mb.CoulombTanh(0.4, 0.1))
    psi = mb.Final(lambda s: s.position("b")[1])
    for effect, text in [("centrifugal", "centrifugal"), ("damping", "law of 'J'")]:
        with pytest.raises(mb.ModelError, match=text):
            mb.gradient(m, psi, "b.mass", t=0.1, step=0.01, without=(effect,))
