"""The full-scale vehicle of Dopico and others (2018): sensitivities of a ride over a bump by springs, dampers and hard points.

Data of the text's vehicle are lost: a car of fourteen degrees of freedom on double wishbones, invented.
examples/gradients/car.py goes on to better springs and dampers.
"""

from __future__ import annotations

import time
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from said import folder, save, told

END, STEP, BUMP = 2.5, 1e-2, 1.5
NAMES = ["front_spring_k", "front_spring_c", "rear_spring_k", "rear_spring_c"]


def main(where: Path | str) -> None:
    """Print gradients and times of three ways, draw ride and sensitivities."""
    m = mb.examples.car()
    psi = mb.Integral(lambda s: (s.t >= BUMP) * s.point_acceleration("driver")[2] ** 2)
    found, seconds = {}, {}
    for way in ("direct", "adjoint"):
        begin = time.process_time()
        found[way] = mb.gradient(m, psi, NAMES, t=END, step=STEP, method=way)
        seconds[way] = time.process_time() - begin
    name, h = NAMES[3], 1e-4
    sides = []
    for sign in (1, -1):
        other = mb.examples.car()
        other.set({name: m.value(name) * (1 + sign * h)})
        sides.append(mb.gradient(other, psi, [name], t=END, step=STEP, method="adjoint").value)
    difference = (sides[0] - sides[1]) / (2 * h * m.value(name))
    direct, adjoint = found["direct"].gradient, found["adjoint"].gradient
    told([
        (
            "gradient of the squared acceleration of the driver",
            "validated on a full-scale vehicle model",
            f"{mb.System(m).dof} degrees of freedom, {len(m.bodies)} bodies: adjoint off direct by "
            f"{np.abs(adjoint / direct - 1).max():.0e}; by {name} {direct[3]:.6g}, central difference {difference:.6g}",
            "data of the vehicle are lost",
        ),
        (
            f"CPU time, {len(NAMES)} parameters",
            "no time is printed",
            f"direct {seconds['direct']:.2f} s, adjoint {seconds['adjoint']:.2f} s, both with the motion",
            "",
        ),
    ])  # fmt: skip
    traj = mb.simulate(m, t=END, step=STEP, method="ali3p", parameters=NAMES)
    figure, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    height = traj.point("driver")[:, 2]
    axes[0].plot(traj.t, 1e3 * (height - height[0]))
    axes[0].set(title="rise of the driver [mm]", xlabel="t [s]")
    change = traj.sensitivity("driver.position")[:, 2]
    for k, parameter in enumerate(NAMES):
        axes[1].plot(traj.t, 1e3 * change[:, k] * m.value(parameter) / 100, label=parameter)
    axes[1].set(title="its change for 1 % more of each [mm]", xlabel="t [s]")
    axes[1].legend(fontsize=8)
    save(figure, where, "car.png")


if __name__ == "__main__":
    main(folder())
