"""Ladders of three layers: loops whose constraints depend on each other, found and named.

python examples/loops/ladder.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
for joint in ("revolute", "cylindrical", "spherical"):
    m = mb.examples.ladder(3, joint=joint)
    modes = mb.modes(m)
    print(f"--- {joint}\n{mb.System(m)}")
    print("lowest frequencies [Hz]:", "  ".join(f"{f:.6g}" for f in modes.frequency[:6]), "\n")

modes = mb.modes(mb.examples.ladder(3))
print(modes)
modes.plot().savefig(folder / "ladder-modes.png")
modes.animate(folder / "ladder-modes.html")
print(f"\npictures in {folder}")
