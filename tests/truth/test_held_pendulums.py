"""Doors, shafts and drawers that are held twice: as pendulums and masses on an incline by their closed forms."""

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import solve_ivp

G = 9.81


def door(seed, hinges):
    """A door on a leaning axis through the origin; returns the model and what its equation of motion needs."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    at = rng.normal(size=3)
    m = mb.Model("door", gravity=(0, 0, -G))
    m.body("door", mass=20.0, inertia=(2.0, 2.0, 2.0), at=tuple(at))
    for i, place in enumerate(rng.uniform(-1, 1, hinges)):
        m.revolute(f"hinge{i}", m.ground, "door", at=tuple(place * axis), axis=tuple(axis))
    arm = at - (at @ axis) * axis
    inertia = 2.0 + 20.0 * arm @ arm
    down = np.array([0, 0, -20.0 * G])

    def torque(angle):
        turned = arm * np.cos(angle) + np.cross(axis, arm) * np.sin(angle)
        return axis @ np.cross(turned, down)

    return m, inertia, torque


@pytest.mark.some(1)
@pytest.mark.parametrize("hinges", [1, 2, 3])
def test_a_leaning_door_falls(hinges):
    for seed in range(4):
        m, inertia, torque = door(seed, hinges)
        end = solve_ivp(lambda t, y: [y[1], torque(y[0]) / inertia], (0, 0.7), [0, 0], rtol=1e-11, atol=1e-12)  # noqa: B023
        found = mb.simulate(m, t=[0.0, 0.7], rtol=1e-9).joint("hinge0")[-1]
        assert float(np.ravel(found)[0]) == pytest.approx(end.y[0, -1], rel=1e-6)


@pytest.mark.parametrize("hinges", [1, 2, 3])
def test_a_leaning_door_swings(hinges):
    """w^2 = |gravity's torque gradient| / inertia at rest."""
    for seed in range(4):
        m, inertia, torque = door(seed, hinges)
        eq = mb.equilibrium(m)
        largest = np.hypot(torque(0.0), torque(np.pi / 2))  # it is a cosine of the angle
        assert mb.modes(m, at=eq).omega[0] == pytest.approx(np.sqrt(largest / inertia), rel=1e-6)
        forces = sum(np.array(eq.reactions[f"hinge{i}"][:3]) for i in range(hinges))
        assert forces == pytest.approx([0, 0, 20.0 * G], abs=1e-6)
        assert max(np.abs(np.array(eq.reactions[f"hinge{i}"])).max() for i in range(hinges)) < 1e4


@pytest.mark.parametrize("slides", [1, 2, 3])
def test_a_leaning_drawer_slides(slides):
    for seed in range(4):
        rng = np.random.default_rng([seed, 2])
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        m = mb.Model("drawer", gravity=(0, 0, -G))
        b = m.body("drawer", mass=3.0, inertia=(1, 1, 1), at=tuple(rng.normal(size=3)))
        for i in range(slides):
            m.prismatic(f"slide{i}", m.ground, b, at=tuple(rng.normal(size=3)), axis=tuple(axis))
        traj = mb.simulate(m, t=[0.0, 0.5], rtol=1e-8)
        way = traj.position("drawer")[-1] - traj.position("drawer")[0]
        assert way == pytest.approx(-0.5 * G * axis[2] * 0.25 * axis, abs=1e-7)
