"""Derivatives of eigenvalues, frequencies, damping ratios and shapes by parameters."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.border import core_errors
from .._lib.checks import real_array
from .._lib.text import counted, without_rounding
from ..errors import ModelError
from ..results import Result, Stats, derived, quantity, result
from .linear_system import relaxes
from .modal_result import ModalResult, refuse_sparse_model

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class GroupSensitivity:
    """Derivatives of one repeated eigenvalue.

    ``matrices`` (n_p, g, g) complex: their eigenvalues are the derivatives of the g eigenvalues along each parameter
    alone. Sums of eigenvalues mean nothing for several parameters at once; sums of matrices do: see `directional`.
    """

    indices: tuple[int, ...]
    eigenvalue: complex
    matrices: np.ndarray
    parameters: tuple[str, ...]

    def directional(self, dp: Any) -> np.ndarray:
        """Derivatives of the g eigenvalues along sum_p dp_p e_p, (g,) complex, in ascending d|s|."""
        dp = _direction(dp, len(self.matrices))
        used = dp != 0.0
        return _splits(np.tensordot(dp[used], self.matrices[used], axes=1), self.eigenvalue)


@result
class DirectionalDerivative(Result):
    """Derivatives along one combined change of all parameters, (n,) each."""

    eigenvalue: np.ndarray = quantity(dims=("mode",), unit="rad/s")
    omega: np.ndarray = quantity(dims=("mode",), unit="rad/s")
    frequency: np.ndarray = quantity(dims=("mode",), unit="Hz")
    damping: np.ndarray = quantity(dims=("mode",), unit="1")

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers"}

    @property
    def numbers(self) -> np.ndarray:
        """(n,) modes counted from 1."""
        return np.arange(1, len(self.frequency) + 1)

    def heading(self) -> str:
        return f"derivatives of {counted(len(self.frequency), 'mode')} along one change of the parameters"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Change of each natural frequency as bars; returns the figure."""
        from ..plot.studies import directional

        return directional(self, ax=ax)


@result
class EigenSensitivity(Result):
    """First derivatives of modes; the parameter axis is last. A single array parameter keeps its shape there.

    For members of a repeated group an entry is the split along that one parameter, in ascending d|s|: members are not
    followed across parameters, so entries of a row must not be combined; use `directional`. nan where no derivative
    exists: near-defective modes, rigid modes that the parameter would hold (s grows like a square root), members of a
    group that ``n=`` cut in two.

    ``status`` is "converged" or "partly undefined"; ``error`` (n,) estimates the relative error of the row's
    derivatives.

    Attributes
    ----------
    eigenvalue
        (n, n_p) complex, ds/dp.
    parameters, shapes
        Labels, and the shape of each (``()`` for a number); n_p is the sum of their sizes.
    units
        Of each of the n_p columns.
    groups
        A `GroupSensitivity` for every repeated group, ``modal.clusters``: also of roots that agree to 1e-11.
    modal
        The modes these are derivatives of.
    """

    modal: ModalResult
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    shapes: tuple[tuple[int, ...], ...]
    flat: np.ndarray
    groups: tuple[GroupSensitivity, ...]
    changes: Any

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers", "parameter": "labels"}
    error_dims: ClassVar[tuple[str, ...]] = ("mode",)

    @property
    def numbers(self) -> np.ndarray:
        """(n,) modes counted from 1."""
        return np.arange(1, len(self.flat) + 1)

    @property
    @derived(dims=("mode", "parameter"), name="eigenvalue", label="ds/dp")
    def _eigenvalues(self) -> np.ndarray:
        return self.flat

    @property
    @derived(dims=("mode", "parameter"), name="frequency", label="d(|s|/2pi)/dp")
    def _frequencies(self) -> np.ndarray:
        return _omega(self.modal.eigenvalue, self.flat) / (2.0 * math.pi)

    @property
    @derived(dims=("mode", "parameter"), name="damping", label="d(damping ratio)/dp")
    def _dampings(self) -> np.ndarray:
        return _damping(self.modal.eigenvalue, self.flat)

    @property
    def eigenvalue(self) -> np.ndarray:
        """ds/dp, (n, n_p) complex, rad/s per unit of the parameter."""
        return self._shaped(self.flat)

    @property
    def omega(self) -> np.ndarray:
        """d|s|/dp, (n, n_p), rad/s per unit of the parameter."""
        return self._shaped(_omega(self.modal.eigenvalue, self.flat))

    @property
    def frequency(self) -> np.ndarray:
        """d(|s|/2pi)/dp, (n, n_p), Hz per unit of the parameter."""
        return self._shaped(_omega(self.modal.eigenvalue, self.flat) / (2.0 * math.pi))

    @property
    def damping(self) -> np.ndarray:
        """d(-Re s/|s|)/dp, (n, n_p), per unit of the parameter; nan for rigid modes."""
        return self._shaped(_damping(self.modal.eigenvalue, self.flat))

    @cached_property
    def _flat_shape(self) -> np.ndarray:
        return _shape_derivatives(self)

    @property
    def shape(self) -> np.ndarray:
        """dphi/dp, (dof, n, n_p), with the normalisation of `ModalResult.shape`; nan for members of repeated groups.

        Computed when it is first asked for: one factorisation for each mode, O(n (dof^3 + n_p dof^2)).
        """
        return self._shaped(self._flat_shape)

    def group(self, i: int) -> GroupSensitivity:
        """The i-th repeated group, in the order of ``modal.clusters``."""
        if not -len(self.groups) <= i < len(self.groups):
            raise ModelError(
                f"there is no group {i}: these modes have {len(self.groups)} groups of repeated eigenvalues"
            )
        return self.groups[i]

    def of(self, parameter: str) -> EigenSensitivity:
        """The part that belongs to one parameter, whose arrays then keep that parameter's shape."""
        if parameter not in self.parameters:
            raise ModelError(f"{parameter!r} is not among the parameters {', '.join(self.parameters)}")
        k = self.parameters.index(parameter)
        sizes = [math.prod(s) for s in self.shapes]
        part = slice(sum(sizes[:k]), sum(sizes[: k + 1]))
        groups = tuple(
            GroupSensitivity(g.indices, g.eigenvalue, g.matrices[part], g.parameters[part]) for g in self.groups
        )
        chosen = EigenSensitivity(
            self.modal,
            (parameter,),
            self.units[part],
            (self.shapes[k],),
            self.flat[:, part],
            groups,
            _selected(self.changes, part),
            stats=self.stats,
            error=self.error,
            status=_status(self.flat[:, part]),
        )
        if "_flat_shape" in self.__dict__:
            chosen.__dict__["_flat_shape"] = self._flat_shape[..., part]
        return chosen

    def directional(self, dp: Mapping[str, float] | ArrayLike) -> DirectionalDerivative:
        """Derivatives along one change of all parameters, repeated groups included.

        Parameters
        ----------
        dp
            (n_p,) change of every parameter (array parameters flattened in C order), in its unit.
        """
        dp = _direction(dp, self.flat.shape[1])
        used = dp != 0.0
        ds = self.flat[:, used] @ dp[used]
        for group in self.groups:
            ds[list(group.indices)] = group.directional(dp)
        s = self.modal.eigenvalue
        column = ds[:, None]
        omega = _omega(s, column)[:, 0]
        return DirectionalDerivative(ds, omega, omega / (2.0 * math.pi), _damping(s, column)[:, 0])

    @property
    def labels(self) -> tuple[str, ...]:
        """One label for each of the n_p columns: ``V[0,1]`` for entries of array parameters."""
        return tuple(_labels(self.parameters, self.shapes))

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that `print` shows: d f_n/dp in Hz, of every mode."""
        heads = [
            f"d/d {name}" + (f" [Hz/{_grouped(unit)}]" if unit else "")
            for name, unit in zip(self.labels, self.units, strict=True)
        ]
        size = np.abs(self.flat) / (2.0 * math.pi)
        scale = np.max(size, axis=0, initial=0.0, where=np.isfinite(size))
        frequency = without_rounding(self._frequencies, scale, float(np.max(np.nan_to_num(self.error), initial=0.0)))
        rows = [[i + 1, float(self.modal.frequency[i]), *line] for i, line in enumerate(frequency.tolist())]
        return ["mode", "f_n [Hz]", *heads], rows

    def heading(self) -> str:
        return f"sensitivity of {counted(len(self.flat), 'mode')} to {counted(self.flat.shape[1], 'parameter')}, {self.status}"

    def notes(self) -> list[str]:
        notes = []
        if self.groups:
            notes.append("repeated groups: each entry is the split along that parameter alone; they do not add up.")
        if self.status != "converged":
            notes.append("- where no derivative exists (near-defective, rigid, or a group cut by n=).")
        return notes

    def plot(self, mode: int = 0, *, most: int = 20, ax: Axes | None = None) -> Figure:
        """Tornado chart (`mbrs.plot.tornado`); returns the Matplotlib figure."""
        from ..plot import tornado

        return tornado(self, mode, most=most, ax=ax)

    def _shaped(self, a: np.ndarray) -> np.ndarray:
        if len(self.shapes) == 1 and self.shapes[0]:
            return a.reshape(*a.shape[:-1], *self.shapes[0])
        return a


def eigen_sensitivity(
    modal: ModalResult,
    dM: ArrayLike | None = None,
    dC: ArrayLike | None = None,
    dK: ArrayLike | None = None,
    *,
    parameters: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    shapes: Sequence[tuple[int, ...]] | None = None,
) -> EigenSensitivity:
    """Derivatives of modes along directions of the matrices.

    ds = -psi^T (s^2 dM + s dC + dK) phi / psi^T (2 s M + C + G) phi for simple roots, from psi^T Q(s) phi = 0; repeated
    roots have a matrix for each direction, whose eigenvalues are the derivatives.

    Parameters
    ----------
    modal
        Modes, as `mbrs.modes` returns them.
    dM, dC, dK
        Derivatives of M, of C + G and of K + N: arrays (dof, dof, n_p), sequences of n_p matrices (dense or
        `scipy.sparse`), or None where nothing depends on the parameters. Only nonzero entries cost anything.
    parameters
        Labels; ``p0, p1, ...`` by default.
    units
        Units of the parameters, or of each entry of theirs, for the table.
    shapes
        Shape of each parameter, ``()`` for a number. The directions of an array parameter follow one another in C
        order.

    Returns
    -------
    EigenSensitivity

    Raises
    ------
    ModelError
        Derivatives of another size, not finite, or unequal in number; labels that do not fit.

    Notes
    -----
    Equations: docs/theory.md (9.5) to (9.7).
    Cost O(n x nonzero entries); shapes, if asked for, one bordered factorisation for each mode.

    Examples
    --------
    >>> import mbrs as mb
    >>> modal = mb.modes(mb.MechanicalSystem(M=[[1.0]], K=[[4.0]]))
    >>> eigen_sensitivity(modal, dK=[[[1.0]]]).omega
    array([[0.25]])
    """
    start = time.perf_counter()
    if not isinstance(modal, ModalResult):
        raise ModelError(f"eigen_sensitivity needs the result of mbrs.modes, got {type(modal).__name__}")
    refuse_sparse_model(modal.system, "modal result")
    if (states := modal.system.states) is not None:
        raise relaxes(states.names[0])
    dof = len(modal.coordinates)
    parts = [_entries(name, a, dof) for name, a in (("dM", dM), ("dC", dC), ("dK", dK))]
    counts = {count for _, count in parts if count is not None}
    if len(counts) > 1:
        raise ModelError(f"dM, dC and dK have different numbers of parameters: {sorted(counts)}")
    n_p = counts.pop() if counts else 0
    labels, units_, shapes_ = _described(n_p, parameters, units, shapes)
    changes = (*(entries for entries, _ in parts), n_p)
    return _solve(modal, changes, labels, units_, shapes_, start)


def _solve(
    modal: ModalResult,
    changes: Any,
    labels: tuple[str, ...],
    units: tuple[str, ...],
    shapes: tuple[tuple[int, ...], ...],
    start: float,
) -> EigenSensitivity:
    from .. import _core

    with core_errors():
        r = _core.eigen_sensitivities(modal.system.core, _modes(modal), changes)
    flat = r["eigenvalue"]
    cut = list(modal.cut_group)
    flat[cut] = np.nan
    names = tuple(_labels(labels, shapes))
    groups = tuple(
        GroupSensitivity(indices, complex(modal.eigenvalue[indices[0]]), matrices, names)
        for indices, matrices in zip(modal.clusters, r["groups"], strict=True)
        if indices[0] not in cut
    )
    counts = {"eigensolutions": 0, "directions": flat.shape[1]}
    return EigenSensitivity(
        modal,
        labels,
        units,
        shapes,
        flat,
        groups,
        changes,
        stats=Stats(time.perf_counter() - start, counts, modal.stats.effects, "bilinear forms"),
        error=_error(modal),
        status=_status(flat),
    )


def _modes(modal: ModalResult) -> Any:
    left = modal.left
    return (
        modal.eigenvalue,
        modal.shape.astype(complex),
        None if left is None else left.astype(complex),
        (modal.kind == "rigid").tolist(),
        modal.near_defective.tolist(),
        [(g[0], len(g)) for g in modal.clusters],
    )


def _shape_derivatives(sensitivity: EigenSensitivity) -> np.ndarray:
    from .. import _core

    modal = sensitivity.modal
    with core_errors():
        r = _core.shape_sensitivities(modal.system.core, _modes(modal), sensitivity.changes, sensitivity.flat)
    shape = np.moveaxis(r["shape"], 0, 1)
    shape[:, list(modal.cut_group)] = np.nan
    finite = np.isfinite(shape)
    return shape if np.any(shape.imag[finite]) else np.ascontiguousarray(shape.real)


def _error(modal: ModalResult) -> np.ndarray:
    """Errors of a derivative come from those of the vectors: the error of s, magnified where another root is near."""
    s = modal.eigenvalue
    distance = np.abs(modal.roots - s[:, None])
    cluster = {i: c for c in modal.clusters for i in c}
    for i in range(len(s)):
        distance[i, [2 * j for j in cluster.get(i, (i,))]] = np.inf
    gap = distance.min(axis=1, initial=np.inf)
    gap = np.where(np.isfinite(gap), gap, np.abs(s))
    noise = modal.error + _EPS * np.nan_to_num(modal.condition, nan=1.0)
    return np.asarray(noise * (1.0 + np.divide(np.abs(s), gap, out=np.zeros(len(s)), where=gap > 0.0)))


def _omega(s: np.ndarray, ds: np.ndarray) -> np.ndarray:
    """d|s| = Re(conj(s) ds)/|s|; at s = 0 it exists only where ds = 0."""
    size = np.abs(s)[:, None]
    at_zero = np.where(ds == 0.0, 0.0, np.nan)
    return np.asarray(
        np.divide((s.conj()[:, None] * ds).real, size, out=at_zero, where=np.broadcast_to(size > 0.0, ds.shape))
    )


def _damping(s: np.ndarray, ds: np.ndarray) -> np.ndarray:
    size = np.abs(s)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        value = -ds.real / size + s.real[:, None] * (s.conj()[:, None] * ds).real / size**3
    return np.where(size > 0.0, value, np.nan)


def _splits(matrix: np.ndarray, s: complex) -> np.ndarray:
    if not np.all(np.isfinite(matrix)):
        return np.full(len(matrix), complex(np.nan, np.nan))
    values = np.linalg.eigvals(matrix)
    growth = values.real if s == 0 else (np.conj(s) * values).real / abs(s)
    return values[np.lexsort((values.imag, growth))]


def _direction(dp: Any, n_p: int) -> np.ndarray:
    give = f"give one change for each of the {n_p} parameters (entries)"
    return real_array("dp", real_array("dp", dp, None, give).ravel(), (n_p,), give)


def _labels(parameters: Sequence[str], shapes: Sequence[tuple[int, ...]]) -> list[str]:
    out: list[str] = []
    for name, shape in zip(parameters, shapes, strict=True):
        if shape:
            out += [f"{name}[{','.join(map(str, i))}]" for i in np.ndindex(*shape)]
        else:
            out.append(name)
    return out


def _described(
    n_p: int, parameters: Any, units: Any, shapes: Any
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[tuple[int, ...], ...]]:
    if isinstance(parameters, str):
        parameters = (parameters,)
    count = len(parameters) if parameters is not None else len(shapes) if shapes is not None else n_p
    names = tuple(parameters) if parameters is not None else tuple(f"p{k}" for k in range(count))
    forms = tuple(tuple(int(i) for i in s) for s in shapes) if shapes is not None else ((),) * count
    labels = tuple(units) if units is not None else ("",) * count
    if len(labels) == len(forms):
        labels = tuple(u for u, s in zip(labels, forms, strict=True) for _ in range(math.prod(s)))
    if len(names) != len(forms) or len(labels) != sum(math.prod(s) for s in forms):
        raise ModelError(f"{len(names)} parameters, {len(forms)} shapes and {len(labels)} units do not fit together")
    total = sum(math.prod(s) for s in forms)
    if total != n_p:
        raise ModelError(f"the parameters have {total} entries but the derivatives {n_p} directions")
    return names, labels, forms


def _entries(name: str, a: Any, dof: int) -> tuple[Any, int | None]:
    """Nonzero entries (row, column, direction, value) of a derivative, and its number of directions."""
    if a is None:
        none = np.zeros(0, dtype=np.int64)
        return (none, none, none, np.zeros(0)), None
    if hasattr(a, "direction"):
        if a.shape[:2] != (dof, dof):
            raise ModelError(f"{name} is of size {a.shape[:2]}, the modes have {dof} coordinates")
        return _typed(a.row, a.column, a.direction, a.value), a.shape[2]
    if isinstance(a, list | tuple) and any(hasattr(part, "tocoo") for part in a):
        found = [(c.row, c.col, np.full(c.nnz, p), c.data) for p, c in enumerate(part.tocoo() for part in a)]
        if any(part.shape != (dof, dof) for part in a):
            raise ModelError(f"every matrix of {name} must be {dof} x {dof}")
        rows, columns, direction, values = (np.concatenate(x) for x in zip(*found, strict=True))
        return _typed(rows, columns, direction, values), len(a)
    give = f"give an array ({dof}, {dof}, n_p) or a list of n_p matrices"
    listed = isinstance(a, list | tuple)
    dense = real_array(name, a, ("n_p", dof, dof) if listed and len(a) else (dof, dof, "n_p"), give)
    dense = np.moveaxis(dense, 0, -1) if listed else dense
    rows, columns, direction = np.nonzero(dense)
    return _typed(rows, columns, direction, dense[rows, columns, direction]), dense.shape[2]


def _typed(rows: Any, columns: Any, direction: Any, values: Any) -> Any:
    index = [np.ascontiguousarray(x, dtype=np.int64) for x in (rows, columns, direction)]
    return (*index, np.ascontiguousarray(values, dtype=float))


def _selected(changes: Any, part: slice) -> Any:
    out = []
    for rows, columns, direction, values in changes[:3]:
        keep = (direction >= part.start) & (direction < part.stop)
        out.append((rows[keep], columns[keep], direction[keep] - part.start, values[keep]))
    return (*out, part.stop - part.start)


def _status(flat: np.ndarray) -> str:
    return "partly undefined" if np.any(np.isnan(flat)) else "converged"


def _grouped(unit: str) -> str:
    """A unit as a denominator."""
    return f"({unit})" if " " in unit or "/" in unit else unit
