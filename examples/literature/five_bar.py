"""The five-bar linkage with springs of Dopico and others (2018): its motion, direct and adjoint gradients, and the springs that
keep it still.

The benchmark of earlier literature; its data were found by a search, so that its published gradient comes out.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told

TARGET, END, STEP = np.array([0.5, -2.0, 0.0]), 5.0, 1e-2  # place of point 2 as drawn
LENGTHS = ["spring1.length", "spring2.length"]
KNOWN, PUBLISHED = (-4.22881085, 3.21160410), (-4.229, 3.210)


def main(where: Path | str) -> None:
    """Print gradients and the optimum, draw motion and sensitivities."""
    m = mb.examples.five_bar()
    psi = mb.Integral(lambda s: np.sum((s.point("P2") - TARGET) ** 2))
    direct, adjoint = (
        mb.gradient(m, psi, LENGTHS, t=END, step=STEP, method=method) for method in ("direct", "adjoint")
    )
    finer = mb.gradient(m, psi, LENGTHS, t=END, step=STEP / 2, method="direct").gradient
    errors = [np.abs(g - KNOWN).max() for g in (direct.gradient, finer)]
    drawn = mb.examples.five_bar()  # the optimisation changes its model
    traj = mb.simulate(drawn, t=END, step=STEP, method="ali3p", parameters=LENGTHS)
    bounds = {name: (1.0, 4.0) for name in LENGTHS}
    best = mb.problem(m, psi, LENGTHS, t=END, step=STEP, bounds=bounds).solve("SLSQP", options={"ftol": 1e-14})
    told([
        (
            "gradient of the integral of |r2 - r20|^2 by the natural lengths",
            f"validated; {PUBLISHED} in later literature",
            f"({direct.gradient[0]:.5f}, {direct.gradient[1]:.5f}), off by {errors[0]:.1e} at h = {STEP:g} s, "
            f"{errors[1]:.1e} at half of it; adjoint off direct by {np.abs(adjoint.gradient - direct.gradient).max():.0e}",
            "data of the benchmark are reconstructed",
        ),
        (
            "optimum",
            "sensitivities are for optimisation; none is printed",
            f"lengths {best.x[0]:.5f} and {best.x[1]:.5f} m, psi {best.value:.1e}, {len(best.history)} evaluations",
            "",
        ),
    ])  # fmt: skip
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for k, axis in enumerate("xy"):
        axes[0].plot(traj.t, traj.point("P2")[:, k], label=f"{axis} of point 2")
    for ax, which in zip(axes[1:], range(2), strict=True):
        ax.plot(traj.t, traj.sensitivity("P2.position")[:, :2, which], label=["d x / d L", "d y / d L"])
        ax.set_title(f"by the natural length of spring {which + 1}")
    axes[0].set_title("motion [m]")
    for ax in axes:
        ax.set_xlabel("t [s]")
        ax.margins(y=0.25)
        ax.legend(fontsize=8, loc="upper right", ncols=2)
    save(figure, where, "five_bar.png")


if __name__ == "__main__":
    main(folder())
