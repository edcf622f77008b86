"""Linear systems with periodic coefficients: their means, and the characteristic exponents, which tell what the means leave out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

# Steps of the exponents for each azimuth: from the azimuths, and from the places between, whose difference tells the exponents' own error.
_STEPS = (4, 2)


@dataclass(frozen=True, eq=False)
class Periodic:
    """M, D, S (2 N, dof, dof) at N azimuths and half-way behind each, over a turn that takes ``period``, in axes in which nothing but
    them changes.
    """

    M: np.ndarray = field(repr=False)
    D: np.ndarray = field(repr=False)
    S: np.ndarray = field(repr=False)
    period: float

    @property
    def mean(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.M.mean(axis=0), self.D.mean(axis=0), self.S.mean(axis=0)

    @property
    def varies(self) -> float:
        """The largest change of a row from its mean, over the row of the mean."""
        worst = 0.0
        for own in (self.M, self.D, self.S):
            size = np.abs(own.mean(axis=0)).sum(axis=1)
            change = np.abs(own - own.mean(axis=0)).sum(axis=2).max(axis=0)
            worst = max(worst, float(np.max(change[size > 0.0] / size[size > 0.0], initial=0.0)))
        return worst

    def kept(self, places: Sequence[int] | np.ndarray) -> Periodic:
        """The part of some coordinates."""
        at = np.asarray(places, dtype=int)
        M, D, S = (x[:, at[:, None], at] for x in (self.M, self.D, self.S))
        return Periodic(M, D, S, self.period)

    def state_matrices(self, t: np.ndarray) -> np.ndarray:
        """(len(t), 2 dof, 2 dof) A(t) of x' = A x, x = (z, z'), by trigonometric interpolation between an odd number of places."""
        weight = interpolation(len(self.M), t / self.period)
        M, D, S = (np.einsum("tk,kij->tij", weight, own) for own in (self.M, self.D, self.S))
        n = M.shape[1]
        A = np.zeros((len(t), 2 * n, 2 * n))
        A[:, :n, n:] = np.eye(n)
        A[:, n:, :n], A[:, n:, n:] = -np.linalg.solve(M, S), -np.linalg.solve(M, D)
        return A

    def monodromy(self, steps: int) -> np.ndarray:
        """(2 dof, 2 dof) what a turn makes of x: two exponentials a step, of order four."""
        from scipy.linalg import expm

        h = self.period / steps
        shift = np.sqrt(3.0) / 6.0
        t = h * np.arange(steps)
        A1, A2 = (self.state_matrices(t + (0.5 + sign * shift) * h) for sign in (-1.0, 1.0))
        a, b = 0.25 + shift, 0.25 - shift
        out = np.eye(A1.shape[1])
        for first, second in zip(A1, A2, strict=True):
            out = expm(h * (b * first + a * second)) @ expm(h * (a * first + b * second)) @ out
        return np.asarray(out)

    def exponents(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Roots (2 dof,) of the means, the characteristic exponents that belong to them, and how well the latter are known.

        An exponent is known but for multiples of 2 pi i over the period: the one nearest to the root of the means is taken.
        """
        from scipy.optimize import linear_sum_assignment

        M, D, S = (x[None] for x in self.mean)
        means = Periodic(M, D, S, self.period)
        averaged, V = np.linalg.eig(means.state_matrices(np.zeros(1))[0])
        back = np.linalg.pinv(V)
        found = []
        for first, steps in enumerate(_STEPS):
            part = Periodic(self.M[first::2], self.D[first::2], self.S[first::2], self.period)
            factor, P = np.linalg.eig(part.monodromy(steps * len(part.M)))
            share = np.abs(back @ P) ** 2
            order = linear_sum_assignment(-share / share.sum(axis=0))[1]
            s = np.log(factor[order].astype(complex)) / self.period
            turn = 2j * np.pi / self.period
            found.append(s + turn * np.round((averaged - s).imag / turn.imag))
        return averaged, found[0], np.abs(found[0] - found[1])

    def left_out(self, eigenvalue: np.ndarray) -> np.ndarray:
        """(n,) what the means leave out of each root: its distance from its characteristic exponent, over its size."""
        averaged, exact, doubt = self.exponents()
        near = np.argmin(np.abs(averaged[None, :] - np.asarray(eigenvalue)[:, None]), axis=1)
        size = np.maximum(np.abs(eigenvalue), np.finfo(float).eps * np.max(np.abs(eigenvalue), initial=1e-300))
        return np.asarray((np.abs(exact[near] - averaged[near]) + doubt[near]) / size)


def interpolation(n: int, place: np.ndarray) -> np.ndarray:
    """(len(place), n) weights of n values at 0, 1/n, ... of a period, n odd, for places in it."""
    x = np.asarray(place)[:, None] - np.arange(n) / n
    k = np.arange(1, (n - 1) // 2 + 1)
    return np.asarray((1.0 + 2.0 * np.cos(2 * np.pi * x[:, :, None] * k).sum(axis=2)) / n)
