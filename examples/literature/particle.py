"""The point mass with a nonholonomic constraint of Dopico and others (2018): one body and one row of velocities,
y' = b z x'.

Data of the text are lost: springs to the origin, start and objective are an example of this repository (docs/theory.md
(23.13)).
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told

NAMES, END = ["k", "m", "b"], 5.0
KNOWN = np.array([0.02152155, -0.21521547, 0.29491657])  # docs/theory.md (23.13)
STEPS = (2e-2, 1e-2, 5e-3)


def main(where: Path | str) -> None:
    """Print errors over the step, draw path, row and sensitivities."""
    m = mb.examples.nonholonomic_particle()
    psi = mb.Integral(lambda s: np.sum(s.position("point") ** 2))
    found = [mb.gradient(m, psi, NAMES, t=END, step=h, method="direct").gradient for h in STEPS]
    adjoint = mb.gradient(m, psi, NAMES, t=END, step=STEPS[-1], method="adjoint").gradient
    errors = [np.abs(g - KNOWN).max() for g in found]
    traj = mb.simulate(m, t=END, step=STEPS[-1], method="ali3p", parameters=NAMES)
    r, v = traj.position("point"), traj.velocity("point")
    row = v[:, 1] - r[:, 2] * v[:, 0]
    told([
        (
            "gradient of the integral of |r|^2 by stiffness, mass and b",
            "validated on a point mass with nonholonomic constraints",
            f"errors {', '.join(f'{e:.1e}' for e in errors)} at h = {', '.join(map(str, STEPS))} s (order "
            f"{np.log2(errors[-2] / errors[-1]):.1f}); adjoint off direct by {np.abs(adjoint - found[-1]).max():.0e}",
            "data and objective of the text are lost",
        ),
        (
            "the row y' - b z x' along the motion",
            "velocity projection",
            f"at most {np.abs(row).max():.0e} m/s after the projections",
            "not printed",
        ),
    ])  # fmt: skip
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    axes[0].plot(r[:, 0], r[:, 1], label="path")
    axes[0].plot(*r[0, :2], "ko", label="start")
    axes[0].set(title="seen along z", xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes[1].plot(traj.t, r, label=["x [m]", "y [m]", "z [m]"])
    axes[2].plot(traj.t, traj.sensitivity("point.position")[:, 1], label=[f"d y / d {name}" for name in NAMES])
    axes[1].set_title("motion")
    axes[2].set_title("sensitivities of y")
    for ax in axes:
        ax.legend(fontsize=8)
    for ax in axes[1:]:
        ax.set_xlabel("t [s]")
    save(figure, where, "particle.png")


if __name__ == "__main__":
    main(folder())
