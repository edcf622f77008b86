"""Random models through the public API: trees and closed loops of all joint and element types. All numbers invented."""

from __future__ import annotations

import numpy as np
from mbrs.model.model import Model

TREE_JOINTS = ("fixed", "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free")
# how many numbers k, c and preload have
N_FREE = {
    "fixed": 0,
    "revolute": 1,
    "prismatic": 1,
    "cylindrical": 2,
    "universal": 2,
    "spherical": 3,
    "planar": 3,
    "free": 6,
}


def random_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def inertia(rng, mass, size=0.4):
    """That of a few points with the given mass in all: always physical."""
    points = size * rng.normal(size=(6, 3))
    points -= points.mean(axis=0)
    return mass / 6 * sum(np.dot(p, p) * np.eye(3) - np.outer(p, p) for p in points)


def add_body(m, rng, name, at, **given):
    mass = 1.0 + rng.random()
    return m.body(
        name,
        mass=mass,
        inertia=inertia(rng, mass),
        at=at,
        com=0.2 * rng.normal(size=3),
        orientation=random_quaternion(rng),
        **given,
    )


def joint_forces(rng, kind):
    n = N_FREE.get(kind, 0)
    if n == 0:
        return {}
    return {"k": 5 + 5 * rng.random(n), "c": 0.3 * rng.random(n), "preload": rng.normal(size=n)}


def frame(rng, kind):
    """Half of them by axes, half by an orientation."""
    if kind == "distance":
        return {}
    if kind in ("fixed", "free") or rng.random() < 0.5:
        return {"orientation": random_quaternion(rng)}
    axis = rng.normal(size=3)
    if kind != "universal":
        return {"axis": axis}
    return {"axis": axis, "axis2": np.cross(axis, rng.normal(size=3))}


def add_joint(m, rng, kind, name, a, b, at, forces=True, slack=0.0):
    """A joint at a point, or with ``slack`` between two points that far apart."""
    given = joint_forces(rng, kind) if forces else {}
    if slack:
        at = (at, np.asarray(at) + slack * rng.normal(size=3))
    return getattr(m, kind)(name, a, b, at=at, **frame(rng, kind), **given)


def stiffness(rng, size):
    """A full positive definite 6 x 6."""
    root = rng.normal(size=(6, 6))
    return size * (root @ root.T / 6 + np.eye(6))


def add_elements(m, rng, label, a, b, near):
    """One of every element type between two bodies, with every option."""
    p = near + 0.3 * rng.normal(size=(6, 3))
    K = stiffness(rng, 6.0)
    forces = {"preload": 0.5 * rng.normal(size=6), "orientation": random_quaternion(rng)}
    m.bushing(f"bush{label}", a, b, at=(p[0], p[1]), k=K, c=0.05 * K, **forces)
    m.bushing(f"mount{label}", a, b, at=p[2], k=3 + rng.random(6), c=0.2 * rng.random(6))
    m.spring_damper(f"spring{label}", a, b, at=(p[3], p[4] + 1.0), k=8.0, c=0.4, preload=0.3)
    m.spring_damper(f"strut{label}", a, b, at=(p[4], p[3] - 1.0), k=5.0, c=0.2, length=1.1)
    m.torsion(f"torsion{label}", a, b, at=p[5], axis=rng.normal(size=3), k=3.0, c=0.2, angle=0.1, preload=0.2)


def add_loads(m, rng, label, body, near, followers=True):
    frames = ("world", "body") if followers else ("world",)
    for kind in frames:
        m.force(f"force{label}{kind}", body, at=near + 0.3 * rng.normal(size=3), value=rng.normal(size=3), frame=kind)
        m.torque(f"torque{label}{kind}", body, value=rng.normal(size=3), frame=kind)


def random_tree(rng, n=4, kinds=TREE_JOINTS, *, each=False, forces=True, followers=True, moving=False, slack=0.0):
    """n bodies, each on one before it or on ground, half of the joints reversed. ``each``: the kinds in turn, in a chain."""
    m = Model("random tree", gravity=rng.normal(size=3) * (1, 9, 1))
    handles, places = [m.ground], [np.zeros(3)]
    for i in range(n):
        j = i if each else int(rng.integers(len(handles)))
        kind = kinds[i % len(kinds)] if each else str(rng.choice(kinds))
        here = places[j] + rng.normal(size=3)
        motion = {"velocity": rng.normal(size=3), "angular_velocity": rng.normal(size=3)} if moving else {}
        body = add_body(m, rng, f"b{i}", here, **motion)
        ends = (handles[j], body) if rng.random() < 0.5 else (body, handles[j])
        middle = 0.5 * (places[j] + here)
        add_joint(m, rng, kind, f"j{i}", *ends, middle, forces, slack)
        if forces:
            add_elements(m, rng, str(i), *ends, middle)
            add_loads(m, rng, str(i), body, here, followers)
        handles.append(body)
        places.append(here)
    return m


def random_loop(rng, kinds, *, rod=False, forces=True, followers=True, moving=False):
    """ground - b0 - b1 - ... - ground by the given joints, and a rod (distance joint) across it if asked for."""
    m = Model("random loop", gravity=rng.normal(size=3) * (1, 9, 1))
    n = len(kinds) - 1
    angle = np.linspace(0, 1.6 * np.pi, n + 2)
    centres = np.stack([1.5 * np.cos(angle), 1.5 * np.sin(angle), np.zeros(n + 2)], axis=1)
    centres += 0.2 * rng.normal(size=centres.shape)
    bodies = [m.ground]
    for i in range(n):
        motion = {"velocity": 0.3 * rng.normal(size=3), "angular_velocity": 0.3 * rng.normal(size=3)} if moving else {}
        bodies.append(add_body(m, rng, f"b{i}", centres[i + 1], **motion))
    bodies.append(m.ground)
    for i, kind in enumerate(kinds):
        ends = (bodies[i], bodies[i + 1]) if rng.random() < 0.5 else (bodies[i + 1], bodies[i])
        add_joint(m, rng, kind, f"j{i}", *ends, 0.5 * (centres[i] + centres[i + 1]), forces)
    if rod:
        m.distance("rod", bodies[1], bodies[n], at=(centres[1] + 0.1, centres[n] - 0.1))
    if forces:
        add_elements(m, rng, "0", bodies[1], bodies[n], centres[n // 2 + 1])
        add_loads(m, rng, "0", bodies[1], centres[1], followers)
    return m


def hinged_chain(n):
    """n rods on hinges with oblique, unequal axes."""
    rng = np.random.default_rng(n)
    m = Model("chain", gravity=(0.0, 1.0, -9.81))
    before, place, d = m.ground, np.zeros(3), np.array([0.6, 0.3, -0.2])
    for i in range(n):
        body = m.body(f"b{i}", mass=0.3, inertia=(0.01, 0.012, 0.009), at=place + d / 2)
        m.revolute(f"j{i}", before, body, at=place, axis=rng.normal(size=3))
        before, place = body, place + d
    return m
