"""The linear part of harmonic balance: all coordinates, or condensed exactly onto those that the elements
touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from .._lib import checks
from ..errors import ModelError
from ..model.law import Law

FULL_UNKNOWNS = 6000
MODAL_COORDINATES = 1500
STABILITY_COORDINATES = 64  # as in the core: up to here it has the matrices themselves
WORTH_REDUCING = 16  # beyond, stability is cheaper by a reduced model
REDUCED_COORDINATES = 96
SHIFTS = 24
ROUTES = ("auto", "modal", "sparse")
NEGLIGIBLE_SHAPE = 1e-9
# lowest over highest squared frequency of what is condensed below which it moves as a rigid body and is kept, and damping between modes
# over its largest entry up to which modes decouple: larger, soft parts are kept and coupled ones are cut; smaller, rounding is condensed
LOOSE, COUPLED = 1e-11, 1e-12
WORTH_CONDENSING = 150
FULL = 4  # part of the entries of a matrix, one in so many, from which on it counts as full
# complex products (about 4 ns each) of all modes of a chain over n^2 and of other systems over n^3, and of one mode over the square of
# what is kept; evaluations of a curve of 60 to 100 points. Only speed depends on them.
CHAIN_MODES, ALL_MODES, MODE, EVALUATIONS = 20, 0.1, 2, 400
ROUGH = 1e-9  # relative rounding of the lowest eigenvalue from which on the sparse route, which is refined, is better


@dataclass(frozen=True)
class Linear:
    """The core's object, how it was made, M, C, K in its coordinates, and the orthogonal matrix T of x = T y where
    coordinates were changed."""

    core: Any
    route: str
    directions: tuple[np.ndarray, ...]
    transform: np.ndarray | None = None
    matrices: tuple[Any, Any, Any] | None = None

    def stability_model(self, top: float) -> tuple[np.ndarray, ...] | None:
        """M, C, K of a model of a large system for motions up to the frequency ``top`` (rad/s); None for small ones."""
        if self.matrices is None or self.matrices[0].shape[0] <= WORTH_REDUCING:
            return None
        return _reduced(self.matrices, np.asarray(self.core.retained), top)


def linear_part(
    system: Any, laws: Sequence[Law], forces: np.ndarray, n_c: int, condense: bool | str, turn: bool = True
) -> Linear:
    """``condense``: True, False, "modal", "sparse" or "auto", which condenses where the full equations are large. Without
    ``turn`` the coordinates stay what they are, whatever the laws touch."""
    if not isinstance(condense, bool | str) or (isinstance(condense, str) and condense not in ROUTES):
        given = checks.shown(condense)
        raise ModelError(f'condense must be True, False, "auto", "modal" or "sparse", it is {given}')
    directions = tuple(w for law in laws for w in law.directions)
    touched = np.flatnonzero(np.any([w != 0 for w in directions], axis=0)) if directions else np.zeros(0, int)
    small = system.n * n_c <= WORTH_CONDENSING
    if condense is False or (condense == "auto" and small):
        return _full(system, directions, forces, n_c)
    if len(touched) == 0:
        touched = np.array([0])  # a linear system: any coordinate carries the equations
    if turn and condense not in ("modal", "sparse") and len(touched) > 8 and system.n <= MODAL_COORDINATES:
        rank = int(np.linalg.matrix_rank(np.array(directions)))
        if 2 * rank < len(touched):
            return _leading_coordinates(system, directions, forces, rank)
    if len(touched) == system.n:
        return _full(system, directions, forces, n_c)
    return _condensed(system, touched, forces, directions, n_c, "auto" if condense is True else condense)


def _condensed(
    system: Any, touched: np.ndarray, forces: np.ndarray, directions: tuple[np.ndarray, ...], n_c: int, route: str
) -> Linear:
    """By modes, or by factors at every frequency: what takes less time altogether, where the route is left open."""
    open_to_modes = route == "modal" or (route == "auto" and system.n <= MODAL_COORDINATES)
    factors = None
    if not open_to_modes or (route == "auto" and not _is_full(system.K)):
        factors = _sparse(system, touched, forces, directions)
    if open_to_modes and (factors is None or _worth_modes(factors, (n_c + 1) // 2)):
        matrices = _symmetric(system)
        modal = None if matrices is None else _modal(matrices, touched, forces, route == "modal")
        if modal is not None:
            return Linear(modal, "condensed, modal", directions, None, matrices)
        if route == "modal":
            raise ModelError(
                'condense="modal" needs symmetric matrices whose damping does not couple the modes; use "sparse"'
            )
    return factors or _sparse(system, touched, forces, directions)


def _is_full(matrix: Any) -> bool:
    """True where so many entries are there that factors have no structure to use."""
    entries = matrix.nnz if hasattr(matrix, "nnz") else np.count_nonzero(matrix)
    return bool(FULL * entries > matrix.shape[0] ** 2)


def _worth_modes(factors: Linear, terms: int) -> bool:
    """True where modes, found once, and their sums take less time for a curve than factors at every frequency."""
    assert factors.matrices is not None
    M, _, K = factors.matrices
    size = factors.core.size
    n = M.shape[0] - size
    is_chain = np.all(M.row == M.col) and np.max(np.abs(K.row - K.col), initial=0) <= 1
    first = CHAIN_MODES * n**2 if is_chain else ALL_MODES * n**3
    by_modes = first + EVALUATIONS * terms * MODE * n * size**2
    return bool(by_modes < EVALUATIONS * factors.core.products(terms))


def dense(system: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C + G, K + N as dense arrays."""

    def array(a: Any) -> np.ndarray:
        if a is None:
            return np.zeros((system.n, system.n))
        return np.asarray(a.toarray() if hasattr(a, "toarray") else a, dtype=float)

    M, C, K = array(system.M), array(system.C), array(system.K)
    G, N = getattr(system, "G", None), getattr(system, "N", None)
    return M, C if G is None else C + array(G), K if N is None else K + array(N)


def _full(system: Any, directions: tuple[np.ndarray, ...], forces: np.ndarray, n_c: int) -> Linear:
    if system.n * n_c > FULL_UNKNOWNS:
        raise ModelError(
            f"{system.n} coordinates with {n_c} coefficients are {system.n * n_c} unknowns in dense matrices; "
            "condense (condense=True, elements on few coordinates) or take fewer harmonics"
        )
    return Linear(_core.HbmLinear.full(system.core, forces), "full", directions)


def _leading_coordinates(system: Any, directions: tuple[np.ndarray, ...], forces: np.ndarray, rank: int) -> Linear:
    """Directions that touch many coordinates: an orthogonal change of coordinates puts them on the first few."""
    import scipy.linalg

    Q = scipy.linalg.qr(np.array(directions).T, pivoting=True)[0]
    turned = tuple(np.concatenate([(Q.T @ w)[:rank], np.zeros(system.n - rank)]) for w in directions)
    M, C, K = (Q.T @ A @ Q for A in dense(system))
    row, column = (i.ravel() for i in np.indices(M.shape))
    m, c, k = (A.ravel() for A in (M, C, K))
    turned_forces = np.ascontiguousarray(forces @ Q)
    core = _core.HbmLinear.sparse(system.n, row, column, m, c, k, np.arange(rank), turned_forces)
    return Linear(core, "condensed, turned", turned, Q, (M, C, K))


def _reduced(matrices: tuple[Any, Any, Any], retained: np.ndarray, top: float) -> tuple[np.ndarray, ...] | None:
    """Congruence onto the retained coordinates and the shapes that the rest takes when these move at frequencies up to
    ``top``: the dynamic stiffness is then interpolated at those frequencies (rational Krylov subspaces, E. J. Grimme, thesis,
    Illinois 1997, chapter 3). The core checks it between them before it is used."""
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl

    M, C, K = (sp.csc_matrix(A) for A in matrices)
    n, n_r = M.shape[0], len(retained)
    local = np.setdiff1d(np.arange(n), retained)
    most = min(REDUCED_COORDINATES - n_r, len(local))
    ll, lr = np.ix_(local, local), np.ix_(local, retained)
    shapes = []
    for w in np.linspace(0.0, top, SHIFTS):
        Z = K - w**2 * M + 1j * w * C
        try:
            shapes.append(-spl.splu(Z[ll].tocsc()).solve(Z[lr].toarray()))
        except RuntimeError:
            continue  # singular here; its neighbours tell as much
    if not shapes or most < 1:
        return None
    static = shapes[0].real
    moving = np.hstack([part - s * static for x in shapes for part, s in ((x.real, 1.0), (x.imag, 0.0))])
    size = np.linalg.norm(moving, axis=0)
    kept = size > 0
    basis, weight, _ = np.linalg.svd(moving[:, kept] / size[kept], full_matrices=False)
    basis = basis[:, : min(most, int(np.sum(weight > NEGLIGIBLE_SHAPE * weight[0])))] if kept.any() else basis[:, :0]
    T = np.zeros((n, n_r + basis.shape[1]))
    T[retained, np.arange(n_r)] = 1.0
    T[local, :n_r], T[local, n_r:] = static, basis
    reduced = tuple(np.ascontiguousarray(T.T @ (A @ T)) for A in (M, C, K))
    return reduced if all(np.all(np.isfinite(A)) for A in reduced) else None


def _symmetric(system: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    parts = dense(system)
    return parts if all(np.array_equal(A, A.T) for A in parts) else None


def _modal(matrices: tuple[np.ndarray, ...], retained: np.ndarray, forces: np.ndarray, wanted: bool) -> Any:
    """Modes of the rest while the retained coordinates are held; None where damping couples them, and, unless they are
    ``wanted``, where their frequencies differ so much that rounding is felt in the lowest."""
    from scipy.sparse import csr_array

    sparse = [csr_array(A) for A in matrices]
    while True:
        n = len(matrices[0])
        local = np.setdiff1d(np.arange(n), retained)
        found = _modes_by_parts(*(A[local][:, local] for A in sparse))
        if found is None:
            return None
        stiffness, damping, shape = found
        lowest, highest = (np.min(stiffness), np.max(stiffness)) if len(local) else (0.0, 0.0)
        if len(local) == 0 or lowest > LOOSE * highest:
            if not wanted and len(local) and highest * np.finfo(float).eps > ROUGH * lowest:
                return None
            break
        # the rest is free at rest: keep the coordinate that moves most, or the static equations are singular
        retained = np.sort(np.append(retained, local[np.argmax(np.abs(shape[:, np.argmin(stiffness)]))]))
        if len(retained) == n:
            return None
    rr = [np.ascontiguousarray(A[np.ix_(retained, retained)]) for A in matrices]
    lr = [np.ascontiguousarray(shape.T @ A[np.ix_(local, retained)]) for A in matrices]
    small = tuple(np.ascontiguousarray(A) for A in matrices) if len(matrices[0]) <= STABILITY_COORDINATES else None
    return _core.HbmLinear.modal(
        retained.tolist(),
        local.tolist(),
        rr,
        lr,
        stiffness,
        damping,
        np.ascontiguousarray(shape),
        forces,
        small,
    )


def _modes_by_parts(M: Any, C: Any, K: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Eigenvalues, modal damping and shapes (n, n) of sparse matrices, of each part that no entry connects with another by
    itself; None where M is not definite or damping couples the modes. Cost O(n^3) of the largest part."""
    from scipy.sparse.csgraph import connected_components

    n = M.shape[0]
    stiffness, damping, shape = np.zeros(n), np.zeros(n), np.zeros((n, n))
    count, part = connected_components(abs(M) + abs(C) + abs(K), directed=False) if n else (0, np.zeros(0))
    for i in range(count):
        own = np.flatnonzero(part == i)
        m, c, k = (A[own][:, own] for A in (M, C, K))
        try:
            stiffness[own], vectors = _modes(m, k)
        except np.linalg.LinAlgError:
            return None
        coupled = vectors.T @ (c @ vectors)
        damping[own] = np.diag(coupled)
        size = np.max(np.abs(coupled), initial=0.0)
        np.fill_diagonal(coupled, 0.0)
        if np.max(np.abs(coupled), initial=0.0) > COUPLED * size:
            return None
        shape[np.ix_(own, own)] = vectors
    return stiffness, damping, shape


def _modes(M: Any, K: Any) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and M-orthonormal eigenvectors of sparse matrices; of a chain, K tridiagonal and M diagonal, in O(n^2)."""
    import scipy.linalg

    mass, rows = M.diagonal(), K.tocoo()
    chain = M.shape[0] > 1 and M.count_nonzero() == len(mass) and np.max(np.abs(rows.row - rows.col), initial=0) <= 1
    if chain and np.all(mass > 0):
        root = np.sqrt(mass)
        values, vectors = scipy.linalg.eigh_tridiagonal(K.diagonal() / mass, K.diagonal(1) / (root[1:] * root[:-1]))
        return values, vectors / root[:, None]
    return scipy.linalg.eigh(K.toarray(), M.toarray())


def _sparse(system: Any, retained: np.ndarray, forces: np.ndarray, directions: tuple[np.ndarray, ...]) -> Linear:
    import scipy.sparse as sp

    def matrix(*parts: Any) -> Any:
        total = sp.csc_matrix((system.n, system.n))
        for part in parts:
            if part is not None:
                total = total + sp.csc_matrix(part)
        return total.tocoo()

    M = matrix(system.M)
    C = matrix(system.C, getattr(system, "G", None))
    K = matrix(system.K, getattr(system, "N", None))
    places = np.unique(np.concatenate([A.col.astype(np.int64) * system.n + A.row for A in (M, C, K)]))
    places = np.union1d(places, np.arange(system.n) * (system.n + 1))  # every pivot has a place

    def values(A: Any) -> np.ndarray:
        out = np.zeros(len(places))
        np.add.at(out, np.searchsorted(places, A.col.astype(np.int64) * system.n + A.row), A.data)
        return out

    core = _core.HbmLinear.sparse(
        system.n, places % system.n, places // system.n, values(M), values(C), values(K), retained, forces
    )
    route = "condensed, sparse" if core.half_bandwidth is None else "condensed, banded"
    return Linear(core, route, directions, None, (M, C, K))


def conservative(system: Any) -> bool:
    """True if a system conserves energy by structure: no damping, no circulatory stiffness, laws of position."""
    M, C, K = dense(system)
    still = all(law.kind.name and not (law.uses_rate or law.has_memory or law.kind.phase) for law in system.elements)
    return still and bool(np.all(C + C.T == 0) and np.all(K == K.T) and np.all(M == M.T))
