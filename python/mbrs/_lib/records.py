"""Results as data: a tree of plain values and a list of arrays, from which `mbrs.io.results` makes the same objects."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import ModelError
from .names import RECORDS

# class -> module of the package: what a file may hold beside numbers, texts, arrays and models
HOMES: Mapping[str, str] = {
    **RECORDS,
    "Cores": "aero.lattice",
    "Wake": "aero.lattice",
    "Failure": "design.chunk",
    "Evidence": "design.evidence",
    "CriticalSpeed": "linear.critical_speeds",
    "CriticalSpeeds": "linear.critical_speeds",
    "GroupSensitivity": "linear.eigen_sensitivity",
    "Lags": "linear.floquet",
    "Periodic": "linear.floquet",
    "LinearSystem": "linear.linear_system",
    "Origin": "linear.linear_system",
    "Place": "linear.pairing",
    "LoadHistory": "linear.response",
    "SparseDerivative": "linear.linearization_sensitivity",
    "SparseModel": "linear.sparse_modes",
    "Directions": "model.directions",
    "BranchPoint": "nonlinear.branch_points",
    "Chunks": "nonlinear.branch_points",
    "Event": "nonlinear.branch_points",
    "Continuation": "nonlinear.options",
    "Fourier": "nonlinear.options",
    "OfModel": "nonlinear.parameter_response",
    "Part": "nonlinear.response_curve",
    "Recommendation": "studies.accuracy",
    "StudyPoint": "studies.accuracy",
    "EffectRow": "studies.effects",
    "Effect": "system.effects",
    "Snapshot": "system.snapshot",
    "Orbit": "system.state",
    "Loop": "system.system",
}
# functions that make again what the core holds, or compute an estimate when it is first asked for
FUNCTIONS: Mapping[str, str] = {
    "prepare": "nonlinear.balance",
    "prepare_family": "nonlinear.balance",
    "estimated_error": "motion.error",
}


class UnsavableError(ModelError):
    """Something in a result that a file of data cannot hold, such as a Python function."""


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
        if hasattr(value, "file_text"):
            return {"~": "model", "toml": _text_of(value)}
        if isinstance(value, functools.partial) and value.func.__name__ in FUNCTIONS:
            given = [self.encode(value.args), self.encode(value.keywords)]
            return {"~": "partial", "function": value.func.__name__, "given": given}
        if name in HOMES and type(value).__module__ == f"mbrs.{HOMES[name]}":
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


def _text_of(model: Any) -> str:
    try:
        return str(model.file_text())
    except ModelError as reason:
        raise UnsavableError(
            f"the result carries its model, and {reason}; result.to_xarray().to_netcdf(path) writes the labelled data alone"
        ) from None


def _state(value: Any) -> Any:
    """Attributes of an object, without those that it computes again when asked."""
    if hasattr(value, "data_state"):
        return value.data_state()
    own = next((vars(k)["__getstate__"] for k in type(value).__mro__[:-1] if "__getstate__" in vars(k)), None)
    if own is not None:
        return own(value)
    again = {n for k in type(value).__mro__ for n, m in vars(k).items() if isinstance(m, cached_property)}
    return {k: v for k, v in value.__dict__.items() if k not in again}
