"""The same models in programs that install with pip. Each function returns numbers; ImportError means: not installed.

One body of the chain: a rod of 1 m along x, 1 kg; joints turn about z and y in turn; a six-component bushing at each.
"""

from __future__ import annotations

from typing import Any

import numpy as np

TRANSLATION, ROTATION = 1000.0, 200.0
DAMPING_RATE = 1e-3
INERTIA = (0.01, 1 / 12, 1 / 12)
GRAVITY = 9.81


def mbrs_chain(n: int) -> Any:
    """The chain as a model of mbrs."""
    import mbrs as mb

    m = mb.Model(f"chain of {n}")
    k = (TRANSLATION,) * 3 + (ROTATION,) * 3
    c = tuple(DAMPING_RATE * v for v in k)
    before = m.ground
    for i in range(n):
        body = m.body(f"B{i}", mass=1.0, inertia=INERTIA, at=(i + 0.5, 0, 0))
        m.revolute(f"J{i}", before, body, at=(i, 0, 0), axis="yz"[(i + 1) % 2])
        m.bushing(f"F{i}", before, body, at=(i, 0, 0), k=k, c=c)
        before = body
    return m


def pinocchio_chain(n: int) -> Any:
    """A function that linearises the chain: M, K, D over the joint angles."""
    import pinocchio as pin

    m = pin.Model()
    m.gravity.linear = np.zeros(3)
    parent = 0
    for i in range(n):
        joint = pin.JointModelRY() if i % 2 else pin.JointModelRZ()
        place = pin.SE3(np.eye(3), np.array([1.0 if i else 0.0, 0.0, 0.0]))
        parent = m.addJoint(parent, joint, place, f"J{i}")
        rod = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag(INERTIA))
        m.appendBodyToJoint(parent, rod, pin.SE3.Identity())
    data, q, zero = m.createData(), np.zeros(n), np.zeros(n)

    def linearise() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        pin.computeRNEADerivatives(m, data, q, zero, zero)
        mass = np.triu(pin.crba(m, data, q))
        # Only the bushings' rotation about the joint axis does any work.
        stiffness = data.dtau_dq + ROTATION * np.eye(n)
        return mass + np.triu(mass, 1).T, stiffness, data.dtau_dv + DAMPING_RATE * ROTATION * np.eye(n)

    return linearise


def exudyn_chain(n: int) -> Any:
    """A function that linearises the chain, projected on the null space of the joints: M, K, D."""
    import exudyn as exu
    from exudyn.utilities import RigidBodyInertia

    container = exu.SystemContainer()
    mbs = container.AddSystem()
    before = mbs.CreateGround()
    stiffness = np.diag([TRANSLATION] * 3 + [ROTATION] * 3)
    for i in range(n):
        rod = RigidBodyInertia(mass=1.0, com=[0, 0, 0], inertiaTensor=np.diag(INERTIA))
        node = exu.NodeType.RotationEulerParameters
        body = mbs.CreateRigidBody(inertia=rod, nodeType=node, referencePosition=[i + 0.5, 0, 0])
        axis = [0, 1, 0] if i % 2 else [0, 0, 1]
        mbs.CreateRevoluteJoint(itemNumbers=[before, body], position=[i, 0, 0], axis=axis)
        mbs.CreateRigidBodySpringDamper(
            itemNumbers=[before, body],
            localPosition0=[0.5 if i else 0.0, 0, 0],
            localPosition1=[-0.5, 0, 0],
            stiffness=stiffness,
            damping=DAMPING_RATE * stiffness,
            useGlobalFrame=False,
        )
        before = body
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.linearSolver.solverType = exu.LinearSolverType.EXUdense

    def linearise() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # The container must outlive its system.
        assert container is not None
        return mbs.ComputeLinearizedSystem(settings, projectIntoConstraintNullspace=True)[:3]

    return linearise


def exudyn_pendulum() -> float:
    """Frequency in Hz of a rod of 1 m hanging from a hinge, about its static equilibrium."""
    import exudyn as exu
    from exudyn.utilities import RigidBodyInertia

    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.CreateGround()
    rod = RigidBodyInertia(mass=1.0, com=[0, 0, 0], inertiaTensor=np.diag([1 / 12, 1e-3, 1 / 12]))
    node = exu.NodeType.RotationEulerParameters
    body = mbs.CreateRigidBody(inertia=rod, gravity=[0, -GRAVITY, 0], nodeType=node, referencePosition=[0, -0.5, 0])
    mbs.CreateRevoluteJoint(itemNumbers=[ground, body], position=[0, 0, 0], axis=[0, 0, 1])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.verboseMode = 0
    settings.linearSolver.ignoreSingularJacobian = True
    settings.linearSolver.solverType = exu.LinearSolverType.EigenDense
    mbs.SolveStatic(settings, updateInitialValues=True)
    values, _ = mbs.ComputeODE2Eigenvalues(computeComplexEigenvalues=True, useAbsoluteValues=False)
    return float(np.max(np.abs(values)) / 2 / np.pi)


def pinocchio_pendulum() -> float:
    """The same frequency from Pinocchio's derivatives; an open chain, so its joint coordinate carries everything."""
    import pinocchio as pin

    m = pin.Model()
    m.gravity.linear = np.array([0.0, -GRAVITY, 0.0])
    joint = m.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    rod = pin.Inertia(1.0, np.array([0.0, -0.5, 0.0]), np.diag([1 / 12, 1e-3, 1 / 12]))
    m.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    data, zero = m.createData(), np.zeros(1)
    pin.computeRNEADerivatives(m, data, zero, zero, zero)
    return float(np.sqrt(data.dtau_dq[0, 0] / pin.crba(m, data, zero)[0, 0]) / 2 / np.pi)
