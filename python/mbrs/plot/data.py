"""Data of figures as plain arrays and labels: shared by matplotlib figures and by the charts of pages."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._lib.text import number, si, without_rounding
from ..errors import MbrsError, ModelError

__all__ = [
    "Curve",
    "TornadoBar",
    "breaks_at_jumps",
    "curves",
    "frf_unit",
    "magnitude_label",
    "mode_index",
    "peak",
    "port_unit",
    "ranked_curves",
    "response_unit",
    "sensitivity_labels",
    "tornado_bars",
]

_RATE = {"receptance": "", "transmissibility": "", "mobility": "/s", "accelerance": "/s^2"}
_ROUNDING = 1e-13
_ROTATION = re.compile(r"\.[+-]?r[xyz](@|$)")


@dataclass(frozen=True, eq=False)
class Curve:
    """One transfer function: ``label`` and complex ``value`` (n_freq,)."""

    label: str
    value: np.ndarray


def curves(result: Any) -> list[Curve]:
    """The transfer functions of an `FrfResult`, outputs outer, inputs inner, named ``output / input``."""
    value = np.asarray(result.value)
    if value.ndim != 3 or 0 in value.shape:
        raise ModelError(
            f"a transfer function must be (n_out, n_in, n_freq) with all of them above 0, got {value.shape}"
        )
    outputs = _names(getattr(result, "outputs", ()), value.shape[0], "out")
    inputs = _names(getattr(result, "inputs", ()), value.shape[1], "in")
    return [
        Curve(outputs[i] if len(inputs) == 1 and len(outputs) > 1 else f"{outputs[i]} / {inputs[j]}", value[i, j])
        for i in range(value.shape[0])
        for j in range(value.shape[1])
    ]


def ranked_curves(result: Any) -> tuple[list[Curve], int]:
    """The curves from the largest peak down, and how many were left out as rounding.

    A response that symmetry forbids comes out at 1e-16 of the others; on a logarithmic axis it would fill the picture.
    """
    ranked = sorted(curves(result), key=lambda curve: -peak(curve.value))
    least = _ROUNDING * peak(ranked[0].value)
    kept = [curve for curve in ranked if peak(curve.value) > least] or ranked
    return kept, len(ranked) - len(kept)


def peak(value: np.ndarray) -> float:
    """Largest finite magnitude, 0 where there is none."""
    size = np.abs(value[np.isfinite(value)])
    return float(size.max()) if size.size else 0.0


def _names(names: Sequence[Any], count: int, default: str) -> list[str]:
    return [str(name) for name in names] if len(names) == count else [f"{default}{i}" for i in range(count)]


def frf_unit(result: Any) -> str:
    """Unit of the magnitude from the kind and the names of the ports; "1" for a ratio, "" where they are mixed."""
    stated = getattr(result, "unit", None)
    if isinstance(stated, str):
        return stated
    kind = str(getattr(result, "kind", ""))
    if kind not in _RATE:
        return ""
    outputs = {port_unit(name) for name in getattr(result, "outputs", ())} or {"m"}
    inputs = {port_unit(name) for name in getattr(result, "inputs", ())} or {"N"}
    if len(outputs) > 1 or len(inputs) > 1:
        return ""
    above, below = outputs.pop() + _RATE[kind], inputs.pop()
    if above == below:
        return "1"
    return f"{above}/{below}" if " " not in below else f"{above}/({below})"


def magnitude_label(unit: str) -> str:
    """Axis label of the magnitude; without a unit for a plain ratio."""
    return "|H|" if unit == "1" else f"|H| [{unit or 'mixed units'}]"


def port_unit(name: Any) -> str:
    """Unit of a port by its name (``payload.force.z``, ``base.rx``, ``payload.motion.z@(0,0,1)``): N, N m, m or rad."""
    text = str(name)
    if ".force." in text:
        return "N"
    if ".torque." in text:
        return "N m"
    return "rad" if _ROTATION.search(text) else "m"


def response_unit(result: Any) -> str:
    """Unit of the outputs of a response, or "SI units" where lengths and angles are mixed."""
    units = {port_unit(name) for name in getattr(result, "outputs", ())} or {"m"}
    rate = {"velocity": "/s", "acceleration": "/s^2"}.get(str(getattr(result, "kind", "")), "")
    return units.pop() + rate if len(units) == 1 else "SI units"


def breaks_at_jumps(values: np.ndarray, limit: float) -> np.ndarray:
    """A copy with nan where the curve jumps by more than ``limit``, so that a wrapped phase draws no vertical lines."""
    out = np.array(values, dtype=float)
    if out.size > 1:
        out[1:][np.abs(np.diff(values)) > limit] = np.nan
    return out


@dataclass(frozen=True)
class TornadoBar:
    """The change of one frequency, in hertz, for a small ``change`` of one parameter, told as text."""

    label: str
    change: str
    value: float


def mode_index(mode: int, n: int) -> int:
    """A mode counted from 0, checked."""
    if not isinstance(mode, int | np.integer) or not 0 <= mode < n:
        raise ModelError(f"mode={mode!r} is not among the {n} modes; it counts from 0")
    return int(mode)


def tornado_bars(sensitivity: Any, mode: int = 0, most: int = 20) -> list[TornadoBar]:
    """First-order changes of one frequency, the largest first.

    Each parameter is changed by +1 % of its value; lengths by 1 mm and angles by 1 mrad, since a share of a coordinate
    would depend on where the origin lies; by one unit where the value is not known. A value of 0 is left out.
    """
    derivative = np.asarray(sensitivity.frequency, dtype=float)
    derivative = derivative.reshape(derivative.shape[0], -1)
    i = mode_index(mode, derivative.shape[0])
    count = derivative.shape[1]
    labels = sensitivity_labels(sensitivity, count)
    units = _per_entry(sensitivity, "units", count)
    values = _values(sensitivity, labels)
    bars = []
    for j in range(count):
        step, text = _step(values[j], units[j])
        if step > 0.0 and np.isfinite(derivative[i, j]):
            bars.append(TornadoBar(labels[j], text, float(derivative[i, j] * step)))
    shown = without_rounding([bar.value for bar in bars])
    bars = [replace(bar, value=float(value)) for bar, value in zip(bars, shown, strict=True)]
    bars.sort(key=lambda bar: -abs(bar.value))
    return bars[:most]


def sensitivity_labels(sensitivity: Any, count: int) -> list[str]:
    """A label for every column, whether the result has them as names or makes them."""
    labels = getattr(sensitivity, "labels", None)
    labels = labels() if callable(labels) else labels
    return _names(labels if labels is not None else getattr(sensitivity, "parameters", ()), count, "p")


def _per_entry(sensitivity: Any, name: str, count: int) -> list[str]:
    """Texts for every column from texts for every parameter, whose sizes are in ``shapes``."""
    texts = [str(text) for text in getattr(sensitivity, name, ())]
    shapes = getattr(sensitivity, "shapes", None)
    if shapes is not None and len(shapes) == len(texts):
        texts = [text for text, shape in zip(texts, shapes, strict=True) for _ in range(math.prod(shape))]
    return texts if len(texts) == count else [""] * count


def _values(sensitivity: Any, labels: Sequence[str]) -> list[float]:
    """Present values of the parameters: as the result states them, else asked of the model; nan where unknown."""
    stated = getattr(sensitivity, "values", None)
    if stated is not None and not callable(stated):
        flat = np.ravel(np.asarray(stated, dtype=float))
        if flat.size == len(labels):
            return [float(v) for v in flat]
    model = getattr(getattr(getattr(sensitivity, "modal", None), "system", None), "model", None)
    return [_value_at(model, label) for label in labels]


def _value_at(model: Any, label: str) -> float:
    if model is None:
        return math.nan
    try:
        value = np.asarray(model.value(label), dtype=float)
    except MbrsError:
        return math.nan
    return float(value) if value.ndim == 0 else math.nan


def _step(value: float, unit: str) -> tuple[float, str]:
    if unit in ("m", "rad"):
        return 1e-3, f"+{si(1e-3, unit)}"
    if not math.isfinite(value):
        return 1.0, f"+1 {unit or 'unit'}"
    return 0.01 * abs(value), f"+1 % of {number(float(value), 6)} {unit}".rstrip()


def rounded(z: np.ndarray) -> np.ndarray:
    """Points of a line through complex values: cubic arcs where it turns by less than 60 degrees from piece to piece, else straight.

    Tangents are those of parabolas through three neighbours, so that circles of a dozen points look round.
    """
    if len(z) < 4:
        return z
    piece = np.diff(z)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = np.abs(piece)
        turn = np.abs(np.angle(piece[1:] / piece[:-1]))
        way = piece / length
        inner = (way[:-1] * length[1:] + way[1:] * length[:-1]) / (length[1:] + length[:-1])
        tangent = np.concatenate([way[:1], inner / np.abs(inner), way[-1:]])
    gentle = np.concatenate([[False], (turn[:-1] < np.pi / 3) & (turn[1:] < np.pi / 3), [False]])
    s = np.linspace(0.0, 1.0, 9)[:-1]
    out = []
    for i, arc in enumerate(gentle):
        if not arc:
            out.append(z[i : i + 1])
            continue
        a, b = length[i] * tangent[i], length[i] * tangent[i + 1]
        out.append(z[i] + s * (a + s * (3.0 * piece[i] - 2.0 * a - b + s * (a + b - 2.0 * piece[i]))))
    return np.concatenate([*out, z[-1:]])
