"""The swing of two rods by four methods: displacements, velocities and angle (figures 5, 6 and 7 of J. Algorithms
Comput. Technol. 2017).

The known angle is that of the free rod's own equation, solved by DOP853 (docs/theory.md (23.11)). Lengths and the
second mass are lost.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told
from solver_words import truth

METHODS: dict[str, dict[str, Any]] = {
    "explicit": {"method": "explicit", "rtol": 1e-8},
    "bdf (Newton)": {"method": "bdf", "step": 5e-3},
    "bdf-bfgs, tree coordinates": {"method": "bdf-bfgs", "step": 5e-3},
    "bdf-bfgs, absolute coordinates": {"method": "bdf-bfgs", "step": 5e-3, "coordinates": "absolute"},
}


def main(where: Path | str) -> None:
    """Print the error of each method, draw the figures."""
    m = mb.examples.swing()
    t = np.linspace(0.0, 5.0, 101)
    known = truth(t)
    figure, axes = plt.subplots(4, 2, figsize=(11, 11), layout="constrained", sharex=True)
    rows = []
    for (name, options), mark in zip(METHODS.items(), ("-", "--", "-.", ":"), strict=True):
        traj = mb.simulate(m, t=t, **options)
        # a hinge that is a set of rows does not count its turns
        angle = np.unwrap(traj.joint("m")) + np.unwrap(traj.joint("n"))
        error = np.abs(angle - known[:, 5])
        place, velocity = {b: traj.position(b) for b in "AB"}, traj.velocity("B")
        curves = (
            place["A"][:, 0],
            place["A"][:, 1],
            place["B"][:, 0],
            place["B"][:, 1],
            velocity[:, 0],
            velocity[:, 1],
            angle,
        )
        for ax, curve in zip(axes.flat, curves, strict=False):
            ax.plot(t, curve, mark, label=name)
        axes.flat[7].semilogy(t[1:], np.maximum(error[1:], 1e-13), label=name)
        n = traj.stats.counts
        work = f"{n.get('residual evaluations', n.get('force evaluations', 0)) / (len(traj.steps) - 1):.1f} evaluations a step"
        rows.append(
            (
                name,
                "fits Adams",
                f"angle of B off by at most {error.max():.1e} rad; {work}; {traj.stats.route}",
                "lengths, mass and inertia of B are lost",
            )
        )
    titles = (
        "5a: x of A [m]",
        "5b: y of A [m]",
        "5c: x of B [m]",
        "5d: y of B [m]",
        "6a: x velocity of B [m/s]",
        "6b: y velocity of B [m/s]",
        "7: angle of B [rad]",
        "error of the angle [rad]",
    )
    for ax, title in zip(axes.flat, titles, strict=True):
        ax.set_title(title, fontsize=10)
    for ax in axes[-1]:
        ax.set_xlabel("t [s]")
    axes.flat[0].legend(fontsize=7)
    told(rows)
    save(figure, where, "swing.png")


if __name__ == "__main__":
    main(folder())
