"""
A model as text
===============

A model is saved as TOML that a person can read, and comes back. Claim: the modes of the file are those of the model,
digit by digit.
"""

import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

m = mb.examples.stewart_platform()
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder, "platform.toml")
    m.save(path)
    print(path.read_text()[:600])
    again = mb.Model.load(path)
modes = mb.modes(m)
assert np.allclose(mb.modes(again).frequency, modes.frequency, rtol=1e-10)
picture = modes.plot()
