"""The table of nonlinear equations of the derivative-free solver's paper (J. Algorithms Comput. Technol. 2017):
algorithm I (inverse BFGS), II (the line-search method that it was compared with, here Broyden's update with the same
search) and Newton's method.

The functions and starts of the paper are lost: these are well known ones. I and II are `plain=True`, from the identity
as in the text and from differences.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told

Function = Callable[[np.ndarray], np.ndarray]


def tridiagonal(x: np.ndarray) -> np.ndarray:
    """Broyden's tridiagonal function: nonsymmetric Jacobian."""
    return (3 - 2 * x) * x - np.r_[0.0, x[:-1]] - 2 * np.r_[x[1:], 0.0] + 1


def boundary(x: np.ndarray) -> np.ndarray:
    """A discrete boundary value problem: symmetric Jacobian."""
    h = 1 / (len(x) + 1)
    t = h * np.arange(1, len(x) + 1)
    return 2 * x - np.r_[0.0, x[:-1]] - np.r_[x[1:], 0.0] + h**2 * (x + t + 1) ** 3 / 2


def rosenbrock(x: np.ndarray) -> np.ndarray:
    """Rosenbrock's function as two equations."""
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def singular(x: np.ndarray) -> np.ndarray:
    """Powell's function: the Jacobian at the solution is singular."""
    a, b, c, d = x
    return np.array([a + 10 * b, np.sqrt(5) * (c - d), (b - 2 * c) ** 2, np.sqrt(10) * (a - d) ** 2])


def convex(x: np.ndarray) -> np.ndarray:
    """Gradient of a strictly convex function."""
    return np.exp(x) - 1


SYSTEMS: dict[str, tuple[Function, np.ndarray]] = {
    "boundary value, 10": (boundary, np.linspace(0, 1, 12)[1:-1] * (np.linspace(0, 1, 12)[1:-1] - 1)),
    "strictly convex, 10": (convex, np.arange(1, 11) / 10.0),
    "Broyden tridiagonal, 10": (tridiagonal, -np.ones(10)),
    "Rosenbrock": (rosenbrock, np.array([-1.2, 1.0])),
    "Powell singular": (singular, np.array([3.0, -1.0, 0.0, 1.0])),
}
TOLERANCE, MOST = 1e-8, 300


def newton(fun: Function, x: np.ndarray) -> list[float]:
    """Norms of the iterates of Newton's method, the Jacobian by complex steps."""
    norms = [float(np.linalg.norm(fun(x)))]
    while norms[-1] > TOLERANCE and len(norms) < MOST:
        J = np.array([fun(x + 1e-40j * e).imag / 1e-40 for e in np.eye(len(x))]).T
        x = x - np.linalg.lstsq(J, fun(x), rcond=None)[0]
        norms.append(float(np.linalg.norm(fun(x))))
    return norms


def main(where: Path | str) -> None:
    """Print BKG, NI and NORM of each, draw the norms of one system."""
    figure, axes = plt.subplots(1, len(SYSTEMS), figsize=(15, 3.6), layout="constrained", sharey=True)
    rows = []
    for ax, (name, (fun, x0)) in zip(axes, SYSTEMS.items(), strict=True):
        cells = []
        for label, method, jac0 in (
            ("I", "inverse-bfgs", "identity"),
            ("II", "broyden", "identity"),
            ("I, differences", "inverse-bfgs", "fd"),
            ("II, differences", "broyden", "fd"),
        ):
            with np.errstate(all="ignore"):
                sol = mb.root(fun, x0, method=method, jac0=jac0, plain=True, tol=TOLERANCE, maxiter=MOST)
            cells.append(f"{label}: {sol.n_backtracks}/{sol.nit}/{sol.norm:.0e}" + ("" if sol.success else " fails"))
            ax.semilogy(sol.norms[:60], label=label)
        norms = newton(fun, x0)
        ax.semilogy(norms, "k:", label="Newton")
        cells.append(f"Newton: {len(norms) - 1} iterations")
        ax.set(title=name, xlabel="iteration")
        rows.append((name, "BKG/NI/NORM of I and II", "; ".join(cells), "functions and starts are lost"))
    axes[0].set(ylabel="|F|", ylim=(1e-12, 1e4))
    axes[0].legend(fontsize=7)
    told(rows)
    save(figure, where, "equations.png")


if __name__ == "__main__":
    main(folder())
