"""Objectives on modes and transfer functions of a linearised model, with exact gradients."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import choice, positive, real_array, shown
from ..errors import MbrsWarning, ModelError
from ..linear.equilibrium import equilibrium
from ..linear.frf import FrfResult, frf
from ..linear.linear_system import as_list
from ..linear.linearize import linearize
from ..linear.mac import mac
from ..linear.modal_result import ModalResult, array_of
from ..linear.modes import modes
from ..linear.sensitivity import sensitivity

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..linear.aliases import Linear, LoadCase, Ports
    from ..model.model import Model

_STATES = ("drawn", "equilibrium")
# Rounds that refine a peak, each narrowing its bracket fourfold before a last parabola: 4^-8 of the sampling near a pole, whose square
# is rounding. Fewer: peaks are too low. More: time. Pinned by tests/design/test_goals.py (closed form of an oscillator).
_ROUNDS = 8
# Samples next to a pole are a quarter of its width apart, so that the highest of them shows at least this share of the peak. Too large:
# the highest peak may be left out. Too small: time.
_CLOSE = 0.7
# Gauss points of a panel whose half is at most _SHORT of its distance from the next pole: error of about 1e-10. Fewer points or longer
# panels: mean squares and their gradients disagree. More or shorter: time. Pinned by the same tests (closed form of a mean square).
_GAUSS = 8
_SHORT = 0.5
# Panels over the band below which a pole on the axis is let be: a rigid mode at 0 Hz. Too large: sharp peaks are integrated badly.
_SHORTEST = 1e-9
# Panels where no poles are known: large sparse models.
_BLIND = 64
# A pole whose damping ratio is below this makes peaks and mean squares infinite. Too large: lightly damped models are refused.
_UNDAMPED = 1e-9
# The least MAC with which a shape is found again. Too large: searches stop where shapes change with the design; too small: another mode
# passes for the one asked for.
_LEAST_MAC = 0.1


class Goal:
    """An objective of a linearised model: a number, and its exact gradient by parameters."""

    def both(self, model: Model, labels: Sequence[str]) -> tuple[float, np.ndarray]:
        """Value, and gradient (n_p,) by the addresses of single numbers."""
        raise NotImplementedError


def state_of(model: Model, at: str) -> Any:
    """The argument ``at=`` of linear analyses for "drawn" and "equilibrium"."""
    return equilibrium(model) if at == "equilibrium" else None


@dataclass(frozen=True, eq=False)
class Match(Goal):
    """The mode with a given shape shall have a frequency, a damping ratio, or both: ((f - f0)/f0)^2 + ((zeta - zeta0)/zeta0)^2.

    In every design the mode is the one whose shape has the largest MAC with the given one, weighted by the mass matrix of ``modes``, so
    that modes may change their order. Of repeated frequencies it is the combination that comes nearest to the shape; its derivative holds
    the combination.

    Parameters
    ----------
    modes
        `ModalResult` of the model as it is now: coordinates, mass matrix and state (drawn or equilibrium) are those of these modes.
    frequency, damping
        Hz, and a ratio; at least one.
    shape
        (dof,) real or complex over ``modes.coordinates``; a column of ``modes.shape``.
    weight
        Factor of the objective, where several are added.

    Notes
    -----
    Gradients: docs/theory.md (9.5). Cost: modes and their sensitivities, O(dof^3).
    R. J. Allemang and D. L. Brown, "A correlation coefficient for modal vector analysis", Proc. 1st Int. Modal Analysis Conf., 1982.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod(); modes = mb.modes(m)
    >>> goal = mb.Match(modes, frequency=12.0, shape=modes.shape[:, 0])
    >>> best = mb.problem(m, goal, ["k_leg"], bounds={"k_leg": (1e4, 1e6)}).solve(tol=1e-14)
    >>> round(float(mb.modes(m).frequency[0]), 5)
    12.0
    """

    modes: ModalResult
    frequency: float | None = None
    damping: float | None = None
    shape: ArrayLike | None = field(default=None, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.modes, ModalResult) or not hasattr(self.modes.system, "state"):
            raise ModelError(f"mb.Match takes modes of a mb.Model, got {shown(self.modes)}")
        if self.modes.system.state.kind not in _STATES:
            raise ModelError(
                f"mb.Match knows modes of the drawn state and of an equilibrium, not of a {self.modes.system.state.kind} state"
            )
        shape = np.asarray(self.shape)
        dof = len(self.modes.coordinates)
        if (
            shape.shape != (dof,)
            or shape.dtype.kind not in "fciu"
            or not np.all(np.isfinite(shape))
            or not np.any(shape)
        ):
            raise ModelError(f"shape= of mb.Match takes {dof} numbers that are not all zero, such as modes.shape[:, 0]")
        if self.frequency is None and self.damping is None:
            raise ModelError("mb.Match needs frequency=, damping= or both")
        for name in ("frequency", "damping"):
            if getattr(self, name) is not None:
                positive(f"{name}= of mb.Match", getattr(self, name))
        positive("weight= of mb.Match", self.weight)

    def both(self, model: Model, labels: Sequence[str]) -> tuple[float, np.ndarray]:
        s, ds = self.root(model, labels)
        size = abs(s)
        growth = (np.conj(s) * ds).real / size
        value, slope = 0.0, np.zeros(len(ds))
        if self.frequency is not None:
            miss = size / (2.0 * math.pi * self.frequency) - 1.0
            value, slope = value + miss**2, slope + 2.0 * miss * growth / (2.0 * math.pi * self.frequency)
        if self.damping is not None:
            miss = -s.real / size / self.damping - 1.0
            rate = (-ds.real / size + s.real * growth / size**2) / self.damping
            value, slope = value + miss**2, slope + 2.0 * miss * rate
        return self.weight * value, self.weight * slope

    def root(self, model: Model, labels: Sequence[str]) -> tuple[complex, np.ndarray]:
        """The eigenvalue of the mode in this design, and its derivatives (n_p,)."""
        found = modes(model, at=state_of(model, self.modes.system.state.kind))
        if found.coordinates != self.modes.coordinates:
            raise ModelError(
                f"the modes of mb.Match have the coordinates {', '.join(self.modes.coordinates[:4])}, ..., and {model.name!r} now "
                "others; compute them anew"
            )
        members, part = self._nearest(found)
        s = complex(found.eigenvalue[members[0]])
        if s == 0.0:
            raise ModelError(
                f"the mode that mb.Match follows has become rigid in {model.name!r}; keep it away with bounds="
            )
        by = sensitivity(found, list(labels))
        if len(members) == 1:
            ds = by.flat[members[0]]
        else:
            (group,) = (g for g in by.groups if members[0] in g.indices)
            ds = np.einsum("i,pij,j->p", part.conj(), group.matrices, part)
        if not np.all(np.isfinite(ds)):
            raise ModelError(f"mode {members[0] + 1} has no derivatives here (near-defective); keep away with bounds=")
        return s, ds

    def _nearest(self, found: ModalResult) -> tuple[tuple[int, ...], np.ndarray]:
        """The modes of one eigenvalue whose span comes nearest to the shape, and the shape in them, of length 1."""
        weight = np.asarray(array_of(self.modes.system.M))
        target = np.asarray(self.shape)
        taken = {i for c in found.clusters for i in c}
        candidates = [*found.clusters, *((i,) for i in range(found.n) if i not in taken and found.kind[i] != "rigid")]
        best, part = -1.0, np.ones(1, dtype=complex)
        members: tuple[int, ...] = (0,)
        for one in candidates:
            basis = found.shape[:, list(one)]
            gram = basis.conj().T @ weight @ basis
            c = np.linalg.solve(gram, basis.conj().T @ weight @ target)
            share = float(mac(basis @ c, target, weight=weight)[0, 0]) if np.any(c) else 0.0
            if share > best:
                best, members, part = share, tuple(one), c.astype(complex)
        if best < _LEAST_MAC:
            raise ModelError(
                f"no mode resembles the shape of mb.Match any more (largest MAC {best:.2f}); keep near with bounds="
            )
        return members, part / np.linalg.norm(part)


@dataclass(frozen=True, eq=False)
class _Transfer(Goal):
    """Base of objectives on transfer functions.

    Every entry of ``inputs`` is a load case: a port, or several with their (complex) amplitudes, ``{port: amplitude}``.
    """

    inputs: LoadCase | Sequence[LoadCase]
    outputs: Ports
    frequency: ArrayLike
    kind: str = field(default="receptance", kw_only=True)
    at: str = field(default="drawn", kw_only=True)
    weight: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        who = f"mb.{type(self).__name__}"
        choice("at", self.at, _STATES)
        positive(f"weight= of {who}", self.weight)
        if not as_list(self.inputs) or not as_list(self.outputs):
            raise ModelError(f"{who} needs inputs and outputs, such as body.force('z') and body.motion('z')")
        points = real_array("frequency", self.frequency)
        wide = points.shape == (2,) and 0.0 <= points[0] < points[1]
        if isinstance(self.frequency, tuple) and not wide:
            raise ModelError(f"frequency={shown(self.frequency)} of {who} is not a range (from, to) in Hz")

    @property
    def ports(self) -> tuple[list[Any], np.ndarray]:
        """The ports of all load cases, and their amplitudes (n_port, n_case)."""
        cases = [case if isinstance(case, Mapping) else {case: 1.0} for case in as_list(self.inputs)]
        ports: list[Any] = []
        for case in cases:
            if not case:
                raise ModelError("a load case of mb.Peak and mb.MeanSquare names at least one port")
            ports += [port for port in case if port not in ports]
        amplitude = np.zeros((len(ports), len(cases)), dtype=complex)
        for j, case in enumerate(cases):
            for port, size in case.items():
                amplitude[ports.index(port), j] = size
        return ports, amplitude

    def transfer(self, system: Any, omega: np.ndarray) -> FrfResult:
        """H of all ports at the points, rad/s."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MbrsWarning)  # points that miss resonances
            return frf(system, self.ports[0], as_list(self.outputs), omega=omega, kind=self.kind)

    def response(self, system: Any, omega: np.ndarray) -> np.ndarray:
        """(n_out, n_case, n_freq) complex."""
        return np.einsum("ijk,jc->ick", self.transfer(system, omega).value, self.ports[1])

    def response_and_slopes(
        self, system: Any, omega: np.ndarray, labels: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The response, and its derivatives (n_out, n_case, n_freq, n_p)."""
        h, amplitude = self.transfer(system, omega), self.ports[1]
        by = sensitivity(h, list(labels)).value
        return np.einsum("ijk,jc->ick", h.value, amplitude), np.einsum("ijkp,jc->ickp", by, amplitude)

    def poles(self, system: Any, low: float, high: float) -> np.ndarray:
        """Poles that are seen in a band of rad/s, Im >= 0.

        Raises
        ------
        ModelError
            One in the band has no damping.
        """
        found = self.transfer(system, np.array([low, high])).poles
        poles = np.zeros(0, dtype=complex) if found is None else found[found.imag >= 0.0]
        near = poles[(poles.imag >= low) & (poles.imag <= high) & (poles.imag > 0.0)]
        bare = near[np.abs(near.real) < _UNDAMPED * near.imag]
        if bare.size:
            raise ModelError(
                f"mb.{type(self).__name__} is infinite: there is no damping at {bare[0].imag / (2 * math.pi):.6g} Hz; give the "
                "elements c= or another band"
            )
        return poles


@dataclass(frozen=True, eq=False)
class Peak(_Transfer):
    """The largest |H| in a band of frequencies; with ``below`` how far all peaks exceed it, sum of max(0, |H|/below - 1)^2.

    Peaks are found between samples, and differentiated where they are (their frequency moves along without effect in first order).
    Where two peaks are equally high the maximum has a kink: as a limit, ``mb.Bounded(mb.Peak(...), upper=x)``, or with ``below`` searches
    take that well.

    Parameters
    ----------
    inputs
        A port, or a list of load cases, each a port or ``{port: amplitude}`` with amplitudes that act together.
    outputs
        Motions; each peaks for itself.
    frequency
        Hz: a range (from, to), or points.
    below
        In the unit of H.
    kind, at, weight
        As of `mb.frf`; "drawn" or "equilibrium"; factor of the objective, where several are added.

    Notes
    -----
    Gradients: docs/theory.md (9.8) at each peak. Cost: one transfer function, and a factorisation O(dof^3) for each peak.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod(); p = m["payload"]
    >>> goal = mb.Peak(p.force("z"), p.motion("z"), (1.0, 100.0), below=2e-5)
    >>> best = mb.problem(m, goal, ["c_leg"], bounds={"c_leg": (1.0, 1e3)}).solve()
    >>> best.value < 1e-6
    True
    """

    below: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.below is not None:
            positive("below= of mb.Peak", self.below)

    def both(self, model: Model, labels: Sequence[str]) -> tuple[float, np.ndarray]:
        system = linearize(model, at=state_of(model, self.at))
        peaks = self.peaks(system)  # (output, case, omega, size)
        if self.below is None:
            peaks = [max(peaks, key=lambda peak: peak[3])]
        else:
            peaks = [peak for peak in peaks if peak[3] > self.below]
        if not peaks:
            return 0.0, np.zeros(len(labels))
        omega = np.unique([peak[2] for peak in peaks])
        y, dy = self.response_and_slopes(system, omega, labels)
        value, slope = 0.0, np.zeros(len(labels))
        for i, c, w, _ in peaks:
            k = int(np.searchsorted(omega, w))
            size = float(abs(y[i, c, k]))
            by = (np.conj(y[i, c, k]) * dy[i, c, k]).real / size if size else np.zeros(len(labels))
            if self.below is None:
                value, slope = size, by
            else:
                over = size / self.below - 1.0
                value, slope = value + over**2, slope + 2.0 * over * by / self.below
        return self.weight * value, self.weight * slope

    def peaks(self, system: Linear) -> list[tuple[int, int, float, float]]:
        """Local maxima of |H| and the ends of the band: output, load case, rad/s, size."""
        if not isinstance(self.frequency, tuple):
            omega = np.unique(2.0 * math.pi * np.atleast_1d(real_array("frequency", self.frequency)))
            size = np.abs(self.response(system, omega))
            k = np.argmax(size, axis=2)
            return [(i, c, float(omega[k[i, c]]), float(size[i, c, k[i, c]])) for i, c in np.ndindex(k.shape)]
        low, high = (2.0 * math.pi * float(f) for f in self.frequency)
        self.poles(system, low, high)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MbrsWarning)
            sampled = frf(system, self.ports[0], as_list(self.outputs), omega=(low, high), kind=self.kind)
        omega = sampled.omega
        size = np.abs(np.einsum("ijk,jc->ick", sampled.value, self.ports[1]))
        ends = [(i, c, float(omega[k]), float(size[i, c, k])) for i, c in np.ndindex(size.shape[:2]) for k in (0, -1)]
        inner = (size[..., 1:-1] >= size[..., :-2]) & (size[..., 1:-1] > size[..., 2:])
        # samples near poles show a peak to a few per cent; those that are far too low need not be known better
        inner &= size[..., 1:-1] >= _CLOSE * (size.max() if self.below is None else self.below)
        places = np.argwhere(inner)
        return [*self._refined(system, places, omega), *ends] if len(places) else ends

    def _refined(self, system: Any, places: np.ndarray, omega: np.ndarray) -> list[tuple[int, int, float, float]]:
        """The maxima within the brackets omega[k], omega[k + 2] of places (output, load case, k)."""
        i, c, k = places.T
        low, high = omega[k], omega[k + 2]
        row = np.arange(len(k))
        for _ in range(_ROUNDS):
            w = np.linspace(low, high, 9, axis=1)
            y = np.abs(self.response(system, w.ravel())).reshape(-1, len(self.ports[1].T), *w.shape)[i, c, row]
            top = np.clip(np.argmax(y, axis=1), 1, 7)
            low, high = w[row, top - 1], w[row, top + 1]
        before, at, after = (y[row, top + step] for step in (-1, 0, 1))
        bend = before - 2.0 * at + after
        shift = np.divide(0.5 * (before - after), bend, out=np.zeros(len(k)), where=bend < 0.0)
        place = w[row, top] + np.clip(shift, -1.0, 1.0) * (w[:, 1] - w[:, 0])
        return [*zip(i.tolist(), c.tolist(), place.tolist(), at.tolist(), strict=True)]


@dataclass(frozen=True, eq=False)
class MeanSquare(_Transfer):
    """The mean of |H|^2 over a band, over all outputs and load cases: integral of |H|^2 df / (to - from).

    Parameters
    ----------
    inputs, outputs
        As of `Peak`. Outputs of different units are added as plain numbers.
    frequency
        Hz: a range (from, to), integrated by Gauss panels that narrow towards each pole, or points, over which the mean is taken.
    kind, at, weight
        As of `Peak`.

    Notes
    -----
    Gradients: docs/theory.md (9.8). Cost: about 16 log2(band/width) factorisations O(dof^3) for each pole.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod(); p = m["payload"]
    >>> goal = mb.MeanSquare(p.force("z"), p.motion("z"), (5.0, 40.0), kind="accelerance")
    >>> best = mb.problem(m, goal, ["c_leg"], bounds={"c_leg": (1.0, 1e4)}).solve()
    >>> best.status
    'converged'
    """

    def both(self, model: Model, labels: Sequence[str]) -> tuple[float, np.ndarray]:
        system = linearize(model, at=state_of(model, self.at))
        omega, share = self.quadrature(system)
        y, dy = self.response_and_slopes(system, omega, labels)
        share = share / (y.shape[0] * y.shape[1])
        value = float(np.einsum("ick,k->", np.abs(y) ** 2, share))
        slope = 2.0 * np.einsum("ick,ickp,k->p", y.conj(), dy, share).real
        return self.weight * value, self.weight * slope

    def quadrature(self, system: Linear) -> tuple[np.ndarray, np.ndarray]:
        """Points in rad/s, and what each counts; the sum is 1."""
        if not isinstance(self.frequency, tuple):
            omega = 2.0 * math.pi * np.atleast_1d(real_array("frequency", self.frequency))
            return omega, np.full(len(omega), 1.0 / len(omega))
        low, high = (2.0 * math.pi * float(f) for f in self.frequency)
        cuts = _panels(low, high, self.poles(system, low, high))
        x, w = np.polynomial.legendre.leggauss(_GAUSS)
        half = 0.5 * np.diff(cuts)
        omega = (0.5 * (cuts[1:] + cuts[:-1])[:, None] + half[:, None] * x).ravel()
        return omega, (half[:, None] * w).ravel() / (high - low)


def _panels(low: float, high: float, poles: np.ndarray) -> np.ndarray:
    """Ends of panels, halved until each is short against its distance from the nearest pole i w = s."""
    done, todo = [], np.linspace(low, high, 1 + (_BLIND if not poles.size else 1))
    begin, end = todo[:-1], todo[1:]
    while begin.size:
        middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
        distance = np.abs(1j * middle[:, None] - poles).min(axis=1, initial=np.inf)
        short = (half <= _SHORT * distance) | (half <= _SHORTEST * (high - low))
        done.append(begin[short])
        begin, middle, end = begin[~short], middle[~short], end[~short]
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
    return np.sort(np.concatenate([*done, [high]]))


@dataclass(frozen=True, eq=False)
class Sum(Goal):
    """Several objectives added up."""

    parts: tuple[Goal, ...]

    def both(self, model: Model, labels: Sequence[str]) -> tuple[float, np.ndarray]:
        found = [part.both(model, labels) for part in self.parts]
        return sum(value for value, _ in found), np.sum([slope for _, slope in found], axis=0)
