"""A slider-crank that turns freely: speed and force in the guide over the angle of the crank.

python examples/slider_crank.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.slider_crank()
print(mb.System(m))
traj = mb.simulate(m, t=np.linspace(0.0, 2.0, 801), rtol=1e-9)
print(traj)

angle, speed = traj.joint("main"), traj.angular_velocity("crank")[:, 2]
side = np.abs(traj.reaction("guide")[:, 1])
print(f"{angle[-1] / (2 * np.pi):.2f} turns, crank between {speed.min():.2f} and {speed.max():.2f} rad/s")
print(f"stroke {np.ptp(traj.position('slider')[:, 0]) * 1e3:.1f} mm, side force on the slider up to {side.max():.1f} N")

traj.plot().savefig(folder / "slider-crank.png")
traj.animate(folder / "slider-crank.html", paths=["pin", "rod"])
print(f"pictures in {folder}")
