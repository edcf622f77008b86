"""The index-3 augmented Lagrangian with projections opened (Dopico and others 2018): penalty, passes, residuals,
gradients.

The five-bar and the point with a nonholonomic row in natural coordinates, by the plain NumPy scheme: passes of the
multipliers over the penalty, the residuals of velocities and accelerations before and behind their projections.
`mb.simulate(..., method="ali3p")` solves the limit, in which no penalty is left. The five-bar's data are found by a
search, the point's are an own example.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from matplotlib.ticker import NullFormatter
from said import folder, save, told

# the scheme in plain NumPy is an oracle of the tests
sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))
from oracles.ali3p import Scheme, Step
from oracles.ali3p_models import POINTS, FiveBar, NonholonomicPoint

KNOWN = -4.22881085, 3.21160410


def steps(mech: FiveBar | NonholonomicPoint, h: float, n: int, penalty: float) -> list[Step]:
    """n steps in detail."""
    scheme = Scheme(mech, mech.p, h, penalty=penalty)
    last, made = scheme.begin(), []
    for _ in range(n):
        made.append(scheme.step(last))
        last = made[-1].end
    return made


def main(where: Path | str) -> None:
    """Print passes, residuals and gradients, draw them."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    rows = []
    for mech, name in ((FiveBar(), "five-bar"), (NonholonomicPoint(), "point with a nonholonomic row")):
        alphas = 10.0 ** np.arange(1, 10, 2)
        runs = [steps(mech, 1e-2, 20, alpha) for alpha in alphas]
        passes = np.array([np.mean([s.passes for s in run], axis=0) for run in runs])
        moved = max(np.abs(run[-1].end.q - runs[-1][-1].end.q).max() for run in runs)
        axes[0].semilogx(alphas, passes.sum(axis=1), "o-", label=name)
        table = ", ".join(f"{alpha:.0e}: {p.sum():.0f}" for alpha, p in zip(alphas, passes, strict=True))
        rows.append(
            (
                f"{name}: passes of a step over the penalty (in effective masses)",
                "a penalty factor, multipliers iterated",
                f"{table}; the motion changes by {moved:.0e}",
                "numbers are not printed",
            )
        )
        hs = np.array([2e-2, 1e-2, 5e-3, 2.5e-3])
        sizes = np.array([np.max([s.residual for s in steps(mech, h, round(0.2 / h), 1e7)], axis=0) for h in hs])
        for k, what in enumerate(("velocity", "acceleration")):
            before, behind = sizes[:, k].T
            solved = before.max() < 1e-12
            axes[1].loglog(hs, np.maximum(before, 1e-17), "o-", color=f"C{len(rows)}", label=f"{name}: {what}")
            axes[1].loglog(hs, np.maximum(behind, 1e-17), "x:", color=f"C{len(rows)}")
            order = (
                "rows of velocities hold within the step"
                if solved
                else f"order {np.log2(before[-2] / before[-1]):.1f} in h"
            )
            rows.append(
                (
                    f"{name}: residual of the {what} rows, h = 0.01 s",
                    "velocity and acceleration projections",
                    f"{before[1]:.1e} before ({order}), {behind[1]:.0e} behind",
                    "numbers are not printed",
                )
            )
    m = mb.examples.five_bar()
    place = np.array([*POINTS[1], 0.0])
    psi = mb.Integral(lambda s: np.sum((s.point("P2") - place) ** 2))
    lengths = ["spring1.length", "spring2.length"]
    hs, errors = (4e-2, 2e-2, 1e-2), []
    for h in hs:
        found = mb.gradient(m, psi, lengths, t=5.0, step=h, method="direct")
        errors.append(np.abs(found.gradient - KNOWN).max())
    rows.append(
        (
            "five-bar, 5 s: gradient of the published objective, h = 0.01 s",
            "validated, (-4.229, 3.210) in later literature",
            f"({found.gradient[0]:.5f}, {found.gradient[1]:.5f}); errors {', '.join(f'{e:.1e}' for e in errors)} at h = "
            + ", ".join(map(str, hs)),
            "data of the benchmark are reconstructed",
        )
    )
    axes[2].loglog(hs, errors, "o-", label="mb.gradient, direct")
    axes[2].loglog(hs, errors[0] * (np.array(hs) / hs[0]) ** 2, "k:", label="order 2")
    axes[0].set(xlabel="penalty [effective masses]", ylabel="passes in a step", title="multiplier updates")
    axes[1].set(xlabel="step h [s]", ylabel="largest residual", title="rows before (circles), behind (crosses)")
    axes[2].set(xlabel="step h [s]", ylabel="error of the gradient", title="five-bar, 5 s")
    for ax in axes:
        ax.legend(fontsize=6)
        ax.xaxis.set_minor_formatter(NullFormatter())
    told(rows)
    save(figure, where, "projections.png")


if __name__ == "__main__":
    main(folder())
