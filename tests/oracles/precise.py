"""Roots and eigenpairs in many digits by mpmath: the measure of modes, and of the derivatives of eigenvalues and shapes, which a
complex step cannot prove.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mbrs.reference.so3 import Array
from mpmath import mp


def companion(m: Any, d: Any, k: Any) -> Any:
    """[[0, 1], [-M^-1 K, -M^-1 D]] of matrices of mpmath, in its present digits."""
    n, inverse = m.rows, m**-1
    a, low, high = mp.zeros(2 * m.rows), -inverse * k, -inverse * d
    for i in range(n):
        a[i, n + i] = 1
        for j in range(n):
            a[n + i, j], a[n + i, n + j] = low[i, j], high[i, j]
    return a


def exact_roots(M: Array, D: Array, K: Array, digits: int = 50) -> list[Any]:
    """All roots of det(s^2 M + s D + K) of the numbers stored."""
    with mp.workdps(digits):
        return list(mp.eig(companion(*(mp.matrix(a.tolist()) for a in (M, D, K))), left=False, right=False))


def relative_errors(values: Array, exact: list[Any], digits: int = 60) -> Array:
    """Relative distance of every value from the exact root nearest to it, each root used once."""
    left, out = list(exact), []
    with mp.workdps(digits):
        for value in values:
            z = mp.mpc(complex(value))
            best = left.pop(min(range(len(left)), key=lambda k: abs(left[k] - z)))
            out.append(float(abs(best - z) / max(abs(best), mp.mpf(10) ** -40)))
    return np.array(out)


def _refine(matrices: list[Any], s: complex, phi: Array) -> tuple[Any, Any]:
    """Newton on P(s) phi = 0, phi_j = 1, from double precision to the working precision."""
    M, D, S = matrices
    n, j = M.rows, int(np.argmax(np.abs(phi)))
    value, v = mp.mpc(s), mp.matrix([mp.mpc(p) for p in phi / phi[j]])
    for _ in range(12):
        P, slope = value**2 * M + value * D + S, 2 * value * M + D
        r = P * v
        border, right = mp.matrix(n + 1, n + 1), mp.matrix(n + 1, 1)
        border[:n, :n] = P
        column = slope * v
        for i in range(n):
            border[i, n], right[i] = column[i], -r[i]
        border[n, j] = 1
        step = mp.lu_solve(border, right)
        v, value = v + step[:n, 0], value + step[n]
        if mp.norm(step) <= mp.mpf(10) ** (-mp.dps + 8) * mp.norm(v):
            break
    return value, v


def _normalised(M: Any, D: Any, s: Any, v: Any, like: Array, bilinear: bool) -> Any:
    """The normalisation of `Modes`, in the sign of ``like``."""
    if bilinear:
        v = v * mp.sqrt(2j * s.imag / (v.T * (2 * s * M + D) * v)[0])
        j = int(np.argmax(np.abs(like)))
        return v if mp.re(v[j] * mp.conj(mp.mpc(like[j]))) > 0 else -v
    from mbrs.reference.modal import _largest

    j = _largest(like)
    v = v * (abs(v[j]) / v[j])
    return v / mp.sqrt(mp.re((v.H * M * v)[0])) * (1 if like[j].real > 0 else -1)


def mp_eigenvalue_derivative(
    M: Any, D: Any, S: Any, dM: Any, dD: Any, dS: Any, s: complex, phi: Any, symmetric: bool = True, digits: int = 50
) -> tuple[complex, Array]:
    """(ds, dphi) by central differences of eigenpairs of M + e dM, ... with e = 10^(-digits/3), error about e^2.

    For a simple eigenvalue; phi is normalised as in `Modes` (``symmetric`` and complex: bilinear, else phi^H M phi =
    1).
    """
    phi = np.asarray(phi)
    with mp.workdps(digits):
        e = mp.mpf(10) ** (-(digits // 3))
        pairs = []
        for sign in (1, -1):
            moved = [
                mp.matrix(np.asarray(a).tolist()) + sign * e * mp.matrix(np.asarray(da).tolist())
                for a, da in ((M, dM), (D, dD), (S, dS))
            ]
            value, v = _refine(moved, s, phi)
            pairs.append((value, _normalised(moved[0], moved[1], value, v, phi, symmetric and abs(s.imag) > 0)))
        ds = complex((pairs[0][0] - pairs[1][0]) / (2 * e))
        dv = (pairs[0][1] - pairs[1][1]) / (2 * e)
        return ds, np.array([complex(c) for c in dv])
