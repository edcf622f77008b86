"""A quarter of a car over a bump: the road is a drive whose motion is a Python function.

python examples/motion/quarter_car.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.quarter_car()
for damper in (700.0, 1400.0, 2800.0):
    m.set({"suspension.c": damper})
    traj = mb.simulate(m, t=np.linspace(0.0, 2.0, 401), rtol=1e-8)
    rise = traj.position("body")[:, 2] - 0.8
    felt = np.gradient(traj.velocity("body")[:, 2], traj.t)
    print(
        f"damper {damper:g} N s/m: body rises {1e3 * rise.max():.1f} mm, up to {np.abs(felt).max():.2f} m/s2, still moves "
        f"{1e3 * np.abs(rise[traj.t > 1.5]).max():.1f} mm after 1.5 s"
    )

print(traj)
traj.plot("coordinates").savefig(folder / "quarter-car.png")
traj.plot("power").savefig(folder / "quarter-car-power.png")
traj.animate(folder / "quarter-car.html")
print(f"pictures in {folder}")
