"""A Stewart platform with flexure joints, 14 bodies and five loops: modes, transfer function, sensitivities, and the
platform's motion after a half-sine push.

python examples/linear/stewart_platform.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.stewart_platform()
print(mb.System(m))
modes = mb.modes(m)
print(modes)

h = mb.frf(m, mb.base_motion("z"), "platform.motion.z", frequency=(1, 200), kind="transmissibility")
print(h)
s = mb.sensitivity(modes, ["k_strut", "c_strut", "platform.mass"])
print(s)


def push(t):
    """Half a sine of 10 ms, 100 N."""
    return np.where(t < 0.01, 100.0 * np.sin(np.pi * t / 0.01), 0.0)


outputs = [f"platform.motion.{axis}" for axis in ("x", "y", "z")]
y = mb.response(m, t=np.linspace(0.0, 0.6, 3001), loads={"platform.force.x": push}, outputs=outputs)
print(y)

h.plot().savefig(folder / "stewart-transmissibility.png")
y.plot().savefig(folder / "stewart-response.png")
s.plot().savefig(folder / "stewart-sensitivity.png")
modes.animate(folder / "stewart-modes.html")
print(f"\npictures in {folder}")
