"""Any model with one of its bodies replaced by a flexible one of the same mass and inertia."""

from __future__ import annotations

import tomllib

import mbrs as mb
import numpy as np
from mbrs._lib.rotations import quaternion_matrix
from mbrs.flexible import ModalBody
from mbrs.model import toml


def points_of(model, body):
    """World points at which something is attached to a body."""
    index, found = model[body].index, []
    for item in (*model.joints, *model.elements):
        both = "at_a" in item.table.block.fields
        for side, name in ((item.a, "at_a" if both else "at"), (item.b, "at_b" if both else "at")):
            if side == index:
                found.append(item.values(name))
    for item in (*model.loads, *model.markers):
        if item.body == index and getattr(item, "type", "force") == "force":
            found.append(item.values("at"))
    return np.unique(np.round(np.array(found).reshape(-1, 3), 15), axis=0)


def second_moments(values):
    """Principal second moments int s^2 dm and their axes (columns), largest first."""
    xx, yy, zz, xy, xz, yz = values[11:17]
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    size, axes = np.linalg.eigh(0.5 * np.trace(J) * np.eye(3) - J)
    return size[::-1], axes[:, ::-1]


def flexible_bodies_of(model):
    """Names of bodies that mass can be spread over, with at least one point that something is attached to."""
    out = []
    for body in model.bodies:
        size, _ = second_moments(body.values())
        if size[0] > 0 and size[-1] > -1e-9 * size[0] and len(points_of(model, body.name)):
            out.append(body.name)
    return out


def modal(model, body, omega, damping=0.0):
    """Six particles on the principal axes, which bend and stretch with the square of the distance s along the longest axis.

    At the node that is farthest away the whole mass on the springs of its three modes would have the angular frequency
    ``omega``. Invented.
    """
    values = np.array(model[body].values())
    mass, com, R = values[10], values[7:10], quaternion_matrix(values[3:7])
    size, axes = second_moments(values)
    arms = np.sqrt(np.maximum(3.0 * size / mass, 0.0))
    r = com + np.concatenate([axes.T * arms[:, None], -axes.T * arms[:, None]])
    nodes = (points_of(model, body) - values[:3]) @ R
    reach = max(arms[0], np.max(np.abs((nodes - com) @ axes[:, 0]), initial=0.0))

    def shapes(x):
        s = (x - com) @ axes[:, 0] / reach
        move = np.einsum("p,ik->pik", s**2, axes)
        turn = np.einsum("p,ik->pik", s / reach, np.cross(axes[:, 0], axes.T).T)
        return np.concatenate([move, turn], axis=1)

    phi, w = shapes(r)[:, :3], mass / 6.0
    P2 = w * np.einsum("pik,pjl->klij", phi, phi)
    tensor = np.array([[values[11], values[14], values[15]], [0, values[12], values[16]], [0, 0, values[13]]])
    return ModalBody(
        mass,
        com,
        tensor + np.triu(tensor, 1).T,
        S=w * phi.sum(axis=0),
        P1=w * np.einsum("pi,pjk->kij", r, phi),
        P2=P2,
        K=omega**2 * mass * np.eye(3),
        C=2.0 * damping * omega * mass * np.eye(3),
        nodes=[f"n{i}" for i in range(len(nodes))],
        node_position=nodes,
        node_shape=shapes(nodes),
        note="six particles, invented",
    )


def flexed(model, body, omega, damping=0.0):
    """The model with this body flexible."""
    made = modal(model, body, omega, damping)
    data = tomllib.loads(toml.dumps(model))
    for entry in data["body"]:
        if entry["name"] == body:
            values = model[body].values()
            velocity = {"velocity": values[17:20], "angular_velocity": values[20:23]}
            keep = {"name": body, "at": values[:3], "orientation": values[3:7], **velocity}
            if "pose" in entry:
                keep["pose"] = entry["pose"]
            arrays = {k: getattr(made, k) for k in made.__dataclass_fields__}
            keep["modal_body"] = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in arrays.items()}
            entry.clear()
            entry.update(keep)
    for load in data.get("load", []):
        if load["body"] == body and load["type"] == "torque":
            load["body"] = f"{body}.n0"
    for element in data.get("element", []):
        # a moment has no point of its own
        if element["type"] == "torsion":
            for side in ("a", "b"):
                if element[side] == body:
                    element[side] = f"{body}.n0"
    new = toml._Reader(data, "", "flexed", True).model(mb.Model)
    assert isinstance(new, mb.Model)
    return new
