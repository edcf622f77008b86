"""The cubic hexapod against its closed form, and what each design variable does to it.

python examples/linear/hexapod.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
edge, k, mass, inertia = 0.2, 1e5, 20.0, 0.15
m = mb.examples.cubic_hexapod(edge=edge, k=k, c=30.0, mass=mass, inertia=inertia)
modes = mb.modes(m)
print(modes)

# K = diag(2k, 2k, 2k, k L^2/2, k L^2/2, 2 k L^2) at the cube's centre, derived in mb.examples.cubic_hexapod_points.
squares = [2 * k / mass] * 3 + [k * edge**2 / (2 * inertia)] * 2 + [2 * k * edge**2 / inertia]
exact = np.sqrt(squares) / (2 * np.pi)
print(f"\nlargest relative distance from the closed form: {np.max(np.abs(modes.frequency / exact - 1)):.1e}\n")

s = mb.sensitivity(modes, ["k_leg", "c_leg", "payload.mass", "payload.inertia[2,2]"])
print(s)
h = mb.frf(m, mb.base_motion("z"), "payload.motion.z", frequency=(1, 200), kind="transmissibility")
print(h)

h.plot().savefig(folder / "hexapod-transmissibility.png")
s.plot().savefig(folder / "hexapod-sensitivity.png")
modes.animate(folder / "hexapod-modes.html")
print(f"\npictures in {folder}")
