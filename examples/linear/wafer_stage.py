"""A wafer stage on air mounts: how much of the floor's motion reaches the wafer, and which number matters.

python examples/linear/wafer_stage.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.wafer_stage()
modes = mb.modes(m)
print(modes)

floor = [mb.base_motion(axis) for axis in ("x", "z")]
wafer = [f"wafer.motion.{axis}" for axis in ("x", "z")]
h = mb.frf(m, floor, wafer, frequency=(0.5, 500), kind="transmissibility")
print(h)
s = mb.sensitivity(modes, ["k_mount", "base.mass", "y guide.k", "flexures.k[2]"])
print(s)

h.plot().savefig(folder / "wafer-stage-transmissibility.png")
s.plot().savefig(folder / "wafer-stage-sensitivity.png")
modes.animate(folder / "wafer-stage-modes.html")
print(f"\npictures in {folder}")
