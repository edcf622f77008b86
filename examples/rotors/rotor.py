"""An overhung disc: spinning splits its repeated modes into backward and forward whirl (Campbell diagram).

python examples/rotors/rotor.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
for speed in (0.0, 300.0):
    print(f"--- {speed:g} rad/s\n{mb.modes(mb.examples.rotor(speed=speed))}\n")

campbell = mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(0.0, 600.0, 61))
print(campbell)
campbell.plot().savefig(folder / "rotor-campbell.png")
print(f"\npicture in {folder}")
