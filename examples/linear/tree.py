"""The binary tree TL7SF1: seven layers, spherical joints, one spring-damper at each; around its twelve lowest modes the
transfer function from a force in x at B6,1 to the motion in y of B6,32, the first and the last body of layer 6.

Geometry after Jiang, Chen and Luo (2011); masses and coefficients are lost there and invented here.

python examples/linear/tree.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.from_code("TL7SF1")
modes = mb.modes(m, n=12)
print(modes)

h = mb.frf(m, inputs=m["B6,1"].force("x"), outputs=m["B6,32"].motion("y"), frequency=(0.008, 0.012))
print()
print(h)
h.plot().savefig(folder / "tree-transfer-function.png")
print(f"\npicture in {folder}")
