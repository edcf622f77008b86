"""Results of updates: values, covariance, and the directions that data see or do not see."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import shown
from .._lib.text import counted
from ..errors import ModelError
from ..linear.correlation import computed_frf, correlate
from ..results import Result, derived, quantity, result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Relative effect on the data, against that of the direction they see best, below which a direction is lost in rounding. Too small:
# rounding passes for information. Too large: weak directions, which still have an interval, count as unseen. Pinned by
# tests/design/test_update.py.
CUT = 1e-10
# A direction of which one standard deviation is more than this multiple of the parameters' sizes is not seen.
_UNSEEN = 1.0
# Parameters with a smaller part of a direction are not named in it.
_PART = 0.1
# A parameter with this part of a direction that is lost has no standard deviation.
_HELD = 1e-6
# A factor that differs from one by less is not written: it would be with its two digits.
_ONE = 0.005


@dataclass(frozen=True, eq=False)
class Seen:
    """Covariance and directions of a fit."""

    sd: np.ndarray
    covariance: np.ndarray
    strength: np.ndarray
    directions: np.ndarray
    unseen: tuple[str, ...]

    def unknown(self) -> Seen:
        """Without an estimate of the noise nothing has a standard deviation."""
        return replace(self, sd=np.full_like(self.sd, np.inf), covariance=np.full_like(self.covariance, np.nan))


def seen_directions(data: np.ndarray, whole: np.ndarray, labels: Sequence[str], sizes: np.ndarray) -> Seen:
    """From Jacobians in standard deviations by parameters over their sizes, of the data alone and with the prior."""
    n = len(labels)
    _, s, v = np.linalg.svd(data, full_matrices=True)
    s = np.concatenate([s, np.zeros(n - len(s))])
    weak = (s <= CUT * s.max(initial=0.0)) | (s * _UNSEEN < 1.0)
    unseen = tuple(_words(v[k], labels, 1.0 / s[k] if s[k] > CUT * s.max() else math.inf) for k in np.flatnonzero(weak))
    _, t, w = np.linalg.svd(whole, full_matrices=True)
    t = np.concatenate([t, np.zeros(n - len(t))])
    lost = t <= CUT * t.max(initial=0.0)
    inverse = np.where(lost, 0.0, 1.0 / np.where(lost, 1.0, t))
    root = sizes[:, None] * w.T * inverse
    covariance = root @ root.T
    held = np.abs(w[lost]).max(axis=0, initial=0.0) > _HELD
    sd = np.where(held, np.inf, np.sqrt(np.diag(covariance)))
    return Seen(sd, covariance, s, v, unseen)


def _words(direction: np.ndarray, labels: Sequence[str], spread: float) -> str:
    """A direction in words: parts of parameters, relative to their sizes."""
    top = int(np.argmax(np.abs(direction)))
    scaled = direction / direction[top]
    order = [k for k in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[k]) >= _PART]
    text = ""
    for k in order:
        size = abs(scaled[k])
        sign = ("" if scaled[k] > 0 else "-") if not text else (" + " if scaled[k] > 0 else " - ")
        text += sign + ("" if abs(size - 1.0) < _ONE else f"{size:.2g} ") + labels[k]
    return f"{text} (relative changes): " + (
        "not seen at all" if math.isinf(spread) else f"seen to {100 * spread:.3g} %"
    )


@result
class Update(Result):
    """Result of `mb.update`.

    Attributes
    ----------
    x, start
        (n_p,) parameters now and before; the model has those of now.
    sd, covariance
        (n_p,), inf where the data do not determine a parameter; (n_p, n_p), of what they determine.
    strength, directions
        (n_p,) singular values of the data's Jacobian over their standard deviations, by relative changes of the parameters, largest
        first, and (n_p, n_p) the directions as rows: 1/strength is the relative standard deviation along each.
    unseen
        The directions along which 100 % is not seen, in words.
    freedom
        Degrees of freedom of the estimate of the noise; infinite where the noise was given.
    noise
        Standard deviation of each group of data: functions, then frequencies, damping, shapes.
    misfit
        Root mean square of the residuals, in standard deviations.
    history
        (n_steps,) the same at each step, with the prior.
    error
        Distance from the optimum in standard deviations before the last step.
    labels, units, evidence, model
        Of the parameters; the data; the model.
    """

    x: np.ndarray = quantity(dims=("parameter",))
    start: np.ndarray = quantity(dims=("parameter",))
    sd: np.ndarray = quantity(dims=("parameter",), label="standard deviation")
    covariance: np.ndarray = quantity(dims=("parameter", "parameter_"))
    strength: np.ndarray = quantity(dims=("direction",))
    directions: np.ndarray = quantity(dims=("direction", "parameter"))
    unseen: tuple[str, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    freedom: float
    noise: np.ndarray
    misfit: float
    history: np.ndarray
    evidence: Any
    model: Any

    row: ClassVar[str] = "parameter"
    axes: ClassVar[Mapping[str, str]] = {"parameter": "labels", "parameter_": "labels"}

    @property
    @derived(dims=("parameter", "parameter_"))
    def correlation(self) -> np.ndarray:
        """(n_p, n_p) correlation of the estimates."""
        size = np.sqrt(np.diag(self.covariance))
        both = np.outer(size, size)
        return np.divide(self.covariance, both, out=np.zeros_like(both), where=both > 0.0)

    def interval(self, level: float = 0.95) -> np.ndarray:
        """(n_p, 2) intervals that hold the true values with this probability, for normal noise and a model that can be true.

        x -+ t sd, with the quantile t of Student's distribution with ``freedom`` degrees.
        """
        from scipy.stats import norm, t

        if not isinstance(level, float | int) or not 0.0 < level < 1.0:
            raise ModelError(f"level must lie between 0 and 1, got {shown(level)}")
        tail = 0.5 + 0.5 * level
        reach = self.sd * (
            norm.ppf(tail) if math.isinf(self.freedom) else t.ppf(tail, self.freedom) if self.freedom > 0 else 1.0
        )
        return np.column_stack([self.x - reach, self.x + reach])

    def heading(self) -> str:
        what = counted(len(self.labels), "parameter")
        return f"update of {what} by {', '.join(self.evidence.kinds)}: {self.status}, misfit {self.misfit:.3g}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the parameters."""
        ends = self.interval()
        columns = (self.labels, self.units, self.start.tolist(), self.x.tolist(), self.sd.tolist(), *ends.T.tolist())
        heads = ["parameter", "unit", "before", "now", "sd", "95 % from", "to"]
        return heads, [list(line) for line in zip(*columns, strict=True)]

    def notes(self) -> list[str]:
        return [f"not seen: {text}" for text in self.unseen]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Values over those before, with their intervals; returns the figure."""
        from ..plot.measurement import update

        return update(self, ax=ax)

    def report(self, path: str | Path, title: str = "Update by a measurement") -> Path:
        """Write one self-contained page, parameters, what the data see, test beside model, and return its path."""
        from ..plot.measurement import side_by_side
        from ..view.page import Section, write_page

        data = self.evidence
        sections = [Section("Parameters", [self, self.plot()])]
        seen = "\n".join(self.unseen) or "All directions are seen."
        weakest = (
            f"Weakest direction: {100 / self.strength[-1]:.3g} % standard deviation." if self.strength[-1] > 0.0 else ""
        )
        sections.append(Section("What the data see", seen, weakest))
        if data.functions is not None:
            from .goals import state_of

            h = computed_frf(self.model, data.functions, data.pairing, state_of(self.model, data.at))
            sections.append(Section("Transfer functions", side_by_side(data.functions, h)))
        if data.functions is None or getattr(data.test, "eigenvalue", np.zeros(0)).size:
            sections.append(Section("Modes", correlate(self.model, data.test, pairing=data.pairing)))
        sections.append(Section("Points", data.pairing))
        return write_page(path, title, sections)
