"""The wind rotor of J. Algorithms Comput. Technol. (2017): table of frequencies and mode shapes (figures 8 to 10).

The data of its NH1500 rotor are lost: blades, hub and nacelle are those of the WindPACT 1.5 MW turbine, the shaft is
invented.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told

BLADES, SPEED = ("blade1", "blade2", "blade3"), 17.2 * 2 * np.pi / 60
FAMILIES = ("1st flap", "1st edge", "2nd flap", "2nd edge")


def kind_of(family: str) -> str:
    """Symmetric where all blades move alike."""
    return "symmetric" if family == "collective" else "antisymmetric"


def frequencies() -> tuple[list[tuple[str, str, str, str]], mb.ModalResult, mb.RotorModes]:
    """The table at rest and turning, and the modes at rest with their patterns."""
    rows, found = [], {}
    for label, speed in (("at rest", 0.0), ("17.2 r/min", SPEED)):
        model = mb.examples.wind_rotor(speed=speed, modes=4, gravity=None, air=None)
        modes = mb.modes(model, at=mb.steady_motion(model) if speed else None)
        found[label] = modes, mb.rotor_modes(modes, BLADES, speed)
    for k, family in enumerate(FAMILIES):
        cells = []
        for label, (_, sorted_) in found.items():
            mine = [
                (f, kind_of(p))
                for f, p, c in zip(sorted_.frequency, sorted_.family, sorted_.coordinate, strict=True)
                if c == k and p != "hub"
            ]
            cells.append(f"{label}: " + ", ".join(f"{f:.3f} {name}" for f, name in mine[:3]))
        rows.append((family, "two antisymmetric, one symmetric; Hz lost", "; ".join(cells), "data of NH1500 are lost"))
    return rows, *found["at rest"]


def draw_modes(modes: mb.ModalResult, sorted_: mb.RotorModes, where: Path | str) -> None:
    """Front views: edgewise displacements in the plane, flapwise ones as hatched width beside the blade."""
    blade = mb.examples.wind_blade()
    place, shape = blade.line_position[:, 0], blade.line_shape
    names = list(modes.coordinates)
    figure, axes = plt.subplots(3, 3, figsize=(9, 9), layout="constrained")
    for row, family in zip(axes, range(3), strict=True):
        mine = [
            i for i in range(len(sorted_.frequency)) if sorted_.coordinate[i] == family and sorted_.family[i] != "hub"
        ][:3]
        mine.sort(key=lambda i: sorted_.family[i] == "collective")
        for ax, i in zip(row, mine, strict=True):
            phi = modes.shape[:, i]
            q = [np.array([phi[names.index(f"{b}.q{k + 1}")] for k in range(4)]) for b in BLADES]
            size = max(np.abs(shape @ x).max() for x in q)
            phase = np.exp(-1j * np.angle(max(np.concatenate(q), key=abs)))
            for n, x in enumerate(q):
                angle = 2 * np.pi * n / 3
                out, side = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
                moved = (shape @ (x * phase)).real / size * 9.0
                line = np.outer(place + 2, out)
                ax.plot(*line.T, color="0.7")
                edge, flap = line + np.outer(moved[:, 1], side), line + np.outer(moved[:, 2], side)
                ax.plot(*edge.T, "C0", lw=2)
                ax.fill(*np.vstack([line, flap[::-1]]).T, color="C1" if moved[-1, 2] > 0 else "C2", alpha=0.5)
            ax.set(aspect="equal", xlim=(-42, 42), ylim=(-42, 42), xticks=[], yticks=[])
            ax.set_title(f"{FAMILIES[family]}, {kind_of(sorted_.family[i])}\n{modes.frequency[i]:.3f} Hz", fontsize=9)
    figure.suptitle(
        "front views: blue edgewise; orange with the wind, green against it (drawn beside the blade)", fontsize=10
    )
    save(figure, where, "rotor_modes.png")


def main(where: Path | str) -> None:
    """Print the table, draw the modes."""
    rows, modes, sorted_ = frequencies()
    draw_modes(modes, sorted_, where)
    body = mb.examples.whole_rotor()["rotor"].modal
    rows.append(
        (
            "one flexible body for the whole rotor",
            "two antisymmetric modes and a symmetric one of each",
            f"{body.n_modes} modes, at rest: {', '.join(f'{f:.3f}' for f in body.frequencies())} Hz",
            "data of NH1500 are lost",
        )
    )
    told(rows)


if __name__ == "__main__":
    main(folder())
