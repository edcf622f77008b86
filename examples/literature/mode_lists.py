"""Natural frequencies and damping ratios over the number of the mode, two programs overlaid (figures 7, 10 and 13 of
Jiang, Chen and Luo 2011).

The text compares with Adams; here the second program is `scipy.linalg.eig` on the matrices of the tree, and the plain
NumPy reference, which shares no code with the core, on the robot and the platform.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import scipy.linalg
from mbrs import reference
from mbrs.model.tables import tables
from said import folder, save, told


def second(model: mb.Model, plain: bool) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and damping ratios by the other program, ascending."""
    if plain:
        own = reference.System(tables(model))
        lin = reference.linearize(own, reference.sensitivity.drawn_and_assembled(own))
        modes = reference.modes(lin.M, lin.C, lin.G, lin.K, lin.N)
        return modes.frequency, modes.damping
    lin, n = mb.linearize(model), mb.System(model).dof
    zero, C = np.zeros((n, n)), np.zeros((n, n)) if lin.C is None else lin.C
    A = np.block([[zero, np.eye(n)], [-lin.K, -C]])
    s = scipy.linalg.eig(A, scipy.linalg.block_diag(np.eye(n), lin.M), right=False)
    s = s[s.imag > 0]
    order = np.argsort(abs(s))
    return abs(s)[order] / (2 * np.pi), (-s.real / abs(s))[order]


def main(where: Path | str) -> None:
    """Print the differences, draw the lists."""
    cases = {
        "TL7RF1": (mb.examples.from_code("TL7RF1"), False, "means 1.02e-6 Hz, 1.73e-10; maxima 5.00e-5 Hz, 5.00e-8"),
        "quadruped": (mb.examples.quadruped(), True, "equal to each other"),
        "Stewart platform": (mb.examples.stewart_platform(), True, "equal to each other"),
    }
    figure, axes = plt.subplots(2, 3, figsize=(12, 5.5), layout="constrained", sharex="col")
    rows = []
    for place, (name, (model, plain, text)) in zip(axes.T, cases.items(), strict=True):
        modes = mb.modes(model)
        order = np.argsort(modes.frequency)
        ours = modes.frequency[order], modes.damping[order]
        other = second(model, plain)
        f, zeta = (np.abs(a - b) for a, b in zip(ours, other, strict=True))
        program = "NumPy reference" if plain else "scipy.linalg.eig"
        for ax, a, b, label in zip(place, ours, other, ("frequency [Hz]", "damping ratio"), strict=True):
            number = np.arange(1, len(a) + 1)
            ax.plot(number, b, "o", mfc="none", ms=6 if len(a) < 40 else 4, label=program)
            ax.plot(number, a, ".", ms=4, label="mbrs")
            ax.set_ylabel(label)
        place[0].set_title(name)
        place[1].set_xlabel("mode")
        found = f"mean {f.mean():.1e} Hz, {zeta.mean():.1e}; max {f.max():.1e} Hz, {zeta.max():.1e} (against {program})"
        rows.append(
            (
                f"{name}, {len(f)} modes: differences of f and zeta",
                text,
                found,
                "Adams is not here; masses and springs are invented",
            )
        )
    axes[0, 0].legend(fontsize=8)
    axes[0, 1].legend(fontsize=8)
    told(rows)
    save(figure, where, "mode_lists.png")


if __name__ == "__main__":
    main(folder())
