"""Ports: where a load enters the model and where a motion is read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ModelError
from .expression_text import number_text
from .expressions import Expression
from .names import GROUND, not_found, shown
from .numbers import Number, numbers, vector
from .rotations import unit

Kind = Literal["force", "torque", "motion", "base"]
# the vector and the point in the name of a port
_VECTOR = re.compile(r"\.\(([^()]*)\)$")
_POINT = re.compile(r"@\(([^()]*)\)$")
KINDS: tuple[Kind, ...] = ("force", "torque", "motion", "base")


@dataclass(frozen=True)
class Port:
    """One scalar input or output of a model, by name: usable with every copy of the model it came from.

    Attributes
    ----------
    name
        Readable, such as ``payload.force.z``.
    kind
        "force" (N), "torque" (N m), "motion" (m or rad) or "base" (motion of ground).
    body, marker
        Names; ``body`` is "ground" for base motion, ``marker`` is None without one.
    point
        World point in the drawn configuration where it acts, or None: the marker's point, else the body's origin.
    direction
        Unit vector (3,), world axes.
    is_rotation
        True for torques and rotations.
    """

    name: str = field(compare=False)
    kind: Kind
    body: str
    marker: str | None
    point: tuple[float, float, float] | None
    direction: tuple[float, float, float]
    is_rotation: bool

    def __str__(self) -> str:
        return self.name


def make_port(kind: Kind, owner: str, body: str, marker: str | None, direction: Any, at: Any) -> Port:
    """A port on a body, a marker or ground; ``owner`` is what its name starts with."""
    where = f"the direction of {owner}.{kind}"
    turns = kind == "torque"
    if kind in ("motion", "base") and isinstance(direction, str) and direction.lstrip("+-").startswith("r"):
        turns = True
        vector_ = unit(direction.replace("r", "", 1), where)
    else:
        vector_ = unit(direction, where)
    point = None
    if at is not None:
        point = _plain_point(vector(at, f"at= of {owner}.{kind}"), f"{owner}.{kind}")
    return Port(_label(kind, owner, direction, point), kind, body, marker, point, vector_, turns)


def _plain_point(entries: list[Number], where: str) -> tuple[float, float, float]:
    if any(isinstance(v, Expression) for v in entries):
        raise ModelError(
            f"at= of {where} must be plain numbers; for a point that follows parameters define a marker there"
        )
    x, y, z = numbers(entries)
    return (x, y, z)


def _label(kind: Kind, owner: str, direction: Any, point: tuple[float, ...] | None) -> str:
    ending = direction if isinstance(direction, str) else "(" + ",".join(number_text(float(v)) for v in direction) + ")"
    place = "" if point is None else "@(" + ",".join(map(number_text, point)) + ")"
    return f"{owner}.{ending}{place}" if kind == "base" else f"{owner}.{kind}.{ending}{place}"


def base_motion(direction: str | ArrayLike) -> Port:
    """Motion of ground as a whole, as an input: translation "x", "y", "z" (or a vector (3,)), rotation "rx", "ry",
    "rz".

    Parameters
    ----------
    direction
        A name, or a vector in world axes, which is normalised.

    Returns
    -------
    Port
        An input of `mb.frf`, `mb.response` and `mb.state_space`. Its amplitude is a displacement in m or an angle in rad; a
        rotation turns ground about the world origin, and gravity keeps its direction in space.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.base_motion("z").name
    'base.z'
    """
    return make_port("base", "base", GROUND, None, direction, None)


def as_port(model: Any, spec: Any) -> Port:
    """A `Port` of this model from a port or its name ("payload.force.z", "base.z")."""
    if isinstance(spec, Port):
        _check_known(model, spec)
        return spec
    if not isinstance(spec, str):
        raise ModelError(f"an input or output must be a port such as body.force('z'), or its name; got {shown(spec)}")
    text, at = spec, None
    if hit := _POINT.search(spec):
        text, at = spec[: hit.start()], tuple(_plain_numbers(hit[1], spec))
    along: Any = None
    if hit := _VECTOR.search(text):
        text, along = text[: hit.start()] + ".vector", tuple(_plain_numbers(hit[1], spec))
    parts = text.split(".")
    if along is not None:
        parts[-1] = along
    if len(parts) == 4 and hasattr(model[parts[0]], "node"):
        node = model[parts[0]].node(parts[1])
        if parts[2] in ("force", "torque", "motion"):
            return _nowhere(getattr(node, parts[2])(parts[3]), at, spec)
    if len(parts) == 2 and parts[0] == "base":
        return _nowhere(base_motion(parts[1]), at, spec)
    if len(parts) != 3 or parts[1] not in ("force", "torque", "motion"):
        raise ModelError(
            f"the port {shown(spec)} must read like 'body.force.z', 'body.torque.x', 'body.motion.rz', 'body.force.(0.6,0,0.8)@(0,0,1)' "
            "or 'base.z'"
        )
    owner = model[parts[0]]
    if not hasattr(owner, "motion"):
        raise ModelError(f"the port {shown(spec)} is on {shown(owner)}, but only bodies and markers have ports")
    if at is not None and parts[1] != "torque" and owner.kind == "body" and hasattr(owner, "_port"):
        made: Port = owner._port(parts[1], parts[2], at)
        return made
    return _nowhere(getattr(owner, parts[1])(parts[2]), at, spec)


def _nowhere(port: Any, at: Any, spec: str) -> Port:
    """A port whose name has no point."""
    if at is not None:
        raise ModelError(f"the port {shown(spec)} has a point, which only forces and motions of bodies have")
    made: Port = port
    return made


def _plain_numbers(text: str, spec: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ModelError(f"the port {shown(spec)} has {shown(text)} where three numbers belong") from None


def _check_known(model: Any, port: Port) -> None:
    if port.kind != "base" and port.body != GROUND and not model.has_frame(port.body):
        raise not_found(
            f"the port {shown(port.name)} does not fit model {shown(model.name)}: no body", port.body, model.body_index
        )
    if port.marker is not None and port.marker not in model.marker_index:
        raise not_found(
            f"the port {shown(port.name)} does not fit model {shown(model.name)}: no marker",
            port.marker,
            model.marker_index,
        )


# "body.force.x" or a coordinate's name, its number, a direction (n,), directions (n, k) by column.
PortLike = Port | str | int | np.integer[Any] | ArrayLike
# One, or several.
Ports = PortLike | Sequence[PortLike]
