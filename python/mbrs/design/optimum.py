"""Results of optimisations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.text import counted, unit_note
from ..results import Result, derived, quantity, result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A constraint that is violated by more than this (relative) does not hold.
FEASIBLE = 1e-4


@result
class Optimum(Result):
    """Result of an optimisation.

    Attributes
    ----------
    x
        (n_p,) parameters, in their units; the model has them now.
    value
        The objective there.
    history
        (n,) objective after every evaluation.
    violation
        (n,) how far the constraints were violated there, relative to their limits (absolute where these are 0).
    labels, units
        Of the parameters.
    message
        The optimiser's own words.
    error
        The gradient projected on what active bounds and constraints leave free, by variables over their scales, relative to the
        objective or its gradient at the start; None where the optimiser was stopped.
    """

    x: np.ndarray = quantity(dims=("parameter",))
    value: float = quantity(name="objective_at_x")
    history: np.ndarray = quantity(dims=("evaluation",), name="objective")
    labels: tuple[str, ...]
    units: tuple[str, ...]
    message: str
    violation: np.ndarray = quantity(dims=("evaluation",))

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"parameter": "labels"}

    @property
    @derived(dims=("parameter",))
    def unit(self) -> np.ndarray:
        """(n_p,) units of the parameters."""
        return np.array(self.units, dtype=str)

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "value": self.value, "message": self.message}

    def heading(self) -> str:
        return f"objective {self.value:.6g} after {counted(len(self.history), 'evaluation')}: {self.status} ({self.message})"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the parameters."""
        return ["parameter", "unit", "value"], [
            list(row) for row in zip(self.labels, self.units, self.x.tolist(), strict=True)
        ]

    def notes(self) -> list[str]:
        note = unit_note(self.labels, self.units)
        return [note] if note else []

    @property
    def kept(self) -> np.ndarray:
        """(n,) whether the constraints held at every evaluation, to 1e-4 of their limits."""
        return np.asarray(self.violation <= FEASIBLE)

    def plot(self, *, ax: Axes | None = None, label: str | None = None) -> Figure:
        """The objective over the evaluations."""
        from ..plot import gradients

        return gradients.convergence(self, ax=ax, label=label)
