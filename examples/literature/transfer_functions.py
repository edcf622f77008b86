"""Transfer functions in decibels, 0.1 to 100 Hz (figures 8, 11 and 14 of Jiang, Chen and Luo 2011), beside direct
solutions in NumPy.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told


def direct(model: mb.Model, load: str, motion: str, frequency: np.ndarray) -> np.ndarray:
    """H by one solution of (K - w^2 M + i w C) x = b for each frequency."""
    lin = mb.linearize(model)
    b, c = lin.input_map([load])[0][:, 0], lin.output_map([motion])[0][0]
    C = 0.0 if lin.C is None else lin.C
    return np.array([c @ np.linalg.solve(lin.K - w**2 * lin.M + 1j * w * C, b) for w in 2 * np.pi * frequency])


def main(where: Path | str) -> None:
    """Print the differences, draw amplitude and phase."""
    tree = mb.examples.from_code("TL7RF1")
    cases = {
        "TL7RF1, B6,1 x to B6,32 y": (tree, "B6,1.force.x", "B6,32.motion.y", (1e-3, 1.0)),
        "quadruped, torso x to x": (mb.examples.quadruped(), "torso.force.x", "torso.motion.x", (0.1, 100.0)),
        "quadruped, torso z to z": (mb.examples.quadruped(), "torso.force.z", "torso.motion.z", (0.1, 100.0)),
        "Stewart platform, z to z": (
            mb.examples.stewart_platform(), "platform.force.z", "platform.motion.z", (0.1, 100.0),
        ),
    }  # fmt: skip
    figure, axes = plt.subplots(2, 4, figsize=(15, 5.5), layout="constrained", sharex="col")
    rows = []
    for place, (name, (model, load, motion, (low, high))) in zip(axes.T, cases.items(), strict=True):
        frequency = np.geomspace(low, high, 400)
        with warnings.catch_warnings():  # the points of the text's figure, not as many as lightly damped peaks need
            warnings.filterwarnings("ignore", "the frequency points miss", mb.MbrsWarning)
            ours = mb.frf(model, load, motion, frequency=frequency).value[0, 0]
        some = np.arange(0, len(frequency), 10)
        other = direct(model, load, motion, frequency[some])
        place[0].semilogx(frequency, 20 * np.log10(abs(ours)), label="mbrs")
        place[0].semilogx(frequency[some], 20 * np.log10(abs(other)), "o", mfc="none", ms=4, label="direct solutions")
        place[1].semilogx(frequency, np.angle(ours, deg=True))
        place[1].semilogx(frequency[some], np.angle(other, deg=True), "o", mfc="none", ms=4)
        place[0].set_title(name, fontsize=10)
        place[0].set_ylabel("displacement over force [dB, 1 m/N]", fontsize=8)
        place[1].set(ylabel="phase [deg]", xlabel="frequency [Hz]")
        gap = np.abs(ours[some] - other).max() / np.abs(other).max()
        peak = frequency[np.argmax(abs(ours))]
        rows.append(
            (
                name,
                "identical to Adams, 0.1 to 100 Hz, in dB",
                f"{gap:.0e} of the peak, which is at {peak:.3g} Hz",
                "levels: the data of the models are lost",
            )
        )
    axes[0, 0].legend(fontsize=8)
    told(rows)
    save(figure, where, "transfer_functions.png")


if __name__ == "__main__":
    main(folder())
