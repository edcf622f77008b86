"""Objective functions of a simulated motion: integrals over time, final values, values at given times."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._lib.checks import UNFIT, rising, shown
from .._lib.vetter import COMPLEX_STEP
from ..errors import ModelError, NotDifferentiableError
from ..motion.quantities import Instant, Names, QuantityKey
from ..motion.tangent import Nodes

# Steps of the differences they are compared with, over the coordinate, and the least size of a coordinate for it (rad, m). Larger: what
# bends looks like a kink; smaller: rounding of the objective hides what is not analytic.
_DIFFERENCE, _LEAST_SIZE = 1e-4, 1e-3
# Rounding of an objective, over its value. Larger: wrong slopes of objectives with a large constant pass; smaller: right ones are refused.
_ROUNDED = 1e-9
# Complex steps that differ from differences by more than this (relative) differentiate something else.
_PROBE = 1e-4
# Instants at which they are compared.
_PROBES = 16


def _called(function: Any, what: str) -> Callable[[Instant], Any]:
    if not callable(function):
        raise ModelError(f"{what} takes a function of the state, such as lambda s: np.sum(s.point('P') ** 2)")
    return function


@dataclass(frozen=True)
class Integral:
    """The integral of function(s) over the motion, by the quadrature of the scheme: as accurate as the motion.

    The function is a further state of the motion. The weights of the scheme integrate it: the trapezoidal rule on the steps of
    "ali3p" and "generalized-alpha" (order 2), the stages of "explicit" (order 8) and "radau" (order 5), at which the function
    is called too, and the formulas of the steps of "bdf".

    Parameters
    ----------
    function
        A function of a state s (`mbrs.motion.quantities.Instant`) that returns a number, written with NumPy; analytic (no abs, no
        np.linalg.norm: use np.sqrt(np.sum(x**2))), because it is differentiated by complex steps.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> psi = mb.Integral(lambda s: np.sum(s.position("crank") ** 2))
    """

    function: Callable[[Instant], Any]

    def __post_init__(self) -> None:
        _called(self.function, "mb.Integral")

    @property
    def times(self) -> tuple[float, ...]:
        """Times that must end a step."""
        return ()

    def weights(self, nodes: Nodes) -> np.ndarray:
        """(n_r,) what each instant counts."""
        return nodes.quadrature


@dataclass(frozen=True)
class Final:
    """function(s) at the end of the motion; see `Integral`."""

    function: Callable[[Instant], Any]

    def __post_init__(self) -> None:
        _called(self.function, "mb.Final")

    @property
    def times(self) -> tuple[float, ...]:
        """Times that must end a step."""
        return ()

    def weights(self, nodes: Nodes) -> np.ndarray:
        """(n_r,) what each instant counts."""
        w = np.zeros(len(nodes.t))
        w[nodes.n_ends - 1] = 1.0
        return w


@dataclass(frozen=True)
class AtTimes:
    """The sum of function(s) over given times; steps end there. ``s.index`` counts the times; see `Integral`.

    Parameters
    ----------
    at
        (n,) s, increasing.
    function
        As in `Integral`.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> data = np.zeros((2, 3))                                       # measured points
    >>> psi = mb.AtTimes([0.5, 1.0], lambda s: np.sum((s.position("crank") - data[s.index]) ** 2))
    """

    at: Sequence[float]
    function: Callable[[Instant], Any]

    def __post_init__(self) -> None:
        _called(self.function, "mb.AtTimes")
        rising("mb.AtTimes: the first argument", self.at, 1)

    @property
    def times(self) -> tuple[float, ...]:
        """Times that must end a step."""
        return tuple(float(t) for t in self.at)

    def weights(self, nodes: Nodes) -> np.ndarray:
        """(n_r,) what each instant counts."""
        w = np.zeros(len(nodes.t))
        w[np.argmin(np.abs(nodes.ends[:, None] - np.array(self.times)), axis=0)] = 1.0
        return w


Objective = Integral | Final | AtTimes


class NewReading(Exception):
    """A state was asked for something that was not among the quantities of the run."""

    def __init__(self, asked: QuantityKey) -> None:
        super().__init__(asked)
        self.asked = asked


@dataclass
class Reader:
    """The quantities of a run, their places in its rows, and the addresses of numbers that objectives read."""

    names: Names
    value_of: Callable[[str], Any]
    places: dict[QuantityKey, slice] = field(default_factory=dict)
    addresses: dict[str, Any] = field(default_factory=dict)

    def add(self, asked: QuantityKey) -> None:
        """One quantity more."""
        start = self.width
        self.places[asked] = slice(start, start + self.names.width(asked))

    @property
    def width(self) -> int:
        """Numbers per instant."""
        return max((s.stop for s in self.places.values()), default=0)

    def instant(self, t: float, index: int, row: np.ndarray, values: dict[str, Any] | None = None) -> Instant:
        """The state object of a row of numbers."""

        def read(asked: QuantityKey) -> np.ndarray:
            if asked not in self.places:
                raise NewReading(asked)
            # a copy: an objective may change what it is given
            return row[self.places[asked]].copy()

        def value(address: str) -> Any:
            if address not in self.addresses:
                self.addresses[address] = self.value_of(address)
            return self.addresses[address] if values is None or address not in values else values[address]

        return Instant(self.names, t, index, read, value)


def number(objective: Objective, s: Instant, real: bool = True) -> complex:
    """The value of an objective's function, checked."""
    found = objective.function(s)
    if np.ndim(found) != 0 or isinstance(found, (str, bytes)) or found is None:
        raise ModelError(
            f"the objective must return one number, got {shown(found)} at t = {s.t:.6g} s; sum it up, as in np.sum(x ** 2)"
        )
    try:
        value = complex(found)
    except UNFIT:
        raise ModelError(f"the objective must return one number, got {shown(found)} at t = {s.t:.6g} s") from None
    if not (math.isfinite(value.real) and math.isfinite(value.imag)):
        raise ModelError(f"the objective is {found} at t = {s.t:.6g} s; keep it finite along the whole motion")
    if real and value.imag != 0.0:
        raise ModelError(f"the objective is complex ({found}) at t = {s.t:.6g} s; return a real number")
    return value


@dataclass
class Evaluation:
    """Value of an objective, its derivative by what was read (n_r, width) and by addresses {address: array}."""

    value: float
    seeds: np.ndarray
    explicit: dict[str, np.ndarray]


def evaluate(objective: Objective, reader: Reader, nodes: Nodes, rows: np.ndarray) -> Evaluation:
    """Run an objective over a motion and differentiate it by complex steps."""
    weights, t = objective.weights(nodes), nodes.t
    used = np.flatnonzero(weights) if np.any(weights) else np.arange(len(t))
    used = used[np.argsort(t[used], kind="stable")]
    seeds = np.zeros_like(rows)
    explicit: dict[str, np.ndarray] = {}
    values, slopes = np.zeros(len(used)), np.zeros((len(used), rows.shape[1]))
    for index, i in enumerate(used):
        values[index] = number(objective, reader.instant(float(t[i]), index, rows[i])).real
        slopes[index] = _slopes(objective, reader, float(t[i]), index, rows[i])
        for address, d in _explicit(objective, reader, float(t[i]), index, rows[i]).items():
            explicit[address] = explicit.get(address, 0.0) + weights[i] * d
    seeds[used] = weights[used, None] * slopes
    for index in _probed(values, slopes):
        i = used[index]
        _probe(objective, reader, float(t[i]), index, rows[i], values[index], slopes[index])
    return Evaluation(float(weights[used] @ values), seeds, explicit)


def _probed(values: np.ndarray, slopes: np.ndarray) -> list[int]:
    """Indices of the instants to probe: some spread over all, and some at which a value has no slope (as with abs)."""
    silent = np.flatnonzero((values != 0.0) & ~np.any(slopes, axis=1))
    return sorted({*_spread(np.arange(len(values))), *_spread(silent)})


def _spread(places: np.ndarray) -> list[int]:
    """At most _PROBES of the places, the first and the last among them."""
    if not len(places):
        return []
    chosen = np.linspace(0, len(places) - 1, min(len(places), _PROBES)).round().astype(int)
    return [int(i) for i in places[chosen]]


def _slopes(objective: Objective, reader: Reader, t: float, index: int, row: np.ndarray) -> np.ndarray:
    out = np.zeros(len(row))
    moved = row.astype(complex)
    for k in range(len(row)):
        moved[k] = row[k] + 1j * COMPLEX_STEP
        out[k] = _complex_number(objective, reader.instant(t, index, moved), t).imag / COMPLEX_STEP
        moved[k] = row[k]
    return out


def _complex_number(objective: Objective, s: Instant, t: float) -> complex:
    """The value of a function where what it reads is complex."""
    try:
        return number(objective, s, real=False)
    except TypeError as reason:
        raise NotDifferentiableError(
            f"the objective does not take complex numbers (t = {t:.6g} s: {reason}), with which it is differentiated: write it with "
            "NumPy functions that do, without float(), math.* or comparisons such as max(); np.arctan2(y, x) is "
            "2 * np.arctan(y / (np.sqrt(x**2 + y**2) + x))"
        ) from reason


def _explicit(objective: Objective, reader: Reader, t: float, index: int, row: np.ndarray) -> dict[str, np.ndarray]:
    out = {}
    for address, now in reader.addresses.items():
        start = np.asarray(now, dtype=float)
        d = np.zeros(start.size)
        for k in range(start.size):
            moved = start.astype(complex).ravel()
            moved[k] += 1j * COMPLEX_STEP
            given = {address: moved.reshape(start.shape) if start.ndim else moved[0]}
            d[k] = _complex_number(objective, reader.instant(t, index, row, given), t).imag / COMPLEX_STEP
        out[address] = d
    return out


def _probe(
    objective: Objective, reader: Reader, t: float, index: int, row: np.ndarray, value: float, slopes: np.ndarray
) -> None:
    """Complex steps see analytic functions only: compare with a difference along one random direction."""

    def at(f: float) -> float:
        return number(objective, reader.instant(t, index, row + f * along)).real

    along = np.random.default_rng(0).normal(size=len(row)) * np.maximum(np.abs(row), _LEAST_SIZE)
    h = _DIFFERENCE
    for f, first in ((0.0, value), (h, at(h))):
        again = at(f)
        if again != first:
            raise ModelError(
                f"the objective is {first:.9g} and then {again:.9g} for the same state (t = {t:.6g} s): it must depend on the state "
                "alone, not on chance or on what it remembers of other calls; s.index counts instants"
            )
    if not len(row):
        return
    exact = float(slopes @ along)
    ahead, back, ahead2, back2 = (at(f) for f in (h, -h, 0.5 * h, -0.5 * h))
    coarse, fine = (ahead - back) / (2 * h), (ahead2 - back2) / h
    best = (4 * fine - coarse) / 3
    noise = abs(best - fine) + _ROUNDED * abs(value) / h
    right, left = (4 * ahead2 - ahead - 3 * value) / h, (3 * value - 4 * back2 + back) / h
    if abs(right - left) > _PROBE * max(abs(right), abs(left)) + 100 * noise:
        # a kink so close to this instant that differences tell nothing; others are probed
        return
    if abs(best - exact) > _PROBE * max(abs(best), abs(exact)) + 100 * noise:
        raise NotDifferentiableError(
            f"complex steps through the objective give {exact:.6g} where differences give {best:.6g} (t = {t:.6g} s): it is not "
            "analytic there. Avoid abs, np.linalg.norm, conjugates, .real and comparisons; write np.sqrt(np.sum(x**2))"
        )
