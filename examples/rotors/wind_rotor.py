"""A three-bladed rotor with flexible blades and shaft at 17.2 r/min: modes, Campbell diagram, motion under weight and air.

Blades, hub and nacelle are those of the WindPACT 1.5 MW turbine (public), a stand-in for the rotor of the derivative-free
solver's paper, whose data were not published; the shaft's stiffness and the air loads are invented.

python examples/rotors/wind_rotor.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from mbrs import reference
from mbrs.model.tables import tables
from mbrs.reference.fixed_frame import Rotor

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
blades, speed = ("blade1", "blade2", "blade3"), 17.2 * 2 * np.pi / 60

# --- modes: standing still and turning, sorted by what the blades do together
free = mb.examples.wind_rotor(modes=4, gravity=None, air=None)  # driven: the speed is held
print(mb.examples.wind_blade())
print(mb.System(free))
turning = mb.steady_motion(free)
families = mb.rotor_modes(mb.modes(free, at=turning), blades, speed)
print(f"rotor modes at 17.2 r/min, blades cantilevered on the flexible shaft\n{families}")
speeds = np.linspace(0.05, 3.6, 24)  # rad/s
rows = []
for one in speeds:
    held = mb.examples.wind_rotor(speed=one, modes=4, gravity=None, air=None)
    rows.append(mb.rotor_modes(mb.modes(held, at=mb.steady_motion(held)), blades, one))
figure, place = plt.subplots(figsize=(8.5, 5.5), layout="constrained")
colour = {"collective": "C0", "forward": "C1", "backward": "C2", "hub": "0.6"}
for one, row in zip(speeds, rows, strict=True):
    place.scatter([one * 30 / np.pi] * len(row.fixed), row.fixed, s=10, c=[colour[kind] for kind in row.family])
rpm = speeds * 30 / np.pi
for order in (1, 3, 6):
    place.plot(rpm, order * rpm / 60, "0.7", lw=0.8)
    place.annotate(f"{order}P", (rpm[-1], order * rpm[-1] / 60), color="0.5")
for kind in ("collective", "forward", "backward"):
    place.scatter([], [], s=20, c=colour[kind], label=kind)
place.axvline(17.2, color="0.8", ls=":")
place.set(ylim=(0, 7.5), xlabel="speed [r/min]", ylabel="f in the fixed frame [Hz]", title="Campbell diagram")
place.legend(frameon=False, ncols=3, loc="upper left")
figure.savefig(folder / "wind-rotor-campbell.png")

# --- motion: weight, inertia, elasticity and tabulated section loads
m = mb.examples.wind_rotor(modes=4, air=12.0)
t = np.linspace(0.0, 6.0, 241)
traj = mb.simulate(m, t=t, rtol=1e-6)
print(traj)

# --- the same by the modal method in the fixed frame: linear, in multiblade coordinates
open_tree = mb.examples.wind_rotor(modes=4, air=12.0, drive=False)
rotor = Rotor(reference.System(tables(open_tree)), "bearing", blades, "shaft end", speed)
linear = rotor.superposed(t)


def modal(k):
    """Modal coordinate k of the three blades, by both methods."""
    one = np.stack([traj.modal(blade)[:, k] for blade in blades], axis=1)
    return one, linear[:, [rotor.names.index(f"{blade}.q{k + 1}") for blade in blades]]


figure, axes = plt.subplots(4, 1, figsize=(8.5, 9.5), sharex=True, layout="constrained")
for k, (place, name) in enumerate(zip(axes[:2], ("1st flap", "1st edge"), strict=True)):
    found, compared = modal(k)
    for i in range(3):
        place.plot(t, found[:, i], color=f"C{i}", label=f"blade {i + 1}")
        place.plot(t, compared[:, i], "k:", lw=1.0, label="modal method, fixed frame" if i == 2 else None)
    place.set(ylabel=f"q{k + 1} [kg^1/2 m]", title=f"{name} coordinate")
    print(
        f"{name}: up to {np.abs(found).max():.3g}, modal method off by {np.abs(found - compared).max() / np.abs(found).max():.1%}"
    )
shape = mb.examples.wind_blade().node_shape[mb.examples.wind_blade().node("section"), :3]
for place, axis, name in ((axes[2], 2, "flapwise"), (axes[3], 1, "edgewise")):
    for i, blade in enumerate(blades):
        moved = traj.modal(blade) @ shape[axis]
        place.plot(t, moved, color=f"C{i}")
        print(f"{blade}: {name} displacement at 85 % of the blade between {moved.min():.3f} and {moved.max():.3f} m")
    place.set(ylabel="[m]", title=f"{name} displacement at 85 % of the blade")
axes[0].legend(ncols=4, fontsize=8, frameon=False)
axes[-1].set_xlabel("t [s]")
figure.savefig(folder / "wind-rotor-motion.png")

# --- in the frame at rest
azimuth = 2 * np.pi / 3 * np.arange(3) + speed * t[:, None]
flap = mb.multiblade(modal(0)[0], azimuth)
print(f"flap: collective {flap[-1, 0]:.3g}, cosine {flap[-1, 1]:.3g}, sine {flap[-1, 2]:.3g} kg^1/2 m at the end")
traj.animate(folder / "wind-rotor.html")
print(f"pictures in {folder}")
