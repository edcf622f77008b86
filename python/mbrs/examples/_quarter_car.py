"""A quarter of a car over a bump."""

from __future__ import annotations

import math

from ..model.model import Model

BUMP_HEIGHT, BUMP_TIME = 0.05, 0.12  # m, s


def bump(t: float) -> tuple[float, float, float]:
    """Height (m), rate and acceleration of the road under the wheel: h (1 - cos w t) / 2 for one period of 0.12 s."""
    if not 0.0 <= t <= BUMP_TIME:
        return 0.0, 0.0, 0.0
    w, half = 2 * math.pi / BUMP_TIME, 0.5 * BUMP_HEIGHT
    return half * (1 - math.cos(w * t)), half * w * math.sin(w * t), half * w * w * math.cos(w * t)


def quarter_car(
    body: float = 350.0,
    wheel: float = 40.0,
    suspension: tuple[float, float] = (2.2e4, 1.4e3),
    tyre: tuple[float, float] = (1.9e5, 100.0),
    gravity: float = 9.81,
) -> Model:
    """A "body" on a "wheel" on the "road", which the drive "bump" lifts by 50 mm for 0.12 s; all move along z.

    ``body`` and ``wheel`` kg; ``suspension`` and ``tyre`` (N/m, N s/m); drawn at rest under the weight. The road is a
    body that the drive holds, so its mass does not matter. Joints "road guide", "wheel guide", "body guide"; elements
    "suspension" and "tyre". Invented data of a usual size.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.quarter_car()).dof
    2
    """
    m = Model("quarter car", gravity=(0.0, 0.0, -gravity))
    heights = {"road": 0.0, "wheel": 0.3, "body": 0.8}
    masses = {"road": 1.0, "wheel": wheel, "body": body}
    parts = {
        name: m.body(name, mass=masses[name], inertia=(1.0, 1.0, 1.0), at=(0, 0, z)) for name, z in heights.items()
    }
    for name, part in parts.items():
        m.prismatic(f"{name} guide", m.ground, part, at=(0, 0, heights[name]), axis="z")
    low, middle, high = ((0, 0, z) for z in heights.values())
    (k, c), (kt, ct) = suspension, tyre
    weight = body * gravity
    m.spring_damper("suspension", parts["wheel"], parts["body"], at=(middle, high), k=k, c=c, preload=-weight)
    m.spring_damper(
        "tyre", parts["road"], parts["wheel"], at=(low, middle), k=kt, c=ct, preload=-weight - wheel * gravity
    )
    m.drive("bump", "road guide", bump)
    return m
