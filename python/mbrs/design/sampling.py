"""Designs by sampling: Latin hypercubes, Sobol and Halton points, grids, tables."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .._lib.border import require_memory
from .._lib.checks import count, real_array, shown
from .._lib.formats import open_file
from ..errors import ModelError
from .table import Designs, checked_names, checked_units, table

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Designs of one table at most: 1e9 rows of one number are 8 GB, which `require_memory` judges before they are made.
MOST = 10**9
_HEADING = re.compile(r"(?P<name>.*\S)\s+\[(?P<unit>[^\[\]]*[^\[\]\d,\s][^\[\]]*)\]")
# From numbers between 0 and 1 to values of one column.
Quantile = Callable[[np.ndarray], np.ndarray]


def latin_hypercube(
    ranges: Mapping[str, Any], n: int, seed: int = 0, *, units: Mapping[str, str] | None = None
) -> Designs:
    """A Latin hypercube: each of ``n`` equal (or equally likely) parts of each range holds one design.

    Parameters
    ----------
    ranges
        For each address a tuple ``(low, high)``, or a frozen distribution of SciPy (anything with ``ppf``).
    n
        How many designs.
    seed
        The same seed gives the same designs.
    units
        Labels of the numbers, such as ``{"k_leg": "N/m"}``. A sweep compares them with those of the model.

    Returns
    -------
    Designs

    Raises
    ------
    ModelError
        A range that is not one, an address given twice, too many designs for the memory.

    References
    ----------
    McKay, Beckman, Conover: A comparison of three methods for selecting values of input variables. Technometrics 21 (1979).

    Examples
    --------
    >>> import mbrs as mb
    >>> designs = mb.design.latin_hypercube({"k": (5e4, 2e5), "c": (10, 200)}, n=100, seed=1)
    >>> len(designs), bool((designs["k"] >= 5e4).all())
    (100, True)
    """
    from scipy.stats import qmc

    return _sampled(
        ranges, n, units, f"latin hypercube, seed {seed}", lambda d, rng: qmc.LatinHypercube(d, seed=rng), seed
    )


def sobol(
    ranges: Mapping[str, Any], n: int, seed: int = 0, *, scramble: bool = True, units: Mapping[str, str] | None = None
) -> Designs:
    """Sobol points, which fill the ranges evenly; ``n`` a power of two, without which they lose their balance.

    ``scramble=False`` gives the plain sequence, which begins in the lower corner; ``seed`` then has no effect. The other
    arguments are those of `latin_hypercube`. Reference: Owen, Scrambling Sobol and Niederreiter-Xing points, J. Complexity 14
    (1998).
    """
    from scipy.stats import qmc

    n = count("n", n, MOST)
    if n & (n - 1):
        below = 1 << (n.bit_length() - 1)
        raise ModelError(f"n={n} Sobol points are not balanced; take {below} or {2 * below}, or a Latin hypercube")
    kind = f"Sobol points, seed {seed}" if scramble else "Sobol points, not scrambled"
    return _sampled(ranges, n, units, kind, lambda d, rng: qmc.Sobol(d, scramble=scramble, seed=rng), seed)


def halton(
    ranges: Mapping[str, Any], n: int, seed: int = 0, *, scramble: bool = True, units: Mapping[str, str] | None = None
) -> Designs:
    """Halton points: evenly spread for any number ``n``, best for few numbers that vary. Arguments as for `sobol`.

    Reference: Owen, A randomized Halton algorithm in R, arXiv:1706.02808 (2017).
    """
    from scipy.stats import qmc

    kind = f"Halton points, seed {seed}" if scramble else "Halton points, not scrambled"
    return _sampled(ranges, n, units, kind, lambda d, rng: qmc.Halton(d, scramble=scramble, seed=rng), seed)


def full_factorial(
    points: Mapping[str, Any], levels: int | Mapping[str, int] = 2, *, units: Mapping[str, str] | None = None
) -> Designs:
    """Every combination of values, the last number fastest.

    Parameters
    ----------
    points
        For each address the values as a list or an array, or a tuple ``(low, high)``, which ``levels`` even values fill. Both
        ends are taken to the last bit.
    levels
        How many values a range has: a number for all, or one for each address.
    units
        As for `latin_hypercube`.
    """
    names = checked_names(points)
    if isinstance(levels, Mapping):
        unknown = [name for name in levels if name not in names]
        if unknown:
            raise ModelError(f"levels= names {unknown[0]!r}, which does not vary; known are {', '.join(names)}")
    columns = [_values(name, points[name], levels) for name in names]
    total = 1
    for column in columns:
        total *= len(column)
    require_room(total, len(names))
    grids = np.meshgrid(*columns, indexing="ij")
    kind = "full factorial " + " x ".join(str(len(column)) for column in columns)
    return table(names, np.stack([grid.ravel() for grid in grids], axis=1), checked_units(names, units), kind)


class HasColumns(Protocol):
    """A table with named columns, such as a `pandas.DataFrame`."""

    @property
    def columns(self) -> Iterable[str]:
        """Headings."""

    def __getitem__(self, name: str, /) -> ArrayLike:
        """A column."""


def from_table(
    given: str | Path | Mapping[str, ArrayLike] | np.ndarray | HasColumns, *, units: Mapping[str, str] | None = None
) -> Designs:
    """Designs that are there already.

    Parameters
    ----------
    given
        A mapping of columns, a `pandas.DataFrame`, a NumPy array with named fields, the path of a CSV file with one heading or of a
        Parquet file, or `Designs`. A heading may carry a unit, ``"k_leg [N/m]"``; a column ``design`` that counts rows from 0 is left
        out. Values keep every bit.
    units
        Labels of the numbers, before those of the headings.
    """
    if isinstance(given, Designs):
        columns = {name: given[name] for name in given.names}
        headed = dict(zip(given.names, given.units, strict=True))
    else:
        columns, headed = _headed(_columns(given))
    counted = columns.get("design")
    if counted is not None and len(columns) > 1 and np.array_equal(counted, np.arange(len(counted))):
        del columns["design"]
        headed.pop("design")
    names = checked_names(columns)
    sizes = {name: len(column) for name, column in columns.items()}
    if len(set(sizes.values())) > 1:
        raise ModelError("the columns differ in length: " + ", ".join(f"{name!r} has {n}" for name, n in sizes.items()))
    values = np.stack([columns[name] for name in names], axis=1)
    return table(names, values, checked_units(names, {**headed, **(units or {})}), "from a table")


def _sampled(
    ranges: Mapping[str, Any],
    n: int,
    units: Mapping[str, str] | None,
    kind: str,
    engine: Callable[[int, np.random.Generator], Any],
    seed: int,
) -> Designs:
    names = checked_names(ranges)
    quantiles = [quantile(name, ranges[name]) for name in names]
    n = count("n", n, MOST, least=0)
    require_room(n, len(names))
    labels = checked_units(names, units)
    cube = engine(len(names), random(seed)).random(n) if n else np.empty((0, len(names)))
    values = np.stack([q(cube[:, j]) for j, q in enumerate(quantiles)], axis=1)
    require_finite(names, values)
    return table(names, values, labels, kind, known_moments(names, ranges))


def known_moments(names: Sequence[str], ranges: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Mean and covariance of independent numbers, and the Poincare constant of each: the smallest C with Var g(x) <= C E(g'(x)^2),
    (high - low)^2 / pi^2 of a range, the variance of a normal distribution, else nan.
    """
    mean, variance, constant = [], [], []
    for name in names:
        given = ranges[name]
        if hasattr(given, "ppf"):
            moments = float(given.mean()), float(given.var())
            family = getattr(getattr(given, "dist", None), "name", "")
            best = {"norm": moments[1], "uniform": 12.0 * moments[1] / np.pi**2}.get(family, np.nan)
        else:
            low, high = interval(name, given)
            moments = 0.5 * low + 0.5 * high, (high - low) ** 2 / 12.0
            best = (high - low) ** 2 / np.pi**2
        mean.append(moments[0])
        variance.append(moments[1])
        constant.append(best)
    return {"mean": np.array(mean), "covariance": np.diag(variance), "poincare": np.array(constant)}


def random(seed: int) -> np.random.Generator:
    """The generator of a seed: a whole number, so that the same call gives the same designs."""
    return np.random.default_rng(count("seed", seed, 2**63 - 1, least=0))


def quantile(name: str, given: Any) -> Quantile:
    """The quantile function of a range or a distribution."""
    if hasattr(given, "ppf"):
        return lambda u: np.asarray(given.ppf(u), dtype=float)
    low, high = interval(name, given)
    # a convex sum cannot overflow, and rounding cannot leave the range
    return lambda u: np.clip(low * (1.0 - u) + high * u, low, high)


def interval(name: str, given: Any) -> tuple[float, float]:
    """The two ends of a range."""
    if not isinstance(given, tuple) or len(given) != 2:
        raise ModelError(
            f"the range of {name!r} must be a tuple (low, high) or a distribution of scipy.stats, it is {shown(given)}"
        )
    low, high = real_array(f"the range of {name!r}", given).tolist()
    if not low < high:
        raise ModelError(f"the range of {name!r} is empty: {low!r} is not below {high!r}")
    return low, high


def _values(name: str, given: Any, levels: int | Mapping[str, int]) -> np.ndarray:
    if not isinstance(given, tuple):
        values = np.atleast_1d(real_array(f"the values of {name!r}", given))
        if values.ndim != 1 or not values.size:
            raise ModelError(f"the values of {name!r} must be a list of numbers, they are {shown(given)}")
        return values
    low, high = interval(name, given)
    n = count(f"levels of {name!r}", levels.get(name, 2) if isinstance(levels, Mapping) else levels, MOST, least=2)
    share = np.arange(n) / (n - 1)
    return np.clip(low * (1.0 - share) + high * share, low, high)


def require_finite(names: Sequence[str], values: np.ndarray) -> None:
    wrong = ~np.isfinite(values)
    if wrong.any():
        name = names[int(np.argmax(wrong.any(axis=0)))]
        raise ModelError(
            f"the distribution of {name!r} gives values that are not finite; truncate it, or scramble the points"
        )


def require_room(n: int, columns: int) -> None:
    require_memory(24.0 * n * columns, f"a table of {n} designs", "take fewer designs or levels")


def _columns(given: Any) -> dict[str, Any]:
    if isinstance(given, str | Path):
        return _parquet(Path(given)) if Path(given).suffix.lower() == ".parquet" else _csv(Path(given))
    if isinstance(given, np.ndarray) and given.dtype.names:
        return {name: given[name] for name in given.dtype.names}
    if isinstance(given, Mapping) or hasattr(given, "columns"):
        return {name: given[name] for name in (given if isinstance(given, Mapping) else given.columns)}
    raise ModelError(
        f"a table of designs must be a mapping, a DataFrame, named fields or a CSV file, it is {shown(given)}"
    )


def _parquet(path: Path) -> dict[str, Any]:
    try:
        from pyarrow import ArrowException, BufferReader, parquet
    except ImportError:
        raise ModelError("Parquet needs pyarrow, which is not installed: pip install 'mbrs-dynamics[tables]'") from None
    try:
        found = parquet.read_table(BufferReader(open_file(path)))
        return {name: found[name].to_numpy(zero_copy_only=False) for name in found.column_names}
    except (ArrowException, OSError, ValueError) as problem:
        raise ModelError(f"{path.name} is not a Parquet file that can be read: {problem}") from None


def _headed(given: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns by name, and the units of their headings."""
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for heading, column in given.items():
        match = _HEADING.fullmatch(heading) if isinstance(heading, str) else None
        name = match["name"] if match else heading
        if name in columns:
            raise ModelError(f"the number {name!r} has two columns")
        columns[name] = np.atleast_1d(real_array(f"the column {shown(heading)}", column))
        if columns[name].ndim != 1:
            raise ModelError(f"the column {shown(heading)} must have one number for each design")
        units[name] = match["unit"] if match else ""
    return columns, units


def _csv(path: Path) -> dict[str, list[float]]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = [line for line in csv.reader(file) if line]
    except (OSError, UnicodeDecodeError, csv.Error) as reason:
        raise ModelError(f"cannot read the designs of {path}: {reason}") from None
    if not lines:
        raise ModelError(f"{path} is empty; its first line must name the numbers")
    head, *rows = lines
    columns: dict[str, list[float]] = {name: [] for name in checked_names(head)}
    for number, row in enumerate(rows, start=2):
        if len(row) != len(head):
            raise ModelError(f"{path}, line {number}: {len(row)} values for {len(head)} columns")
        for name, text in zip(head, row, strict=True):
            try:
                columns[name].append(float(text))
            except ValueError:
                raise ModelError(f"{path}, line {number}: {shown(text)} of {name!r} is not a number") from None
    return columns
