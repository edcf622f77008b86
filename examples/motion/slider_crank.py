"""A slider-crank that turns freely: speed and force in the guide; then with a rod that bends (stiffness invented).

python examples/motion/slider_crank.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
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

m = mb.examples.slider_crank(stiffness=15.0)  # soft, so that one sees it
rod = m["rod"].modal
bent = mb.simulate(m, t=np.linspace(0.0, 2.0, 801), rtol=1e-8)
print(rod, bent, sep="\n")
at_middle, at_tip = (bent.modal("rod") @ rod.node_shape[rod.node(name), 1] for name in ("middle", "tip"))
sag = 1e3 * (at_middle - 0.5 * at_tip)
print(f"the middle of the rod bends by {np.abs(sag).max():.2f} mm from the line between its ends")
print(f"side force on the slider now up to {np.abs(bent.reaction('guide')[:, 1]).max():.1f} N")

figure, axes = plt.subplots(2, 1, figsize=(8.5, 6.0), sharex=True, layout="constrained")
axes[0].plot(bent.t, sag)
axes[0].set(ylabel="[mm]", title="Middle of the rod, from the line between its ends")
for one, name in ((traj, "rigid rod"), (bent, "elastic rod")):
    axes[1].plot(one.t, one.reaction("guide")[:, 1], label=name, lw=1.0)
axes[1].set(xlabel="t [s]", ylabel="[N]", title="Side force on the slider")
axes[1].legend(frameon=False, ncols=2)
figure.savefig(folder / "slider-crank-elastic.png")
print(f"pictures in {folder}")
