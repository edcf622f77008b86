"""Cost of the reduction for chain, tree and ladder (section 5.1 of Jiang, Chen and Luo 2011 counts matrices and prints
no times).

Three ways to M and K in minimal coordinates: all constraints at once (the null space of 6n - m rows, as Kang's method
inverts), the text's products with B' and B'' (given: their own cost is left out), and `mb.linearize`, which finds its
maps anew, adds C and K, and never forms B'.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import scipy.linalg
from matplotlib.ticker import NullFormatter
from said import folder, save, told

SIZES = {"CL{}RF1": (10, 20, 40, 80), "TL{}RF1": (3, 4, 5, 6), "LL{}RF1": (3, 6, 12, 24)}


def seconds(call: Callable[[], object]) -> float:
    """CPU seconds of one call, the better of two."""
    best = np.inf
    for _ in range(2):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return best


def measure(model: mb.Model) -> tuple[int, float, float, float]:
    """Coordinates, and the times of the three ways."""
    lin = mb.linearize(model)
    free = scipy.linalg.block_diag(*lin.body_mass_matrices)
    B1, B2 = lin.B_open, lin.B_cut
    # rows of all joints: whatever vanishes on the motions that the joints allow
    rows = scipy.linalg.null_space(lin.T.T).T

    def all_constraints() -> np.ndarray:
        dependent = scipy.linalg.qr(rows, pivoting=True, mode="r")[1]
        inner, outer = dependent[: len(rows)], dependent[len(rows) :]
        B = np.zeros((rows.shape[1], len(outer)))
        B[outer, range(len(outer))] = 1.0
        B[inner] = -np.linalg.solve(rows[:, inner], rows[:, outer])
        return B.T @ free @ B

    def twice() -> np.ndarray:
        return B2.T @ (B1.T @ free @ B1) @ B2

    return len(free), seconds(all_constraints), seconds(twice), seconds(lambda: mb.linearize(model))


def main(where: Path | str) -> None:
    """Print ratios, draw times over sizes."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained", sharey=True)
    rows = []
    for ax, (code, layers) in zip(axes, SIZES.items(), strict=True):
        found = np.array([measure(mb.examples.from_code(code.format(n))) for n in layers])
        for k, name in enumerate(("all constraints, NumPy", "B', B'' given: products", "mb.linearize (M, C, K)"), 1):
            ax.loglog(found[:, 0], 1e3 * found[:, k], "o-", label=name)
        ax.set(title=code.format("n"), xlabel="coordinates 6n")
        ax.xaxis.set_minor_formatter(NullFormatter())
        last = found[-1]
        rows.append(
            (
                f"{code.format(layers[-1])}, {last[0]:.0f} coordinates",
                "less computational effort",
                f"all constraints {1e3 * last[1]:.3g} ms, products with given B' and B'' {1e3 * last[2]:.3g} ms, "
                f"mbrs with its own maps {1e3 * last[3]:.3g} ms",
                "no time is printed",
            )
        )
    axes[0].set_ylabel("CPU time [ms]")
    axes[0].legend(fontsize=8)
    told(rows)
    save(figure, where, "reduction_cost.png")


if __name__ == "__main__":
    main(folder())
