"""Motions in Exudyn beside those of mbrs. ImportError means: not installed. The model data are those of mb.examples.

Each function returns CPU seconds of the solver alone, and what it reached.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

GRAVITY = 9.81


def _settings(exu: Any, end: float, steps: int, rho: float, every: float) -> Any:
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime, integration.verboseMode = steps, end, 0
    integration.generalizedAlpha.spectralRadius = rho
    integration.newton.useModifiedNewton = True
    integration.automaticStepSize = False
    integration.explicit.useLieGroupIntegration = True
    settings.solution.sensors.writePeriod = every
    # the name of this switch moved between versions
    if hasattr(settings.solution, "file"):
        settings.solution.file.write = False
    else:
        settings.solution.writeSolutionToFile = False
    return settings


def _timed(exu: Any, mbs: Any, settings: Any, solver: str) -> float:
    begin = time.process_time()
    mbs.SolveDynamic(settings, solverType=getattr(exu.DynamicSolverType, solver))
    return time.process_time() - begin


def four_bars(n: int, h: float, end: float, rho: float = 0.9) -> tuple[float, float, np.ndarray]:
    """Planar rods and hinges, the fastest setting: CPU seconds, largest energy drift (J), position of the first tip."""
    import exudyn as exu
    from exudyn.utilities import (
        LoadMassProportional,
        MarkerBodyMass,
        MarkerBodyPosition,
        NodeRigidBody2D,
        ObjectGround,
        RevoluteJoint2D,
        RigidBody2D,
        SensorUserFunction,
    )

    inertia, count = 1.0 / 12.0, 2 * n + 1
    poses = [(i, 0.5, np.pi / 2) for i in range(n + 1)] + [(i + 0.5, 1.0, 0.0) for i in range(n)]
    rates = [(0.5, 0.0, -1.0)] * (n + 1) + [(1.0, 0.0, 0.0)] * n

    def build(watched: bool) -> tuple[Any, Any, Any]:
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        low, high = [], []
        for pose, rate in zip(poses, rates, strict=True):
            node = mbs.AddNode(NodeRigidBody2D(referenceCoordinates=list(pose), initialVelocities=list(rate)))
            body = mbs.AddObject(RigidBody2D(nodeNumber=node, physicsMass=1.0, physicsInertia=inertia))
            weight = mbs.AddMarker(MarkerBodyMass(bodyNumber=body))
            mbs.AddLoad(LoadMassProportional(markerNumber=weight, loadVector=[0, -GRAVITY, 0]))
            low.append(mbs.AddMarker(MarkerBodyPosition(bodyNumber=body, localPosition=[-0.5, 0, 0])))
            high.append(mbs.AddMarker(MarkerBodyPosition(bodyNumber=body, localPosition=[0.5, 0, 0])))
        ground = mbs.AddObject(ObjectGround())
        feet = [mbs.AddMarker(MarkerBodyPosition(bodyNumber=ground, localPosition=[i, 0, 0])) for i in range(n + 1)]
        pairs = list(zip(feet, low, strict=False))
        pairs += [(high[i], low[n + 1 + i]) for i in range(n)] + [(high[i + 1], high[n + 1 + i]) for i in range(n)]
        for pair in pairs:
            mbs.AddObject(RevoluteJoint2D(markerNumbers=list(pair)))

        def energy(mbs: Any, *_: Any) -> list[float]:
            q = mbs.systemData.GetODE2Coordinates().reshape(count, 3) + np.array(poses)
            v = mbs.systemData.GetODE2Coordinates_t().reshape(count, 3)
            kinetic = 0.5 * np.sum(v[:, :2] ** 2) + 0.5 * inertia * np.sum(v[:, 2] ** 2)
            return [float(kinetic + GRAVITY * np.sum(q[:, 1]))]

        sensor = None
        if watched:
            sensor = mbs.AddSensor(
                SensorUserFunction(sensorNumbers=[], factors=[], sensorUserFunction=energy, storeInternal=True)
            )
        mbs.Assemble()
        return container, mbs, sensor

    def run(watched: bool) -> tuple[float, Any, Any, Any]:
        container, mbs, sensor = build(watched)
        settings = _settings(exu, end, round(end / h), rho, 0.01)
        linear = "EXUdense" if n == 1 else "EigenSparse"
        settings.linearSolver.solverType = getattr(exu.LinearSolverType, linear)
        return _timed(exu, mbs, settings, "GeneralizedAlpha"), container, mbs, sensor

    _, keep, mbs, sensor = run(True)
    history = mbs.GetSensorStoredData(sensor)
    drift = float(np.max(np.abs(history[:, 1] - history[0, 1])))
    centre = mbs.systemData.GetODE2Coordinates()[:2] + np.array([0.0, 0.5])
    seconds = min(run(False)[0] for _ in range(3 if n == 1 else 1))
    del keep
    return seconds, drift, 2.0 * centre


def heavy_top(solver: str, h: float, end: float, rho: float = 0.9) -> tuple[float, np.ndarray]:
    """CPU seconds and the last position of the centre of mass; explicit solvers get a body that turns about the pivot."""
    import exudyn as exu
    from exudyn.utilities import (
        CoordinateConstraint,
        Force,
        MarkerBodyPosition,
        MarkerNodeCoordinate,
        NodePointGround,
        NodeRigidBodyRotVecLG,
        ObjectRigidBody,
        RigidBodyInertia,
        SensorBody,
    )

    mass, about_centre = 15.0, np.diag([0.234375, 0.46875, 0.234375])
    arm, w = np.array([0.0, 1.0, 0.0]), np.array([0.0, 150.0, -4.61538])
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    if solver == "GeneralizedAlpha":
        ground = mbs.CreateGround()
        body = mbs.CreateRigidBody(
            inertia=RigidBodyInertia(mass=mass, com=[0, 0, 0], inertiaTensor=about_centre),
            nodeType=exu.NodeType.RotationEulerParameters,
            referencePosition=list(arm),
            initialVelocity=list(np.cross(w, arm)),
            initialAngularVelocity=list(w),
            gravity=[0, 0, -GRAVITY],
        )
        mbs.CreateSphericalJoint(itemNumbers=[ground, body], position=[0, 0, 0])
        local = [0, 0, 0]
    else:
        about_pivot = np.diag(about_centre) + mass * np.array([1.0, 0.0, 1.0])
        node = mbs.AddNode(NodeRigidBodyRotVecLG(referenceCoordinates=[0.0] * 6, initialVelocities=[0.0, 0.0, 0.0, *w]))
        body = mbs.AddObject(ObjectRigidBody(physicsMass=mass, physicsInertia=[*about_pivot, 0, 0, 0], nodeNumber=node))
        marker = mbs.AddMarker(MarkerBodyPosition(bodyNumber=body, localPosition=list(arm)))
        mbs.AddLoad(Force(markerNumber=marker, loadVector=[0, 0, -mass * GRAVITY]))
        still = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
        for k in range(3):
            moving = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=k))
            mbs.AddObject(CoordinateConstraint(markerNumbers=[still, moving]))
        local = list(arm)
    sensor = mbs.AddSensor(
        SensorBody(
            bodyNumber=body,
            localPosition=local,
            outputVariableType=exu.OutputVariableType.Position,
            storeInternal=True,
        )
    )
    mbs.Assemble()
    seconds = _timed(exu, mbs, _settings(exu, end, round(end / h), rho, 0.1), solver)
    return seconds, np.asarray(mbs.GetSensorStoredData(sensor))[-1, 1:4]
