"""Standard systems of nonlinear equations with their starts and sources, for tests and benches of `mb.root`: part of the zoo.

MGH: J. J. More, B. S. Garbow and K. E. Hillstrom, ACM Trans. Math. Softw. 7 (1981) 17-41, with the number there.
Luksan: L. Luksan, J. Optim. Theory Appl. 81 (1994) 569-590. Kelley: C. T. Kelley, Solving Nonlinear Equations with
Newton's Method, SIAM 2003. Raydan: M. Raydan, SIAM J. Optim. 7 (1997) 26-33.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from problems import Problem
from scipy.optimize import brentq


@dataclass
class RootProblem(Problem):
    """``model`` is F, with its standard start, the half width of the band of its Jacobian (None: full) and the symmetry of it. Its
    answer is a root (n,), by arithmetic, or None where no closed form is known.
    """

    model: Callable[[np.ndarray], np.ndarray]
    answer: np.ndarray | None
    name: str = field(kw_only=True)
    x0: np.ndarray = field(kw_only=True)
    band: int | None = None
    symmetric: bool = False

    @property
    def fun(self) -> Callable[[np.ndarray], np.ndarray]:
        return self.model

    @property
    def n(self) -> int:
        return len(self.x0)

    def sparsity(self):
        """The band as a scipy.sparse matrix."""
        import scipy.sparse

        width = range(-self.band, self.band + 1)
        return scipy.sparse.diags([1.0] * len(width), list(width), shape=(self.n, self.n), format="csc")


def _shifted(x):
    return np.r_[0.0, x[:-1]], np.r_[x[1:], 0.0]


def rosenbrock(x):
    f = np.empty_like(x)
    f[0::2], f[1::2] = 10 * (x[1::2] - x[0::2] ** 2), 1 - x[0::2]
    return f


def powell_singular(x):
    a, b, c, d = x[0::4], x[1::4], x[2::4], x[3::4]
    f = np.empty_like(x)
    f[0::4], f[1::4] = a + 10 * b, np.sqrt(5) * (c - d)
    f[2::4], f[3::4] = (b - 2 * c) ** 2, np.sqrt(10) * (a - d) ** 2
    return f


def freudenstein_roth(x):
    a, b = x[0::2], x[1::2]
    f = np.empty_like(x)
    f[0::2], f[1::2] = a + ((5 - b) * b - 2) * b - 13, a + ((b + 1) * b - 14) * b - 29
    return f


def powell_badly_scaled(x):
    return np.array([1e4 * x[0] * x[1] - 1, np.exp(-x[0]) + np.exp(-x[1]) - 1.0001])


def helical_valley(x):
    theta = np.arctan2(x[1], x[0]) / (2 * np.pi)
    return np.array([10 * (x[2] - 10 * theta), 10 * (np.hypot(x[0], x[1]) - 1), x[2]])


def trigonometric(x):
    i = np.arange(1, len(x) + 1)
    return len(x) - np.cos(x).sum() + i * (1 - np.cos(x)) - np.sin(x)


def brown_almost_linear(x):
    f = x + x.sum() - (len(x) + 1)
    f[-1] = np.prod(x) - 1
    return f


def _grid(n):
    return np.arange(1, n + 1) / (n + 1)


def boundary_value(x):
    n = len(x)
    before, after = _shifted(x)
    return 2 * x - before - after + (x + _grid(n) + 1) ** 3 / (2 * (n + 1) ** 2)


def integral(x):
    n = len(x)
    t = _grid(n)
    c = (x + t + 1) ** 3
    left, right = np.cumsum(t * c), np.cumsum(((1 - t) * c)[::-1])[::-1] - (1 - t) * c
    return x + ((1 - t) * left + t * right) / (2 * (n + 1))


def broyden_tridiagonal(x):
    before, after = _shifted(x)
    return (3 - 2 * x) * x - before - 2 * after + 1


def broyden_banded(x):
    n = len(x)
    g = np.r_[0.0, np.cumsum(x * (1 + x))]
    i = np.arange(n)
    near = g[np.minimum(n, i + 2)] - g[np.maximum(0, i - 5)] - x * (1 + x)
    return x * (2 + 5 * x**2) + 1 - near


def chebyquad(x):
    n = len(x)
    before, now = np.ones(n), 2 * x - 1
    f = np.empty(n)
    for i in range(1, n + 1):
        f[i - 1] = now.mean() + (1 / (i * i - 1) if i % 2 == 0 else 0.0)
        before, now = now, 2 * (2 * x - 1) * now - before
    return f


def trigonometric_exponential(x):
    f = np.zeros_like(x)
    near = 2 * x[1:] + np.sin(x[:-1] - x[1:]) * np.sin(x[:-1] + x[1:])
    far = -x[:-1] * np.exp(x[:-1] - x[1:])
    f[0] = 3 * x[0] ** 3 - 5
    f[1:-1] = x[1:-1] * (4 + 3 * x[1:-1] ** 2) - 8
    f[-1] = 4 * x[-1] - 3
    f[:-1] += near
    f[1:] += far
    return f


def exponential(x):
    return np.exp(x) - 1 + _shifted(x)[0]


def cubic(x):
    before, after = _shifted(x)
    return 2 * x - before - after + x**3 - 1


def h_equation(x):
    n = len(x)
    mu = (np.arange(n) + 0.5) / n
    kernel = mu[:, None] / (mu[:, None] + mu[None, :])
    return x - 1 / (1 - 0.9 / (2 * n) * (kernel @ x))


def bratu(x):
    m = int(np.sqrt(len(x)))
    u = np.zeros((m + 2, m + 2))
    u[1:-1, 1:-1] = x.reshape(m, m)
    around = u[:-2, 1:-1] + u[2:, 1:-1] + u[1:-1, :-2] + u[1:-1, 2:]
    return (4 * u[1:-1, 1:-1] - around - 6.0 / (m + 1) ** 2 * np.exp(u[1:-1, 1:-1])).ravel()


def convex(x):
    return np.exp(x) - 1


def _badly_scaled_root(n):
    second = brentq(lambda b: np.exp(-1e-4 / b) + np.exp(-b) - 1.0001, 5.0, 15.0, xtol=1e-14)
    return np.array([1e-4 / second, second])


def problem(name: str, n: int | None = None) -> RootProblem:
    """The problem of that name at size n (None: its first size)."""
    fun, size, start, root, source, band, symmetric = TABLE[name]
    n = size if n is None else n
    answer = None if root is None else root(n)
    return RootProblem(fun, answer, source, name=name, x0=start(n), band=band, symmetric=symmetric)


def _repeated(*values):
    """These values, over and over."""
    return lambda n: np.tile(np.array(values, dtype=float), n // len(values))


def _bent(n):
    return _grid(n) * (_grid(n) - 1)


# name: F, first size, start, root, source, half width of the band, symmetric Jacobian
TABLE = {
    "Rosenbrock": (rosenbrock, 10, _repeated(-1.2, 1), np.ones, "MGH 21", 1, False),
    "Powell singular": (powell_singular, 4, _repeated(3, -1, 0, 1), np.zeros, "MGH 22", 3, False),
    "Freudenstein-Roth": (
        freudenstein_roth,
        10,
        _repeated(6, 5),
        _repeated(5, 4),
        "MGH 2, repeated; start (6, 5)",
        1,
        False,
    ),
    "Powell badly scaled": (powell_badly_scaled, 2, _repeated(0, 1), _badly_scaled_root, "MGH 3", None, False),
    "helical valley": (helical_valley, 3, _repeated(-1, 0, 0), _repeated(1, 0, 0), "MGH 7", None, False),
    "trigonometric": (trigonometric, 10, lambda n: np.full(n, 1 / n), np.zeros, "MGH 26", None, False),
    "Brown almost-linear": (brown_almost_linear, 10, lambda n: np.full(n, 0.5), np.ones, "MGH 27", None, False),
    "boundary value": (boundary_value, 10, _bent, None, "MGH 28", 1, True),
    "integral": (integral, 10, _bent, None, "MGH 29", None, False),
    "Broyden tridiagonal": (broyden_tridiagonal, 10, _repeated(-1), None, "MGH 30", 1, False),
    "Broyden banded": (broyden_banded, 10, _repeated(-1), None, "MGH 31", 5, False),
    "Chebyquad": (chebyquad, 7, _grid, None, "MGH 35", None, False),
    "trigexp": (trigonometric_exponential, 100, np.zeros, np.ones, "Luksan, Toint's problem", 1, False),
    "exponential": (exponential, 2, np.ones, np.zeros, "own", 1, False),
    "tridiagonal cubic": (cubic, 10, np.zeros, None, "own", 1, True),
    "H-equation": (h_equation, 100, np.ones, None, "Kelley, c = 0.9", None, False),
    "Bratu": (bratu, 900, np.zeros, None, "Kelley; -u'' = 6 exp u on a square", 30, True),
    "strictly convex": (
        convex,
        1000,
        lambda n: np.arange(1, n + 1) / n,
        np.zeros,
        "Raydan, strictly convex 1",
        0,
        True,
    ),
}
# Their roots are not alone: another may be met.
SEVERAL_ROOTS = ("trigonometric", "Brown almost-linear", "Powell badly scaled")
