"""Designs: values of the numbers of a model that a study varies, one row for each design."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._lib.checks import shown
from ..errors import ModelError, NameNotFoundError
from ..results import Result, result

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@result
class Designs(Result):
    """A table of designs: one column for each address of a model, one row for each design.

    Attributes
    ----------
    names
        Addresses such as ``"k_leg"`` or ``"payload.mass"``, one for each column.
    values
        (n, p), in the units of the model.
    units
        Of each column; empty where none was given.
    source
        How the table came about.
    about
        What statistics need to know of the table, as far as it is known: ``"mean"`` (p,) and ``"covariance"`` (p, p) of the
        distribution, ``"poincare"`` (p,) constants of independent numbers, ``"saltelli"``: blocks of a table for Sobol indices.

    Examples
    --------
    >>> import mbrs as mb
    >>> designs = mb.design.full_factorial({"k": (1.0, 3.0), "c": [0.1, 0.7]}, levels=3, units={"k": "N/m"})
    >>> len(designs), designs.point(5), designs["k"][:2]
    (6, {'k': 3.0, 'c': 0.7}, array([1., 1.]))
    """

    names: tuple[str, ...]
    values: np.ndarray
    units: tuple[str, ...]
    source: str
    about: Mapping[str, Any]

    row: ClassVar[str] = "design"

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, name: str) -> np.ndarray:
        """One column (n,)."""
        if name not in self.names:
            raise NameNotFoundError(
                f"the designs have no column {shown(name)}; they have {', '.join(map(repr, self.names))}"
            )
        return self.values[:, self.names.index(name)]

    def __iter__(self) -> Iterator[dict[str, float]]:
        return (self.point(i) for i in range(len(self)))

    def point(self, index: int) -> dict[str, float]:
        """One design as what `Model.set` takes."""
        return dict(zip(self.names, self.values[index].tolist(), strict=True))

    def part(self, rows: slice | Sequence[int] | np.ndarray) -> Designs:
        """The designs of a slice, of indices or of a mask."""
        return table(self.names, self.values[rows], self.units, f"part of {self.source}")

    def labelled(self) -> dict[str, tuple[tuple[str, ...], Any, str, str]]:
        return {name: (("design",), self.values[:, j], self.units[j], name) for j, name in enumerate(self.names)}

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "source": self.source}

    def heading(self) -> str:
        return f"{len(self)} designs of {len(self.names)} numbers, {self.source}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that is printed: the range of each number."""
        if not len(self):
            return ["number", "unit"], [list(line) for line in zip(self.names, self.units, strict=True)]
        sides = (self.values.min(axis=0), self.values.mean(axis=0), self.values.max(axis=0))
        rows = zip(self.names, self.units, *(side.tolist() for side in sides), strict=True)
        return ["number", "unit", "least", "mean", "largest"], [list(line) for line in rows]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Every design as a line over its numbers, each scaled to its range; returns the figure."""
        from ..plot.sweeps import parallel

        return parallel(self.labelled(), self.heading(), ax=ax)


def table(
    names: Sequence[str], values: np.ndarray, units: Sequence[str], source: str, about: Mapping[str, Any] | None = None
) -> Designs:
    """A table of designs from checked parts."""
    rows = np.array(values, dtype=float, order="C").reshape(-1, len(names))
    return Designs(tuple(names), rows, tuple(units), source, dict(about or {}), status="computed")


def checked_names(given: Any) -> tuple[str, ...]:
    """Addresses of numbers: texts, each once."""
    names = tuple(given)
    for name in names:
        if not isinstance(name, str) or not name.strip():
            raise ModelError(f"the name of a number must be an address such as 'payload.mass', it is {shown(name)}")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ModelError(f"the number {twice[0]!r} occurs twice among the designs")
    if not names:
        raise ModelError("designs need at least one number that varies")
    return names


# Rows (n, p), columns by name, or a table.
DesignsLike = Designs | Mapping[str, ArrayLike] | ArrayLike


def checked_units(names: Sequence[str], units: Mapping[str, str] | None) -> tuple[str, ...]:
    """The unit of every name, empty where none was given."""
    given = dict(units or {})
    unknown = [name for name in given if name not in names]
    if unknown:
        raise NameNotFoundError(f"units= names {unknown[0]!r}, which does not vary; known are {', '.join(names)}")
    for name, unit in given.items():
        if not isinstance(unit, str):
            raise ModelError(f"the unit of {name!r} must be text such as 'N/m', it is {shown(unit)}")
    return tuple(given.get(name, "") for name in names)


def fingerprint(values: np.ndarray) -> str:
    """SHA-256 of the bits of a table."""
    rows = np.ascontiguousarray(values, dtype="<f8")
    return hashlib.sha256(str(rows.shape).encode() + rows.tobytes()).hexdigest()
