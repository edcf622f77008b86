"""The lowest modes of large systems: sparse matrices, and models with thousands of bodies."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.progress import Elapsed
from .._lib.warning import warn_user
from ..errors import ConvergenceError, ModelError, RouteError
from ..results import Stats
from ..system.effects import check_without, effects
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .linearize import BALANCED
from .modal_result import ModalResult, modal_result

# The dense route costs dof^3, the sparse one some hundred factorisations' worth of dof: from here on it wins.
_LARGE = 400
# What the sparse route does not know goes to the dense one as long as that takes minutes, not hours.
_DENSE_AT_MOST = 4000
_PART = 10
# Largest damped system that is taken from the dense route where the sparse one does not converge. Larger: minutes of work after a
# failure. Smaller: failures that need not be.
DENSE_INSTEAD = 1500
_CROWDED = "reduce the matrices, for instance to the modes without damping"
# Relative error of an eigenvalue above which a sparse result is not called converged. Larger: roots with few digits pass. Smaller: soft
# modes of stiff assembled matrices, and roots beside others, do not.
_UNRESOLVED = 1e-8
# Neighbouring roots this near (relative) are one repeated root. Too small: members of a group split by rounding. Too large: near roots
# lose their own shapes. Pinned by tests/truth/test_crowded_modes.py.
_SAME_ROOT = 1e-9
# Rounding of an entry of C = a M + b K over the sizes of its terms. Too small: proportional damping takes the general route, which
# is slower. Too large: damping that is not proportional is called so; the error of roots would show it.
# Pinned by tests/truth/test_crowded_modes.py.
_PROPORTIONAL = 1e-12
# Components of a shape this near to the largest (relative) are equal to it: the first of them is positive. Larger: a smaller one
# decides; smaller: rounding decides, and the sign changes with the order of the rows.
_AS_LARGE = 1e-6
# 1 - cos^2 of the angle between M and K below which they are multiples of each other, and one is enough. Larger: true sums are
# refused; smaller: coefficients are rounding.
_ONE_DIRECTION = 1e-6
# Growth over |s| that is rounding where there is damping. Larger: weak flutter is called stable; smaller: rounding is called flutter.
_GROWS = 1e-12
# What each matrix is across its diagonal.
_SIGNS = {"M": 1.0, "C": 1.0, "G": -1.0, "K": 1.0, "N": -1.0}


def is_large(model: Any, n: int | None) -> bool:
    """True if modes of a model take the sparse route: few modes of many coordinates."""
    if n is None or len(model.bodies) == 0:
        return False
    from ..system.compiled import compiled

    with core_errors():
        n_tree = compiled(model).n_tree
    return bool(n_tree > _LARGE and n * _PART < n_tree)


@dataclass(frozen=True, eq=False)
class SparseModel:
    """Model of sparse modes: names, and the motion of all bodies; its matrices are made when asked for.

    Attributes
    ----------
    coordinates, bodies
        Names of the minimal coordinates, and of the bodies with the nodes of flexible ones.
    motion
        (6 n_bodies, n) motion of the centres of mass in each mode, world axes.
    absolute
        (n_absolute, n) the modes over the coordinates of `form`: those of all bodies, then those of shapes.
    arm
        (n_bodies, 3) from the centres of mass to the origins.
    """

    coordinates: tuple[str, ...]
    bodies: tuple[str, ...]
    motion: np.ndarray
    absolute: np.ndarray
    arm: np.ndarray
    state: State
    without: tuple[str, ...]
    snapshot: Snapshot

    @property
    def model(self) -> Any:
        """The model."""
        return self.snapshot.model

    @cached_property
    def poses(self) -> dict[str, np.ndarray]:
        """Position (n, 3) and rotation (n, 3, 3) of the bodies' origins, world."""
        with core_errors():
            return dict(self.snapshot.system.bodies(self.state.q, self.state.rate))

    @property
    def geometry(self) -> Any:
        """Bodies, springs and joints to draw, at this state."""
        from ..model.scene import scene_from_tables
        from ..model.tables import tables

        return scene_from_tables(tables(self.model), self.model).moved(self.poses["position"], self.poses["rotation"])

    def body_motion(self, body: int) -> np.ndarray:
        """(6, n) motion of a body's origin, world axes."""
        x = self.motion[6 * body : 6 * body + 6]
        return np.vstack([x[:3] + np.cross(x[3:], self.arm[body], axis=0), x[3:]])

    @cached_property
    def form(self) -> dict[str, Any]:
        """Sparse matrices in absolute coordinates (centres of mass, world axes): see `matrices`."""
        with core_errors():
            state = self.state
            return _core.sparse_model_form(
                self.snapshot.system, state.q, state.rate, state.acceleration.tolist(), list(self.without)
            )

    def energy(self) -> tuple[np.ndarray, tuple[str, ...], np.ndarray]:
        """Kinetic energy of each body (n_bodies, n); names of the elastic elements and the strain energy of each."""
        from scipy.sparse import coo_array

        x, body = self.absolute, self.form["body"]
        i, j, v = self.form["mass"]
        kinetic = np.zeros((len(self.bodies), x.shape[1]))
        own = body[i] == body[j]
        np.add.at(kinetic, body[i[own]], (x[i[own]].conj() * x[j[own]]).real * v[own, None])
        i, j, v = self.form["rows"]
        compliance, owner = self.form["compliance"], self.form["connector"]
        stretch = coo_array((v, (i, j)), shape=(len(compliance), len(x))).tocsr() @ x
        elastic = owner >= 0
        energy = np.zeros((len(self.form["names"]), x.shape[1]))
        np.add.at(energy, owner[elastic], np.abs(stretch[elastic]) ** 2 / compliance[elastic][:, None])
        return kinetic, tuple(self.form["names"]), energy


def model_modes(
    model: Any, at: Any, n: int, without: Any, start: float, shift: float | None = None
) -> ModalResult | None:
    """The n lowest modes of a model, or those nearest to a frequency; None where the dense route must take over and can."""
    without = check_without(without)
    snapshot = Snapshot.of(model)
    state = state_of(model, snapshot.system, at)
    if state.orbit is not None:
        return None
    try:
        with core_errors(), Elapsed(f"lowest {n} modes of {model.name!r}"):
            if state.turn is not None:
                raise RouteError(
                    "the sparse route of large models knows no steady motions whose axes turn: mb.modes(m) without n= takes the dense route"
                )
            r = _core.sparse_model_modes(
                snapshot.system, state.q, state.rate, state.acceleration.tolist(), list(without), n, _sigma(shift)
            )
    except (RouteError, ConvergenceError):
        if snapshot.system.n_tree > _DENSE_AT_MOST:
            raise
        return None
    if at is None and not state.moving and r["unbalanced"] > BALANCED:
        warn_user(
            f"the drawn state of {model.name!r} is not in balance: at {r['worst']!r} "
            f"{r['unbalanced']:.1e} of all forces is "
            "unbalanced; take the modes at an equilibrium instead"
        )
    count = r["shape"].shape[1]
    if not np.any(r["body"].imag):
        r["body"], r["motion"] = r["body"].real.copy(), r["motion"].real.copy()
    _sign(r)
    # with the nodes of flexible bodies
    names = tuple(snapshot.tables["body_name"])
    system = SparseModel(tuple(r["coordinates"]), names, r["body"], r["motion"], r["arm"], state, without, snapshot)
    on = tuple(e for e in effects(model).on if e not in without)
    r["backward_error"] = r["residual"]
    # the small problem behind the modes has no shapes of coordinates for partners
    r["partner_shape"] = np.zeros((len(r["coordinates"]), 0))
    r["route"] = f"sparse, {r['route']} ({r['verified']})"
    found = modal_result(system, r, count, on, start)
    unresolved = r["verified"] == "unverified" or not np.all(found.error[found.kind != "rigid"] <= _UNRESOLVED)
    return found.replaced(status="unresolved" if unresolved else "converged")


def _sign(r: dict[str, Any]) -> None:
    """The largest component of each shape has a positive real part."""
    size = np.abs(r["shape"])
    first = np.argmax(size >= (1.0 - _AS_LARGE) * size.max(axis=0), axis=0)
    flip = np.where(r["shape"][first, np.arange(size.shape[1])].real < 0.0, -1.0, 1.0)
    r["shape"] = r["shape"] * flip
    r["body"], r["motion"] = r["body"] * flip, r["motion"] * flip


def _sigma(shift: float | None) -> float | None:
    """(2 pi f)^2: where the spectrum of K x = lambda M x is wanted."""
    return None if shift is None else (2.0 * np.pi * shift) ** 2


def _symmetric_parts(system: Any) -> list[Any]:
    """Sparse M, C, G, K, N without the rounding of their symmetry; the error names entries that are more."""
    parts: list[Any] = []
    for name, sign in _SIGNS.items():
        matrix = getattr(system, name)
        if matrix is None:
            parts.append(None)
            continue
        gap = (matrix - sign * matrix.T).tocoo()
        size = abs(matrix).max() if matrix.nnz else 0.0
        if gap.nnz:
            worst = int(np.argmax(np.abs(gap.data)))
            i, j = sorted((int(gap.row[worst]), int(gap.col[worst])))
            with core_errors():
                _core.check_symmetry(name, float(abs(gap.data[worst]) / size), i, j)
        parts.append(matrix if gap.nnz == 0 else (0.5 * (matrix + sign * matrix.T)).tocsr())
    return parts


def _proportional(M: Any, C: Any, K: Any) -> tuple[float, float] | None:
    """a and b of C = a M + b K, by least squares; None where an entry differs by more than rounding of its terms."""
    if C.nnz == 0:
        return None
    mm, mk, kk = (float(x.multiply(y).sum()) for x, y in ((M, M), (M, K), (K, K)))
    mc, kc = (float(x.multiply(C).sum()) for x in (M, K))
    determinant = mm * kk - mk * mk
    candidates = [(mc / mm, 0.0), (0.0, kc / kk if kk > 0.0 else 0.0)]
    # where M and K are nearly multiples of each other one of them is enough
    if determinant > _ONE_DIRECTION * mm * kk:
        candidates.append(((kk * mc - mk * kc) / determinant, (mm * kc - mk * mc) / determinant))
    return next((pair for pair in candidates if _is_sum(M, C, K, *pair)), None)


def _is_sum(M: Any, C: Any, K: Any, a: float, b: float) -> bool:
    """True if every entry of C is a M + b K but for rounding of its terms."""
    rest = abs(C - a * M - b * K) - _PROPORTIONAL * (abs(a) * abs(M) + abs(b) * abs(K) + abs(C))
    return bool(rest.max() <= 0.0)


def _with_damping(r: dict[str, Any], a: float, b: float) -> dict[str, Any]:
    """Roots of s^2 + (a + b lambda) s + lambda = 0 for the modes without damping; of two real ones the lower is the partner."""
    lam = r.pop("lambda")
    half = 0.5 * (a + b * lam)
    square = half**2 - lam
    root = np.sqrt(np.abs(square))
    far = -half - np.where(half >= 0.0, root, -root)
    near = np.divide(lam, far, out=np.zeros_like(far), where=far != 0.0)  # no digits cancel
    real = square >= 0.0
    r["eigenvalue"] = np.where(real, np.maximum(near, far), -half + 1j * root)
    r["partner"] = np.where(real, np.minimum(near, far), -half - 1j * root)
    s = r["eigenvalue"]
    slope = np.abs(s * (2.0 * s + a + b * lam))
    change = np.divide(np.abs((1.0 + b * s) * lam) * r["error"], slope, out=np.full(len(s), np.inf), where=slope > 0.0)
    r["error"] = np.where(s == 0.0, np.sqrt(r["error"]), np.maximum(change, np.finfo(float).eps))
    r["route"] += ", proportional damping"
    return r


def sparse_modes(
    system: Any, n: int | None, effects: tuple[str, ...], shift: float | None, start: float
) -> ModalResult:
    """The n lowest modes of sparse matrices, or those nearest to a frequency."""
    if n is None:
        raise ModelError(
            "modes of sparse matrices need n=, the number of the lowest modes, such as mb.modes(system, n=20)"
        )
    M, C, G, K, N = _symmetric_parts(system)
    D, S = _sum(C, G), _sum(K, N)
    proportional = None if C is None or G is not None or N is not None else _proportional(M, C, K)
    with core_errors(), Elapsed(f"lowest {n} modes of {system.M.shape[0]} coordinates"):
        if proportional is not None:
            r = _with_damping(_core.sparse_modes(_arrays(M), None, _arrays(K), n, _sigma(shift)), *proportional)
        else:
            r = _lowest(M, D, S, n, _sigma(shift), symmetric=G is None and N is None)
    damped = "eigenvalue" in r
    s, partner = (r["eigenvalue"], r["partner"]) if damped else _roots_of_squares(r["lambda"])
    shape = r["shape"]
    route = f"{r['route']} ({r['verified']})" if "verified" in r else r["route"]
    # of lambda = -s^2, so half of it for s; of a rigid mode the blur around zero, as a frequency
    error = r["error"] if damped else np.where(s == 0.0, np.sqrt(r["error"]), 0.5 * r["error"])
    unresolved = r.get("verified") == "unverified" or not np.all(error[s != 0.0] <= _UNRESOLVED)
    groups = _groups(s)
    return ModalResult(
        eigenvalue=s,
        roots=np.stack([s, partner], axis=1).ravel(),
        shape=shape,
        left=None,
        kind=_kinds(s, damped),
        groups=groups,
        backward_error=r["residual"],
        condition=np.full(len(s), np.nan),
        near_defective=np.zeros(len(s), dtype=bool),
        coordinates=tuple(system.coordinates),
        system=system,
        partner_mode=np.zeros(0, dtype=np.int64),
        partner_shape=np.zeros((shape.shape[0], 0)),
        partner_left=None,
        stats=Stats(time.perf_counter() - start, r["counts"], effects, route),
        error=error,
        status="unresolved" if unresolved else "converged",
        cut_group=() if damped or shift is not None else _cut_group(M, K, r["lambda"], groups),
    )


def _roots_of_squares(lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both roots of s^2 = -lam: a pair of imaginary ones, or of real ones of which the first grows."""
    root = np.sqrt(np.abs(lam))
    return np.where(lam >= 0.0, 1j * root, root), np.where(lam >= 0.0, -1j * root, -root)


def _kinds(s: np.ndarray, damped: bool) -> np.ndarray:
    """The kind of each motion exp(s t); with damping a growth below rounding does not count."""
    kind = np.full(len(s), "vibration", dtype="U10")
    kind[(s.imag == 0.0) & (s.real < 0.0)] = "overdamped"
    kind[(s.imag == 0.0) & (s.real > 0.0)] = "divergence"
    noise = _GROWS * np.abs(s) if damped else 0.0
    kind[(s.imag != 0.0) & (s.real > noise)] = "flutter"
    kind[s == 0.0] = "rigid"
    return kind


def _cut_group(M: Any, K: Any, lam: np.ndarray, groups: tuple[tuple[int, ...], ...]) -> tuple[int, ...]:
    """Indices of the last group where more eigenvalues than those found lie within its blur: one inertia count tells."""
    n = len(lam)
    if n == M.shape[0] or not lam[-1] > 0.0:
        return ()
    with core_errors():
        below = _core.sparse_count(_arrays(M), _arrays(K), lam[-1] * (1.0 + 2.0 * _SAME_ROOT))
    if below is None or below <= n:
        return ()
    return groups[-1] if groups and groups[-1][-1] == n - 1 else (n - 1,)


def _lowest(M: Any, D: Any, S: Any, n: int, sigma: float | None, symmetric: bool) -> dict[str, Any]:
    """The core's answer with n modes; of two real roots that make one overdamped mode the lower is its partner."""
    arrays = _arrays(M), None if D is None else _arrays(D), _arrays(S)
    wanted, dof = n, M.shape[0]
    while True:
        if sigma is not None and not (symmetric and (D is None or D.count_nonzero() == 0)):
            raise ModelError("shift= of a sparse system needs symmetric matrices without damping; leave it out")
        try:
            with core_errors():
                r = _core.sparse_modes(*arrays, wanted, sigma)
        except ConvergenceError as problem:
            if symmetric and (D is None or D.count_nonzero() == 0):
                raise
            raise ConvergenceError(f"{problem}; {_CROWDED}", problem.result) from None
        if "eigenvalue" not in r:
            return r
        s = r["eigenvalue"]
        r["partner"] = np.where(s.imag != 0.0, s.conj(), np.nan)
        if not symmetric:
            return r
        lower = _lower(M, D, s, r["shape"])
        upper = np.flatnonzero(~lower)
        if len(upper) >= n or wanted >= dof:
            return _paired(r, upper[:n], np.flatnonzero(lower))
        wanted = min(wanted + n - len(upper), dof)


def _lower(M: Any, D: Any, s: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Real roots with x^T Q'(s) x < 0: the lower ones of every scalar quadratic."""
    lower = np.zeros(len(s), dtype=bool)
    for i in np.flatnonzero((s.imag == 0.0) & (s != 0.0)):
        v = x[:, i].real
        lower[i] = 2.0 * s[i].real * (v @ (M @ v)) + v @ (D @ v) < 0.0
    return lower


def _paired(r: dict[str, Any], upper: np.ndarray, lower: np.ndarray) -> dict[str, Any]:
    """Each upper real root takes the lower one with the most similar shape; nan where that lies beyond what was computed."""
    s, x = r["eigenvalue"], r["shape"]
    unit = x / np.linalg.norm(x, axis=0)
    free = list(lower)
    for i in upper[(s[upper].imag == 0.0) & (len(lower) > 0)]:
        likeness = np.abs(unit[:, free].conj().T @ unit[:, i]) if free else np.zeros(0)
        if likeness.size and likeness.max() > 0.5:
            r["partner"][i] = s[free.pop(int(np.argmax(likeness)))]
    for key in ("eigenvalue", "partner", "residual", "error"):
        r[key] = r[key][upper]
    r["shape"] = x[:, upper]
    return r


def _groups(s: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """Neighbours that agree: members of one repeated eigenvalue."""
    groups: list[list[int]] = []
    for i, value in enumerate(s):
        if groups and abs(value - s[groups[-1][-1]]) <= _SAME_ROOT * abs(value):
            groups[-1].append(i)
        else:
            groups.append([i])
    return tuple(tuple(g) for g in groups if len(g) > 1)


def _sum(a: Any, b: Any) -> Any:
    if a is None:
        return b
    return a if b is None else a + b


def _arrays(a: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    from scipy.sparse import csc_array

    c = csc_array(a)
    c.sum_duplicates()
    return c.indptr.astype(np.int64), c.indices.astype(np.int64), c.data.astype(float)
