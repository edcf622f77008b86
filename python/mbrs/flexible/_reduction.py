"""Reduction to a few shapes: fixed-interface modes and constraint modes, made orthonormal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import ModelError, SingularError

__all__ = ["reduced_shapes"]

Array = np.ndarray
_DENSE = 1500
_RIGID = 1e-11


def reduced_shapes(
    M: Any,
    K: Any,
    interface: Array,
    fixed: Array,
    n_modes: int,
    rigid: int,
    whose: str,
    stiffness_of: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array]:
    """Shapes T (n, m) with T^T M T = 1 and T^T K T = diag(square), and square (m,), ascending.

    R. R. Craig and M. C. C. Bampton, AIAA Journal 6(7) (1968) 1313-1319: with the coordinates in ``fixed`` held, the
    interface coordinates b and the others i, x_i = -K_ii^-1 K_ib x_b + Phi_i z, K_ii Phi_i = M_ii Phi_i diag(w^2). The
    reduced problem is then brought to its own modes, of which the ``rigid`` lowest are left out. ``stiffness_of``: T^T K T
    where it is known better than by K.
    """
    import scipy.sparse as sp

    M, K = (sp.csc_matrix(X) for X in (M, K))
    if not (np.all(np.isfinite(M.data)) and np.all(np.isfinite(K.data))):
        raise ModelError(
            f"{whose}: its mass or stiffness matrix is not finite: lengths and properties differ too much in size"
        )
    n = M.shape[0]
    free = np.setdiff1d(np.arange(n), np.concatenate([interface, fixed]))
    if n_modes > len(free):
        raise ModelError(
            f"{whose}: modes must be at most {len(free)}, the number of inner degrees of freedom; it is {n_modes}"
        )
    M_ii, K_ii, K_ib = M[free][:, free], K[free][:, free], K[free][:, interface]
    T = np.zeros((n, len(interface) + n_modes))
    T[interface, np.arange(len(interface))] = 1.0
    if len(interface):
        T[free, : len(interface)] = -_solved(K_ii, K_ib.toarray(), whose)
    if n_modes:
        T[free, len(interface) :] = _lowest(M_ii, K_ii, n_modes, rigid == 0 or len(interface) > 0, whose)
    stiffness = T.T @ (K @ T) if stiffness_of is None else stiffness_of(T)
    return _orthonormal(M, stiffness, T, rigid, whose)


def _solved(K: Any, b: Array, whose: str) -> Array:
    import warnings

    import scipy.sparse.linalg as sl

    with warnings.catch_warnings():
        warnings.simplefilter("error", sl.MatrixRankWarning)
        try:
            made = np.asarray(sl.splu(K.tocsc()).solve(b))
        except (RuntimeError, sl.MatrixRankWarning):
            raise _loose(whose) from None
    if not np.all(np.isfinite(made)):
        raise _loose(whose)
    return made


def _loose(whose: str) -> SingularError:
    return SingularError(
        f"{whose}: with its nodes held, K is singular: a part of the body is attached to nothing. Check the matrix, or "
        "remove degrees of freedom without stiffness"
    )


def _lowest(M: Any, K: Any, n: int, held: bool, whose: str) -> Array:
    """The n lowest modes."""
    import scipy.sparse.linalg as sl

    size = M.shape[0]
    if size <= _DENSE or n >= size - 1 or not held:
        return _modes(M.toarray(), K.toarray(), n, held, whose)[0]
    # A start of its own, so that the same input gives the same output.
    start = np.cos(np.arange(size) ** 2)
    return np.asarray(sl.eigsh(K, n, M, sigma=0.0, v0=start)[1])


def _modes(M: Array, K: Array, n: int, held: bool, whose: str) -> tuple[Array, Array]:
    """The n lowest modes of a dense pencil, orthonormal over M, and their squares, ascending.

    As the largest of M phi = (K + shift M) phi mu: those are accurate to rounding, where the small ones of K phi = M phi
    w^2 lose what the largest w^2 of a fine mesh outweighs. The shift is for a free body.
    """
    import scipy.linalg

    scale = 1 / np.sqrt(np.maximum(np.diag(K), 1e-300))
    if not held:
        scale = 1 / np.sqrt(np.maximum(np.diag(M), 1e-300))
    M, K = (0.5 * (X + X.T) * np.outer(scale, scale) for X in (M, K))
    size, shift = len(M), 0.0
    try:
        if not held:
            shift = float(np.max(np.abs(scipy.linalg.eigh(K, M, eigvals_only=True)[: n + 1])))
        mu, phi = scipy.linalg.eigh(M, K + shift * M, subset_by_index=(size - n, size - 1))
    except scipy.linalg.LinAlgError:
        raise _loose(whose) from None
    if len(mu) < n:  # numbers that are none, of stiffnesses that underflow
        raise _loose(whose)
    if not np.all(mu > 0):
        raise SingularError(f"{whose}: the mass matrix is not positive definite; give every freedom some mass")
    mu, phi = mu[::-1], phi[:, ::-1]
    return scale[:, None] * phi / np.sqrt(mu), 1 / mu - shift


def _orthonormal(M: Any, stiffness: Array, T: Array, rigid: int, whose: str) -> tuple[Array, Array]:
    Y, square = _modes(T.T @ (M @ T), stiffness, T.shape[1], rigid == 0, whose)
    zero = int(np.sum(square[: rigid + 1] < _RIGID * square[-1])) if rigid else 0
    if zero != rigid:
        raise ModelError(
            f"{whose}: the free body must have {rigid} rigid motions, its matrices have {zero}"
            f"{' or more' if zero > rigid else ''}; check K and the nodes' positions"
        )
    shapes = T @ Y[:, rigid:]
    top = np.argmax(np.abs(shapes), axis=0)
    shapes = shapes * np.where(shapes[top, np.arange(shapes.shape[1])] < 0, -1.0, 1.0)
    return shapes, square[rigid:]
