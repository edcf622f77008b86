"""Designs from a normal distribution: correlated, truncated, both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import count, real_array
from ..errors import ModelError
from .sampling import MOST, interval, random, require_room
from .table import Designs, checked_names, checked_units, table

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# What rounding may have made of an entry of a Cholesky factor of a correlation matrix, per row and in units of 1: larger, matrices
# that no distribution has pass; smaller, perfectly correlated numbers are refused (tests/design/test_sampling.py).
SINGULAR = 64 * float(np.finfo(float).eps)
# Share of draws that must lie within the bounds of a correlated distribution; below it, rejection would take too long.
LEAST_SHARE = 1e-4


def normal(
    mean: Mapping[str, float],
    sd: Mapping[str, float],
    n: int,
    seed: int = 0,
    *,
    correlation: ArrayLike | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    units: Mapping[str, str] | None = None,
) -> Designs:
    """Normally distributed designs.

    x = mean + diag(sd) L z with z standard normal and L L^T the correlation. Without bounds on correlated numbers z is a Latin
    hypercube of normal scores; with them, x is drawn independently until it lies within, which is exact for any bounds.

    Parameters
    ----------
    mean, sd
        By address; ``sd`` above 0.
    n, seed, units
        As for `latin_hypercube`.
    correlation
        (p, p) in the order of ``mean``, or a mapping of pairs of addresses to their coefficient; none by default.
    bounds
        ``(low, high)`` by address: the distribution is truncated there, so that no value lies outside.

    Returns
    -------
    Designs
        Without bounds ``about`` has its ``mean`` (p,) and ``covariance`` (p, p).

    Raises
    ------
    ModelError
        A correlation that no distribution has; bounds that hardly any draw meets.

    Examples
    --------
    >>> import mbrs as mb
    >>> designs = mb.design.normal({"k": 1e5, "m": 20.0}, {"k": 5e3, "m": 0.4}, n=500, correlation={("k", "m"): 0.6})
    >>> bool(abs(np.corrcoef(designs.values.T)[0, 1] - 0.6) < 0.1)
    True
    """
    names = checked_names(mean)
    if set(sd) != set(names):
        raise ModelError(f"mean= and sd= must name the same numbers: {', '.join(names)} and {', '.join(map(str, sd))}")
    centre = real_array("mean", [mean[name] for name in names])
    width = real_array("sd", [sd[name] for name in names])
    if np.any(width <= 0.0):
        raise ModelError(f"the standard deviation of {names[int(np.argmin(width))]!r} must be above 0")
    low, high = _limits(names, bounds)
    n = count("n", n, MOST, least=0)
    require_room(n, len(names))
    labels = checked_units(names, units)
    matrix = _correlation(names, correlation)
    factor = cholesky(matrix)
    rng = random(seed)
    inside = (low - centre) / width, (high - centre) / width
    if bounds and np.any(matrix != np.eye(len(names))):
        scores = _rejected(factor, n, rng, inside)
    else:
        scores = _hypercube(len(names), n, rng, inside) @ factor.T
    values = np.clip(centre + width * scores, low, high)
    about = {} if bounds else {"mean": centre, "covariance": matrix * np.outer(width, width)}
    if about and not np.any(matrix != np.eye(len(names))):
        about["poincare"] = width**2
    return table(names, values, labels, f"normal, seed {seed}" + (", truncated" if bounds else ""), about)


def _limits(names: Sequence[str], bounds: Mapping[str, tuple[float, float]] | None) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for name, given in (bounds or {}).items():
        if name not in names:
            raise ModelError(f"bounds= names {name!r}, which does not vary; known are {', '.join(names)}")
        low[names.index(name)], high[names.index(name)] = interval(name, given)
    return low, high


def _correlation(names: Sequence[str], given: Any) -> np.ndarray:
    p = len(names)
    if given is None:
        return np.eye(p)
    if isinstance(given, Mapping):
        matrix = np.eye(p)
        for pair, value in given.items():
            if not isinstance(pair, tuple) or len(pair) != 2 or pair[0] == pair[1] or not set(pair) <= set(names):
                raise ModelError(f"correlation= names the pair {pair!r}; give two of {', '.join(names)}")
            i, j = names.index(pair[0]), names.index(pair[1])
            matrix[i, j] = matrix[j, i] = float(real_array("correlation", value))
    else:
        matrix = real_array("correlation", given)
    if matrix.shape != (p, p) or np.any(matrix != matrix.T) or np.any(np.diag(matrix) != 1.0):
        raise ModelError(f"the correlation must be a symmetric matrix ({p}, {p}) with ones on its diagonal")
    return matrix


def cholesky(matrix: np.ndarray) -> np.ndarray:
    """L with L L^T = R of a correlation matrix, also of a singular one (numbers that determine each other)."""
    p = len(matrix)
    noise = SINGULAR * p
    factor = np.zeros((p, p))
    for j in range(p):
        rest = matrix[j:, j] - factor[j:, :j] @ factor[j, :j]
        if rest[0] > noise:
            factor[j:, j] = rest / np.sqrt(rest[0])
        elif rest[0] < -noise or np.any(np.abs(rest) > np.sqrt(noise)):
            raise ModelError("no distribution has this correlation: the matrix is not positive semidefinite")
    return factor


def _hypercube(p: int, n: int, rng: np.random.Generator, inside: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Independent normal scores within bounds, a Latin hypercube of their probabilities."""
    from scipy.stats import qmc, truncnorm

    if not n:
        return np.empty((0, p))
    cube = qmc.LatinHypercube(p, seed=rng).random(n)
    # a Latin hypercube may end at 0 or 1, where the quantile is infinite
    cube = np.clip(cube, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)
    return np.stack([truncnorm.ppf(cube[:, j], inside[0][j], inside[1][j]) for j in range(p)], axis=1)


def _rejected(
    factor: np.ndarray, n: int, rng: np.random.Generator, inside: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Correlated normal scores, those outside the bounds drawn again."""
    found, kept, drawn = [], 0, 0
    while kept < n:
        scores = rng.standard_normal((max(1000, 2 * (n - kept)), len(factor))) @ factor.T
        good = scores[np.all((scores >= inside[0]) & (scores <= inside[1]), axis=1)]
        found.append(good)
        kept, drawn = kept + len(good), drawn + len(scores)
        if drawn >= 10 / LEAST_SHARE and kept < LEAST_SHARE * drawn:
            raise ModelError(
                f"only {kept} of {drawn} draws lie within the bounds; widen them, or move the mean towards them"
            )
    return np.concatenate(found)[:n] if found else np.empty((0, len(factor)))
