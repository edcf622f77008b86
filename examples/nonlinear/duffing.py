"""Duffing's oscillator through both folds.

python examples/nonlinear/duffing.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
from mbrs.examples import error_table

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
duffing = mb.examples.duffing()
curve = mb.frequency_response(duffing, force=[0.18], omega=(0.5, 1.6), harmonics=7)
print(curve)
curve.plot().savefig(folder / "duffing-curve.png")
curve.plot_multipliers().savefig(folder / "duffing-multipliers.png")
peak = curve.peak()
print(f"\n{peak}\ndistance from the motion integrated in time: {peak.verify():.1e}")
peak.plot().savefig(folder / "duffing-harmonics.png")
peak.plot_orbit().savefig(folder / "duffing-orbit.png")

rows = []
for omega, known in ((0.5, 0.23850991), (0.8, 0.47487205), (0.9, 0.75793394), (1.0, 1.30534547), (1.5, 0.14391972)):
    one = mb.harmonic_balance(duffing, force=[0.18], omega=omega, harmonics=7)
    rows.append((f"|a1| at omega {omega}", one.amplitude(), known, "docs/theory.md (23.5)"))
for i, (event, known) in enumerate(zip(curve.events, (1.26960, 1.11570), strict=True), 1):
    rows.append((f"omega of fold {i}", event.omega, known, "docs/theory.md (23.5), 6 digits"))

# k3 = 1 and 0.3 cos(omega t): peak and folds by shooting are printed to ten digits
curve = mb.frequency_response(mb.examples.duffing(k3=1.0), force=[0.3], omega=(0.8, 3.0), harmonics=31)
peak = curve.peak(harmonic=None)
rows.append(("largest |x|, k3 = 1", peak.largest(), 2.5645599332, "docs/theory.md (23.6), shooting"))
rows.append(("omega of the peak, k3 = 1", peak.omega, 2.3993334635, "docs/theory.md (23.6), shooting"))
for i, (event, known) in enumerate(zip(curve.events, (2.3996492588, 1.3291743525), strict=True), 1):
    rows.append((f"omega of fold {i}, k3 = 1", event.omega, known, "docs/theory.md (23.6), shooting"))
print(error_table(rows))
print(f"pictures in {folder}")
