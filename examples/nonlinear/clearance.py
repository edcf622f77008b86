"""A mass with play between two stops, on a rail: a multibody model with a gap in a joint. All data are invented.

python examples/nonlinear/clearance.py [folder for the pictures]
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
m = mb.examples.clearance_oscillator()
mass = m["mass"]
curve = mb.frequency_response(
    m, inputs=mass.force("x"), amplitude=3.0, frequency=(5, 25), harmonics=list(range(1, 64, 2))
)
print(curve)
curve.plot(mass.motion("x"), harmonic=None).savefig(folder / "clearance-curve.png")
peak = curve.peak("rail")
peak.plot("rail").savefig(folder / "clearance-harmonics.png")
peak.plot_orbit("rail").savefig(folder / "clearance-orbit.png")

# Below the clearance the oscillator is linear; above, shooting finds the periodic motion in time.
rows = []
system, force = mb.nonlinear_system(m), curve.force
first = curve.point(0)
w = first.omega
linear = abs(3.0 / (8e3 - 2.0 * w**2 + 20j * w))
rows.append(("amplitude at 5 Hz, free of the stops", first.amplitude("rail"), linear, "closed form"))
for i in np.linspace(20, len(curve) - 15, 4).astype(int):
    one = curve.point(int(i))
    start = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
    state, _ = hbm_shooting.shoot(system, force, one.omega, start)
    source = f"shooting, relative to |x|; estimate {one.error:.0e}"
    rows.append((f"x(0) at {one.frequency:.4f} Hz", start[0], state[0], source, one.largest("rail")))
print(error_table(rows))
print(f"pictures in {folder}")
