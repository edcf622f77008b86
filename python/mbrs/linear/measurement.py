"""Measurements, or results of other programs: functions at nodes, modes, positions of the nodes. `mb.load` reads files of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .._lib.text import counted
from ..errors import ModelError
from ..results import Result, Stats, derived, quantity, result
from .frf import FrfResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .frf import FrfResult

__all__ = ["MeasuredFunction", "Measurement"]

# FRFs of one set have the same frequencies up to the digits of a text file; the share by which they may differ. Too small: sets with
# rounded axes fall apart. Too large: other sampling passes. Pinned by tests/io/test_uff.py.
_SAME_AXIS = 1e-5


@dataclass(frozen=True, eq=False)
class MeasuredFunction:
    """One function: an FRF, a time history, a spectrum.

    Attributes
    ----------
    kind
        "frequency response", "time response", "coherence", ...
    response, reference
        Node and direction, "12:+z", or the name that mbrs gave; "" where there is none.
    quantity
        What the values are: "displacement", "velocity", "acceleration", "force", ... and, of an FRF, over what: "acceleration/force".
    unit
        Label of the values in the file.
    x, value
        (n,) s or Hz, and the values in SI units, complex for an FRF.
    """

    kind: str
    response: str
    reference: str
    quantity: str
    unit: str
    x: np.ndarray
    value: np.ndarray


@result
class Measurement(Result):
    """Functions, modes and geometry from a test or another program.

    Attributes
    ----------
    node, position
        (n_node,) numbers and (n_node, 3) m of the nodes.
    node_name
        Names of the nodes where the file has them, else their numbers as text.
    lines
        Polygons of node numbers, to draw the structure.
    functions
        Each a `MeasuredFunction`; `frf` makes one matrix of the frequency responses.
    eigenvalue
        (n_mode,) complex, rad/s.
    shape
        (6, n_node, n_mode) complex, x y z rx ry rz; zero where nothing was measured.
    """

    node: np.ndarray = quantity(dims=("node",))
    position: np.ndarray = quantity(dims=("node", "axis"), unit="m")
    node_name: tuple[str, ...]
    lines: tuple[tuple[int, ...], ...]
    functions: tuple[MeasuredFunction, ...]
    eigenvalue: np.ndarray = quantity(dims=("mode",), unit="rad/s")
    shape: np.ndarray = quantity(dims=("component", "node", "mode"))
    source: str = ""

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers"}

    @property
    def numbers(self) -> np.ndarray:
        """(n_mode,) modes counted from 1."""
        return np.arange(1, len(self.eigenvalue) + 1)

    @property
    @derived(dims=("mode",), unit="Hz", label="natural frequency")
    def frequency(self) -> np.ndarray:
        """(n_mode,) |s|/2pi in Hz."""
        return np.asarray(np.abs(self.eigenvalue) / (2.0 * math.pi))

    @property
    @derived(dims=("mode",), unit="1", label="damping ratio")
    def damping(self) -> np.ndarray:
        """(n_mode,) -Re s/|s|."""
        size = np.abs(self.eigenvalue)
        return np.asarray(
            np.divide(-self.eigenvalue.real, size, out=np.full(len(size), np.nan), where=size > 0.0) + 0.0
        )

    def frf(self, quantity: str | None = None) -> FrfResult:
        """The frequency responses as one matrix; nan where a pair was not measured.

        Parameters
        ----------
        quantity
            Such as "acceleration/force"; needed where the file has several.

        Raises
        ------
        ModelError
            There are none, several quantities, or different frequencies.
        """
        found = [f for f in self.functions if f.kind == "frequency response" and quantity in (None, f.quantity)]
        kinds = list(dict.fromkeys(f.quantity for f in found))
        if len(kinds) != 1:
            what = (
                f"several quantities: {', '.join(kinds)}; choose one"
                if kinds
                else "no frequency responses" + (f" of {quantity!r}" if quantity else "")
            )
            raise ModelError(f"{self.source or 'this measurement'} has {what}")
        x = found[0].x
        for f in found:
            if len(f.x) != len(x) or np.any(np.abs(f.x - x) > _SAME_AXIS * np.abs(x).max(initial=0.0)):
                raise ModelError(
                    f"{f.response} / {f.reference} has other frequencies than {found[0].response} / {found[0].reference}; "
                    "take them from .functions one by one"
                )
        outputs = tuple(dict.fromkeys(f.response for f in found))
        inputs = tuple(dict.fromkeys(f.reference for f in found))
        value = np.full((len(outputs), len(inputs), len(x)), np.nan, dtype=complex)
        for f in found:
            value[outputs.index(f.response), inputs.index(f.reference)] = f.value
        names = {"displacement/force": "receptance", "velocity/force": "mobility", "acceleration/force": "accelerance"}
        over, _, under = kinds[0].partition("/")
        kind = names.get(kinds[0], "transmissibility" if over == under else kinds[0])
        return FrfResult(
            value,
            x,
            2.0 * math.pi * x,
            kind,
            inputs,
            outputs,
            stats=Stats(route="measured"),
            error=math.nan,
            status="measured",
        )

    def heading(self) -> str:
        parts = ((len(self.functions), "function"), (len(self.eigenvalue), "mode"), (len(self.node), "node"))
        return f"{self.source or 'measurement'}: {', '.join(counted(*part) for part in parts)}"

    def notes(self) -> list[str]:
        kinds: dict[str, int] = {}
        for f in self.functions:
            name = f"{f.kind} ({f.quantity})" if f.quantity else f.kind
            kinds[name] = kinds.get(name, 0) + 1
        return [f"{n} x {name}" for name, n in kinds.items()]

    def plot(self, *, against: FrfResult | None = None, ax: Axes | None = None) -> Figure:
        """Magnitudes of all frequency responses, and the natural frequencies as vertical lines; returns the figure.

        Parameters
        ----------
        against
            `FrfResult` of a model, drawn as dashed lines; of its functions those of the same ports where there are such.
        ax
            Axes to draw into.
        """
        from ..plot.measurement import measurement as draw

        return draw(self, against=against, ax=ax)
