"""Time response of the Stewart platform's displacement (figure 15 of Jiang, Chen and Luo 2011) after a push, by two
ways.

`mb.response` of the linearised model beside `mb.simulate` of the full equations of motion: for small motions they
agree.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told

T, PUSH = 0.01, 100.0


def push(t: np.ndarray) -> np.ndarray:
    """Half a sine of 10 ms, 100 N."""
    return np.where(t < T, PUSH * np.sin(np.pi * t / T), 0.0)


def main(where: Path | str) -> None:
    """Print the distance, draw both."""
    model = mb.examples.stewart_platform()
    t = np.linspace(0.0, 0.4, 801)
    linear = mb.response(model, t=t, loads={"platform.force.x": push}, outputs=["platform.motion.x"])
    nodes = np.linspace(0.0, T, 41)
    curve = mb.Table([*nodes, 1.0], [*(PUSH * np.sin(np.pi * nodes / T)), 0.0], kind="linear")
    model.force("push", "platform", at=model.value("platform.at"), value=(curve, 0, 0))
    full = mb.simulate(model, t=t, rtol=1e-6)
    moved = full.position("platform")[:, 0] - full.position("platform")[0, 0]
    ours = linear.value[0]
    figure, ax = plt.subplots(figsize=(8.5, 4), layout="constrained")
    ax.plot(t, 1e3 * ours, label="mb.response, linearised")
    ax.plot(t, 1e3 * moved, "k:", label="mb.simulate, full equations")
    ax.set(xlabel="t [s]", ylabel="displacement in x [mm]", title="Stewart platform after a push of 10 ms, 100 N")
    ax.legend()
    gap = np.abs(ours - moved).max() / np.abs(ours).max()
    told(
        [
            (
                "displacement over time",
                "identical to Adams; up to 8e-3 (unit lost)",
                f"{1e3 * abs(ours).max():.3g} mm at most; linear and full equations {gap:.1%} apart",
                "load and data of the text are lost",
            )
        ]
    )
    save(figure, where, "time_response.png")


if __name__ == "__main__":
    main(folder())
