"""Directions dx/dp in the number vector x of a model's Tables, one column for each number that an address names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .._lib.rotations import cross, quaternion_rate
from ..errors import ModelError, NotDifferentiableError
from .addresses import Target, driver, target
from .book import Book
from .function_calls import FunctionCall
from .names import shown
from .tables import offsets

# Above this many entries the derivative of x is better sparse.
_DENSE_LIMIT = 1_000_000


@dataclass(frozen=True)
class Directions:
    """Directions dx/dp in the number vector x, one column for each number that an address names.

    Attributes
    ----------
    labels, units
        Of each column: "leg0.at_b[2]", "m". A parameter has the unit that `Model.parameter` was given; "" without one, and of
        numbers of laws.
    shape
        What the parameter axis of a derivative becomes: (n_p,), or the shape of the one array that was asked for.
    n_x
        Length of x.
    rows, columns, values
        The entries that are not zero.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    shape: tuple[int, ...]
    n_x: int
    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray

    @property
    def n(self) -> int:
        """Number of columns."""
        return len(self.labels)

    @cached_property
    def dense(self) -> np.ndarray:
        """(n_x, n) float64, column by column in memory."""
        out = np.zeros((self.n_x, self.n), order="F")
        np.add.at(out, (self.rows, self.columns), self.values)
        return out

    @cached_property
    def sparse(self) -> Any:
        """(n_x, n) `scipy.sparse.csc_array`."""
        from scipy.sparse import coo_array

        return coo_array((self.values, (self.rows, self.columns)), shape=(self.n_x, self.n)).tocsc()

    @property
    def is_small(self) -> bool:
        """True where `dense` is the cheaper form."""
        return self.n_x * self.n <= _DENSE_LIMIT

    def part(self, start: int, n: int) -> np.ndarray:
        """Rows start ... start + n of dx/dp, dense (n, n_p)."""
        out = np.zeros((n, self.n))
        inside = (self.rows >= start) & (self.rows < start + n)
        np.add.at(out, (self.rows[inside] - start, self.columns[inside]), self.values[inside])
        return out

    def shaped(self, derivative: np.ndarray) -> np.ndarray:
        """A derivative (..., n) with its last axis in the shape of the parameter."""
        return np.reshape(derivative, (*np.shape(derivative)[:-1], *self.shape))


def directions(model: Book, addresses: str | Sequence[str]) -> Directions:
    """Columns dx/dp for parameters and addresses.

    Parameters
    ----------
    model
        The values are taken as they are now.
    addresses
        One or more: "k_leg", "V" (all its entries), "V[0,1]", "payload.mass", "leg0.at_b[2]", "A.axis" (three columns:
        turning about world x, y, z). Each is a direction by itself, also where parameters drive the number.

    Returns
    -------
    Directions

    Raises
    ------
    NameNotFoundError
        An unknown address; the message proposes the nearest.
    NotDifferentiableError
        An expression at a kink, such as abs at 0.

    Examples
    --------
    >>> import mbrs as mb
    >>> from mbrs.model.directions import directions
    >>> m = mb.Model("one"); k = m.parameter("k", 5.0)
    >>> p = m.body("payload", mass=k * k, inertia=(1, 1, 1), at=(0, 0, 0))
    >>> directions(m, ["k", "payload.mass"]).dense[10]
    array([10.,  1.])
    """
    try:
        given = [addresses] if isinstance(addresses, str) else list(addresses)
    except TypeError:
        raise ModelError(
            f"parameters are addresses such as ['k_leg', 'payload.mass'], got {shown(addresses)}"
        ) from None
    if not given:
        raise ModelError("no parameter was named; give addresses such as ['k_leg', 'payload.mass']")
    _require_derivatives(model)
    base = offsets(model)
    columns: list[tuple[list[int], list[float]]] = []
    labels: list[str] = []
    units: list[str] = []
    targets = [target(model, address) for address in given]
    jacobian = None
    for one in targets:
        labels += one.labels
        if one.group is None:
            jacobian = driver(model).jacobian(model) if jacobian is None else jacobian
            for place in one.components:
                rows, values, stores = jacobian.get(place, ([], [], []))
                columns.append(([base[kind] + row for row, kind in zip(rows, stores, strict=True)], values))
            units += [model.space.unit_of(place) for place in one.components]
        else:
            start = base[one.store]
            for component in one.components:
                slots, values = _column(model, one, component)
                columns.append(([start + slot for slot in slots], values))
                units.append(one.group.units[component])
    shape = targets[0].shape if len(targets) == 1 and targets[0].shape else (len(labels),)
    return _assembled(tuple(labels), tuple(units), shape, sum(len(s.x) for s in model.stores.values()), columns)


def _assembled(
    labels: tuple[str, ...],
    units: tuple[str, ...],
    shape: tuple[int, ...],
    n_x: int,
    columns: Sequence[tuple[list[int], list[float]]],
) -> Directions:
    counts = [len(rows) for rows, _ in columns]
    return Directions(
        labels,
        units,
        shape,
        n_x,
        np.array([row for rows, _ in columns for row in rows], dtype=np.int64),
        np.repeat(np.arange(len(columns)), counts),
        np.array([value for _, values in columns for value in values], dtype=float),
    )


def _column(model: Book, target: Target, component: int) -> tuple[Sequence[int], list[float]]:
    group = target.group
    if group is None:
        return [], []
    if group.kind not in ("axis", "orientation"):
        slots = group.slots[component]
        return slots, [1.0] * len(slots)
    places = [slots[0] for slots in group.slots]
    now = [model.stores[target.store].x[place] for place in places]
    if group.kind == "orientation":
        return places, quaternion_rate(now, component)
    e = [0.0, 0.0, 0.0]
    e[component] = 1.0
    return places, cross(e, now)


def dx_dV(model: Book) -> Any:
    """(n_x, n_V) `scipy.sparse.csc_array`: exact derivative of all numbers by all parameters, in the order of
    definition.
    """
    from scipy.sparse import csc_array

    n_x, n_v = sum(len(s.x) for s in model.stores.values()), len(model.space.values)
    if n_v == 0:
        return csc_array((n_x, 0))
    return directions(model, list(model.space.names)).sparse


def _require_derivatives(model: Book) -> None:
    """Functions that are called have first derivatives by the motion alone."""
    for law in (law for laws in model.laws.values() for law in laws):
        if isinstance(law.body, FunctionCall):
            raise NotDifferentiableError(
                f"the law of {shown(law.owner.name)} is a function with derivatives=, which has no derivatives by parameters; "
                "give a function that can be traced"
            )
    for constraint in model.constraints:
        if isinstance(constraint.body, FunctionCall):
            raise NotDifferentiableError(
                f"constraint {shown(constraint.name)} is given with derivatives=, which are not enough for derivatives by parameters; "
                "give a function that can be traced"
            )
