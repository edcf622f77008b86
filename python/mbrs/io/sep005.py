"""Time histories as dictionaries of SEP-005, the form that programs of the SDyPy project exchange.

https://sdypy-sep005.readthedocs.io
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.checks import real_array, shown
from ..errors import ModelError
from ..linear.measurement import MeasuredFunction, Measurement
from ..linear.response import ResponseResult

# quantity: (letter of SEP-005, unit of a translation, of a rotation)
_LETTERS = {
    "displacement": ("d", "m", "rad"),
    "velocity": ("v", "m/s", "rad/s"),
    "acceleration": ("a", "m/s^2", "rad/s^2"),
    "force": ("f", "N", "N m"),
    "strain": ("e", "1", "1"),
    "stress": ("s", "Pa", "Pa"),
}
# Steps of times that differ by less than this share are even. Too small: text files with few digits are uneven. Too large: a drifting
# clock passes for an even one.
_EVEN = 1e-9


def to_sep005(result: ResponseResult | Measurement) -> list[dict[str, Any]]:
    """Time histories of a response or a measurement as dictionaries of SEP-005.

    Parameters
    ----------
    result
        Of `mb.response`, or a `Measurement` with time responses.

    Returns
    -------
    list of dict
        One for each history: name, data, unit_str, quantity, and fs where the times are even, else time. Values are in SI units.

    Raises
    ------
    ModelError
        Another result, or one without time histories.

    Notes
    -----
    Cost O(size). W. Weijtjens and others, "SEP-005: timeseries", SDyPy enhancement proposals.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> s = mb.MechanicalSystem(M=[[2.0]], K=[[8.0]])
    >>> y = mb.response(s, t=np.linspace(0.0, 1.0, 11), loads={0: lambda t: t}, outputs=0)
    >>> mb.to_sep005(y)[0]["fs"], mb.to_sep005(y)[0]["quantity"]
    (10.0, 'd')
    """
    if isinstance(result, ResponseResult):
        return [
            _channel(name, result.kind, result.t, row) for name, row in zip(result.outputs, result.value, strict=True)
        ]
    if isinstance(result, Measurement):
        found = [f for f in result.functions if f.kind == "time response"]
        if found:
            return [_channel(f.response, f.quantity, f.x, np.real(f.value)) for f in found]
        raise ModelError(f"{result.source or 'this measurement'} has no time histories")
    raise ModelError(f"SEP-005 holds time histories of mb.response and of measurements, not a {type(result).__name__}")


def _channel(name: str, quantity: str, t: np.ndarray, data: np.ndarray) -> dict[str, Any]:
    letter, along, about = _LETTERS.get(quantity, ("", "", ""))
    turns = name.rpartition(":")[2].lstrip("+-").startswith("r") or name.rpartition(".")[2].lstrip("+-").startswith("r")
    made: dict[str, Any] = {"name": name, "data": np.asarray(data, dtype=float), "unit_str": about if turns else along}
    steps = np.diff(t)
    if t.size > 1 and t[0] == 0.0 and np.ptp(steps) <= _EVEN * steps.mean():
        made["fs"] = _rate(t)
    else:
        made["time"] = t.tolist()
    return made | ({"quantity": letter} if letter else {})


def _rate(t: np.ndarray) -> float:
    """Samples per second: the whole number where it is one but for rounding."""
    rate = (len(t) - 1) / float(t[-1] - t[0])
    whole = float(round(rate))
    return whole if whole and abs(rate - whole) <= 16 * np.finfo(float).eps * whole else rate


def from_sep005(channels: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> Measurement:
    """A measurement from dictionaries of SEP-005.

    Parameters
    ----------
    channels
        One, or several: name, data, unit_str, and fs (Hz) or time (s); quantity "d", "v", "a", "f", "e" or "s". Values are taken as they
        are: units are labels.

    Returns
    -------
    Measurement
        ``.functions`` are time responses.

    Raises
    ------
    ModelError
        A channel without name, data, unit or times, or of different lengths.

    Notes
    -----
    Cost O(size).

    Examples
    --------
    >>> import mbrs as mb
    >>> test = mb.from_sep005({"name": "12:+z", "data": [0.0, 1.0], "unit_str": "m/s^2", "fs": 100.0, "quantity": "a"})
    >>> test.functions[0].x.tolist(), test.functions[0].quantity
    ([0.0, 0.01], 'acceleration')
    """
    listed = [channels] if isinstance(channels, Mapping) else list(channels)
    return Measurement(
        node=np.zeros(0, dtype=int),
        position=np.zeros((0, 3)),
        node_name=(),
        lines=(),
        functions=tuple(_function(i, c) for i, c in enumerate(listed)),
        eigenvalue=np.zeros(0, dtype=complex),
        shape=np.zeros((6, 0, 0), dtype=complex),
        source="SEP-005",
        error=None,
        status="measured",
    )


def _function(i: int, channel: Any) -> MeasuredFunction:
    if not isinstance(channel, Mapping) or not isinstance(channel.get("name"), str) or "data" not in channel:
        raise ModelError(f"channel {i} is not a dictionary of SEP-005 with name and data: {shown(channel)}")
    name = channel["name"]
    if not isinstance(channel.get("unit_str"), str):
        raise ModelError(f"channel {name!r} has no unit_str")
    data = real_array(f"data of {name!r}", channel["data"])
    if data.ndim != 1:
        raise ModelError(f"data of {name!r} must be one row of numbers, its shape is {data.shape}")
    if channel.get("time") is not None:
        t = real_array(f"time of {name!r}", channel["time"])
    elif isinstance(channel.get("fs"), int | float) and 0.0 < channel["fs"] < math.inf:
        t = np.arange(len(data)) / float(channel["fs"])
    else:
        raise ModelError(f"channel {name!r} needs time, or fs above 0")
    if t.shape != data.shape:
        raise ModelError(f"channel {name!r} has {data.size} values at {t.size} times")
    quantities = {letter: quantity for quantity, (letter, _, _) in _LETTERS.items()}
    quantity = quantities.get(str(channel.get("quantity")), "")
    return MeasuredFunction("time response", name, "", quantity, channel["unit_str"], t, data)
