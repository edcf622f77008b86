"""Motions in time from Fourier coefficients [a0, a1, b1, ...]: shared by periodic and quasi-periodic solutions."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._lib.checks import sized_array
from .displacement import displacement_coefficients


class FourierMotion:
    """x(t) = a0 + sum_k (a_k cos w_k t + b_k sin w_k t), ``X`` (dof, 2 n_k + 1); base of `PeriodicSolution` and
    `QuasiPeriodicSolution`, which know the frequencies w_k of their terms.
    """

    X: np.ndarray
    system: Any

    def term_frequencies(self) -> np.ndarray:
        """(n_k,) circular frequency of every term, rad/s."""
        raise NotImplementedError("a class of motions says at which frequencies its terms are")

    def displacement(self, t: Any, dof: Any = None) -> np.ndarray:
        """x at the times ``t``, (dof, n_t); (n_t,) of one displacement where ``dof`` names it."""
        return self._series(t, 0, dof)

    def velocity(self, t: Any, dof: Any = None) -> np.ndarray:
        """x' at the times ``t``, (dof, n_t) or (n_t,)."""
        return self._series(t, 1, dof)

    def _series(self, t: Any, derivative: int, dof: Any) -> np.ndarray:
        X = self.X if dof is None else displacement_coefficients(self.X, self.system, dof)[None, :]
        w = self.term_frequencies()
        c = (X[:, 1::2] - 1j * X[:, 2::2]) * (1j * w) ** derivative
        x = (c @ np.exp(1j * np.outer(w, sized_array("t", t, give="give times in s")))).real
        x = x if derivative else x + X[:, :1]
        return x if dof is None else x[0]
