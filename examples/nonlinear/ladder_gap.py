"""A ladder of three layers whose top rung has play between stops. All data are invented.

python examples/nonlinear/ladder_gap.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from mbrs.plot.figure import figure, style
from mbrs.reference import hbm_shooting

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
m = mb.examples.ladder_with_gap()
print(mb.modes(m))
top = m["B3,3"]
with style():
    picture, axes = figure()
    for force in (0.05, 0.2, 0.8):
        curve = mb.frequency_response(
            m, inputs=top.force("x"), amplitude=force, frequency=(2, 12), harmonics=list(range(1, 22, 2))
        )
        print(f"\n{force:g} N\n{curve.table('B3,3.motion.x')}")
        curve.plot("B3,3.motion.x", ax=axes, label=f"{force:g} N")
    axes.set_yscale("log")
    axes.set_title("dashed: unstable")
picture.savefig(folder / "ladder-gap.png")

rows = []
free = mb.harmonic_balance(m, inputs=top.force("x"), amplitude=0.05, frequency=2.0)
linear = mb.frf(mb.linearize(m), "B3,3.force.x", "B3,3.motion.x", frequency=[2.0]).value[0, 0, 0]
rows.append(
    ("0.05 N at 2 Hz, inside the gap", free.amplitude("B3,3.motion.x"), 0.05 * abs(linear), "transfer function")
)
system = mb.nonlinear_system(m)
for i in np.linspace(5, len(curve) - 5, 4).astype(int):
    one = curve.point(int(i))
    start = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
    state, _ = hbm_shooting.shoot(system, one.force, one.omega, start)
    source = f"shooting, relative to |x|; estimate {one.error:.0e}"
    rows.append((f"J1,1a(0) at {one.frequency:.4f} Hz", start[0], state[0], source, one.largest(0)))
one = curve.point(int(np.linspace(5, len(curve) - 5, 4)[1]))
found = one.verify(rtol=1e-8)
rows.append(
    (f"distance in a period at {one.frequency:.4f} Hz", found.balanced, 0.0, f"in time; estimate {one.error:.0e}")
)
rows.append((f"geometry at {one.frequency:.4f} Hz", found.full, 0.0, "full equations of the model, mb.simulate"))
print(error_table(rows))
print(f"pictures in {folder}")
