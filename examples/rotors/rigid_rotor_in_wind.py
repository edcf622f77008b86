"""A rigid rotor in the wind: blade elements and momentum beside wakes of vortex filaments, and a step of the pitch.

python examples/rotors/rigid_rotor_in_wind.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))

# a blade for a tip speed ratio of 7, after Glauert, with thin sections
a = np.radians(np.arange(-20.0, 20.5, 1.0))
section = mb.aero.polar(a, 2 * np.pi * np.sin(a), 0.008 + 0.01 * a**2, name="thin").extend(aspect_ratio=17.0)
stations = np.linspace(6.0, 40.0, 18)
phi = 2 / 3 * np.arctan(40.0 / (7.0 * stations))
chord = 0.8 * 8 * np.pi * stations * (1 - np.cos(phi)) / (6 * np.pi * np.sin(np.radians(5.0)))
rotor = mb.aero.rotor(mb.aero.blade(stations, chord, phi - np.radians(5.0), section), count=3)

# --- steady wind: three models of the inflow
momentum = mb.aero.performance(rotor, tip_speed_ratio=np.linspace(4.0, 9.0, 11))
momentum.plot().savefig(folder / "rotor-performance.png")
print(momentum)
print("by a prescribed wake:")
print(mb.aero.performance(rotor, [6.0, 7.0, 8.0], inflow="prescribed-wake"))
free = mb.aero.rotor_wake(rotor, 7.0, turns=6)
print(free.heading())
free.plot().savefig(folder / "rotor-wake.png")
exact = momentum.power_coefficient[6]
print(f"power coefficient at 7: {exact:.4f} by momentum, {2 * 7.0**3 * free.power:.4f} with a free wake")

# --- the pitch moves by three degrees in half a second: the wake takes its time
t = np.linspace(0.0, 60.0, 1201)
pitch = np.radians(np.interp(t, [10.0, 10.5], [0.0, 3.0]))
slow = mb.aero.rotor_response(rotor, t, wind=8.0, speed=1.4, pitch=pitch)
quick = mb.aero.rotor_response(rotor, t, wind=8.0, speed=1.4, pitch=pitch, inflow="bem")
figure = slow.plot()
figure.axes[0].plot(t, quick.thrust, ":", label="without lag")
figure.savefig(folder / "rotor-pitch-step.png")
low, end, sudden = slow.thrust.min() / 1e3, slow.thrust[-1] / 1e3, quick.thrust[-1] / 1e3
print(f"thrust falls to {low:.1f} kN and settles at {end:.1f} kN ({sudden:.1f} kN without lag)")
print(f"pictures in {folder}")
