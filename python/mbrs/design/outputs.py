"""Named outputs of sweeps, ``mb.outputs``: which analysis, and which of its numbers. They pickle, and a store keeps them as text."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._lib.checks import choice, count, names, real_array, shown
from ..errors import ModelError
from ..results import along_parameters

__all__ = ["equilibrium", "frf", "modes", "sensitivity"]

# name of an output -> its dimensions after that of the designs, and its unit
Layout = Mapping[str, tuple[tuple[str, ...], str]]
_STATES = ("drawn", "equilibrium")


@dataclass(frozen=True)
class Analysis:
    """An analysis of a model and the numbers that it gives: called with a model, returns arrays by name."""

    parameters: tuple[str, ...]
    at: str

    @property
    def values(self) -> Layout:
        """Dimensions and unit of every array that the analysis itself gives, without derivatives."""
        raise NotImplementedError

    def compute(self, model: Any, at: Any) -> Any:
        """Its result."""
        raise NotImplementedError

    def numbers(self, result: Any) -> dict[str, Any]:
        """Values by name, of a result or of its sensitivity."""
        return {name: getattr(result, name) for name in self.values}

    def __call__(self, model: Any) -> dict[str, Any]:
        from ..linear.equilibrium import equilibrium as rest

        result = self.compute(model, rest(model) if self.at == "equilibrium" else None)
        found = self.numbers(result)
        if self.parameters:
            from ..linear.sensitivity import sensitivity as derive

            derived, layout = self.numbers(derive(result, list(self.parameters))), self.layout
            for name in (f"{name}_derivative" for name in derived):
                found[name] = along_parameters(layout[name][0], derived[name.removesuffix("_derivative")])
        return found

    @property
    def layout(self) -> Layout:
        """Dimensions and units of all outputs; a derivative ends in the parameters, its unit differs between them."""
        own = dict(self.values)
        if self.parameters:
            own |= {f"{name}_derivative": ((*dims, "parameter"), "") for name, (dims, _) in self.values.items()}
        return own

    def labels(self, model: Any) -> dict[str, tuple[Any, ...]]:
        """Labels of dimensions: the entries of the parameters by their addresses."""
        from ..model.addresses import target

        if not self.parameters:
            return {}
        return {"parameter": tuple(label for name in self.parameters for label in target(model, name).labels)}

    def describe(self) -> dict[str, Any]:
        """Describe the analysis and its arguments as data."""
        fields = {f.name: _plain(getattr(self, f.name)) for f in dataclasses.fields(self)}
        return {"analysis": type(self).__name__.strip("_").lower(), **fields}

    def __str__(self) -> str:
        return self.describe()["analysis"]


@dataclass(frozen=True)
class Modes(Analysis):
    """See `modes`."""

    n: int | None

    @property
    def values(self) -> Layout:
        return {"frequency": (("mode",), "Hz"), "damping": (("mode",), "1")}

    def compute(self, model: Any, at: Any) -> Any:
        from ..linear.modes import modes as analysis

        return analysis(model, at=at, n=self.n)


@dataclass(frozen=True)
class Frf(Analysis):
    """See `frf`."""

    inputs: tuple[Any, ...]
    outputs: tuple[Any, ...]
    frequency: tuple[float, ...]
    kind: str

    @property
    def values(self) -> Layout:
        return {"H": (("output", "input", "frequency"), "")}

    def compute(self, model: Any, at: Any) -> Any:
        from ..linear.frf import frf as analysis

        points = np.array(self.frequency)
        return analysis(
            model, inputs=list(self.inputs), outputs=list(self.outputs), frequency=points, kind=self.kind, at=at
        )

    def numbers(self, result: Any) -> dict[str, Any]:
        return {"H": result.value}

    def labels(self, model: Any) -> dict[str, tuple[Any, ...]]:
        ports = {"output": tuple(map(str, self.outputs)), "input": tuple(map(str, self.inputs))}
        return {**super().labels(model), **ports, "frequency": self.frequency}


@dataclass(frozen=True)
class Equilibrium(Analysis):
    """See `equilibrium`."""

    @property
    def values(self) -> Layout:
        return {"position": (("body", "axis"), "m"), "rotation": (("body", "axis", "axis_"), "1")}

    def compute(self, model: Any, at: Any) -> Any:
        from ..linear.equilibrium import equilibrium as rest

        return rest(model)

    def numbers(self, result: Any) -> dict[str, Any]:
        return {name: values for name, (_, values, _, _) in result.labelled().items() if name in self.values}

    @property
    def layout(self) -> Layout:
        changed = {"rotation_derivative": (("body", "axis", "parameter"), "")} if self.parameters else {}
        return {**super().layout, **changed}

    def labels(self, model: Any) -> dict[str, tuple[Any, ...]]:
        return {**super().labels(model), "body": tuple(body.name for body in model.bodies)}


def modes(n: int | None = None, sensitivities: Sequence[str] = (), *, at: str = "drawn") -> Analysis:
    """Natural frequencies (Hz) and damping ratios, ``frequency`` and ``damping`` (n,).

    Parameters
    ----------
    n
        How many of the lowest modes; all by default. Designs with fewer have nan for the rest.
    sensitivities
        Addresses: ``frequency_derivative`` and ``damping_derivative`` (n, p) as well, exact, along each parameter alone.
    at
        The state: "drawn" or "equilibrium".

    Examples
    --------
    >>> import mbrs as mb
    >>> outputs = mb.outputs.modes(n=2, sensitivities=["k_leg"])
    >>> outputs(mb.examples.cubic_hexapod())["frequency_derivative"].shape
    (2, 1)
    """
    number = None if n is None else count("n", n, 10**6)
    return Modes(names("sensitivities", sensitivities), choice("state", at, _STATES), number)


def frf(
    inputs: Any,
    outputs: Any,
    frequency: Any,
    kind: str = "receptance",
    sensitivities: Sequence[str] = (),
    *,
    at: str = "drawn",
) -> Analysis:
    """A transfer function ``H`` (n_out, n_in, n_freq), complex, at fixed frequencies (Hz); the other arguments as in `mb.frf`.

    With ``sensitivities`` also ``H_derivative`` (n_out, n_in, n_freq, p).
    """
    if isinstance(frequency, tuple):
        raise ModelError(
            f"frequency={shown(frequency)} is a range, which every design would sample at other points; give a list or an array"
        )
    points = np.atleast_1d(real_array("frequency", frequency))
    if points.ndim != 1 or not points.size:
        raise ModelError("frequency must be a list of numbers in Hz")
    state = choice("state", at, _STATES)
    return Frf(
        names("sensitivities", sensitivities), state, _listed(inputs), _listed(outputs), tuple(points.tolist()), kind
    )


def _listed(ports: Any) -> tuple[Any, ...]:
    return tuple(ports) if isinstance(ports, list | tuple) else (ports,)


def equilibrium(sensitivities: Sequence[str] = ()) -> Analysis:
    """Rest positions of bodies: ``position`` (n_bodies, 3) m, and ``rotation`` (n_bodies, 3, 3), from body to world axes.

    With ``sensitivities`` also ``position_derivative`` (n_bodies, 3, p), and ``rotation_derivative`` (n_bodies, 3, p) by a world
    rotation vector.
    """
    return Equilibrium(names("sensitivities", sensitivities), "equilibrium")


def sensitivity(analysis: Analysis, parameters: Sequence[str]) -> Analysis:
    """The outputs of another analysis with their exact derivatives by ``parameters``.

    >>> import mbrs as mb
    >>> mb.outputs.sensitivity(mb.outputs.modes(n=3), ["k_leg", "c_leg"]) == mb.outputs.modes(3, ["k_leg", "c_leg"])
    True
    """
    if not isinstance(analysis, Analysis):
        raise ModelError(f"sensitivity takes one of mb.outputs and parameters, not {shown(analysis)}")
    return dataclasses.replace(analysis, parameters=names("parameters", parameters))


def _plain(value: Any) -> Any:
    """A value as JSON holds it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value
