"""Modes as a result: frequencies, damping, shapes, groups of equal roots, energies."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.text import counted, number, without_rounding
from ..errors import NameNotFoundError, RouteError
from ..model.flexible import FlexibleBody
from ..model.names import index
from ..results import FIXED_LABELS, Late, Result, Stats, added_counts, derived, quantity, result
from .energy_shares import EnergyShares, energy_shares
from .mac import mac as _mac

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..model.aliases import BodyLike
    from ..plot.protocols import HasModes
    from ..view.modes import Viewer
    from ..view.scene import SceneGeometry

TWIST = FIXED_LABELS["component"]
KINDS = ("rigid", "vibration", "overdamped", "flutter", "divergence")

# Backward error of an eigenvalue above which a result is not called converged. Larger: wrong roots of well-conditioned matrices pass.
# Smaller: rounding of large ones does not.
_UNRESOLVED = 1e-9
# Relative error of an eigenvalue above which a result is not called converged. Too small: critical damping and defects, which have no
# more digits than these, count as failures. Too large: wrong digits pass. Pinned by tests/truth/test_graded_modes.py.
_DOUBTFUL = 1e-4
# Shares of energy that differ by less of the largest are equal. Larger: a mode is named after what holds less. Smaller: rounding names it.
_EQUAL = 1e-9


@result
class ModalResult(Result):
    """Modes of (s^2 M + s (C + G) + K + N) phi = 0, in ascending |s|; equal |s| in ascending damping ratio.

    ``stats.route`` names the algorithm. ``error`` (n,) estimates the relative error of each eigenvalue: that of the algorithm
    and, for undamped and proportionally damped systems, that of the data, which is what rounding of the entries of K and M (or
    of their factors), made before they were given, can do to it; of models also what rounding of the places that they are drawn at
    does. For rigid modes it is the frequency (rad/s) that this rounding
    hides. What the meshes and shapes of flexible bodies leave open is not in it: `discretisation` estimates that.
    ``status`` is "unresolved" unless every backward error is at most 1e-9 and every error at most 1e-4.

    Attributes
    ----------
    eigenvalue
        (n,) complex, rad/s: of a complex pair the root with Im > 0, of two real roots the larger one; 0 for rigid
        modes.
    roots
        (2 dof,) complex: for every mode, also those that ``n=`` cut off, the root above and its partner; a relaxation has none. Real
        roots of symmetric systems are matched so that each mode has one root with phi^T Q'(s) phi > 0 and one with < 0, whose
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
    shift
        Hz, to which the modes are the nearest; None for the lowest ones.
    discretisation
        (n,) estimated relative error of each frequency by the meshes and shapes of the model's flexible bodies, which ``error`` does
        not hold: how far it moves where elements are halved and shapes more than doubled. nan for rigid modes, 0 without flexible
        bodies. Computed when it is first read, at about the cost of finer beams and of their modes; None of results that a file held.
        `ModelError` for plain matrices, states that are neither drawn nor an equilibrium, and bodies that `mbrs.flexible.beam` did not
        make.
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
    shift: float | None = None
    discretisation: Any = field(default=Late("discretisation", None), kw_only=True, repr=False)

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {"mode": "numbers", "coordinate": "coordinates"}
    error_dims: ClassVar[tuple[str, ...]] = ("mode",)
    late: ClassVar[tuple[str, ...]] = ("error", "status", "discretisation")
    largest_error: ClassVar[float] = np.inf  # of rigid modes a frequency: what makes the modes judges them by kind

    def data_state(self) -> dict[str, Any]:
        state = super().data_state()
        if callable(state["discretisation"]):
            state["discretisation"] = None
        return state

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
        return np.asarray(np.abs(self.eigenvalue))

    @property
    @derived(dims=("mode",), unit="Hz", label="natural frequency")
    def frequency(self) -> np.ndarray:
        """(n,) |s|/2pi in Hz: the undamped natural frequency only for underdamped modes of proportional damping."""
        return np.asarray(np.abs(self.eigenvalue) / (2.0 * math.pi))

    @property
    @derived(dims=("mode",), unit="Hz", label="damped frequency")
    def frequency_damped(self) -> np.ndarray:
        """(n,) |Im s|/2pi in Hz: what one sees in a decaying vibration."""
        return np.asarray(np.abs(self.eigenvalue.imag) / (2.0 * math.pi))

    @property
    @derived(dims=("mode",), unit="1", label="damping ratio")
    def damping(self) -> np.ndarray:
        """(n,) damping ratio -Re s/|s|; 1 for overdamped modes, negative for unstable ones, nan for rigid ones."""
        size = np.abs(self.eigenvalue)
        return np.asarray(
            np.divide(-self.eigenvalue.real, size, out=np.full(len(size), np.nan), where=size > 0.0) + 0.0
        )

    @property
    def unstable(self) -> np.ndarray:
        """(n,) bool: flutter or divergence."""
        return np.isin(self.kind, ("flutter", "divergence"))

    @property
    def geometry(self) -> SceneGeometry | None:
        """Bodies and joints to draw, from the model; None for plain matrices."""
        found: SceneGeometry | None = getattr(self.system, "geometry", None)
        return found

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
        return bool(abs(self.eigenvalue[i] - self.eigenvalue[j]) <= _core.SAME_ROOT * abs(self.eigenvalue[j]))

    def body_shape(self, body: BodyLike) -> np.ndarray:
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
        if not names:
            raise NameNotFoundError("modes of plain matrices have no bodies; take modes of a Model")
        i = index("no body", body, names)
        if motion is not None:
            return np.asarray(motion(i), dtype=complex)
        return np.asarray(maps[6 * i : 6 * i + 6] @ self.shape, dtype=complex)

    def mac(self, other: ModalResult | ArrayLike, *, weight: ArrayLike | None = None) -> np.ndarray:
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
        meshes: Any = self.__dict__["discretisation"]
        known = self._flexible and meshes is not None and not callable(meshes)
        columns += ["meshes"] * known
        dominant = dominant_in(self)
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
                *([number(float(meshes[i]), 2)] if known else []),
            ]
            for i in range(self.n)
        ]

    def heading(self) -> str:
        dof = len(self.coordinates)
        found = f"{self.n} of {dof} modes" if self.n != dof else counted(self.n, "mode")
        return f"{found}, {self.stats.route}, {self.status}"

    def notes(self) -> list[str]:
        notes = []
        proportional = any(word in self.stats.route for word in ("undamped", "proportional"))
        if not proportional or np.any(self.kind == "overdamped"):
            notes.append("f_n = |s|/2pi is the undamped natural frequency only for underdamped proportional damping.")
        if np.any(self.near_defective):
            notes.append("* near-defective: two roots almost meet (critical damping).")
        if self._flexible:
            notes.append("The error of the meshes and shapes of flexible bodies is in .discretisation, not in .error.")
        return notes

    @property
    def _flexible(self) -> bool:
        bodies = getattr(getattr(self.system, "model", None), "bodies", ())
        return any(isinstance(b, FlexibleBody) for b in bodies)

    def plot(
        self,
        view: str = "poles",
        *,
        n: int | None = None,
        against: HasModes | tuple[ArrayLike, ArrayLike] | None = None,
        ax: Axes | None = None,
        label: str | None = None,
    ) -> Figure:
        """Poles, and without ``ax`` how much each coordinate moves; or, as ``plot("list", against=other)``, frequencies and damping
        ratios over the number of the mode, of two results beside each other (`mbrs.plot.modes`). Returns the figure.
        """
        from ..plot import modes as draw

        return draw(self, view, n=n, against=against, ax=ax, label=label)

    def animate(
        self,
        path: str | Path | None = None,
        *,
        n: int = 30,
        select: int | None = None,
        phase: float | None = None,
        title: str = "Modes",
    ) -> Path | Viewer:
        """Shapes in motion as one self-contained page (`mbrs.view.modes`); returns the path, or a viewer."""
        from ..view.modes import modes as draw

        return draw(self, path, n=n, select=select, phase=phase, title=title)


def _status(r: dict[str, Any], n: int) -> str:
    """A nan is never good enough; the error of a rigid mode is a frequency, not a share."""
    error = r["error"][:n]
    if "rigid" in r["kind"][:n]:
        error = error[np.array(r["kind"][:n]) != "rigid"]
    good = (r["backward_error"][:n] <= _UNRESOLVED).all() and (error <= _DOUBTFUL).all()
    return "converged" if good and np.isfinite(r["shape"][:, :n]).all() else "unresolved"


def modal_result(system: Any, r: dict[str, Any], n: int | None, effects: tuple[str, ...], start: float) -> ModalResult:
    """The modes that the core found for a system, the first n or all."""
    n = len(r["eigenvalue"]) if n is None else n
    shape = r["shape"][:, :n]
    if not shape.imag.any():
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


def refuse_sparse_model(system: Any, what: str) -> None:
    """The lowest modes of a large model have no matrices."""
    if type(system).__name__ == "SparseModel":
        raise RouteError(
            f"sensitivities of a {what} by sparse matrices, the lowest modes of a large model, are not available; leave n= out: "
            "all modes come from dense matrices and have them"
        )


def array_of(a: Any) -> np.ndarray | None:
    """A dense matrix of floats, or None where nothing acts."""
    if a is None:
        return None
    return np.asarray(a.toarray() if hasattr(a, "toarray") else a, dtype=float)


def dominant_in(r: ModalResult) -> list[str]:
    """The body, or else the coordinate, with the largest share of the kinetic energy, and the direction in which that body moves."""
    shares = r.energy()
    names, values = (
        (shares.coordinates, shares.kinetic) if shares.kinetic_body is None else (shares.bodies, shares.kinetic_body)
    )
    picks = [_first_largest(v) for v in values.T]
    if shares.kinetic_body is None or getattr(r.system, "body_mass_matrices", None) is None:
        return [names[i] for i in picks]
    return [f"{names[i]} {_direction(r, i, k)}".rstrip() for k, i in enumerate(picks)]


def _first_largest(values: np.ndarray) -> int:
    """The first among equals, whatever rounding says."""
    return int(np.argmax(values >= values.max() * (1.0 - _EQUAL)))


def _direction(r: ModalResult, body: int, mode: int) -> str:
    """The world axis along (or about) which a rigid body has most of its kinetic energy in a mode; "" of a flexible one."""
    name = r._bodies()[0][body]
    if any(coordinate.startswith(f"{name}.q") for coordinate in r.coordinates):
        return ""
    v = r.body_shape(name)[:, mode]
    energy = (v.conj() * (r.system.body_mass_matrices[body] @ v)).real
    return TWIST[_first_largest(energy)] if energy.max() > 0.0 else ""
