"""Modes of linear and linearised systems."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ._border import core_errors
from ._energy_shares import EnergyShares, energy_shares
from ._stiffness_factor import is_strained, stiffness_factor
from .errors import ModelError, NameNotFoundError, SingularError
from .mac import mac as _mac
from .model.book import Book
from .model.schema import LAW_OF_CODE
from .progress import while_long
from .relaxation import relaxation_of, relaxing_modes
from .report import number, without_rounding
from .results import Result, Stats, added_counts, derived, quantity, result
from .second_order import MechanicalSystem

KINDS = ("rigid", "vibration", "overdamped", "flutter", "divergence")
_MATRIX_EFFECTS = {"damping": "C", "gyroscopic": "G", "circulatory": "N"}
_UNRESOLVED = 1e-9
# Relative error of an eigenvalue above which a result is not called converged. Too small: critical damping and defects, which have no
# more digits than these, count as failures. Too large: wrong digits pass. Pinned by tests/truth/test_graded_modes.py.
_DOUBTFUL = 1e-4
# Relative error of an assembled model's frequency from which on the factor of its stiffness is worth a second solution. Too small:
# ordinary models are solved twice. Too large: soft modes keep the rounding of stiff springs. Pinned by tests/truth/test_graded_modes.py.
_GRADED = 1e-9
# A smaller pivot of M means that light bodies drown in the rounding of heavy ones; then a factor of M is taken.
_LIGHTEST = 1e-5
# Roots that a symmetry makes equal come out this far apart: positions and closed loops carry some rounding.
_SAME = 1e-11


@result
class ModalResult(Result):
    """Modes of (s^2 M + s (C + G) + K + N) phi = 0, in ascending |s|; equal |s| in ascending damping ratio.

    ``stats.route`` names the algorithm. ``error`` (n,) estimates the relative error of each eigenvalue: that of the algorithm
    and, for undamped and proportionally damped systems, that of the data, which is what rounding of the entries of K and M (or
    of their factors), made before they were given, can do to it. For rigid modes it is the frequency (rad/s) that this rounding
    hides. ``status`` is "unresolved" unless every backward error is at most 1e-9 and every error at most 1e-4.

    Attributes
    ----------
    eigenvalue
        (n,) complex, rad/s: of a complex pair the root with Im > 0, of two real roots the larger one; 0 for rigid
        modes.
    roots
        (2 dof,) complex: for every mode, also those that ``n=`` cut off, the root above and its partner. Real roots of
        symmetric systems are matched so that each mode has one root with phi^T Q'(s) phi > 0 and one with < 0, whose
        shapes are the most alike; without symmetry the larger half of the real roots is matched with the smaller half.
    shape
        (dof, n), rows are `coordinates`; real where all shapes are. Symmetric systems: phi^T (2 s M + C) phi = 2i Im s,
        which is phi^T M phi = 1 without damping. With G or N, and for real, rigid and near-defective roots:
        phi^H M phi = 1. The largest component (the first within 1e-6) has a positive real part, and is real where
        phi^H M phi = 1.
    left
        (dof, n) left vectors, psi^T (s^2 M + s (C + G) + K + N) = 0 with psi^T (2 s M + C + G) phi = 2i Im s (for
        real, rigid and near-defective roots psi^H M psi = 1); None where they equal the shapes.
    kind
        (n,) of str: "rigid" (s = 0), "vibration" (complex, Re s <= 0), "overdamped" (real), "flutter" (complex,
        Re s > 0), "divergence" (real, s > 0), "relaxation" (real and without a partner: of the state of a law).
    groups
        Tuples of the indices of repeated eigenvalues, only those with more than one member. Their shapes are a basis
        that depends on the subspace alone.
    backward_error
        (n,) |Q(s) phi| / ((|s|^2 |M| + |s| |C + G| + |K + N|) |phi|) in coordinates of unit mass, Frobenius norms.
    condition
        (n,) relative change of s for a relative change of every matrix entry; nan for rigid modes.
    near_defective
        (n,) bool: two roots of one mode (critical damping) or of two modes almost meet, so that s depends on the data
        like a square root; the shape belongs to both.
    coordinates
        dof names.
    system
        The matrices the modes belong to.
    cut_group
        Indices of those modes whose repeated group ``n=`` has cut: the shapes of the others are missing.
    """

    eigenvalue: np.ndarray = quantity(dims=("mode",), unit="rad/s")
    roots: np.ndarray = quantity(dims=("root",), unit="rad/s")
    shape: np.ndarray = quantity(dims=("coordinate", "mode"))
    left: np.ndarray | None = quantity(dims=("coordinate", "mode"))
    kind: np.ndarray = quantity(dims=("mode",))
    groups: tuple[tuple[int, ...], ...]
    backward_error: np.ndarray = quantity(dims=("mode",), unit="1")
    condition: np.ndarray = quantity(dims=("mode",), unit="1")
    near_defective: np.ndarray = quantity(dims=("mode",))
    coordinates: tuple[str, ...]
    system: Any
    partner_mode: np.ndarray
    partner_shape: np.ndarray
    partner_left: np.ndarray | None
    cut_group: tuple[int, ...] = ()

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers", "coordinate": "coordinates"}
    error_dims: ClassVar[tuple[str, ...]] = ("mode",)

    @property
    def numbers(self) -> np.ndarray:
        """(n,) modes counted from 1, as tables show them."""
        return np.arange(1, self.n + 1)

    @property
    @derived(dims=("mode",))
    def group(self) -> np.ndarray:
        """(n,) the repeated group of each mode, from 1; 0 for a mode that is alone."""
        return np.array(
            [next((k + 1 for k, g in enumerate(self.groups) if i in g), 0) for i in range(self.n)], dtype=int
        )

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.eigenvalue)

    @property
    def omega(self) -> np.ndarray:
        """(n,) |s| in rad/s."""
        return np.abs(self.eigenvalue)

    @property
    @derived(dims=("mode",), unit="Hz", label="natural frequency")
    def frequency(self) -> np.ndarray:
        """(n,) |s|/2pi in Hz: the undamped natural frequency only for underdamped modes of proportional damping."""
        return np.abs(self.eigenvalue) / (2.0 * math.pi)

    @property
    @derived(dims=("mode",), unit="Hz", label="damped frequency")
    def frequency_damped(self) -> np.ndarray:
        """(n,) |Im s|/2pi in Hz: what one sees in a decaying vibration."""
        return np.abs(self.eigenvalue.imag) / (2.0 * math.pi)

    @property
    @derived(dims=("mode",), unit="1", label="damping ratio")
    def damping(self) -> np.ndarray:
        """(n,) damping ratio -Re s/|s|; 1 for overdamped modes, negative for unstable ones, nan for rigid ones."""
        size = np.abs(self.eigenvalue)
        return np.divide(-self.eigenvalue.real, size, out=np.full(len(size), np.nan), where=size > 0.0) + 0.0

    @property
    def unstable(self) -> np.ndarray:
        """(n,) bool: flutter or divergence."""
        return np.isin(self.kind, ("flutter", "divergence"))

    @property
    def geometry(self) -> Any:
        """Bodies and joints to draw, from the model; None for plain matrices."""
        return getattr(self.system, "geometry", None)

    def group_of(self, mode: int) -> tuple[int, ...]:
        """Indices of the repeated group that a mode belongs to; the mode alone if there is none."""
        return next((g for g in self.groups if mode in g), (mode,))

    @cached_property
    def clusters(self) -> tuple[tuple[int, ...], ...]:
        """`groups`, widened by neighbours that agree to 1e-11 of |s|.

        A symmetry makes such roots equal and the rounding of positions and of closed loops parts them, so that how
        their shapes mix is arbitrary: derivatives treat them as one repeated eigenvalue.
        """
        joined: list[list[int]] = []
        group = {i: g for g in self.groups for i in g}
        for i in range(self.n):
            last = joined[-1][-1] if joined else None
            if last is not None and (group.get(i) == group.get(last, ()) or self._same(last, i)):
                joined[-1].append(i)
            else:
                joined.append([i])
        return tuple(tuple(c) for c in joined if len(c) > 1)

    def _same(self, i: int, j: int) -> bool:
        if "rigid" in (self.kind[i], self.kind[j]) or self.near_defective[i] or self.near_defective[j]:
            return False
        return abs(self.eigenvalue[i] - self.eigenvalue[j]) <= _SAME * abs(self.eigenvalue[j])

    def body_shape(self, body: Any) -> np.ndarray:
        """Motion of a body's origin, (6, n) complex: x y z rx ry rz in world axes, m and rad.

        Parameters
        ----------
        body
            Handle or name.

        Raises
        ------
        NameNotFoundError
            A name that the model does not have; modes of plain matrices have no bodies.
        """
        names, maps = self._bodies()
        motion = getattr(self.system, "body_motion", None)
        name = getattr(body, "name", body)
        if name not in names:
            known = ", ".join(names) if names else "none: these are modes of plain matrices"
            raise NameNotFoundError(f"there is no body {name!r}; bodies: {known}")
        i = names.index(name)
        if motion is not None:
            return np.asarray(motion(i), dtype=complex)
        return np.asarray(maps[6 * i : 6 * i + 6] @ self.shape, dtype=complex)

    def mac(self, other: Any, *, weight: Any = None) -> np.ndarray:
        """MAC of these shapes with those of another result, (n, n_other); see `mbrs.mac`."""
        return _mac(self, other, weight=weight)

    @cached_property
    def _energy(self) -> EnergyShares:
        return energy_shares(self)

    def energy(self) -> EnergyShares:
        """Shares of kinetic and strain energy of each coordinate, body and element; see `EnergyShares`."""
        return self._energy

    def _bodies(self) -> tuple[tuple[str, ...], Any]:
        return tuple(getattr(self.system, "bodies", ())), getattr(self.system, "T", None)

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table that `print` shows."""
        columns = ["mode", "f_n [Hz]", "f_d [Hz]", "zeta", "kind", "group", "dominant", "residual"]
        dominant = _dominant(self)
        damping = [without_rounding(d, 1.0, e) for d, e in zip(self.damping, self.error, strict=True)]
        names = {i: k + 1 for k, g in enumerate(self.groups) for i in g}
        return columns, [
            [
                i + 1,
                float(self.frequency[i]),
                float(self.frequency_damped[i]),
                float(damping[i]),
                str(self.kind[i]) + ("*" if self.near_defective[i] else ""),
                names.get(i, ""),
                dominant[i],
                number(float(self.backward_error[i]), 2),
            ]
            for i in range(self.n)
        ]

    def heading(self) -> str:
        dof = len(self.coordinates)
        of = "" if self.n == dof else f" of {dof}"
        return f"{self.n}{of} modes, {self.stats.route}, {self.status}"

    def notes(self) -> list[str]:
        notes = []
        if self.stats.route not in ("undamped", "proportional") or np.any(self.kind == "overdamped"):
            notes.append("f_n = |s|/2pi is the undamped natural frequency only for underdamped proportional damping.")
        if np.any(self.near_defective):
            notes.append("* near-defective: two roots almost meet (critical damping).")
        return notes

    def plot(self, *, ax: Any = None, **options: Any) -> Any:
        """Poles, and without ``ax`` how much each coordinate moves (`mbrs.plot.modes`); returns the figure."""
        from .plot import modes as draw

        return draw(self, ax=ax, **options)

    def animate(self, path: str | Path | None = None, **options: Any) -> Any:
        """Shapes in motion as one self-contained page (`mbrs.animate.modes`); returns the path, or a viewer."""
        from .animate import modes as draw  # type: ignore[import-not-found,unused-ignore]

        return draw(self, path, **options)


def modes(
    m: Any,
    *,
    at: Any = None,
    n: int | None = None,
    without: Iterable[str] = (),
    stiffness_factor: Any = None,
    shift: float | None = None,
) -> ModalResult:
    """Modes: all solutions of (s^2 M + s (C + G) + K + N) phi = 0.

    Parameters
    ----------
    m
        A `Model`, or a `MechanicalSystem` (dense or sparse).
    at
        State to linearise a model at: None (the drawn state), an equilibrium, a steady motion, ``traj.state(t)``.
    n
        How many of the lowest modes to return; None returns all, one for each degree of freedom.
    shift
        Hz. The ``n`` modes whose squared frequencies lie nearest to its square, in place of the lowest; ``n`` is then needed.
        Sparse routes solve there (symmetric systems only), and inertia counts prove that none is missing.
    without
        Effects to leave out. Plain matrices know "damping" (C), "gyroscopic" (G) and "circulatory" (N).
    stiffness_factor
        (any, dof) matrix F with K = F^T F, such as sqrt(k) times the rows of relative displacement. It keeps low
        frequencies accurate where a stiffness ratio beyond 1e8 would drown them in the rounding of an assembled K;
        used for undamped and proportionally damped systems.

    Returns
    -------
    ModalResult
        In ascending |s|; normalisation there.

    Raises
    ------
    SingularError
        M is not positive definite; the message names the coordinate without inertia.
    ModelError
        Matrices that are not symmetric (M, C, K) or skew (G, N), not finite, or of different sizes; ``n`` out of range; a
        shift without ``n``, negative, or for a large damped system.

    Notes
    -----
    Without damping, or with damping that the undamped modes diagonalise, one symmetric eigenproblem and scalar
    quadratics; where a bound from all residuals says that digits are lost (very different stiffnesses or masses), singular
    values of a factor of K by Jacobi's method, and residuals in twice the precision. A model hands over the factor of its
    own elements where assembling them has lost digits; geometry then decides which modes are rigid. Conservative gyroscopic
    systems one Hermitian eigenproblem; all else the balanced state matrix in energy coordinates, which have the scaling of
    Fan, Lin and Van Dooren built in, with Rayleigh corrections of all roots and Newton corrections of the pairs whose
    backward error exceeds max(dof, 16) eps or whose vectors may be wrong. Cost O(dof^3).

    Examples
    --------
    >>> import mbrs as mb
    >>> system = mb.MechanicalSystem(M=[[1.0, 0.0], [0.0, 1.0]], C=None, K=[[2.0, -1.0], [-1.0, 2.0]])
    >>> mb.modes(system).omega.round(6).tolist()
    [1.0, 1.732051]
    """
    start = time.perf_counter()
    if isinstance(without, str):
        without = (without,)
    shift = _shift(shift, n)
    if _is_large_model(m, n) and not _has_state_rates(m):
        if stiffness_factor is not None:
            raise ModelError("stiffness_factor= belongs to matrices; a model knows its own")
        from .sparse_modal import model_modes

        found = model_modes(m, at, _positive(n), tuple(without), start, shift)
        if found is not None:
            return found
    system, effects = _second_order(m, at, tuple(without))
    n = _count(n, len(system.coordinates))
    if getattr(system, "is_sparse", False):
        return _sparse(system, n, effects, shift, start)
    return _dense(system, n, effects, stiffness_factor, shift, start)


def _second_order(m: Any, at: Any, without: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    if not isinstance(m, MechanicalSystem):
        from .linearize import second_order_of  # type: ignore[import-not-found,unused-ignore]

        system = second_order_of(m, at, without)
        return system, tuple(getattr(system, "effects", ()))
    if at is not None:
        raise ModelError("at= is the state to linearise a model at; a MechanicalSystem is linear already, leave it out")
    for name in without:
        if name not in _MATRIX_EFFECTS:
            known = ", ".join(_MATRIX_EFFECTS)
            raise ModelError(f"without={name!r}: the effects of a MechanicalSystem are {known}")
    drop = {_MATRIX_EFFECTS[name] for name in without}
    if drop:
        parts = {a: None if a in drop else getattr(m, a) for a in ("M", "C", "K", "G", "N")}
        m = MechanicalSystem(**parts, elements=m.elements, coordinates=m.coordinates)
    return m, tuple(name for name, a in _MATRIX_EFFECTS.items() if getattr(m, a) is not None)


def _has_state_rates(m: Any) -> bool:
    """Has a model laws whose states have rates? Only the dense route knows those that relax."""
    return any(LAW_OF_CODE[law.code].state == "rate" for laws in m.laws.values() for law in laws)


def _is_large_model(m: Any, n: Any) -> bool:
    if n is None or not isinstance(m, Book):
        return False
    from .sparse_modal import is_large

    return is_large(m, _positive(n))


def _count(n: int | None, dof: int) -> int | None:
    return None if n is None else min(_positive(n), dof)


def _positive(n: Any) -> int:
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
        raise ModelError(f"n must be a positive number of modes, got {n!r}")
    return int(n)


def _shift(shift: Any, n: int | None) -> float | None:
    if shift is None:
        return None
    if isinstance(shift, bool) or not isinstance(shift, int | float | np.number) or not 0.0 <= shift < math.inf:
        raise ModelError(f"shift must be a frequency in Hz, zero or positive, got {shift!r}")
    if n is None:
        raise ModelError("shift= asks for the modes nearest to a frequency: say how many with n=")
    return float(shift)


def _nearest(r: dict[str, Any], n: int, shift: float) -> dict[str, Any]:
    """All results with the n modes nearest to a frequency first, in ascending order."""
    distance = np.abs(np.abs(r["eigenvalue"]) ** 2 - (2.0 * math.pi * shift) ** 2)
    near = np.argsort(distance, kind="stable")
    order = np.concatenate([np.sort(near[:n]), np.sort(near[n:])])
    place = np.argsort(order)
    out = dict(r)
    for key in ("eigenvalue", "partner", "backward_error", "condition", "error", "near_defective", "kind"):
        out[key] = np.asarray(r[key])[order]
    for key in ("shape", "left"):
        out[key] = None if r[key] is None else r[key][:, order]
    out["partner_mode"] = place[r["partner_mode"]]
    # members stay neighbours, except where the choice has cut a group
    out["groups"] = [(int(np.min(place[a : a + count])), count) for a, count in r["groups"]]
    return out


def _sparse(system: Any, n: int | None, effects: tuple[str, ...], shift: float | None, start: float) -> ModalResult:
    from . import _core

    if not hasattr(_core, "sparse_modes"):
        raise ModelError("modes of sparse matrices are not available in this build; pass dense arrays (M.toarray())")
    from .sparse_modal import sparse_modes  # type: ignore[import-not-found,unused-ignore]

    return sparse_modes(system, n, effects, shift, start)


def _dense(
    system: Any, n: int | None, effects: tuple[str, ...], factor: Any, shift: float | None, start: float
) -> ModalResult:
    from . import _core

    f = None if factor is None else _matrix("stiffness_factor", factor)
    mass, stiffness = np.asarray(_array(system.M)), np.asarray(_array(system.K))
    damping, gyroscopic, circulatory = (_array(getattr(system, a)) for a in "CGN")
    relaxation = relaxation_of(system)
    if relaxation is not None:
        with core_errors():
            r = relaxing_modes(system, relaxation, (damping, gyroscopic), (stiffness, circulatory))
        return _result(system, r if shift is None or n is None else _nearest(r, n, shift), n, effects, start)
    try:
        with core_errors(), while_long(f"modes of {len(mass)} coordinates", 100.0 * len(mass) ** 3):
            r = _core.dense_modes(mass, damping, gyroscopic, stiffness, circulatory, f)
            mf = None
            if r["mass_pivot"] < _LIGHTEST and hasattr(system, "mass_factor"):
                mf = system.mass_factor
                r = _core.dense_modes(mass, damping, gyroscopic, stiffness, circulatory, f, mf)
            f = _factor_for(system, r) if f is None else None
            if f is not None:
                r = _core.dense_modes(mass, damping, gyroscopic, stiffness, circulatory, f, mf)
    except SingularError as problem:
        names = tuple(system.coordinates)
        text = re.sub(r"\{coordinate (\d+)\}", lambda hit: f"coordinate {names[int(hit[1])]!r}", str(problem))
        raise SingularError(text) from None
    if shift is not None and n is not None:
        r = _nearest(r, n, shift)
    return _result(system, r, n, effects, start)


def _factor_for(system: Any, r: dict[str, Any]) -> np.ndarray | None:
    """A model's own factor of K, where assembled matrices have lost digits of soft modes or hide them among the rigid ones."""
    if r["route"] not in ("undamped", "proportional") or not hasattr(system, "snapshot"):
        return None
    rigid = np.array(r["kind"]) == "rigid"
    blurred = not np.all(r["error"][~rigid] <= _GRADED)
    if not blurred and not np.any(rigid):
        return None
    factor = stiffness_factor(system)
    if factor is None or not (blurred or is_strained(factor, r["shape"][:, rigid].real, system.M)):
        return None
    return factor


def _status(r: dict[str, Any], n: int) -> str:
    """A nan is never good enough; the error of a rigid mode is a frequency, not a share."""
    elastic = np.array(r["kind"][:n]) != "rigid"
    good = np.all(r["backward_error"][:n] <= _UNRESOLVED) and np.all(r["error"][:n][elastic] <= _DOUBTFUL)
    return "converged" if good and np.all(np.isfinite(r["shape"][:, :n])) else "unresolved"


def _result(system: Any, r: dict[str, Any], n: int | None, effects: tuple[str, ...], start: float) -> ModalResult:
    n = len(r["eigenvalue"]) if n is None else n
    shape = r["shape"][:, :n]
    if not np.any(shape.imag):
        shape = np.ascontiguousarray(shape.real)
    groups = [tuple(i for i in range(first, first + count) if i < n) for first, count in r["groups"]]
    own = r["partner_mode"] < n
    roots = np.stack([r["eigenvalue"], r["partner"]], axis=1).ravel()
    left, partner_left = r["left"], r["partner_left"]
    return ModalResult(
        eigenvalue=r["eigenvalue"][:n],
        roots=roots[~np.isnan(roots)],
        shape=shape,
        left=None if left is None else left[:, :n],
        kind=np.array(r["kind"][:n], dtype="U10"),
        groups=tuple(g for g in groups if len(g) > 1),
        backward_error=r["backward_error"][:n],
        condition=r["condition"][:n],
        near_defective=r["near_defective"][:n],
        coordinates=tuple(system.coordinates),
        system=system,
        partner_mode=r["partner_mode"][own],
        partner_shape=r["partner_shape"][:, own],
        partner_left=None if partner_left is None else partner_left[:, own],
        cut_group=next((tuple(range(a, n)) for a, count in r["groups"] if a < n < a + count), ()),
        stats=Stats(time.perf_counter() - start, added_counts(system, r["counts"]), effects, r["route"]),
        error=r["error"][:n],
        status=_status(r, n),
    )


def _array(a: Any) -> np.ndarray | None:
    if a is None:
        return None
    return np.asarray(a.toarray() if hasattr(a, "toarray") else a, dtype=float)


def _matrix(name: str, a: Any) -> np.ndarray:
    try:
        f = _array(a)
    except (TypeError, ValueError) as problem:
        raise ModelError(f"{name} must be a real matrix: {problem}") from None
    if f is None or f.ndim != 2 or f.size == 0:
        raise ModelError(f"{name} must be a matrix with one column for each coordinate")
    return f


def _dominant(r: ModalResult) -> list[str]:
    """The body, or else the coordinate, with the largest share of the kinetic energy."""
    shares = r.energy()
    names, values = (
        (shares.coordinates, shares.kinetic) if shares.kinetic_body is None else (shares.bodies, shares.kinetic_body)
    )
    # the first among equals, whatever rounding says
    return [names[int(np.argmax(v >= v.max() - 1e-9))] for v in values.T]
