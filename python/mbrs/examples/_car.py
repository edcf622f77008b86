"""A car of fourteen degrees of freedom on double wishbones, over a bump."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..model.model import Model
from ..model.shapes import Cylinder

# Everything here is invented, of the size of a middle-class car: m, kg, N, s; x forwards, y left, z up from the road.
SPEED = 12.0
WHEEL_RADIUS = 0.31
AXLES = {"front": 1.2, "rear": -1.4}
HALF_TRACK = 0.75
# The car drives on a flat road first, so that designs that do not rest as drawn settle before they are judged.
BUMP_TIME, BUMP_LENGTH = 1.5, 3.0
BUMP_HEIGHTS = {"left": 0.06, "right": 0.03}
MASSES = {"chassis": 1250.0, "lower": 6.0, "upper": 4.0, "upright": 14.0, "wheel": 18.0, "patch": 2.0}
# (x from the axle, y of the left side, z)
POINTS = {
    "lower_inner": (0.0, 0.35, 0.22),
    "upper_inner": (0.0, 0.42, 0.46),
    "lower_ball": (0.01, 0.70, 0.20),
    "upper_ball": (-0.02, 0.66, 0.48),
    "rod_inner": (-0.12, 0.36, 0.26),
    "rod_outer": (-0.13, 0.68, 0.25),
    "spring_low": (0.0, 0.58, 0.21),
    "spring_top": (0.0, 0.50, 0.60),
}
# Of spring and tyre at 9.81 m/s2: the drawn car has no accelerations (tests/examples/test_gradient_examples.py).
PRELOADS = {"front": (-5390.164650919, -3713.386846154), "rear": (-4632.892083171, -3241.903153846)}
STIFFNESS = {"front": 6.0e4, "rear": 5.2e4}
DAMPING = {"front": 4.2e3, "rear": 3.8e3}
TYRE = {"k": 2.0e5, "c": 150.0, "slip": 3.0e3, "side": 4.0e3}


def _height(t: float, start: float, top: float) -> tuple[float, float, float]:
    """top sin^4 over the bump's length, with rate and acceleration: smooth to the third derivative."""
    u = (t - start) * SPEED / BUMP_LENGTH
    if not 0.0 < u < 1.0:
        return 0.0, 0.0, 0.0
    w = math.pi * SPEED / BUMP_LENGTH
    s, c = math.sin(math.pi * u), math.cos(math.pi * u)
    return top * s**4, 4 * top * w * s**3 * c, 4 * top * w * w * s * s * (3 * c * c - s * s)


def road_front_left(t: float) -> tuple[float, float, float]:
    """Height of the road under that wheel (m), its rate and acceleration."""
    return _height(t, BUMP_TIME, BUMP_HEIGHTS["left"])


def road_front_right(t: float) -> tuple[float, float, float]:
    """Height of the road under that wheel (m), its rate and acceleration."""
    return _height(t, BUMP_TIME, BUMP_HEIGHTS["right"])


def road_rear_left(t: float) -> tuple[float, float, float]:
    """The same a wheelbase later."""
    return road_front_left(t - (AXLES["front"] - AXLES["rear"]) / SPEED)


def road_rear_right(t: float) -> tuple[float, float, float]:
    """The same a wheelbase later."""
    return road_front_right(t - (AXLES["front"] - AXLES["rear"]) / SPEED)


ROADS = {
    ("front", "left"): road_front_left,
    ("front", "right"): road_front_right,
    ("rear", "left"): road_rear_left,
    ("rear", "right"): road_rear_right,
}


def car(gravity: float = 9.81) -> Model:
    """A car that drives at 12 m/s on four double wishbones over a bump, higher on the left: 14 degrees of freedom.

    ``gravity`` m/s2. Invented data. Per corner, such as "front left": bodies "front left lower" and "upper" (arms, hinged to
    "chassis"), "upright" (on their ball joints and on a tie rod, a distance joint), "wheel" (turns on the upright), "road"
    (follows the road's height by the drive of the same name) and "patch" (runs along the road with the wheel's turning, by a
    coupler): the tyre "front left tyre" is a bushing from the patch to the upright, springy upwards and with slip forces
    proportional to slip speeds. Elements "front left spring" between lower arm and chassis.

    Parameters, alike on both sides: ``front_spring_k``, ``front_spring_c``, ``rear_...``, ``tyre_k``, ``tyre_c``, and the hard
    points ``front_lower_ball`` (3,), ... as on the left side, world coordinates of the drawn car. Drawn at rest on its springs,
    whose preload does not follow the parameters; the bump comes after 1.5 s.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.car()).dof
    14
    """
    m = Model("car", gravity=(0.0, 0.0, -gravity))
    going = (SPEED, 0.0, 0.0)
    chassis = m.body(
        "chassis", mass=MASSES["chassis"], inertia=(520.0, 1900.0, 2100.0), at=(0, 0, 0.55), velocity=going
    )
    m.marker("driver", chassis, at=(0.1, 0.35, 0.6))
    tyre = m.parameter("tyre_k", TYRE["k"], unit="N/m"), m.parameter("tyre_c", TYRE["c"], unit="N s/m")
    for axle, x in AXLES.items():
        k, c = (
            m.parameter(f"{axle}_spring_{n}", v[axle], unit=u)
            for n, v, u in (("k", STIFFNESS, "N/m"), ("c", DAMPING, "N s/m"))
        )
        points = {n: m.parameter(f"{axle}_{n}", np.add(p, (x, 0, 0)), unit="m") for n, p in POINTS.items()}
        for side, sign in (("left", 1), ("right", -1)):
            at = {n: (p[0], sign * p[1], p[2]) for n, p in points.items()}
            _corner(m, axle, side, at, (k, c), tyre, np.multiply(PRELOADS[axle], gravity / 9.81))
    return m


def _middle(x: float, sign: int, *names: str) -> np.ndarray:
    return np.mean([np.multiply(POINTS[n], (1, sign, 1)) for n in names], axis=0) + (x, 0, 0)


def _corner(
    m: Model, axle: str, side: str, at: dict[str, Any], spring: tuple[Any, Any], tyre: tuple[Any, Any], preload: Any
) -> None:
    name, sign, x, r = f"{axle} {side}", 1 if side == "left" else -1, AXLES[axle], WHEEL_RADIUS
    hub, ground = np.array([x, sign * HALF_TRACK, r]), np.array([x, sign * HALF_TRACK, 0.0])
    chassis, going = m["chassis"], (SPEED, 0.0, 0.0)
    lower = _arm(m, f"{name} lower", _middle(x, sign, "lower_inner", "lower_ball"), MASSES["lower"])
    upper = _arm(m, f"{name} upper", _middle(x, sign, "upper_inner", "upper_ball"), MASSES["upper"])
    upright = m.body(
        f"{name} upright",
        mass=MASSES["upright"],
        inertia=(0.18, 0.18, 0.1),
        at=hub - (0, 0.06 * sign, 0),
        velocity=going,
    )
    spin = (0.0, SPEED / r, 0.0)
    wheel = m.body(
        f"{name} wheel",
        mass=MASSES["wheel"],
        inertia=(0.5, 0.9, 0.5),
        at=hub,
        angular_velocity=spin,
        velocity=going,
        shape=Cylinder(r, 0.2, "y", colour="#4a5058"),
    )
    road = m.body(f"{name} road", mass=1.0, inertia=(1.0, 1.0, 1.0), at=ground)
    patch = m.body(f"{name} patch", mass=MASSES["patch"], inertia=(0.1, 0.1, 0.1), at=ground, velocity=going)
    m.revolute(f"{name} lower hinge", chassis, lower, at=at["lower_inner"], axis="x")
    m.revolute(f"{name} upper hinge", chassis, upper, at=at["upper_inner"], axis="x")
    m.spherical(f"{name} lower ball", lower, upright, at=at["lower_ball"])
    m.spherical(f"{name} upper ball", upper, upright, at=at["upper_ball"])
    m.distance(f"{name} tie rod", chassis, upright, at=(at["rod_inner"], at["rod_outer"]))
    turn = m.revolute(f"{name} bearing", upright, wheel, at=hub, axis="y")
    lift = m.prismatic(f"{name} lift", m.ground, road, at=ground, axis="z")
    run = m.prismatic(f"{name} run", road, patch, at=ground, axis="x")
    m.coupler(f"{name} rolling", turn, run, r)
    m.drive(f"{name} bump", lift, ROADS[axle, side])
    k, c = spring
    suspension, load = preload
    m.spring_damper(
        f"{name} spring", lower, chassis, at=(at["spring_low"], at["spring_top"]), k=k, c=c, preload=suspension
    )
    m.bushing(
        f"{name} tyre",
        patch,
        upright,
        at=hub,
        k=(0, 0, tyre[0], 0, 0, 0),
        c=(TYRE["slip"], TYRE["side"], tyre[1], 0, 0, 0),
        preload=(0, 0, load, 0, 0, 0),
    )


def _arm(m: Model, name: str, at: np.ndarray, mass: float) -> Any:
    return m.body(name, mass=mass, inertia=(0.05, 0.02, 0.05), at=at, velocity=(SPEED, 0.0, 0.0))
