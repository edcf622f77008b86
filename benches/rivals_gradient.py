"""A double pendulum of five parameters in mbrs and in Exudyn, and its derivatives by complex steps. Invented data.

Links of 1 m, hinged at the origin, hanging straight at 0.3 rad; a damper d1 in the upper hinge, a spring k2 and a damper in the
lower one; m1 the upper mass, J2 the lower inertia, c2 from the lower hinge to the lower centre of mass.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

VALUES = {"m1": 1.0, "J2": 0.08, "k2": 20.0, "d1": 0.3, "c2": 0.5}
GRAVITY, ANGLE, END, DAMPER, INERTIA = 9.81, 0.3, 1.0, 0.1, 0.08


def pendulum() -> tuple[Any, list[Any]]:
    """The model with its parameters, and the two angles at the end as objectives."""
    import mbrs as mb

    m = mb.Model("double pendulum", gravity=(0, -GRAVITY, 0))
    p = {name: m.parameter(name, value) for name, value in VALUES.items()}
    down = np.array([np.sin(ANGLE), -np.cos(ANGLE), 0.0])
    turned = mb.rotation("z", ANGLE)
    upper = m.body("upper", mass=p["m1"], inertia=(0.08, 0.01, INERTIA), at=0.5 * down, orientation=turned)
    place = tuple(float(x) * (1 + p["c2"]) if x else 0.0 for x in down)
    lower = m.body("lower", mass=1.0, inertia=(0.08, 0.01, p["J2"]), at=place, orientation=turned)
    m.revolute("A", m.ground, upper, at=(0, 0, 0), axis="z", c=p["d1"])
    m.revolute("B", upper, lower, at=down, axis="z", k=p["k2"], c=DAMPER)
    return m, [mb.Final(lambda s: s.joint("A")), mb.Final(lambda s: s.joint("B"))]


def _slope(y: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Lagrange's equations in the absolute angles, columns of y (4, n) for columns of p (5, n)."""
    (m1, J2, k2, d1, c2), (a, b, va, vb) = p, y
    far, near = m1 * 0.25 + INERTIA + 1.0, c2**2 + J2
    mixed, turning = c2 * np.cos(a - b), c2 * np.sin(a - b)
    between = k2 * (b - a) + DAMPER * (vb - va)
    on_a = -turning * vb**2 - GRAVITY * (0.5 * m1 + 1.0) * np.sin(a) - d1 * va + between
    on_b = turning * va**2 - GRAVITY * c2 * np.sin(b) - between
    det = far * near - mixed**2
    return np.array([va, vb, (near * on_a - mixed * on_b) / det, (far * on_b - mixed * on_a) / det])


def pendulum_truth(steps: int = 4000) -> np.ndarray:
    """(2, 5): derivatives of both joint angles at the end, by complex steps through the classical Runge-Kutta scheme."""
    values = np.array(list(VALUES.values()))
    p = values[:, None] + 1j * 1e-40 * np.eye(5)
    y = np.zeros((4, 5), dtype=complex)
    y[:2] = ANGLE
    h = END / steps
    for _ in range(steps):
        k1 = _slope(y, p)
        k2 = _slope(y + h / 2 * k1, p)
        k3 = _slope(y + h / 2 * k2, p)
        k4 = _slope(y + h * k3, p)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    d = y.imag / 1e-40
    return np.array([d[0], d[1] - d[0]])


def pendulum_in_exudyn(size: float, steps: int = 1000) -> tuple[float, np.ndarray]:
    """CPU seconds and (2, 5) of Exudyn's ComputeSensitivities: forward differences of whole simulations."""
    from exudyn.processing import ComputeSensitivities

    names = list(VALUES)
    ranges = {name: (value, size, 0) for name, value in VALUES.items()}
    begin = time.process_time()
    found = ComputeSensitivities(
        lambda given: _angles_in_exudyn(given, steps), ranges, useMultiProcessing=False, showProgress=False
    )
    seconds = time.process_time() - begin
    return seconds, np.asarray(found[-1]).reshape(len(names), 2).T


def _angles_in_exudyn(p: dict[str, float], steps: int) -> list[float]:
    import exudyn as exu
    from exudyn.utilities import RigidBodyInertia

    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.CreateGround()
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    down = np.array([s, -c, 0.0])
    common = {
        "nodeType": exu.NodeType.RotationEulerParameters,
        "referenceRotationMatrix": turned,
        "gravity": [0.0, -GRAVITY, 0.0],
    }
    bodies = []
    for mass, inertia, reach in ((p["m1"], INERTIA, 0.5), (1.0, p["J2"], 1 + p["c2"])):
        own = RigidBodyInertia(mass=mass, com=[0, 0, 0], inertiaTensor=np.diag([0.08, 0.01, inertia]))
        bodies.append(mbs.CreateRigidBody(inertia=own, referencePosition=list(reach * down), **common))
    upper, lower = bodies
    mbs.CreateRevoluteJoint(bodyNumbers=[ground, upper], position=[0, 0, 0], axis=[0, 0, 1])
    mbs.CreateRevoluteJoint(bodyNumbers=[upper, lower], position=list(down), axis=[0, 0, 1])

    def about_z(value: float) -> np.ndarray:
        return np.diag([0.0, 0.0, 0.0, 0.0, 0.0, value])

    mbs.CreateRigidBodySpringDamper(
        bodyNumbers=[ground, upper], localPosition1=[0, 0.5, 0], stiffness=about_z(0.0), damping=about_z(p["d1"])
    )
    mbs.CreateRigidBodySpringDamper(
        bodyNumbers=[upper, lower],
        localPosition0=[0, -0.5, 0],
        localPosition1=[0, p["c2"], 0],
        stiffness=about_z(p["k2"]),
        damping=about_z(DAMPER),
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime, integration.verboseMode = steps, END, 0
    integration.newton.relativeTolerance = 1e-10
    if hasattr(settings.solution, "file"):
        settings.solution.file.write = False
    else:
        settings.solution.writeSolutionToFile = False
    mbs.SolveDynamic(settings)
    angles = []
    for body in (upper, lower):
        R = np.reshape(mbs.GetObjectOutputBody(body, exu.OutputVariableType.RotationMatrix), (3, 3))
        angles.append(float(np.arctan2(R[1, 0], R[0, 0])))
    return [angles[0], angles[1] - angles[0]]
