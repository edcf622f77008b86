"""Natural lengths of two springs that keep point 2 of the five-bar where it is: an optimum with psi = 0 (docs/theory.md (23.12))."""

import sys
from pathlib import Path

import mbrs as mb
import numpy as np

m = mb.examples.five_bar()
r0 = np.array([0.5, -2.0, 0.0])
psi = mb.Integral(lambda s: np.sum((s.point("P2") - r0) ** 2))
lengths = ["spring1.length", "spring2.length"]
print(mb.gradient(m, psi, lengths, t=5.0, step=1e-2))
design = mb.problem(m, psi, lengths, t=5.0, step=1e-2, bounds={name: (1.0, 4.0) for name in lengths})
best = design.solve("SLSQP", options={"ftol": 1e-14})
print(best)  # 2.43192357, 1.84486889
best.plot().savefig((Path(sys.argv[1]) if len(sys.argv) > 1 else Path()) / "five-bar-convergence.png")
