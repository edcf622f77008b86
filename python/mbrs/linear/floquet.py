"""Linear systems with periodic coefficients: their means, and the characteristic exponents, which tell what the means leave out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

# Steps of the exponents for each azimuth: from the azimuths, and from the places between, whose difference tells the exponents' own error.
_STEPS = (4, 2)


@dataclass(frozen=True, eq=False)
class Lags:
    """States u of first order over a turn: M z" + D z' + S z = E u, u' = P z + R z' + A u.

    E ``effect`` (2 N, dof, m), P ``by_place`` and R ``by_rate`` (2 N, m, dof), A ``own`` (2 N, m, m), which holds -V of their axes,
    ``turning`` (m, m); ``names`` of what they are on.
    """

    effect: np.ndarray = field(repr=False)
    by_place: np.ndarray = field(repr=False)
    by_rate: np.ndarray = field(repr=False)
    own: np.ndarray = field(repr=False)
    turning: np.ndarray = field(repr=False)
    names: tuple[str, ...] = field(repr=False)

    def at(self, places: Any) -> Lags:
        """At some azimuths."""
        return replace(
            self,
            effect=self.effect[places],
            by_place=self.by_place[places],
            by_rate=self.by_rate[places],
            own=self.own[places],
        )

    def kept(self, places: np.ndarray) -> Lags:
        """With some coordinates."""
        P, R = self.by_place[:, :, places], self.by_rate[:, :, places]
        return replace(self, effect=self.effect[:, places], by_place=P, by_rate=R)

    def weighed(self, weight: np.ndarray) -> tuple[np.ndarray, ...]:
        """E, P, R and A between the azimuths."""
        four = (self.effect, self.by_place, self.by_rate, self.own)
        return tuple(np.einsum("tk,kij->tij", weight, x) for x in four)

    @property
    def mean(self) -> tuple[np.ndarray, ...]:
        """E, P, R and A."""
        return tuple(x.mean(axis=0) for x in (self.effect, self.by_place, self.by_rate, self.own))


@dataclass(frozen=True, eq=False)
class Periodic:
    """M, D, S (2 N, dof, dof) at N azimuths and half-way behind each, over a turn that takes ``period``, in axes in which nothing but
    them changes; with states of first order, ``lags``, D and S are those at held states.
    """

    M: np.ndarray = field(repr=False)
    D: np.ndarray = field(repr=False)
    S: np.ndarray = field(repr=False)
    period: float
    lags: Lags | None = None

    @property
    def mean(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.M.mean(axis=0), self.D.mean(axis=0), self.S.mean(axis=0)

    @property
    def varies(self) -> float:
        """The largest change of a row from its mean, over the row of the mean."""
        worst = 0.0
        lags = () if self.lags is None else (self.lags.effect, self.lags.by_place, self.lags.by_rate, self.lags.own)
        for own in (self.M, self.D, self.S, *lags):
            size = np.abs(own.mean(axis=0)).sum(axis=1)
            change = np.abs(own - own.mean(axis=0)).sum(axis=2).max(axis=0)
            worst = max(worst, float(np.max(change[size > 0.0] / size[size > 0.0], initial=0.0)))
        return worst

    def kept(self, places: Sequence[int] | np.ndarray) -> Periodic:
        """The part of some coordinates."""
        at = np.asarray(places, dtype=int)
        M, D, S = (x[:, at[:, None], at] for x in (self.M, self.D, self.S))
        return Periodic(M, D, S, self.period, None if self.lags is None else self.lags.kept(at))

    def at(self, places: Any) -> Periodic:
        """At some azimuths."""
        lags = None if self.lags is None else self.lags.at(places)
        return Periodic(self.M[places], self.D[places], self.S[places], self.period, lags)

    def state_matrices(self, t: np.ndarray) -> np.ndarray:
        """(len(t), 2 dof + m, 2 dof + m) A(t) of x' = A x, x = (z, z', u), interpolated by harmonics between an odd number of places."""
        weight = interpolation(len(self.M), t / self.period)
        M, D, S = (np.einsum("tk,kij->tij", weight, own) for own in (self.M, self.D, self.S))
        n = M.shape[1]
        m = 0 if self.lags is None else len(self.lags.turning)
        A = np.zeros((len(t), 2 * n + m, 2 * n + m))
        A[:, :n, n : 2 * n] = np.eye(n)
        A[:, n : 2 * n, :n], A[:, n : 2 * n, n : 2 * n] = -np.linalg.solve(M, S), -np.linalg.solve(M, D)
        if self.lags is not None:
            E, P, R, own = self.lags.weighed(weight)
            A[:, n : 2 * n, 2 * n :] = np.linalg.solve(M, E)
            A[:, 2 * n :, :n], A[:, 2 * n :, n : 2 * n], A[:, 2 * n :, 2 * n :] = P, R, own
        return A

    def monodromy(self, steps: int) -> np.ndarray:
        """(2 dof + m, 2 dof + m) what a turn makes of x: two exponentials a step, of order four. O(steps (dof + m)^3)."""
        from scipy.linalg import expm

        h = self.period / steps
        shift = np.sqrt(3.0) / 6.0
        a, b = 0.25 + shift, 0.25 - shift
        out = np.eye(self.state_matrices(np.zeros(1)).shape[1])
        for k in range(steps):
            first, second = self.state_matrices(h * (k + 0.5 + shift * np.array([-1.0, 1.0])))
            out = expm(h * (b * first + a * second)) @ expm(h * (a * first + b * second)) @ out
        return np.asarray(out)

    def exponents(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Roots (2 dof + m,) of the means, the characteristic exponents that belong to them, and how well the latter are known.

        An exponent is known but for multiples of 2 pi i over the period: the one nearest to the root of the means is taken.
        """
        from scipy.optimize import linear_sum_assignment

        M, D, S = (x[None] for x in self.mean)
        lags = self.lags
        if lags is not None:
            E, P, R, A = (x[None] for x in lags.mean)
            lags = Lags(E, P, R, A, lags.turning, lags.names)
        means = Periodic(M, D, S, self.period, lags)
        averaged, V = np.linalg.eig(means.state_matrices(np.zeros(1))[0])
        back = np.linalg.pinv(V)
        found = []
        for first, steps in enumerate(_STEPS):
            part = self.at(slice(first, None, 2))
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
