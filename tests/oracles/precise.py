"""Fifty-digit eigenpairs: the measure of eigenvalue and shape derivatives, which a complex step cannot prove.
Needs mpmath.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mbrs.reference.so3 import Array


def _refine(mp: Any, matrices: list[Any], s: complex, phi: Array) -> tuple[Any, Any]:
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
        if mp.norm(step) <= mp.mpf(10) ** (-mp.mp.dps + 8) * mp.norm(v):
            break
    return value, v


def _normalised(mp: Any, M: Any, D: Any, s: Any, v: Any, like: Array, bilinear: bool) -> Any:
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
    import mpmath as mp

    phi = np.asarray(phi)
    with mp.workdps(digits):
        e = mp.mpf(10) ** (-(digits // 3))
        pairs = []
        for sign in (1, -1):
            moved = [
                mp.matrix(np.asarray(a).tolist()) + sign * e * mp.matrix(np.asarray(da).tolist())
                for a, da in ((M, dM), (D, dD), (S, dS))
            ]
            value, v = _refine(mp, moved, s, phi)
            pairs.append((value, _normalised(mp, moved[0], moved[1], value, v, phi, symmetric and abs(s.imag) > 0)))
        ds = complex((pairs[0][0] - pairs[1][0]) / (2 * e))
        dv = (pairs[0][1] - pairs[1][1]) / (2 * e)
        return ds, np.array([complex(c) for c in dv])
