"""Effects of uncertain numbers on outputs: moments and quantiles, Sobol indices, derivative-based bounds of these."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import count, real_array
from ..errors import ModelError
from ..results import Result, quantity, result
from .sampling import MOST, known_moments, quantile, random, require_finite, require_room
from .table import Designs, checked_names, checked_units, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Resamplings that the standard errors of indices come from: fewer, and these scatter by more than a tenth of themselves.
RESAMPLINGS = 200


def saltelli(ranges: Mapping[str, Any], n: int, seed: int = 0, *, units: Mapping[str, str] | None = None) -> Designs:
    """Designs for Sobol indices: ``n`` blocks of p + 2 rows A, A with one column of B each, B.

    ``n`` is a power of two, ranges or distributions as for `latin_hypercube`; `Runs.sobol_indices` reads the outputs. Reference:
    Saltelli et al., Variance based sensitivity analysis of model output, Comput. Phys. Commun. 181 (2010).
    """
    from scipy.stats import qmc

    names = checked_names(ranges)
    n, p = count("n", n, MOST), len(names)
    if n & (n - 1):
        below = 1 << (n.bit_length() - 1)
        raise ModelError(f"n={n} blocks are not balanced; take {below} or {2 * below}")
    require_room(n * (p + 2), p)
    cube = qmc.Sobol(2 * p, seed=random(seed)).random(n)
    quantiles = [quantile(name, ranges[name]) for name in names]
    a, b = (np.stack([q(side[:, j]) for j, q in enumerate(quantiles)], axis=1) for side in (cube[:, :p], cube[:, p:]))
    blocks = np.repeat(a[:, None], p + 2, axis=1)
    for j in range(p):
        blocks[:, j + 1, j] = b[:, j]
    blocks[:, -1] = b
    values = blocks.reshape(-1, p)
    require_finite(names, values)
    about = {**known_moments(names, ranges), "saltelli": n}
    return table(names, values, checked_units(names, units), f"{n} blocks for Sobol indices, seed {seed}", about)


@result
class SobolIndices(Result):
    """Shares of the variance of an output: ``first`` S_i = V(E(y|x_i)) / V, ``total`` S_Ti = 1 - V(E(y|x_~i)) / V, with bootstrap
    standard errors; ``used``: blocks of rows that all have outputs.
    """

    names: tuple[str, ...]
    output: str
    first: np.ndarray = quantity(dims=("number",), unit="1", label="first-order index")
    first_error: np.ndarray = quantity(dims=("number",), unit="1", label="its standard error")
    total: np.ndarray = quantity(dims=("number",), unit="1", label="total index")
    total_error: np.ndarray = quantity(dims=("number",), unit="1", label="its standard error ")
    used: int

    row: ClassVar[str] = "number"
    axes: ClassVar[Mapping[str, str]] = {"number": "names"}

    def heading(self) -> str:
        return f"Sobol indices of {self.output!r} from {self.used} blocks"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Both indices of each number with their standard errors; returns the figure."""
        from ..plot.sweeps import indices

        sides = {"first": (self.first, self.first_error), "total": (self.total, self.total_error)}
        return indices(self.names, sides, self.heading(), ax=ax)


@result
class DerivativeMeasures(Result):
    """Derivative-based measures of an output y: ``mean_square`` v_i = E((dy/dx_i)^2), and ``bound`` C_i v_i / V >= S_Ti on the total
    Sobol index, C_i the Poincare constant of x_i ((b - a)^2 / pi^2 of a range, the variance of a normal number; else nan).
    """

    names: tuple[str, ...]
    output: str
    mean_square: np.ndarray = quantity(dims=("number",), label="mean square of the derivative")
    mean_square_error: np.ndarray = quantity(dims=("number",), label="its standard error")
    bound: np.ndarray = quantity(dims=("number",), unit="1", label="bound of the total index")

    row: ClassVar[str] = "number"
    axes: ClassVar[Mapping[str, str]] = {"number": "names"}

    def heading(self) -> str:
        return f"derivative-based measures of {self.output!r}"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The bound of each number; returns the figure."""
        from ..plot.sweeps import indices

        return indices(self.names, {"bound": (self.bound, np.zeros(len(self.names)))}, self.heading(), ax=ax)


@result
class Statistics(Result):
    """Moments and quantiles of real outputs, entry by entry.

    ``mean`` with its standard error for independent draws, ``variance`` (n - 1), ``sd``, ``quantile`` at ``levels``. Where the
    designs know their own mean m and covariance S and the outputs their exact derivatives g, also the moments to first order:
    ``linear_mean`` y(m) and ``linear_sd`` = sqrt(g^T S g); else nan.
    """

    entries: tuple[str, ...]
    units: tuple[str, ...]
    levels: tuple[float, ...]
    count: np.ndarray = quantity(dims=("entry",), label="designs")
    mean: np.ndarray = quantity(dims=("entry",))
    mean_error: np.ndarray = quantity(dims=("entry",), label="standard error of the mean")
    variance: np.ndarray = quantity(dims=("entry",))
    sd: np.ndarray = quantity(dims=("entry",), label="standard deviation")
    linear_mean: np.ndarray = quantity(dims=("entry",), label="mean to first order")
    linear_sd: np.ndarray = quantity(dims=("entry",), label="standard deviation to first order")
    quantile: np.ndarray = quantity(dims=("entry", "level"))

    row: ClassVar[str] = "entry"
    axes: ClassVar[Mapping[str, str]] = {"entry": "entries", "level": "levels"}

    def heading(self) -> str:
        return f"statistics of {len(self.entries)} outputs"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that is printed."""
        columns = [
            "output",
            "unit",
            "mean",
            "sd",
            "linear mean",
            "linear sd",
            *(f"{level:.3g}" for level in self.levels),
        ]
        sides = np.column_stack([self.mean, self.sd, self.linear_mean, self.linear_sd, self.quantile]).tolist()
        return columns, [[*heads, *side] for *heads, side in zip(self.entries, self.units, sides, strict=True)]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Standard deviation over the mean of every entry, from the designs and to first order; returns the figure."""
        from ..plot.sweeps import indices

        with np.errstate(divide="ignore", invalid="ignore"):
            sides = {
                "designs": (self.sd / abs(self.mean), np.zeros(len(self.entries))),
                "to first order": (self.linear_sd / abs(self.linear_mean), np.zeros(len(self.entries))),
            }
        return indices(self.entries, sides, "standard deviation over mean", ax=ax)


def sobol_indices(designs: Designs, y: np.ndarray, output: str) -> SobolIndices:
    """Indices from one real number for each row of `saltelli`: first order after Saltelli (2010), total after Jansen (1999)."""
    n, p = designs.about.get("saltelli", 0), len(designs.names)
    if not n or len(y) != n * (p + 2):
        raise ModelError("Sobol indices need the designs of mb.design.saltelli, all of them")
    blocks = y.reshape(n, p + 2)
    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    if len(blocks) < 2:
        raise ModelError(f"{output!r} has no two blocks without failures")
    rng = np.random.default_rng(0)
    first, total = _indices(blocks)
    again = np.array([_indices(blocks[rng.integers(len(blocks), size=len(blocks))]) for _ in range(RESAMPLINGS)])
    errors = again.std(axis=0, ddof=1)
    return SobolIndices(designs.names, output, first, errors[0], total, errors[1], len(blocks), status="computed")


def _indices(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, mixed, b = blocks[:, :1], blocks[:, 1:-1], blocks[:, -1:]
    centre = np.mean(np.concatenate([a, b]))
    variance = np.var(np.concatenate([a, b]))
    with np.errstate(divide="ignore", invalid="ignore"):
        first = np.mean((b - centre) * (mixed - a), axis=0) / variance
        total = 0.5 * np.mean((a - mixed) ** 2, axis=0) / variance
    return first, total


def derivative_measures(designs: Designs, y: np.ndarray, gradient: np.ndarray, output: str) -> DerivativeMeasures:
    """Measures from a number (n,) and its exact derivatives (n, p). Reference: Sobol, Kucherenko: Derivative based global
    sensitivity measures and their link with global sensitivity indices, Math. Comput. Simul. 79 (2009); Lamboni et al. (2013).
    """
    if gradient.shape != (len(y), len(designs.names)):
        raise ModelError(
            f"the derivatives of {output!r} must be by the numbers of the designs, {', '.join(designs.names)}, in this order"
        )
    good = np.isfinite(y) & np.isfinite(gradient).all(axis=1)
    squares = gradient[good] ** 2
    if len(squares) < 2:
        raise ModelError(f"{output!r} has no two designs with derivatives")
    mean = squares.mean(axis=0)
    error = squares.std(axis=0, ddof=1) / math.sqrt(len(squares))
    constants = np.asarray(designs.about.get("poincare", np.full(len(designs.names), np.nan)))
    bound = constants * mean / np.var(y[good], ddof=1)
    return DerivativeMeasures(designs.names, output, mean, error, bound, status="computed")


def statistics(runs: Any, levels: Sequence[float]) -> Statistics:
    """Moments and quantiles of the runs."""
    shares = np.atleast_1d(real_array("quantiles", levels))
    if shares.ndim != 1 or np.any((shares < 0.0) | (shares > 1.0)):
        raise ModelError("quantiles= must be numbers from 0 to 1")
    entries = tuple(runs.entries())
    linear = _linear(runs)
    rows = []
    for name in entries:
        values = runs[name][runs.done].astype(float)
        values = values[np.isfinite(values)]
        m = len(values)
        mean = float(values.mean()) if m else math.nan
        variance = float(values.var(ddof=1)) if m > 1 else math.nan
        error = math.sqrt(variance / m) if m > 1 else math.nan
        spread = np.quantile(values, shares) if m else np.full(len(shares), np.nan)
        rows.append([m, mean, error, variance, math.sqrt(variance), *linear.get(name, (math.nan, math.nan)), *spread])
    sides = np.array(rows, dtype=float).reshape(len(entries), 7 + len(shares))
    units = tuple(runs.unit_of(name) for name in entries)
    number, mean, error, variance, sd, linear_mean, linear_sd = sides[:, :7].T
    return Statistics(
        entries, units, tuple(shares.tolist()), number.astype(int), mean, error, variance, sd, linear_mean, linear_sd,
        sides[:, 7:], status="computed",
    )  # fmt: skip


def _linear(runs: Any) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation to first order of every entry that has an exact derivative, at the mean of the designs."""
    from .outputs import Analysis, sensitivity

    about, session = runs.designs.about, runs.session
    if session is None or not isinstance(session.outputs, Analysis) or "mean" not in about:
        return {}
    model = session.model.copy()
    model.set(dict(zip(runs.designs.names, np.asarray(about["mean"]).tolist(), strict=True)))
    found = sensitivity(session.outputs, runs.designs.names)(model)
    moments = {}
    for name in session.outputs.values:
        value, gradient = np.asarray(found[name]), np.asarray(found[f"{name}_derivative"])
        if value.dtype.kind == "c" or gradient.shape[:-1] != value.shape:
            continue
        variance = np.einsum("...i,ij,...j", gradient, about["covariance"], gradient)
        for place in np.ndindex(value.shape):
            key = f"{name}[{','.join(map(str, place))}]" if place else name
            moments[key] = float(value[place]), math.sqrt(max(float(variance[place]), 0.0))
    return moments
