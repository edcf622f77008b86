"""Measurements as residuals of a model over their standard deviations with exact derivatives by parameters."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import real_array, shown
from ..errors import MbrsWarning, ModelError
from ..linear.correlation import frf_ports, measured_frf, partners, shape_rows
from ..linear.frf import FrfResult, frf
from ..linear.linearize import linearize
from ..linear.mac import mac
from ..linear.measurement import Measurement
from ..linear.modal_result import ModalResult
from ..linear.modes import modes
from ..linear.pairing import Pairing
from ..linear.sensitivity import sensitivity
from .goals import state_of

if TYPE_CHECKING:
    from ..model.model import Model

KINDS = ("frequency", "damping", "shape", "frf")


@dataclass(frozen=True, eq=False)
class Block:
    """Residuals model - test of one kind, (n,), their derivatives (n, n_p), and the group of data that each belongs to.

    The data of a group have one standard deviation: ``known`` (n,), or nan where it is to be found from the residuals.
    ``size`` (n,) is how large the datum is of which a residual is the difference: no residual is known better than its rounding.
    """

    residual: np.ndarray
    slopes: np.ndarray
    group: np.ndarray
    known: np.ndarray
    size: np.ndarray


@dataclass(frozen=True, eq=False)
class Evidence:
    """The data of an update.

    Attributes
    ----------
    kinds
        Of `KINDS`.
    noise
        Standard deviations by kind.
    partner, used
        Mode of the model for each measured one where it was given; the measured modes that had one at first.
    """

    test: Any
    pairing: Pairing
    kinds: tuple[str, ...]
    noise: Mapping[str, Any]
    at: str
    functions: FrfResult | None
    partner: np.ndarray
    used: list[int] = field(default_factory=list)

    def blocks(self, model: Model, labels: Sequence[str]) -> list[Block]:
        """All residuals at the present values of the model."""
        found = []
        if "frf" in self.kinds:
            found.append(self._functions(model, labels))
        if set(self.kinds) - {"frf"}:
            found += self._modes(model, labels)
        return found

    def _functions(self, model: Model, labels: Sequence[str]) -> Block:
        """Real and imaginary parts of all functions; one group for each function."""
        measured = self.functions
        assert measured is not None
        inputs, outputs = frf_ports(measured, self.pairing)
        system = linearize(model, at=state_of(model, self.at))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MbrsWarning)  # resonances between the measured points
            h = frf(system, inputs, outputs, omega=measured.omega, kind=measured.kind)
        slopes = sensitivity(h, list(labels)).value
        there = np.isfinite(measured.value)
        group = np.broadcast_to(np.arange(there[..., 0].size).reshape(*there.shape[:2], 1), there.shape)[there]
        known = self.noise.get("frf")
        known = np.full(there.shape, np.nan) if known is None else _noise(known, there.shape)
        miss, by = (h.value - measured.value)[there], slopes[there]
        return Block(
            np.concatenate([miss.real, miss.imag]),
            np.concatenate([by.real, by.imag]),
            np.concatenate([group, group]),
            np.concatenate([known[there]] * 2),
            np.concatenate([np.abs(measured.value[there])] * 2),
        )

    def _modes(self, model: Model, labels: Sequence[str]) -> list[Block]:
        computed = modes(model, at=state_of(model, self.at))
        has, mine = self._partners(computed)
        by = sensitivity(computed, list(labels))
        if np.any(np.isnan(by.flat[mine])):
            raise ModelError(
                "a mode of the model that the test has seen has no derivatives (repeated or near-defective)"
            )
        found = []
        if "frequency" in self.kinds:
            f = np.asarray(self.test.frequency)[has]
            found.append(self._ratios("frequency", computed.frequency[mine] / f - 1.0, by.frequency[mine] / f[:, None]))
        if "damping" in self.kinds:
            z = np.asarray(self.test.damping)[has]
            if np.any(~(z > 0.0)):
                raise ModelError("the measured modes have no damping to update by; leave 'damping' out of data=")
            found.append(self._ratios("damping", computed.damping[mine] / z - 1.0, by.damping[mine] / z[:, None]))
        if "shape" in self.kinds:
            measured, rows = shape_rows(self.test, self.pairing, computed.system)
            found.append(self._shapes(measured[:, has], rows, computed.shape[:, mine], by.shape[:, mine]))
        return found

    def _partners(self, computed: ModalResult) -> tuple[np.ndarray, np.ndarray]:
        """The measured modes that are used, always the same ones, and the modes of the model that they belong to now."""
        if self.partner.size:
            has = np.flatnonzero(self.partner >= 0)
            return has, self.partner[has]
        from scipy.optimize import linear_sum_assignment

        shape, rows = shape_rows(self.test, self.pairing, computed.system)
        like = mac(shape, rows @ computed.shape)
        if not self.used:
            self.used.extend(np.flatnonzero(partners(like) >= 0).tolist())
            if not self.used:
                raise ModelError(
                    "no measured mode resembles one of the model; look at mb.correlate(m, test), and start nearer"
                )
        return np.array(self.used), linear_sum_assignment(like[self.used], maximize=True)[1]

    def _ratios(self, kind: str, miss: np.ndarray, slopes: np.ndarray) -> Block:
        known = self.noise.get(kind)
        sizes = np.full(len(miss), np.nan) if known is None else _noise(known, miss.shape)
        return Block(miss, slopes, np.zeros(len(miss), dtype=int), sizes, np.ones(len(miss)))

    def _shapes(self, measured: np.ndarray, rows: np.ndarray, shape: np.ndarray, slopes: np.ndarray) -> Block:
        """Shapes of length 1, those of the model scaled to fit best: a = y^H t / y^H y for y = rows phi, residual a y - t."""
        parts: list[tuple[np.ndarray, np.ndarray]] = []
        for k in range(measured.shape[1]):
            t = measured[:, k] / np.linalg.norm(measured[:, k])
            y, dy = (rows @ shape[:, k]).astype(complex), (rows @ slopes[:, k]).astype(complex)
            size = np.vdot(y, y).real
            a = np.vdot(y, t) / size
            da = (dy.conj().T @ t - a * 2.0 * (y.conj() @ dy).real) / size
            parts.append((a * y - t, a * dy + np.outer(y, da)))
        miss, by = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
        if np.any(measured.imag) or np.any(miss.imag):
            miss, by = np.concatenate([miss.real, miss.imag]), np.concatenate([by.real, by.imag])
        return self._ratios("shape", miss.real, by.real)


def evidence(
    test: Any, pairing: Pairing, data: Any, noise: Any, at: str, band: tuple[float, float] | None, partner: Any
) -> Evidence:
    """Checked data of an update."""
    functions = measured_frf(test, band)
    modal = isinstance(test, Measurement) and len(test.eigenvalue) > 0
    if data is None:
        data = (
            ("frf",)
            if functions is not None
            else ("frequency", "damping")
            if modal and np.all(test.damping > 0)
            else ("frequency",)
        )
    kinds = (data,) if isinstance(data, str) else tuple(data)
    for kind in kinds:
        if kind not in KINDS:
            raise ModelError(f"data= takes some of {', '.join(KINDS)}, got {shown(kind)}")
        if kind == "frf" and functions is None:
            raise ModelError("data='frf': the measurement has no frequency responses")
        if kind != "frf" and not modal:
            raise ModelError(f"data={kind!r}: the measurement has no modes")
    if not kinds:
        raise ModelError(f"data= is empty; it takes some of {', '.join(KINDS)}")
    given = noise if isinstance(noise, Mapping) else {} if noise is None else {kind: noise for kind in kinds}
    for kind in given:
        if kind not in kinds:
            raise ModelError(f"noise= names {shown(kind)}, and the data are {', '.join(kinds)}")
    pairs = np.zeros(0, dtype=int) if partner is None else np.asarray(partner, dtype=int)
    if partner is not None and (not modal or pairs.shape != (len(test.eigenvalue),)):
        raise ModelError("partner= takes the mode of the model for each measured mode, -1 without one")
    return Evidence(test, pairing, kinds, given, at, functions, pairs)


def _noise(given: Any, shape: tuple[int, ...]) -> np.ndarray:
    size = real_array("noise", given)
    if np.any(size <= 0.0):
        raise ModelError("noise= takes standard deviations above 0")
    if size.ndim == 2 and len(shape) == 3:
        size = size[..., None]
    try:
        return np.broadcast_to(size, shape)
    except ValueError:
        raise ModelError(f"noise= of shape {size.shape} does not fit data of shape {shape}") from None
