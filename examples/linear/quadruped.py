"""A standing four-legged robot, 13 bodies and 18 degrees of freedom: modes, transfer function, sensitivities.

python examples/linear/quadruped.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.quadruped()
print(mb.System(m))
modes = mb.modes(m)
print(modes)

ports = ["torso.force.z", "torso.motion.z"]
h = mb.frf(m, *ports, frequency=(0.1, 100))
print(h)
s = mb.sensitivity(modes, ["k_leg", "k_foot", "torso.mass", "knee-FL.at_a[1]"])
print(s)
dh = mb.sensitivity(h, ["k_leg", "torso.mass"])
print(dh)

h.plot().savefig(folder / "quadruped-transfer-function.png")
s.plot().savefig(folder / "quadruped-sensitivity.png")
modes.animate(folder / "quadruped-modes.html")
print(f"\npictures in {folder}")
