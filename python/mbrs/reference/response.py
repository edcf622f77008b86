"""Time response of M y" + D y' + S y = F f(t), exact where f is linear between the sampled times."""

from __future__ import annotations

from typing import Any

import numpy as np

from .so3 import Array


def response(M: Any, D: Any, S: Any, F: Any, t: Any, f: Any, y0: Any = None, v0: Any = None) -> tuple[Array, Array]:
    """y, y' (n_t, n) for loads f (n_t, n_in) at times t.

    Over a step h with f = f0 + (f1 - f0) tau/h the exponential of [[A, B, 0], [0, 0, 1], [0, 0, 0]] h carries (z, f,
    f') exactly. Complex M, D, S, F, f pass (complex step). Cost: one exponential per different step.
    """
    import scipy.linalg

    M, D, S, F = (np.asarray(X) for X in (M, D, S, F))
    t, f = np.asarray(t, dtype=float), np.asarray(f)
    n, m = F.shape
    f = f.reshape(len(t), m)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, S), -np.linalg.solve(M, D)]])
    B = np.concatenate([np.zeros((n, m)), np.linalg.solve(M, F)])
    augmented = np.block([[A, B, 0 * B], [np.zeros((m, 2 * n + m)), np.eye(m)], [np.zeros((m, 2 * n + 2 * m))]])
    z = np.zeros((len(t), 2 * n), dtype=np.result_type(augmented, f, float))
    z[0, :n], z[0, n:] = 0 if y0 is None else y0, 0 if v0 is None else v0
    known: dict[float, Array] = {}
    for k in range(len(t) - 1):
        h = float(t[k + 1] - t[k])
        if h not in known:
            known[h] = scipy.linalg.expm(augmented * h)[: 2 * n]
        z[k + 1] = known[h] @ np.concatenate([z[k], f[k], (f[k + 1] - f[k]) / h])
    return z[:, :n], z[:, n:]
