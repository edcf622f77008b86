"""
Six legs along the edges of a cube
==================================

The six frequencies of a cubic isolator are known in closed form. Claim: ``mb.modes`` finds them to twelve digits.
"""

import mbrs as mb
import numpy as np

m = mb.examples.cubic_hexapod(edge=0.2, k=1e5, c=30.0, mass=20.0, inertia=0.15)
modes = mb.modes(m)
print(modes)

# %%
# sqrt(2 k/m) three times, sqrt(k L^2/(2 I)) twice, sqrt(2 k L^2/I) once:

squares = [2e5 / 20] * 3 + [1e5 * 0.04 / 0.3] * 2 + [2e5 * 0.04 / 0.15]
exact = np.sqrt(squares) / (2 * np.pi)
assert np.max(np.abs(modes.frequency / exact - 1)) < 1e-12

# %%
# How much of the motion of the base reaches the payload:

h = mb.frf(m, mb.base_motion("z"), "payload.motion.z", frequency=(1, 200), kind="transmissibility")
picture = h.plot()
