"""Results: what every analysis returns. A field is declared once, with dimensions, unit and label; tables, labelled data,
files and reprs come from that.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, cast, dataclass_transform

import numpy as np

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ._lib.text import Block

_F = TypeVar("_F", bound=Callable[..., Any])
_C = TypeVar("_C", bound=type)
_AXIS, _TWIST = ("x", "y", "z"), ("x", "y", "z", "rx", "ry", "rz")
# Largest estimated error, relative, under which any result may be called converged; most have a smaller limit of their own. Larger: what
# has no right digit passes for a solution. Smaller: truncated series of rough laws never converge. Pinned by tests/test_results.py.
LARGEST_ERROR = 0.1
# Labels of dimensions that mean the same in every result.
FIXED_LABELS: Mapping[str, tuple[str, ...]] = {
    "axis": _AXIS,
    "axis_": _AXIS,
    "component": _TWIST,
    "wrench": _TWIST,
    "quaternion": ("w", "x", "y", "z"),
    "part": ("cos", "sin"),
    "level": ("position", "velocity", "acceleration"),
}


@dataclass(frozen=True)
class Stats:
    """Cost of a result: wall time in seconds, deterministic work counts, the effects that ran, the route that was
    taken; ``measures``: numbers of a run by name, such as residuals before and after projections.
    """

    wall_time: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    route: str = ""
    measures: Mapping[str, float] = field(default_factory=dict)


def added_counts(*parts: Any) -> dict[str, int]:
    """Work counts of several steps together; a part may be counts, or anything with ``.stats`` (else it counts
    nothing).
    """
    total: dict[str, int] = {}
    for part in parts:
        counts = part if isinstance(part, Mapping) else getattr(getattr(part, "stats", None), "counts", {})
        for name, n in counts.items():
            total[name] = total.get(name, 0) + n
    return total


@dataclass(frozen=True)
class Quantity:
    """Declaration of a field of a result: its dimensions in their order, its unit, a label, its name in labelled data."""

    dims: tuple[str, ...] = ()
    unit: str = ""
    label: str = ""
    name: str = ""


def quantity(*, dims: Sequence[str] = (), unit: str = "", label: str = "", name: str = "", **options: Any) -> Any:
    """Declare a field of a result.

    Parameters
    ----------
    dims
        Names of the dimensions, such as ``("mode",)``; none for a number.
    unit
        SI symbol; empty where it differs between entries, "1" for a ratio.
    label
        What the quantity is called in tables and plots; its name by default.
    name
        Name in labelled data; that of the field by default.
    **options
        As for `dataclasses.field`.
    """
    return field(metadata={"quantity": Quantity(tuple(dims), unit, label, name)}, **options)


def derived(*, dims: Sequence[str] = (), unit: str = "", label: str = "", name: str = "") -> Callable[[_F], _F]:
    """Declare a property of a result as a quantity, under ``@property`` or ``@cached_property``."""

    def mark(function: _F) -> _F:
        function.__dict__["quantity"] = Quantity(tuple(dims), unit, label, name)
        return function

    return mark


class Late:
    """A field of a result: a value, or a function of the result that computes it when it is first read."""

    def __init__(self, name: str, default: Any) -> None:
        self.name, self.default = name, default

    def __repr__(self) -> str:
        return repr(self.default)  # in signatures

    def __get__(self, owner: Any, kind: Any = None) -> Any:
        if owner is None:
            return self
        value = owner.__dict__.get(self.name)
        if callable(value):
            value = value(owner)
            owner.__dict__[self.name] = value
        return value

    def __set__(self, owner: Any, value: Any) -> None:
        owner.__dict__[self.name] = self.default if value is self else value


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Base of all results: frozen, prints as a table, plots, saves, becomes labelled data.

    Attributes
    ----------
    stats
        What it cost, a `Stats`.
    error
        An estimate computed with the result (relative unless the class says otherwise), or when it is first read.
    status
        A named reason. "converged" needs an estimate of at most 0.1, and of what the class asks for; without one the word is
        "computed". Where it depends on an estimate that is computed when it is first read, so is the status.
    """

    stats: Stats = field(default_factory=Stats, kw_only=True)
    error: Any = field(default=Late("error", None), kw_only=True)
    status: str = field(default=cast(Any, Late("status", "converged")), kw_only=True)

    # the dimension of the rows of `to_frame`; the attributes that label dimensions; the dimensions of `error`
    row: ClassVar[str] = ""
    axes: ClassVar[Mapping[str, str]] = {}
    error_dims: ClassVar[tuple[str, ...]] = ()
    # an error above which nothing is called converged, whatever made it; larger only where the error is not a share of the result
    largest_error: ClassVar[float] = LARGEST_ERROR
    # fields that may be functions of the result, computed when they are first read
    late: ClassVar[tuple[str, ...]] = ("error", "status")

    def __post_init__(self) -> None:
        error, status = self.__dict__.get("error"), self.__dict__.get("status")
        if status == "converged" and not callable(error):
            if error is None or np.size(error) == 0:
                object.__setattr__(self, "status", "computed")
            elif not (np.asarray(error, dtype=float) <= self.largest_error).all():  # nan is not
                object.__setattr__(self, "status", "unresolved")

    @classmethod
    def quantities(cls) -> dict[str, Quantity]:
        """The declared quantities by attribute, fields first, then what is derived from them."""
        found = {f.name: f.metadata["quantity"] for f in dataclasses.fields(cls) if "quantity" in f.metadata}
        for base in reversed(cls.__mro__):
            for name, member in vars(base).items():
                function = getattr(member, "fget", None) or getattr(member, "func", None)
                declared = getattr(function, "quantity", None)
                if declared is not None:
                    found[name] = declared
        return found

    def labels_of(self, dimension: str) -> Sequence[object] | np.ndarray | None:
        """Labels of a dimension, or None: modes count from 1, others have the names that the result holds."""
        if dimension in FIXED_LABELS:
            return FIXED_LABELS[dimension]
        name = self.axes.get(dimension)
        return None if name is None else getattr(self, name)

    def labelled(self) -> dict[str, tuple[tuple[str, ...], Any, str, str]]:
        """Every quantity that is there, by its name in labelled data: (dims, values, unit, label)."""
        out = {}
        for attribute, q in self.quantities().items():
            value = getattr(self, attribute)
            if value is not None:
                name = q.name or attribute
                values = along_parameters(q.dims, _plain_array(value))
                out[name] = (q.dims, values, q.unit, q.label or name.replace("_", " "))
        if self.error_dims and self.error is not None:
            error = along_parameters(self.error_dims, np.asarray(self.error, dtype=float))
            out["error"] = (self.error_dims, error, "1", "estimated error")
        return out

    def attributes(self) -> dict[str, Any]:
        """Attributes of labelled data: class, status, route, and the error where it is one number."""
        out: dict[str, Any] = {"result": type(self).__name__, "status": self.status}
        if self.stats.route:
            out["route"] = self.stats.route
        if isinstance(self.error, int | float):
            out["error"] = float(self.error)
        return out

    def _coordinates(self, used: Iterable[str]) -> dict[str, Any]:
        found = {dimension: self.labels_of(dimension) for dimension in used}
        return {dimension: _plain_array(labels) for dimension, labels in found.items() if labels is not None}

    def to_xarray(self) -> xarray.Dataset:
        """The declared quantities as an `xarray.Dataset` with units (needs ``pip install mbrs-dynamics[xarray]``)."""
        import xarray

        quantities = self.labelled()
        dims = dict.fromkeys(d for shape, *_ in quantities.values() for d in shape)
        coordinates: dict[str, Any] = {d: (d, labels) for d, labels in self._coordinates(dims).items()}
        data: dict[str, Any] = {}
        for name, (shape, value, unit, label) in quantities.items():
            entry = (shape, value, {key: text for key, text in (("units", unit), ("long_name", label)) if text})
            (coordinates if shape == (name,) else data)[name] = entry
        return xarray.Dataset(data, coordinates, self.attributes())

    def columns(self) -> dict[str, np.ndarray]:
        """The quantities over the dimension ``row`` as real columns by heading: other dimensions are spread, complex
        numbers become two columns.
        """
        quantities = {k: q for k, q in self.labelled().items() if self.row in q[0] or (not self.row and not q[0])}
        out: dict[str, np.ndarray] = {}
        if self.row and self.row not in quantities:
            labels = self._coordinates([self.row])
            size = next((q[1].shape[q[0].index(self.row)] for q in quantities.values()), 0)
            out[self.row] = labels.get(self.row, np.arange(size))
        for name, (dims, value, unit, _) in sorted(quantities.items(), key=lambda item: item[0] != self.row):
            head = f" [{unit}]" if unit else ""
            front = np.moveaxis(value, dims.index(self.row), 0) if self.row else value[None]
            others = [d for d in dims if d != self.row]
            labels = self._coordinates(others)
            for place in np.ndindex(front.shape[1:]):
                named = [str(labels[d][i]) if d in labels else str(i) for d, i in zip(others, place, strict=True)]
                full = f"{name}({', '.join(named)})" if named else name
                column = front[(slice(None), *place)]
                if np.iscomplexobj(column):
                    out |= {f"re {full}{head}": column.real, f"im {full}{head}": column.imag}
                else:
                    out[full + head] = column
        return out

    def to_frame(self) -> pandas.DataFrame:
        """The table of `columns` as a `pandas.DataFrame` (needs ``pip install mbrs-dynamics[xarray]``)."""
        import pandas

        return pandas.DataFrame(self.columns())

    def save(self, path: str | Path) -> Path:
        """Save, as the ending says, and return the path.

        ``.nc`` NetCDF (labelled data, and all that `mbrs.load` needs), ``.json`` the same as text, ``.csv`` the table of
        `to_frame`, ``.pkl`` a pickle; ``.uff`` transfer functions and modes for other programs (docs/files.md). The old file stays
        until the new one is complete; a link is replaced, not followed.

        Raises
        ------
        ModelError
            An unknown ending, or a Python function that a file of data cannot hold.
        """
        from ._lib.result_files import save

        return save(self, path)

    def heading(self) -> str:
        """The first line of ``print(result)``."""
        return self.status

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that ``print`` shows: by default the quantities over one dimension alone."""
        shown = {k: q for k, q in self.labelled().items() if q[0] == (self.row,)}
        columns = self.columns()
        heads = [
            h
            for h in columns
            if h == self.row or any(h == k + (f" [{q[2]}]" if q[2] else "") for k, q in shown.items())
        ]
        return heads, [list(line) for line in zip(*(columns[h].tolist() for h in heads), strict=True)]

    def notes(self) -> list[str]:
        """Lines below the table."""
        return []

    def blocks(self) -> list[Block]:
        """The tables that ``print`` shows."""
        from ._lib.text import Block

        return [Block(*self.rows(), title=self.heading(), footer="\n".join(self.notes()) or None)]

    def __str__(self) -> str:
        return "\n".join(block.text() for block in self.blocks())

    def _repr_html_(self) -> str:
        return "\n".join(block.html() for block in self.blocks())

    def __repr__(self) -> str:
        first = self.heading().split("\n")[0]
        name = type(self).__name__
        return f"{name}({first.removeprefix(name).lstrip(': ')})"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Draw the result, into ``ax`` or a figure of its own, and return the figure; every class says how."""
        raise NotImplementedError(type(self).__name__)

    def data_state(self) -> dict[str, Any]:
        """State for a file of data: the fields, and values that were computed when first asked for."""
        state = {f.name: self.__dict__[f.name] for f in dataclasses.fields(self)}
        if callable(state["error"]) and not isinstance(state["error"], functools.partial):
            state["error"] = None  # a closure of this process
        if callable(state["status"]):
            state["status"] = "computed" if state["error"] is None else self.status
        return state

    def replaced(self, **changes: object) -> Self:
        """A copy with other fields; an estimate that was not asked for yet stays so."""
        late = {name: self.__dict__[name] for name in self.late}
        return dataclasses.replace(self, **{**late, **changes})

    def __getstate__(self) -> dict[str, Any]:
        return self.data_state()


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field, quantity))
def result(cls: _C) -> _C:
    """Class decorator of results: a frozen dataclass that is equal to itself only and whose repr is one line."""
    return dataclass(frozen=True, eq=False, repr=False)(cls)  # type: ignore[return-value]


def along_parameters(dims: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    """An array parameter, which keeps its shape in a derivative, along the one axis "parameter"; it is the last."""
    spread = dims[-1:] == ("parameter",) and values.ndim > len(dims)
    return values.reshape(*values.shape[: len(dims) - 1], -1) if spread else values


def _plain_array(value: Any) -> np.ndarray:
    """An array that files and frames can hold: texts as fixed-width strings."""
    array = np.asarray(value)
    return array.astype(str) if array.dtype == object else array
