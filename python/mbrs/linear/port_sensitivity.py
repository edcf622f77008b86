"""Derivatives of the maps of ports, from motions at inputs to motions at outputs, along directions of the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix, skew
from ..model.ports import Port
from ..model.schema import BODY, MARKER
from ..model.tables import tables
from .linearization_sensitivity import LinearizationSensitivity


def map_changes(
    d: LinearizationSensitivity, inputs: Sequence[Port], outputs: Sequence[Port], shared: Sequence[int]
) -> dict[str, Any]:
    """Derivatives of the input map, of the output map and of what inputs feed through, as the core takes them.

    ``shared``: inputs whose body turns with ground, which tilts gravity.
    """
    tilts = [_tilt_change(d, inputs[j]) for j in shared]
    direct = _direct_change(d, outputs, inputs)
    if direct is not None and tilts:
        direct = np.concatenate([direct, np.zeros((len(outputs), len(tilts), d.directions.n))], axis=1)
    return {
        "dF": np.stack([*(_input_change(d, port) for port in inputs), *tilts], axis=1),
        "dL": np.stack([_row_change(d, port) for port in outputs]),
        "dD0": direct,
    }


def _arm_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    """(3, n_p): change of the vector from the body's origin to the port's point, world axes."""
    lin = d.linearization
    t, along = tables(lin.model), d.directions
    body = lin.snapshot.frame(port.body)
    # a node keeps its place in its body, of which it is enough to know how that was drawn
    start = t["body_x"][lin.snapshot.tables["owner"][body] if body >= len(t["body_x"]) else body]
    world = np.zeros((3, along.n))
    point = port.point
    if port.marker is not None and point is None:
        at = t["marker_x"][lin.model.marker_index[port.marker]]
        at += MARKER.block.place("at")
        point = tuple(t["x"][at : at + 3])
        world = along.part(at, 3)
    if point is None:
        return np.zeros((3, along.n))
    q = t["x"][start:][BODY.block.slice("orientation")]
    drawn = quaternion_matrix(q)
    local = world - along.part(start + BODY.block.place("at"), 3)
    turn = _rotation_rate(q, along.part(start + BODY.block.place("orientation"), 4))
    local = drawn.T @ (local - np.cross(turn.T, np.asarray(point) - t["x"][start:][BODY.block.slice("at")]).T)
    arm = lin.port_arm(port)
    return np.asarray(np.cross(d.rotation[body].T, arm).T + lin.poses["rotation"][body] @ local)


def _rotation_rate(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """World rotation vectors (3, n_p) of changes (4, n_p) of a quaternion: the vector part of 2 dq q* / |q|^2."""
    w, v = q[0], q[1:]
    return np.asarray(2.0 * (w * dq[1:] - np.outer(v, dq[0]) - np.cross(dq[1:].T, v).T) / (q @ q))


def _row_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    """(dof, n_p): change of the row of a port's motion."""
    lin = d.linearization
    if port.body == "ground":
        return np.zeros((lin.n, d.directions.n))
    body = lin.snapshot.frame(port.body)
    assert d.T is not None
    block = slice(6 * body, 6 * body + 6)
    direction = np.asarray(port.direction)
    turning = d.T[block][3:]
    if port.is_rotation:
        return np.asarray(np.einsum("i,ijp->jp", direction, turning))
    arm, darm = lin.port_arm(port), _arm_change(d, port)
    moved = d.T[block][:3] - np.einsum("ik,kjp->ijp", skew(arm), turning)
    moved -= np.stack([skew(darm[:, p]) @ lin.T[block][3:] for p in range(d.directions.n)], axis=2)
    return np.asarray(np.einsum("i,ijp->jp", direction, moved))


def _input_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    if port.kind != "base":
        return _row_change(d, port)
    assert d.ground_coupling is not None
    return np.asarray(-np.einsum("ikp,k->ip", d.ground_coupling, d.linearization._rigid(port)))


def _tilt_change(d: LinearizationSensitivity, port: Port) -> np.ndarray:
    """(dof, n_p): change of the force per angle of ground that turns under gravity."""
    assert d.ground_coupling is not None
    model, lin = d.linearization.model, d.linearization
    assert model.gravity is not None
    change = d.directions.part(int(tables(model)["gravity_x"][0]), 3)
    moved = np.cross(change.T, port.direction).T
    return np.asarray(
        np.einsum("ikp,k->ip", d.ground_coupling[:, :3], np.cross(model.gravity, port.direction))
        + (lin.ground_coupling[:, :3] @ moved)
    )


def _direct_change(d: LinearizationSensitivity, outputs: Sequence[Port], inputs: Sequence[Port]) -> np.ndarray | None:
    """(n_out, n_in, n_p): only turning ground moves points by where they are."""
    lin = d.linearization
    out = np.zeros((len(outputs), len(inputs), d.directions.n))
    for j, source in enumerate(inputs):
        if source.kind != "base" or not source.is_rotation:
            continue
        for i, port in enumerate(outputs):
            if port.is_rotation or port.body == "ground":
                continue
            body = lin.snapshot.frame(port.body)
            moved = d.position[body] + _arm_change(d, port)
            out[i, j] = np.asarray(port.direction) @ np.cross(np.asarray(source.direction), moved.T).T
    return out if np.any(out) else None
