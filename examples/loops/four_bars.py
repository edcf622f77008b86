"""Rows of four-bar linkages that fall through the pose in which all links align: redundant joints, one freedom.

python examples/loops/four_bars.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
for n in (1, 3, 10):
    m = mb.examples.four_bars(n)
    traj = mb.simulate(m, t=10.0, rtol=1e-7)
    drift = np.ptp(traj.energy.total)
    print(
        f"n = {n}: {sum(mb.System(m).redundant.values())} redundant constraints, {len(traj.steps) - 1} steps in "
        f"{traj.stats.wall_time:.3f} s, energy kept to {drift:.1e} J, constraints to {traj.residual.max():.0e}"
    )

traj = mb.simulate(mb.examples.four_bars(3), t=np.linspace(0.0, 4.0, 401), rtol=1e-7)
print(traj)
traj.plot().savefig(folder / "four-bars.png")
traj.plot("reactions", of=["foot0", "foot1", "left0"]).savefig(folder / "four-bars-reactions.png")
traj.animate(folder / "four-bars.html")
print(f"pictures in {folder}")
