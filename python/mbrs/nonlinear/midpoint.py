"""Motion in time by the implicit midpoint rule, for checks of large systems and of laws with memory.

One sparse factorisation per step size; the laws enter through the few displacements they see. The rule is symmetric in time,
so that its error has even powers of the step (Hairer, Lubich, Wanner, Geometric Numerical Integration, 2006, V.3).
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from . import balance

ITERATIONS = 40
# Correction of displacements within a step, over them, that is rounding. Larger: steps are not solved. Smaller: iterations for nothing.
SOLVED = 1e-13


class Slider:
    """A Jenkins element (or one slider of Iwan's) at present: force and slope at a displacement, then its new place."""

    def __init__(self, k: float, slip: float, z: float = 0.0) -> None:
        self.k, self.slip, self.z = k, slip, z

    def force(self, u: float) -> tuple[float, float]:
        """k (u - z), at most the slip force, and its slope."""
        trial = self.k * (u - self.z)
        return (trial, self.k) if abs(trial) <= self.slip else (np.copysign(self.slip, trial), 0.0)

    def move(self, u: float) -> None:
        """The slider follows beyond its slip force."""
        trial = self.k * (u - self.z)
        if abs(trial) > self.slip:
            self.z = u - np.copysign(self.slip, trial) / self.k


def sliders_of(law: Any, history: np.ndarray) -> list[Slider]:
    """The sliders of a law after two passes through one period of its displacement, where they repeat themselves."""
    numbers = law.numbers()
    start = law.start or [0.0] * (len(numbers) // 2)
    out = [Slider(k, slip, z) for k, slip, z in zip(numbers[0::2], numbers[1::2], start, strict=True)]
    for slider in out:
        for u in np.tile(history, 2):
            slider.move(float(u))
    return out


class Element:
    """A law along its directions, with its memory; ``slopes`` (phase, u, v) gives forces, df/du and df/dv of laws without, on ``own``,
    its places among the displacements of all."""

    def __init__(self, law: Any, slopes: Callable[..., Sequence[Any]], history: np.ndarray, own: slice) -> None:
        self.slopes, self.own = slopes, own
        self.sliders = sliders_of(law, history) if law.has_memory else []

    def force(self, u: np.ndarray, v: np.ndarray, phase: float) -> tuple[Any, Any, Any]:
        """Forces (m,), df/du and df/dv (m, m)."""
        if self.sliders:
            parts = [slider.force(float(u[0])) for slider in self.sliders]
            return sum(p[0] for p in parts), sum(p[1] for p in parts), 0.0
        f, f_u, f_v = self.slopes(phase, u, v)
        m = len(u)
        return f, np.reshape(f_u, (m, m)), np.reshape(f_v, (m, m))

    def move(self, u: np.ndarray) -> None:
        """Memory after a step with these displacements in its middle."""
        for slider in self.sliders:
            slider.move(float(u[0]))


def integrate(
    system: Any,
    load: Callable[[float], np.ndarray],
    omega: float,
    state: tuple[np.ndarray, np.ndarray],
    span: tuple[float, int],
    histories: list[np.ndarray],
    every: int,
) -> np.ndarray:
    """x at every so many steps, (n, n_out + 1), from the state (x, x') over ``span`` = (time, steps).

    ``omega`` is the rate of the phase that varying stiffnesses follow, ``histories`` displacements of the elements over the
    period before the start, from which their sliders know where they are.
    """
    import scipy.sparse as sp
    import scipy.sparse.linalg as spl

    def matrix(*parts: Any) -> Any:
        return sum((sp.csc_matrix(A) for A in parts if A is not None), sp.csc_matrix((system.n, system.n)))

    M = matrix(system.M)
    C = matrix(system.C, getattr(system, "G", None))
    K = matrix(system.K, getattr(system, "N", None))
    h = span[0] / span[1]
    A = spl.splu((2 / h**2 * M + C / h + K / 2).tocsc())
    directions = [w for law in system.elements for w in law.directions]
    core = balance.core_elements(system.elements, directions)
    ends = np.cumsum([0, *(len(law.directions) for law in system.elements)])
    laws = enumerate(zip(system.elements, histories, itertools.pairwise(ends.tolist()), strict=True))
    elements = [
        Element(law, functools.partial(core.slopes, i), history, slice(*own)) for i, (law, history, own) in laws
    ]
    W = np.array(directions).T.reshape(system.n, len(directions))
    G = A.solve(W) if elements else W
    compliance = W.T @ G
    x, v = state[0].copy(), state[1].copy()
    out = [x.copy()]
    guess = np.zeros(len(directions))
    for step in range(span[1]):
        t = (step + 0.5) * h
        d = A.solve(load(t) + 2 / h * (M @ v) - K @ x)
        if elements:
            u = W.T @ x
            free = W.T @ d
            e, f = _elements(elements, u, free, guess + free, compliance, h, omega * t)
            guess = e - free
            d = d - G @ f
            for element in elements:
                element.move((u + e / 2)[element.own])
        x = x + d
        v = 2 / h * d - v
        if (step + 1) % every == 0:
            out.append(x.copy())
    return np.array(out).T


def _elements(
    elements: list[Element],
    u: np.ndarray,
    free: np.ndarray,
    e: np.ndarray,
    compliance: np.ndarray,
    h: float,
    phase: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Increments e of the displacements with e = free - compliance f(u + e/2, e/h), and the forces."""
    f, slope = np.zeros(len(e)), np.zeros((len(e), len(e)))
    for _ in range(ITERATIONS):
        for element in elements:
            own = element.own
            f[own], f_u, f_v = element.force(u[own] + e[own] / 2, e[own] / h, phase)
            slope[own, own] = f_u / 2 + f_v / h
        defect = e - free + compliance @ f
        correction = np.linalg.solve(np.eye(len(e)) + compliance @ slope, -defect)
        e = e + correction
        if np.max(np.abs(correction)) <= SOLVED * (np.max(np.abs(u)) + np.max(np.abs(e))):
            break
    return e, f


def is_smooth(laws: Any) -> bool:
    """True if the error of the rule has an expansion that extrapolation may use: no kinks."""
    return all(law.kind.smooth or (law.kind.name == "Gap" and law.numbers()[2] > 0) for law in laws)
