"""Duffing's oscillator under two forces whose frequencies have the ratio sqrt(2).

python examples/nonlinear/quasi_periodic.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
from mbrs.examples import error_table

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
PRINTED = {  # docs/theory.md (23.9), (cos, sin) for m = 7
    2.0: {(1, 0): (-0.0055712601, -0.0832608775), (0, 1): (-0.0014475824, -0.0357439837),
          (2, -1): (-0.0003014939, -0.0006886006)},
    1.5: {(1, 0): (-0.0261221620, -0.2067112787), (0, 1): (-0.0045260166, -0.0731946175),
          (2, -1): (-0.0006733389, 0.0102917316)},
}  # fmt: skip
rows = []
for eta, printed in PRINTED.items():
    system, forces = mb.examples.two_tone_duffing(eta)
    found = mb.quasi_periodic(system, forces, harmonics=7)
    for index, pair in printed.items():
        value = found.coefficient(0, index)
        for name, ours, theirs in (("cos", value.real, pair[0]), ("sin", -value.imag, pair[1])):
            rows.append((f"eta = {eta:g}, k = {index}, {name}", ours, theirs, "docs/theory.md (23.9)"))
print(found)
fine = mb.quasi_periodic(system, forces, harmonics=13, x0=found)
print(f"\nm = 7: distance from integration in time {found.verify():.1e}, estimate {found.error:.1e}")
print(f"m = 13: distance from integration in time {fine.verify(rtol=1e-12):.1e}, estimate {fine.error:.1e}")
found.plot().savefig(folder / "quasi-periodic-spectrum.png")
found.plot_orbit().savefig(folder / "quasi-periodic-motion.png")
branch = mb.quasi_periodic_response(system, forces, scale=(1.2, 0.55), harmonics=9)
print(f"\n{branch}")
branch.plot().savefig(folder / "quasi-periodic-branch.png")
print(error_table(rows))
print(f"pictures in {folder}")
