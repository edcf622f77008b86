"""Cost of the reduction for chain, tree and ladder (section 5.1 of Jiang, Chen and Luo 2011 counts matrices and prints
no times).

Three ways to M in minimal coordinates: all constraints at once (6n - m rows are given, as many coordinates are solved for, as
Kang's method inverts), the text's way in plain NumPy (B' from joint to joint, B'' from the cut joints, the products), and
`mb.linearize`, which adds C and K and never forms B'.
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
from mbrs.model.tables import tables
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


def two_matrices(model: mb.Model) -> tuple[np.ndarray, np.ndarray]:
    """B' (6n, tree) and B'' (tree, m) of hinges about z: joint after joint, and from the rows of those that close loops."""
    t = tables(model)
    x, n = t["x"], len(t["body_x"])
    centre = np.array([x[i : i + 3] for i in t["body_x"]])
    hinges = [(a, b, x[i : i + 3]) for a, b, i in zip(t["joint_a"], t["joint_b"], t["joint_x"], strict=True)]
    B, reached, cuts = np.zeros((n, 6, n)), np.zeros(n, dtype=bool), []
    for a, b, at in hinges:
        if reached[b]:
            cuts.append((a, b, at))
            continue
        if a >= 0:
            B[b] = B[a]
            B[b, :3] += np.cross(B[a, 3:].T, centre[b] - centre[a]).T
        B[b, :, np.count_nonzero(reached)] += np.r_[np.cross([0, 0, 1], centre[b] - at), 0, 0, 1]
        reached[b] = True
    count = np.count_nonzero(reached)
    open_loop = B[:, :, :count].reshape(6 * n, count)
    if not cuts:
        return open_loop, np.eye(count)

    def moved(body: int, at: np.ndarray) -> np.ndarray:
        """Translation and tilt of a body's point: the rows of a hinge about z."""
        if body < 0:
            return np.zeros((5, count))
        own = B[body, :, :count]
        return np.vstack([own[:3] + np.cross(own[3:].T, at - centre[body]).T, own[3:5]])

    rows = np.vstack([moved(b, at) - moved(a, at) for a, b, at in cuts])
    R, order = scipy.linalg.qr(rows, pivoting=True, mode="r")
    rank = np.count_nonzero(np.abs(np.diag(R)) > 1e-10 * abs(R[0, 0]))
    B2 = np.zeros((count, count - rank))
    B2[order[rank:], range(count - rank)] = 1.0
    B2[order[:rank]] = -scipy.linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:])
    return open_loop, B2


def measure(model: mb.Model) -> tuple[int, float, float, float]:
    """Coordinates, and the times of the three ways."""
    lin = mb.linearize(model)
    free = scipy.linalg.block_diag(*lin.body_mass_matrices)
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
        B1, B2 = two_matrices(model)
        return B2.T @ (B1.T @ free @ B1) @ B2

    # both maps allow the same motions
    other = np.linalg.multi_dot(two_matrices(model))
    if other.shape != lin.T.shape or np.abs(rows @ other).max() > 1e-10 * np.abs(other).max():
        raise RuntimeError(f"the NumPy reduction of {model.name} is wrong")
    return len(free), seconds(all_constraints), seconds(twice), seconds(lambda: mb.linearize(model))


def main(where: Path | str) -> None:
    """Print ratios, draw times over sizes."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained", sharey=True)
    rows = []
    for ax, (code, layers) in zip(axes, SIZES.items(), strict=True):
        found = np.array([measure(mb.examples.from_code(code.format(n))) for n in layers])
        for k, name in enumerate(("all constraints, NumPy", "B', B'', NumPy", "mb.linearize (M, C, K)"), 1):
            ax.loglog(found[:, 0], 1e3 * found[:, k], "o-", label=name)
        ax.set(title=code.format("n"), xlabel="coordinates 6n")
        ax.xaxis.set_minor_formatter(NullFormatter())
        last = found[-1]
        rows.append(
            (
                f"{code.format(layers[-1])}, {last[0]:.0f} coordinates",
                "less computational effort",
                f"all constraints {1e3 * last[1]:.3g} ms, B' and B'' in NumPy {1e3 * last[2]:.3g} ms, "
                f"mbrs, also C and K, {1e3 * last[3]:.3g} ms",
                "no time is printed",
            )
        )
    axes[0].set_ylabel("CPU time [ms]")
    axes[0].legend(fontsize=8)
    told(rows)
    save(figure, where, "reduction_cost.png")


if __name__ == "__main__":
    main(folder())
