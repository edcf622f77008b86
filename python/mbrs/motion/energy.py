"""Energies and powers of a motion: `Trajectory.energy`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from .._lib.text import counted
from ..results import Result, quantity, result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@result
class Energy(NDArrayOperatorsMixin, Result):
    """Energies of a motion; behaves as the array of their sum: in arithmetic, in NumPy functions, by index.

    Attributes
    ----------
    time
        (n_t,) s.
    total, kinetic, gravity
        (n_t,) J. Gravity counts from the world origin, springs from their unstretched state.
    stored
        (n_t,) J of each element and joint spring by name; without an entry: no energy belongs to its forces.
    power
        (n_t,) W that each element takes out of the motion, by name: what it stores and what it dissipates; of a force or
        torque negative where it drives. For drives: `Trajectory.drive_force` times the rate of the joint.
    """

    time: np.ndarray = quantity(dims=("time",), unit="s")
    total: np.ndarray = quantity(dims=("time",), unit="J")
    kinetic: np.ndarray = quantity(dims=("time",), unit="J")
    gravity: np.ndarray = quantity(dims=("time",), unit="J")
    stored: dict[str, np.ndarray]
    power: dict[str, np.ndarray]

    row: ClassVar[str] = "time"
    axes: ClassVar[Mapping[str, str]] = {"time": "time"}

    def heading(self) -> str:
        return f"energy at {counted(len(self.total), 'output')}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: start, end and extremes of every part."""
        parts = {"total": self.total, "kinetic": self.kinetic, "gravity": self.gravity, **self.stored}
        rows = [[name, *(float(x) for x in (v[0], v[-1], v.min(), v.max()))] for name, v in parts.items() if len(v)]
        return ["[J]", "start", "end", "least", "largest"], rows

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Total, kinetic, gravity and stored energy over time; returns the figure."""
        from ..plot.motion import energies

        return energies(self, ax=ax)

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return np.asarray(self.total, dtype=dtype)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        totals = [x.total if isinstance(x, Energy) else x for x in inputs]
        return getattr(ufunc, method)(*totals, **options)

    def __len__(self) -> int:
        return len(self.total)

    def __getitem__(self, index: Any) -> Any:
        return self.total[index]
