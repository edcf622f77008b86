"""Test and computation side by side: frequencies, MAC, CoMAC, FRAC, signs and units, expansion of measured shapes."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np

from .._lib.checks import complex_array, shown
from .._lib.text import counted
from .._lib.warning import warn_user
from ..errors import MbrsWarning, ModelError
from ..results import Result, Stats, quantity, result
from .frf import FrfResult, frf
from .linear_system import as_list
from .mac import mac
from .measurement import Measurement
from .modal_result import ModalResult
from .modes import modes as modes_of
from .pairing import Pairing, pair

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..model.model import Model
    from ..system.state import StateLike
    from .aliases import Shapes
    from .pairing import PairOptions

# Modes that are less alike than this are not pairs. Too small: strangers are paired; too large: modes of a model that still has to be
# updated have no partner.
_LEAST_MAC = 0.3
# Functions that are less alike say nothing about signs and units.
_LEAST_FRAC = 0.4
# Factors between units, and how near a factor must be to be named.
_FACTORS: Mapping[float, str] = {
    1e3: "mm for m", 1e6: "um for m", 9.80665: "g for m/s2", 4.4482216: "N for lbf", 39.370079: "in for m", 2.0 * math.pi: "Hz for rad/s",
}  # fmt: skip
_SAME_FACTOR = 0.15
_AXES = ("x", "y", "z", "rx", "ry", "rz")


def frac(a: FrfResult | ArrayLike, b: FrfResult | ArrayLike) -> np.ndarray:
    """FRAC = |sum a* b|^2 / (sum |a|^2 sum |b|^2) over the frequencies: 1 for proportional functions, 0 for orthogonal ones.

    Parameters
    ----------
    a, b
        `FrfResult` of the same ports and frequencies, or complex arrays (..., n_freq). Frequencies where one is not finite are left out.

    Returns
    -------
    numpy.ndarray
        (n_out, n_in), or the shape without the last axis.

    Notes
    -----
    Cost O(size). W. Heylen and S. Lammens, "FRAC: a consistent way of comparing frequency response functions", Proc. Int. Conf. on
    Identification in Engineering Systems, Swansea 1996, 48-57.

    Examples
    --------
    >>> import numpy as np
    >>> frac(np.array([1.0, 2j, 3.0]), np.array([2.0, 4j, 6.0]))
    array(1.)
    """
    x, y = (np.asarray(getattr(r, "value", r), dtype=complex) for r in (a, b))
    if x.shape != y.shape or x.ndim == 0:
        raise ModelError(
            f"frac needs functions over the same ports and frequencies, got arrays of shapes {x.shape} and {y.shape}"
        )
    there = np.isfinite(x) & np.isfinite(y)
    x, y = np.where(there, x, 0.0), np.where(there, y, 0.0)
    product = np.abs(np.sum(x.conj() * y, axis=-1)) ** 2
    size = np.sum(np.abs(x) ** 2, axis=-1) * np.sum(np.abs(y) ** 2, axis=-1)
    found: np.ndarray = np.divide(product, size, out=np.zeros_like(product), where=size > 0.0)
    return found


def comac(a: Shapes, b: Shapes) -> np.ndarray:
    """CoMAC_i = (sum_k |a_ik b_ik|)^2 / (sum_k |a_ik|^2 sum_k |b_ik|^2): which coordinates make pairs of shapes differ.

    Parameters
    ----------
    a, b
        Paired shapes as columns, (n, n_pairs); each is brought to length 1 first.

    Returns
    -------
    numpy.ndarray
        (n,), in [0, 1]; 0 where a coordinate rests in one set only, nan where it rests in both.

    Notes
    -----
    N. A. J. Lieven and D. J. Ewins, "Spatial correlation of mode shapes, the coordinate modal assurance criterion (COMAC)", Proc. 6th
    Int. Modal Analysis Conf., 1988, 690-695. Cost O(size).

    Examples
    --------
    >>> import numpy as np
    >>> comac(np.eye(2), np.eye(2))
    array([1., 1.])
    """
    x, y = (complex_array("shapes", s) for s in (a, b))
    if x.shape != y.shape or x.ndim != 2:
        raise ModelError(f"comac needs pairs of shapes as columns, got arrays of shapes {x.shape} and {y.shape}")
    x, y = (np.abs(s) / np.maximum(np.linalg.norm(s, axis=0), np.finfo(float).tiny) for s in (x, y))
    size = np.sum(x**2, axis=1) * np.sum(y**2, axis=1)
    both = (np.sum(x, axis=1) > 0.0) | (np.sum(y, axis=1) > 0.0)
    found: np.ndarray = np.divide(np.sum(x * y, axis=1) ** 2, size, out=np.where(both, 0.0, np.nan), where=size > 0.0)
    return found


def serep(measured: Shapes, basis: Shapes, full: Shapes) -> np.ndarray:
    """Expand measured shapes by those of a model (SEREP): full basis^+ measured.

    Parameters
    ----------
    measured
        (n_measured, n) shapes at the measured coordinates.
    basis
        (n_measured, k) the model's modes there, k not above n_measured.
    full
        (n_full, k) the same modes everywhere.

    Returns
    -------
    numpy.ndarray
        (n_full, n); exact for shapes in the span of the modes.

    Raises
    ------
    ModelError
        More modes than measured coordinates, or modes that the coordinates cannot tell apart.

    Notes
    -----
    J. O'Callahan, P. Avitabile and R. Riemer, "System equivalent reduction expansion process (SEREP)", Proc. 7th Int. Modal Analysis
    Conf., 1989, 29-37. Cost O(n_measured k^2).

    Examples
    --------
    >>> import numpy as np
    >>> serep(np.array([[2.0]]), np.array([[1.0]]), np.array([[1.0], [0.5]]))
    array([[2.],
           [1.]])
    """
    x, b, f = (complex_array(name, a) for name, a in (("measured", measured), ("basis", basis), ("full", full)))
    if x.ndim != 2 or b.ndim != 2 or f.ndim != 2 or len(x) != len(b) or b.shape[1] != f.shape[1]:
        raise ModelError("serep needs (n_measured, n), (n_measured, k) and (n_full, k) arrays")
    if np.linalg.matrix_rank(b) < b.shape[1]:
        raise ModelError(
            f"{len(b)} measured coordinates cannot tell {b.shape[1]} modes apart; expand by fewer modes, or measure more coordinates"
        )
    out = f @ np.linalg.lstsq(b, x, rcond=None)[0]
    real = not any(np.iscomplexobj(np.asarray(a)) for a in (measured, basis, full))
    return np.asarray(out.real if real else out)


@result
class Correlation(Result):
    """Test and computation side by side.

    Attributes
    ----------
    mac
        (n_test, n_model) over the measured coordinates.
    partner
        (n_test,) index of the model's mode that a measured one belongs to, -1 without one: the largest MAC, each used once.
    frequency, frequency_model, difference
        (n_test,) Hz, Hz, and f_model / f - 1; nan without a partner.
    damping, damping_model
        (n_test,) ratios.
    comac, coordinate
        (n,) and the names of the measured coordinates, "12:x".
    shape
        (n, n_test) measured shapes at these coordinates, along world axes.
    frac
        (n_out, n_in), or None without functions.
    checks
        What looks like a wrong sign or unit, in words.
    pairing, modes, computed, measured
        `Pairing`, `ModalResult`, and the transfer functions of both, or None.
    """

    mac: np.ndarray = quantity(dims=("mode", "model"))
    partner: np.ndarray = quantity(dims=("mode",))
    frequency: np.ndarray = quantity(dims=("mode",), unit="Hz")
    frequency_model: np.ndarray = quantity(dims=("mode",), unit="Hz")
    difference: np.ndarray = quantity(dims=("mode",), unit="1")
    damping: np.ndarray = quantity(dims=("mode",), unit="1")
    damping_model: np.ndarray = quantity(dims=("mode",), unit="1")
    comac: np.ndarray = quantity(dims=("coordinate",))
    coordinate: tuple[str, ...]
    shape: np.ndarray
    frac: np.ndarray | None = quantity(dims=("output", "input"))
    checks: tuple[str, ...]
    pairing: Pairing
    modes: ModalResult
    computed: FrfResult | None
    measured: FrfResult | None

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers", "coordinate": "coordinate"}
    largest_error: ClassVar[float] = np.inf  # of rigid modes a frequency: the status is that of the modes

    @property
    def numbers(self) -> np.ndarray:
        """(n_test,) measured modes counted from 1."""
        return np.arange(1, len(self.frequency) + 1)

    def heading(self) -> str:
        found = int(np.sum(self.partner >= 0))
        functions = "" if self.frac is None else f", {counted(self.frac.size, 'function')}"
        return f"test and computation: {found} of {len(self.frequency)} modes paired{functions}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the frequencies."""
        heads = [
            "mode",
            "f test [Hz]",
            "mode of model",
            "f model [Hz]",
            "difference [%]",
            "zeta test",
            "zeta model",
            "MAC",
        ]
        rows: list[list[Any]] = []
        for i, j in enumerate(self.partner.tolist()):
            paired = (
                [j + 1, float(self.frequency_model[i]), 100.0 * float(self.difference[i])]
                if j >= 0
                else ["", math.nan, math.nan]
            )
            like = [float(self.damping_model[i]), float(self.mac[i, j])] if j >= 0 else [math.nan, math.nan]
            rows.append([i + 1, float(self.frequency[i]), *paired, float(self.damping[i]), *like])
        return heads, rows

    def notes(self) -> list[str]:
        notes = list(self.checks)
        if self.frac is not None and self.frac.size:
            notes.append(f"FRAC {np.nanmin(self.frac):.3f} to {np.nanmax(self.frac):.3f}")
        return notes

    def expanded(self, modes: Sequence[int] | None = None) -> np.ndarray:
        """(6, n_bodies, n_test) motion of all bodies in the measured modes, by the shapes of the model (`serep`).

        Parameters
        ----------
        modes
            Indices of the model's modes to expand by; the partners of the measured ones by default.
        """
        chosen = sorted(set(self.partner[self.partner >= 0].tolist())) if modes is None else list(modes)
        if not chosen:
            raise ModelError("no measured mode has a partner to expand it by; name modes=")
        names = tuple(self.modes.system.bodies)
        full = np.concatenate([self.modes.body_shape(name)[:, chosen] for name in names])
        basis = _rows(self.pairing, self.modes.system, self.coordinate) @ self.modes.shape[:, chosen]
        return serep(self.shape, basis, full).reshape(len(names), 6, -1).transpose(1, 0, 2)

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """MAC as a matrix of squares; returns the figure."""
        from ..plot.measurement import correlation

        return correlation(self, ax=ax)

    def report(self, path: str | Path, title: str = "Test and computation") -> Path:
        """Write one self-contained page, and return its path."""
        from ..view.page import Section, write_page

        sections = [Section("Modes", [self, self.plot()] if len(self.frequency) else self)]
        if self.measured is not None and self.computed is not None:
            from ..plot.measurement import side_by_side

            sections.append(Section("Transfer functions", side_by_side(self.measured, self.computed)))
        sections.append(Section("Points", self.pairing))
        return write_page(path, title, sections)


def correlate(
    m: Model,
    test: Measurement | FrfResult,
    *,
    pairing: Pairing | None = None,
    at: StateLike = None,
    band: tuple[float, float] | None = None,
    **options: Unpack[PairOptions],
) -> Correlation:
    """Compare a measurement with a model: frequencies, damping, MAC, CoMAC, FRAC, signs and units.

    Parameters
    ----------
    m
        The model.
    test
        What `mb.load` returns of measured functions or modes.
    pairing
        Of `mb.pair`; made with ``**options`` (points, frame, tolerance) by default.
    at
        State of the model, as in `mb.modes`.
    band
        Hz; functions are compared there.

    Returns
    -------
    Correlation

    Warns
    -----
    MbrsWarning
        Functions with another sign or unit than the model's.

    Notes
    -----
    MAC (6.10) over the measured coordinates, rotations times the size of the model. Cost: modes, and
    transfer functions at the measured frequencies.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod()
    >>> h = mb.frf(m, inputs="payload.force.z", outputs="payload.motion.z", frequency=[10.0, 15.0, 20.0])
    >>> mb.correlate(m, h).frac.round(6)
    array([[1.]])
    """
    start = time.perf_counter()
    made = pair(m, test, **options) if pairing is None else pairing
    computed = modes_of(m, at=at)
    coordinates, shape = _measured_shapes(test, made)
    there = _rows(made, computed.system, coordinates) @ computed.shape
    scale = _scales(made, coordinates)[:, None]
    like = mac(scale * shape, scale * there) if shape.size and there.size else np.zeros((shape.shape[1], computed.n))
    partner = partners(like)
    has = partner >= 0
    pick = np.where(has, partner, 0)
    f = np.asarray(test.frequency, dtype=float) if shape.shape[1] else np.zeros(0)
    f_model = np.where(has, computed.frequency[pick], np.nan)
    measured = measured_frf(test, band)
    h = None if measured is None else computed_frf(m, measured, made, at)
    checks = () if measured is None or h is None else _signs_and_units(measured, h)
    for text in checks:
        warn_user(text)
    return Correlation(
        mac=like,
        partner=partner,
        frequency=f,
        frequency_model=f_model,
        difference=np.divide(f_model, f, out=np.full(len(f), np.nan), where=f > 0.0) - 1.0,
        damping=np.asarray(test.damping, dtype=float) if isinstance(test, Measurement) and len(f) else np.zeros(0),
        damping_model=np.where(has, computed.damping[pick], np.nan),
        comac=comac(shape[:, has], there[:, partner[has]]) if np.any(has) else np.full(len(coordinates), np.nan),
        coordinate=coordinates,
        shape=shape,
        frac=None if measured is None or h is None else frac(measured.value, h.value),
        checks=checks,
        pairing=made,
        modes=computed,
        computed=h,
        measured=measured,
        stats=Stats(time.perf_counter() - start, {}, computed.stats.effects, "side by side"),
        error=computed.error.max(initial=0.0),
        status=computed.status,
    )


def measured_frf(test: Any, band: tuple[float, float] | None = None) -> FrfResult | None:
    """The measured transfer functions in a band, or None without any."""
    if isinstance(test, FrfResult):
        h = test
    elif any(f.kind == "frequency response" for f in test.functions):
        h = test.frf()
    else:
        return None
    if band is None:
        return h
    if not isinstance(band, tuple | list) or len(band) != 2 or not band[0] < band[1]:
        raise ModelError(f"band= takes (from, to) in Hz, got {shown(band)}")
    inside = (h.frequency >= band[0]) & (h.frequency <= band[1])
    if not np.any(inside):
        raise ModelError(
            f"nothing was measured from {band[0]:g} to {band[1]:g} Hz; it was from {h.frequency.min():g} to {h.frequency.max():g} Hz"
        )
    return h.replaced(value=h.value[..., inside], frequency=h.frequency[inside], omega=h.omega[inside])


def frf_ports(measured: FrfResult, pairing: Pairing) -> tuple[list[Any], list[Any]]:
    """Inputs and outputs of a model for those of measured functions."""
    if measured.origin is not None:
        return as_list(measured.origin.inputs), as_list(measured.origin.outputs)
    kind = "base" if measured.kind == "transmissibility" else "force"
    inputs = [pairing.port(name, kind) for name in measured.inputs]
    return inputs, [pairing.port(name, "motion") for name in measured.outputs]


def computed_frf(m: Any, measured: FrfResult, pairing: Pairing, at: Any) -> FrfResult:
    """The model's transfer functions at the same ports and frequencies."""
    inputs, outputs = frf_ports(measured, pairing)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MbrsWarning)  # resonances between the measured points
        h = frf(m, inputs, outputs, omega=measured.omega, kind=measured.kind, at=at)
    return h.replaced(inputs=measured.inputs, outputs=measured.outputs)


def _measured_shapes(test: Any, pairing: Pairing) -> tuple[tuple[str, ...], np.ndarray]:
    """Coordinates "node:axis" that moved in some mode, and the shapes there along the axes of the test."""
    if not isinstance(test, Measurement) or not len(test.eigenvalue):
        return (), np.zeros((0, 0))
    labels, rows = [], []
    for i, name in enumerate(test.node_name):
        for c, axis in enumerate(_AXES):
            if np.any(test.shape[c, i]) and name in pairing.places:
                labels.append(f"{name}:{axis}")
                rows.append(test.shape[c, i])
    return tuple(labels), np.array(rows).reshape(len(rows), len(test.eigenvalue))


def _rows(pairing: Pairing, system: Any, coordinates: Sequence[str]) -> np.ndarray:
    """(n, dof): rows of the motions at measured coordinates."""
    rows = [system.port_row(pairing.port(text, "motion"))[0] for text in coordinates]
    return np.array(rows).reshape(len(rows), system.n)


def _scales(pairing: Pairing, coordinates: Sequence[str]) -> np.ndarray:
    """(n,): 1 for displacements and the size of the model for rotations, so that both count as lengths."""
    items = pairing.model.items.values()
    points = np.array([(0.0, 0.0, 0.0), *(item.values("at") for item in items if item.kind in ("body", "marker"))])
    length = float(np.linalg.norm(points[:, None] - points[None], axis=2).max()) or 1.0
    return np.array([length if ":r" in text else 1.0 for text in coordinates])


def shape_rows(test: Measurement, pairing: Pairing, system: Any) -> tuple[np.ndarray, np.ndarray]:
    """Measured shapes (n, n_mode) and the model's rows (n, dof), rotations times the size of the model."""
    coordinates, shape = _measured_shapes(test, pairing)
    if not coordinates:
        raise ModelError(
            "the measured modes have no shapes at paired points, so that their partners are not known; give points="
        )
    scale = _scales(pairing, coordinates)[:, None]
    return scale * shape, scale * _rows(pairing, system, coordinates)


def partners(like: np.ndarray) -> np.ndarray:
    """The mode of the model for each measured one by a MAC, -1 without one, each used once so that the sum of all is largest."""
    from scipy.optimize import linear_sum_assignment

    partner = np.full(len(like), -1)
    i, j = linear_sum_assignment(like, maximize=True)
    alike = like[i, j] >= _LEAST_MAC
    partner[i[alike]] = j[alike]
    return partner


def _signs_and_units(measured: FrfResult, computed: FrfResult) -> tuple[str, ...]:
    """Signs and units that the factor between measured and computed functions tells."""
    found: dict[str, list[str]] = {}
    alike = frac(measured.value, computed.value)
    for i, j in np.argwhere(alike >= _LEAST_FRAC):
        a, b = measured.value[i, j], computed.value[i, j]
        there = np.isfinite(a) & np.isfinite(b)
        factor = np.vdot(b[there], a[there]) / np.vdot(b[there], b[there]).real
        name = f"{measured.outputs[i]} / {measured.inputs[j]}"
        if factor.real < -0.5 * abs(factor):
            found.setdefault("the opposite sign of the model's", []).append(name)
        elif abs(factor.imag) > 0.7 * abs(factor):
            found.setdefault(
                "another phase than the model's by 90 degrees (another kind, or exp(-i omega t))", []
            ).append(name)
        for size, words in _FACTORS.items():
            for value, text in ((size, words), (1.0 / size, " for ".join(reversed(words.split(" for "))))):
                if abs(math.log(abs(factor) / value)) < _SAME_FACTOR:
                    found.setdefault(f"values {value:.4g} times the model's: {text}?", []).append(name)
    return tuple(f"{', '.join(names[:4])}{', ...' if len(names) > 4 else ''}: {what}" for what, names in found.items())
