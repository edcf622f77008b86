"""A chain of forty rods let go level: chaotic once its end whips round, so that only tolerances tell how far to trust it.

python examples/motion/falling_chain.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.pendulum_chain(40)
times = np.linspace(0.0, 1.0, 101)
tight = mb.simulate(m, t=times, rtol=1e-9)
for rtol in (1e-4, 1e-6):
    traj = mb.simulate(m, t=times, rtol=rtol)
    off = np.linalg.norm(traj.point("end") - tight.point("end"), axis=1)
    print(
        f"rtol {rtol:g}: {len(traj.steps) - 1} steps, end off by {off.max():.1e} m, energy kept to "
        f"{np.ptp(traj.energy.total):.1e} J"
    )

print(tight)
tight.plot("positions", of=["end"]).savefig(folder / "falling-chain.png")
tight.animate(folder / "falling-chain.html", pace=0.2)
print(f"pictures in {folder}")
