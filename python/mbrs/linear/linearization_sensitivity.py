"""Derivatives of linearisations, equilibria and steady motions: results of `mb.sensitivity`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from .._lib.text import without_rounding
from ..model.directions import Directions
from ..model.schema import BODY
from ..model.tables import tables
from ..results import Result, derived, quantity, result
from .linearization import Linearization
from .parts import split

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class SparseDerivative:
    """Derivatives of a matrix along n_p directions by their entries that are not zero; the parameter axis is last."""

    row: np.ndarray
    column: np.ndarray
    direction: np.ndarray
    value: np.ndarray
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, entries: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], shape: tuple[int, int, int]) -> Self:
        """From what the core returns: rows, columns, directions, values."""
        row, column, direction, value = entries
        return cls(row, column, direction, value, shape)

    def dense(self) -> np.ndarray:
        """(n, n, n_p)."""
        out = np.zeros(self.shape)
        np.add.at(out, (self.row, self.column, self.direction), self.value)
        return out

    def symmetric(self, whole: np.ndarray) -> SparseDerivative:
        """The symmetric part, but for the directions where ``whole`` (n_p,); entries may then stand twice and add up."""
        half = ~whole[self.direction]
        return SparseDerivative(
            np.concatenate([self.row, self.column[half]]),
            np.concatenate([self.column, self.row[half]]),
            np.concatenate([self.direction, self.direction[half]]),
            np.concatenate([np.where(half, 0.5, 1.0) * self.value, 0.5 * self.value[half]]),
            self.shape,
        )


@result
class LinearizationSensitivity(Result):
    """Derivatives of a linearisation; the parameter axis is last, and a single array parameter keeps its shape there.

    Attributes
    ----------
    M, C, G, K, N
        (dof, dof, n_p), None where the matrix itself is absent. C, G and N also exist where a parameter makes them: a damper
        of size zero, a single entry of a full bushing, a given velocity.
    T
        (6 n_bodies, dof, n_p), of `mb.sensitivity` of a linearisation.
    position, rotation
        (n_bodies, 3, n_p): how each body's origin moves, m, and how the body turns, world rotation vector, rad, per
        unit
        of the parameter. Zero where the configuration is held.
    coordinate
        (n_tree, n_p) the same in tree coordinates.
    labels, units
        Of the parameters.
    """

    mass: SparseDerivative
    damping: SparseDerivative
    stiffness: SparseDerivative
    T: np.ndarray | None
    position: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    rotation: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    coordinate: np.ndarray
    ground_coupling: np.ndarray | None
    labels: tuple[str, ...]
    units: tuple[str, ...]
    directions: Directions
    linearization: Linearization
    parameter_shape: tuple[int, ...]

    row: ClassVar[str] = "parameter"
    largest_error: ClassVar[float] = np.inf  # that of the linearisation, whose status it has
    axes: ClassVar[Mapping[str, str]] = {
        "body": "bodies",
        "parameter": "labels",
        "coordinate": "coordinates",
        "coordinate_": "coordinates",
    }

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.linearization.bodies

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.linearization.coordinates

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dM")
    def M(self) -> np.ndarray:
        """dM/dp."""
        return self._shaped(self.mass.dense())

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dC")
    def C(self) -> np.ndarray | None:
        """dC/dp, the symmetric part of the derivative of the damping; without damping in the model, where a parameter brings it in."""
        symmetric = split(self.damping.dense())[0]
        return self._shaped(symmetric) if self.linearization.C is not None or np.any(symmetric) else None

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dG")
    def G(self) -> np.ndarray | None:
        """dG/dp, the skew part of the derivative of the damping."""
        return self._skew(self.damping, self.has_G)

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dK")
    def K(self) -> np.ndarray:
        """dK/dp, the symmetric part of the derivative of the stiffness."""
        return self._shaped(split(self.stiffness.dense())[0])

    @cached_property
    @derived(dims=("coordinate", "coordinate_", "parameter"), name="dN")
    def N(self) -> np.ndarray | None:
        """dN/dp, the skew part of the derivative of the stiffness."""
        return self._skew(self.stiffness, self.has_N)

    def _skew(self, of: SparseDerivative, has: np.ndarray) -> np.ndarray | None:
        return self._shaped(split(of.dense())[1] * has) if np.any(has) else None

    def _shaped(self, a: np.ndarray) -> np.ndarray:
        return a.reshape(*a.shape[:-1], *self.parameter_shape)

    def with_shape(self) -> Self:
        """The same with the parameter axis in the shape of the one array that was asked for."""
        shaped = self.directions.shaped
        arrays = {name: getattr(self, name) for name in ("T", "position", "rotation", "coordinate", "ground_coupling")}
        given: dict[str, Any] = {name: shaped(a) for name, a in arrays.items() if a is not None}
        return replace(self, parameter_shape=self.directions.shape, **given)

    @cached_property
    def has_G(self) -> np.ndarray:
        """(n_p,) bool: parameters whose dG counts; without G in the model, those that bring one in."""
        lin, along = self.linearization, self.directions
        if lin.G is not None:
            return np.ones(along.n, dtype=bool)
        moving = (BODY.block.slice("velocity"), BODY.block.slice("angular_velocity"))
        velocities = [
            int(s) + i for s in tables(lin.model)["body_x"] for part in moving for i in range(part.start, part.stop)
        ]
        return np.asarray(_cross_couples(lin.model, along, "c") | _touches(along, velocities))

    @cached_property
    def has_N(self) -> np.ndarray:
        """(n_p,) bool: parameters whose dN counts; without N in the model, those that bring one in."""
        lin, along = self.linearization, self.directions
        return np.ones(along.n, dtype=bool) if lin.N is not None else _cross_couples(lin.model, along, "k")

    @property
    def D(self) -> np.ndarray | None:
        """C + G."""
        parts = [a for a in (self.C, self.G) if a is not None]
        return sum(parts[1:], parts[0]) if parts else None

    @property
    def S(self) -> np.ndarray:
        """K + N."""
        return self.K if self.N is None else self.K + self.N

    def heading(self) -> str:
        return f"derivatives of {self.linearization.model.name!r}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest entries by each parameter."""
        sizes = [
            np.abs(a).reshape(-1, len(self.labels)).max(axis=0, initial=0.0) for a in (self.M, self.K, self.position)
        ]
        rows = [[*line] for line in zip(self.labels, self.units, *(s.tolist() for s in sizes), strict=True)]
        return ["parameter", "unit", "max |dM|", "max |dK|", "max |dx| [m]"], rows

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Largest entries of dM and dK by each parameter, each over the largest of its matrix; returns the figure."""
        from ..plot.derivatives import linearization_sensitivity

        return linearization_sensitivity(self, ax=ax)


@result
class EquilibriumSensitivity(Result):
    """Derivatives of an equilibrium or a steady motion: ``position`` and ``rotation`` (n_bodies, 3, n_p), world; ``coordinate`` (n_tree,
    n_p). A single array parameter keeps its shape there.
    """

    position: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    rotation: np.ndarray = quantity(dims=("body", "axis", "parameter"))
    coordinate: np.ndarray
    bodies: tuple[str, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"body": "bodies", "parameter": "labels"}

    def heading(self) -> str:
        return "equilibrium per unit of each parameter"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: how each body moves by each parameter."""
        rows: list[list[Any]] = []
        values = self.labelled()
        position, rotation = values["position"][1], values["rotation"][1]
        for p, (label, unit) in enumerate(zip(self.labels, self.units, strict=True)):
            numbers = without_rounding(np.hstack([position[..., p], rotation[..., p]]))
            rows += [[body, label, unit, *line] for body, line in zip(self.bodies, numbers.tolist(), strict=True)]
        return ["body", "parameter", "unit", "dx", "dy", "dz", "drx", "dry", "drz"], rows

    def notes(self) -> list[str]:
        from .._lib.text import unit_note

        note = unit_note(self.labels, self.units)
        return [note] if note else []

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Displacement of each body by each parameter, as bars; returns the figure."""
        from ..plot.derivatives import equilibrium_sensitivity

        return equilibrium_sensitivity(self, ax=ax)


def _cross_couples(model: Any, along: Directions, name: str) -> np.ndarray:
    """(n_p,) bool: directions along which the k or c of a full bushing becomes unsymmetric."""
    out = np.zeros(along.n, dtype=bool)
    places = tables(model)["element_x"]
    for element in model.elements:
        if element.shapes.get(name) == (6, 6):
            start = int(places[element.index]) + element.table.block.place(name)
            d = along.part(start, 36).reshape(6, 6, -1)
            out |= np.any(d != d.transpose(1, 0, 2), axis=(0, 1))
    return out


def _touches(along: Directions, places: Sequence[int]) -> np.ndarray:
    """(n_p,) bool: directions with a part in some of the places of x."""
    out = np.zeros(along.n, dtype=bool)
    out[along.columns[np.isin(along.rows, places)]] = True
    return out
