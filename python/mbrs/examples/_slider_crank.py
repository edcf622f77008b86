"""A slider-crank with a rigid or an elastic rod."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..flexible import beam
from ..model.model import Model
from ..model.rotations import rotation
from ._links import rod

_ROD_MASS = 0.76  # kg


def slider_crank(
    crank: float = 0.15,
    length: float = 0.35,
    speed: float = 12.0,
    angle: float = 0.3,
    gravity: float = 9.81,
    stiffness: float | None = None,
) -> Model:
    """A crank turning freely about z in the drawing's plane, a rod and a slider along x: one degree of freedom.

    ``crank`` and ``length`` (of the rod) m, ``speed`` rad/s and ``angle`` rad of the crank as drawn, ``gravity`` m/s2
    downwards (-y), ``stiffness`` N m2 of a rod that bends (rigid without it), with the node "middle".
    Joints "main", "crank pin", "slider pin" and "guide"; marker "pin" on the crank pin. Spatial joints on a planar loop: three
    redundant constraints. All data invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.slider_crank()).dof
    1
    """
    m = Model("slider-crank", gravity=(0.0, -gravity, 0.0))
    c, s = np.cos(angle), np.sin(angle)
    pin = np.array([crank * c, crank * s])
    tilt = -np.arcsin(crank * s / length)
    end = np.array([pin[0] + length * np.cos(tilt), 0.0])
    v_pin = speed * crank * np.array([-s, c])
    # the slider's velocity makes the rod's ends approach at no rate
    v_end = np.array([v_pin @ (end - pin) / (end[0] - pin[0]), 0.0])
    one = rod(m, "crank", [(0, 0), pin], 0.38, [(0, 0), v_pin])
    if stiffness is None:
        two = held = far = rod(m, "rod", [pin, end], _ROD_MASS, [v_pin, v_end])
    else:
        two = _elastic_rod(m, pin, end, v_pin, v_end, stiffness)
        held, far = two.node("root"), two.node("tip")
    three = m.body("slider", mass=1.2, inertia=(1e-3, 1e-3, 1e-3), at=(*end, 0.0), velocity=(*v_end, 0.0))
    m.revolute("main", m.ground, one, at=(0, 0, 0), axis="z")
    m.revolute("crank pin", one, held, at=(*pin, 0), axis="z")
    m.revolute("slider pin", far, three, at=(*end, 0), axis="z")
    m.prismatic("guide", m.ground, three, at=(*end, 0), axis="x")
    m.marker("pin", one, at=(*pin, 0))
    return m


def _elastic_rod(
    m: Model, pin: np.ndarray, end: np.ndarray, v_pin: np.ndarray, v_end: np.ndarray, stiffness: float
) -> Any:
    """A uniform beam whose frame is at the crank pin; a static shape for the other end, two more for what is between."""
    along = end - pin
    length = float(np.linalg.norm(along))
    bending = beam(
        length,
        mass=_ROD_MASS / length,
        EI_flap=4 * stiffness,
        EI_edge=stiffness,
        elements=20,
        modes=2,
        attach=["tip"],
        nodes={"middle": 0.5 * length},
        damping=0.01,
    )
    turning = (along[0] * (v_end - v_pin)[1] - along[1] * (v_end - v_pin)[0]) / length**2
    return m.flexible_body(
        "rod",
        bending,
        at=(*pin, 0.0),
        orientation=rotation("z", float(np.arctan2(along[1], along[0]))),
        velocity=(*v_pin, 0.0),
        angular_velocity=(0.0, 0.0, float(turning)),
    )
