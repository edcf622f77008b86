"""A mass with an absorber on cubic springs: between two Neimark-Sacker points no periodic motion is stable.

python examples/nonlinear/neimark_sacker.py [folder for the pictures]
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
system = mb.examples.two_mass_cubic()
curve = mb.frequency_response(system, force=[0.11, 0.0], omega=(0.8, 1.4), harmonics=9)
print(curve)
curve.plot("mass").savefig(folder / "neimark-sacker-curve.png")
curve.plot_multipliers().savefig(folder / "neimark-sacker-multipliers.png")

# The reference integrates the motion and its monodromy matrix in time, and knows nothing of harmonics.
rows = []
for event in curve.events:
    one = curve.at(event)
    start = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
    monodromy = hbm_shooting.flow(system, [0.11, 0.0], event.omega, start, one.period)[1]
    multipliers = np.linalg.eigvals(monodromy)
    near = multipliers[np.argmin(np.abs(np.abs(multipliers) - 1))]
    rows.append((f"{event.kind} at {event.omega:.8f}: |multiplier|", 1.0, float(abs(near)), "shooting"))
    if event.kind == "neimark-sacker":
        angle = abs(np.angle(np.exp(event.exponent * one.period)))
        rows.append((f"{event.kind} at {event.omega:.8f}: angle", float(angle), float(abs(np.angle(near))), "shooting"))
print(error_table(rows))
print(f"pictures in {folder}")
