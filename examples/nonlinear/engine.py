"""An engine on mounts that harden, under the forces of its crankshaft, about its loaded equilibrium. Invented data.

python examples/nonlinear/engine.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from mbrs.plot.figure import figure, style
from mbrs.reference import hbm_balance, hbm_shooting

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
m = mb.examples.engine_on_mounts()
at = mb.equilibrium(m)
print(mb.modes(m, at=at))
ports = [m["crank"].force("z"), m["block"].torque("x")]
with style():
    picture, axes = figure()
    for force in (25.0, 100.0, 200.0):
        curve = mb.frequency_response(
            m, inputs=ports, amplitude=[force, 0.07 * force], at=at, frequency=(12, 22), harmonics=5
        )
        print(f"\n{force:g} N\n{curve.table('crank.motion.z')}")
        curve.plot("crank.motion.z", ax=axes, label=f"{force:g} N")
    axes.set_title("dashed: unstable")
picture.savefig(folder / "engine-curves.png")

# The model's matrices and laws in the plain reference: harmonic balance in NumPy, and the monodromy matrix in time.
rows = []
system = mb.nonlinear_system(m, at=at)
for i in (10, len(curve) // 2):
    one = curve.point(i)
    X = hbm_balance.harmonic_balance(system, one.force, one.omega, range(1, 6), 64, one.X)
    ours, theirs = one.amplitude("block.z"), float(np.hypot(*X[2, 1:3]))
    rows.append((f"|block.z| at {one.frequency:.4f} Hz", ours, theirs, "plain harmonic balance"))
    start = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
    _, monodromy = hbm_shooting.flow(system, one.force, one.omega, start, one.period, rtol=1e-9)
    largest = float(np.max(np.abs(np.linalg.eigvals(monodromy))))
    rows.append((f"largest multiplier at {one.frequency:.4f} Hz", float(np.max(np.abs(curve.multipliers[i]))), largest,
                 f"integration in time; estimate {one.error:.0e}"))  # fmt: skip
    found = one.verify()
    where = f"distance in a period at {one.frequency:.4f} Hz"
    rows.append((where, found.balanced, 0.0, "equations that were balanced, integrated in time"))
    rows.append((f"{where}, geometry", found.full, 0.0, "full equations of the model, mb.simulate"))
print(error_table(rows))
print(f"pictures in {folder}")
