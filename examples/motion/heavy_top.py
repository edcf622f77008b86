"""The fast heavy top: a tight run, its axis and its energy.

python examples/motion/heavy_top.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.heavy_top()
traj = mb.simulate(m, t=np.linspace(0.0, 2.0, 401), rtol=1e-10)
print(traj)

# It spins at 150 rad/s and goes round the vertical much more slowly: gravity turns its moment of momentum.
x, y, z = traj.position("top").T
turned = np.unwrap(np.arctan2(y, x))
print(f"precession {np.ptp(turned) / 2.0:.4f} rad/s, the axis nods between z = {z.min():.6f} and {z.max():.6f} m")
print(f"energy kept to {np.ptp(traj.energy.total):.1e} J, estimated error of the pose at the end {traj.error:.1e}")

traj.plot("positions", of="top").savefig(folder / "heavy-top.png")
traj.animate(folder / "heavy-top.html", pace=0.2, paths=["top"])
print(f"pictures in {folder}")
