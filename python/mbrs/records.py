"""Results as data: a tree of plain values and a list of arrays, from which the same objects come back.

Only classes of `HOMES` and functions of `FUNCTIONS` are ever made: reading a file imports nothing else and calls nothing that
the file names.
"""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from .errors import ModelError
from .model.book import Book

# class -> module of the package: what a file may hold beside numbers, texts, arrays and models
HOMES: Mapping[str, str] = {
    **dict.fromkeys(("Stats",), "results"),
    **dict.fromkeys(("ModalResult",), "modal"),
    **dict.fromkeys(("FrfResult", "FrfSensitivity"), "frf"),
    **dict.fromkeys(("Measurement", "MeasuredFunction"), "measurement"),
    **dict.fromkeys(("ResponseResult", "ResponseSensitivity", "LoadHistory"), "response"),
    **dict.fromkeys(("Linearization", "Snapshot"), "linearize"),
    **dict.fromkeys(("LinearizationSensitivity", "EquilibriumSensitivity", "SparseDerivative"), "sensitivity"),
    **dict.fromkeys(("EigenSensitivity", "GroupSensitivity", "DirectionalDerivative"), "eigen_sensitivity"),
    **dict.fromkeys(("System", "Loop"), "system"),
    **dict.fromkeys(("EffectsTable", "Effect"), "effects"),
    **dict.fromkeys(("EffectStudy", "EffectRow"), "_effect_study"),
    **dict.fromkeys(("AccuracyStudy", "StudyPoint", "Recommendation"), "study"),
    **dict.fromkeys(("MotionGradient", "MotionSensitivity"), "motion_gradient"),
    **dict.fromkeys(("Trajectory", "Energy"), "trajectory"),
    **dict.fromkeys(("FrequencyResponse", "Part"), "response_curve"),
    **dict.fromkeys(("ParameterResponse", "OfModel"), "parameter_response"),
    **dict.fromkeys(("Branch",), "continuation"),
    **dict.fromkeys(("Event", "BranchPoint", "Chunks"), "_branch_points"),
    **dict.fromkeys(("LinearSystem", "Origin"), "_linear"),
    **dict.fromkeys(
        ("Cubic", "Polynomial1D", "Gap", "CoulombTanh", "Hertz", "TableLaw", "VanDerPol", "Jenkins", "Iwan"),
        "model.laws",
    ),
    "VaryingStiffness": "model.laws",
    "Equilibrium": "equilibrium",
    "EnergyShares": "_energy_shares",
    "SteadyMotion": "steady",
    "StateSpace": "state_space",
    "CampbellResult": "campbell",
    **dict.fromkeys(("CriticalSpeeds", "CriticalSpeed"), "critical_speeds"),
    "RotorModes": "multiblade",
    "GradientCheck": "check_gradients",
    "Optimum": "design_problem",
    "PeriodicSolution": "harmonic_balance",
    "QuasiPeriodicSolution": "quasi_periodic",
    "QuasiPeriodicResponse": "quasi_periodic_response",
    "LimitCycle": "limit_cycle",
    "SparseModel": "sparse_modal",
    "MechanicalSystem": "second_order",
    "NonlinearSystem": "nonlinear_system",
    "State": "state",
    "Port": "model.ports",
    "Directions": "tables",
}
# functions that make again what the core holds, or compute an estimate when it is first asked for
FUNCTIONS: Mapping[str, str] = {"prepare": "_balance", "of_family": "_balance", "_estimated_error": "simulate"}
# how deeply values may be nested before a file counts as damaged
_DEEPEST = 200


class UnsavableError(ModelError):
    """Something in a result that a file of data cannot hold, such as a Python function."""


def member(table: Mapping[str, str], name: Any) -> Any:
    """The class or function of a table."""
    if name not in table:
        raise ModelError(f"the file holds a {name!r}, which this version of mbrs does not know")
    return getattr(importlib.import_module(f".{table[name]}", __package__), name)


class Encoder:
    """Values to a tree that JSON can hold; ``arrays`` collects the arrays, ``models`` the texts of models."""

    def __init__(self) -> None:
        self.arrays: list[np.ndarray] = []
        self._seen: dict[int, tuple[int, Any]] = {}
        self._array_of: dict[int, tuple[int, np.ndarray]] = {}

    def encode(self, value: Any) -> Any:
        """The tree of one value. Objects that occur twice are written once."""
        if value is None or isinstance(value, bool | str):
            return value
        if isinstance(value, np.generic):
            return self.encode(value.item())
        if type(value) is int:
            return value
        if type(value) is float:
            return value if math.isfinite(value) else {"~": "float", "is": repr(value)}
        if type(value) is complex:
            return {"~": "complex", "re": self.encode(value.real), "im": self.encode(value.imag)}
        if isinstance(value, list):
            return [self.encode(one) for one in value]
        if type(value) is tuple:
            return {"~": "tuple", "of": [self.encode(one) for one in value]}
        if isinstance(value, Mapping):
            return {"~": "dict", "of": [[self.encode(k), self.encode(v)] for k, v in value.items()]}
        if type(value) is np.ndarray:
            return self._array(value)
        return self._object(value)

    def _array(self, value: np.ndarray) -> Any:
        if value.dtype.kind not in "biufc":
            kind = value.dtype.str if value.dtype.kind == "U" else "object"
            return {
                "~": "texts",
                "dtype": kind,
                "shape": list(value.shape),
                "of": [self.encode(one) for one in value.ravel().tolist()],
            }
        known = self._array_of.get(id(value))
        if known is None:
            known = self._array_of[id(value)] = (len(self.arrays), value)
            self.arrays.append(np.ascontiguousarray(value).reshape(value.shape))
        return {"~": "array", "at": known[0]}

    def _object(self, value: Any) -> Any:
        known = self._seen.get(id(value))
        if known is not None:
            return {"~": "again", "at": known[0]}
        number = len(self._seen)
        self._seen[id(value)] = (number, value)
        return {"at": number, **self._described(value)}

    def _described(self, value: Any) -> dict[str, Any]:
        name = type(value).__name__
        if hasattr(value, "tocsc") and hasattr(value, "indptr"):
            parts = {"data": self.encode(value.data), "indices": self.encode(value.indices)}
            return {
                "~": f"sparse {value.format}",
                "shape": list(value.shape),
                "indptr": self.encode(value.indptr),
                **parts,
            }
        if name == "Derivative":
            more = [list(value.parameter_shape), value.value_ndim]
            return {"~": "derivative", "of": self._array(np.asarray(value)), "more": more}
        if isinstance(value, Book):
            return {"~": "model", "toml": _text_of(value)}
        if isinstance(value, functools.partial) and value.func.__name__ in FUNCTIONS:
            given = [self.encode(value.args), self.encode(value.keywords)]
            return {"~": "partial", "function": value.func.__name__, "given": given}
        if name in HOMES and type(value).__module__ == f"{__package__}.{HOMES[name]}":
            if isinstance(value, tuple):
                return {"~": "tuple of", "class": name, "of": [self.encode(one) for one in value]}
            reduced = type(value).__dict__.get("__reduce__")
            if reduced is not None:
                function, given = reduced(value)
                return {"~": "made", "function": function.__name__, "given": self.encode(tuple(given))}
            return {"~": "record", "class": name, "state": self.encode(_state(value))}
        if name == "Setup":
            function, given = value.__reduce__()
            return {"~": "made", "function": function.__name__, "given": self.encode(tuple(given))}
        what = f"the Python function {getattr(value, '__name__', value)!r}" if callable(value) else f"a {name}"
        raise UnsavableError(
            f"a file of data cannot hold {what}; save the result with the ending .pkl (where its functions can be imported by "
            "name), or its labelled data alone with result.to_xarray().to_netcdf(path)"
        )


def _text_type(name: Any) -> np.dtype[Any]:
    """Texts of a width that a name can have, or objects."""
    dtype = np.dtype(str(name))
    if dtype.kind not in "UO" or dtype.itemsize > 1 << 16:
        raise ModelError(f"an array of the file has the type {name!r}, which is not one of texts")
    return dtype


def _text_of(model: Any) -> str:
    from .model.toml import dumps

    try:
        return dumps(model)
    except ModelError as reason:
        raise UnsavableError(
            f"the result carries its model, and {reason}; result.to_xarray().to_netcdf(path) writes the labelled data alone"
        ) from None


def _state(value: Any) -> Any:
    """What an object consists of, without what it computes again when asked."""
    if hasattr(value, "data_state"):
        return value.data_state()
    own = next((vars(k)["__getstate__"] for k in type(value).__mro__[:-1] if "__getstate__" in vars(k)), None)
    if own is not None:
        return own(value)
    again = {n for k in type(value).__mro__ for n, m in vars(k).items() if isinstance(m, cached_property)}
    return {k: v for k, v in value.__dict__.items() if k not in again}


class Decoder:
    """The values of a tree; ``functions``: whether models that call Python functions are read, which imports these."""

    def __init__(self, arrays: list[np.ndarray], functions: bool = False) -> None:
        self.arrays, self.functions = arrays, functions
        self._made: dict[int, Any] = {}
        self._depth = 0

    def decode(self, tree: Any) -> Any:
        """One value."""
        if isinstance(tree, list):
            return [self.decode(one) for one in tree]
        if not isinstance(tree, dict):
            return tree
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ModelError("the file is nested too deeply")
        value = self._value(tree)
        self._depth -= 1
        return value

    def _value(self, tree: dict[str, Any]) -> Any:
        kind = tree["~"]
        if kind == "float":
            return {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}[tree["is"]]
        if kind == "complex":
            return complex(self.decode(tree["re"]), self.decode(tree["im"]))
        if kind == "tuple":
            return tuple(self.decode(tree["of"]))
        if kind == "dict":
            return {self.decode(k): self.decode(v) for k, v in tree["of"]}
        if kind == "array":
            return self.arrays[tree["at"]]
        if kind == "texts":
            made = np.empty(len(tree["of"]), dtype=_text_type(tree["dtype"]))
            made[:] = self.decode(tree["of"])
            return made.reshape(tree["shape"])
        if kind == "again":
            return self._made[tree["at"]]
        if kind == "record":
            return self._record(tree)
        value = self._made[tree["at"]] = self._other(kind, tree)
        return value

    def _record(self, tree: dict[str, Any]) -> Any:
        cls = member(HOMES, tree["class"])
        value = self._made[tree["at"]] = cls.__new__(cls)
        state = self.decode(tree["state"])
        if hasattr(value, "__setstate__"):
            value.__setstate__(state)
        else:
            value.__dict__.update(state)
        return value

    def _other(self, kind: str, tree: dict[str, Any]) -> Any:
        if kind == "model":
            return _model_of(tree["toml"], self.functions)
        if kind == "tuple of":
            return member(HOMES, tree["class"])(self.decode(tree["of"]))
        if kind == "partial":
            args, keywords = self.decode(tree["given"])
            return functools.partial(member(FUNCTIONS, tree["function"]), *args, **keywords)
        if kind == "made":
            return member(FUNCTIONS, tree["function"])(*self.decode(tree["given"]))
        if kind == "derivative":
            from .matrix_calculus import Derivative

            return Derivative.of(self.decode(tree["of"]), *tree["more"])
        if kind in ("sparse csc", "sparse csr"):
            import scipy.sparse

            made = scipy.sparse.csc_array if kind.endswith("csc") else scipy.sparse.csr_array
            parts = (self.decode(tree["data"]), self.decode(tree["indices"]), self.decode(tree["indptr"]))
            return made(parts, shape=tuple(tree["shape"]))
        raise ModelError(f"the file holds a value of the unknown kind {kind!r}")


def _model_of(text: str, functions: bool) -> Any:
    from .model.model import Model
    from .model.toml import loads

    return loads(text, Model, "the model of the result", functions)
