"""Results of a sweep: outputs of every design, and reasons for designs without them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import choice, count, real_array, shown
from .._lib.text import counted
from ..errors import ModelError, NameNotFoundError
from ..results import Result, quantity, result
from .chunk import DONE, FAILED, STATUS, Chunk, Failure, checked, columns_of
from .table import Designs, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from .table import DesignsLike
    from .uncertainty import DerivativeMeasures, SobolIndices, Statistics

# Code of a design without a result.
WAITING = -1
_ENTRY = re.compile(r"(?P<name>[^\[\]]+)\[(?P<place>[-\d,\s]+)\]")
_KINDS = ("scatter", "parallel", "correlation", "failures")
_FAILED = "failed outside of the sweep"


@result
class Failures(Result):
    """The designs that failed: ``design`` (index), ``reason`` ("failed", "timeout", "killed"), ``error`` (class), ``object`` of the
    model, ``message``, ``seconds``.
    """

    design: np.ndarray = quantity(dims=("failure",))
    reason: np.ndarray = quantity(dims=("failure",))
    error_class: np.ndarray = quantity(dims=("failure",), label="error class")
    object: np.ndarray = quantity(dims=("failure",))
    message: np.ndarray = quantity(dims=("failure",))
    seconds: np.ndarray = quantity(dims=("failure",), unit="s")

    row: ClassVar[str] = "failure"

    def __len__(self) -> int:
        return len(self.design)

    def heading(self) -> str:
        return counted(len(self), "failed design") if len(self) else "no design failed"

    def kinds(self) -> dict[tuple[str, str, str], np.ndarray]:
        """Designs by reason, error class and object, the most frequent first."""
        found: dict[tuple[str, str, str], list[int]] = {}
        for row in zip(self.design, self.reason, self.error_class, self.object, strict=True):
            found.setdefault((str(row[1]), str(row[2]), str(row[3])), []).append(int(row[0]))
        return {key: np.array(found[key]) for key in sorted(found, key=lambda key: (-len(found[key]), key))}

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that is printed: one row for each kind of failure."""
        texts = dict(zip(self.design.tolist(), self.message.tolist(), strict=True))
        rows = [
            [len(designs), *key, int(designs[0]), " ".join(texts[int(designs[0])].split())[:60]]
            for key, designs in self.kinds().items()
        ]
        return ["designs", "reason", "error", "object", "first", "its message"], rows

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Draw the number of failed designs of each kind; returns the figure."""
        from ..plot.sweeps import failures as draw

        return draw(self, ax=ax)


@result
class Runs(Result):
    """The outputs of many designs; see `mb.sweep`.

    Attributes
    ----------
    designs
        The `Designs`, one row for each.
    outputs
        Arrays (n, ...) by name: the first axis counts designs. Designs without a result have nan, smaller arrays are filled with it.
    dims, units, labels
        Dimensions of each output behind "design", its unit, labels of dimensions.
    codes
        (n,): -1 waiting, 0 done, 1 failed, 2 timeout, 3 killed.
    seconds
        (n,) wall time of each design.
    status
        "computed", "interrupted" (Ctrl-C) or "stopped" (an error) of the sweep as a whole.
    """

    designs: Designs
    outputs: Mapping[str, np.ndarray]
    dims: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    labels: Mapping[str, tuple[Any, ...]]
    codes: np.ndarray
    seconds: np.ndarray
    failed: tuple[Failure, ...]
    session: Any = field(default=None, repr=False)

    row: ClassVar[str] = "design"

    def __len__(self) -> int:
        return len(self.codes)

    @property
    def done(self) -> np.ndarray:
        """(n,) bool: the designs that have outputs."""
        return self.codes == DONE

    @property
    def states(self) -> np.ndarray:
        """(n,) the status of each design as a word: "waiting", "done", "failed", "timeout", "killed"."""
        return np.array([*STATUS, "waiting"])[self.codes]

    @property
    def failures(self) -> Failures:
        """The designs that failed, as a table."""
        places = np.array([f.design for f in self.failed], dtype=np.int64)
        error = np.array([f.error for f in self.failed], dtype=str)
        obj = np.array([f.object for f in self.failed], dtype=str)
        text = np.array([f.message for f in self.failed], dtype=str)
        return Failures(places, self.states[places], error, obj, text, self.seconds[places], status="computed")

    def __getitem__(self, name: str) -> np.ndarray:
        """A number of the designs or an output by name, (n, ...); ``"f[0]"`` is one entry of it, (n,)."""
        if name in self.outputs:
            return self.outputs[name]
        if name in self.designs.names:
            return self.designs[name]
        match = _ENTRY.fullmatch(name) if isinstance(name, str) else None
        if match is not None and match["name"] in self.outputs:
            return self._entry(name, match)
        known = ", ".join([*self.outputs, *self.designs.names])
        raise NameNotFoundError(f"the runs have no {shown(name)}; they have {known}")

    def _entry(self, name: str, match: re.Match[str]) -> np.ndarray:
        array = self.outputs[match["name"]]
        try:
            place: Any = tuple(int(part) for part in match["place"].split(","))
            if len(place) != array.ndim - 1:
                raise IndexError
            entry: np.ndarray = array[(slice(None), *place)]
            return entry
        except (ValueError, IndexError):
            raise NameNotFoundError(
                f"{name!r} is not an entry of {match['name']!r}, which has the shape {array.shape[1:]}"
            ) from None

    def unit_of(self, name: str) -> str:
        """The unit of a number or an output, empty where it is not known."""
        own = dict(zip(self.designs.names, self.designs.units, strict=True))
        return self.units.get(name.partition("[")[0], own.get(name, ""))

    def labels_of(self, dimension: str) -> Sequence[object] | np.ndarray | None:
        if dimension in self.labels:
            return self.labels[dimension]
        if dimension == "mode":
            return np.arange(
                1,
                1
                + max(
                    a.shape[1 + self.dims[n].index("mode")] for n, a in self.outputs.items() if "mode" in self.dims[n]
                ),
            )
        return super().labels_of(dimension)

    def labelled(self) -> dict[str, tuple[tuple[str, ...], Any, str, str]]:
        found = self.designs.labelled()
        taken = {*found, "state", "seconds", "design", *(d for dims in self.dims.values() for d in dims)}
        for name, array in self.outputs.items():
            key = f"output {name}" if name in taken else name
            found[key] = (("design", *self.dims[name]), array, self.units[name], name)
        found["state"] = (("design",), self.states, "", "state")
        found["seconds"] = (("design",), self.seconds, "s", "wall time")
        return found

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "source": self.designs.source, "failed": len(self.failed)}

    def heading(self) -> str:
        parts = [
            f"{int(np.sum(self.codes == code))} {word}"
            for code, word in enumerate(STATUS)
            if np.any(self.codes == code)
        ]
        if np.any(self.codes == WAITING):
            parts.append(f"{int(np.sum(self.codes == WAITING))} waiting")
        return f"{counted(len(self), 'design')}: " + (", ".join(parts) or "none") + f" ({self.status})"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that is printed: range and moments of each real output, entry by entry."""
        rows: list[list[Any]] = []
        for name in self.entries()[:_MOST_ROWS]:
            values = self[name][self.done]
            values = values[np.isfinite(values)]
            sides = [f(values) for f in (np.min, np.mean, np.max)] if len(values) else [math.nan] * 3
            rows.append(
                [
                    name,
                    self.unit_of(name),
                    *map(float, sides),
                    float(np.std(values, ddof=1)) if len(values) > 1 else math.nan,
                ]
            )
        return ["output", "unit", "least", "mean", "largest", "standard deviation"], rows

    def entries(self) -> list[str]:
        """Names of all entries of real outputs, such as ``"f[0]"``."""
        found = []
        for name, array in self.outputs.items():
            if array.dtype.kind != "c":
                places = (",".join(map(str, place)) for place in np.ndindex(array.shape[1:]))
                found += [f"{name}[{place}]" if place else name for place in places]
        return found

    def notes(self) -> list[str]:
        lines = [f"designs: {self.designs.heading()}"]
        more = len(self.entries()) - _MOST_ROWS
        if more > 0:
            lines.append(f"... and {more} more entries")
        lines += [f"{len(d)} {key[0]}: {key[1]} {key[2]}".rstrip() for key, d in self.failures.kinds().items()][:5]
        return lines

    def plot(self, *names: str, kind: str = "", colour: str = "", ax: Axes | None = None) -> Figure:
        """Draw the runs; returns the figure.

        Parameters
        ----------
        *names
            Numbers of the designs and entries of outputs such as ``"f[0]"``; two of them make a scatter plot.
        kind
            "scatter", "parallel" (every design as a line over ``names``), "correlation" (rank correlation of outputs with the
            numbers of the designs), "failures"; by default a scatter plot of two names, parallel coordinates of more, else correlation.
        colour
            A name that colours points or lines.
        """
        from ..plot import sweeps

        kind = choice(
            "kind", kind or {0: "correlation", 1: "scatter", 2: "scatter"}.get(len(names), "parallel"), _KINDS
        )
        if kind == "failures":
            return self.failures.plot(ax=ax)
        shade = self._real(colour) if colour else None
        if kind == "correlation":
            chosen = [*(names or self.entries()[:_MOST_ROWS])]
            rank = {name: self._real(name) for name in (*self.designs.names, *chosen)}
            return sweeps.correlation(rank, self.designs.names, tuple(chosen), ax=ax)
        chosen = [*names] if len(names) > 1 else [self.designs.names[0], *(names or self.entries()[:1])]
        columns = {name: (("design",), self._real(name), self.unit_of(name), name) for name in chosen}
        if kind == "parallel":
            return sweeps.parallel(columns, self.heading(), colour=shade, ax=ax)
        return sweeps.scatter(columns, colour=shade, shade=colour, ax=ax)

    def _real(self, name: str) -> np.ndarray:
        values = self[name]
        if values.ndim != 1 or values.dtype.kind == "c":
            raise ModelError(f"{name!r} is not one real number for each design; name an entry such as '{name}[0]'")
        return values.astype(float)

    def statistics(self, quantiles: Sequence[float] = (0.05, 0.5, 0.95)) -> Statistics:
        """Mean, variance and quantiles of every real output, beside the moments to first order from exact derivatives where the
        designs know their distribution and the outputs are one of ``mb.outputs``; see `mbrs.design.uncertainty.Statistics`.
        """
        from .uncertainty import statistics

        return statistics(self, quantiles)

    def sobol_indices(self, name: str) -> SobolIndices:
        """First-order and total Sobol indices of one real output, for the designs of ``mb.design.saltelli``.

        Examples
        --------
        >>> import mbrs as mb
        >>> designs = mb.design.saltelli({"k_leg": (9e4, 1.1e5), "payload.mass": (19.0, 21.0)}, n=64)
        >>> runs = mb.sweep(mb.examples.cubic_hexapod(), designs, mb.outputs.modes(n=1))
        >>> indices = runs.sobol_indices("frequency[0]")
        >>> bool(abs(indices.total.sum() - 1.0) < 0.2)
        True
        """
        from .uncertainty import sobol_indices

        return sobol_indices(self.designs, self._real(name), name)

    def derivative_measures(self, name: str, derivative: str = "") -> DerivativeMeasures:
        """E((dy/dx_i)^2) of one real output and its bound on the total Sobol index, from exact derivatives.

        ``derivative``: the output that holds them, by the numbers of the designs in their order; ``"f_derivative[0]"`` for
        ``"f[0]"`` by default.
        """
        from .uncertainty import derivative_measures

        head, _, place = name.partition("[")
        array = self[derivative.partition("[")[0] or f"{head}_derivative"]
        place = derivative.partition("[")[2] if derivative else place
        index: Any = tuple(int(part) for part in place.rstrip("]").split(",") if part)
        return derivative_measures(self.designs, self._real(name), array[(slice(None), *index)], name)

    # --- ask, tell, evaluate -----

    def ask(self, n: int) -> Designs:
        """The next ``n`` designs without a result that this session has not asked for; fewer at the end.

        They are computed elsewhere, and `tell` takes their outputs.
        """
        session = self._going()
        waiting = [i for a, b in session.missing() for i in range(a, b) if i not in session.asked]
        chosen = waiting[: count("n", n, 10**9)]
        session.asked.update(chosen)
        return table(self.designs.names, session.rows[chosen], self.designs.units, "asked for")

    def tell(
        self, designs: DesignsLike, outputs: Sequence[Mapping[str, Any] | None], seconds: ArrayLike = math.nan
    ) -> Runs:
        """Keep outputs that were computed elsewhere, in the store as well, and return all runs.

        Parameters
        ----------
        designs
            `Designs`, a mapping of names to numbers or columns, or rows (n, p): those of the table take their place in it, others are
            added.
        outputs
            For each design a mapping of names to numbers and arrays, or None where it failed.
        seconds
            Wall time of each.
        """
        session = self._going()
        values = self._values(designs)
        if len(outputs) != len(values):
            raise ModelError(f"outputs= has {len(outputs)} entries for {len(values)} designs")
        spent = np.broadcast_to(np.asarray(seconds, dtype=float), len(values))
        session.record(values, [_told(one, float(s)) for one, s in zip(outputs, spent, strict=True)])
        return session.runs()

    def evaluate(self, designs: DesignsLike) -> Runs:
        """The runs of some designs: those with a result are looked up, others are computed and kept, in the store as well.

        A search that proposes the same designs again (with the same seed) goes on where it was for nothing.

        Parameters
        ----------
        designs
            As for `tell`.
        """
        session = self._going()
        return session.runs(rows=session.evaluate(self._values(designs)))

    def _going(self) -> Any:
        if self.session is None:
            raise ModelError("these runs came from a file and cannot go on; call mb.sweep with their store=")
        return self.session

    def _values(self, designs: Any) -> np.ndarray:
        names = self.designs.names
        if isinstance(designs, Mapping | Designs):
            given = designs.names if isinstance(designs, Designs) else tuple(designs)
            if set(given) != set(names):
                raise ModelError(
                    f"the designs name {', '.join(map(str, given))}; those of the sweep are {', '.join(names)}"
                )
            columns = [np.atleast_1d(real_array(f"the column {name!r}", designs[name])) for name in names]
            values = np.stack(columns, axis=1)
        else:
            values = np.atleast_2d(real_array("the designs", designs))
        if values.ndim != 2 or values.shape[1] != len(names):
            raise ModelError(f"the designs must be rows of {len(names)} numbers ({', '.join(names)})")
        return values

    def data_state(self) -> dict[str, Any]:
        return {**super().data_state(), "session": None}


# Rows of outputs that a table shows.
_MOST_ROWS = 30


def _told(outputs: Mapping[str, Any] | None, seconds: float) -> Chunk:
    """One design whose outputs came from elsewhere, as a chunk; `Session.record` gives it its place."""
    rows = [] if outputs is None else [(0, checked(outputs))]
    failures = [] if rows else [Failure(0, "", "", _FAILED)]
    status = np.array([DONE if rows else FAILED], np.int8)
    return Chunk(0, np.empty((1, 0)), status, np.array([seconds]), failures, columns_of(rows))
