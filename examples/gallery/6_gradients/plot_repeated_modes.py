"""
Modes that coincide
===================

The cubic isolator has three equal frequencies. A leg that softens splits them, and no single mode has a derivative;
the group has a matrix. Claim: the eigenvalues of this matrix are the slopes of the three curves.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

m = mb.Model("isolator")
p = m.body("payload", mass=20.0, inertia=(0.15, 0.15, 0.15), at=(0, 0, 0.1))
for i, (a, b) in enumerate(mb.examples.cubic_hexapod_points(edge=0.2, centre=(0, 0, 0.1))):
    m.spring_damper(f"leg{i}", m.ground, p, at=(a, b), k=1e5)
modes = mb.modes(m)
s = mb.sensitivity(modes, ["leg0.k"])
print(modes.groups)

change = np.linspace(0.0, 0.2, 401)
curves = []
for part in change:
    softer = m.copy()
    softer.set({"leg0.k": 1e5 * (1 - part)})
    curves.append(mb.modes(softer).frequency[:3])
curves = np.array(curves)
slopes = np.sort((curves[1] - curves[0]) / (-1e5 * change[1]))
exact = np.sort(np.abs(s.frequency[:3, 0]))
print("slopes of the curves", slopes, "derivatives", exact)
assert np.allclose(slopes, exact, atol=1e-3 * exact.max())
plt.plot(100 * change, curves, label=["mode 1", "mode 2", "mode 3"])
plt.legend()
plt.xlabel("leg 0 softer by [%]")
picture = plt.ylabel("frequency [Hz]")
