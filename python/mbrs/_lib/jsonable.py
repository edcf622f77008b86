"""Results as JSON: arrays as nested lists, complex numbers as real and imaginary parts, nan and inf as null."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["dumps", "jsonable", "result_data", "system_data"]


def dumps(data: Any) -> str:
    """The data as JSON text that every parser takes (no NaN)."""
    return json.dumps(jsonable(data), indent=1, allow_nan=False)


def jsonable(value: Any) -> Any:
    """Plain lists, dicts, numbers and strings; complex arrays become ``{"re": ..., "im": ...}``.

    Examples
    --------
    >>> jsonable({"s": np.array([1 + 2j]), "zeta": float("nan")})
    {'s': {'re': [1.0], 'im': [2.0]}, 'zeta': None}
    """
    if value is None or isinstance(value, bool | str | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return {"re": jsonable(value.real), "im": jsonable(value.imag)}
    if isinstance(value, np.ndarray) and np.iscomplexobj(value):
        return {"re": jsonable(value.real), "im": jsonable(value.imag)}
    if isinstance(value, np.ndarray | np.generic):
        plain = value.dtype.kind in "biuU" or (value.dtype.kind == "f" and bool(np.isfinite(value).all()))
        return value.tolist() if plain else jsonable(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: jsonable(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): jsonable(one) for key, one in value.items()}
    if isinstance(value, list | tuple | set | frozenset | range):
        return [jsonable(one) for one in value]
    return str(value)


def result_data(result: Any, names: tuple[str, ...]) -> dict[str, Any]:
    """The named attributes of a result, those it has, with its status, error and cost."""
    data = {name: getattr(result, name) for name in names if hasattr(result, name)}
    data = {name: value() if callable(value) else value for name, value in data.items()}
    stats = getattr(result, "stats", None)
    if stats is not None:
        fields = ("wall_time", "counts", "effects", "route")
        data["stats"] = {name: getattr(stats, name, None) for name in fields}
    data["status"] = getattr(result, "status", None)
    data["error"] = getattr(result, "error", None)
    return data


def system_data(system: Any, effects: Any) -> dict[str, Any]:
    """Data of ``mbrs check``: plain attributes of the system, and the effects."""
    names = ("name", "n_bodies", "n_joints", "n_elements", "dof", "rank", "loops", "redundant", "coordinates")
    data = {name: getattr(system, name) for name in names if hasattr(system, name)}
    data["effects"] = [{"name": e.name, "on": bool(e.on), "why": e.why} for e in effects]
    return data
