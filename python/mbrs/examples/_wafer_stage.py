"""A wafer stage on air mounts: the kind of machine on which Jiang, Chen and Luo (2011) made experiments; all data are invented."""

from __future__ import annotations

from ..errors import ModelError
from ..model.model import Model

# Invented: kg, kg m2; N/m, N m/rad, N s/m, N m s/rad.
_BASE, _LONG_STROKE, _CHUCK = (1200.0, (90.0, 110.0, 180.0)), (60.0, (1.4, 1.2, 2.2)), (12.0, (0.12, 0.12, 0.22))
_MOUNT_K, _MOUNT_C = (1.2e5, 1.2e5, 2.4e5), (600.0, 600.0, 1200.0)
_SERVO_K, _SERVO_C = 4e6, 6e3
_CHUCK_K, _CHUCK_C = (2e7, 2e7, 6e7, 4e5, 4e5, 3e5), (2e3, 2e3, 5e3, 40.0, 40.0, 30.0)


def wafer_stage(mounts: int = 4, length: float = 1.6, width: float = 1.2) -> Model:
    """A granite base on air mounts, two crossed slides held by their servos and a chuck on flexures.

    Parameters
    ----------
    mounts
        3 or 4 air mounts, bushings with three translations, under the corners (or two corners and a middle).
    length, width
        m, of the base along x and y.

    Returns
    -------
    Model
        4 bodies and 14 degrees of freedom: 6 of "base", 1 each of "y slide" and "x slide", 6 of "chuck". Parameter
        "k_mount" (3,). All data are invented.
    """
    if mounts not in (3, 4):
        raise ModelError(f"a wafer stage has 3 or 4 mounts, got mounts={mounts!r}")
    m = Model("wafer stage")
    k = m.parameter("k_mount", _MOUNT_K, unit="N/m")
    base = m.body("base", mass=_BASE[0], inertia=_BASE[1], at=(0, 0, 0.2))
    x, y = length / 2, width / 2
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)] if mounts == 4 else [(-x, -y), (x, -y), (0.0, y)]
    for i, (px, py) in enumerate(corners):
        stiffness = (k[0], k[1], k[2], 0.0, 0.0, 0.0)
        m.bushing(f"mount{i}", m.ground, base, at=(px, py, 0.0), k=stiffness, c=(*_MOUNT_C, 0.0, 0.0, 0.0))
    slide_y = m.body("y slide", mass=_LONG_STROKE[0], inertia=_LONG_STROKE[1], at=(0, 0, 0.45))
    slide_x = m.body(
        "x slide", mass=_LONG_STROKE[0] / 2, inertia=tuple(v / 2 for v in _LONG_STROKE[1]), at=(0, 0, 0.52)
    )
    chuck = m.body("chuck", mass=_CHUCK[0], inertia=_CHUCK[1], at=(0, 0, 0.6))
    m.prismatic("y guide", base, slide_y, at=(0, 0, 0.42), axis="y", k=_SERVO_K, c=_SERVO_C)
    m.prismatic("x guide", slide_y, slide_x, at=(0, 0, 0.49), axis="x", k=_SERVO_K, c=_SERVO_C)
    m.bushing("flexures", slide_x, chuck, at=(0, 0, 0.56), k=_CHUCK_K, c=_CHUCK_C)
    m.marker("wafer", chuck, at=(0, 0, 0.62))
    return m
