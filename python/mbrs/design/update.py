"""Models updated by measurements: Gauss-Newton with exact Jacobians, covariance, priors, and what the data do not see."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from .._lib.checks import UNFIT, choice, count, shown
from .._lib.progress import Progress
from ..errors import Interrupted, MbrsError, ModelError
from ..linear.pairing import Pairing, pair
from ..model.directions import directions
from ..motion.tangent import value_at
from ..results import Stats
from .evidence import Block, Evidence, evidence
from .fit import CUT, Update, seen_directions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..linear.frf import FrfResult
    from ..linear.measurement import Measurement
    from ..linear.pairing import PairOptions
    from ..model.model import Model

# Distance from the optimum, in standard deviations, below which a fit has converged. Too small: rounding of the residuals never lets
# it. Too large: intervals lie beside the optimum. Pinned by tests/design/test_update.py.
_NEAR = 1e-4
# Change of standard deviations of the data that ends their estimation. Too small: rounds without effect; too large: intervals are off.
_SETTLED = 1e-3
_ROUNDS = 20
# Residuals this small against the first ones are rounding, and not an estimate of noise.
_FLOOR = 1e-12
# Relative change of a parameter in one step, at first; it grows with steps that help. Too small: many steps. Too large: steps along
# directions that are hardly seen leave the model. Pinned by the same tests.
_REACH = 0.5
# Relative change of the parameters that cannot be told from rounding of the residuals.
_STILL = 1e-9
# Levenberg's damping, relative to the largest singular value squared: its first value when a step fails, and the last one that is tried.
_FIRST, _LAST = 1e-8, 1e6


@dataclass(eq=False)
class _Fit:
    """Residuals at a point, and how they are weighted."""

    model: Model
    labels: tuple[str, ...]
    data: Evidence
    prior: tuple[np.ndarray, np.ndarray]  # mean and standard deviation, infinite without one
    sizes: np.ndarray
    limits: tuple[np.ndarray, np.ndarray]
    evaluations: int = 0

    def at(self, p: np.ndarray) -> list[Block]:
        """All residuals there."""
        self.model.set(dict(zip(self.labels, p.tolist(), strict=True)))
        self.evaluations += 1
        found = self.data.blocks(self.model, self.labels)
        for block in found:
            if not (np.all(np.isfinite(block.residual)) and np.all(np.isfinite(block.slopes))):
                raise ModelError(
                    "the model has no finite transfer function, or no derivative, at a measured frequency (an undamped resonance or 0 Hz "
                    "of a free body); give damping, or band="
                )
        return found

    def weighted(self, p: np.ndarray, blocks: list[Block], sd: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and their derivatives by p over ``sizes``, in standard deviations; the prior's are last."""
        r = [b.residual / s for b, s in zip(blocks, sd, strict=True)]
        a = [b.slopes / s[:, None] * self.sizes for b, s in zip(blocks, sd, strict=True)]
        mean, width = self.prior
        has = np.isfinite(width)
        r.append((p - mean)[has] / width[has])
        a.append((np.diag(self.sizes / width))[has])
        return np.concatenate(r), np.concatenate(a)

    def deviations(self, blocks: list[Block], first: list[np.ndarray] | None) -> list[np.ndarray]:
        """Standard deviation of every datum: known, or that of the residuals of its group."""
        n = sum(len(b.residual) for b in blocks)
        share = max(1.0 - len(self.labels) / n, 1.0 / n)
        out = []
        for k, b in enumerate(blocks):
            total = np.bincount(b.group)
            spread = np.sqrt(np.bincount(b.group, b.residual**2) / np.maximum(total * share, 1e-300))
            floor = np.maximum(np.finfo(float).eps * b.size, 0.0 if first is None else _FLOOR * first[k])
            own = np.maximum(spread[b.group], floor)
            out.append(np.where(np.isnan(b.known), np.where(own > 0.0, own, 1.0), b.known))
        return out


def update(
    m: Model,
    test: Measurement | FrfResult,
    parameters: str | Sequence[str],
    *,
    data: str | Sequence[str] | None = None,
    pairing: Pairing | None = None,
    noise: ArrayLike | Mapping[str, ArrayLike] | None = None,
    prior: Mapping[str, float | tuple[float, float]] | None = None,
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    band: tuple[float, float] | None = None,
    partner: Sequence[int] | None = None,
    at: str = "drawn",
    max_steps: int = 60,
    **options: Unpack[PairOptions],
) -> Update:
    """Update parameters of a model so that it agrees best with a measurement.

    min over p of sum ((y(p) - y_test) / sd)^2 + sum ((p - p_prior) / sd_prior)^2 by Gauss-Newton steps with exact Jacobians (Levenberg's
    damping where a full step does not help); covariance (A^T A)^-1 of the weighted Jacobian A.

    Parameters
    ----------
    m
        The model; it keeps the values that are found.
    test
        What `mb.load` returns of measured functions or modes, or an `FrfResult`.
    parameters
        Addresses of numbers.
    data
        Some of "frf" (complex transfer functions), "frequency", "damping" (relative errors) and "shape" (shapes of length 1 over the
        measured coordinates). Transfer functions where there are any, else frequencies and damping.
    pairing
        Of `mb.pair`; made with ``**options`` (points, frame, tolerance) by default.
    noise
        Standard deviations: a number, an array, or {kind: ...}; of "frf" those of real and imaginary part, in the unit of H, one number or
        an array (n_out, n_in) or (n_out, n_in, n_freq). What is not given is estimated from the residuals: one for each function, one
        for all frequencies, one for all damping ratios, one for all shapes.
    prior
        {address: standard deviation} about the present value, or {address: (mean, standard deviation)}.
    bounds
        {address: (lower, upper)}, None where there is none.
    band
        Hz; transfer functions are used there.
    partner
        (n_test,) index of the model's mode for each measured one, -1 without one; by MAC at each step by default.
    at
        "drawn" or "equilibrium".
    max_steps
        Steps at most.

    Returns
    -------
    Update
        ``x, sd, covariance, interval(0.95)``, and ``unseen``: directions that the data do not see.

    Raises
    ------
    ModelError
        Data that the measurement does not have, parameters named twice, nodes that are not paired.
    Interrupted
        Ctrl-C; ``.result`` is the fit so far.

    Notes
    -----
    Jacobians: docs/theory.md (9.5), (9.7), (9.8). Cost: as many evaluations as steps, each O(dof^3) for every measured frequency.
    M. I. Friswell and J. E. Mottershead, Finite Element Model Updating in Structural Dynamics, Kluwer 1995, chapters 8 and 9.
    Intervals hold to first order: for noise that is small against the bend of y(p) within the interval.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> m = mb.examples.cubic_hexapod()
    >>> h = mb.frf(m, inputs="payload.force.z", outputs="payload.motion.z", frequency=np.linspace(5.0, 40.0, 71))
    >>> m.set({"k_leg": 0.8e5, "c_leg": 50.0})
    >>> fit = mb.update(m, h, ["k_leg", "c_leg"])
    >>> fit.x.round(3).tolist()
    [100000.0, 30.0]
    """
    begin = time.perf_counter()
    along = directions(m, parameters)
    labels = along.labels
    for label in labels:
        if labels.count(label) > 1:
            raise ModelError(f"{label!r} is named twice; name every parameter once")
        if math.isnan(value_at(m, label)):
            raise ModelError(
                f"{label!r} is a rotation and cannot be updated; make the axis or orientation depend on a parameter"
            )
    choice("at", at, ("drawn", "equilibrium"))
    count("max_steps", max_steps, 10**6)
    made = pair(m, test, **options) if pairing is None else pairing
    told = evidence(test, made, data, noise, at, band, partner)
    start = np.array([float(m.value(label)) for label in labels])
    mean, width = _prior(prior, labels, start)
    sizes = np.where(start != 0.0, np.abs(start), np.where(np.isfinite(width), width, 1.0))
    fit = _Fit(m, labels, told, (mean, width), sizes, _limits(bounds, labels, start))
    run = _Run(fit, start, max_steps)
    try:
        with Progress("update") as progress:
            run.solve(progress)
    except KeyboardInterrupt:
        raise Interrupted(
            "the update was interrupted; its result is the fit so far", _result(run, along, begin, "interrupted")
        ) from None
    return _result(run, along, begin, run.status)


class _Run:
    """Gauss-Newton steps, and rounds in which the noise is estimated."""

    def __init__(self, fit: _Fit, start: np.ndarray, most: int) -> None:
        self.fit, self.most = fit, most
        self.start, self.p = start, start
        self.blocks = fit.at(start)
        self.first = fit.deviations(self.blocks, None)
        self.sd = self.first
        self.history: list[float] = []
        self.status, self.distance = "max-steps", math.inf
        self.reach = _REACH

    def solve(self, progress: Progress) -> None:
        """Weights and steps in turn until both rest."""
        for _ in range(_ROUNDS):
            self.status = "max-steps"
            while len(self.history) < self.most:
                self.distance = self.step()
                progress.advance(
                    note=f"{self.history[-1]:.4g} standard deviations per datum, {self.distance:.1e} from the optimum"
                )
                if self.distance <= _NEAR or self.status == "stalled":
                    break
            if self.distance <= _NEAR:
                self.status = "converged"
            settled, last = self.fit.deviations(self.blocks, self.first), self.sd
            change = max(float(np.abs(np.log(a / b)).max(initial=0.0)) for a, b in zip(settled, last, strict=True))
            self.sd = settled
            if change <= _SETTLED or self.status == "max-steps":
                return

    def step(self) -> float:
        """One step; returns how far away the optimum was before it, in standard deviations of the parameters."""
        fit, p = self.fit, self.p
        r, a = fit.weighted(p, self.blocks, self.sd)
        cost = float(r @ r)
        free = self._free(p, a.T @ r)
        self.history.append(math.sqrt(cost / len(r)))
        u, s, v = np.linalg.svd(a[:, free], full_matrices=False)
        g = u.T @ r
        sees = s > CUT * s.max(initial=0.0)
        distance = float(np.linalg.norm(g[sees]))
        if distance <= _NEAR:
            return distance
        damping, most = 0.0, s.max()
        while damping <= _LAST:
            gain = np.where(sees, s / np.where(sees, s**2 + damping * most**2, 1.0), 0.0)
            change = v.T @ (gain * g)
            reach = float(np.abs(change).max(initial=0.0))
            if reach <= self.reach and self._better(free, change, cost):
                if damping == 0.0 or reach > 0.5 * self.reach:
                    self.reach = max(self.reach, 2.0 * reach)
                return distance
            if damping == 0.0 and reach <= _STILL:
                return 0.0  # rounding of the residuals
            damping = max(_FIRST, 10.0 * damping)
        fit.at(p)
        self.status = "stalled"
        return distance

    def _better(self, free: np.ndarray, change: np.ndarray, cost: float) -> bool:
        """Go there if the sum of squares is less."""
        fit = self.fit
        trial = self.p.copy()
        trial[free] -= fit.sizes[free] * change
        trial = np.clip(trial, *fit.limits)
        try:
            blocks = fit.at(trial)
        except MbrsError:
            return False  # a design without a model: a shorter step
        now = fit.weighted(trial, blocks, self.sd)[0]
        if not float(now @ now) < cost:
            return False
        self.p, self.blocks = trial, blocks
        return True

    def _free(self, p: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Indices of the parameters that no bound holds against the descent."""
        low, high = self.fit.limits
        held = ((p <= low) & (slope > 0.0)) | ((p >= high) & (slope < 0.0))
        return np.flatnonzero(~held)


def _result(run: _Run, along: Any, begin: float, status: str) -> Update:
    fit = run.fit
    fit.model.set(dict(zip(fit.labels, run.p.tolist(), strict=True)))
    r, a = fit.weighted(run.p, run.blocks, run.sd)
    n = sum(len(b.residual) for b in run.blocks)
    has_prior = np.isfinite(fit.prior[1])
    estimated = any(np.any(np.isnan(b.known)) for b in run.blocks)
    freedom = n + int(np.sum(has_prior)) - len(fit.labels) if estimated else math.inf
    seen = seen_directions(a[:n], a, fit.labels, fit.sizes)
    if status == "converged" and seen.unseen:
        status = "unidentified"
    if freedom <= 0:
        seen = seen.unknown()
    groups = sorted({(k, int(g)) for k, b in enumerate(run.blocks) for g in np.unique(b.group)})
    noise = [float(run.sd[k][run.blocks[k].group == g][0]) for k, g in groups]
    return Update(
        x=run.p,
        start=run.start,
        sd=seen.sd,
        covariance=seen.covariance,
        strength=seen.strength,
        directions=seen.directions,
        unseen=seen.unseen,
        labels=along.labels,
        units=along.units,
        freedom=float(freedom),
        noise=np.array(noise),
        misfit=float(math.sqrt(np.mean(r[:n] ** 2))),
        history=np.array(run.history),
        evidence=fit.data,
        model=fit.model,
        stats=Stats(
            time.perf_counter() - begin, {"evaluations": fit.evaluations, "steps": len(run.history)}, (), "Gauss-Newton"
        ),
        error=run.distance if math.isfinite(run.distance) else None,
        status=status,
    )


def _prior(given: Any, labels: Sequence[str], start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean, width = start.copy(), np.full(len(labels), np.inf)
    for label, value in _named(given, labels, "prior").items():
        pair_ = value if isinstance(value, tuple | list) else (start[labels.index(label)], value)
        try:
            centre, sd = (float(v) for v in pair_)
        except UNFIT:
            centre, sd = math.nan, math.nan
        if not (math.isfinite(centre) and 0.0 < sd < math.inf):
            raise ModelError(
                f"prior= of {label!r} takes a standard deviation above 0, or (mean, standard deviation), got {shown(value)}"
            )
        mean[labels.index(label)], width[labels.index(label)] = centre, sd
    return mean, width


def _limits(given: Any, labels: Sequence[str], start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.full(len(labels), -np.inf), np.full(len(labels), np.inf)
    for label, ends in _named(given, labels, "bounds").items():
        k = labels.index(label)
        try:
            low[k], high[k] = (o if e is None else float(e) for e, o in zip(ends, (-math.inf, math.inf), strict=True))
        except UNFIT:
            raise ModelError(f"bounds of {label!r} are (lower, upper), got {shown(ends)}") from None
        if not low[k] <= start[k] <= high[k]:
            raise ModelError(
                f"{label!r} begins at {start[k]:g}, which is not within its bounds {low[k]:g} to {high[k]:g}"
            )
    return low, high


def _named(given: Any, labels: Sequence[str], what: str) -> Mapping[str, Any]:
    if given is not None and not isinstance(given, Mapping):
        raise ModelError(f"{what}= takes a dictionary over the parameters, got {shown(given)}")
    for name in given or {}:
        if name not in labels:
            raise ModelError(f"{what}= names {name!r}, which is not among the parameters {', '.join(labels)}")
    return given or {}
