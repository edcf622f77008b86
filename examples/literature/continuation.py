"""Three predictors with three correctors through both folds of Duffing's oscillator (Sarrouy and Sinou 2011, section
5).

Every pair must find the folds of docs/theory.md (23.5); the table counts points, corrections and milliseconds. Then the
order of the Lagrange polynomial, at steps of one length.
"""

from __future__ import annotations

import time
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
from said import folder, save, told

FOLDS = 1.269602, 1.115700


def main(where: Path | str) -> None:
    """Print the table, draw the curves."""
    system = mb.examples.duffing()
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained", sharey=True)
    rows = []
    for ax, predictor in zip(axes, ("secant", "tangent", "lagrange"), strict=True):
        for corrector, mark in (("arclength", "o"), ("pseudo-arclength", "x"), ("moore-penrose", "+")):
            start = time.process_time()
            curve = mb.frequency_response(
                system, force=[0.18], omega=(0.5, 1.6), harmonics=7, predictor=predictor, corrector=corrector
            )
            spent = 1e3 * (time.process_time() - start)
            folds = [event.omega for event in curve.events if event.kind == "fold"]
            off = max(abs(a - b) for a, b in zip(folds, FOLDS, strict=True))
            ax.plot(curve.omega, curve.amplitude(dof=0, harmonic=1), mark, ms=4, mfc="none", label=corrector)
            counts = curve.stats.counts
            corrections = counts.get("corrections", counts.get("iterations", 0))
            found = f"{len(curve.omega)} points, {corrections} corrections, {spent:.0f} ms; folds within {off:.0e}"
            rows.append((f"{predictor}, {corrector}", "described, no example", found, "the text has no numbers"))
        ax.set(title=f"predictor: {predictor}", xlabel="omega")
    for order in range(1, 6):
        curve = mb.frequency_response(
            system, force=[0.18], omega=(0.5, 1.6), harmonics=7, predictor=f"lagrange{order}", max_step=0.05
        )
        found = f"{len(curve.omega)} points, {curve.stats.counts['corrections']} corrections"
        rows.append(
            (f"Lagrange polynomial of order {order}", "described, no example", found, "the text has no numbers")
        )
    axes[0].set_ylabel("amplitude of the first harmonic")
    axes[0].legend(fontsize=8)
    told(rows)
    save(figure, where, "continuation.png")


if __name__ == "__main__":
    main(folder())
