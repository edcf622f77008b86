"""A balanced rotor is steady as it is drawn, whatever its axis, place and speed: against the gyroscopic equations in NumPy."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

CART, DISC = (0.7, (0.05, 0.06, 0.07)), (4.0, (0.6, 0.6, 1.0))
MOUNTS, TURNED = (-0.6, 0.9), (50.0, 0.5)
WEIGHT = 9.81


def rotor(R, place, k, weight=0.0):
    """A disc on a hinge in a housing on two isotropic mounts, the axis along R z."""
    q = np.roll(Rotation.from_matrix(R).as_quat(), 1)
    m = mb.Model("rotor", gravity=tuple(-weight * R[:, 2]))
    cart, disc = (
        m.body(name, mass=mass, inertia=inertia, at=place, orientation=q)
        for name, (mass, inertia) in {"cart": CART, "disc": DISC}.items()
    )
    m.revolute("shaft", cart, disc, at=place + 0.1 * R[:, 2], axis=R[:, 2])
    for name, z in zip(("b1", "b2"), MOUNTS, strict=True):
        stiffness, damping = (k, k, 2 * k, 0, 0, TURNED[0]), (1e-3 * k,) * 3 + (0, 0, TURNED[1])
        m.bushing(name, m.ground, cart, at=place + z * R[:, 2], k=stiffness, c=damping, orientation=q)
    return m


def roots(k, speed):
    """x, y, rx, ry with gyroscopic moments, z and the housing about the axis for themselves; those with Im > 0 or real."""
    mass = CART[0] + DISC[0]
    M = np.diag([mass, mass, CART[1][0] + DISC[1][0], CART[1][1] + DISC[1][1]])
    K, G = np.zeros((4, 4)), np.zeros((4, 4))
    for z in MOUNTS:
        rows = np.array([[1.0, 0, 0, z], [0, 1.0, -z, 0]])
        K += k * rows.T @ rows
    G[2, 3] = DISC[1][2] * speed
    G[3, 2] = -G[2, 3]
    inverse = np.linalg.inv(M)
    state = np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ K, -inverse @ (1e-3 * K + G)]])
    axial = np.roots([mass, 2e-3 * k, 4.0 * k])
    about = np.roots([CART[1][2], 2.0 * TURNED[1], 2.0 * TURNED[0]])
    return np.concatenate([np.linalg.eigvals(state), axial, about])


def drawn(seed):
    rng = np.random.default_rng([seed, 77])
    R = Rotation.random(random_state=seed).as_matrix()
    return R, rng.uniform(-1.0, 1.0, 3), 10 ** rng.uniform(1.8, 3.5), 10 ** rng.uniform(1.0, 3.0, 3)


@pytest.mark.parametrize("seed", range(20))
def test_a_rotor_along_any_axis_is_steady_as_drawn(seed):
    if jitter.level():
        pytest.skip("noise sets the disc off its axis by more than rounding: nothing else is at work")
    R, place, k, speeds = drawn(seed)
    m = rotor(R, place, k)
    for speed in speeds:
        found = mb.steady_motion(m, {"shaft": float(speed)})
        assert found.status == "converged"
        assert np.max(np.abs(found.poses["position"] - place)) < 1e-9
        modes = mb.modes(m, at=found)
        assert modes.status == "converged"
        own, exact = modes.eigenvalue[modes.kind != "rigid"], roots(k, speed)
        assert len(own) == 6
        for s in own:
            assert np.min(np.abs(exact - s)) < 1e-7 * abs(s)


@pytest.mark.parametrize("seed", range(8))
def test_its_weight_along_the_axis_is_held_by_the_mounts(seed):
    R, place, k, speeds = drawn(seed)
    sunk = WEIGHT * (CART[0] + DISC[0]) / (4.0 * k)
    for speed in speeds:
        found = mb.steady_motion(rotor(R, place, k, WEIGHT), {"shaft": float(speed)})
        assert found.status == "converged"
        assert np.max(np.abs(found.poses["position"] - (place - sunk * R[:, 2]))) < 1e-8


def test_a_force_across_the_axis_is_not_taken_for_rounding():
    """A housing off the axis by a millionth bends its mounts: what is above rounding is balanced as before."""
    R, place, k, _ = drawn(3)
    off, speed = 1e-6, 20.0
    q = np.roll(Rotation.from_matrix(R).as_quat(), 1)
    m = mb.Model("carried")
    hub = m.body("hub", mass=1.0, inertia=(0.1, 0.1, 0.1), at=place, orientation=q)
    rim = m.body("rim", mass=2.0, inertia=(0.1, 0.1, 0.1), at=place + off * R[:, 0], orientation=q)
    m.revolute("spin", m.ground, hub, at=place, axis=R[:, 2])
    m.prismatic("spoke", hub, rim, at=place, axis=R[:, 0], k=k + 2.0 * speed**2)
    found = mb.steady_motion(m, {"spin": speed})
    # 2 W^2 (off + x) = (k + 2 W^2) x
    moved = 2.0 * speed**2 * off / k
    assert found.status == "converged"
    assert np.linalg.norm(found.poses["position"][1] - place) == pytest.approx(off + moved, rel=1e-8)
