"""Every result: what it declares, how it prints, and that a file gives back the same object."""

from __future__ import annotations

import warnings
from types import SimpleNamespace

import mbrs as mb
import numpy as np

warnings.filterwarnings("ignore", category=mb.errors.MbrsWarning)
TURN = mb.rotation((0.31, -0.83, 0.46), 0.7)


def drawn():
    """A double pendulum with springs, dampers, parameters, about an axis that is not of the world."""
    m = mb.Model("pendulum", gravity=(0.4, -9.3, 1.7))
    k = m.parameter("k", 37.3)
    axis = np.array([0.31, -0.83, 0.46])
    a = m.body("a", mass=1.31, inertia=(0.021, 0.033, 0.027), at=(0.37, 0.11, -0.23), orientation=TURN)
    b = m.body("b", mass=0.73, inertia=(0.013, 0.017, 0.019), at=(0.71, 0.23, -0.31), orientation=TURN)
    m.revolute("A", m.ground, a, at=(0.0, 0.0, 0.0), axis=axis, k=k, c=0.21)
    m.revolute("B", a, b, at=(0.53, 0.17, -0.29), axis=axis, k=0.7 * k, c=0.13)
    return m


def duffing():
    return mb.MechanicalSystem(M=[[1.3]], C=[[0.07]], K=[[1.9]], elements=[mb.Cubic(0.23, w=[1.0])], coordinates=["x"])


def stage():
    m = mb.Model("stage")
    b = m.body("b", mass=1.7, inertia=(0.1, 0.2, 0.3))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=(0.31, -0.83, 0.46), k=413.0, c=0.61, law=mb.Cubic(1.9e4))
    return m, b


def _curve():
    m, b = stage()
    return mb.frequency_response(
        m, inputs=b.force((0.31, -0.83, 0.46)), amplitude=0.7, frequency=(1.7, 3.3), max_points=12
    )


def _parameter_curve():
    m, b = stage()
    return mb.parameter_response(
        m, "b.mass", value=(1.5, 1.9), inputs=b.force((0.31, -0.83, 0.46)), amplitude=0.7, frequency=2.3, max_points=8
    )


def _torus(**more):
    forces = [dict(force=[0.11], omega=0.83), dict(force=[0.07], omega=1.31)]
    return (mb.quasi_periodic_response if more else mb.quasi_periodic)(duffing(), forces, harmonics=3, **more)


def _blades():
    phase = np.exp(-2j * np.pi * np.arange(3) / 3)
    shape = np.stack([np.ones(3), phase, phase.conj()], axis=1)
    return SimpleNamespace(shape=shape, eigenvalue=1j * np.array([1.9, 2.3, 2.9]), coordinates=["a.q1", "b.q1", "c.q1"])


MAKE = {
    "ModalResult": lambda: mb.modes(drawn()),
    "ModalResult of matrices": lambda: mb.modes(
        mb.MechanicalSystem(M=np.diag([1.3, 0.7]), K=[[3.1, -1.7], [-1.7, 2.9]])
    ),
    "EnergyShares": lambda: mb.modes(drawn()).energy(),
    "FrfResult": lambda: mb.frf(
        drawn(), inputs=["a.force.x", "b.torque.z"], outputs="b.motion.y", frequency=[0.7, 1.9, 3.1]
    ),
    "FrfSensitivity": lambda: mb.sensitivity(MAKE["FrfResult"](), ["k", "a.mass"]),
    "ResponseResult": lambda: mb.response(
        drawn(), np.linspace(0.0, 1.3, 27), {"a.force.x": np.sin(np.arange(27.0))}, ["b.motion.y", "a.motion.x"]
    ),
    "ResponseSensitivity": lambda: mb.sensitivity(MAKE["ResponseResult"](), ["k", "a.mass"]),
    "Equilibrium": lambda: mb.equilibrium(drawn()),
    "EquilibriumSensitivity": lambda: mb.sensitivity(mb.equilibrium(drawn()), ["k", "a.mass"]),
    "Linearization": lambda: mb.linearize(drawn()),
    "LinearizationSensitivity": lambda: mb.sensitivity(mb.linearize(drawn()), ["k", "a.mass"]),
    "StateSpace": lambda: mb.state_space(drawn(), inputs="a.force.x", outputs="b.motion.y"),
    "EigenSensitivity": lambda: mb.sensitivity(mb.modes(drawn()), ["k", "a.mass"]),
    "DirectionalDerivative": lambda: mb.sensitivity(mb.modes(drawn()), ["k", "a.mass"]).directional([0.3, -0.7]),
    "SteadyMotion": lambda: mb.steady_motion(mb.examples.rotor(), {"shaft": 130.0}),
    "CampbellResult": lambda: mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(10.0, 90.0, 4)),
    "System": lambda: mb.System(mb.examples.four_bar()),
    "EffectsTable": lambda: mb.effects(drawn()),
    "PeriodicSolution": lambda: mb.harmonic_balance(duffing(), force=[0.31], omega=1.1, harmonics=5),
    "FrequencyResponse": _curve,
    "ParameterResponse": _parameter_curve,
    "QuasiPeriodicSolution": _torus,
    "QuasiPeriodicResponse": lambda: _torus(level=(0.7, 1.0)),
    "LimitCycle": lambda: mb.limit_cycle(
        mb.MechanicalSystem(M=[[1.0]], C=[[-0.31]], K=[[1.0]], elements=[mb.VanDerPol(0.31, w=[1.0])]), harmonics=9
    ),
    "Trajectory": lambda: mb.simulate(drawn(), t=np.linspace(0.0, 0.4, 9)),
    "Energy": lambda: mb.simulate(drawn(), t=np.linspace(0.0, 0.4, 9)).energy,
    "MotionGradient": lambda: mb.gradient(
        drawn(), mb.Final(lambda s: s.position("b")[0]), ["k", "a.mass"], t=0.2, step=0.01
    ),
    "MotionSensitivity": lambda: MAKE["MotionGradient"]().sensitivity(["k"]),
    "GradientCheck": lambda: mb.check_gradients(mb.modes, drawn(), ["k", "a.mass"]),
    "Optimum": lambda: mb.problem(
        drawn(),
        mb.Final(lambda s: s.position("b")[0] ** 2),
        parameters=["k"],
        bounds={"k": (10.0, 90.0)},
        t=0.1,
        step=0.01,
    ).solve(),
    "AccuracyStudy": lambda: mb.accuracy_study(mb.simulate, drawn(), t=0.2, rtol=[1e-4, 1e-6]),
    "EffectStudy": lambda: mb.effect_study(mb.modes, drawn()),
    "RotorModes": lambda: mb.rotor_modes(_blades(), ["a", "b", "c"], 0.7),
}
