"""Vibration and motion of spatial multibody systems. ``import mbrs as mb``.

Everything public is listed here and imported when it is first used, so that ``import mbrs`` stays cheap.
"""

from __future__ import annotations

import importlib
from typing import Any

from ._lib.formats import load_with as _load_with

_HOME = {
    "__version__": "_lib.version",
    "AssemblyError": "errors",
    "ConvergenceError": "errors",
    "DesignError": "errors",
    "DoubtfulWarning": "errors",
    "DuplicateNameError": "errors",
    "InertiaError": "errors",
    "Interrupted": "errors",
    "KinkWarning": "errors",
    "MbrsError": "errors",
    "MbrsWarning": "errors",
    "ModelError": "errors",
    "NameNotFoundError": "errors",
    "NotDifferentiableError": "errors",
    "OmissionWarning": "errors",
    "RouteError": "errors",
    "SingularError": "errors",
    "StoreError": "errors",
    "Model": "model.model",
    "load": "io.results",
    "MechanicalSystem": "linear.matrices",
    "System": "system.system",
    "base_motion": "model.ports",
    "rotation": "model.rotations",
    "effects": "system.effects",
    "equilibrium": "linear.equilibrium",
    "linearize": "linear.linearize",
    "modes": "linear.modes",
    "mac": "linear.mac",
    "frac": "linear.correlation",
    "comac": "linear.correlation",
    "serep": "linear.correlation",
    "correlate": "linear.correlation",
    "pair": "linear.pairing",
    "multiblade": "linear.multiblade",
    "rotor_modes": "linear.multiblade",
    "root": "solvers.root",
    "frf": "linear.frf",
    "response": "linear.response",
    "state_space": "linear.state_space",
    "sensitivity": "linear.sensitivity",
    "eigen_sensitivity": "linear.eigen_sensitivity",
    "steady_motion": "linear.steady",
    "Performance": "aero.steady_rotors",
    "RotorResponse": "aero.dynamic_inflow",
    "RotorWake": "aero.rotor_wakes",
    "StallResponse": "aero.separation",
    "WingLoads": "aero.wings",
    "WingStart": "aero.wings",
    "simulate": "motion.simulate",
    "campbell": "linear.campbell",
    "check_gradients": "studies.gradients",
    "compare": "studies.compare",
    "gradient": "gradients.gradient",
    "problem": "design.problem",
    "Bounded": "design.functions",
    "Frequency": "design.functions",
    "Damping": "design.functions",
    "Match": "design.goals",
    "Peak": "design.goals",
    "MeanSquare": "design.goals",
    "Robust": "design.robust",
    "Integral": "gradients.objectives",
    "Final": "gradients.objectives",
    "AtTimes": "gradients.objectives",
    "outputs": "design",
    "fmu": "io.fmu",
    "to_sep005": "io.sep005",
    "from_sep005": "io.sep005",
    "sweep": "design.sweep",
    "update": "design.update",
    "Update": "design.fit",
    "Designs": "design.table",
    "Runs": "design.runs",
    "Failures": "design.runs",
    "SobolIndices": "design.uncertainty",
    "DerivativeMeasures": "design.uncertainty",
    "Statistics": "design.uncertainty",
    "accuracy_study": "studies.accuracy",
    "effect_study": "studies.effects",
    "harmonic_balance": "nonlinear.periodic",
    "frequency_response": "nonlinear.frequency_response",
    "limit_cycle": "nonlinear.limit_cycle",
    "quasi_periodic": "nonlinear.quasi_periodic",
    "quasi_periodic_response": "nonlinear.quasi_periodic_curves",
    "parameter_response": "nonlinear.parameter_response",
    "Branch": "nonlinear.branch",
    "nonlinear_system": "nonlinear.system",
    "Cubic": "model.laws",
    "Polynomial1D": "model.laws",
    "Gap": "model.laws",
    "Jenkins": "model.laws",
    "Iwan": "model.laws",
    "CoulombTanh": "model.laws",
    "Hertz": "model.laws",
    "TableLaw": "model.laws",
    "VanDerPol": "model.laws",
    "VaryingStiffness": "model.laws",
    "Maxwell": "model.laws",
    "BoucWen": "model.laws",
    "LuGre": "model.laws",
    "FunctionLaw": "model.laws",
    "Box": "model.shapes",
    "Cylinder": "model.shapes",
    "Sphere": "model.shapes",
    "Mesh": "model.shapes",
    "Ramp": "model.motions",
    "Sine": "model.motions",
    "Polynomial": "model.motions",
    "Table": "model.motions",
    # what models are made of and what analyses return, for annotations and isinstance
    "Result": "results",
    "Stats": "results",
    "Body": "model.bodies",
    "Ground": "model.bodies",
    "Marker": "model.bodies",
    "FlexibleBody": "model.flexible",
    "Joint": "model.joint",
    "Drive": "model.drives",
    "Coupler": "model.drives",
    "Constraint": "model.constraints",
    "Element": "model.forces",
    "Load": "model.forces",
    "SectionLoad": "model.section_loads",
    "Port": "model.ports",
    "Expression": "model.expressions",
    "State": "system.state",
    "EffectsTable": "system.effects",
    "Equilibrium": "linear.equilibrium",
    "SteadyMotion": "linear.steady",
    "Linearization": "linear.linearization",
    "ModalResult": "linear.modal_result",
    "EnergyShares": "linear.energy_shares",
    "FrfResult": "linear.frf",
    "FrfSensitivity": "linear.frf",
    "Measurement": "linear.measurement",
    "MeasuredFunction": "linear.measurement",
    "Pairing": "linear.pairing",
    "Correlation": "linear.correlation",
    "ResponseResult": "linear.response",
    "ResponseSensitivity": "linear.response",
    "StateSpace": "linear.first_order",
    "EigenSensitivity": "linear.eigen_sensitivity",
    "DirectionalDerivative": "linear.eigen_sensitivity",
    "LinearizationSensitivity": "linear.sensitivity",
    "EquilibriumSensitivity": "linear.sensitivity",
    "CampbellResult": "linear.campbell",
    "RotorModes": "linear.multiblade",
    "BladeLoads": "motion.air",
    "Trajectory": "motion.trajectory",
    "Energy": "motion.energy",
    "MotionGradient": "gradients.motion_gradient",
    "MotionSensitivity": "gradients.motion_gradient",
    "NonlinearSystem": "nonlinear.system",
    "PeriodicSolution": "nonlinear.periodic",
    "FrequencyResponse": "nonlinear.response_curve",
    "ParameterResponse": "nonlinear.parameter_response",
    "LimitCycle": "nonlinear.limit_cycle",
    "QuasiPeriodicSolution": "nonlinear.quasi_periodic",
    "QuasiPeriodicResponse": "nonlinear.quasi_periodic_curves",
    "Problem": "design.problem",
    "Optimum": "design.optimum",
    "AccuracyStudy": "studies.accuracy",
    "EffectStudy": "studies.effects",
    "Comparison": "studies.compare",
    "GradientCheck": "studies.gradients",
}
_MODULES = {
    **{name: name for name in ("aero", "design", "examples", "reference", "errors", "plot", "view", "flexible")},
    "matrix_calculus": "solvers.matrix_calculus",
    "formats": "_lib.formats",
    "report": "_lib.text",
}
# Folders of which the files are reached by name, as `mb.view.motion`, without an import of their own.
_WHOLE = {
    "view": ("modes", "motion", "page", "still"),
    "plot": (
        "aero",
        "derivatives",
        "gradients",
        "linear",
        "matrices",
        "models",
        "motion",
        "nonlinear",
        "scenes",
        "studies",
        "sweeps",
    ),
}
__all__ = sorted(
    [
        *(name for name in _HOME if name != "__version__"),
        "aero",
        "design",
        "examples",
        "flexible",
        "formats",
        "matrix_calculus",
    ]
)


def _register_formats() -> None:
    """Import the modules of `io`, each of which registers its formats; other programs that they need wait until they are used."""
    import pkgutil

    folder = importlib.import_module(".io", __name__)
    for module in pkgutil.iter_modules(folder.__path__):
        if not module.name.startswith("_"):
            importlib.import_module(f"{folder.__name__}.{module.name}")


_load_with(_register_formats)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    elif name in _MODULES:
        value = importlib.import_module(f".{_MODULES[name]}", __name__)
        for part in _WHOLE.get(name, ()):
            importlib.import_module(f".{_MODULES[name]}.{part}", __name__)
    else:
        import difflib

        near = difflib.get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module 'mbrs' has no attribute {name!r}{hint}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
