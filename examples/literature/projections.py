"""The index-3 augmented Lagrangian with projections opened (Dopico and others 2018): penalty, passes, residuals.

The five-bar and the point with a nonholonomic row by `mb.simulate(..., method="ali3p", penalty=, passes=)`: the distance of the motion
from that of the limit, in which no penalty is left, after one or more updates of the multipliers in every linear system, and the
residuals of velocities and accelerations before and after their projections. Data: see five_bar.py and particle.py.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from matplotlib.ticker import NullFormatter
from said import folder, save, told

END, STEP = 0.2, 1e-2
SCENES = {"five-bar": mb.examples.five_bar, "point with a nonholonomic row": mb.examples.nonholonomic_particle}
PENALTIES, PASSES, STEPS = 10.0 ** np.arange(1, 10, 2), (1, 2, 4), (2e-2, 1e-2, 5e-3, 2.5e-3)
ROUNDING = 1e-17  # the floor of the pictures


def distances(m: mb.Model) -> np.ndarray:
    """Largest distance of coordinates (m or rad) from the limit, (passes, penalties)."""
    limit = mb.simulate(m, t=END, step=STEP, method="ali3p").q
    out = np.empty((len(PASSES), len(PENALTIES)))
    for i, j in np.ndindex(*out.shape):
        q = mb.simulate(m, t=END, step=STEP, method="ali3p", penalty=PENALTIES[j], passes=PASSES[i]).q
        out[i, j] = np.abs(q - limit).max()
    return out


def residuals(m: mb.Model, level: str) -> np.ndarray:
    """Largest residual before and after a projection, (steps, 2)."""
    out = []
    for h in STEPS:
        measures = mb.simulate(m, t=END, step=h, method="ali3p", penalty=1e5, passes=4).stats.measures
        out.append([measures[f"{level} residual {when} projection"] for when in ("before", "after")])
    return np.array(out)


def main(where: Path | str) -> None:
    """Print distances and residuals, draw them."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    rows = []
    for ax, (name, make) in zip(axes, SCENES.items(), strict=False):
        m = make()
        found = distances(m)
        for passes, line in zip(PASSES, found, strict=True):
            ax.loglog(PENALTIES, np.maximum(line, ROUNDING), "o-", label=f"passes={passes}")
        table = "; ".join(
            f"{passes}: " + ", ".join(f"{d:.0e}" for d in line) for passes, line in zip(PASSES, found, strict=True)
        )
        penalties = ", ".join(f"{p:.0e}" for p in PENALTIES)
        rows.append(
            (
                f"{name}: distance from the limit of many passes, for penalties {penalties}",
                "a penalty factor, multipliers iterated",
                f"passes {table}",
                "numbers are not printed",
            )
        )
        ax.set(xlabel="penalty [effective masses]", ylabel="distance from the limit", title=name)
        for level in ("velocity", "acceleration"):
            before, after = residuals(m, level).T
            color = f"C{len(axes[2].lines) // 2}"
            axes[2].loglog(STEPS, np.maximum(before, ROUNDING), "o-", color=color, label=f"{name}: {level}")
            axes[2].loglog(STEPS, np.maximum(after, ROUNDING), "x:", color=color)
            order = (
                "the rows are those of the step itself"
                if before.max() < 1e-12
                else f"order {np.log2(before[-2] / before[-1]):.1f} in h"
            )
            rows.append(
                (
                    f"{name}: residual of the {level} rows, h = {STEPS[1]:g} s",
                    "velocity and acceleration projections",
                    f"{before[1]:.1e} before ({order}), {after[1]:.0e} after",
                    "numbers are not printed",
                )
            )
    axes[2].set(xlabel="step h [s]", ylabel="largest residual", title="rows before (circles), after (crosses)")
    for ax in axes:
        ax.legend(fontsize=6)
        ax.xaxis.set_minor_formatter(NullFormatter())
    told(rows)
    save(figure, where, "projections.png")


if __name__ == "__main__":
    main(folder())
