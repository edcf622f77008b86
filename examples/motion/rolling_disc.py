"""A disc that rolls without slip: two constraints on velocities that no position remembers.

python examples/motion/rolling_disc.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.rolling_disc()
print(mb.System(m))
traj = mb.simulate(m, t=np.linspace(0.0, 4.0, 801), rtol=1e-9)
print(traj)

# The disc's axis is its y axis as drawn; the lean is what is missing to upright.
axis = traj.rotation("disc")[:, :, 1]
lean = np.arcsin(axis[:, 2])
print(f"leans between {np.degrees(lean.min()):.1f} and {np.degrees(lean.max()):.1f} degrees")
print(f"energy kept to {np.ptp(traj.energy.total):.1e} J though it rolls: the contact does no work")
print(
    f"contact force between {traj.reaction('contact')[:, 2].min():.2f} and {traj.reaction('contact')[:, 2].max():.2f} N"
)

traj.plot("positions", of=["disc", "rim"]).savefig(folder / "rolling-disc.png")
traj.animate(folder / "rolling-disc.html", paths=["rim", "disc"])
print(f"pictures in {folder}")
