"""Air loads of a free vortex wake, computed in advance, on the flexible rotor of J. Algorithms Comput. Technol. (2017), figure 12.

As in the text: the wake is that of the rotor without flexibility, and its forces at the sections of the blades are then applied to the
multibody system and to the modal method alike. Chord, sections, wind and shaft are invented; blades, hub and nacelle those of the
WindPACT 1.5 MW turbine, scaled so that the tip is 40.1 m from the axis.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from rotor_motion import BLADES, HUB, PLACE, READINGS, SPEED, TIMES, Loads, inertial, multibody, tip, turning
from said import folder, save, told

SECTIONS, STEPS = 8, 30
NAME = "40.1 m from the axis"


def wake_loads(scale: float) -> tuple[mb.Trajectory, Loads]:
    """The motion of the rigid rotor beside its free wake, and the forces per length along each blade over time, in its axes."""
    m = mb.examples.wind_rotor(scale=scale)
    m.aerodynamics(
        "air",
        mb.examples.wind_rotor_blades(SECTIONS, scale),
        wind=mb.aero.wind(8.0, "x", shear=0.2, reference_height=84.0),
        inflow="free-wake",
        options={"steps": STEPS},
    )
    traj = mb.simulate(m, t=TIMES, rtol=1e-4, without=("flexibility",))
    loads = {}
    for name in BLADES:
        air = traj.aero(name)
        force = np.stack([0 * air.normal_force, air.tangential_force, air.normal_force], axis=2)
        loads[name] = {"stations": air.place - scale * HUB, "table": force, "times": TIMES}
    return traj, loads


def main(where: Path | str) -> None:
    """Print how far the ways are apart, draw the displacement of the tip and the loads."""
    scale = READINGS[NAME]
    wake, loads = wake_loads(scale)
    rotor = turning(scale, SPEED, loads=loads)
    still = turning(scale, 0.0, gravity=None)
    curves = {
        "multibody": multibody(scale, loads=loads)[1],
        "modal method, all terms": tip(rotor, rotor.superposed(TIMES), scale),
        "modal method, inertial frame": tip(rotor, inertial(rotor, still), scale),
    }
    full, rows = curves["multibody"], []
    figure, axes = plt.subplots(1, 3, figsize=(14, 4), layout="constrained")
    for ax, axis, name in ((axes[0], 2, "flapwise"), (axes[1], 1, "edgewise")):
        largest = np.abs(full[:, axis]).max()
        for (label, moved), style in zip(curves.items(), ("-", "--", ":"), strict=True):
            ax.plot(TIMES, moved[:, axis], linestyle=style, label=label)
        gaps = [
            f"{k} {np.abs(v[:, axis] - full[:, axis]).max() / largest:.2g}" for k, v in curves.items() if v is not full
        ]
        rows.append(
            (
                f"{name} displacement of a tip {NAME}, loads of a free wake",
                "coincident generally, with deviations",
                f"up to {largest:.3g} m; away from the multibody method, of that: {', '.join(gaps)}",
                "blade, wind and which place is meant are lost",
            )
        )
        ax.set(xlabel="t [s]", ylabel=f"tip, {name} [m]", title=f"tip {PLACE} m from the axis")
    axes[0].legend(fontsize=8)
    load = loads[BLADES[0]]
    for k in range(0, len(load["stations"]), 2):
        label = f"{load['stations'][k] + scale * HUB:.1f} m"
        axes[2].plot(TIMES, load["table"][:, k, 2], label=label)
    axes[2].set(xlabel="t [s]", ylabel="normal force of blade 1 [N/m]", title="loads, computed in advance")
    axes[2].legend(fontsize=8, title="from the axis", loc="center", bbox_to_anchor=(0.5, 0.4))
    save(figure, where, "rotor_wake.png")
    told(rows)
    print(f"rigid rotor beside its wake: {wake.power[-1] / 1e3:.0f} kW, {wake.thrust[-1] / 1e3:.0f} kN at the end")


if __name__ == "__main__":
    main(folder())
