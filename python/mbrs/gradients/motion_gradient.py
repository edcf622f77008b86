"""The results of `mb.gradient`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.vetter import Derivative
from ..errors import ModelError
from ..results import Result, derived, quantity, result

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@result
class MotionGradient(Result):
    """Value and gradient of objectives of a motion; unpacks as ``value, gradient``.

    Attributes
    ----------
    value
        A float, or (n_obj,) for several objectives.
    gradient
        (n_p,), or in the shape of the one array parameter; (n_obj, ...) for several objectives. ``.vetter()`` gives the
        block layout.
    labels, units
        Of the parameters.
    where
        (n_p,) the values of the parameters; nan for turns of axes and orientations.
    t
        (n_t,) s; ends of the steps.
    method
        "direct" or "adjoint".
    kinks
        ``(t, element, what)`` of kinks of forces at which no step ended (a slider that begins or ceases to slide, friction that
        changes its sign within a step, a force that jumps): the gradient ignores them and is first-order accurate there.
    status
        "converged"; "unresolved" where ``error`` exceeds the root of ``rtol``, half of the digits that were asked of the motion, or
        .3 with fixed steps; "kinks" where there are such; "computed" without an estimate. Like ``error`` it is made when first asked for.
    growth
        How many times larger the relative changes of what the objectives read are than those of the parameters, at most. It grows
        without bound where a motion is chaotic; from 1e4 on there is a warning.
    error
        Estimated distance from the gradient of the continuous motion, by two runs with longer steps, or one with shorter ones where
        steps end at kinks (made when first asked for): the largest difference of an effect of a parameter's own size, relative to the
        largest effect. None for less than two steps, and after the model was changed.
    """

    value: Any
    gradient: Derivative
    labels: tuple[str, ...]
    units: tuple[str, ...]
    where: np.ndarray = quantity(dims=("parameter",))
    t: np.ndarray = quantity(dims=("t",), unit="s")
    method: str
    kinks: tuple[tuple[float, str, str], ...] = ()
    growth: float = 0.0

    def __iter__(self) -> Iterator[Any]:
        return iter((self.value, self.gradient))

    answers_sensitivity: ClassVar[bool] = True  # `mb.sensitivity` of it is its own method
    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"parameter": "labels"}

    @property
    def flat(self) -> np.ndarray:
        """(n_obj, n_p) the gradients without the shapes of objectives and parameters."""
        return np.asarray(self.gradient).reshape(-1, len(self.labels))

    @property
    @derived(dims=("objective", "parameter"), name="gradient")
    def _gradients(self) -> np.ndarray:
        return self.flat

    @property
    @derived(dims=("objective",), name="value")
    def _values(self) -> np.ndarray:
        return np.atleast_1d(self.value)

    @property
    @derived(dims=("parameter",))
    def unit(self) -> np.ndarray:
        """(n_p,) units of the parameters."""
        return np.array(self.units, dtype=str)

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "method": self.method}

    def heading(self) -> str:
        value = f"{self.value:.9g}" if np.ndim(self.value) == 0 else ", ".join(f"{v:.9g}" for v in self.value)
        return f"objective {value} ({self.stats.route})"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: value and gradient by parameter."""
        names = ["gradient"] if np.ndim(self.value) == 0 else [f"gradient {i}" for i in range(len(self.flat))]
        each = zip(self.labels, self.units, self.where.tolist(), *self.flat.tolist(), strict=True)
        return ["parameter", "unit", "value", *names], [list(row) for row in each]

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    def sensitivity(self, parameters: str | Sequence[str]) -> MotionSensitivity:
        """The gradient as `mb.sensitivity` returns derivatives: ``value``, parameter axis last; one array parameter keeps its shape."""
        named = [parameters] if isinstance(parameters, str) else list(parameters)
        arrays = [_entries(self.labels, p) for p in named]
        named = [label for labels in arrays for label in labels]
        missing = [p for p in named if p not in self.labels]
        if missing:
            raise ModelError(
                f"this gradient is by {', '.join(self.labels)}, not by {missing[0]!r}; compute it with that parameter"
            )
        flat = np.asarray(self.gradient).reshape(*np.shape(self.value), len(self.labels))
        chosen = [self.labels.index(p) for p in named]
        value = flat[..., chosen]
        return MotionSensitivity(
            value=value.reshape(*value.shape[:-1], *_shape(named)) if len(arrays) == 1 < len(named) else value,
            labels=tuple(named),
            units=tuple(self.units[i] for i in chosen),
            stats=self.stats,
        )

    def plot(
        self,
        kind: str = "tornado",
        *,
        n: int = 30,
        change: float | Mapping[str, float] = 0.01,
        objective: int = 0,
        ax: Axes | None = None,
    ) -> Figure:
        """Bars of the change of the objective by one per cent of each parameter, or by ``change=`` ("tornado")."""
        if kind != "tornado":
            raise ModelError(f"there is no plot {kind!r} of a gradient; known is 'tornado'")
        from ..plot import gradients

        return gradients.tornado(self, n=n, change=change, objective=objective, ax=ax)


def _entries(labels: Sequence[str], name: str) -> list[str]:
    """The labels that a name means: its own, or those of the entries of an array."""
    return [label for label in labels if label.rpartition("[")[0] == name and name not in labels] or [name]


def _shape(labels: Sequence[str]) -> tuple[int, ...]:
    """Shape of an array, from the labels of its entries; (n,) of anything else."""
    place = labels[-1].rpartition("[")[2].rstrip("]").split(",")
    shape = tuple(int(i) + 1 if i.isdigit() else 0 for i in place)
    return shape if math.prod(shape) == len(labels) else (len(labels),)


@result
class MotionSensitivity(Result):
    """Derivatives of objectives of a motion: ``value`` (..., n_p), by ``labels``."""

    value: np.ndarray
    labels: tuple[str, ...]
    units: tuple[str, ...]

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"parameter": "labels"}

    @property
    @derived(dims=("objective", "parameter"))
    def derivative(self) -> np.ndarray:
        """(n_obj, n_p) `value` without the shape of the objectives."""
        return self.value.reshape(-1, len(self.labels))

    @property
    @derived(dims=("parameter",))
    def unit(self) -> np.ndarray:
        """(n_p,) units of the parameters."""
        return np.array(self.units, dtype=str)

    def heading(self) -> str:
        return "objectives of a motion"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table."""
        rows = [list(row) for row in zip(self.labels, self.units, *self.derivative.tolist(), strict=True)]
        return ["parameter", "unit", *("derivative" for _ in self.derivative)], rows

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Derivatives as bars, each over the largest of its objective; returns the figure."""
        from ..plot.studies import motion_sensitivity

        return motion_sensitivity(self, ax=ax)


def effects_of(made: MotionGradient, gradients: Any) -> np.ndarray:
    """(n_obj, n_p) gradients times the parameters' sizes; turns and zeros count as they are."""
    sizes = np.abs(np.nan_to_num(made.where, nan=1.0))
    flat = np.asarray(gradients).reshape(-1, len(made.labels))
    return np.asarray(flat * np.where(sizes == 0.0, 1.0, sizes))
