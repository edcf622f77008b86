"""A standing four-legged robot: topology of Jiang, Chen and Luo (2011), all data invented."""

from __future__ import annotations

from typing import Any

from ..model.model import Model

# Invented. kg, (kg m2), m; a leg bends backwards at the knee, so that the foot is not under the hip's axis.
_TORSO = (30.0, (0.9, 0.5, 1.2))
_HIP, _THIGH, _SHANK = (1.2, (2e-3, 2e-3, 1.5e-3)), (2.0, (1.6e-2, 1.6e-2, 2e-3)), (1.0, (8e-3, 8e-3, 8e-4))
_JOINT_K, _JOINT_C = 400.0, 1.5
# The motors of the hips hold them: turning freely they would let the torso sway sideways without any stiffness.
_YAW_K, _YAW_C = 250.0, 1.0
_FOOT_K, _FOOT_C = (4e4, 4e4, 8e4), (60.0, 60.0, 120.0)


def quadruped(length: float = 0.8, width: float = 0.4, height: float = 0.6, gravity: float = 0.0) -> Model:
    """A torso on four legs of three bodies: 13 bodies, 18 degrees of freedom (6 + 4 x 3), an open tree.

    Hips turn about z, thighs and shanks about x with torsion springs, each foot rests on a three-component
    spring-damper (docs/theory.md (23.4)); ``length`` and ``width`` of the torso and ``height`` of the hips in m;
    ``gravity`` m/s2 downwards, none by default since the drawn posture would then not be in equilibrium. All other data
    are invented.

    Bodies "torso", "hip-FL", "thigh-FL", "shank-FL" (front and rear, left and right), springs "foot-FL", ...; parameter
    "k_foot" (3,) is shared by all feet, "k_leg" by all torsion springs.
    """
    m = Model("quadruped", gravity=(0.0, 0.0, -gravity) if gravity else None)
    k_leg, k_foot = m.parameter("k_leg", _JOINT_K, unit="N m/rad"), m.parameter("k_foot", _FOOT_K, unit="N/m")
    torso = m.body("torso", mass=_TORSO[0], inertia=_TORSO[1], at=(0, 0, height))
    for end, y in (("F", length / 2), ("R", -length / 2)):
        for side, x in (("L", -width / 2), ("R", width / 2)):
            _leg(m, torso, end + side, x, y, height, k_leg, k_foot)
    return m


def _leg(m: Model, torso: Any, label: str, x: float, y: float, height: float, k_leg: Any, k_foot: Any) -> None:
    hip_z, knee_z = 0.9 * height, 0.45 * height
    knee_y, foot_y = y - 0.2 * height, y - 0.1 * height
    hip = m.body(f"hip-{label}", mass=_HIP[0], inertia=_HIP[1], at=(x, y, 0.95 * height))
    thigh_at = (x, (y + knee_y) / 2, (hip_z + knee_z) / 2)
    thigh = m.body(f"thigh-{label}", mass=_THIGH[0], inertia=_THIGH[1], at=thigh_at)
    shank = m.body(f"shank-{label}", mass=_SHANK[0], inertia=_SHANK[1], at=(x, (knee_y + foot_y) / 2, knee_z / 2))
    m.revolute(f"yaw-{label}", torso, hip, at=(x, y, height), axis="z", k=_YAW_K, c=_YAW_C)
    m.revolute(f"pitch-{label}", hip, thigh, at=(x, y, hip_z), axis="x")
    m.revolute(f"knee-{label}", thigh, shank, at=(x, knee_y, knee_z), axis="x")
    m.torsion(f"pitch spring-{label}", hip, thigh, at=(x, y, hip_z), axis="x", k=k_leg, c=_JOINT_C)
    m.torsion(f"knee spring-{label}", thigh, shank, at=(x, knee_y, knee_z), axis="x", k=k_leg, c=_JOINT_C)
    stiffness = (k_foot[0], k_foot[1], k_foot[2], 0.0, 0.0, 0.0)
    m.bushing(f"foot-{label}", m.ground, shank, at=(x, foot_y, 0.0), k=stiffness, c=(*_FOOT_C, 0.0, 0.0, 0.0))
