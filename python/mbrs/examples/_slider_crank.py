"""A slider-crank with rigid rod."""

from __future__ import annotations

import numpy as np

from ..model import Model
from ._links import rod


def slider_crank(
    crank: float = 0.15, length: float = 0.35, speed: float = 12.0, angle: float = 0.3, gravity: float = 9.81
) -> Model:
    """A crank turning freely about z in the drawing's plane, a rod and a slider along x: one degree of freedom.

    ``crank`` and ``length`` (of the rod) m, ``speed`` rad/s and ``angle`` rad of the crank as drawn, ``gravity`` m/s2
    downwards (-y). Joints "main", "crank pin", "slider pin" and "guide"; marker "pin" on the crank pin. Spatial joints
    on a planar loop: three redundant constraints. All data invented.

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
    two = rod(m, "rod", [pin, end], 0.76, [v_pin, v_end])
    three = m.body("slider", mass=1.2, inertia=(1e-3, 1e-3, 1e-3), at=(*end, 0.0), velocity=(*v_end, 0.0))
    m.revolute("main", m.ground, one, at=(0, 0, 0), axis="z")
    m.revolute("crank pin", one, two, at=(*pin, 0), axis="z")
    m.revolute("slider pin", two, three, at=(*end, 0), axis="z")
    m.prismatic("guide", m.ground, three, at=(*end, 0), axis="x")
    m.marker("pin", one, at=(*pin, 0))
    return m
