"""Several joints in a row between the same two bodies, as one joint of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import ModelError
from ..model.schema import JOINTS
from ._poses import Array

# Sine of the angle by which axes of one composite may miss a right angle or being parallel, and the distance of axes over the size of
# the link by which they may miss each other. Too small: hand-typed axes of seven digits are refused. Too large: a leaning axis is
# straightened. Pinned by tests/io/test_mjcf.py.
ALIGNED = 1e-6


@dataclass
class Hinge:
    """One joint as a file has it: between a link and what carries it, drawn in world axes."""

    name: str
    kind: str  # of `Model`: revolute, prismatic, spherical, planar, free
    at: Array
    axis: Array
    k: float = 0.0
    c: float = 0.0
    preload: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    where: str = ""


@dataclass
class Composite:
    """One joint of `Model`: its type, point, frame, forces, and where the coordinates of the parts are."""

    name: str
    kind: str
    at: Array
    frame: dict[str, Any]
    # (part, coordinate of the joint, sign of the part's coordinate)
    places: list[tuple[Hinge, str, float]]
    notes: list[str] = field(default_factory=list)

    def _values(self, key: str, odd: bool = False) -> Array:
        """One number for each free coordinate of the joint in their order; odd quantities change sign with the coordinate."""
        names = JOINTS[self.kind].coordinates
        out = np.zeros(len(names))
        for hinge, name, sign in self.places:
            out[names.index(name)] = getattr(hinge, key) * (sign if odd else 1.0)
        return out if len(self.places) != 1 or len(names) == 1 else self._spread(key)

    def _spread(self, key: str) -> Array:
        """One ball, plane or floating joint of a file has one number for all its coordinates."""
        return np.full(len(JOINTS[self.kind].coordinates), getattr(self.places[0][0], key))

    @property
    def k(self) -> Array:
        """Stiffness of each coordinate."""
        return self._values("k")

    @property
    def c(self) -> Array:
        """Damping of each coordinate."""
        return self._values("c")

    @property
    def preload(self) -> Array:
        """Force of each coordinate as drawn."""
        return self._values("preload", odd=True)

    @property
    def friction(self) -> dict[str, float]:
        """Dry friction by coordinate."""
        return dict(zip(JOINTS[self.kind].coordinates, self._values("friction").tolist(), strict=True))


def compose(hinges: Sequence[Hinge], size: float, where: str) -> Composite:
    """The joint that moves as several in a row do; ``size`` (m) is that of the link."""
    name = "+".join(h.name for h in hinges)
    if len(hinges) == 1:
        return _single(hinges[0])
    kinds = "".join("s" if h.kind == "prismatic" else "r" if h.kind == "revolute" else "?" for h in hinges)
    slides = [h for h in hinges if h.kind == "prismatic"]
    turns = [h for h in hinges if h.kind == "revolute"]
    at = _meeting(turns, size) if len(turns) > 1 and "?" not in kinds else (turns[0].at if turns else None)
    if at is not None:
        if kinds in ("sr", "rs") and _parallel(slides[0], turns[0]):
            sign = 1.0 if slides[0].axis @ turns[0].axis > 0.0 else -1.0
            return Composite(
                name, "cylindrical", at, {"axis": turns[0].axis}, [(slides[0], "z", sign), (turns[0], "rz", 1.0)]
            )
        if kinds == "rr" and _square(turns):
            frame = {"axis": turns[0].axis, "axis2": turns[1].axis}
            return Composite(name, "universal", at, frame, [(turns[0], "rz", 1.0), (turns[1], "rx", 1.0)])
        if kinds == "rrr" and _square(turns):
            return _cardan(name, "spherical", at, [], turns)
        if kinds == "ssr" and _square(slides) and _square([slides[0], turns[0]]) and _square([slides[1], turns[0]]):
            x, y = (_unit(s.axis) for s in slides)
            normal = np.cross(x, y)
            sign = 1.0 if normal @ turns[0].axis > 0.0 else -1.0
            frame = {"orientation": np.column_stack([x, y, normal])}
            return Composite(
                name, "planar", at, frame, [(slides[0], "x", 1.0), (slides[1], "y", 1.0), (turns[0], "rz", sign)]
            )
        if kinds == "sssrrr" and _square(slides) and _square(turns):
            return _cardan(name, "free", at, slides, turns)
    words = ", ".join(f"{h.kind} {h.name!r}" for h in hinges)
    raise ModelError(
        f"{where} has {len(hinges)} joints in a row ({words}), which no joint of mbrs replaces: two bodies have one joint between them. "
        "Put a body with its small mass between the joints"
    )


def _single(hinge: Hinge) -> Composite:
    names = JOINTS[hinge.kind].coordinates
    frame: dict[str, Any] = {} if hinge.kind in ("spherical", "free") else {"axis": hinge.axis}
    notes = []
    if hinge.kind in ("spherical", "free") and (hinge.c or hinge.friction):
        # dampers of a model act on the rates of its coordinates, here of the rotation vector
        notes = ["damping of an angular velocity, now of the rate of the rotation vector: equal for small angles"]
    return Composite(hinge.name, hinge.kind, hinge.at, frame, [(hinge, names[0], 1.0)], notes)


def _cardan(name: str, kind: str, at: Array, slides: Sequence[Hinge], turns: Sequence[Hinge]) -> Composite:
    """Three turns about axes at right angles as one rotation; the same motions, other coordinates."""
    x, y = _unit(turns[0].axis), _unit(turns[1].axis)
    frame = np.column_stack([x, y, np.cross(x, y)])
    third = 1.0 if frame[:, 2] @ turns[2].axis > 0.0 else -1.0
    places = list(zip(turns, ("rx", "ry", "rz"), (1.0, 1.0, third), strict=True))
    notes = ["three hinges, now one joint with a rotation vector for coordinate"]
    if slides:
        turn = frame.T @ np.column_stack([_unit(s.axis) for s in slides])
        order = np.argmax(np.abs(turn), axis=0)
        if any(h.k or h.c or h.preload or h.friction for h in slides) and (
            len(set(order)) < 3 or np.abs(np.abs(turn) - np.eye(3)[:, order]).max() > ALIGNED
        ):
            raise ModelError(
                f"the slides of {name} have springs or dampers along axes that are not those of its hinges"
            )
        signs = np.sign(turn[order, range(3)])
        places = [(s, "xyz"[o], float(v)) for s, o, v in zip(slides, order, signs, strict=True)] + places
        notes[0] = "three slides and three hinges, now one free joint"
    if any(h.k or h.c or h.preload or h.friction for h in turns):
        notes.append(
            "springs, dampers and friction of three hinges, now about the axes of one joint: equal for small angles"
        )
    return Composite(name, kind, at, {"orientation": frame}, places, notes)


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v)


def _parallel(a: Hinge, b: Hinge) -> bool:
    return bool(np.linalg.norm(np.cross(_unit(a.axis), _unit(b.axis))) <= ALIGNED)


def _square(hinges: Sequence[Hinge]) -> bool:
    """Are all axes at right angles?"""
    axes = np.array([_unit(h.axis) for h in hinges])
    return bool(np.abs(axes @ axes.T - np.eye(len(axes))).max() <= ALIGNED)


def _meeting(hinges: Sequence[Hinge], size: float) -> Array | None:
    """The point where all axes meet, or None: least squares of the distances from the lines."""
    normal = [np.eye(3) - np.outer(a, a) for a in (_unit(h.axis) for h in hinges)]
    whole = sum(normal)
    if np.linalg.cond(whole) > 1.0 / ALIGNED:
        return None
    at = np.linalg.solve(whole, sum(n @ h.at for n, h in zip(normal, hinges, strict=True)))
    far = max(float(np.linalg.norm(n @ (at - h.at))) for n, h in zip(normal, hinges, strict=True))
    return at if far <= ALIGNED * max(size, float(np.ptp([h.at for h in hinges], axis=0).max())) else None
