"""Check of derivatives by differences, for users who want to see it with their own model."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import shown
from .._lib.text import number
from ..errors import ModelError
from ..linear.sensitivity import sensitivity
from ..model.directions import directions
from ..results import Result, Stats, quantity, result
from ..system.compiled import compiled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model

# A derivative that differs from the differences by less than this many times their own error is confirmed.
_FACTOR = 10.0
# Largest relative difference that is confirmed though the differences claim less. Larger: wrong derivatives pass; smaller: rounding of
# the analysis refuses right ones.
_NOISE = 1e-7
# Step of the differences over the value of the parameter, and the value that 0 counts as, over the size of the model's numbers of its
# unit. Larger: what bends is not told from what is wrong; smaller: rounding hides it. Pinned by tests/gradients/test_check_gradients.py.
_STEP, _OF_ZERO = 1e-4, 1e-3


@result
class GradientCheck(Result):
    """Derivatives against central differences, one row per parameter.

    ``exact`` and ``difference`` are the entries that disagree most, ``error`` their relative difference, ``noise`` the error of
    the differences themselves (from two step sizes), ``ok`` whether they agree within it.
    """

    labels: tuple[str, ...]
    exact: np.ndarray = quantity(dims=("parameter",))
    difference: np.ndarray = quantity(dims=("parameter",))
    noise: np.ndarray = quantity(dims=("parameter",))
    ok: np.ndarray = quantity(dims=("parameter",))

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"parameter": "labels"}
    error_dims: ClassVar[tuple[str, ...]] = ("parameter",)

    def heading(self) -> str:
        return "check of gradients"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table."""
        short = ([number(float(e), 2) for e in a] for a in (self.error, self.noise))
        rows = [list(row) for row in zip(self.labels, self.exact, self.difference, *short, self.ok, strict=True)]
        return ["parameter", "derivative", "difference", "disagreement", "error of difference", "agree"], rows

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Disagreement and the error of the differences by parameter, logarithmic; returns the figure."""
        from ..plot.studies import gradient_check

        return gradient_check(self, ax=ax)

    def __bool__(self) -> bool:
        return bool(np.all(self.ok))


def check_gradients(
    analysis: Callable[[Any], Any],
    m: Model,
    parameters: str | Sequence[str],
    *,
    value: Callable[[Any], Any] | None = None,
) -> GradientCheck:
    """Compare `mb.sensitivity` with central differences of the analysis itself.

    Parameters
    ----------
    analysis
        What to differentiate, such as ``mb.modes`` or ``lambda m: mb.frf(m, ...)``; it returns a result of modes, a
        transfer
        function, a response, an equilibrium or a linearisation.
    m
        The model; left as it was.
    parameters
        Addresses of scalar numbers and parameters (axes and orientations cannot be set along one direction).
    value
        Which numbers of the result to compare, with the same meaning for the result and (last axis: parameters) for its
        sensitivity; by default eigenvalues of modes, values of transfer functions and responses, positions of an
        equilibrium and
        K of a linearisation.

    Returns
    -------
    GradientCheck
        True where all agree.

    Notes
    -----
    Ridders-like extrapolation of central differences with two steps; 4 runs of the analysis per parameter. Eigenvalues at both
    ends of a step are paired with those that the derivatives expect there, each once: a double root splits along a parameter,
    and its halves change places in the order by size from one end to the other.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod()
    >>> bool(mb.check_gradients(mb.linearize, m, ["payload.mass", "k_leg"]))
    True
    """
    start = time.perf_counter()
    if not callable(analysis):
        raise ModelError(
            f"check_gradients takes a function of the model first, such as mb.modes, got {shown(analysis)}"
        )
    along = directions(m, parameters)
    numbers = _default if value is None else value
    result = analysis(m)
    exact = np.asarray(numbers(sensitivity(result, list(along.labels))))
    roots = np.asarray(result.eigenvalue) if value is None and hasattr(result, "eigenvalue") else None
    rows = [_one(analysis, m, label, exact[..., p], numbers, roots) for p, label in enumerate(along.labels)]
    columns = [np.array(c) for c in zip(*rows, strict=True)]
    ok = columns[2] <= np.maximum(_FACTOR * columns[3], _NOISE)
    return GradientCheck(
        labels=along.labels,
        exact=columns[0],
        difference=columns[1],
        error=columns[2],
        noise=columns[3],
        ok=ok,
        status="converged" if np.all(ok) else "different",
        stats=Stats(time.perf_counter() - start, {"analyses": 1 + 4 * along.n}, (), "central differences"),
    )


def _default(result: Any) -> np.ndarray:
    for name in ("eigenvalue", "value", "K", "position"):
        found = getattr(result, name, None)
        if found is not None and not callable(found):
            return np.asarray(found)
    if hasattr(result, "poses"):
        return result.poses["position"]
    raise ModelError(
        f"check_gradients does not know which numbers of a {type(result).__name__} to compare; give value="
    )


def _paired(roots: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Roots in the order of those expected, each used once. Where roots cross or split, their order by size is not that of modes."""
    from scipy.optimize import linear_sum_assignment

    if len(roots) != len(expected):
        raise ModelError(f"the number of modes changes near this design, from {len(expected)} to {len(roots)}")
    return roots[linear_sum_assignment(np.abs(expected[:, None] - roots[None, :]))[1]]


def _usual_size(m: Any, label: str) -> float:
    """Size of the model's numbers of the same unit: the characteristic length, or the median of those that are not 0."""
    unit = directions(m, [label]).units[0]
    if unit == "m":
        return float(compiled(m).characteristic_length)
    known = directions(m, [f"{item.name}.{name}" for item in m.items.values() for name in item.fields()])
    alike = [abs(float(m.value(one))) for one, own in zip(known.labels, known.units, strict=True) if own == unit]
    return float(np.median([v for v in alike if v > 0.0] or [1.0]))


def _one(
    analysis: Any, m: Any, label: str, exact: np.ndarray, numbers: Any, roots: np.ndarray | None
) -> tuple[Any, Any, float, float]:
    """``roots``: the eigenvalues of modes, whose neighbours are paired with them; None for what has an order of its own."""
    now = m.value(label)
    if np.ndim(now) != 0:
        raise ModelError(f"{label!r} is not a single number; check one of its entries")
    h = _STEP * (abs(float(now)) or _OF_ZERO * _usual_size(m, label))

    def difference(step: float) -> np.ndarray:
        ends = []
        for side in (1.0, -1.0):
            m.set({label: now + side * step})
            found = np.asarray(numbers(analysis(m)))
            ends.append(found if roots is None else _paired(found, roots + side * step * exact))
        return (ends[0] - ends[1]) / (2.0 * step)

    try:
        coarse, fine = difference(h), difference(0.5 * h)
    finally:
        m.set({label: now})
    best = (4.0 * fine - coarse) / 3.0
    scale = max(
        float(np.max(np.abs(best), initial=0.0)), float(np.max(np.abs(exact), initial=0.0)), np.finfo(float).tiny
    )
    miss = np.abs(best - exact) / scale
    worst = np.unravel_index(int(np.argmax(miss)), miss.shape)
    noise = float(np.max(np.abs(best - fine))) / scale
    return exact[worst], best[worst], float(miss[worst]), noise
