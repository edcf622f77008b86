"""Geometry of a model for drawing, from its Tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from .._lib.rotations import quaternion_matrix
from ..model.schema import BODY, COUPLER, ELEMENTS, JOINTS, LOADS, MARKER
from ..view.scene import BodyGeometry, JointGeometry, LinkGeometry, SceneGeometry

_JOINTS = {kind.code: kind.type for kind in JOINTS.values()}
_ELEMENTS = {kind.code: kind for kind in ELEMENTS.values()}
_JOINT = JOINTS["revolute"].block


def scene_from_tables(tables: Mapping[str, Any]) -> SceneGeometry:
    """Geometry for drawing, from the Tables of a model (docs/tables.md), in its drawn state.

    Every joint, element, marker and load counts as an attachment point of the bodies it acts on. O(number of objects).

    Parameters
    ----------
    tables
        The dict of flat arrays that a `Model` compiles to.
    """
    x = np.asarray(tables["x"], dtype=float)
    names = [str(name) for name in tables["body_name"]]
    attached: list[list[np.ndarray]] = [[] for _ in names]

    def attach(body: int, point: np.ndarray) -> str | None:
        if body < 0:
            return None
        attached[body].append(point)
        return names[body]

    links = tuple(_links(tables, x, attach))
    joints = tuple(_joints(tables, x, attach))
    for body, rim in _rims(tables, x):
        attached[body].extend(rim)
    for body, start in zip(tables.get("load_body", ()), tables.get("load_x", ()), strict=True):
        attach(int(body), x[start:][LOADS["force"].block.slice("at")])
    markers = {}
    keys = ("name", "body", "x")
    for name, body, start in zip(*(tables.get(f"marker_{k}", ()) for k in keys), strict=True):
        point = x[start:][MARKER.block.slice("at")]
        markers[str(name)] = (attach(int(body), point), point)
    at, orientation = BODY.block.slice("at"), BODY.block.slice("orientation")
    bodies = tuple(
        BodyGeometry(
            name,
            x[start:][at],
            quaternion_matrix(x[start:][orientation]),
            np.reshape(points, (-1, 3)) if points else (),
        )
        for name, start, points in zip(names, tables["body_x"], attached, strict=True)
    )
    return SceneGeometry(bodies, links, joints, markers)


def _rims(tables: Mapping[str, Any], x: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Bodies that are round, with points of their rims: rolling discs, and what turns in a hinge that drives a rack."""
    kinds, starts, second = tables["joint_type"], tables["joint_x"], tables["joint_b"]
    for j, start in enumerate(starts):
        if _JOINTS[int(kinds[j])] == "rolling_disc" and second[j] >= 0:
            n, block = x[start:], JOINTS["rolling_disc"].block
            yield int(second[j]), _circle(n[block.slice("at_b")], n[block.slice("axis2")], n[block.place("radius")])
    keys = ("first", "second", "x")
    for a, b, place in zip(*(tables.get(f"coupler_{k}", ()) for k in keys), strict=True):
        if (_JOINTS[int(kinds[a])], _JOINTS[int(kinds[b])]) == ("revolute", "prismatic") and second[a] >= 0:
            start = starts[a]
            axis = _joint_axis(x, start, tables["joint_flags"][a])
            centre, ratio = x[start:][_JOINT.slice("at_a")], x[place + COUPLER.block.place("ratio")]
            yield int(second[a]), _circle(centre, axis, abs(ratio))


def _circle(centre: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """(24, 3) points of a circle; none where there is no axis or radius."""
    length = float(np.linalg.norm(axis))
    if not (np.isfinite(length * radius) and length * radius > 0.0):
        return np.zeros((0, 3))
    across = np.linalg.svd((axis / length)[None, :])[2][1:]
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    return centre + radius * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1])


def _joint_axis(x: np.ndarray, start: int, flags: int) -> np.ndarray:
    n = x[start:]
    if int(flags) & _JOINT.fields["orientation"].bit:
        return quaternion_matrix(n[_JOINT.slice("orientation")])[:, 2]
    return n[_JOINT.slice("axis")]


def _links(tables: Mapping[str, Any], x: np.ndarray, attach: Any) -> Any:
    keys = ("name", "type", "a", "b", "x")
    for name, kind, a, b, start in zip(*(tables.get(f"element_{k}", ()) for k in keys), strict=True):
        block = _ELEMENTS[int(kind)].block
        at_a = x[start:][block.slice("at_a" if "at_a" in block.fields else "at")]
        at_b = x[start:][block.slice("at_b")] if "at_b" in block.fields else at_a  # a torsion spring acts at one point
        yield LinkGeometry(str(name), attach(int(a), at_a), attach(int(b), at_b), at_a, at_b, _ELEMENTS[int(kind)].type)


def _joints(tables: Mapping[str, Any], x: np.ndarray, attach: Any) -> Any:
    keys = ("name", "type", "a", "b", "flags", "x")
    for name, kind, a, b, flags, start in zip(*(tables.get(f"joint_{k}", ()) for k in keys), strict=True):
        at_a, at_b = x[start:][_JOINT.slice("at_a")], x[start:][_JOINT.slice("at_b")]
        axis = _joint_axis(x, start, flags)
        usable = np.all(np.isfinite(axis)) and np.any(axis != 0.0)
        yield JointGeometry(
            str(name), _JOINTS[int(kind)], attach(int(a), at_a), attach(int(b), at_b), at_a, axis if usable else None
        )
