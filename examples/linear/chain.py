"""Chains of ten bodies with the joints of the source (R, P, C, S) and with springs alone: degrees of freedom and modes.

python examples/linear/chain.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
print("joint        dof  lowest frequencies [Hz]")
for joint in ("revolute", "prismatic", "cylindrical", "spherical", None):
    modes = mb.modes(mb.examples.chain(10, joint=joint))
    lowest = "  ".join(f"{f:10.6f}" for f in modes.frequency[:4])
    print(f"{joint or 'springs only':12} {len(modes.coordinates):3d}  {lowest}   {modes.stats.route}")

# The source's chain runs along the axes of its hinges and twists; across them it bends.
twist, bend = (mb.modes(mb.examples.chain(10, along=axis)).frequency for axis in ("z", "x"))
print(f"\nchain of ten hinges, first mode: along the hinges {twist[0]:.6f} Hz, across them {bend[0]:.6f} Hz")

# Together the spring-dampers of a joint have the coefficients of one: their number changes the work, not the answer.
one, three = (mb.modes(mb.examples.chain(10, springs=s)).frequency for s in (1, 3))
print(f"\nthree spring-dampers per joint instead of one move the frequencies by {abs(three / one - 1).max():.1e}\n")

modes = mb.modes(mb.examples.chain(10))
print(modes)
modes.plot().savefig(folder / "chain-modes.png")
modes.animate(folder / "chain-modes.html")
print(f"\npictures in {folder}")
