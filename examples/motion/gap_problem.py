"""A mass on a spring that strikes a stop: non-smooth forces, and what steps and tolerances make of them.

python examples/motion/gap_problem.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.gap_problem(stop=1e6)
for rtol in (1e-4, 1e-6, 1e-8):
    traj = mb.simulate(m, t=5.0, rtol=rtol)
    # while the stop is pressed a steep law holds the energy; free of it the sum shows what the scheme lost
    free = traj.position("mass")[:, 0] < 0.05
    print(
        f"rtol {rtol:g}: {len(traj.steps) - 1} steps, {traj.stats.counts.get('rejected steps', 0)} rejected, energy kept to "
        f"{np.ptp(traj.energy.total[free]):.1e} J, estimated error {traj.error:.1e}"
    )

traj = mb.simulate(m, t=np.linspace(0.0, 5.0, 2501), rtol=1e-8)  # outputs close enough to draw
print(traj)
traj.plot().savefig(folder / "gap-problem.png")
traj.plot("error").savefig(folder / "gap-problem-error.png")
print(f"pictures in {folder}")
