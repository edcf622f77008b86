"""A small result of every class, for tests that hold for all of them."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import mbrs as mb
import numpy as np
from air_models import vane
from mbrs.linear.measurement import MeasuredFunction, Measurement
from mbrs.results import Result

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


def _turbine():
    a = np.linspace(-np.pi, np.pi, 73)
    section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.01 + np.sin(a) ** 4)
    return mb.aero.rotor(mb.aero.blade([2.1, 10.3, 39.7], [3.1, 3.5, 1.2], [0.35, 0.12, -0.03], section))


def _wing():
    section = mb.aero.polar([-0.7, 0.9], [-4.3, 5.1], [0.02, 0.03])
    return mb.aero.blade([-2.3, 0.4, 3.1], [0.7, 1.1, 0.6], [0.02, 0.0, -0.03], section)


def _rail():
    m, axis = mb.Model("rail"), (0.31, -0.83, 0.46)
    last = m.ground
    for i in range(500):
        b = m.body(f"b{i}", mass=1.0 + 0.001 * i, inertia=(0.1, 0.2, 0.3), at=(0.7 * i, 0.1, -0.2))
        m.prismatic(f"j{i}", m.ground, b, at=(0.7 * i, 0.0, 0.0), axis=axis)
        m.bushing(f"k{i}", last, b, at=(0.7 * i - 0.3, 0.0, 0.0), k=(913.0,) * 6)
        last = b
    return m


def _sliding():
    """A carriage that is pulled along at constant speed, and a rotor whose bushing carries a ring around."""
    m = mb.Model("carriage")
    along = np.array([0.31, -0.83, 0.46])
    a = m.body("a", mass=1.7, inertia=(0.1, 0.2, 0.3), orientation=TURN)
    b = m.body("b", mass=0.9, inertia=(0.03,) * 3, orientation=TURN)
    ring = m.body("ring", mass=0.4, inertia=(0.02,) * 3, orientation=TURN)
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis=along, c=0.61)
    m.revolute("hub", m.ground, b, at=(0, 0, 0), axis=(0.7, 0.2, -0.5), c=0.017)
    m.bushing("tie", b, ring, at=(0, 0, 0), orientation=TURN, k=(3.1e4,) * 3 + (170.0,) * 3)
    return mb.steady_motion(m, {"rail": 0.7, "hub": 13.0})


def _blocks():
    return mb.design.saltelli({"k": (31.0, 43.0), "a.mass": (1.1, 1.7)}, 4)


def _measured():
    x = np.linspace(1.0, 3.0, 5)
    function = MeasuredFunction("frequency response", "2:+z", "1:-x", "velocity/force", "m/s", x, x * (0.3 - 0.7j))
    shape = np.arange(24.0).reshape(6, 2, 2) * (1 + 0.1j)
    at = np.array([[0.1, 0.2, 0.3], [0.7, -0.1, 0.4]])
    return Measurement(
        np.array([1, 2]),
        at,
        ("1", "tip"),
        ((1, 2),),
        (function,),
        np.array([-0.1 + 3j, 7j]),
        shape,
        "test",
        status="measured",
    )


def _read_back():
    """Transfer functions of the model, read back from a universal file as a measurement."""
    h = mb.frf(drawn(), inputs="a.force.x", outputs=["a.motion.x", "b.motion.y"], frequency=[0.7, 1.2, 1.7, 2.2])
    with tempfile.TemporaryDirectory() as folder:
        return mb.load(h.save(Path(folder) / "h.uff"))


MAKE = {
    "ModalResult": lambda: mb.modes(drawn()),
    "ModalResult of matrices": lambda: mb.modes(
        mb.MechanicalSystem(M=np.diag([1.3, 0.7]), K=[[3.1, -1.7], [-1.7, 2.9]])
    ),
    "ModalResult of a large model": lambda: mb.modes(_rail(), n=2),
    "EnergyShares": lambda: mb.modes(drawn()).energy(),
    "FrfResult": lambda: mb.frf(
        drawn(), inputs=["a.force.x", "b.torque.z"], outputs="b.motion.y", frequency=[0.7, 1.9, 3.1]
    ),
    "FrfSensitivity": lambda: mb.sensitivity(MAKE["FrfResult"](), ["k", "a.mass"]),
    "ResponseResult": lambda: mb.response(
        drawn(), np.linspace(0.0, 1.3, 27), {"a.force.x": np.sin(np.arange(27.0))}, ["b.motion.y", "a.motion.x"]
    ),
    "ResponseSensitivity": lambda: mb.sensitivity(MAKE["ResponseResult"](), ["k", "a.mass"]),
    "Pairing": lambda: mb.pair(drawn(), _read_back()),
    "Correlation": lambda: mb.correlate(drawn(), _read_back()),
    "Update": lambda: mb.update(drawn(), MAKE["FrfResult"](), ["k", "a.mass"], noise=1e-6),
    "Equilibrium": lambda: mb.equilibrium(drawn()),
    "EquilibriumSensitivity": lambda: mb.sensitivity(mb.equilibrium(drawn()), ["k", "a.mass"]),
    "Linearization": lambda: mb.linearize(drawn()),
    "LinearizationSensitivity": lambda: mb.sensitivity(mb.linearize(drawn()), ["k", "a.mass"]),
    "StateSpace": lambda: mb.state_space(drawn(), inputs="a.force.x", outputs="b.motion.y"),
    "EigenSensitivity": lambda: mb.sensitivity(mb.modes(drawn()), ["k", "a.mass"]),
    "DirectionalDerivative": lambda: mb.sensitivity(mb.modes(drawn()), ["k", "a.mass"]).directional([0.3, -0.7]),
    "SteadyMotion": lambda: mb.steady_motion(mb.examples.rotor(), {"shaft": 130.0}),
    "SteadyMotion that slides and carries": _sliding,
    "CampbellResult with critical speeds": lambda: mb.campbell(
        mb.examples.rotor(), "shaft", speed=np.linspace(10.0, 290.0, 4)
    ),
    "ModalResult near a frequency": lambda: mb.modes(drawn(), n=1, shift=1.9),
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
    "Comparison": lambda: mb.compare(mb.modes(drawn())),
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
    "BladeLoads": lambda: mb.simulate(vane(sections=3), t=[0.0, 0.01], rtol=1e-6).aero("arm"),
    "Performance": lambda: mb.aero.performance(_turbine(), [4.1, 7.3, 9.9]),
    "WingLoads": lambda: mb.aero.lifting_line(_wing(), [0.03, 0.11], strips=8),
    "RotorResponse": lambda: mb.aero.rotor_response(
        _turbine(), np.linspace(0.0, 3.0, 7), 8.0, 4.0, pitch=np.linspace(0.0, 0.1, 7)
    ),
    "StallResponse": lambda: mb.aero.dynamic_stall(
        mb.aero.polar([-0.4, 0.0, 0.2, 0.4], [-0.8, 0.1, 1.1, 0.7], [0.1, 0.01, 0.02, 0.1]),
        [0.0, 0.1, 0.3],
        [0.1, 0.3, 0.2],
        20.0,
        0.7,
    ),
    "RotorWake": lambda: mb.aero.rotor_wake(
        _turbine(), 5.0, turns=4, steps=12, strips=4, free_turns=0.5, mean_turns=1.5, tail_turns=0.5
    ),
    "WingStart": lambda: mb.aero.impulsive_start(_wing(), 0.07, 2.9, step=0.7, strips=8),
    "Measurement": lambda: _measured(),
    "RotorModes": lambda: mb.rotor_modes(_blades(), ["a", "b", "c"], 0.7),
    "Runs": lambda: mb.sweep(drawn(), _blocks(), mb.outputs.modes(2, ["k", "a.mass"])),
    "Failures": lambda: mb.sweep(drawn(), mb.design.from_table({"a.mass": [1.0, -1.0]}), mb.outputs.modes()).failures,
    "SobolIndices": lambda: MAKE["Runs"]().sobol_indices("frequency[0]"),
    "DerivativeMeasures": lambda: MAKE["Runs"]().derivative_measures("frequency[0]"),
    "Statistics": lambda: MAKE["Runs"]().statistics(),
    "Designs": lambda: mb.design.latin_hypercube({"k": (31.0, 43.0), "a.mass": (1.1, 1.7)}, 7, units={"k": "N/m"}),
}


@cache
def made(name: str) -> Result:
    """Each result, made once."""
    return MAKE[name]()
