"""Condensation on the nonlinear degrees of freedom against the full balance, n = 10 to 60 (Sarrouy and Sinou 2011,
section 4).

A row of n masses with one cubic spring: the same coefficients, at a fraction of the time.
"""

from __future__ import annotations

import time
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told


def row_of_masses(n: int) -> tuple[mb.MechanicalSystem, np.ndarray]:
    """n unit masses between springs, damped in proportion, a cubic spring at the last one."""
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    w, force = np.zeros(n), np.zeros(n)
    w[-1], force[0] = 1.0, 0.2
    return mb.MechanicalSystem(M=np.eye(n), C=0.02 * K, K=K, elements=[mb.Cubic(0.5, w=w)]), force


def main(where: Path | str) -> None:
    """Print differences and ratios, draw times over n."""
    rows, found = [], []
    small, load = row_of_masses(3)
    for condense in (False, True):  # what is done only once is not measured
        mb.harmonic_balance(small, force=load, omega=0.31, harmonics=7, condense=condense)
    for n in (10, 20, 30, 60):
        system, force = row_of_masses(n)
        results, spent = [], []
        for condense in (False, True):
            start = time.process_time()
            results.append(mb.harmonic_balance(system, force=force, omega=0.31, harmonics=7, condense=condense))
            spent.append(1e3 * (time.process_time() - start))
        gap = np.abs(results[0].X - results[1].X).max() / np.abs(results[0].X).max()
        found.append([n, *spent])
        rows.append(
            (
                f"n = {n}",
                "keeps only the nonlinear degrees of freedom",
                f"{15 * n} unknowns or 15; {spent[0]:.3g} and {spent[1]:.3g} ms; differ by {gap:.0e}",
                "the text has no example",
            )
        )
    told(rows)
    n, full, condensed = np.array(found).T
    figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
    ax.loglog(n, full, "o-", label="full balance, n (2m + 1) unknowns")
    ax.loglog(n, condensed, "s-", label="condensed, 2m + 1 unknowns")
    ax.set(
        xlabel="degrees of freedom n", ylabel="CPU time of one solution [ms]", title="seven harmonics, one cubic spring"
    )
    ax.legend()
    save(figure, where, "condensation.png")


if __name__ == "__main__":
    main(folder())
