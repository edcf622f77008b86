"""Two masses beside a stop: a contact needs many samples, and its harmonics die away slowly.

python examples/nonlinear/unilateral_spring.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from mbrs.reference import hbm_shooting

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
system, force = mb.examples.two_mass_stop(), [0.0, 0.1]
curve = mb.frequency_response(system, force=force, omega=(0.45, 0.9), harmonics=21, n_samples=1024)
print(curve)
curve.plot("first", harmonic=None).savefig(folder / "unilateral-curve.png")
peak = curve.peak("first")
peak.plot("first").savefig(folder / "unilateral-harmonics.png")
peak.plot_orbit("first").savefig(folder / "unilateral-orbit.png")

# Shooting from the solution's own state: the periodic motion that is really there.
rows = []
for i in np.linspace(0, len(curve) - 1, 6).astype(int):
    one = curve.point(int(i))
    start = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
    state, _ = hbm_shooting.shoot(system, force, one.omega, start)
    size = one.largest("first")
    source = f"shooting; relative to |x| {size:.3g}; estimate {one.error:.0e}"
    rows.append((f"x(0) of the first mass, omega {one.omega:.4f}", start[0], state[0], source, size))
print(error_table(rows))
print(f"pictures in {folder}")
