"""The two-body swing: one rod driven at 60 deg/s, the other free; check values from docs/theory.md (23.11).

python examples/motion/swing.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.swing()
# angle of the free rod from level at these times, from its own equation solved by DOP853
check = {0.5: -0.835430375, 1.0: -2.363025261, 2.0: -2.081860121, 3.0: -0.818461015, 5.0: -0.393332826}
traj = mb.simulate(m, t=[0.0, *check], rtol=1e-10)
angle = traj.joint("m") + traj.joint("n")
for t, expected, found in zip(check, check.values(), angle[1:], strict=True):
    print(f"t = {t:g} s: angle of B {found:.9f} rad, check value {expected:.9f}")
print(f"largest difference {np.abs(angle[1:] - list(check.values())).max():.1e} rad")

traj = mb.simulate(m, t=np.linspace(0.0, 5.0, 501), rtol=1e-9)
print(traj)
torque = traj.reaction("motor")[:, 5]
print(f"the motor gives between {torque.min():.0f} and {torque.max():.0f} N m")
traj.plot().savefig(folder / "swing.png")
traj.animate(folder / "swing.html")
print(f"pictures in {folder}")
