"""Sizes and matrices of the two reductions M -> B'^T M B' -> B''^T M' B'' (Jiang, Chen and Luo 2011, section 5.1).

n bodies, p constraints of the open tree, q of the whole system, m degrees of freedom. Kang's method inverts a matrix of
size 6n - m, the text's one of size 6n - p - m. Here all matrices of a tree and a ladder are formed, with those of free
bodies from the plain NumPy reference, and the roots of the reduced ones are compared with `mb.modes`.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import scipy.linalg
from mbrs import reference
from mbrs.model.tables import tables
from mbrs.reference.dynamics import elements
from mbrs.reference.kinematics import moving
from said import folder, save, told


def reduced(model: mb.Model) -> tuple[mb.Linearization, list[np.ndarray], float]:
    """M of free bodies, M' of the open tree and M'' in minimal coordinates, and the largest distance of the roots from `mb.modes`, Hz."""
    lin = mb.linearize(model)
    free = scipy.linalg.block_diag(*lin.body_mass_matrices)
    own = reference.System(tables(model))
    state = reference.sensitivity.drawn_and_assembled(own)
    unit = np.eye(6 * own.nb)
    K, C = (
        elements(own, moving(state, np.zeros(6 * own.nb), **{change: unit})).derivative_along(6 * own.nb)[:, 0].T
        for change in ("pose", "twist")
    )
    maps = lin.B_open, lin.B_cut
    M2, K2, C2 = (maps[1].T @ (maps[0].T @ X @ maps[0]) @ maps[1] for X in (free, K, C))
    n = lin.n
    state_matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M2, K2), -np.linalg.solve(M2, C2)]])
    roots = np.sort(np.abs(np.linalg.eigvals(state_matrix)))[::2] / (2 * np.pi)
    distance = np.abs(roots - np.sort(mb.modes(model).frequency)).max()
    return lin, [free, maps[0].T @ free @ maps[0], M2], float(distance)


def main(where: Path | str) -> None:
    """Print the sizes, draw the matrices."""
    rows = []
    for code in ("CL10RF1", "TL5SF1", "LL3RF1", "LL3SF1"):
        model = mb.examples.from_code(code)
        system = mb.System(model)
        lin, chain, distance = reduced(model)
        n, p, q, m = 6 * len(model.bodies), system.n_open, system.n_constraints, system.dof
        sizes = " -> ".join(str(len(X)) for X in chain)
        rows.append((
            code, "inverts 6n - p - m; Kang's method 6n - m",
            f"6n = {n}, p = {p}, q = {q}, m = {m}: {n - p - m} instead of {n - m}; M: {sizes}; roots within {distance:.0e} Hz",
            "",
        ))  # fmt: skip
    told(rows)
    model = mb.examples.from_code("LL3RF1")
    lin, chain, _ = reduced(model)
    shown = {
        "M": chain[0],
        "B'": lin.B_open,
        "M' = B'^T M B'": chain[1],
        "B''": lin.B_cut,
        "M'' = B''^T M' B''": chain[2],
    }
    figure, axes = plt.subplots(1, len(shown), figsize=(13, 3.6), width_ratios=[3, 2, 1.4, 1, 1])
    for ax, (name, X) in zip(axes, shown.items(), strict=True):
        ax.spy(np.abs(X) > 1e-12 * np.abs(X).max(), markersize=2)
        ax.set_title(f"{name}\n{X.shape[0]} x {X.shape[1]}", fontsize=9)
        ax.set_xticks([]), ax.set_yticks([])
    figure.suptitle("ladder of three layers with hinges: 9 bodies, 3 degrees of freedom", y=1.06)
    save(figure, where, "matrices.png")


if __name__ == "__main__":
    main(folder())
