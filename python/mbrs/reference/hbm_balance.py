"""Harmonic balance in plain NumPy, by evaluation matrices instead of an FFT: the oracle of the core.

Coefficients (dof, 2H+1) [a0, a1, b1, ...] of a periodic motion, or of one on a torus of d phases, whose harmonics have d indices each;
as a vector harmonic by harmonic, all coordinates of one coefficient together.
T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56 (1989) 149-154.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import ConvergenceError, ModelError
from . import laws
from .so3 import Array

STEP = 1e-30  # complex step: no difference is taken


def dense(system: Any) -> tuple[Array, Array, Array]:
    """M, C + G, K + N as dense arrays."""

    def array(a: Any) -> Array:
        if a is None:
            return np.zeros((system.n, system.n))
        return np.asarray(a.toarray() if hasattr(a, "toarray") else a, dtype=float)

    return array(system.M), array(system.C) + array(system.G), array(system.K) + array(system.N)


def phases(n_samples: int | Sequence[int]) -> Array:
    """(d, n) phases of the samples over the torus."""
    sides = [2 * np.pi * np.arange(n) / n for n in np.atleast_1d(n_samples)]
    return np.array(np.meshgrid(*sides, indexing="ij")).reshape(len(sides), -1)


def evaluation(harmonics: Any, n_samples: int | Sequence[int]) -> Array:
    """Gamma (n, 2H+1): samples from coefficients; ``harmonics`` (H,) or (H, d)."""
    angle = np.asarray(harmonics).reshape(len(harmonics), -1) @ phases(n_samples)
    gamma = np.ones((angle.shape[1], 2 * len(angle) + 1))
    gamma[:, 1::2], gamma[:, 2::2] = np.cos(angle).T, np.sin(angle).T
    return gamma


def rates(frequencies: Array) -> Array:
    """Matrix of d/dt on coefficients, for the circular frequencies of the harmonics."""
    D = np.zeros((2 * len(frequencies) + 1,) * 2)
    for j, w in enumerate(frequencies):
        D[2 * j + 1, 2 * j + 2], D[2 * j + 2, 2 * j + 1] = w, -w
    return D


def force_vector(system: Any, force: Any, harmonics: Sequence[int], subharmonic: int = 1) -> Array:
    """Force coefficients (2H+1, n)."""
    terms = np.zeros((len(harmonics) + 1, system.n), complex)
    for h, f in (force if isinstance(force, Mapping) else {1: force}).items():
        terms[0 if h == 0 else 1 + list(harmonics).index(h * subharmonic)] = f
    return coefficients(terms)


def coefficients(terms: Array) -> Array:
    """(2H+1, n) of the complex amplitudes (H+1, n), the constant first."""
    out = np.zeros((2 * len(terms) - 1, terms.shape[1]))
    out[0], out[1::2], out[2::2] = terms[0].real, terms[1:].real, -terms[1:].imag
    return out


def sampled(law: Any, u: Array, v: Array, phase: Array) -> tuple[Array, Array, Array]:
    """f, df/du, df/dv of a law without memory at samples (u, v) and excitation phases."""
    if hasattr(law, "function"):
        if law.derivatives is not None:
            return law.sampled(u, v)
        f_u, f_v = (np.imag(law.function(0.0, u + a, v + b)) / STEP for a, b in ((1j * STEP, 0.0), (0.0, 1j * STEP)))
        return law.force(u, v), f_u + np.zeros_like(u), f_v + np.zeros_like(u)
    f, f_u, f_v, _ = laws.force(law.code, np.asarray(law.numbers()), u, v, phase=phase)
    return f + np.zeros_like(u), f_u + np.zeros_like(u), f_v + np.zeros_like(u)


def march(law: Any, u: Array, du: Array) -> tuple[Array, Array]:
    """f (n,) and df/dX (n, n_c) of a law with memory over the second of two periods; du (n, n_c) = du/dX at the samples."""
    p, out = np.asarray(law.numbers()), []
    z = [np.zeros(du.shape[1], complex)] * laws.memory_size(law.code, len(p))
    for here, change in 2 * list(zip(u, du, strict=True)):
        f, _, _, z = laws.force(law.code, p, here + 1j * STEP * change, 0.0, z)
        out.append(f)
    second = np.array(out[len(u) :])
    return second[:, 0].real, second.imag / STEP


def balanced(
    system: Any, y: Array, f: Array, frequencies: tuple[Array, Array], gamma: Array, phase: Array
) -> tuple[Array, Array, Array]:
    """R, dR/dy and dR/domega at the vector y for the frequencies of the harmonics and their slopes by omega; phases (d, n)."""
    M, C, K = dense(system)
    D, D_omega = (rates(w) for w in frequencies)
    eye, inverse = np.eye(len(D)), np.linalg.pinv(gamma)
    linear = np.kron(eye, K) + np.kron(D, C) + np.kron(D @ D, M)
    R, J = linear @ y - f.ravel(), linear.copy()
    R_omega = (np.kron(D_omega, C) + np.kron(D_omega @ D + D @ D_omega, M)) @ y
    for law in system.elements:
        c = y.reshape(-1, system.n) @ law.w
        if law.has_memory:
            if len(phase) > 1:
                raise ModelError(f"the reference has no {law!r} on a torus; compare laws without memory")
            force, dF = march(law, gamma @ c, gamma)
            F_omega = 0 * c
        else:
            force, f_u, f_v = sampled(law, gamma @ c, gamma @ D @ c, phase[0])
            dF, F_omega = f_u[:, None] * gamma + f_v[:, None] * (gamma @ D), inverse @ (f_v * (gamma @ D_omega @ c))
        R, R_omega = R + np.kron(inverse @ force, law.w), R_omega + np.kron(F_omega, law.w)
        J = J + np.kron(inverse @ dF, np.outer(law.w, law.w))
    return R, J, R_omega


def residual(
    system: Any, y: Array, force: Any, omega: float, harmonics: Sequence[int], n_samples: int, subharmonic: int = 1
) -> tuple[Array, Array, Array]:
    """R, dR/dy, dR/domega of a periodic motion at the vector y (2H+1) n."""
    f, h = force_vector(system, force, harmonics, subharmonic), np.asarray(harmonics) / subharmonic
    return balanced(system, y, f, (h * omega, h), evaluation(harmonics, n_samples), subharmonic * phases(n_samples))


def newton(
    equations: Callable[[Array], tuple[Array, Array]], y: Array, tolerance: float, size: float = 0.0
) -> tuple[Array, Array]:
    """The root of residual and slope from y, and the last slope; steps end below the tolerance times the larger of |y| and size."""
    for _ in range(100):
        R, J = equations(y)
        step = np.linalg.solve(J, -R)
        y = y + step
        if np.max(np.abs(step)) <= tolerance * max(np.max(np.abs(y)), size, 1e-300):
            return y, J
    raise ConvergenceError("Newton's method did not converge within 100 steps; begin nearer to the solution")


def harmonic_balance(
    system: Any,
    force: Any,
    omega: float,
    harmonics: Sequence[int],
    n_samples: int,
    X: Array | None = None,
    subharmonic: int = 1,
    tolerance: float = 1e-12,
) -> Array:
    """Coefficients (dof, 2H+1) by plain Newton iterations from X."""
    n_c = 2 * len(harmonics) + 1
    y = np.zeros(n_c * system.n) if X is None else np.asarray(X, float).T.ravel()
    y, _ = newton(lambda y: residual(system, y, force, omega, harmonics, n_samples, subharmonic)[:2], y, tolerance)
    return y.reshape(n_c, system.n).T


def limit_cycle(
    system: Any, force: Any, omega: float, harmonics: Sequence[int], n_samples: int, X: Array, tolerance: float = 1e-11
) -> tuple[Array, float]:
    """Coefficients and omega of a free periodic motion from X and omega; it moves orthogonally to the flow at the start."""
    start = X.T.ravel()
    flow = np.kron(rates(np.asarray(harmonics)), np.eye(system.n)) @ start

    def equations(z: Array) -> tuple[Array, Array]:
        R, J, R_omega = residual(system, z[:-1], force, z[-1], harmonics, n_samples)
        return np.append(R, flow @ (z[:-1] - start)), np.block([[J, R_omega[:, None]], [flow, 0.0]])

    z, _ = newton(equations, np.append(start, omega), tolerance)
    return z[:-1].reshape(-1, system.n).T, float(z[-1])


def quasi_periodic(
    system: Any,
    terms: Array,
    omega: Array,
    indices: Array,
    n_samples: Sequence[int],
    X: Array,
    tolerance: float = 1e-12,
) -> Array:
    """Coefficients (dof, 2 n_k + 1) on the torus by Newton's method from X; ``terms`` (n_k + 1, n) are complex forces."""
    w = indices @ omega
    gamma, phase, f = evaluation(indices, n_samples), phases(n_samples), coefficients(terms)
    y, _ = newton(lambda y: balanced(system, y, f, (w, 0 * w), gamma, phase)[:2], X.T.ravel(), tolerance)
    return y.reshape(-1, system.n).T
