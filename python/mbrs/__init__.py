"""Vibration and motion of spatial multibody systems. ``import mbrs as mb``.

Everything public is listed here and imported when it is first used, so that ``import mbrs`` stays cheap.
"""

from __future__ import annotations

import importlib
import sys
import types
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "AssemblyError": "errors",
    "ConvergenceError": "errors",
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
    "Model": "model.model",
    "load": "result_files",
    "MechanicalSystem": "second_order",
    "System": "system",
    "base_motion": "model.ports",
    "rotation": "model.rotations",
    "effects": "effects",
    "equilibrium": "equilibrium",
    "linearize": "linearize",
    "modes": "modal",
    "mac": "mac",
    "multiblade": "multiblade",
    "rotor_modes": "multiblade",
    "root": "root",
    "frf": "frf",
    "response": "response",
    "state_space": "state_space",
    "StateSpace": "state_space",
    "sensitivity": "sensitivity",
    "eigen_sensitivity": "eigen_sensitivity",
    "steady_motion": "steady",
    "simulate": "simulate",
    "campbell": "campbell",
    "check_gradients": "check_gradients",
    "gradient": "gradient",
    "problem": "design_problem",
    "Bounded": "design_problem",
    "Frequency": "design_problem",
    "Damping": "design_problem",
    "Integral": "objectives",
    "Final": "objectives",
    "AtTimes": "objectives",
    "accuracy_study": "study",
    "effect_study": "study",
    "harmonic_balance": "harmonic_balance",
    "frequency_response": "frequency_response",
    "limit_cycle": "limit_cycle",
    "quasi_periodic": "quasi_periodic",
    "quasi_periodic_response": "quasi_periodic_response",
    "parameter_response": "parameter_response",
    "Branch": "continuation",
    "nonlinear_system": "nonlinear_system",
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
    "FunctionLaw": "model.laws",
    "Ramp": "model.motions",
    "Sine": "model.motions",
    "Polynomial": "model.motions",
    "Table": "model.motions",
}
_MODULES = ("examples", "reference", "errors", "report", "plot", "animate", "matrix_calculus", "flexible")
__all__ = sorted([*_HOME, "examples", "flexible", "matrix_calculus"])


class _Package(types.ModuleType):
    """`mb.frf` is the function, although the module that defines it is called `mbrs.frf`: the import system would
    set the
    module under that name as soon as anything imports it.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, types.ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    elif name in _MODULES:
        value = importlib.import_module(f".{name}", __name__)
    else:
        import difflib

        near = difflib.get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module 'mbrs' has no attribute {name!r}{hint}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
