"""Branches of periodic responses in any parameter of a system or model."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from .._lib.checks import shown
from ..errors import ModelError
from ..model.book import Book
from ..results import Result, quantity, result
from . import balance
from .branch import BRANCH_DEFAULTS, Branch, interrupted, takes_branch_options
from .branch_options import BranchOptions
from .branch_points import Event, checked_event
from .options import point_number, points
from .periodic import PeriodicSolution
from .response_curve import FrequencyResponse
from .system import as_system

if TYPE_CHECKING:
    from ..linear.matrices import MechanicalSystem
    from ..model.model import Model
    from .displacement import Displacement


@result
class ParameterResponse(FrequencyResponse):
    """A branch in a parameter: ``value`` (n,), one for each point; ``omega`` and ``level`` stay what they are.

    The rest is as of `FrequencyResponse`; every event has its ``value`` too. ``family`` makes the system for a value.
    """

    value: np.ndarray = quantity(dims=("point",), default_factory=lambda: np.zeros(0), kw_only=True)
    name: str = field(default="value", kw_only=True)
    family: Callable[[float], Any] | None = field(default=None, repr=False, kw_only=True)

    @property
    def folds(self) -> np.ndarray:
        """Values at which the branch turns."""
        return np.array([event.value for event in self.events if event.kind == "fold"], dtype=float)

    def point(self, i: int) -> PeriodicSolution:
        """The solution number ``i`` by itself, with the system of its value."""
        i = point_number(i, len(self))
        return self._with_system(super().point(i), float(self.value[i]), float(self.level[i]))

    @property
    def varies(self) -> str:
        """Name of the parameter that varies along the curve."""
        return self.name

    def axis(self) -> tuple[np.ndarray, str]:
        """Abscissa of the curve, (n,), and its name."""
        return self.value, self.name

    def place(self, event: Event) -> float:
        """Abscissa of an event."""
        value = checked_event(event).value
        return float("nan") if value is None else value

    def at(self, event: Event) -> PeriodicSolution:
        """The motion at an event, with the system there."""
        return self._with_system(super().at(event), self.place(event), event.level)

    def _with_system(self, one: PeriodicSolution, value: float, level: float) -> PeriodicSolution:
        if self.family is None:
            return one
        system, force = self.family(value)
        return one.replaced(system=system, force=balance.scaled_force(force, level))

    def peak(self, dof: Displacement = 0, harmonic: int | None = 1) -> PeriodicSolution:
        """The point of the curve with the largest amplitude; not solved for."""
        return self.point(int(np.argmax(self.amplitude(dof, harmonic))))

    def resume(self, max_points: int = 1000) -> ParameterResponse:
        """The same branch with up to ``max_points`` more points; also of one that was saved (not as ``.nc``) and loaded, where
        its systems come from a model or from a function that can be imported."""
        if self.branch is None:
            raise ModelError(
                "this branch cannot go on: its systems came from a function that cannot be imported; define it in a module"
            )
        most = len(self.branch.chunks) + points(max_points)
        return _followed(self.branch, most, self.name, self.stats.wall_time)

    def _span(self) -> str:
        return f"{self.name} {self.value.min():.6g} to {self.value.max():.6g} at {self.frequency[0]:.6g} Hz"

    def data_state(self) -> dict[str, Any]:
        if self.family is None or isinstance(self.family, OfModel):
            return super().data_state()
        # what makes the systems cannot travel in data, so that the coefficients must
        order = self.parts[0].setup.subharmonic if self.parts else 1
        cache = {"X": self.X, "subharmonic": order}
        return {**super().data_state(), "family": None, "parts": (), "branch": None, "_built": cache}

    def __getstate__(self) -> dict[str, Any]:
        return Result.data_state(self) if self.family is None or _travels(self.family) else self.data_state()


@takes_branch_options
def parameter_response(
    system: Model | Callable[[float], MechanicalSystem],
    parameter: str | None = None,
    *,
    value: tuple[float, float],
    max_points: int = 10000,
    **options: Unpack[BranchOptions],
) -> ParameterResponse:
    """Periodic responses at one frequency while a parameter p of the system changes, through folds: R(X, p) = 0.

    Parameters
    ----------
    system, parameter
        A `Model` and the address of one of its numbers ("k_leg", "payload.mass", "rail.law[0]"); or a function of p that
        returns the `MechanicalSystem`, with the same coordinates and elements for all p, and no ``parameter``.
    value
        (start, end) of p, in its unit.
    force, inputs, amplitude, omega, frequency, level, harmonics, n_samples, subharmonic, condense, x0, tol, at, without
        As for `frequency_response`, with one frequency and one level.
    predictor, corrector, step, min_step, max_step, tolerance, stability, events, max_points
        As for `frequency_response`.

    Returns
    -------
    ParameterResponse
        ``value``, ``X``, ``stable``, ``events``, ``error``, ``status`` as of `FrequencyResponse`.

    Raises
    ------
    ModelError
        Wrong input, or a system that cannot be made for a value on the way.
    ConvergenceError
        The first point was not found.

    Notes
    -----
    Equations: docs/theory.md (13.1) to (13.5).
    The continuation of `frequency_response` with the exact Jacobian; dR/dp is a central difference between two systems, on
    whose accuracy neither solutions nor folds depend. Three systems are made per iteration, which takes most of the time.
    Numbers of a model are as before when the function returns.

    Examples
    --------
    >>> import mbrs as mb
    >>> family = lambda k3: mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(k3, w=[1.0])])
    >>> mb.parameter_response(family, value=(0.01, 0.1), force=[0.18], omega=0.9).status
    'converged'
    """
    started = perf_counter()
    most = points(max_points)
    made = _family(system, parameter, options)
    branch = Branch(None, family=made, value=value, **options)
    return _followed(branch, most, parameter or "value", perf_counter() - started)


def _followed(branch: Branch, most: int, name: str, wall_time: float) -> ParameterResponse:
    started = perf_counter()
    try:
        branch.follow(most, None, "parameter response")
    except KeyboardInterrupt:
        raise interrupted(branch, lambda: _collect(branch, name, wall_time + perf_counter() - started)) from None
    return _collect(branch, name, wall_time + perf_counter() - started)


def _collect(branch: Branch, name: str, wall_time: float) -> ParameterResponse:
    fields = branch.fields(wall_time)
    value = np.concatenate([part.value for part in fields["parts"]])
    return ParameterResponse(**fields, value=value, name=name, family=branch.family)


def _family(system: Any, parameter: str | None, options: BranchOptions) -> Callable[[float], tuple[Any, Any]]:
    """p -> (system, force)"""
    given: dict[str, Any] = {**BRANCH_DEFAULTS, **options}
    rest = tuple(given[name] for name in ("force", "amplitude", "at", "without", "inputs"))
    if isinstance(system, Book):
        if not isinstance(parameter, str):
            raise ModelError(
                f'parameter must be the address of a number of the model, such as "k", it is {shown(parameter)}'
            )
        return OfModel(system, parameter, rest)
    if not callable(system):
        raise ModelError("parameter_response needs a Model with the address of a number, or a function of the value")
    if parameter is not None:
        raise ModelError("parameter= is the address of a number of a model; a function of the value needs none")
    return OfFunction(system, rest)


@dataclass(frozen=True)
class OfModel:
    """p -> (system, force) of a model with one of its numbers changed; the model is as before afterwards."""

    model: Any
    address: str
    rest: tuple[Any, ...]

    def __call__(self, p: float) -> tuple[Any, Any]:
        before = self.model.value(self.address)
        self.model.set({self.address: p})
        try:
            made, given = as_system(self.model, *self.rest)
            made.values = {self.address: p}
            return made, given
        finally:
            self.model.set({self.address: before})


@dataclass(frozen=True)
class OfFunction:
    """p -> (system, force) of a user's function of p."""

    function: Callable[[float], Any]
    rest: tuple[Any, ...]

    def __call__(self, p: float) -> tuple[Any, Any]:
        return as_system(self.function(p), *self.rest)


def _travels(family: Any) -> bool:
    try:
        pickle.dumps(family)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True
