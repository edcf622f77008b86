"""Roots and shapes of (s^2 M + s (C + G) + K + N) phi = 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import SingularError
from .linear import first_order
from .so3 import Array


@dataclass
class Modes:
    """n representatives, ascending in |s|: of a complex pair the root with Im s > 0, of the real ones the upper half.

    ``shape`` (n, n) by column: phi^T (2 s M + C) phi = 2i Im s where everything is symmetric, else phi^H M phi = 1
    with the largest component real; real, rigid and near-defective ones phi^H M phi = 1. ``left`` (n, n): psi^T P(s)
    = 0, scaled to psi^T (2 s M + C + G) phi = 2i Im s where that is not near zero. The component of largest modulus
    (first within 1e-6) has a positive real part. ``groups``: indices of repeated eigenvalues. ``defective``: |psi^T
    P' phi| small against its terms.
    """

    eigenvalue: Array
    roots: Array
    frequency: Array
    damping: Array
    shape: Array
    left: Array
    groups: list[list[int]]
    defective: Array
    symmetric: bool


def modes(
    M: Any, C: Any = None, G: Any = None, K: Any = None, N: Any = None, rigid: float = 1e-12, repeated: float = 1e-8
) -> Modes:
    """All roots and n modes (normalised as `Modes` says; docs/theory.md (6.1) to (6.3)).

    rigid: singular values of the mass-normalised stiffness below this share of the largest count as zero.
    repeated: eigenvalues closer than this share of |s| form a group.
    """
    import scipy.linalg

    M = np.asarray(M, dtype=float)
    n = len(M)
    C, G, K, N = (np.zeros((n, n)) if X is None else np.asarray(X, dtype=float) for X in (C, G, K, N))
    try:
        L = np.linalg.cholesky(M)
    except np.linalg.LinAlgError as e:
        raise SingularError(
            "the mass matrix is not positive definite; give every degree of freedom some inertia"
        ) from e
    D, S = (_hat(L, X) for X in (C + G, K + N))
    symmetric = _negligible(_hat(L, G), D, S) and _negligible(_hat(L, N), S, D)
    if symmetric:
        D, S = 0.5 * (D + D.T), 0.5 * (S + S.T)
    if symmetric and not np.any(C):
        s, phi, psi, roots = _undamped(S, rigid)
    else:
        s, phi, psi, roots = _general(D, S, rigid)
    phi, psi = (scipy.linalg.solve_triangular(L.T, v, lower=False) for v in (phi, psi))
    groups = _groups(s, repeated)
    shape, left, defective = _normalise(M, C + G, s, phi, psi, groups, symmetric)
    f = np.abs(s) / (2 * np.pi)
    with np.errstate(invalid="ignore", divide="ignore"):
        zeta = np.where(s == 0, np.nan, -s.real / np.abs(s))
    return Modes(s, roots, f, zeta, shape, left, groups, defective, symmetric)


def _hat(L: Array, X: Array) -> Array:
    return np.linalg.solve(L, np.linalg.solve(L, X).T).T


def _negligible(part: Array, *whole: Array) -> bool:
    return bool(np.max(np.abs(part), initial=0.0) <= 1e-14 * max(np.max(np.abs(w), initial=0.0) for w in whole))


def _undamped(S: Array, rigid: float) -> tuple[Array, Array, Array, Array]:
    square, phi = np.linalg.eigh(S)
    square = np.where(np.abs(square) <= rigid * np.max(np.abs(square), initial=0.0), 0.0, square)
    s = np.where(square < 0, np.sqrt(np.abs(square)) + 0j, 1j * np.sqrt(np.abs(square)))
    order = np.argsort(np.abs(s), kind="stable")
    phi = phi[:, order].astype(complex)
    return s[order], phi, phi, np.concatenate([s[order], -s[order]])


def _general(D: Array, S: Array, rigid: float) -> tuple[Array, Array, Array, Array]:
    import scipy.linalg

    n = len(S)
    scale = max(np.sqrt(np.linalg.norm(S, 2)), np.linalg.norm(D, 2), 1e-300) if n else 1.0
    roots, w, v = scipy.linalg.eig(first_order(np.eye(n), D / scale, S / scale**2), left=True, right=True)
    right, left = _upper_half(roots, v, n), w[n:].conj()
    null, conull, double, single = _zero_roots(D, S, rigid)
    order = np.argsort(np.abs(roots), kind="stable")
    roots[order[: 2 * double + single]] = 0.0
    zeros, others = order[: 2 * double + single], order[2 * double + single :]
    real = np.concatenate([zeros[:single], others[roots[others].imag == 0]])
    real = real[np.argsort(-roots[real].real, kind="stable")]
    chosen = np.concatenate(
        [zeros[single : single + double], real[: (len(real) + 1) // 2], others[roots[others].imag > 0]]
    )
    chosen = chosen[np.argsort(np.abs(roots[chosen]), kind="stable")][:n]
    phi, psi = right[:, chosen], left[:, chosen]
    rigid_ones = np.flatnonzero(roots[chosen] == 0)
    phi[:, rigid_ones] = null[:, : len(rigid_ones)]
    psi[:, rigid_ones] = conull[:, : len(rigid_ones)]
    return roots[chosen] * scale, phi, psi, roots * scale


def _upper_half(roots: Array, v: Array, n: int) -> Array:
    """phi from (phi, s phi), out of the larger half."""
    return np.where(np.abs(roots) > 1, v[n:] / np.where(roots == 0, 1, roots), v[:n])


def _zero_roots(D: Array, S: Array, rigid: float) -> tuple[Array, Array, int, int]:
    """Null spaces of S, undamped directions first, and how many zero roots are double (no damping) and single."""
    U, sigma, Vt = np.linalg.svd(S)
    keep = sigma <= rigid * np.max(sigma, initial=0.0)
    right, left = Vt[keep].T, U[:, keep]
    if right.shape[1] == 0:
        return right, left, 0, 0
    u, resistance, vt = np.linalg.svd(left.T @ D @ right)
    size = max(np.linalg.norm(D, 2), np.sqrt(sigma[0]), 1e-300)
    free = resistance <= np.sqrt(rigid) * 1e-3 * size
    double = int(np.sum(free))
    return right @ vt.T[:, ::-1], left @ u[:, ::-1], double, len(free) - double


def _groups(s: Array, tolerance: float) -> list[list[int]]:
    groups: list[list[int]] = []
    for i, value in enumerate(s):
        for g in groups:
            if abs(value - s[g[0]]) <= tolerance * abs(value):
                g.append(i)
                break
        else:
            groups.append([i])
    return [g for g in groups if len(g) > 1]


def _normalise(
    M: Array, D: Array, s: Array, phi: Array, psi: Array, groups: list[list[int]], symmetric: bool
) -> tuple[Array, Array, Array]:
    import scipy.linalg

    phi, psi, defective = phi.astype(complex), psi.astype(complex), np.zeros(len(s), dtype=bool)
    grouped = {i for g in groups for i in g}
    for g in [*groups, *([i] for i in range(len(s)) if i not in grouped)]:
        value = s[g[0]]
        F, W = phi[:, g], psi[:, g]
        slope = 2 * value * M + D
        gram = (F if symmetric else W).T @ slope @ F
        smallest = np.min(np.abs(np.linalg.eigvals(gram))) if value.imag != 0 else np.inf
        defective[g] = _is_defective(M, D, value, F, W)
        if value.imag == 0 or defective[g[0]] or smallest == 0:
            F = _unit_mass(M, F, value)
            W = F if symmetric else _unit_mass(M, W, value)
        elif symmetric:
            F = F @ scipy.linalg.sqrtm(np.linalg.inv(gram / (2j * value.imag)))
            F = F * _sign(F)
            W = F
        else:
            F = _unit_mass(M, F, value)
            W = W @ np.linalg.inv((W.T @ slope @ F).T / (2j * value.imag))
        phi[:, g], psi[:, g] = F, W
    return phi, psi, defective


def _is_defective(M: Array, D: Array, s: complex, F: Array, W: Array) -> bool:
    """|psi^T (2 s M + D) phi| against |psi| |2 s M| |phi| in mass-normalised lengths."""
    if s == 0:
        return False
    length = np.sqrt(np.einsum("ik,ij,jk->k", F.conj(), M, F).real * np.einsum("ik,ij,jk->k", W.conj(), M, W).real)
    slope = np.abs(np.einsum("ik,ij,jk->k", W, 2 * s * M + D, F)) if F.shape[1] == 1 else np.full(F.shape[1], np.inf)
    return bool(np.any(slope < 1e-6 * 2 * abs(s) * length))


def _unit_mass(M: Array, F: Array, s: complex) -> Array:
    """phi^H M phi = 1 with a real largest component; groups of real roots become M-orthonormal."""
    F = np.stack([f / f[_largest(f)] for f in F.T], axis=1)
    if s.imag == 0:
        F = F.real.astype(complex)
        R = np.linalg.cholesky((F.conj().T @ M @ F).real)
        F = np.linalg.solve(R, F.T).T
    F = F / np.sqrt(np.einsum("ik,ij,jk->k", F.conj(), M, F).real)
    return F * _sign(F)


def _largest(f: Array) -> int:
    """The component of largest modulus, the first of those within 1e-6."""
    size = np.abs(f)
    return int(np.flatnonzero(size >= (1 - 1e-6) * np.max(size))[0])


def _sign(F: Array) -> Array:
    return np.array([1.0 if f[_largest(f)].real >= 0 else -1.0 for f in F.T])
