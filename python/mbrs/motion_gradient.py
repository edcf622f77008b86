"""The results of `mb.gradient`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .errors import ModelError
from .matrix_calculus import Derivative
from .results import Result


@dataclass(frozen=True, eq=False, repr=False)
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
        ``(t, element, what)`` of places that the motion passed where a force has a kink (a gap that closes or opens, a slider
        that begins or ceases to slide, friction that changes its sign within a step): it is not differentiable there. The
        gradient is that of the steps on both sides of them; ``status`` is then "kinks" instead of "converged".
    growth
        How many times larger the relative changes of what the objectives read are than those of the parameters, at most. It grows
        without bound where a motion is chaotic; from 1e4 on a warning says so.
    error
        Estimated distance from the gradient of the continuous motion, by a second run with steps twice as long (made when first
        asked for): the largest difference of an effect of a parameter's own size, relative to the largest effect. None for less
        than two steps, and after the model was changed.
    """

    value: Any
    gradient: Derivative
    labels: tuple[str, ...]
    units: tuple[str, ...]
    where: np.ndarray
    t: np.ndarray
    method: str
    kinks: tuple[tuple[float, str, str], ...] = ()
    growth: float = 0.0
    estimate: Callable[[MotionGradient], float | None] | None = field(default=None, repr=False)
    error: Any = field(default=None, init=False)

    def __iter__(self) -> Iterator[Any]:
        return iter((self.value, self.gradient))

    def __str__(self) -> str:
        from .report import table, unit_note

        flat = np.asarray(self.gradient).reshape(-1, len(self.labels))
        named = zip(self.labels, self.units, self.where, strict=True)
        rows = [(label, unit, where, *flat[:, p]) for p, (label, unit, where) in enumerate(named)]
        names = ["gradient"] if np.ndim(self.value) == 0 else [f"gradient {i}" for i in range(len(flat))]
        value = f"{self.value:.9g}" if np.ndim(self.value) == 0 else ", ".join(f"{v:.9g}" for v in self.value)
        title, footer = f"objective {value} ({self.stats.route})", unit_note(self.labels, self.units)
        return table(["parameter", "unit", "value", *names], rows, title=title, footer=footer)

    __repr__ = __str__

    def __getstate__(self) -> dict[str, Any]:
        # the second run is a closure of this process: an estimate is kept if it was made
        return {**self.__dict__, "estimate": None}

    def sensitivity(self, parameters: str | Sequence[str]) -> MotionSensitivity:
        """The gradient as `mb.sensitivity` returns derivatives: ``value``, parameter axis last."""
        named = [parameters] if isinstance(parameters, str) else list(parameters)
        missing = [p for p in named if p not in self.labels]
        if missing:
            raise ModelError(
                f"this gradient is by {', '.join(self.labels)}, not by {missing[0]!r}; compute it with that parameter"
            )
        flat = np.asarray(self.gradient).reshape(*np.shape(self.value), len(self.labels))
        chosen = [self.labels.index(p) for p in named]
        return MotionSensitivity(
            value=flat[..., chosen],
            labels=tuple(named),
            units=tuple(self.units[i] for i in chosen),
            stats=self.stats,
        )

    def plot(self, kind: str = "tornado", **options: Any) -> Any:
        """Bars of the change of the objective by one per cent of each parameter, or by ``change=`` ("tornado")."""
        if kind != "tornado":
            raise ModelError(f"there is no plot {kind!r} of a gradient; known is 'tornado'")
        from .plot import gradients

        return gradients.tornado(self, **options)

    def to_xarray(self) -> Any:
        """`xarray.Dataset` over the parameters."""
        import xarray

        flat = np.asarray(self.gradient).reshape(-1, len(self.labels))
        return xarray.Dataset(
            {"gradient": (("objective", "parameter"), flat), "value": (("objective",), np.atleast_1d(self.value))},
            coords={
                "parameter": list(self.labels),
                "unit": ("parameter", list(self.units)),
                "where": ("parameter", self.where),
            },
            attrs={"method": self.method},
        )


def _error(self: MotionGradient) -> float | None:
    if "_error" not in self.__dict__:
        self.__dict__["_error"] = self.estimate(self) if self.estimate is not None else None
    found: float | None = self.__dict__["_error"]
    return found


# a property may not stand in the class body, where the dataclass would take it for a default
MotionGradient.error = property(_error, doc="Estimated error of the gradient, see the class.")  # type: ignore[assignment]


@dataclass(frozen=True, eq=False, repr=False)
class MotionSensitivity(Result):
    """Derivatives of objectives of a motion: ``value`` (..., n_p), by ``labels``."""

    value: np.ndarray
    labels: tuple[str, ...]
    units: tuple[str, ...]

    def __str__(self) -> str:
        from .report import table, unit_note

        flat = self.value.reshape(-1, len(self.labels))
        rows = [(label, unit, *flat[:, p]) for p, (label, unit) in enumerate(zip(self.labels, self.units, strict=True))]
        columns = ["parameter", "unit", *("derivative" for _ in flat)]
        return table(columns, rows, title="objectives of a motion", footer=unit_note(self.labels, self.units))

    __repr__ = __str__

    def to_xarray(self) -> Any:
        """`xarray.Dataset` over objectives and parameters."""
        import xarray

        return xarray.Dataset(
            {"derivative": (("objective", "parameter"), self.value.reshape(-1, len(self.labels)))},
            coords={"parameter": list(self.labels), "unit": ("parameter", list(self.units))},
        )


def effects_of(made: MotionGradient, gradients: Any) -> np.ndarray:
    """(n_obj, n_p) gradients times the parameters' sizes; turns and zeros count as they are."""
    sizes = np.abs(np.nan_to_num(made.where, nan=1.0))
    flat = np.asarray(gradients).reshape(-1, len(made.labels))
    return np.asarray(flat * np.where(sizes == 0.0, 1.0, sizes))
