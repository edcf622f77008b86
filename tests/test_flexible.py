"""Flexible bodies in the core against the reference (particles), closed forms and themselves."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from flexible_models import MECHANISMS, cantilever, four_bar, pendulum, rod, tumbling
from mbrs.reference import State, System, linearize
from mbrs.tables import framed, tables

SCHEMES = {"generalized-alpha": {}, "bdf": {}, "explicit": {}}


def random_state(model, rng, size=0.1, moving=True):
    """A state of an open tree off its drawn one, with modal coordinates and rates."""
    core = model.compiled()
    relative = core.assemble()["relative"].copy()
    q = relative[core.n_bodies :, :3]
    q[:] = size * rng.standard_normal(q.shape)
    m = sum(int(n) for n in tables(model)["flexible_modes"])
    q.reshape(-1)[m:] = 0.0
    return relative, rng.standard_normal(core.n_tree) if moving else np.zeros(0)


def reference_state(model, system, relative, rate):
    """The same state in the frames of the reference: bodies, moving nodes, carriers of modal coordinates."""
    core = model.compiled()
    found = core.bodies(relative, rate)
    n = core.n_bodies
    arm = np.einsum("nij,nj->ni", found["rotation"], np.array([b.com for b in system.bodies[:n]]))
    omega = found["angular_velocity"]
    velocity = found["velocity"] + np.cross(omega, arm)
    q = relative[n:, :3]
    speed = np.zeros(q.shape)
    m = sum(int(k) for k in tables(model)["flexible_modes"])
    if len(rate):
        speed.reshape(-1)[:m] = rate[-m:]
    zeros, ones = np.zeros(q.shape), np.broadcast_to(np.eye(3), (len(q), 3, 3))
    return State(
        np.concatenate([found["position"] + arm, q]),
        np.concatenate([found["rotation"], ones]),
        np.concatenate([velocity, speed]),
        np.concatenate([omega, zeros]),
    )


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", ["tumbling", "pendulum", "by the tip", "cantilever"])
def test_the_linearisation_agrees_with_particles(name, moving):
    model = MECHANISMS[name](damping=1e-3)
    rng = np.random.default_rng([len(name), moving])
    relative, rate = random_state(model, rng, moving=moving)
    found = model.compiled().linearize(relative, rate, [])
    system = System(tables(model))
    state = reference_state(model, system, relative, rate)
    assert model.compiled().topology()["coordinates"] == system.coordinates
    expected = linearize(system, state, [system.coordinates.index(c) for c in found["coordinates"]], ())
    for key in ("M", "D", "S"):
        a, e = found[key], getattr(expected, key)
        a = np.zeros_like(e) if a is None else a
        assert np.max(np.abs(a - e)) <= 1e-10 * np.max(np.abs(e)), key
