"""Fourier series on a torus of phases tau_i = omega_i t: which terms there are, their samples, and the problem of the core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb
from time import perf_counter
from typing import Any

import numpy as np

from .. import _core
from .._lib import checks
from .._lib.checks import shown
from .._lib.warning import warn_user
from ..errors import ModelError
from ..model.law import Law
from ..results import Stats
from . import balance, condensation
from .options import Fourier, integer
from .periodic import effects_of
from .quasi_periodic_solution import QuasiPeriodicSolution

COMMENSURABLE = 1e-9
SLOW = 1e-3
NONSMOOTH_SAMPLES = 96
MOST_UNKNOWNS = 6000
MOST_COMBINATIONS = 200_000
MOST_SAMPLES = 1 << 18


def n_terms(p: int, m: int) -> int:
    """Number of index vectors of `diamond`, (sum_i 2^i C(p, i) C(m, i) - 1) / 2: docs/theory.md (12.2)."""
    return (sum(2**i * comb(p, i) * comb(m, i) for i in range(min(p, m) + 1)) - 1) // 2


def _diamond_of(p: int, harmonics: Any) -> np.ndarray:
    m = integer("harmonics", harmonics)
    if m > MOST_UNKNOWNS or 2 * n_terms(p, m) + 1 > MOST_UNKNOWNS:
        raise ModelError(f"harmonics = {checks.shown(harmonics)} with {p} frequencies are too many terms; take fewer")
    return diamond(p, m)


def diamond(p: int, m: int) -> np.ndarray:
    """Index vectors (n_k, p) with sum |k_i| <= m, one of each pair +-k (first non-zero entry positive), by order,
    without 0."""
    box = np.zeros((1, 0), dtype=int)
    for _ in range(p):
        left = m - np.abs(box).sum(axis=1)
        box = np.vstack([np.append(k, i) for k, n in zip(box, left, strict=True) for i in range(-n, n + 1)])
    box = box[np.any(box != 0, axis=1)]
    first = box[np.arange(len(box)), np.argmax(box != 0, axis=1)]
    box = box[first > 0]
    return box[np.lexsort([*(-box.T[::-1]), np.abs(box).sum(axis=1)])]


class Torus:
    """The core's problem for a set of forces and terms."""

    def __init__(
        self,
        system: Any,
        forces: Sequence[Mapping[str, Any]],
        fourier: Fourier,
        indices: Any,
        static: Any,
        least_samples: list[int] | None = None,
        turn: bool = True,
    ) -> None:
        laws = balance.checked_system(system)
        for i, law in enumerate(laws):
            if law.has_memory:
                raise ModelError(f"elements[{i}], {law!r}, has a memory; quasi-periodic balance needs laws without")
        self.system, self.forces, self.static = system, forces, static
        self.fourier = fourier
        self._given_indices = indices
        self.omega, vectors, self.free = _sources(system.n, forces)
        p = len(self.omega)
        self.indices = _diamond_of(p, fourier.harmonics) if indices is None else _checked(indices, p)
        top = int(np.max(np.abs(self.indices).sum(axis=1)))
        if n_terms(p, max(top + 2, 5)) > MOST_COMBINATIONS:
            raise ModelError(
                f"{p} frequencies in combinations up to the order {top} are too many; take fewer of them or a lower order"
            )
        self._refuse_periodic(top)
        kept = {tuple(k) for k in self.indices.tolist()}
        extra = np.array([k for k in diamond(p, top + 2).tolist() if tuple(k) not in kept]).reshape(-1, p)
        self.dims, fine = self._samples(laws, extra, least_samples)
        self.terms, self.turn = self._terms(system.n, vectors), turn
        n_c = 2 * len(self.indices) + 1
        self.linear = condensation.linear_part(system, laws, self.terms, n_c, fourier.condense, turn)
        if self.linear.core.size * n_c > MOST_UNKNOWNS:
            raise ModelError(
                f"{self.linear.core.size * n_c} unknowns are too many; take fewer harmonics or coordinates"
            )
        self.estimated_unknowns = self.linear.core.size * (n_c + 2 * len(extra))
        elements = balance.core_elements(laws, self.linear.directions)
        self.core = balance.call_core(
            _core.HbmProblem,
            self.linear.core,
            elements,
            self.indices.tolist(),
            1,
            self.omega.tolist(),
            self.dims,
            extra.tolist(),
            fine,
        )

    def _samples(self, laws: Any, extra: np.ndarray, least: list[int] | None) -> tuple[list[int], list[int]]:
        """Samples per phase of the terms, and of the finer grid on which the terms beyond them are estimated."""
        dims = _samples(self.fourier.n_samples, laws, self.indices)
        if least is not None:
            dims = [max(n, m) for n, m in zip(dims, least, strict=True)]
        fine = [max(a, b) for a, b in zip(dims, _samples(None, laws, np.vstack([self.indices, extra])), strict=True)]
        if any(not law.kind.polynomial for law in laws):
            fine = [max(n, 3 * own // 2) for n, own in zip(fine, dims, strict=True)]  # to see the aliasing
        if np.prod([float(n) for n in fine]) > MOST_SAMPLES:
            raise ModelError(
                f"{' x '.join(str(n) for n in fine)} samples are too many; give fewer (n_samples=), or take fewer harmonics"
            )
        return dims, fine

    def _terms(self, n: int, vectors: Sequence[np.ndarray]) -> np.ndarray:
        """Complex forces of the terms, the constant first."""
        terms = np.zeros((len(self.indices) + 1, n), complex)
        if self.static is not None:
            terms[0] = balance.force_vector(n, self.static, 0)
        for i, (vector, unit) in enumerate(zip(vectors, np.eye(len(self.omega), dtype=int), strict=True)):
            at = np.flatnonzero(np.all(self.indices == unit, axis=1))
            if len(at) == 0:
                raise ModelError(f"indices lack the term of forces[{i}] itself, {unit.tolist()}")
            terms[1 + at[0]] = vector
        return terms

    def finer(self, answer: Mapping[str, Any]) -> Torus | None:
        """The same with twice the samples per dimension, where they are what limits an answer."""
        n = int(np.prod(self.dims))
        if n << len(self.dims) > MOST_SAMPLES:
            return None
        if balance.more_samples(1, answer["error"], answer["aliasing"], self.system.elements, self.fourier) is None:
            return None
        return self.of_system(self.system, [2 * n for n in self.dims])

    def of_system(self, system: Any, least_samples: list[int] | None = None) -> Torus:
        """The same forces and terms with another system, or with more samples."""
        return Torus(system, self.forces, self.fourier, self._given_indices, self.static, least_samples, self.turn)

    def member(self, system: Any) -> tuple[Any, Any]:
        """Linear part and elements of another system under the same forces, for the core."""
        laws = balance.checked_system(system)
        linear = condensation.linear_part(
            system, laws, self.terms, 2 * len(self.indices) + 1, self.fourier.condense, False
        )
        return linear.core, balance.core_elements(laws, linear.directions)

    def _refuse_periodic(self, top: int) -> None:
        if self.free is not None:
            return  # one of the frequencies is a guess
        k = diamond(len(self.omega), max(top, 5))
        distance = np.abs(k @ self.omega) / np.max(self.omega)
        worst = int(np.argmin(distance))
        combination = " + ".join(f"{int(n)} * {w:.6g}" for n, w in zip(k[worst], self.omega, strict=True) if n)
        if distance[worst] < COMMENSURABLE:
            raise ModelError(
                f"the frequencies are commensurable: {combination} = 0, so the motion is periodic; "
                "use harmonic_balance at their common divisor with forces in its harmonics"
            )
        if distance[worst] < SLOW and np.abs(k[worst]).sum() <= top:
            warn_user(
                f"the frequencies are almost commensurable: {combination} is only {distance[worst]:.1e} of the "
                "largest; the motion beats slowly and may need many terms"
            )

    def start(self, x0: Any) -> np.ndarray:
        """Unknowns of the core from an earlier solution."""
        X = np.zeros((self.system.n, 2 * len(self.indices) + 1))
        if x0 is not None:
            if not isinstance(x0, QuasiPeriodicSolution) or x0.X.shape[0] != self.system.n:
                raise ModelError("x0 must be a QuasiPeriodicSolution of a system of the same size")
            place = {tuple(k): j for j, k in enumerate(x0.indices.tolist())}
            X[:, 0] = x0.X[:, 0]
            for j, k in enumerate(self.indices.tolist()):
                if tuple(k) in place:
                    old = place[tuple(k)]
                    X[:, 2 * j + 1 : 2 * j + 3] = x0.X[:, 2 * old + 1 : 2 * old + 3]
        T = self.linear.transform
        return self.core.restrict(X if T is None else T.T @ X)

    def expand(self, y: np.ndarray, omega: np.ndarray, level: float = 1.0) -> np.ndarray:
        """(dof, 2 n_k + 1) of all coordinates."""
        X = balance.call_core(self.core.expand, y, omega.tolist(), level)
        return X if self.linear.transform is None else self.linear.transform @ X

    def solution(self, answer: Mapping[str, Any], started: float, own: float | None = None) -> QuasiPeriodicSolution:
        """An answer of the core as a result; ``own`` is the free frequency that was found."""
        counts = {key: answer[key] for key in ("iterations", "evaluations", "factorisations")}
        omega, forces = self.omega.copy(), list(self.forces)
        if self.free is not None and own is not None:
            omega[self.free] = own
            forces[self.free] = dict(force=np.zeros(self.system.n), omega=own)
        return QuasiPeriodicSolution(
            self.expand(answer["y"], omega),
            self.indices,
            omega,
            tuple(self.dims),
            self.system,
            forces,
            self.static,
            stats=Stats(perf_counter() - started, counts, effects_of(self.system), self.linear.route),
            error=answer["error"],
            status="converged" if answer["converged"] and answer["error"] <= self.fourier.limit() else "unresolved",
        )


def _sources(n: int, forces: Any) -> tuple[np.ndarray, list[np.ndarray], int | None]:
    """Frequencies, forces, and the number of the frequency that no force gives, if there is one."""
    if isinstance(forces, Mapping | str) or not isinstance(forces, Sequence) or len(forces) < 2:
        raise ModelError(
            "forces must list at least two mappings dict(force=(n,), omega=...); harmonic_balance takes one"
        )
    omega, vectors, free = [], [], []
    for i, source in enumerate(forces):
        if not isinstance(source, Mapping) or not source or set(source) - {"force", "omega", "frequency"}:
            raise ModelError(
                f"forces[{i}] must be dict(force=(n,), omega=...) or with frequency=, it is {shown(source)}"
            )
        w = balance.one_frequency(source.get("omega"), source.get("frequency"))
        if w.ndim != 0:
            raise ModelError(f"forces[{i}] needs one frequency, not {w.tolist()}")
        omega.append(float(w))
        if "force" not in source:
            free.append(i)
        vectors.append(balance.force_vector(n, source.get("force", np.zeros(n)), 1))
    if len(free) > 1:
        raise ModelError("one frequency at most may be the motion's own, a mapping without force=")
    return np.array(omega), vectors, free[0] if free else None


def _checked(indices: Any, p: int) -> np.ndarray:
    try:
        k = np.asarray(indices)
    except (ValueError, OverflowError):
        k = np.zeros(0)
    if k.ndim != 2 or k.shape[1] != p or k.shape[0] == 0 or not np.issubdtype(k.dtype, np.integer):
        raise ModelError(f"indices must be integers (n_k, {p}), their shape is {k.shape}")
    if not np.all(np.any(k != 0, axis=1)):
        raise ModelError("indices contain the zero vector; the constant term is always kept")
    first = k[np.arange(len(k)), np.argmax(k != 0, axis=1)]
    k = k * np.sign(first)[:, None]
    if len(np.unique(k, axis=0)) != len(k):
        raise ModelError("indices contain a vector twice, k and -k being the same term")
    return k.astype(int)


def _samples(n_samples: Any, laws: Sequence[Law], indices: np.ndarray) -> list[int]:
    """Samples per dimension; a law of degree q makes terms up to q times the largest index, so that (q + 1) k + 1
    do."""
    reach = np.max(np.abs(indices), axis=0)
    if n_samples is None:
        return [balance.fast_size(max([2 * k + 2, *(_least(law, k) for law in laws)])) for k in reach.tolist()]
    given = np.ravel(n_samples).tolist() if isinstance(n_samples, Sequence | np.ndarray) else [n_samples] * len(reach)
    if len(given) != len(reach):
        raise ModelError(f"n_samples must be one number or {len(reach)}, it is {checks.shown(n_samples)}")
    given = [checks.count("n_samples", n, balance.LARGEST_SAMPLE) for n in given]
    polynomial = [law for law in laws if law.kind.polynomial]
    for i, (n, k) in enumerate(zip(given, reach.tolist(), strict=True)):
        least = max([2 * k + 1, *(_least(law, k) for law in polynomial)])
        if n < least:
            raise ModelError(f"n_samples[{i}] = {n} aliases indices up to {k}; use at least {least}, or leave it out")
    return given


def _least(law: Law, k: int) -> int:
    return balance.alias_free(law, k, 1) if law.kind.polynomial else max(NONSMOOTH_SAMPLES, 6 * k)
