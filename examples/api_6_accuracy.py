"""What accuracy costs, and which effects matter, on one page: a four-bar and a Duffing oscillator. Writes accuracy.png."""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
m, duffing = mb.examples.four_bar(), mb.examples.duffing()

study = mb.accuracy_study(mb.simulate, m, t=0.5, method=["generalized-alpha", "bdf", "bdf-bfgs"], rtol=10.0 ** -np.arange(3, 8))
study.plot().savefig(folder / "accuracy.png"); print(study); print(study.recommend(error=1e-5))        # measured error against measured time, one line per method
curves = mb.accuracy_study(mb.frequency_response, duffing, force=[0.18], omega=(0.5, 1.6), harmonics=[1, 3, 5, 7, 9, 15])
print(mb.effect_study(mb.modes, m))                            # each effect off in turn: change of the result, time saved
print(curves)
